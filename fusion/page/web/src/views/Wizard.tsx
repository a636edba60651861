// Look, run, judge, use: the court's lines become a rig.
import { signal } from "@preact/signals";
import { act, address, send } from "../api";
import type { Job } from "../contract";
import { Doing } from "../parts/Buttons";
import { job } from "../store";
import { t } from "../words";
import { CAMERAS, lookBoth, views } from "./Cameras";

const focal = signal("");
const startedId = signal<number | null>(null);
const used = signal<string | null>(null);

export const isCalibration = (one: Job | null): boolean =>
  one !== null && (one.id === startedId.value || one.kind.startsWith("calib") || one.kind === "court");

export function Wizard() {
  const running = job.value;
  const mine = running !== null && isCalibration(running) ? running : null;
  const hasPictures = CAMERAS.every((camera) => views.value[camera] !== undefined);
  const step = used.value ? 4 : mine ? (mine.state === "done" ? 3 : 2) : hasPictures ? 2 : 1;
  const start = async () => {
    used.value = null;
    const px = Number.parseFloat(focal.value);
    const order = { kind: "court", focal_px: Number.isFinite(px) && px > 0 ? px : null };
    const made = await act(() => send<Job>("POST", "/setup/calibrations", order));
    if (!made) return;
    startedId.value = made.id;
    // The line may have told a later state already.
    if (job.value?.id !== made.id) job.value = made;
  };
  const use = async () => {
    if (!mine) return;
    const answer = await act(() =>
      send<{ sentence: string }>("POST", `/setup/calibrations/${mine.id}/use`),
    );
    if (answer) used.value = answer.sentence;
  };
  return (
    <section class="panel wizard" aria-label={t("wizard.title")}>
      <h2>{t("wizard.title")}</h2>
      <ol class="steps">
        {(["look", "run", "judge", "use"] as const).map((name, i) => (
          <li key={name} aria-current={step === i + 1 ? "step" : undefined}
            class={step > i + 1 ? "past" : ""}>
            {t(`wizard.${name}`)}
          </li>
        ))}
      </ol>
      <p>{t("wizard.about")}</p>
      <div class="bar">
        <Doing do={lookBoth}>{t("wizard.doLook")}</Doing>
        <label class="field">
          {t("wizard.focal")}
          <span class="with-unit">
            <input type="number" min={100} max={20000} step={1} inputMode="numeric"
              placeholder={t("wizard.focalRig")} value={focal.value}
              onInput={(event) => (focal.value = event.currentTarget.value)} />
            <span class="unit">px</span>
          </span>
        </label>
        <Doing class="primary" do={start} disabled={mine?.state === "running"}>
          {t(mine ? "wizard.again" : "wizard.doRun")}
        </Doing>
      </div>
      <div aria-live="polite">{mine && <State job={mine} />}</div>
      {mine?.state === "done" && (
        <>
          <img class="found" src={`${address(`/setup/calibrations/${mine.id}/found.png`)}?t=${mine.at_ms}`}
            alt={t("wizard.found")} />
          <div class="bar">
            <Doing class="primary" do={use} disabled={used.value !== null}>{t("wizard.doUse")}</Doing>
            <a class="button" href={address(`/setup/calibrations/${mine.id}/rig.toml`)} download>
              rig.toml
            </a>
          </div>
        </>
      )}
      {used.value && <p class="aim good" role="status" lang="en">{used.value}</p>}
    </section>
  );
}

export function State(props: { job: Job }) {
  const { job } = props;
  return (
    <div class="job" data-state={job.state}>
      {job.state === "running" && (
        <>
          <p>{t("job.running", { part: Math.round(100 * job.progress) })}</p>
          <progress max={1} value={job.progress} aria-label={t("job.progress")} />
        </>
      )}
      {job.state === "failed" && (
        <p class="aim wrong">
          <strong>{t("job.failed")}</strong> <span lang="en">{job.verdict ?? job.lines.at(-1)}</span>
        </p>
      )}
      {job.state === "done" && job.verdict && (
        <p class="verdict" lang="en">{job.verdict}</p>
      )}
      {job.lines.length > 0 && (
        <details>
          <summary>{t("job.lines")}</summary>
          <pre tabIndex={0}>{job.lines.join("\n")}</pre>
        </details>
      )}
    </div>
  );
}

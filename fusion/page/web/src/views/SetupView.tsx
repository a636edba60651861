import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { act, address, fetchFile, saveBlob, send } from "../api";
import type { CameraName, Job } from "../contract";
import { Doing, Health } from "../parts/Buttons";
import { sizeText } from "../pure/units";
import { job, status, watch } from "../store";
import { dayText, named, t } from "../words";
import { CAMERAS, Cameras } from "./Cameras";
import { GroundTruth } from "./GroundTruth";
import { State, Wizard, isCalibration } from "./Wizard";
import { loadRecordings, recordings } from "./recordings";

export function SetupView() {
  return (
    <div class="view">
      <h1>{t("tab.setup")}</h1>
      <Condition />
      <Cameras />
      <Wizard />
      <div class="columns even">
        <Pairing />
        <Recordings />
      </div>
      <GroundTruth />
      <Files />
    </div>
  );
}

function Condition() {
  const known = status.value;
  return (
    <section class="panel">
      <h2>{t("health.title")}</h2>
      <Health />
      <p class={watch.value ? "warning" : "quiet-text"} lang={watch.value ? "en" : undefined}>
        {watch.value?.sentence ?? t("health.noTurn")}
      </p>
      {known && (
        <div class="scroll" tabIndex={0} role="region" aria-label={t("health.title")}>
          <table>
            <thead>
              <tr>
                <th scope="col">{t("health.camera")}</th>
                <th scope="col">{t("health.state")}</th>
                <th scope="col" class="number">{t("health.rate")}</th>
                <th scope="col" class="number">{t("health.candidates")}</th>
                <th scope="col" class="number">{t("health.clock")}</th>
                <th scope="col" class="number">{t("health.lost")}</th>
              </tr>
            </thead>
            <tbody>
              {known.boards.map((board) => (
                <tr key={board.camera}>
                  <th scope="row">{t(`camera.${board.camera}`)}</th>
                  <td>{named("board", board.state)}</td>
                  <td class="number">{board.frames_s?.toFixed(1) ?? "–"}</td>
                  <td class="number">{board.candidates_s?.toFixed(0) ?? "–"}</td>
                  <td class="number">
                    {board.clock_sigma_ms === null ? "–" : `± ${board.clock_sigma_ms.toFixed(2)} ms`}
                  </td>
                  <td class="number">{board.n_lost} / {board.n_batches}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
    </section>
  );
}

function Pairing() {
  const pair = async (camera: CameraName) => {
    const answer = await act(() => send<{ file: string }>("POST", "/setup/pair", { camera }));
    if (!answer) return;
    const path = `/setup/pair/${encodeURIComponent(answer.file)}`;
    const file = await act(() => fetchFile(path));
    if (file) saveBlob(file, answer.file);
  };
  return (
    <section class="panel">
      <h2>{t("pair.title")}</h2>
      <p>{t("pair.about")}</p>
      <div class="bar">
        {CAMERAS.map((camera) => (
          <Doing key={camera} do={() => pair(camera)}>{t(`pair.${camera}`)}</Doing>
        ))}
      </div>
      <p class="quiet-text"><code>tennis-pair take {status.value?.court ?? "…"}-left.pair</code></p>
    </section>
  );
}

const seconds = signal(10);

function Recordings() {
  const now = job.value;
  const mine: Job | null = isCalibration(now) ? null : now;
  useEffect(() => void loadRecordings(), [mine?.state]);
  const record = async () => {
    const made = await act(() =>
      send<Job>("POST", "/setup/recordings", { seconds: seconds.value }),
    );
    if (made && job.value?.id !== made.id) job.value = made;
  };
  return (
    <section class="panel">
      <h2>{t("record.title")}</h2>
      <div class="bar">
        <label class="field short">
          {t("record.seconds")}
          <span class="with-unit">
            <input type="number" min={1} max={600} step={1} value={seconds.value}
              onInput={(event) => {
                const value = event.currentTarget.valueAsNumber;
                if (value >= 1 && value <= 600) seconds.value = value;
              }} />
            <span class="unit">s</span>
          </span>
        </label>
        <Doing class="end" do={record} disabled={mine?.state === "running"}>{t("record.start")}</Doing>
      </div>
      {mine && <State job={mine} />}
      {recordings.value.length === 0 ? (
        <p class="quiet-text">{t("record.none")}</p>
      ) : (
        <ul class="files-list">
          {recordings.value.map((one) => (
            <li key={one.name}>
              <a href={address(`/setup/recordings/${encodeURIComponent(one.name)}`)} download>
                {one.name}
              </a>
              <span class="quiet-text">{sizeText(one.bytes)} · {dayText(one.at_ms)}</span>
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

function Files() {
  const logs = async () => {
    const file = await act(() => fetchFile("/logs.txt"));
    if (file) saveBlob(file, `${status.value?.court ?? "court"}-logs.txt`);
  };
  return (
    <section class="panel">
      <h2>{t("files.title")}</h2>
      <div class="bar">
        <Doing do={logs}>{t("files.logs")}</Doing>
        <a class="button" href={address("/openapi.json")}>{t("files.api")}</a>
      </div>
    </section>
  );
}

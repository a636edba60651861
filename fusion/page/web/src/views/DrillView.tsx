import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { act, send } from "../api";
import type { DrillState, ShotRow } from "../contract";
import { Doing, StopButton, isStopped } from "../parts/Buttons";
import { isInZone, landingText } from "../parts/Numbers";
import { language } from "../settings";
import { drill, rows, status } from "../store";
import { named, t, timeText } from "../words";
import {
  MAX_TARGETS, addTarget, begin, change, draft, drills, isDirty, loadDrills, open, remove, save,
  targetIdx,
} from "./draft";
import { TargetBoard } from "./TargetBoard";
import { TargetForm } from "./TargetForm";

const ORDERS = ["in turn", "random"];
const isCorrecting = signal(true);
const balls = signal("");

export function DrillView() {
  useEffect(() => void loadDrills(), []);
  // On a phone what matters now comes first; on a desk both stand beside each other.
  const running = drill.value?.running ?? false;
  return (
    <div class="drill-page">
      <div class="view drill">
      <h1>{t("tab.drill")}</h1>
      {isStopped() && <p class="warning strong">{t("stop.isStopped")}</p>}
      <div class="drill-grid">
        <Run />
        {running ? [<Said key="said" />, <Editor key="editor" />] : [<Editor key="editor" />, <Said key="said" />]}
      </div>
      </div>
      <StopButton />
    </div>
  );
}

function Run() {
  const state = drill.value;
  const running = state?.running ?? false;
  const correcting = running ? (state?.is_correcting ?? false) : isCorrecting.value;
  const start = async () => {
    const now = draft.value;
    if (!now) return;
    if (isDirty.value && !(await save())) return;
    const n = Number.parseInt(balls.value, 10);
    const order = {
      name: now.name,
      is_correcting: isCorrecting.value,
      balls: Number.isInteger(n) && n > 0 ? n : null,
    };
    const news = await act(() => send<DrillState>("POST", "/drill/start", order));
    if (news) drill.value = news;
  };
  const stop = async () => {
    const news = await act(() => send<DrillState>("POST", "/drill/stop"));
    if (news) drill.value = news;
  };
  const correct = async (event: Event) => {
    const box = event.currentTarget as HTMLInputElement;
    const is_correcting = box.checked;
    if (!running) {
      isCorrecting.value = is_correcting;
      return;
    }
    const news = await act(() => send<DrillState>("POST", "/drill/correcting", { is_correcting }));
    if (news) drill.value = news;
    else box.checked = !is_correcting;
  };
  return (
    <section class={`panel run ${running ? "running" : ""}`} aria-label={t("drill.run")}>
      {running && state ? (
        <Progress state={state} />
      ) : (
        <p class="headline small">{state?.name ? t("drill.idleAfter", { name: state.name }) : t("drill.idle")}</p>
      )}
      {!running && <Which />}
      {state?.said && <p class="said" lang={language.value === "en" ? undefined : "en"}>{state.said}</p>}
      <div class="bar">
        <label class="switch">
          <input type="checkbox" role="switch" checked={correcting} onChange={correct} />
          <span>{t("drill.correcting")}</span>
        </label>
        {!running && (
          <label class="field short">
            {t("drill.balls")}
            <input
              type="number" min={1} max={10000} step={1} inputMode="numeric"
              placeholder={t("drill.endless")}
              value={balls.value}
              onInput={(event) => (balls.value = event.currentTarget.value)}
            />
          </label>
        )}
      </div>
      {running ? (
        <Doing class="primary" do={stop}>{t("drill.stop")}</Doing>
      ) : (
        <Doing class="primary" do={start} disabled={draft.value === null}>
          {draft.value ? t("drill.start", { name: draft.value.name }) : t("drill.startNone")}
        </Doing>
      )}
      {status.value?.machine === null && <p class="quiet-text">{t("drill.noMachine")}</p>}
    </section>
  );
}

function Which() {
  const now = draft.value;
  const pick = (event: Event) => {
    const { value } = event.currentTarget as HTMLSelectElement;
    const found = drills.value.find((one) => one.name === value);
    if (found) open(found);
  };
  const is_known = drills.value.some((one) => one.name === now?.name);
  return (
    <label class="field">
      {t("drill.which")}
      <select value={now?.name ?? ""} onChange={pick}>
        {now && !is_known && <option value={now.name}>{now.name}</option>}
        {drills.value.map((one) => <option key={one.name}>{one.name}</option>)}
      </select>
    </label>
  );
}

function Progress(props: { state: DrillState }) {
  const { state } = props;
  return (
    <div aria-live="polite">
      <p class="over">{t("drill.running", { name: state.name ?? "" })}</p>
      <p class="headline small">{state.target?.name ?? "…"}</p>
      <p class="under">
        {state.balls === null
          ? t("drill.ball", { n: state.ball })
          : t("drill.ballOf", { n: state.ball, all: state.balls })}
      </p>
      {state.balls !== null && (
        <progress max={state.balls} value={state.ball} aria-label={t("drill.progress")} />
      )}
    </div>
  );
}

const SAID = 30;

/** What was changed and why: a sentence for each ball, newest first. */
function Said() {
  const told = rows.value.filter((row) => row.sentence !== null).slice(0, SAID);
  return (
    <section class="panel why">
      <h2>{t("drill.why")}</h2>
      {told.length === 0 ? (
        <p class="quiet-text">{t("drill.whyNone")}</p>
      ) : (
        <ol class="told" lang={language.value === "en" ? undefined : "en"} tabIndex={0} aria-label={t("drill.why")}>
          {told.map((row) => <Told key={row.id} row={row} />)}
        </ol>
      )}
    </section>
  );
}

function Told(props: { row: ShotRow }) {
  const { row } = props;
  const is_in = isInZone(row);
  return (
    <li>
      <span class={`dot ${is_in === null ? "none" : is_in ? "in" : "out"}`} aria-hidden="true" />
      <div>
        <p class="over" lang={language.value}>
          {timeText(row.at_ms)} · {landingText(row)}
        </p>
        <p>{row.sentence}</p>
      </div>
    </li>
  );
}

function Editor() {
  const now = draft.value;
  const is_known = drills.value.some((one) => one.name === now?.name);
  return (
    <section class="panel editor" aria-label={t("drill.editor")}>
      <div class="bar head">
        <h2>{now ? t("drill.targetsOf", { name: now.name }) : t("drill.editor")}</h2>
        <span class="gap" />
        <button type="button" class="quiet" onClick={begin}>{t("drill.new")}</button>
      </div>
      {now && (
        <>
          <TargetBoard />
          <p class="quiet-text">{t("drill.how")}</p>
          <div class="chips" role="group" aria-label={t("drill.targets")}>
            {now.targets.map((one, idx) => (
              <button
                key={idx} type="button" aria-pressed={idx === targetIdx.value}
                onClick={() => (targetIdx.value = idx)}
              >
                {one.name}
              </button>
            ))}
            <button
              type="button" class="quiet" disabled={now.targets.length >= MAX_TARGETS}
              onClick={() => addTarget([0, 18])}
            >
              + {t("drill.addTarget")}
            </button>
          </div>
          <TargetForm />
          <div class="bar">
            <label class="field">
              {t("drill.name")}
              <input type="text" maxLength={60} value={now.name}
                onInput={(event) => change({ name: event.currentTarget.value })} />
            </label>
            <label class="field">
              {t("drill.order")}
              <select value={now.order}
                onChange={(event) => change({ order: event.currentTarget.value })}>
                {[...new Set([...ORDERS, now.order])].map((one) => (
                  <option key={one} value={one}>{named("order", one)}</option>
                ))}
              </select>
            </label>
            <label class="field short">
              {t("drill.period")}
              <input type="number" min={1} max={60} step={0.5} value={now.period_s}
                onInput={(event) => {
                  const value = event.currentTarget.valueAsNumber;
                  if (value >= 1 && value <= 60) change({ period_s: value });
                }} />
            </label>
          </div>
          <div class="bar">
            <Doing class="primary" do={save} disabled={!isDirty.value}>{t("drill.save")}</Doing>
            <Doing do={remove} disabled={!is_known}>{t("drill.delete")}</Doing>
          </div>
        </>
      )}
    </section>
  );
}

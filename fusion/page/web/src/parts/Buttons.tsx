// Small things that every view uses.
import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { act, note, send } from "../api";
import { status } from "../store";
import { named, t } from "../words";

/** A button that is busy while its work goes on. */
export function Doing(props: {
  do: () => Promise<unknown>;
  class?: string;
  disabled?: boolean;
  children: ComponentChildren;
}) {
  const [isBusy, setBusy] = useState(false);
  const start = async () => {
    if (isBusy) return;
    setBusy(true);
    try {
      await props.do();
    } finally {
      setBusy(false);
    }
  };
  return (
    <button
      type="button"
      class={props.class ?? ""}
      disabled={props.disabled ?? false}
      aria-busy={isBusy}
      onClick={() => void start()}
    >
      {props.children}
    </button>
  );
}

export const isStopped = () => status.value?.machine?.state === "stopped";

/** Never hidden, never disabled: a stop that cannot be pressed is none. */
export function StopButton() {
  const stop = async () => {
    const done = await act(() => send("POST", "/machine/stop"));
    if (done) note("good", t("stop.sent"));
  };
  const resume = () => act(() => send("POST", "/machine/resume"));
  return (
    <div class="stop-bar">
      <Doing class="stop" do={stop}>
        <svg viewBox="0 0 24 24" width="26" height="26" aria-hidden="true">
          <path d="M8 2h8l6 6v8l-6 6H8l-6-6V8z" fill="currentColor" />
        </svg>
        {t("stop.stop")}
      </Doing>
      {isStopped() && (
        <Doing class="resume" do={resume}>
          {t("stop.resume")}
        </Doing>
      )}
    </div>
  );
}

export function Chip(props: { kind: "good" | "wrong" | "quiet"; name: string; text: string }) {
  return (
    <li class={`chip ${props.kind}`}>
      <i aria-hidden="true" />
      <span class="chip-name">{props.name}</span> <span class="chip-text">{props.text}</span>
    </li>
  );
}

/** Cameras, measuring and machine in a row: a word and a shape each, not a colour alone. */
export function Health() {
  const known = status.value;
  if (!known) return null;
  return (
    <ul class="health" aria-label={t("health.title")}>
      {known.boards.map((board) => (
        <Chip
          key={board.camera}
          kind={board.state === "alive" ? "good" : board.state === "silent" ? "wrong" : "quiet"}
          name={t(`camera.${board.camera}`)}
          text={
            board.state === "alive" && board.frames_s !== null
              ? t("health.frames", { n: board.frames_s.toFixed(0) })
              : named("board", board.state)
          }
        />
      ))}
      <Chip
        kind={known.fusion === "alive" ? "good" : "wrong"}
        name={t("health.fusion")}
        text={named("fusion", known.fusion)}
      />
      <Chip
        kind={machineKind(known.machine?.state ?? null)}
        name={t("health.machine")}
        text={known.machine ? named("machine", known.machine.state) : t("machine.none")}
      />
    </ul>
  );
}

function machineKind(state: string | null): "good" | "wrong" | "quiet" {
  if (state === null) return "quiet";
  return ["stopped", "jammed", "empty", "refused", "silent"].includes(state) ? "wrong" : "good";
}

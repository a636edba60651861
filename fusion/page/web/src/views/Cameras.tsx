// Both pictures with what is known of them drawn over, and what focus and light are like.
import { signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { Refusal, act, address, get, send } from "../api";
import type { CameraName, CameraView } from "../contract";
import { Doing } from "../parts/Buttons";
import { t, timeText } from "../words";

export const CAMERAS: readonly CameraName[] = ["left", "right"];
export const views = signal<Partial<Record<CameraName, CameraView>>>({});
const missing = signal<Partial<Record<CameraName, string>>>({});
const best = signal<Record<CameraName, number>>({ left: 0, right: 0 });

/** While somebody turns a lens; nobody turns for longer, and the board's link is not to be filled. */
const KEEP_LOOKING_MS = 1500;
const KEEP_LOOKING_MAX = 200;

function take(view: CameraView): void {
  views.value = { ...views.value, [view.camera]: view };
  missing.value = { ...missing.value, [view.camera]: undefined };
  const before = best.value[view.camera];
  if (view.sharpness > before) best.value = { ...best.value, [view.camera]: view.sharpness };
}

async function loadView(camera: CameraName): Promise<void> {
  try {
    take(await get<CameraView>(`/cameras/${camera}/view`));
  } catch (error) {
    if (error instanceof Refusal) missing.value = { ...missing.value, [camera]: error.message };
  }
}

export async function look(camera: CameraName): Promise<boolean> {
  const view = await act(() => send<CameraView>("POST", `/cameras/${camera}/look`));
  if (view) take(view);
  return view !== null;
}

export async function lookBoth(): Promise<boolean> {
  return (await look("left")) && (await look("right"));
}

export function Cameras() {
  const [isLooking, setLooking] = useState(false);
  useEffect(() => {
    for (const camera of CAMERAS) void loadView(camera);
  }, []);
  useEffect(() => {
    if (!isLooking) return;
    let is_over = false;
    const turn = async () => {
      for (let n = 0; n < KEEP_LOOKING_MAX && !is_over; n++) {
        if (!(await lookBoth())) break;
        await new Promise((resolve) => setTimeout(resolve, KEEP_LOOKING_MS));
      }
      if (!is_over) setLooking(false);
    };
    void turn();
    return () => {
      is_over = true;
    };
  }, [isLooking]);
  return (
    <section class="panel">
      <div class="bar head">
        <h2>{t("setup.cameras")}</h2>
        <span class="gap" />
        <label class="switch">
          <input type="checkbox" role="switch" checked={isLooking}
            onChange={(event) => setLooking(event.currentTarget.checked)} />
          <span>{t("setup.keepLooking")}</span>
        </label>
        <Doing do={lookBoth}>{t("setup.look")}</Doing>
      </div>
      <div class="pair">
        {CAMERAS.map((camera) => <Camera key={camera} camera={camera} />)}
      </div>
      <p class="quiet-text">{t("setup.overlay")}</p>
    </section>
  );
}

function Camera(props: { camera: CameraName }) {
  const { camera } = props;
  const view = views.value[camera];
  return (
    <div class="camera">
      <h3>{t(`camera.${camera}`)}</h3>
      {view ? (
        <>
          <Picture view={view} />
          <Focus view={view} />
          <Light view={view} />
          <p class="quiet-text">{t("setup.taken", { time: timeText(view.at_ms) })}</p>
        </>
      ) : (
        <div class="no-picture">
          <p>{missing.value[camera] ?? t("setup.noPicture")}</p>
        </div>
      )}
    </div>
  );
}

function Picture(props: { view: CameraView }) {
  const { view } = props;
  const [w, h] = view.image_px;
  const r = w / 90;
  return (
    <div class="overlaid" style={{ aspectRatio: `${w} / ${h}` }}>
      <img
        src={`${address(`/cameras/${view.camera}/picture.png`)}?t=${view.at_ms}`}
        width={w}
        height={h}
        alt={t("setup.pictureOf", { camera: t(`camera.${view.camera}`) })}
      />
      <svg viewBox={`-0.5 -0.5 ${w} ${h}`} aria-hidden="true">
        {view.lines_px.map((line, i) => (
          <polyline key={i} class="court-line" points={line.map((p) => p.join(",")).join(" ")} />
        ))}
        {view.candidates_px.map(({ at_px: [x, y] }, i) => (
          <path key={i} class="cross" d={`M${x - r} ${y - r}l${2 * r} ${2 * r}m0 ${-2 * r}l${-2 * r} ${2 * r}`} />
        ))}
      </svg>
    </div>
  );
}

function Focus(props: { view: CameraView }) {
  const { view } = props;
  const top = Math.max(best.value[view.camera], view.sharpness, 1e-9);
  const part = view.sharpness / top;
  const forget = () => {
    best.value = { ...best.value, [view.camera]: view.sharpness };
  };
  return (
    <div class="gauge">
      <div class="bar">
        <span>
          {t("setup.focus")} <strong>{view.sharpness.toFixed(2)}</strong>{" "}
          <span class="quiet-text">{t("setup.best", { best: top.toFixed(2) })}</span>
        </span>
        <span class="gap" />
        <button type="button" class="quiet" onClick={forget}>{t("setup.forget")}</button>
      </div>
      <meter min={0} max={1} value={part} aria-label={t("setup.focus")} />
    </div>
  );
}

function lightWord(view: CameraView): "bright" | "dark" | "right" {
  if (view.saturated_part > 0.01 || view.median_level > 200) return "bright";
  if (view.dark_part > 0.5 || view.median_level < 35) return "dark";
  return "right";
}

function Light(props: { view: CameraView }) {
  const { view } = props;
  const word = lightWord(view);
  return (
    <div class="gauge">
      <p>
        {t("setup.light")} <strong>{t(`setup.light.${word}`)}</strong>{" "}
        <span class="quiet-text">
          {t("setup.levels", {
            median: view.median_level.toFixed(0),
            white: (100 * view.saturated_part).toFixed(1),
            black: (100 * view.dark_part).toFixed(1),
          })}
        </span>
      </p>
      <meter min={0} max={255} low={35} high={200} optimum={110} value={view.median_level}
        aria-label={t("setup.light")} />
    </div>
  );
}

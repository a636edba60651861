// The picture of the last ball: in three dimensions where the browser can, else from two sides.
import { signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import { CourtMap, EllipseMark, WHOLE, at } from "../plots/CourtMap";
import { SideView, abovePath } from "../plots/SideView";
import { ellipse95 } from "../pure/ellipse";
import { drawnFrom } from "../pure/trajectory";
import type { Place, Scene } from "../scene/scene";
import type { Palette } from "../scene/meshes";
import { isDark, prefersStill } from "../settings";
import { court, flights, shown, shownBall } from "../store";
import { t } from "../words";

const PLACES: readonly Place[] = ["behind", "above", "side", "landing"];
const place = signal<Place>("behind");

function palette(): Palette {
  const style = getComputedStyle(document.documentElement);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  return {
    air: colour("--court-air"),
    around: colour("--court-around"),
    outside: colour("--court-outside"),
    inside: colour("--court-inside"),
    line: colour("--court-line"),
    ball: colour("--court-ball"),
    old: colour("--court-old"),
    reference: colour("--court-reference"),
    target: colour("--court-target"),
    net: colour("--court-net"),
    machine: colour("--court-machine"),
    shadow: colour("--court-shadow"),
  };
}

function hasWebGl(): boolean {
  try {
    return document.createElement("canvas").getContext("webgl2") !== null;
  } catch {
    return false;
  }
}

const canDraw = hasWebGl();

export function Stage() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const scene = useRef<Scene | null>(null);
  const [isReady, setReady] = useState(false);
  const known = court.value;
  useEffect(() => {
    if (!canDraw || !known) return;
    let is_gone = false;
    // A chunk of its own, after the first view.
    void import("../scene/scene").then(({ Scene }) => {
      const place_of = canvas.current;
      if (is_gone || !place_of) return;
      try {
        scene.current = new Scene(place_of, known, palette(), prefersStill);
        scene.current.look(place.value, false);
        setReady(true);
      } catch {
        // The drawing from above and from the side stays.
      }
    });
    return () => {
      is_gone = true;
      scene.current?.dispose();
      scene.current = null;
      setReady(false);
    };
  }, [known?.name]);
  const ball = shownBall.value;
  const target = shown.value?.target ?? null;
  const all = flights.value;
  useEffect(() => {
    const others = all.filter((one) => one.id !== ball?.id && (!ball || one.id < ball.id));
    scene.current?.show({ ball, others, target });
  }, [ball, all, target, isReady]);
  const dark = isDark.value;
  useEffect(() => scene.current?.paint(palette()), [dark]);
  const look = (to: Place) => {
    place.value = to;
    scene.current?.look(to);
  };
  const places = isReady ? PLACES : PLACES.filter((one) => one === "above" || one === "side");
  const chosen = isReady || places.includes(place.value) ? place.value : "above";
  return (
    <div class="stage">
      <div class="picture">
        {canDraw && (
          <canvas ref={canvas} class={isReady ? "" : "not-yet"} role="img" aria-label={label()} />
        )}
        {!isReady && <Flat from={chosen === "side" ? "side" : "above"} />}
      </div>
      <div class="places" role="group" aria-label={t("live.from")}>
        {places.map((one) => (
          <button type="button" aria-pressed={one === chosen} onClick={() => look(one)}>
            {t(`live.${one}`)}
          </button>
        ))}
      </div>
      <p class="stage-key" aria-hidden="true">
        <i class="measured" /> {t("live.measured")} <i class="planned" /> {t("live.reference")}
      </p>
    </div>
  );
}

function label(): string {
  return t("live.picture");
}

function Flat(props: { from: "above" | "side" }) {
  const ball = shownBall.value;
  const flight = ball ? drawnFrom(ball.shot) : null;
  const faded = flights.value.filter((one) => one.id !== ball?.id).map((one) => drawnFrom(one.shot));
  if (props.from === "side") {
    return (
      <SideView
        court={court.value}
        flight={flight}
        reference_m={ball?.reference_m ?? null}
        faded={faded}
        label={label()}
      />
    );
  }
  const bounce = ball?.shot.bounce ?? null;
  const landing = bounce ? ([bounce.position_m[0], bounce.position_m[1]] as [number, number]) : null;
  const ellipse = landing && bounce ? ellipse95(landing, bounce.covariance_m2) : null;
  const target = shown.value?.target;
  return (
    <CourtMap court={court.value} area={WHOLE} label={label()}>
      {target && <circle class="zone" {...circle(target.landing_m)} r={target.zone_radius_m} />}
      {faded.map((one, i) => <path key={i} class="flight faded" d={abovePath(one.before)} />)}
      {ball?.reference_m && <path class="reference" d={abovePath(ball.reference_m)} />}
      {flight && <path class="flight hop" d={abovePath(flight.after)} />}
      {flight && <path class="flight" d={abovePath(flight.before)} />}
      {ellipse && <EllipseMark ellipse={ellipse} class="sure" />}
      {landing && <circle class="ball" {...circle(landing)} r={0.2} />}
    </CourtMap>
  );
}

function circle(place_m: [number, number]) {
  const [cx, cy] = at(place_m);
  return { cx, cy };
}

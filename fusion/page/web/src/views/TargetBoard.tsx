// The court on which targets are drawn: tap to add, drag or arrow keys to move.
import { useRef } from "preact/hooks";
import type { Xy } from "../contract";
import { CourtMap, FAR_HALF, at } from "../plots/CourtMap";
import { Point, markOf } from "../plots/marks";
import { abovePath } from "../plots/SideView";
import { court } from "../store";
import { t } from "../words";
import { addTarget, aim, changeTarget, draft, placed, removeTarget, targetIdx } from "./draft";

const STEP_M = 0.1;
const BIG_STEP_M = 1;
/** A finger that moved less than this has tapped. */
const TAP_PX = 8;

const WAYS: Record<string, Xy> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

export function TargetBoard() {
  const svg = useRef<SVGSVGElement>(null);
  const held = useRef<number | null>(null);
  const down = useRef<{ x: number; y: number } | null>(null);
  const placeOf = (event: PointerEvent): Xy | null => {
    const matrix = svg.current?.getScreenCTM();
    if (!matrix) return null;
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    return [point.x, -point.y];
  };
  const start = (event: PointerEvent) => {
    const hit = (event.target as Element).closest("[data-target]");
    down.current = { x: event.clientX, y: event.clientY };
    if (!hit) return;
    const idx = Number(hit.getAttribute("data-target"));
    held.current = idx;
    targetIdx.value = idx;
    svg.current?.setPointerCapture(event.pointerId);
  };
  const isTap = (event: PointerEvent) =>
    down.current !== null &&
    Math.hypot(event.clientX - down.current.x, event.clientY - down.current.y) < TAP_PX;
  const move = (event: PointerEvent) => {
    if (held.current === null || isTap(event)) return;
    const to = placeOf(event);
    if (to) changeTarget(held.current, { landing_m: placed(to) });
  };
  const end = (event: PointerEvent) => {
    const to = placeOf(event);
    if (event.type === "pointerup" && held.current === null && isTap(event) && to) addTarget(to);
    held.current = null;
    down.current = null;
  };
  const key = (idx: number) => (event: KeyboardEvent) => {
    const now = draft.value?.targets[idx];
    const way = WAYS[event.key];
    if (now && way) {
      event.preventDefault();
      const step = event.shiftKey ? BIG_STEP_M : STEP_M;
      const [x, y] = now.landing_m;
      changeTarget(idx, { landing_m: placed([x + way[0] * step, y + way[1] * step]) });
    } else if (event.key === "Delete" || event.key === "Backspace") {
      event.preventDefault();
      removeTarget(idx);
    } else if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      targetIdx.value = idx;
    }
  };
  const answer = aim.value;
  return (
    <CourtMap
      court={court.value}
      area={FAR_HALF}
      class="board"
      role="group"
      label={t("drill.board")}
      svgRef={svg}
      onPointerDown={start}
      onPointerMove={move}
      onPointerUp={end}
    >
      {answer?.flight_m && <path class="reference" d={abovePath(answer.flight_m)} />}
      {draft.value?.targets.map((one, idx) => {
        const [cx, cy] = at(one.landing_m);
        const is_chosen = idx === targetIdx.value;
        return (
          <g
            key={idx}
            class={`target ${is_chosen ? "chosen" : ""}`}
            data-target={idx}
            tabIndex={0}
            role="button"
            aria-pressed={is_chosen}
            aria-label={t("drill.targetAt", {
              name: one.name,
              x: one.landing_m[0].toFixed(1),
              y: one.landing_m[1].toFixed(1),
            })}
            onKeyDown={key(idx)}
            onFocus={() => (targetIdx.value = idx)}
          >
            <circle class="grip" cx={cx} cy={cy} r={Math.max(0.85, one.zone_radius_m)} />
            <circle class="zone" cx={cx} cy={cy} r={one.zone_radius_m} />
            <Point mark={markOf(idx)} at={[cx, cy]} r={0.24} />
          </g>
        );
      })}
      {answer && !answer.reachable && answer.landing_m && (
        <g class="nearest">
          <circle cx={at(answer.landing_m)[0]} cy={at(answer.landing_m)[1]} r={0.3} />
        </g>
      )}
    </CourtMap>
  );
}

// The court from above, in metres; x right, far baseline on top.
import type { ComponentChildren, Ref } from "preact";
import type { Court, Ellipse, Xy } from "../contract";

export interface Area {
  x_m: [number, number];
  y_m: [number, number];
}

/** Where balls of a machine land: the far half and what is around it. */
export const FAR_HALF: Area = { x_m: [-6.9, 6.9], y_m: [10.6, 26.2] };
export const WHOLE: Area = { x_m: [-6.9, 6.9], y_m: [-2.6, 26.2] };

/** Court to picture: up is further. */
export function at([x_m, y_m]: Xy): [number, number] {
  return [x_m, -y_m];
}

export function CourtMap(props: {
  court: Court | null;
  area: Area;
  label: string;
  class?: string;
  svgRef?: Ref<SVGSVGElement>;
  onPointerDown?: (event: PointerEvent) => void;
  onPointerMove?: (event: PointerEvent) => void;
  onPointerUp?: (event: PointerEvent) => void;
  role?: "img" | "group";
  children?: ComponentChildren;
}) {
  const { court, area } = props;
  const [left, right] = area.x_m;
  const [near, far] = area.y_m;
  return (
    <svg
      class={`court-map on-court ${props.class ?? ""}`}
      viewBox={`${left} ${-far} ${right - left} ${far - near}`}
      role={props.role ?? "img"}
      aria-label={props.label}
      ref={props.svgRef ?? null}
      onPointerDown={props.onPointerDown}
      onPointerMove={props.onPointerMove}
      onPointerUp={props.onPointerUp}
      onPointerCancel={props.onPointerUp}
    >
      <rect class="outside" x={left} y={-far} width={right - left} height={far - near} />
      <rect class="inside" x={-5.485} y={-23.77} width={10.97} height={23.77} />
      {court?.lines_m.map(([a, b], i) => (
        <line key={i} class="line" x1={a[0]} y1={-a[1]} x2={b[0]} y2={-b[1]} />
      ))}
      {court && (
        <line
          class="net"
          x1={court.net.posts_x_m[0]}
          x2={court.net.posts_x_m[1]}
          y1={-court.net.y_m}
          y2={-court.net.y_m}
        />
      )}
      {props.children}
    </svg>
  );
}

export function EllipseMark(props: { ellipse: Ellipse; class: string }) {
  const { center_m, half_axes_m, turned_rad } = props.ellipse;
  const [cx, cy] = at(center_m);
  return (
    <ellipse
      class={props.class}
      cx={cx}
      cy={cy}
      rx={half_axes_m[0]}
      ry={half_axes_m[1]}
      transform={`rotate(${(-turned_rad * 180) / Math.PI} ${cx} ${cy})`}
    />
  );
}

// A flight from the side: along the court to the right, height upwards, both to scale.
import type { Court, Xyz } from "../contract";
import type { Drawn } from "../pure/trajectory";

const NEAR_M = -1.5;
const FAR_M = 27.5;

function path(points: readonly Xyz[]): string {
  if (points.length === 0) return "";
  return `M${points.map(([, y, z]) => `${y.toFixed(3)} ${(-z).toFixed(3)}`).join("L")}`;
}

export function SideView(props: {
  court: Court | null;
  flight: Drawn | null;
  reference_m: Xyz[] | null;
  faded?: Drawn[];
  label: string;
}) {
  const { court, flight, reference_m } = props;
  const all = [...(flight?.before ?? []), ...(reference_m ?? [])];
  const top_m = Math.max(3.2, ...all.map((point) => point[2] + 0.6));
  const bounce = flight?.before.at(-1);
  return (
    <svg
      class="side-view on-court"
      viewBox={`${NEAR_M} ${-top_m} ${FAR_M - NEAR_M} ${top_m + 0.5}`}
      role="img"
      aria-label={props.label}
    >
      <rect class="air" x={NEAR_M} y={-top_m} width={FAR_M - NEAR_M} height={top_m} />
      <rect class="outside" x={NEAR_M} y={0} width={FAR_M - NEAR_M} height={0.5} />
      <rect class="inside" x={0} y={0} width={23.77} height={0.5} />
      {court && (
        <g>
          <line class="net" x1={court.net.y_m} x2={court.net.y_m} y1={0} y2={-court.net.height_center_m} />
          <line
            class="net-post"
            x1={court.net.y_m}
            x2={court.net.y_m}
            y1={0}
            y2={-court.net.height_post_m}
          />
        </g>
      )}
      {props.faded?.map((one, i) => <path key={i} class="flight faded" d={path(one.before)} />)}
      {reference_m && <path class="reference" d={path(reference_m)} />}
      {flight && <path class="flight hop" d={path(flight.after)} />}
      {flight && <path class="flight" d={path(flight.before)} />}
      {bounce && <circle class="ball" cx={bounce[1]} cy={-bounce[2]} r={0.16} />}
    </svg>
  );
}

export function abovePath(points: readonly Xyz[]): string {
  if (points.length === 0) return "";
  return `M${points.map(([x, y]) => `${x.toFixed(3)} ${(-y).toFixed(3)}`).join("L")}`;
}

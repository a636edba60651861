// Numbers ball by ball, with the band of their sigma.
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { rangeOf, ticks, tickText } from "../pure/ticks";

export interface Series {
  name: string;
  hue: 0 | 1;
  shape: "circle" | "square";
  /** Null is a hole, not a zero. */
  values: (number | null)[];
  sigmas: (number | null)[] | null;
  /** Balls scatter: points alone. A belief is a line. */
  drawn: "points" | "line";
}

const HEIGHT = 220;
const EDGE = { left: 52, right: 10, top: 12, bottom: 34 };

function useWidth(otherwise: number) {
  const ref = useRef<HTMLDivElement>(null);
  const [width, setWidth] = useState(otherwise);
  useLayoutEffect(() => {
    const place = ref.current;
    if (!place) return;
    const take = () => setWidth(Math.max(260, Math.round(place.clientWidth)));
    const observer = new ResizeObserver(take);
    observer.observe(place);
    take();
    return () => observer.disconnect();
  }, []);
  return { ref, width };
}

interface Scale {
  x: (i: number) => number;
  y: (value: number) => number;
}

function bandPath(series: Series, { x, y }: Scale): string {
  const runs: string[] = [];
  let upper: string[] = [];
  let lower: string[] = [];
  const close = () => {
    if (upper.length > 1) runs.push(`M${upper.join("L")}L${lower.reverse().join("L")}Z`);
    upper = [];
    lower = [];
  };
  series.values.forEach((value, i) => {
    const sigma = series.sigmas?.[i];
    if (value === null || sigma === null || sigma === undefined) return close();
    upper.push(`${x(i).toFixed(1)} ${y(value + sigma).toFixed(1)}`);
    lower.push(`${x(i).toFixed(1)} ${y(value - sigma).toFixed(1)}`);
  });
  close();
  return runs.join("");
}

function linePath(series: Series, { x, y }: Scale): string {
  let is_down = false;
  return series.values
    .map((value, i) => {
      if (value === null) {
        is_down = false;
        return "";
      }
      const step = `${is_down ? "L" : "M"}${x(i).toFixed(1)} ${y(value).toFixed(1)}`;
      is_down = true;
      return step;
    })
    .join("");
}

function Dots(props: { series: Series; scale: Scale }) {
  const { series, scale } = props;
  return (
    <g class={`ink-${series.hue}`}>
      {series.values.map((value, i) => {
        if (value === null) return null;
        const [x, y] = [scale.x(i), scale.y(value)];
        return series.shape === "circle" ? (
          <circle key={i} class="spot" cx={x} cy={y} r={4} />
        ) : (
          <rect key={i} class="spot" x={x - 3.5} y={y - 3.5} width={7} height={7} />
        );
      })}
    </g>
  );
}

export function Trend(props: {
  label: string;
  unit: string;
  xLabel: string;
  series: Series[];
  /** Half the least range shown, so that noise does not look like a storm. */
  least: number;
  /** Where the range must reach besides: drag is never near 0. */
  around?: number;
}) {
  const { ref, width } = useWidth(640);
  const n = Math.max(1, ...props.series.map((one) => one.values.length));
  const middle = props.around ?? 0;
  const ends = props.series.flatMap((one) =>
    one.values.flatMap((value, i) => {
      if (value === null) return [];
      const sigma = one.sigmas?.[i] ?? 0;
      return [value - sigma - middle, value + sigma - middle];
    }),
  );
  const [low, high] = rangeOf(ends, props.least).map((end) => end + middle) as [number, number];
  const inner = { w: width - EDGE.left - EDGE.right, h: HEIGHT - EDGE.top - EDGE.bottom };
  const scale: Scale = {
    x: (i) => EDGE.left + (n === 1 ? inner.w / 2 : (i * inner.w) / (n - 1)),
    y: (value) => EDGE.top + ((high - value) / (high - low)) * inner.h,
  };
  const xs = ticks(1, n, Math.min(8, width / 80)).filter(Number.isInteger);
  return (
    <div ref={ref} class="trend">
      <svg
        class="on-paper"
        width={width}
        height={HEIGHT}
        viewBox={`0 0 ${width} ${HEIGHT}`}
        role="img"
        aria-label={props.label}
      >
        {ticks(low, high, 5).map((tick) => (
          <g key={tick}>
            <line
              class={tick === 0 ? "axis zero" : "grid"}
              x1={EDGE.left}
              x2={width - EDGE.right}
              y1={scale.y(tick)}
              y2={scale.y(tick)}
            />
            <text class="tick" x={EDGE.left - 7} y={scale.y(tick) + 4} text-anchor="end">
              {tickText(tick)}
            </text>
          </g>
        ))}
        {xs.map((tick) => (
          <text
            key={tick}
            class="tick"
            x={scale.x(tick - 1)}
            y={HEIGHT - EDGE.bottom + 17}
            text-anchor="middle"
          >
            {tick}
          </text>
        ))}
        <text class="tick" x={width - EDGE.right} y={HEIGHT - 3} text-anchor="end">
          {props.xLabel}
        </text>
        <text class="tick" x={2} y={HEIGHT - 3}>
          {props.unit}
        </text>
        {props.series.map((one) => (
          <path key={one.name} class={`band ink-${one.hue}`} d={bandPath(one, scale)} />
        ))}
        {props.series.map((one) =>
          one.drawn === "line" ? (
            <path
              key={one.name}
              class={`curve ink-${one.hue} ${one.hue === 1 ? "dashed" : ""}`}
              d={linePath(one, scale)}
            />
          ) : (
            <Dots key={one.name} series={one} scale={scale} />
          ),
        )}
      </svg>
    </div>
  );
}

export function TrendKey(props: { series: Series[] }) {
  return (
    <ul class="legend">
      {props.series.map((one) => (
        <li key={one.name}>
          <svg class="key on-paper" viewBox="0 0 26 16" width="26" height="16" aria-hidden="true">
            {one.drawn === "line" ? (
              <path
                class={`curve ink-${one.hue} ${one.hue === 1 ? "dashed" : ""}`}
                d="M1 8H25"
              />
            ) : one.shape === "circle" ? (
              <circle class={`spot ink-${one.hue}`} cx={13} cy={8} r={4} />
            ) : (
              <rect class={`spot ink-${one.hue}`} x={9} y={4} width={8} height={8} />
            )}
          </svg>
          {one.name}
        </li>
      ))}
    </ul>
  );
}

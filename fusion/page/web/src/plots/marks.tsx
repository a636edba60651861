// A colour and a shape for each target, so that neither alone has to be told apart.
import type { ComponentChildren } from "preact";

const SHAPES = ["circle", "square", "triangle", "diamond", "cross", "plus", "down"] as const;

export interface Mark {
  shape: (typeof SHAPES)[number];
  /** 0..6: a class of the style sheet, for colours differ on court and on paper. */
  hue: number;
}

export const NO_MARK: Mark = { shape: "circle", hue: 7 };

export function markOf(target_idx: number): Mark {
  if (target_idx < 0) return NO_MARK;
  const n = SHAPES.length;
  const turn = Math.floor(target_idx / n);
  return { shape: SHAPES[(target_idx + turn) % n] ?? "circle", hue: target_idx % n };
}

function outline(shape: Mark["shape"], r: number): string {
  const polygon = (points: [number, number][]) =>
    `M${points.map(([x, y]) => `${x * r} ${y * r}`).join("L")}Z`;
  const thin = 0.42;
  switch (shape) {
    case "circle":
      return `M${-r} 0A${r} ${r} 0 1 1 ${r} 0A${r} ${r} 0 1 1 ${-r} 0Z`;
    case "square":
      return polygon([[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]]);
    case "triangle":
      return polygon([[0, -1.15], [1.1, 0.85], [-1.1, 0.85]]);
    case "down":
      return polygon([[0, 1.15], [1.1, -0.85], [-1.1, -0.85]]);
    case "diamond":
      return polygon([[0, -1.3], [1.05, 0], [0, 1.3], [-1.05, 0]]);
    case "plus":
      return polygon([
        [-thin, -1.2], [thin, -1.2], [thin, -thin], [1.2, -thin], [1.2, thin], [thin, thin],
        [thin, 1.2], [-thin, 1.2], [-thin, thin], [-1.2, thin], [-1.2, -thin], [-thin, -thin],
      ]);
    case "cross": {
      const [a, b] = [1.15, 0.55];
      return polygon([
        [-a, -a + b], [-a + b, -a], [0, -b], [a - b, -a], [a, -a + b], [b, 0],
        [a, a - b], [a - b, a], [0, b], [-a + b, a], [-a, a - b], [-b, 0],
      ]);
    }
  }
}

export function Point(props: {
  mark: Mark;
  at: [number, number];
  r: number;
  class?: string;
  children?: ComponentChildren;
}) {
  const { mark, at, r } = props;
  return (
    <path
      class={`point hue-${mark.hue} ${props.class ?? ""}`}
      d={outline(mark.shape, r)}
      transform={`translate(${at[0]} ${at[1]})`}
    >
      {props.children}
    </path>
  );
}

export function Key(props: { mark: Mark }) {
  return (
    <svg class="key on-paper" viewBox="-8 -8 16 16" width="16" height="16" aria-hidden="true">
      <Point mark={props.mark} at={[0, 0]} r={5.5} />
    </svg>
  );
}

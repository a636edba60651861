// A covariance -> the ellipse that holds 95 % of a normal distribution.
import type { Ellipse, Xy } from "../contract";

/** 95 % of a chi-squared with two degrees of freedom, whose distribution is 1 - exp(-x/2). */
export const CHI2_95 = -2 * Math.log(0.05);

/** Null when the matrix is no covariance. */
export function ellipse95(center_m: Xy, covariance_m2: [Xy, Xy]): Ellipse | null {
  const [[a, b], [c, d]] = covariance_m2;
  const off = (b + c) / 2;
  const mean = (a + d) / 2;
  const spread = Math.hypot((a - d) / 2, off);
  const [major, minor] = [mean + spread, mean - spread];
  if (!(minor >= 0) || !Number.isFinite(major)) return null;
  const turned_rad = 0.5 * Math.atan2(2 * off, a - d);
  return {
    center_m,
    half_axes_m: [Math.sqrt(major * CHI2_95), Math.sqrt(minor * CHI2_95)],
    turned_rad,
  };
}

export function pointsOfEllipse(ellipse: Ellipse, n: number): Xy[] {
  const { center_m, half_axes_m, turned_rad } = ellipse;
  const [cos, sin] = [Math.cos(turned_rad), Math.sin(turned_rad)];
  return Array.from({ length: n }, (_, i): Xy => {
    const angle = (2 * Math.PI * i) / n;
    const u = half_axes_m[0] * Math.cos(angle);
    const v = half_axes_m[1] * Math.sin(angle);
    return [center_m[0] + u * cos - v * sin, center_m[1] + u * sin + v * cos];
  });
}

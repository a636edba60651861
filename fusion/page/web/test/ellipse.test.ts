import { describe, expect, it } from "vitest";
import { CHI2_95, ellipse95, pointsOfEllipse } from "../src/pure/ellipse";

describe("95 % ellipse", () => {
  it("chi-squared of two degrees at 95 % is 5.991", () => {
    expect(CHI2_95).toBeCloseTo(5.9915, 4);
  });
  it("without correlation its axes are those of the court", () => {
    const ellipse = ellipse95([1, 20], [[4, 0], [0, 1]]);
    expect(ellipse?.half_axes_m[0]).toBeCloseTo(2 * Math.sqrt(CHI2_95), 9);
    expect(ellipse?.half_axes_m[1]).toBeCloseTo(Math.sqrt(CHI2_95), 9);
    expect(ellipse?.turned_rad).toBeCloseTo(0, 9);
  });
  it("the major axis follows the correlation", () => {
    expect(ellipse95([0, 0], [[1, 0.5], [0.5, 1]])?.turned_rad).toBeCloseTo(Math.PI / 4, 9);
    expect(ellipse95([0, 0], [[1, -0.5], [-0.5, 1]])?.turned_rad).toBeCloseTo(-Math.PI / 4, 9);
    expect(ellipse95([0, 0], [[1, 0], [0, 4]])?.turned_rad).toBeCloseTo(Math.PI / 2, 9);
  });
  it("every point on it has the same Mahalanobis distance", () => {
    const covariance: [[number, number], [number, number]] = [[3e-4, 1e-4], [1e-4, 9e-4]];
    const ellipse = ellipse95([0.3, 22.1], covariance);
    expect(ellipse).not.toBeNull();
    const [[a, b], [, d]] = covariance;
    const det = a * d - b * b;
    for (const [x, y] of pointsOfEllipse(ellipse!, 17)) {
      const [u, v] = [x - 0.3, y - 22.1];
      expect((d * u * u - 2 * b * u * v + a * v * v) / det).toBeCloseTo(CHI2_95, 6);
    }
  });
  it("what is no covariance makes no ellipse", () => {
    expect(ellipse95([0, 0], [[1, 3], [3, 1]])).toBeNull();
    expect(ellipse95([0, 0], [[NaN, 0], [0, 1]])).toBeNull();
  });
});

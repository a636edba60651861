import { describe, expect, it } from "vitest";
import type { Shot, Xyz } from "../src/contract";
import { routeFrom } from "../src/pure/route";
import { rangeOf, ticks, tickText } from "../src/pure/ticks";
import { cordHeight, drawnFrom } from "../src/pure/trajectory";

const point = (t_ns: number, position_m: Xyz) => ({
  t_ns, position_m, velocity_m_s: [0, 20, 0] as Xyz, sigma_m: [0, 0, 0] as Xyz, left_px: null,
  right_px: null,
});
const shot = (over: Partial<Shot>): Shot => ({
  shot_idx: 0, outcome: "measured", launch: null, bounce: null, net: null, track: [],
  residual_px: { left: null, right: null }, ...over,
});

describe("what is drawn", () => {
  it("the bounce ends the flight and begins the hop", () => {
    const bounce: Shot["bounce"] = {
      t_ns: 25, position_m: [0, 20, 0.03], velocity_in_m_s: [0, 20, -5],
      velocity_out_m_s: null, covariance_m2: [[1, 0], [0, 1]],
    };
    const drawn = drawnFrom(shot({ bounce, track: [point(30, [0, 21, 1]), point(10, [0, 5, 2])] }));
    expect(drawn.before.map((p) => p[1])).toEqual([5, 20]);
    expect(drawn.after.map((p) => p[1])).toEqual([20, 21]);
  });
  it("without a bounce there is no hop, and without points nothing", () => {
    expect(drawnFrom(shot({ track: [point(1, [0, 1, 1])] })).after).toEqual([]);
    expect(drawnFrom(shot({})).before).toEqual([]);
  });
  it("a long track is thinned but keeps its ends", () => {
    const track = Array.from({ length: 5000 }, (_, i) => point(i, [0, i, 1]));
    const { before } = drawnFrom(shot({ track }));
    expect(before.length).toBe(240);
    expect([before[0]?.[1], before.at(-1)?.[1]]).toEqual([0, 4999]);
  });
  it("the cord is lowest in the middle and as high as the posts at its ends", () => {
    const net = { posts_x_m: [-6.4, 6.4] as [number, number], height_post_m: 1.07, height_center_m: 0.914 };
    expect(cordHeight(0, net)).toBeCloseTo(0.914, 9);
    expect(cordHeight(-6.4, net)).toBeCloseTo(1.07, 9);
  });
});

describe("axes", () => {
  it("have round ticks within their range", () => {
    expect(ticks(-1.1, 2.3, 4).map(tickText)).toEqual(["-1", "0", "1", "2"]);
    expect(ticks(0.1, 0.55, 5).map(tickText)).toEqual(["0.1", "0.2", "0.3", "0.4", "0.5"]);
  });
  it("a range of nothing is still a range", () => {
    const [low, high] = rangeOf([], 1);
    expect(high).toBeGreaterThan(low);
  });
});

describe("address", () => {
  it("names the view, and an unknown one is live", () => {
    expect(routeFrom("#/drill").view).toBe("drill");
    expect(routeFrom("#/nonsense").view).toBe("live");
    expect(routeFrom("").view).toBe("live");
  });
  it("brings a token once, and no nonsense as one", () => {
    expect(routeFrom("#token=abc-123").token).toBe("abc-123");
    expect(routeFrom("#token=").token).toBeNull();
    expect(routeFrom("#token=a%0d%0ab").token).toBeNull();
  });
});

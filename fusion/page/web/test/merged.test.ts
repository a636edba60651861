import { describe, expect, it } from "vitest";
import type { ShotRow } from "../src/contract";
import { waitMs } from "../src/pure/backoff";
import { MAX_RECENT, isMissingBefore, merged } from "../src/pure/merged";

const row = (id: number, sentence: string | null = null): ShotRow => ({
  id, session_id: 1, at_ms: id, outcome: "measured", speed_m_s: 20, speed_sigma_m_s: null,
  elevation_deg: null, azimuth_deg: null, spin_rpm: null, spin_sigma_rpm: null, net_height_m: null,
  net_height_sigma_m: null, landing_m: null, landing_covariance_m2: null, target: null,
  miss_m: null, sentence,
});
const ids = (rows: ShotRow[]) => rows.map((one) => one.id);

describe("balls that were missed", () => {
  it("come once, newest first, in whatever order they are heard", () => {
    expect(ids(merged([row(5), row(3)], [row(4), row(5), row(6)]))).toEqual([6, 5, 4, 3]);
  });
  it("a correction replaces the row without it", () => {
    expect(merged([row(5)], [row(5, "12 cm long")])[0]?.sentence).toBe("12 cm long");
  });
  it("the list has a limit and keeps the newest", () => {
    const many = merged([], Array.from({ length: MAX_RECENT + 40 }, (_, i) => row(i + 1)));
    expect(many.length).toBe(MAX_RECENT);
    expect(many[0]?.id).toBe(MAX_RECENT + 40);
  });
  it("older pages are asked for until what is known is reached", () => {
    const page = [row(90), row(41)];
    expect(isMissingBefore(page, 20, 41)).toBe(true);
    expect(isMissingBefore(page, 41, 41)).toBe(false);
    expect(isMissingBefore(page, 20, null)).toBe(false);
    expect(isMissingBefore(page, null, 41)).toBe(false);
    expect(isMissingBefore([], 20, 41)).toBe(false);
  });
  it("tries come later and later, up to five seconds", () => {
    expect([0, 1, 2, 3, 4, 40].map((n) => waitMs(n, 1))).toEqual([500, 1000, 2000, 4000, 5000, 5000]);
    expect(waitMs(0, 0)).toBe(375);
  });
});

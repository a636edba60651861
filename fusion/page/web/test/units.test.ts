import { describe, expect, it } from "vitest";
import {
  centimetres, metresASecondFrom, sigmaText, sizeText, speedFrom, SPEED_UNITS,
} from "../src/pure/units";

describe("units", () => {
  it("100 km/h are 62.14 mph and 27.78 m/s", () => {
    expect(speedFrom(100 / 3.6, "km/h")).toBeCloseTo(100, 9);
    expect(speedFrom(100 / 3.6, "mph")).toBeCloseTo(62.1371, 4);
    expect(speedFrom(100 / 3.6, "m/s")).toBeCloseTo(27.7778, 4);
  });
  it("what is typed in any unit comes back", () => {
    for (const unit of SPEED_UNITS) {
      expect(speedFrom(metresASecondFrom(71.3, unit), unit)).toBeCloseTo(71.3, 9);
    }
  });
  it("a sigma that is not zero never reads as zero", () => {
    expect(sigmaText(0.004, 1)).toBe("< 0.1");
    expect(sigmaText(0.06, 1)).toBe("0.1");
    expect(sigmaText(0, 1)).toBe("0.0");
  });
  it("there is no minus zero centimetre", () => {
    expect(centimetres(-0.001)).toBe("0");
    expect(centimetres(-0.126)).toBe("-13");
  });
  it("sizes have three figures or so", () => {
    expect([sizeText(12), sizeText(12_345), sizeText(3_141_592)]).toEqual(["12 B", "12 kB", "3.1 MB"]);
  });
});

import { describe, expect, it } from "vitest";
import { missParts, missText, spinWay } from "../src/pure/miss";
import en from "../src/words/en.json";

const words = {
  long: en["miss.long"],
  short: en["miss.short"],
  left: en["miss.left"],
  right: en["miss.right"],
  onTarget: en["miss.onTarget"],
};

describe("words of a miss", () => {
  it("long is further, left is towards -x", () => {
    expect(missText([-0.04, 0.12], words)).toBe("12 cm long");
    expect(missText([-0.08, 0.12], words)).toBe("12 cm long, 8 cm left");
    expect(missText([0.31, -0.22], words)).toBe("22 cm short, 31 cm right");
  });
  it("below five centimetres it is on target", () => {
    expect(missText([0.03, -0.04], words)).toBe("On target, 5 cm off");
    expect(missParts([0.03, -0.04])).toEqual([]);
  });
  it("what is small beside the rest is not named", () => {
    expect(missParts([0.06, 1.5]).map((part) => part.way)).toEqual(["long"]);
  });
  it("backspin is positive, as in shots/1", () => {
    expect([spinWay(900), spinWay(-900), spinWay(12)]).toEqual(["backspin", "topspin", "flat"]);
  });
});

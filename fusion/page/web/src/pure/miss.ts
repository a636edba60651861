// Landing less target -> words: "12 cm long, 4 cm left".
import type { Xy } from "../contract";
import { centimetres } from "./units";

/** Words of one language; `{cm}` is replaced. */
export interface MissWords {
  long: string;
  short: string;
  left: string;
  right: string;
  onTarget: string;
}

/** Less than this along or across is not worth a word, as in the sentence of a correction. */
const NEAR_M = 0.05;
const NEAR_PART = 0.2;

export interface MissPart {
  way: "long" | "short" | "left" | "right";
  off_m: number;
}

/** What is off, biggest first; empty on target. */
export function missParts(miss_m: Xy): MissPart[] {
  const [across_m, along_m] = miss_m;
  const least_m = Math.max(NEAR_M, NEAR_PART * Math.hypot(across_m, along_m));
  const parts: MissPart[] = [];
  if (Math.abs(along_m) >= least_m) {
    parts.push({ way: along_m > 0 ? "long" : "short", off_m: Math.abs(along_m) });
  }
  if (Math.abs(across_m) >= least_m) {
    parts.push({ way: across_m > 0 ? "right" : "left", off_m: Math.abs(across_m) });
  }
  return parts;
}

export function missText(miss_m: Xy, words: MissWords): string {
  const parts = missParts(miss_m);
  if (parts.length === 0) {
    return words.onTarget.replace("{cm}", centimetres(Math.hypot(...miss_m)));
  }
  return parts.map((part) => words[part.way].replace("{cm}", centimetres(part.off_m))).join(", ");
}

/** Backspin is positive; below 30 rpm nobody sees it turn. */
export function spinWay(spin_rpm: number): "topspin" | "backspin" | "flat" {
  if (Math.abs(spin_rpm) < 30) return "flat";
  return spin_rpm > 0 ? "backspin" : "topspin";
}

// How long to wait before the connection is tried again.
export const FIRST_WAIT_MS = 500;
export const LONGEST_WAIT_MS = 5000;

/** Doubles up to the longest; `chance` in 0..1 keeps twenty phones from knocking at once. */
export function waitMs(n_failed: number, chance: number): number {
  const wait = Math.min(LONGEST_WAIT_MS, FIRST_WAIT_MS * 2 ** Math.min(n_failed, 10));
  return Math.round(wait * (0.75 + 0.25 * chance));
}

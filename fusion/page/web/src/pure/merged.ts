// Rows of balls that came by the live line and by questions -> one list, newest first, no doubles.
import type { ShotRow } from "../contract";

/** What a phone needs at once; older balls are in the session's table. */
export const MAX_RECENT = 200;

/** A row that comes again replaces the old one: its correction may have come meanwhile. */
export function merged<Row extends ShotRow>(known: readonly Row[], news: readonly Row[]): Row[] {
  const by_id = new Map(known.map((row) => [row.id, row]));
  for (const row of news) by_id.set(row.id, row);
  return [...by_id.values()].sort((a, b) => b.id - a.id).slice(0, MAX_RECENT);
}

/**
 * After a lost connection: whether older balls must be asked for, i.e. whether a page of answers
 * does not reach back to what is known. `known_id` is the newest one known before.
 */
export function isMissingBefore(
  page: readonly ShotRow[],
  known_id: number | null,
  next: number | null,
): boolean {
  const oldest = page.at(-1);
  if (known_id === null || next === null || oldest === undefined) return false;
  return oldest.id > known_id;
}

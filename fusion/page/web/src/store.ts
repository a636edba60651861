// What is known now: the status, the balls, the view. Everything drawn follows from these.
import { computed, signal } from "@preact/signals";
import { get } from "./api";
import type { Ball, Court, DrillState, Job, ShotRow, Status, Watch } from "./contract";
import { merged } from "./pure/merged";
import { routeFrom, type View } from "./pure/route";

/** How many flights are drawn: the last one and those fading behind it. */
export const MAX_FLIGHTS = 8;

export const view = signal<View>(routeFrom(location.hash).view);
export const court = signal<Court | null>(null);
export const status = signal<Status | null>(null);
export const drill = signal<DrillState | null>(null);
export const watch = signal<Watch | null>(null);
export const job = signal<Job | null>(null);
export const rows = signal<ShotRow[]>([]);
export const flights = signal<Ball[]>([]);
/** A ball the person looks at, perhaps older than all rows here; null follows the newest. */
export const chosen = signal<ShotRow | null>(null);
export const newest = computed(() => rows.value[0] ?? null);

export const shown = computed<ShotRow | null>(() => {
  const kept = chosen.value;
  if (kept === null) return newest.value;
  return rows.value.find((row) => row.id === kept.id) ?? kept;
});

export const shownBall = computed<Ball | null>(
  () => flights.value.find((ball) => ball.id === shown.value?.id) ?? null,
);

function rowFrom(ball: Ball): ShotRow {
  const { shot: _shot, reference_m: _reference, correction: _correction, ...row } = ball;
  return row;
}

export function takeRows(news: readonly ShotRow[]): void {
  rows.value = merged(rows.value, news);
}

export function takeBall(ball: Ball): void {
  takeRows([rowFrom(ball)]);
  const all = merged(flights.value, [ball]);
  const kept = all.slice(0, MAX_FLIGHTS);
  const older = all.slice(MAX_FLIGHTS).find((one) => one.id === chosen.value?.id);
  flights.value = older ? [...kept, older] : kept;
}

export function forget(): void {
  rows.value = [];
  flights.value = [];
  chosen.value = null;
}

export function takeStatus(news: Status): void {
  status.value = news;
  drill.value = news.drill;
  watch.value = news.watch;
  if (news.setup !== null) job.value = news.setup;
}

const asking = new Set<number>();

/** The flight of a ball, when it is not here yet. */
export async function fetchFlight(id: number): Promise<void> {
  if (asking.has(id) || flights.value.some((ball) => ball.id === id)) return;
  asking.add(id);
  try {
    takeBall(await get<Ball>(`/balls/${id}`));
  } catch {
    // Asked again when it is chosen again; the numbers are shown without it.
  } finally {
    asking.delete(id);
  }
}

export function go(to: View): void {
  location.hash = `/${to}`;
}

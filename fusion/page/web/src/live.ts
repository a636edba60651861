// The one line from the server: kept open, opened anew with patience, and what was missed asked for.
import { signal } from "@preact/signals";
import { get } from "./api";
import type { Court, LiveMessage, ShotRow, Status } from "./contract";
import { waitMs } from "./pure/backoff";
import { isMissingBefore } from "./pure/merged";
import * as store from "./store";

export type Line = "first" | "open" | "lost";
export const line = signal<Line>("first");
/** When it is tried again. */
export const retryAt = signal(0);

const PAGE = 50;
/** A longer outage than this many balls is what the session's table is for. */
const MAX_PAGES = 4;
/** The server says its status every second; silence for this long is a dead line. */
const SILENCE_MS = 6000;

let socket: WebSocket | null = null;
let n_failed = 0;
let timer = 0;
let heard_at = 0;

async function fetchMissed(): Promise<void> {
  const known_id = store.newest.value?.id ?? null;
  let before = "";
  for (let page = 0; page < MAX_PAGES; page++) {
    const answer = await get<{ balls: ShotRow[]; next: number | null }>(
      `/balls?limit=${PAGE}${before}`,
    );
    // What this page knows must be there still; else it is another history (a new data folder).
    if (page === 0 && known_id !== null && (answer.balls[0]?.id ?? 0) < known_id) store.forget();
    store.takeRows(answer.balls);
    if (!isMissingBefore(answer.balls, known_id, answer.next)) break;
    before = `&before=${answer.next}`;
  }
  const wanted = store.rows.value.slice(0, store.MAX_FLIGHTS - 2);
  for (const row of wanted) await store.fetchFlight(row.id);
}

async function fetchAll(): Promise<void> {
  try {
    const [status, court] = await Promise.all([get<Status>("/status"), get<Court>("/court")]);
    store.court.value = court;
    store.takeStatus(status);
    await fetchMissed();
  } catch {
    // The line below tells and tries again.
  }
}

function take(message: LiveMessage): void {
  switch (message.type) {
    case "status":
      return store.takeStatus(message.status);
    case "ball":
    case "correction":
      return store.takeBall(message.ball);
    case "drill":
      store.drill.value = message.drill;
      return;
    case "watch":
      store.watch.value = message.watch;
      return;
    case "job":
      store.job.value = message.job;
      return;
  }
}

function lose(): void {
  if (socket === null) return;
  socket.onclose = socket.onmessage = socket.onopen = socket.onerror = null;
  socket.close();
  socket = null;
  line.value = "lost";
  const wait = waitMs(n_failed++, Math.random());
  retryAt.value = Date.now() + wait;
  timer = window.setTimeout(open, wait);
}

function open(): void {
  clearTimeout(timer);
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/api/v1/live`);
  heard_at = Date.now();
  socket.onopen = () => {
    n_failed = 0;
    heard_at = Date.now();
    line.value = "open";
    void fetchAll();
  };
  socket.onmessage = (event) => {
    heard_at = Date.now();
    try {
      take(JSON.parse(event.data as string) as LiveMessage);
    } catch {
      // A newer server may say more than this page knows.
    }
  };
  socket.onclose = socket.onerror = lose;
}

export function tryNow(): void {
  if (line.value === "open") return;
  clearTimeout(timer);
  lose();
  open();
}

export function start(): void {
  void fetchAll();
  open();
  window.setInterval(() => {
    if (socket !== null && Date.now() - heard_at > SILENCE_MS) lose();
  }, 1000);
  // A phone that slept finds its line dead; it should not wait for the next try.
  document.addEventListener("visibilitychange", () => {
    if (document.visibilityState === "visible" && Date.now() - heard_at > SILENCE_MS) tryNow();
  });
  window.addEventListener("online", tryNow);
}

// A session with its balls, asked for when it is looked at and again when a ball was added.
import { signal, type Signal } from "@preact/signals";
import { get, noteError } from "../api";
import type { Session, SessionRow, ShotRow } from "../contract";

/** Points on one map; more hide each other. */
export const MAX_POINTS = 2000;
const PAGE = 500;

export interface Loaded {
  session: Session;
  balls: ShotRow[];
}

export const sessions = signal<SessionRow[]>([]);
export const hasMoreSessions = signal(false);

export async function loadSessions(): Promise<void> {
  try {
    const answer = await get<{ sessions: SessionRow[]; next: number | null }>("/sessions?limit=200");
    sessions.value = answer.sessions;
    hasMoreSessions.value = answer.next !== null;
  } catch (error) {
    noteError(error);
  }
}

export async function loadMoreSessions(): Promise<void> {
  const last = sessions.value.at(-1);
  if (!last) return;
  try {
    const answer = await get<{ sessions: SessionRow[]; next: number | null }>(
      `/sessions?limit=200&before=${last.id}`,
    );
    sessions.value = [...sessions.value, ...answer.sessions];
    hasMoreSessions.value = answer.next !== null;
  } catch (error) {
    noteError(error);
  }
}

async function ballsOf(id: number): Promise<ShotRow[]> {
  const balls: ShotRow[] = [];
  let before = "";
  while (balls.length < MAX_POINTS) {
    const answer = await get<{ balls: ShotRow[]; next: number | null }>(
      `/balls?session=${id}&limit=${PAGE}${before}`,
    );
    balls.push(...answer.balls);
    if (answer.next === null) break;
    before = `&before=${answer.next}`;
  }
  return balls;
}

const turns = new WeakMap<Signal<Loaded | null>, number>();

/** Into `place`; an answer that was overtaken by a newer question is dropped. */
export async function load(place: Signal<Loaded | null>, id: number | null): Promise<void> {
  const turn = (turns.get(place) ?? 0) + 1;
  turns.set(place, turn);
  if (id === null) {
    place.value = null;
    return;
  }
  try {
    const [session, balls] = await Promise.all([get<Session>(`/sessions/${id}`), ballsOf(id)]);
    if (turns.get(place) === turn) place.value = { session, balls };
  } catch (error) {
    noteError(error);
  }
}

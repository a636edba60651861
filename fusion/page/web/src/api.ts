// Questions to the server. An answer that is no success becomes a Refusal with its sentence.
import { signal } from "@preact/signals";
import type { Problem } from "./contract";
import { token } from "./settings";
import { t } from "./words";

const ROOT = "/api/v1";
const PATIENCE_MS = 15_000;

export class Refusal extends Error {
  constructor(
    readonly status: number,
    sentence: string,
    readonly expected: string | null,
  ) {
    super(sentence);
  }
}

async function refusalFrom(answer: Response): Promise<Refusal> {
  try {
    const problem = (await answer.json()) as Partial<Problem>;
    if (typeof problem.error === "string") {
      return new Refusal(answer.status, problem.error, problem.expected ?? null);
    }
  } catch {
    // Not ours: a proxy's page.
  }
  return new Refusal(answer.status, t("error.status", { status: answer.status }), null);
}

async function asked(method: string, path: string, body?: unknown): Promise<Response> {
  const headers: Record<string, string> = {};
  if (body !== undefined) headers["Content-Type"] = "application/json";
  if (token.value !== null) headers["Authorization"] = `Bearer ${token.value}`;
  let answer: Response;
  try {
    answer = await fetch(ROOT + path, {
      method,
      headers,
      signal: AbortSignal.timeout(PATIENCE_MS),
      ...(body === undefined ? {} : { body: JSON.stringify(body) }),
    });
  } catch {
    throw new Refusal(0, t("error.unreachable"), null);
  }
  if (!answer.ok) throw await refusalFrom(answer);
  return answer;
}

export async function get<T>(path: string): Promise<T> {
  return (await (await asked("GET", path)).json()) as T;
}

export async function send<T>(method: string, path: string, body?: unknown): Promise<T> {
  const answer = await asked(method, path, body);
  const text = await answer.text();
  return (text === "" ? {} : JSON.parse(text)) as T;
}

/** For files that need the token, which a plain link cannot carry. */
export async function fetchFile(path: string): Promise<Blob> {
  return (await asked("GET", path)).blob();
}

export function address(path: string): string {
  return ROOT + path;
}

export function saveBlob(blob: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

export interface Note {
  id: number;
  kind: "wrong" | "good";
  text: string;
  expected: string | null;
}

const MAX_NOTES = 3;
export const notes = signal<Note[]>([]);
let n_notes = 0;

export function note(kind: Note["kind"], text: string, expected: string | null = null): void {
  const known = notes.value.filter((one) => one.text !== text);
  notes.value = [...known, { id: ++n_notes, kind, text, expected }].slice(-MAX_NOTES);
}

export function dismiss(id: number): void {
  notes.value = notes.value.filter((one) => one.id !== id);
}

export function noteError(error: unknown): void {
  if (error instanceof Refusal) note("wrong", error.message, error.expected);
  else note("wrong", error instanceof Error ? error.message : String(error));
}

/** What waits for a token; the dialog is open while there is one. */
export const waiting = signal<{ why: string; resume: () => void; giveUp: () => void } | null>(null);

function tokenFromPerson(why: string): Promise<boolean> {
  waiting.value?.giveUp();
  return new Promise((resolve) => {
    waiting.value = { why, resume: () => resolve(true), giveUp: () => resolve(false) };
  }).then((is_given) => {
    waiting.value = null;
    return is_given as boolean;
  });
}

/**
 * Does what changes something: asks for the token when there is none or it is wrong, and shows
 * refusals as their sentence. Null when it was not done.
 */
export async function act<T>(what: () => Promise<T>): Promise<T | null> {
  for (;;) {
    try {
      return await what();
    } catch (error) {
      if (error instanceof Refusal && error.status === 401) {
        const why = token.value === null ? t("token.why") : t("token.wrong");
        if (await tokenFromPerson(why)) continue;
        return null;
      }
      noteError(error);
      return null;
    }
  }
}

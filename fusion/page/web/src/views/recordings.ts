// The recordings that this page keeps, asked for when they are looked at.
import { signal } from "@preact/signals";
import { get, noteError } from "../api";
import type { Recording } from "../contract";

export const recordings = signal<Recording[]>([]);

export async function loadRecordings(): Promise<void> {
  try {
    recordings.value = (await get<{ recordings: Recording[] }>("/setup/recordings")).recordings;
  } catch (error) {
    noteError(error);
  }
}

// Which recordings were made while a session went on.

interface Span {
  started_ms: number;
  /** Null while it goes on. */
  ended_ms: number | null;
}

/** A recording is named after when it began, and was written last when it ended. */
export function recordedDuring<T extends { name: string; at_ms: number }>(
  session: Span,
  recordings: readonly T[],
): T[] {
  return recordings.filter((one) => {
    const named = /^(\d{12,14})\.mcap$/.exec(one.name)?.[1];
    const began_ms = named === undefined ? one.at_ms : Number(named);
    return began_ms < (session.ended_ms ?? Infinity) && one.at_ms > session.started_ms;
  });
}

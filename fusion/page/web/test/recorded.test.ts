import { expect, it } from "vitest";
import { recordedDuring } from "../src/pure/recorded";

const at = (began_ms: number, ended_ms: number) => ({ name: `${began_ms}.mcap`, at_ms: ended_ms });
const T = 1_700_000_000_000;

it("a recording is of a session that it shares time with", () => {
  const session = { started_ms: T + 100, ended_ms: T + 200 };
  const [before, into, within, beyond, after] = [
    at(T + 10, T + 90), at(T + 50, T + 120), at(T + 120, T + 150), at(T + 150, T + 300), at(T + 210, T + 300),
  ];
  const all = [before!, into!, within!, beyond!, after!];
  expect(recordedDuring(session, all)).toEqual([into, within, beyond]);
  expect(recordedDuring({ ...session, ended_ms: null }, all)).toEqual([into, within, beyond, after]);
  // Of one that somebody brought along only its end is known.
  const brought = { name: "monday.mcap", at_ms: T + 150 };
  expect(recordedDuring(session, [brought])).toEqual([brought]);
});

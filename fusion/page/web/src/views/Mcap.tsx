// Recordings that were made while a session went on: what fusion was sent, to be looked at or replayed.
import { useEffect } from "preact/hooks";
import { address } from "../api";
import { recordedDuring } from "../pure/recorded";
import { t, timeText } from "../words";
import { sessions } from "./loaded";
import { loadRecordings, recordings } from "./recordings";

/** More would hide the other buttons; all are in the set-up. */
const MAX_LINKS = 3;

export function Mcap(props: { id: number }) {
  useEffect(() => void loadRecordings(), [props.id]);
  const session = sessions.value.find((one) => one.id === props.id);
  const found = session ? recordedDuring(session, recordings.value).slice(0, MAX_LINKS) : [];
  if (found.length === 0) {
    return (
      <a class="button" href="#/setup" aria-label={t("session.mcap")} title={t("session.mcap")}>
        MCAP
      </a>
    );
  }
  return (
    <>
      {found.map((one) => (
        <a key={one.name} class="button" download
          href={address(`/setup/recordings/${encodeURIComponent(one.name)}`)}>
          {t("session.mcapOf", { at: timeText(one.at_ms) })}
        </a>
      ))}
    </>
  );
}

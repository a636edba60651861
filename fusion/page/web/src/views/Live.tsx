import { useEffect } from "preact/hooks";
import type { ShotRow } from "../contract";
import { Health, StopButton, isStopped } from "../parts/Buttons";
import { Numbers, isInZone, landingSigma, landingText } from "../parts/Numbers";
import { Stage } from "../parts/Stage";
import { speedText } from "../pure/units";
import { language, unit } from "../settings";
import { chosen, fetchFlight, newest, rows, shown, shownBall, status, watch } from "../store";
import { local, named, t, timeText } from "../words";

const STRIP = 12;

export function Live() {
  const row = shown.value;
  useEffect(() => {
    if (row) void fetchFlight(row.id);
  }, [row?.id]);
  return (
    <div class="live">
      <h1 class="only-heard">{t("tab.live")}</h1>
      <Stage />
      <section class="facts" aria-label={t("live.last")}>
        {watch.value && (
          <p class="warning" lang="en">
            {watch.value.sentence}
          </p>
        )}
        {status.value?.history?.error && (
          <p class="warning" role="alert">
            {t("live.notKept")} <span lang="en">{status.value.history.error}</span>
          </p>
        )}
        {isStopped() && <p class="warning strong">{t("stop.isStopped")}</p>}
        {row ? <Facts row={row} /> : <Empty />}
        <Health />
      </section>
      <StopButton />
    </div>
  );
}

function Empty() {
  const is_silent = status.value?.fusion === "silent";
  return (
    <div class="empty">
      <p class="headline">{t("live.none")}</p>
      <p>{is_silent ? t("live.noneSilent") : t("live.noneYet")}</p>
    </div>
  );
}

function Facts(props: { row: ShotRow }) {
  const { row } = props;
  const is_in = isInZone(row);
  const sigma = landingSigma(row);
  const sentence = shownBall.value?.correction?.sentence ?? row.sentence;
  return (
    <>
      <div class="landing" data-ball={row.id}>
        <p class="over">
          {row.target ? t("live.for", { name: row.target.name }) : t("live.ball")}
          <span class="when">
            {timeText(row.at_ms)}
            {row.age_ms != null && ` · ${t("live.after", { ms: row.age_ms.toFixed(0) })}`}
          </span>
          {chosen.value !== null && chosen.value.id !== newest.value?.id && (
            <button type="button" class="quiet" onClick={() => (chosen.value = null)}>
              {t("live.backToLast")}
            </button>
          )}
        </p>
        <p class="headline">{landingText(row)}</p>
        <p class="under">
          {is_in !== null && (
            <span class={`zone-word ${is_in ? "in" : "out"}`}>
              <svg viewBox="0 0 16 16" width="15" height="15" aria-hidden="true">
                <path d={is_in ? "M2 8.5 6.2 13 14 4" : "M3 3l10 10M13 3 3 13"} />
              </svg>
              {t(is_in ? "live.inZone" : "live.outOfZone")}
            </span>
          )}
          {sigma && <span>{sigma}</span>}
        </p>
      </div>
      <Numbers row={row} />
      {sentence && (
        <p class="sentence" lang={language.value === "en" ? undefined : "en"}>
          {sentence}
        </p>
      )}
      <Strip />
    </>
  );
}

/** The last balls; each can be looked at again. */
function Strip() {
  return (
    <ol class="strip" aria-label={t("live.others")} tabIndex={0}>
      {rows.value.slice(0, STRIP).map((row) => {
        const is_in = isInZone(row);
        const is_shown = row.id === shown.value?.id;
        return (
          <li key={row.id}>
            <button
              type="button"
              aria-pressed={is_shown}
              aria-label={`${timeText(row.at_ms)}: ${landingText(row)}`}
              onClick={() => (chosen.value = row.id === newest.value?.id ? null : row)}
            >
              <span class={`dot ${is_in === null ? "none" : is_in ? "in" : "out"}`} />
              {row.speed_m_s === null ? "–" : local(speedText(row.speed_m_s, unit.value))}
            </button>
          </li>
        );
      })}
    </ol>
  );
}

/** What is read aloud for each new ball, once. */
export function Announcer() {
  const row = newest.value;
  const text = row
    ? [
        row.target ? t("live.for", { name: row.target.name }) : t("live.ball"),
        landingText(row),
        row.speed_m_s === null ? null : `${local(speedText(row.speed_m_s, unit.value))} ${unit.value}`,
        row.outcome === "measured" ? null : named("outcome", row.outcome),
      ]
        .filter(Boolean)
        .join(", ")
    : "";
  return (
    <p class="only-heard" role="status" aria-live="polite" data-newest={row?.id}>
      {text}
    </p>
  );
}

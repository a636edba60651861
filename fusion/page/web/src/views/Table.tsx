// The balls of a session, page by page; filtered by the server.
import { useEffect, useState } from "preact/hooks";
import { get, noteError } from "../api";
import type { Session, ShotRow } from "../contract";
import { landingText } from "../parts/Numbers";
import { spinWay } from "../pure/miss";
import { speedText } from "../pure/units";
import { unit } from "../settings";
import { chosen, go, newest } from "../store";
import { dayText, local, named, t, timeText } from "../words";

const PAGE = 25;
const OUTCOMES = ["measured", "no bounce seen", "one camera", "too few points", "no court"];

interface Filter {
  target: string;
  outcome: string;
  from: string;
  until: string;
}

const ALL: Filter = { target: "", outcome: "", from: "", until: "" };

function questionFrom(id: number, filter: Filter, before: number | null): string {
  const question = new URLSearchParams({ session: `${id}`, limit: `${PAGE}` });
  if (before !== null) question.set("before", `${before}`);
  if (filter.target !== "") question.set("target", filter.target);
  if (filter.outcome !== "") question.set("outcome", filter.outcome);
  const [from, until] = [filter.from, filter.until].map((text) => Date.parse(text));
  if (Number.isFinite(from)) question.set("from_ms", `${from}`);
  if (Number.isFinite(until)) question.set("until_ms", `${until}`);
  return `/balls?${question}`;
}

export function Table(props: { session: Session }) {
  const { session } = props;
  const [filter, setFilter] = useState(ALL);
  // Where each page begins; the last one is shown.
  const [pages, setPages] = useState<(number | null)[]>([null]);
  const [answer, setAnswer] = useState<{ balls: ShotRow[]; next: number | null }>({
    balls: [],
    next: null,
  });
  const before = pages.at(-1) ?? null;
  const last = newest.value;
  const news = before === null && last?.session_id === session.id ? last.id : 0;
  const question = questionFrom(session.id, filter, before);
  useEffect(() => {
    let is_old = false;
    get<typeof answer>(question)
      .then((news) => !is_old && setAnswer(news))
      .catch(noteError);
    return () => {
      is_old = true;
    };
  }, [question, news]);
  useEffect(() => setPages([null]), [session.id]);
  const change = (name: keyof Filter) => (event: Event) => {
    const { value } = event.currentTarget as HTMLInputElement | HTMLSelectElement;
    setFilter({ ...filter, [name]: value });
    setPages([null]);
  };
  return (
    <section class="panel">
      <h2>{t("table.title")}</h2>
      <div class="bar">
        <label class="field">
          {t("table.target")}
          <select value={filter.target} onChange={change("target")}>
            <option value="">{t("table.all")}</option>
            {session.targets.map((one) => (
              <option key={one.target.name}>{one.target.name}</option>
            ))}
          </select>
        </label>
        <label class="field">
          {t("table.outcome")}
          <select value={filter.outcome} onChange={change("outcome")}>
            <option value="">{t("table.all")}</option>
            {OUTCOMES.map((one) => (
              <option key={one} value={one}>
                {named("outcome", one)}
              </option>
            ))}
          </select>
        </label>
        {(["from", "until"] as const).map((end) => (
          <label key={end} class="field">
            {t(`table.${end}`)}
            <input type="datetime-local" value={filter[end]} onChange={change(end)} />
          </label>
        ))}
      </div>
      <Rows balls={answer.balls} />
      <div class="bar pages">
        <button type="button" disabled={pages.length < 2} onClick={() => setPages(pages.slice(0, -1))}>
          {t("table.newer")}
        </button>
        <span aria-live="polite">{t("table.page", { n: pages.length })}</span>
        <button
          type="button"
          disabled={answer.next === null}
          onClick={() => setPages([...pages, answer.next])}
        >
          {t("table.older")}
        </button>
      </div>
    </section>
  );
}

function Rows(props: { balls: ShotRow[] }) {
  if (props.balls.length === 0) return <p class="quiet-text">{t("table.empty")}</p>;
  const look = (row: ShotRow) => {
    chosen.value = row;
    go("live");
  };
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={t("table.title")}>
      <table class="balls">
        <thead>
          <tr>
            <th scope="col" class="number">{t("table.ball")}</th>
            <th scope="col">{t("table.time")}</th>
            <th scope="col">{t("table.target")}</th>
            <th scope="col">{t("table.landing")}</th>
            <th scope="col" class="number">{t("live.speed")} ({unit.value})</th>
            <th scope="col" class="number">{t("live.spin")} (rpm)</th>
            <th scope="col" class="number">{t("live.net")} (cm)</th>
            <th scope="col">{t("table.outcome")}</th>
          </tr>
        </thead>
        <tbody>
          {props.balls.map((row) => (
            <tr key={row.id}>
              <td class="number">
                <button type="button" class="quiet" onClick={() => look(row)}
                  aria-label={t("table.look", { n: row.id })}>
                  {row.id}
                </button>
              </td>
              <td title={dayText(row.at_ms)}>{timeText(row.at_ms)}</td>
              <td>{row.target?.name ?? "–"}</td>
              <td>{row.landing_m ? landingText(row) : "–"}</td>
              <td class="number">{row.speed_m_s === null ? "–" : local(speedText(row.speed_m_s, unit.value))}</td>
              <td class="number">
                {row.spin_rpm === null
                  ? "–"
                  : `${Math.abs(row.spin_rpm).toFixed(0)} ${named("spin", spinWay(row.spin_rpm))}`}
              </td>
              <td class="number">
                {row.net_height_m === null ? "–" : (100 * row.net_height_m).toFixed(0)}
              </td>
              <td>{named("outcome", row.outcome)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

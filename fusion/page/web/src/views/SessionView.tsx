import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { act, address, note, send } from "../api";
import type { Session, SessionRow, ShotRow, TargetSummary, Xy } from "../contract";
import { Doing } from "../parts/Buttons";
import { CourtMap, EllipseMark, FAR_HALF, at } from "../plots/CourtMap";
import { Figure } from "../plots/Figure";
import { Key, NO_MARK, Point, markOf } from "../plots/marks";
import { Trend, TrendKey, type Series } from "../plots/Trend";
import { centimetres } from "../pure/units";
import { court, newest, status } from "../store";
import { dayText, t } from "../words";
import {
  MAX_POINTS, hasMoreSessions, load, loadMoreSessions, loadSessions, sessions, type Loaded,
} from "./loaded";
import { Mcap } from "./Mcap";
import { Table } from "./Table";

const chosen = signal<number | null>(null);
const other = signal<number | null>(null);
const loaded = signal<Loaded | null>(null);
const compared = signal<Loaded | null>(null);
/** A drill fires every few seconds; the summary needs no more. */
const REFRESH_MS = 700;

export function SessionView() {
  useEffect(() => void loadSessions(), []);
  const running = status.value?.session?.id ?? null;
  const id = chosen.value ?? running ?? sessions.value[0]?.id ?? null;
  const last = newest.value;
  const news = last !== null && last.session_id === id ? `${last.id} ${last.sentence}` : "";
  useEffect(() => {
    const is_here = loaded.value?.session.id === id;
    const timer = setTimeout(() => void load(loaded, id), is_here ? REFRESH_MS : 0);
    return () => clearTimeout(timer);
  }, [id, news]);
  useEffect(() => void load(compared, other.value), [other.value]);
  const here = loaded.value;
  return (
    <div class="view">
      <h1>{t("tab.session")}</h1>
      <Choice id={id} />
      {here === null || here.session.id !== id ? (
        <p class="quiet-text">{id === null ? t("session.none") : t("session.loading")}</p>
      ) : (
        <Pages here={here} beside={compared.value} />
      )}
    </div>
  );
}

function sessionName(session: SessionRow): string {
  return `${session.name} · ${dayText(session.started_ms)}`;
}

function Choice(props: { id: number | null }) {
  const { id } = props;
  const pick = (place: typeof chosen) => (event: Event) => {
    const { value } = event.currentTarget as HTMLSelectElement;
    place.value = value === "" ? null : Number(value);
  };
  const begin = async () => {
    const name = new Date().toISOString().slice(0, 16).replace("T", " ");
    const made = await act(() => send<SessionRow>("POST", "/sessions", { name }));
    if (!made) return;
    chosen.value = made.id;
    note("good", t("session.began", { name: made.name }));
    await loadSessions();
  };
  return (
    <div class="bar">
      <label class="field wide-name">
        {t("session.which")}
        <select value={id ?? ""} onChange={pick(chosen)}>
          {sessions.value.map((one) => (
            <option key={one.id} value={one.id}>
              {sessionName(one)} ({one.n_balls})
            </option>
          ))}
        </select>
      </label>
      <label class="field wide-name">
        {t("session.compare")}
        <select value={other.value ?? ""} onChange={pick(other)}>
          <option value="">{t("session.nothing")}</option>
          {sessions.value
            .filter((one) => one.id !== id)
            .map((one) => (
              <option key={one.id} value={one.id}>
                {sessionName(one)} ({one.n_balls})
              </option>
            ))}
        </select>
      </label>
      {hasMoreSessions.value && (
        <button type="button" onClick={() => void loadMoreSessions()}>
          {t("session.older")}
        </button>
      )}
      <span class="gap" />
      {id !== null && (
        <>
          <a class="button" href={address(`/sessions/${id}/balls.csv`)} download>
            CSV
          </a>
          <a class="button" href={address(`/sessions/${id}/session.json`)} download>
            JSON
          </a>
          <Mcap id={id} />
        </>
      )}
      <Doing do={begin}>{t("session.begin")}</Doing>
    </div>
  );
}

function Pages(props: { here: Loaded; beside: Loaded | null }) {
  const { here, beside } = props;
  return (
    <>
      <Summary session={here.session} />
      <div class="columns">
        <LandingMap here={here} beside={beside} />
        <div class="stack">
          <Trends session={here.session} />
        </div>
      </div>
      {beside && <Difference here={here.session} beside={beside.session} />}
      <Targets session={here.session} />
      <Table session={here.session} />
    </>
  );
}

function Summary(props: { session: Session }) {
  const { session } = props;
  const n = session.targets.reduce((sum, one) => sum + one.n, 0);
  const n_in = session.targets.reduce((sum, one) => sum + one.n_in_zone, 0);
  const pace = session.pace;
  return (
    <dl class="tiles">
      <Tile name={t("session.balls")} value={`${session.n_balls}`} />
      <Tile name={t("session.measured")} value={`${session.n_measured}`} />
      <Tile
        name={t("session.inZone")}
        value={n === 0 ? "–" : `${Math.round((100 * n_in) / n)} %`}
        under={t("session.of", { n: n_in, all: n })}
      />
      <Tile
        name={t("session.pace")}
        value={pace ? pace.rating.toFixed(0) : "–"}
        under={pace ? `± ${pace.sigma.toFixed(0)} · n = ${pace.n}` : t("session.noPace")}
      />
    </dl>
  );
}

function Tile(props: { name: string; value: string; under?: string }) {
  return (
    <div>
      <dt>{props.name}</dt>
      <dd>
        <span class="value">{props.value}</span>
        {props.under && <span class="sigma">{props.under}</span>}
      </dd>
    </div>
  );
}

function indexOf(targets: readonly TargetSummary[], row: ShotRow): number {
  return row.target ? targets.findIndex((one) => one.target.name === row.target?.name) : -1;
}

function LandingMap(props: { here: Loaded; beside: Loaded | null }) {
  const { here, beside } = props;
  const { targets } = here.session;
  const points = here.balls.filter((row) => row.landing_m !== null);
  const most = Math.max(here.session.n_balls, beside?.session.n_balls ?? 0);
  const legend = (
    <>
    <ul class="legend">
      {targets.map((one, i) => (
        <li key={one.target.name}>
          <Key mark={markOf(i)} /> {one.target.name}
        </li>
      ))}
      {targets.length === 0 && (
        <li>
          <Key mark={NO_MARK} /> {t("session.noTarget")}
        </li>
      )}
      {beside && (
        <li>
          <span class="key hollow" aria-hidden="true" /> {beside.session.name}
        </li>
      )}
    </ul>
    {most > MAX_POINTS && (
      <p class="quiet-text">{t("session.newest", { n: `${MAX_POINTS}`, all: `${most}` })}</p>
    )}
    </>
  );
  return (
    <Figure title={t("session.map")} file={`landings-${here.session.id}`} legend={legend}>
      <CourtMap
        court={court.value}
        area={FAR_HALF}
        label={t("session.mapLabel", { n: points.length, all: here.session.n_balls })}
      >
        {targets.map((one) => (
          <Zone key={one.target.name} at_m={one.target.landing_m} r={one.target.zone_radius_m} />
        ))}
        {beside?.balls.map(
          (row) =>
            row.landing_m && (
              <Point
                key={row.id}
                class="hollow"
                mark={markOf(indexOf(targets, row))}
                at={at(row.landing_m)}
                r={0.09}
              />
            ),
        )}
        {points.map((row) => (
          <Point
            key={row.id}
            mark={markOf(indexOf(targets, row))}
            at={at(row.landing_m as Xy)}
            r={0.11}
          />
        ))}
        {targets.map((one, i) => (
          <g key={one.target.name} class={`hue-line-${markOf(i).hue}`}>
            {one.ellipse_95 && <EllipseMark ellipse={one.ellipse_95} class="scatter" />}
            {one.mean_ellipse_95 && <EllipseMark ellipse={one.mean_ellipse_95} class="mean" />}
          </g>
        ))}
      </CourtMap>
    </Figure>
  );
}

function Zone(props: { at_m: Xy; r: number }) {
  const [cx, cy] = at(props.at_m);
  return (
    <g>
      <circle class="zone" cx={cx} cy={cy} r={props.r} />
      <path class="zone-cross" d={`M${cx - 0.2} ${cy}h0.4M${cx} ${cy - 0.2}v0.4`} />
    </g>
  );
}

const part = (pair: Xy | null, i: 0 | 1, times: number) => (pair ? pair[i] * times : null);

function Trends(props: { session: Session }) {
  const { trend, id } = props.session;
  const miss: Series[] = [
    {
      name: t("session.along"), hue: 0, shape: "circle", drawn: "points", sigmas: null,
      values: trend.map((one) => part(one.miss_m, 1, 100)),
    },
    {
      name: t("session.across"), hue: 1, shape: "square", drawn: "points", sigmas: null,
      values: trend.map((one) => part(one.miss_m, 0, 100)),
    },
  ];
  const wind: Series[] = [
    {
      name: t("session.windAlong"), hue: 0, shape: "circle", drawn: "line",
      values: trend.map((one) => part(one.wind_m_s, 1, 1)),
      sigmas: trend.map((one) => part(one.wind_sigma_m_s, 1, 1)),
    },
    {
      name: t("session.windAcross"), hue: 1, shape: "square", drawn: "line",
      values: trend.map((one) => part(one.wind_m_s, 0, 1)),
      sigmas: trend.map((one) => part(one.wind_sigma_m_s, 0, 1)),
    },
  ];
  const drag: Series[] = [
    {
      name: t("session.dragOne"), hue: 0, shape: "circle", drawn: "line",
      values: trend.map((one) => one.drag),
      sigmas: trend.map((one) => one.drag_sigma),
    },
  ];
  const known = drag[0]?.values.filter((value) => value !== null) ?? [];
  const around = known.length === 0 ? 0 : known.reduce((a, b) => a + b, 0) / known.length;
  const axis = t("session.axis");
  return (
    <>
      <Figure title={t("session.miss")} file={`miss-${id}`} legend={<TrendKey series={miss} />}>
        <Trend label={t("session.missLabel")} unit="cm" xLabel={axis} series={miss} least={50} />
      </Figure>
      <Figure title={t("session.wind")} file={`wind-${id}`} legend={<TrendKey series={wind} />}>
        <Trend label={t("session.windLabel")} unit="m/s" xLabel={axis} series={wind} least={1} />
      </Figure>
      <Figure title={t("session.drag")} file={`drag-${id}`} legend={<TrendKey series={drag} />}>
        <Trend
          label={t("session.dragLabel")} unit="" xLabel={axis} series={drag} least={0.03}
          around={around}
        />
      </Figure>
    </>
  );
}

/** "+12 ± 4", along and across. */
function biasText(one: TargetSummary | undefined, i: 0 | 1): string {
  if (!one?.bias_m) return "–";
  const sigma = one.bias_sigma_m ? ` ± ${centimetres(one.bias_sigma_m[i])}` : "";
  return `${signed(one.bias_m[i])}${sigma}`;
}

function signed(length_m: number): string {
  const cm = centimetres(length_m);
  return cm.startsWith("-") ? cm.replace("-", "−") : `+${cm}`;
}

/** What both tables of targets say. */
function TargetHead() {
  return (
    <thead>
      <tr>
        <th scope="col">{t("table.target")}</th>
        <th scope="col" class="number">{t("session.n")}</th>
        <th scope="col" class="number">{t("session.inZone")}</th>
        <th scope="col" class="number">{t("session.biasAlong")}</th>
        <th scope="col" class="number">{t("session.biasAcross")}</th>
      </tr>
    </thead>
  );
}

function Targets(props: { session: Session }) {
  const { targets } = props.session;
  if (targets.length === 0) return null;
  return (
    <section class="panel">
      <h2>{t("session.targets")}</h2>
      <div class="scroll" tabIndex={0} role="region" aria-label={t("session.targets")}>
        <table>
          <TargetHead />
          <tbody>
            {targets.map((one, i) => (
              <tr key={one.target.name}>
                <th scope="row">
                  <Key mark={markOf(i)} /> {one.target.name}
                </th>
                <td class="number">{one.n}</td>
                <td class="number">{one.n_in_zone}</td>
                <td class="number">{biasText(one, 1)}</td>
                <td class="number">{biasText(one, 0)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

/** What is different between two sessions, and whether that is more than chance (2 sigma). */
function Difference(props: { here: Session; beside: Session }) {
  const { here, beside } = props;
  const rows = here.targets.flatMap((one) => {
    const match = beside.targets.find((two) => two.target.name === one.target.name);
    return match ? [{ one, match }] : [];
  });
  const cell = (one: TargetSummary, two: TargetSummary, i: 0 | 1) => {
    if (!one.bias_m || !two.bias_m) return "–";
    const off_m = one.bias_m[i] - two.bias_m[i];
    const sigmas = [one.bias_sigma_m?.[i], two.bias_sigma_m?.[i]];
    if (sigmas.some((sigma) => sigma === undefined)) return signed(off_m);
    const sigma_m = Math.hypot(...(sigmas as number[]));
    const is_sure = Math.abs(off_m) > 2 * sigma_m;
    return `${signed(off_m)} ± ${centimetres(sigma_m)}${is_sure ? " *" : ""}`;
  };
  const share = (one: TargetSummary) => (one.n === 0 ? "–" : `${Math.round((100 * one.n_in_zone) / one.n)} %`);
  return (
    <section class="panel">
      <h2>{t("session.difference", { here: here.name, other: beside.name })}</h2>
      {rows.length === 0 ? (
        <p class="quiet-text">{t("session.noSameTargets")}</p>
      ) : (
        <div class="scroll" tabIndex={0} role="region" aria-label={t("session.compare")}>
          <table class="difference">
            <TargetHead />
            <tbody>
              {rows.map(({ one, match }) => (
                <tr key={one.target.name}>
                  <th scope="row">{one.target.name}</th>
                  <td class="number">{one.n} / {match.n}</td>
                  <td class="number">{share(one)} / {share(match)}</td>
                  <td class="number">{cell(one, match, 1)}</td>
                  <td class="number">{cell(one, match, 0)}</td>
                </tr>
              ))}
            </tbody>
          </table>
          <p class="quiet-text">{t("session.sure")}</p>
        </div>
      )}
    </section>
  );
}

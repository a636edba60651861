// Speaks the server's words without a court, for work on the page: `npm run mock`, `npm run dev`.
// Shots come from a small drag-and-lift ODE with a fixed seed. Serves dist/ too, when it is built.
// MOCK_PORT, MOCK_EVERY_MS (between balls), MOCK_BALLS (already there), MOCK_TOKEN.
import { createReadStream, existsSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { deflateSync } from "node:zlib";
import { WebSocketServer } from "ws";

const PORT = Number(process.env.MOCK_PORT ?? 8787);
const EVERY_MS = Number(process.env.MOCK_EVERY_MS ?? 4000);
const TOKEN = process.env.MOCK_TOKEN ?? "mock";
const DIST = new URL("../dist", import.meta.url).pathname;
const START_MS = Date.now();

let seed = 7;
const chance = () => {
  seed = (seed * 1664525 + 1013904223) % 4294967296;
  return seed / 4294967296;
};
const normal = () => Math.sqrt(-2 * Math.log(1 - chance())) * Math.cos(2 * Math.PI * chance());

const W = 4.115, D = 5.485, L = 23.77, N = 11.885;
const court = {
  name: "rose",
  lines_m: [
    [[-D, 0], [D, 0]], [[-D, L], [D, L]], [[-D, 0], [-D, L]], [[D, 0], [D, L]],
    [[-W, 0], [-W, L]], [[W, 0], [W, L]], [[-W, N - 6.4], [W, N - 6.4]],
    [[-W, N + 6.4], [W, N + 6.4]], [[0, N - 6.4], [0, N + 6.4]], [[0, 0], [0, 0.1]],
    [[0, L - 0.1], [0, L]],
  ],
  net: { y_m: N, posts_x_m: [-6.4, 6.4], height_post_m: 1.07, height_center_m: 0.914 },
  launcher_m: [0, 0, 1],
  cameras_m: [[-2, -0.5, 3.5], [2, -0.5, 3.5]],
};
const target = (name, x, y, speed_m_s, spin_rpm) => ({
  name, landing_m: [x, y], zone_radius_m: 1, speed_m_s, spin_rpm, net_height_m: null, apex_m: null,
});
const drills = new Map([
  ["five corners", { name: "five corners", order: "random", period_s: 4, targets: [
    target("deep left", -2.5, 22, 26.4, -600), target("deep right", 2.5, 21.5, 23.9, null),
    target("short left", -1.8, 16.8, 18.9, -400), target("short right", 1.8, 17.5, 20, 500),
    target("middle", 0, 20, 27.2, -900)] }],
  ["backhand corner", { name: "backhand corner", order: "in turn", period_s: 3, targets: [
    target("corner", -3.2, 22.4, 25, -800)] }],
]);

/** Positions every 10 ms until the ground is met, and a hop after it. */
function flight(speed, up, side, spin_rpm, drag) {
  const deg = Math.PI / 180;
  const p = [0, 0, 1];
  const v = [speed * Math.cos(up * deg) * Math.sin(side * deg),
    speed * Math.cos(up * deg) * Math.cos(side * deg), speed * Math.sin(up * deg)];
  const k = 0.5 * 1.204 * Math.PI * 0.033 ** 2 / 0.0577;
  const track = [], hop = [];
  let bounce = null, net = null;
  for (let i = 0; i < 400; i++) {
    const s = Math.hypot(...v);
    const lift = (0.6 * spin_rpm * 0.1047 * 0.033) / s;
    const before = [...p];
    const a = [-k * drag * s * v[0], -k * drag * s * v[1] - k * lift * s * v[2],
      -9.81 - k * drag * s * v[2] + k * lift * s * v[1]];
    for (let j = 0; j < 3; j++) { v[j] += a[j] * 0.01; p[j] += v[j] * 0.01; }
    const row = { t_ns: (i + 1) * 1e7, position_m: [...p], velocity_m_s: [...v],
      sigma_m: [0.004, 0.008, 0.004], left_px: null, right_px: null };
    if (before[1] < N && p[1] >= N) net = { height_m: p[2], sigma_m: 0.006 };
    if (!bounce && p[2] <= 0.033) {
      p[2] = 0.033;
      const out = [v[0] * 0.7, v[1] * 0.7, -v[2] * 0.72];
      bounce = { t_ns: row.t_ns, position_m: [p[0], p[1], 0.033], velocity_in_m_s: [...v],
        velocity_out_m_s: out, covariance_m2: [[9e-6, 2e-6], [2e-6, 3.6e-5]] };
      v.splice(0, 3, ...out);
    } else (bounce ? hop : track).push(row);
    if (hop.length > 9) break;
  }
  return { track: [...track, ...hop], bounce, net };
}

function solved(wanted) {
  const speed = wanted.speed_m_s ?? 22, spin = wanted.spin_rpm ?? 0;
  const side = (Math.atan2(wanted.landing_m[0], wanted.landing_m[1]) * 180) / Math.PI;
  let [low, high] = [0, 28];
  for (let i = 0; i < 26; i++) {
    const mid = (low + high) / 2;
    const at = flight(speed, mid, side, spin, 0.55).bounce;
    if (at && at.position_m[1] < wanted.landing_m[1]) low = mid; else high = mid;
  }
  return { speed_m_s: speed, elevation_deg: low, azimuth_deg: side, spin_rpm: spin };
}

const sessions = [
  { id: 1, name: "Saturday, without wind", started_ms: START_MS - 864e5, ended_ms: START_MS - 8e7 },
  { id: 2, name: "Sunday", started_ms: START_MS - 36e5, ended_ms: null },
];
const balls = [];
let turn = 0, is_stopped = false, drill = { running: false, name: null, is_correcting: true,
  ball: 0, balls: null, target: null, said: null };
let job = null;
const said = ["mock: started"];

function shoot(session_id, at_ms) {
  const list = drills.get(drill.name ?? "five corners")?.targets ?? drills.get("five corners").targets;
  const goal = list[turn++ % list.length];
  const set = solved(goal);
  const n = balls.filter((one) => one.session_id === session_id).length;
  const learned = Math.exp(-n / 6);
  const real = flight(set.speed_m_s * (1 + 0.035 * learned + 0.008 * normal()),
    set.elevation_deg + 0.9 * learned + 0.25 * normal(), set.azimuth_deg + 0.7 * learned + 0.5 * normal(),
    set.spin_rpm + 30 * normal(), 0.55 + 0.02 * normal());
  const is_whole = balls.length % 17 !== 11;
  const speed = Math.hypot(...real.track[0].velocity_m_s);
  const landing = is_whole ? real.bounce.position_m.slice(0, 2) : null;
  const miss = landing && landing.map((x, i) => x - goal.landing_m[i]);
  const cm = miss && miss.map((x) => Math.round(100 * Math.abs(x)));
  const sentence = !miss ? `${goal.name}: landing not measured (no bounce seen): nothing is changed`
    : `${goal.name}: ${cm[1]} cm ${miss[1] > 0 ? "long" : "short"}: ${Math.round(cm[1] * 0.7)} cm speed +1.8 %, ${Math.round(cm[1] * 0.3)} cm wind 0.7 m/s more from behind: elevation ${(-0.3 * learned).toFixed(1)}°`;
  const shot = { shot_idx: balls.length, outcome: is_whole ? "measured" : "no bounce seen",
    launch: { t_ns: 0, position_m: [0, 0, 1], speed_m_s: speed, elevation_deg: set.elevation_deg,
      azimuth_deg: set.azimuth_deg, spin_rpm: set.spin_rpm,
      sigma: { speed_m_s: 0.03, elevation_deg: 0.04, azimuth_deg: 0.05, spin_rpm: 120 } },
    bounce: is_whole ? real.bounce : null, net: real.net, track: real.track,
    residual_px: { left: 0.2, right: 0.2 }, frames_lost: { left: 0, right: 0 } };
  const air = { drag: 0.55 - 0.02 * learned, drag_sigma: 0.012 + 0.03 * learned,
    wind_m_s: [0.5 * (1 - learned), -1.2 * (1 - learned)],
    wind_sigma_m_s: [0.15 + 0.8 * learned, 0.2 + learned] };
  const ball = { id: balls.length + 1, session_id, at_ms, outcome: shot.outcome, speed_m_s: speed,
    speed_sigma_m_s: 0.03, elevation_deg: set.elevation_deg, azimuth_deg: set.azimuth_deg,
    spin_rpm: set.spin_rpm, spin_sigma_rpm: 120, net_height_m: real.net?.height_m ?? null,
    net_height_sigma_m: real.net ? 0.006 : null, landing_m: landing,
    landing_covariance_m2: landing && real.bounce.covariance_m2, target: goal, miss_m: miss, sentence,
    shot, reference_m: flight(set.speed_m_s, set.elevation_deg, set.azimuth_deg, set.spin_rpm, 0.55)
      .track.filter((row) => row.t_ns < (real.bounce?.t_ns ?? 1e12)).map((row) => row.position_m),
    correction: { correction_idx: balls.length, reason: "standing", is_trusted: true, sentence,
      target: goal.name, next: set, expected_landing_m: goal.landing_m, miss_m: miss,
      parts: [], air, machine: null } };
  balls.push(ball);
  return ball;
}

function boot() {
  const n = Number(process.env.MOCK_BALLS ?? 24);
  for (let i = 0; i < 40; i++) shoot(1, sessions[0].started_ms + i * 5000);
  for (let i = 0; i < n; i++) shoot(2, Date.now() - (n - i) * 5000);
}

const rowFrom = ({ shot, reference_m, correction, ...row }) => row;
const sessionRow = (one) => {
  const of = balls.filter((ball) => ball.session_id === one.id);
  return { ...one, n_balls: of.length, n_measured: of.filter((ball) => ball.landing_m).length };
};

function summary(rows) {
  const mean = [0, 1].map((i) => rows.reduce((sum, row) => sum + row.miss_m[i], 0) / rows.length);
  const spread = [0, 1].map((i) => Math.sqrt(rows.reduce((sum, row) =>
    sum + (row.miss_m[i] - mean[i]) ** 2, 0) / Math.max(1, rows.length - 1)));
  const center_m = mean.map((m, i) => m + rows[0].target.landing_m[i]);
  const root = Math.sqrt(rows.length);
  const ellipse = (k) => ({ center_m, turned_rad: Math.PI / 2,
    half_axes_m: [k * 2.45 * spread[1], k * 2.45 * spread[0]] });
  return { target: rows[0].target, n: rows.length,
    n_in_zone: rows.filter((row) => Math.hypot(...row.miss_m) <= row.target.zone_radius_m).length,
    bias_m: mean, bias_sigma_m: spread.map((s) => s / root), ellipse_95: ellipse(1),
    mean_ellipse_95: ellipse(1 / root) };
}

function sessionFrom(one) {
  const of = balls.filter((ball) => ball.session_id === one.id);
  const names = [...new Set(of.filter((ball) => ball.miss_m).map((ball) => ball.target.name))];
  return { ...sessionRow(one),
    targets: names.map((name) => summary(of.filter((b) => b.target.name === name && b.miss_m))),
    trend: of.map((ball) => ({ shot_id: ball.id, at_ms: ball.at_ms, miss_m: ball.miss_m,
      drag: ball.correction.air.drag, drag_sigma: ball.correction.air.drag_sigma,
      wind_m_s: ball.correction.air.wind_m_s, wind_sigma_m_s: ball.correction.air.wind_sigma_m_s })),
    pace: { rating: 38, sigma: 4, n: of.length } };
}

const limits = { min: { speed_m_s: 11, elevation_deg: 0, azimuth_deg: -10, spin_rpm: -2500 },
  max: { speed_m_s: 30.5, elevation_deg: 50, azimuth_deg: 10, spin_rpm: 2500 } };
const status = () => ({ court: "rose", version: "mock", now_ms: Date.now(), fusion: "alive",
  boards: ["left", "right"].map((camera) => ({ camera, state: "alive", heard_age_ms: 12,
    clock_sigma_ms: 0.14, n_batches: 5400, n_lost: 2, frames_s: 90, candidates_s: 108 })),
  machine: { state: is_stopped ? "stopped" : "ready", heard_age_ms: 300,
    settings: solved(drills.get("five corners").targets[0]), limits },
  drill, session: sessionRow(sessions.at(-1)), watch: null, setup: job, needs_token: true,
  n_viewers: live.clients.size, n_lost: 0 });

/** A picture in grey with a bright trapezium, as PNG. */
function png(w, h) {
  const rows = Buffer.alloc((w + 1) * h, 90);
  for (let y = 0; y < h; y++) {
    rows[y * (w + 1)] = 0;
    for (let x = 0; x < w; x++) rows[y * (w + 1) + 1 + x] = y < h * 0.3 ? 150 - y / 4 : 84 + ((x * 7 + y * 13) % 9);
  }
  const crcTable = Array.from({ length: 256 }, (_, n) => {
    for (let k = 0; k < 8; k++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
    return n >>> 0;
  });
  const chunk = (type, data) => {
    const body = Buffer.concat([Buffer.from(type), data]);
    let crc = 0xffffffff;
    for (const byte of body) crc = crcTable[(crc ^ byte) & 255] ^ (crc >>> 8);
    const [size, end] = [Buffer.alloc(4), Buffer.alloc(4)];
    size.writeUInt32BE(data.length);
    end.writeUInt32BE((crc ^ 0xffffffff) >>> 0);
    return Buffer.concat([size, body, end]);
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(w, 0);
  head.writeUInt32BE(h, 4);
  head.set([8, 0, 0, 0, 0], 8);
  return Buffer.concat([Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]), chunk("IHDR", head),
    chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))]);
}

const cameraView = (camera) => ({ camera, at_ms: Date.now(), image_px: [640, 480],
  sharpness: 22 + 3 * chance(), saturated_part: 0.001, dark_part: 0.01, median_level: 92,
  lines_px: [[[150, 460], [250, 200]], [[490, 460], [390, 200]], [[250, 200], [390, 200]],
    [[205, 316], [435, 316]], [[320, 316], [320, 200]]],
  candidates_px: [0, 1, 2, 3, 4].map((i) => ({ at_px: [300 + 9 * i, 180 - 22 * i + 4 * i * i], width_px: 6 })) });

class Problem extends Error {
  constructor(code, error, expected) {
    super(error);
    Object.assign(this, { code, body: { error, expected } });
  }
}

const tell = (message) => {
  for (const client of live.clients) client.send(JSON.stringify(message));
};

function work(kind, verdict) {
  job = { id: (job?.id ?? 0) + 1, kind, state: "running", progress: 0, lines: ["looking for lines"],
    verdict: null, at_ms: Date.now() };
  const timer = setInterval(() => {
    job = { ...job, progress: Math.min(1, job.progress + 0.25), lines: [...job.lines, "fitted anew"] };
    if (job.progress === 1) {
      clearInterval(timer);
      job = { ...job, state: "done", verdict };
    }
    tell({ type: "job", job });
  }, 250);
  return job;
}

function pageOf(question) {
  const number = (key) => (question.get(key) === null ? null : Number(question.get(key)));
  const limit = number("limit") ?? 50;
  const found = balls.filter((ball) =>
    (number("session") === null || ball.session_id === number("session")) &&
    (number("before") === null || ball.id < number("before")) &&
    (number("from_ms") === null || ball.at_ms >= number("from_ms")) &&
    (number("until_ms") === null || ball.at_ms <= number("until_ms")) &&
    (question.get("outcome") === null || ball.outcome === question.get("outcome")) &&
    (question.get("target") === null || ball.target.name === question.get("target"))).reverse();
  const page = found.slice(0, limit);
  return { balls: page.map(rowFrom), next: found.length > limit ? page.at(-1).id : null };
}

function aimed(wanted) {
  const settings = solved(wanted);
  const reachable = Math.abs(settings.azimuth_deg) <= 10 && settings.speed_m_s <= 30.5;
  if (!reachable) {
    const x = Math.sign(wanted.landing_m[0]) * Math.tan((10 * Math.PI) / 180) * wanted.landing_m[1];
    return { ...aimed({ ...wanted, landing_m: [x * 0.999, wanted.landing_m[1]],
      speed_m_s: Math.min(30, wanted.speed_m_s ?? 22) }), reachable: false,
      sentence: "the machine turns by at most 10.0°; this needs " + Math.abs(settings.azimuth_deg).toFixed(1) + "°" };
  }
  const path = flight(settings.speed_m_s, settings.elevation_deg, settings.azimuth_deg, settings.spin_rpm, 0.55);
  return { reachable, sentence: null, settings, landing_m: path.bounce.position_m.slice(0, 2),
    flight_m: path.track.filter((row) => row.t_ns < path.bounce.t_ns).map((row) => row.position_m),
    net_height_m: path.net?.height_m ?? null };
}

function changed(news) {
  drill = { ...drill, ...news };
  tell({ type: "drill", drill });
  return drill;
}

/** [method, path, needs token, answer] */
const WAYS = [
  ["GET", /^\/status$/, false, status],
  ["GET", /^\/court$/, false, () => court],
  ["GET", /^\/balls$/, false, (_, __, question) => pageOf(question)],
  ["GET", /^\/balls\/(\d+)$/, false, ([id]) => balls[id - 1]],
  ["GET", /^\/sessions$/, false, () => ({ sessions: [...sessions].reverse().map(sessionRow), next: null })],
  ["POST", /^\/sessions$/, true, (_, { name }) => {
    sessions.push({ id: sessions.length + 1, name, started_ms: Date.now(), ended_ms: null });
    return sessionRow(sessions.at(-1));
  }],
  ["GET", /^\/sessions\/(\d+)$/, false, ([id]) => sessions[id - 1] && sessionFrom(sessions[id - 1])],
  ["GET", /^\/sessions\/(\d+)\/session\.json$/, false, ([id]) => sessionFrom(sessions[id - 1])],
  ["GET", /^\/sessions\/(\d+)\/balls\.csv$/, false, ([id]) => "id,speed_m_s\n" +
    balls.filter((b) => b.session_id === Number(id)).map((b) => `${b.id},${b.speed_m_s}\n`).join("")],
  ["GET", /^\/drills$/, false, () => ({ drills: [...drills.values()] })],
  ["PUT", /^\/drills\/(.+)$/, true, ([name], body) => {
    const bad = body.targets.find((one) => !aimed(one).reachable);
    if (bad) throw new Problem(400, `${bad.name}: ${aimed(bad).sentence}`, "a target within reach");
    drills.set(decodeURIComponent(name), body);
    return body;
  }],
  ["DELETE", /^\/drills\/(.+)$/, true, ([name]) => drills.delete(decodeURIComponent(name)) && {}],
  ["POST", /^\/aim$/, false, (_, body) => aimed(body)],
  ["POST", /^\/drill\/start$/, true, (_, body) => changed({ running: true, ...body, ball: 0,
    target: drills.get(body.name)?.targets[0] ?? null })],
  ["POST", /^\/drill\/stop$/, true, () => changed({ running: false })],
  ["POST", /^\/drill\/correcting$/, true, (_, body) => changed(body)],
  ["POST", /^\/machine\/(stop|resume)$/, true, ([what]) => {
    is_stopped = what === "stop";
    tell({ type: "status", status: status() });
    return {};
  }],
  ["GET", /^\/cameras\/(left|right)\/picture\.png$/, false, () => png(640, 480)],
  ["GET", /^\/cameras\/(left|right)\/view$/, false, ([camera]) => cameraView(camera)],
  ["POST", /^\/cameras\/(left|right)\/look$/, true, ([camera]) => cameraView(camera)],
  ["POST", /^\/setup\/calibrations$/, true, () => work("court",
    "A bounce at the far baseline is known to 0.4 cm along and 0.3 cm across (1 sigma).")],
  ["GET", /^\/setup\/calibrations\/(\d+)\/found\.png$/, false, () => png(1280, 480)],
  ["POST", /^\/setup\/calibrations\/(\d+)\/use$/, true, () => ({
    sentence: "rig.toml is written; the old one is rig.toml.1; fusion must be started anew" })],
  ["GET", /^\/setup\/jobs\/(\d+)$/, false, () => job],
  ["POST", /^\/setup\/recordings$/, true, () => work("recording", "clip.mcap: 3.1 MB, nothing lost")],
  ["GET", /^\/setup\/recordings$/, false, () => ({ recordings: [
    { name: "2026-11-22-16-04.mcap", bytes: 3_141_592, at_ms: START_MS - 5e5 }] })],
  // What every MCAP file begins with.
  ["GET", /^\/setup\/recordings\/(.+)\.mcap$/, false, () => "\x89MCAP0\r\n"],
  ["GET", /^\/clips$/, false, () => ({ clips: [
    { name: "serve.y4m", bytes: 27_648_512, at_ms: START_MS - 6e7, is_labelled: true }] })],
  ["POST", /^\/setup\/pair$/, true, (_, { camera }) => ({ file: `rose-${camera}.pair` })],
  ["GET", /^\/setup\/pair\/(.+)$/, true, ([name]) => `keys of ${name}\n`],
  ["GET", /^\/logs\.txt$/, true, () => said.join("\n")],
];

const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css",
  ".svg": "image/svg+xml", ".webmanifest": "application/manifest+json" };

function serveFile(url, answer) {
  const path = normalize(url.pathname === "/" ? "/index.html" : url.pathname);
  const file = join(DIST, path);
  if (!file.startsWith(DIST) || !existsSync(file)) return answer.writeHead(404).end("not there");
  answer.writeHead(200, { "Content-Type": TYPES[extname(file)] ?? "application/octet-stream",
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:" });
  createReadStream(file).pipe(answer);
}

async function serve(request, answer) {
  const url = new URL(request.url, "http://mock");
  if (!url.pathname.startsWith("/api/v1")) return serveFile(url, answer);
  const path = url.pathname.slice("/api/v1".length);
  let text = "";
  for await (const part of request) text += part;
  try {
    const way = WAYS.find(([method, at]) => method === request.method && at.test(path));
    if (!way) throw new Problem(404, `${path}: there is nothing`);
    if (way[2] && request.headers.authorization !== `Bearer ${TOKEN}`) throw new Problem(401, "a token is needed");
    const said = way[3](way[1].exec(path).slice(1), text ? JSON.parse(text) : {}, url.searchParams);
    if (!said) throw new Problem(404, `${path}: there is none`);
    if (Buffer.isBuffer(said)) return answer.writeHead(200, { "Content-Type": "image/png" }).end(said);
    if (typeof said === "string") return answer.writeHead(200, { "Content-Type": "text/plain",
      "Content-Disposition": `attachment; filename="${path.split("/").at(-1)}"` }).end(said, "latin1");
    answer.writeHead(200, { "Content-Type": "application/json" }).end(JSON.stringify(said));
  } catch (error) {
    answer.writeHead(error.code ?? 500, { "Content-Type": "application/json" })
      .end(JSON.stringify(error.body ?? { error: String(error) }));
  }
}

const server = createServer((request, answer) => void serve(request, answer));
const live = new WebSocketServer({ server, path: "/api/v1/live" });
boot();
if (EVERY_MS > 0) setInterval(() => {
  if (is_stopped) return;
  const ball = shoot(sessions.at(-1).id, Date.now());
  tell({ type: "ball", ball: { ...ball, correction: null, sentence: null } });
  setTimeout(() => tell({ type: "correction", id: ball.id, ball }), 150);
  if (drill.running) changed({ ball: drill.ball + 1, target: ball.target,
    running: drill.balls === null || drill.ball + 1 < drill.balls });
}, EVERY_MS);
setInterval(() => tell({ type: "status", status: status() }), 1000);
server.listen(PORT, "127.0.0.1", () => console.log(`mock: http://127.0.0.1:${PORT}/#token=${TOKEN}`));

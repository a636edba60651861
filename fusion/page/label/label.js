// What a person does → labels. Each change is shown at once, sent in turn, and taken back when the
// program refuses it.

import { $, clamp, desk, fit, isInPicture, isOn, moveTo, moveToMiddle, pixelFrom, stageSize,
  stateOf, zoom } from "./desk.js";
import { ask, foresee, luma, ofClip, paint } from "./frames.js";
import { draw, showSaved, showTrouble } from "./drawing.js";
import { t, translate } from "./words.js";

const MAX_UNDO = 500;
const MAX_LAG = 60;
const DRAG_FROM = 4; // screen pixels: less is a click
const { labels, looked, view } = desk;

// ---- going to a frame

/// A step marks the frame it leaves as looked at; a jump does not.
function step(by) {
  looked.add(desk.at);
  go(desk.at + by);
}

function go(to) {
  desk.at = clamp(to, 0, desk.clip.n_frames - 1);
  show();
}

async function show() {
  const idx = desk.at;
  draw();
  try {
    const needed = [luma(idx)];
    if (isOn("difference")) needed.push(luma(Math.max(0, idx - desk.lag)));
    const [now, before] = await Promise.all(needed);
    if (idx !== desk.at) return; // gone on meanwhile
    if (desk.shown !== idx && isOn("follow")) follow();
    paint(now, before, isOn("stretch"));
    desk.shown = idx;
    draw();
    foresee([idx + 1, idx - 1, idx + 2, idx + 3]);
  } catch (error) {
    if (idx === desk.at) showTrouble(t("Frame {idx} cannot be shown: {why}",
      { idx, why: error.message }));
  }
}

/// When zoomed, the ball, or the place where it should be by now, comes to the middle.
function follow() {
  if (view.isFit) return;
  const [one, two] = [labels.get(desk.at - 1), labels.get(desk.at - 2)];
  const guess = one && two ? { x_px: 2 * one.x_px - two.x_px, y_px: 2 * one.y_px - two.y_px } : one;
  const ball = labels.get(desk.at) ?? guess ?? labels.get(desk.at + 1);
  if (ball) moveToMiddle(ball);
}

function goToUnseen() {
  looked.add(desk.at);
  const n = desk.clip.n_frames;
  for (let k = 1; k < n; k++) {
    const idx = (desk.at + k) % n;
    if (stateOf(idx) === "unseen") return go(idx);
  }
  draw();
}

// ---- labels

const stored = new Map(); // as the program last said
const undoable = [];
const failed = new Set(); // since the queue was last empty
let queue = Promise.resolve(); // one after the other, or an older place might win
let nWaiting = 0;

function change(idx, label, isUndo = false) {
  const before = labels.get(idx);
  looked.add(idx);
  if (before || label) {
    if (!isUndo) undoable.push([idx, before]);
    if (undoable.length > MAX_UNDO) undoable.shift();
    assign(labels, idx, label);
    nWaiting++;
    showSaved("saving", t("saving …"));
    queue = queue.then(() => send(idx, label));
  }
  draw();
}

function assign(map, idx, label) {
  if (label) map.set(idx, label);
  else map.delete(idx);
}

async function send(idx, label) {
  const remove = { method: "DELETE" };
  try {
    const options = label ? { method: "PUT", body: JSON.stringify(label) } : remove;
    await trusted(() => ask(ofClip(`labels/${idx}`), options));
    assign(stored, idx, label);
    failed.delete(idx);
  } catch (error) {
    failed.add(idx);
    const why = error.message;
    showTrouble(t("Frame {idx} was not saved and is as before: {why}", { idx, why }));
  }
  if (--nWaiting > 0) return;
  if (failed.size === 0) {
    return showSaved("saved", t("saved to {file}", { file: desk.clip.labels_file }));
  }
  showSaved("failed", t("not saved: frame {frames}", { frames: [...failed].join(", ") }));
  for (const frame of failed) assign(labels, frame, stored.get(frame));
  failed.clear();
  draw();
}

function undo() {
  const [idx, before] = undoable.pop() ?? [];
  if (idx === undefined) return;
  change(idx, before, true);
  go(idx);
}

function place(screen, isHard) {
  const p = pixelFrom(screen);
  if (desk.shown !== desk.at || !isInPicture(p)) return; // no label on a picture nobody sees
  const is_hard = isHard || (labels.get(desk.at)?.is_hard ?? false);
  change(desk.at, label(Math.round(p.x_px * 10) / 10, Math.round(p.y_px * 10) / 10, is_hard));
  if (isOn("advance")) step(1);
}

function nudge(by_x_px, by_y_px) {
  const old = labels.get(desk.at);
  if (!old) return;
  const moved = (px, by) => Math.round((px + by) * 1000) / 1000; // as many digits as the file has
  change(desk.at, label(moved(old.x_px, by_x_px), moved(old.y_px, by_y_px), old.is_hard));
}

function label(x_px, y_px, is_hard) {
  const { width_px, height_px } = desk.clip;
  return { x_px: clamp(x_px, -0.5, width_px - 0.5), y_px: clamp(y_px, -0.5, height_px - 0.5),
    is_hard };
}

function noBall() {
  change(desk.at, undefined);
  step(1);
}

function toggleHard() {
  const label = labels.get(desk.at);
  if (label) change(desk.at, { ...label, is_hard: !label.is_hard });
}

// ---- keys

function toggle(id) {
  $(id).setAttribute("aria-pressed", String(!isOn(id)));
  show();
}

function setLag(lag) {
  desk.lag = clamp(lag, 1, MAX_LAG);
  show();
}

function zoomBy(factor, screen) {
  zoom(factor, screen);
  refresh();
}

/// To what contrast is stretched depends on what is in view.
function refresh() {
  if (isOn("stretch")) show();
  else draw();
}

const middle = () => desk.pointer ?? stageSize().map((side) => side / 2);
const ALT_KEYS = {
  ArrowLeft: () => nudge(-0.1, 0), ArrowRight: () => nudge(0.1, 0),
  ArrowUp: () => nudge(0, -0.1), ArrowDown: () => nudge(0, 0.1),
};
const KEYS = {
  ArrowRight: (isFar) => step(isFar ? 10 : 1), ArrowLeft: (isFar) => step(isFar ? -10 : -1),
  ".": () => step(1), ",": () => step(-1), ">": () => step(10), "<": () => step(-10),
  Home: () => go(0), End: () => go(desk.clip.n_frames - 1), u: goToUnseen,
  n: noBall, h: toggleHard,
  Delete: () => change(desk.at, undefined), Backspace: () => change(desk.at, undefined),
  a: () => toggle("advance"), f: () => toggle("follow"), c: () => toggle("stretch"),
  d: () => toggle("difference"), "[": () => setLag(desk.lag - 1), "]": () => setLag(desk.lag + 1),
  "+": () => zoomBy(1.5, middle()), "=": () => zoomBy(1.5, middle()),
  "-": () => zoomBy(1 / 1.5, middle()), 0: () => { fit(); refresh(); },
  "?": () => $("help").showModal(),
};

function onKey(event) {
  if ($("help").open || $("token").open) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  let action = event.altKey ? ALT_KEYS[key] : KEYS[key];
  if (event.ctrlKey || event.metaKey) action = key === "z" ? undo : undefined;
  if (!action) return;
  event.preventDefault();
  action(event.shiftKey);
}

// ---- mouse

function onStage(canvas) {
  let drag = null;
  const screen = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    drag = { from: screen(event), x: view.x, y: view.y, isMoved: false };
  });
  canvas.addEventListener("pointermove", (event) => {
    desk.pointer = screen(event);
    if (drag) {
      const [dx, dy] = [desk.pointer[0] - drag.from[0], desk.pointer[1] - drag.from[1]];
      drag.isMoved ||= Math.hypot(dx, dy) >= DRAG_FROM;
      if (drag.isMoved && !view.isFit) moveTo(drag.x + dx, drag.y + dy);
      canvas.classList.toggle("dragging", drag.isMoved && !view.isFit);
    }
    draw();
  });
  canvas.addEventListener("pointerup", (event) => {
    if (drag && !drag.isMoved && event.button === 0) place(drag.from, event.shiftKey);
    if (drag?.isMoved) refresh();
    drag = null;
    canvas.classList.remove("dragging");
  });
  canvas.addEventListener("pointercancel", () => (drag = null));
  canvas.addEventListener("pointerleave", () => { desk.pointer = null; draw(); });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 33 : 1;
    zoomBy(Math.exp(-event.deltaY * lines * 0.002), screen(event));
  }, { passive: false });
}

function onTimeline(canvas) {
  const seek = (event) => {
    const box = canvas.getBoundingClientRect();
    go(Math.floor(((event.clientX - box.left) / box.width) * desk.clip.n_frames));
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    seek(event);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons & 1) seek(event);
  });
}

// ---- who may

function keep(token) {
  desk.token = token;
  try {
    localStorage.setItem("court.token", token);
  } catch {
    // Private windows may refuse; then it lasts as long as the page.
  }
}

/// The token comes in the address once, and must not stay where it is seen, or is the one that the
/// coach's page keeps. What remains of the address is the clip's name.
function takeAddress() {
  const address = new URLSearchParams(location.hash.slice(1));
  const given = address.get("token");
  try {
    desk.token = localStorage.getItem("court.token");
  } catch {
    // As above.
  }
  if (given) keep(given);
  const clip = address.get("clip");
  const rest = clip === null ? "" : `#clip=${encodeURIComponent(clip)}`;
  history.replaceState(null, "", location.pathname + rest);
  return clip;
}

function tokenFromPerson() {
  return new Promise((resolve) => {
    const dialog = $("token");
    $("token-typed").value = "";
    dialog.returnValue = "";
    const typed = () => (dialog.returnValue === "go" ? $("token-typed").value.trim() : "");
    dialog.onclose = () => resolve(typed());
    dialog.showModal();
  });
}

/// Does what needs the token, and asks for it when it is missing or wrong.
async function trusted(what) {
  for (;;) {
    try {
      return await what();
    } catch (error) {
      const token = error.status === 401 ? await tokenFromPerson() : "";
      if (token === "") throw error;
      keep(token);
    }
  }
}

// ---- start

async function start() {
  const asked = takeAddress();
  await translate();
  const name = asked ?? (await (await ask("clips")).json()).clips[0]?.name;
  if (name === undefined) throw new Error(t("there is no clip"));
  desk.clip = { name };
  desk.clip = await (await ask(`clips/${encodeURIComponent(name)}`)).json();
  const { labels: listed } = await (await ask(ofClip("labels"))).json();
  for (const { frame_idx, ...label } of listed) {
    labels.set(frame_idx, label);
    stored.set(frame_idx, label);
  }
  const { width_px, height_px, n_frames, frame_rate_hz } = desk.clip;
  const rate = frame_rate_hz ? `, ${Math.round(frame_rate_hz * 100) / 100} Hz` : "";
  document.title = `${name} – ${t("ground truth")}`;
  $("csv").href = `../api/v1/${ofClip("labels.csv")}`;
  $("clip-name").textContent = name;
  $("clip-facts").textContent = `${width_px} × ${height_px}, ${n_frames} ${t("frames")}${rate}`;
  for (const id of ["advance", "follow", "stretch", "difference"]) {
    $(id).addEventListener("click", () => toggle(id));
  }
  $("none").addEventListener("click", noBall);
  $("hard").addEventListener("click", toggleHard);
  $("lag-less").addEventListener("click", () => setLag(desk.lag - 1));
  $("lag-more").addEventListener("click", () => setLag(desk.lag + 1));
  $("help-button").addEventListener("click", () => $("help").showModal());
  $("trouble-close").addEventListener("click", () => ($("trouble").hidden = true));
  document.addEventListener("keydown", onKey);
  window.addEventListener("beforeunload", (event) => nWaiting > 0 && event.preventDefault());
  new ResizeObserver(refresh).observe($("stage"));
  onStage($("picture"));
  onTimeline($("timeline"));
  go(0);
}

start().catch((error) => showTrouble(t("The clip cannot be shown: {why}",
  { why: error.message })));

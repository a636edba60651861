// What the page knows → what is seen of it.

import { $, clamp, desk, fit, isInPicture, pixelFrom, screenFrom, stateOf } from "./desk.js";
import { t } from "./words.js";

const MAGNIFIED = 12;
const COLOR = Object.fromEntries(["ball", "hard", "none", "unseen", "before", "after"].map(
  (name) => [name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`)]));
const ARMS = [[1, 0], [-1, 0], [0, 1], [0, -1]];

export function draw() {
  const { view } = desk;
  const { context } = sized($("picture"));
  if (view.isFit) fit();
  drawPlane(context, view.scale, view.x, view.y);
  drawMarks(context, view.scale, screenFrom);
  drawMagnifier();
  drawTimeline();
  drawWords();
}

/// A canvas, empty, in CSS pixels whatever the screen has.
function sized(canvas) {
  const ratio = window.devicePixelRatio;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/// The picture; pale while it is not yet that of the frame asked for.
function drawPlane(context, scale, x, y) {
  if (desk.shown < 0) return;
  context.globalAlpha = desk.shown === desk.at ? 1 : 0.5;
  context.imageSmoothingEnabled = scale * window.devicePixelRatio < 2.5; // then pixels are seen
  context.drawImage(desk.plane, x, y, desk.plane.width * scale, desk.plane.height * scale);
  context.globalAlpha = 1;
}

/// Rings: faint around the ball of the neighbours, clear around this frame's. Never on the ball.
function drawMarks(context, scale, placeFrom) {
  const { at, labels } = desk;
  const radius = clamp(3.5 * scale, 9, 60);
  const ring = (idx, color, alpha, arms) => {
    const label = labels.get(idx);
    if (!label) return;
    const [x, y] = placeFrom(label);
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    for (const [dx, dy] of arms) {
      context.moveTo(x + dx * radius * 0.75, y + dy * radius * 0.75);
      context.lineTo(x + dx * radius * 1.3, y + dy * radius * 1.3);
    }
    context.globalAlpha = alpha;
    for (const [style, width] of [["#000a", 3.5], [color, 1.5]]) {
      Object.assign(context, { strokeStyle: style, lineWidth: width });
      context.stroke();
    }
    context.globalAlpha = 1;
  };
  ring(at - 1, COLOR.before, 0.55, []);
  ring(at + 1, COLOR.after, 0.55, []);
  ring(at, labels.get(at)?.is_hard ? COLOR.hard : COLOR.ball, 1, ARMS);
}

/// What is under the pointer, or else the ball, large.
function drawMagnifier() {
  const { context, width, height } = sized($("magnifier"));
  const middle = desk.pointer ? pixelFrom(desk.pointer) : desk.labels.get(desk.at);
  if (!middle) return;
  const scale = Math.max(MAGNIFIED, desk.view.scale);
  const x = width / 2 - (middle.x_px + 0.5) * scale;
  const y = height / 2 - (middle.y_px + 0.5) * scale;
  drawPlane(context, scale, x, y);
  drawMarks(context, scale, (p) => [(p.x_px + 0.5) * scale + x, (p.y_px + 0.5) * scale + y]);
  if (!desk.pointer) return;
  context.strokeStyle = "#fffb";
  context.beginPath();
  for (const [dx, dy] of ARMS) {
    context.moveTo(width / 2 + dx * 5, height / 2 + dy * 5);
    context.lineTo(width / 2 + dx * 14, height / 2 + dy * 14);
  }
  context.stroke();
}

function drawTimeline() {
  const { context, width, height } = sized($("timeline"));
  const cell = width / desk.clip.n_frames;
  const [top, tall] = [8, height - 16];
  context.fillStyle = COLOR.unseen;
  context.fillRect(0, top, width, tall);
  // The rarer is drawn later, so that it shows where many frames share a column.
  for (const [state, indices] of [["none", desk.looked.keys()], ["ball", desk.labels.keys()],
    ["hard", desk.labels.keys()]]) {
    context.fillStyle = COLOR[state];
    for (const idx of indices) {
      if (stateOf(idx) !== state) continue;
      context.fillRect(idx * cell, top, Math.max(1, cell - (cell >= 4 ? 1 : 0)), tall);
    }
  }
  const x = clamp((desk.at + 0.5) * cell, 1.5, width - 1.5);
  context.fillStyle = "#fff";
  context.fillRect(x - 1.5, 1, 3, height - 2);
}

const tenths = (px) => px.toFixed(2).replace(/0$/, ""); // a digit more only where it says something

function drawWords() {
  const { at, clip, labels, looked, pointer, view } = desk;
  const label = labels.get(at);
  const say = (id, words) => ($(id).textContent = words);
  say("label-x", label ? tenths(label.x_px) : "–");
  say("label-y", label ? tenths(label.y_px) : "–");
  say("label-state", t({ ball: "a ball", hard: "a ball, hard: need not be found",
    none: "no ball", unseen: "no label yet" }[stateOf(at)]));
  $("label-state").dataset.state = stateOf(at);
  $("hard").setAttribute("aria-pressed", String(label?.is_hard ?? false));
  $("hard").disabled = !label;
  say("frame-number", at);
  say("frame-count", t("of 0 to {last}", { last: clip.n_frames - 1 }));
  say("lag", desk.lag);
  say("zoom", view.isFit ? t("whole picture") : `${view.scale.toFixed(1)} ×`);
  const p = pointer && pixelFrom(pointer);
  say("pointer", p && isInPicture(p) ? `x ${p.x_px.toFixed(1)}   y ${p.y_px.toFixed(1)}` : "");
  const nHard = [...labels.values()].filter((one) => one.is_hard).length;
  const nNone = [...looked].filter((idx) => !labels.has(idx)).length;
  say("n-balls", labels.size - nHard);
  say("n-hard", nHard);
  say("n-none", nNone);
  say("n-unseen", clip.n_frames - labels.size - nNone);
}

export function showSaved(state, words) {
  $("saved").dataset.state = state;
  $("saved").textContent = words;
}

export function showTrouble(words) {
  $("trouble-words").textContent = words;
  $("trouble").hidden = false;
}

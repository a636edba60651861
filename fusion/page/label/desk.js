// What the page knows, and where things are. Pixels are those of the clip, (0, 0) the centre of its
// top-left one; a place on the screen is [x, y] in CSS pixels of the stage.

export const $ = (id) => document.getElementById(id);

export const desk = {
  clip: null,
  token: null, // of whoever may change labels
  at: 0, // the frame asked for
  shown: -1, // the frame whose pixels are in `plane`
  plane: document.createElement("canvas"), // that frame as it is to be seen, at its own size
  lag: 4, // frames between the two of a difference
  labels: new Map(), // by frame, as shown
  looked: new Set(), // frames somebody went on from
  pointer: null, // where the mouse is on the screen
  view: { scale: 1, x: 0, y: 0, isFit: true }, // screen = (pixel + 0.5) * scale + x
};

const MAX_SCALE = 48; // screen pixels for one of the clip
const { view } = desk;

export const isOn = (id) => $(id).getAttribute("aria-pressed") === "true";
export const clamp = (value, min, max) => Math.min(Math.max(value, min), max);

export function stateOf(idx) {
  const label = desk.labels.get(idx);
  if (label) return label.is_hard ? "hard" : "ball";
  return desk.looked.has(idx) ? "none" : "unseen";
}

export function screenFrom({ x_px, y_px }) {
  return [(x_px + 0.5) * view.scale + view.x, (y_px + 0.5) * view.scale + view.y];
}

export function pixelFrom([x, y]) {
  return { x_px: (x - view.x) / view.scale - 0.5, y_px: (y - view.y) / view.scale - 0.5 };
}

export function isInPicture({ x_px, y_px }) {
  const { width_px, height_px } = desk.clip;
  return x_px >= -0.5 && x_px <= width_px - 0.5 && y_px >= -0.5 && y_px <= height_px - 0.5;
}

export function stageSize() {
  return [$("stage").clientWidth, $("stage").clientHeight];
}

function fitScale() {
  const [width, height] = stageSize();
  return Math.min(width / desk.clip.width_px, height / desk.clip.height_px);
}

export function fit() {
  const [width, height] = stageSize();
  const scale = fitScale();
  const [x, y] = [width - desk.clip.width_px * scale, height - desk.clip.height_px * scale];
  Object.assign(view, { scale, x: x / 2, y: y / 2, isFit: true });
}

/// Zooms so that what is at a place stays there.
export function zoom(factor, [x, y]) {
  const scale = clamp(view.scale * factor, fitScale(), MAX_SCALE);
  const ratio = scale / view.scale;
  view.scale = scale;
  view.isFit = scale <= fitScale() * 1.001;
  moveTo(x - (x - view.x) * ratio, y - (y - view.y) * ratio);
}

/// Moves the picture; the middle of the stage always shows a part of it.
export function moveTo(x, y) {
  const [width, height] = stageSize();
  view.x = clamp(x, width / 2 - desk.clip.width_px * view.scale, width / 2);
  view.y = clamp(y, height / 2 - desk.clip.height_px * view.scale, height / 2);
}

export function moveToMiddle({ x_px, y_px }) {
  const [width, height] = stageSize();
  moveTo(width / 2 - (x_px + 0.5) * view.scale, height / 2 - (y_px + 0.5) * view.scale);
}

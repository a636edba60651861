// Frames: asked for once, the least recently used forgotten; and their grey levels as they are to
// be seen.

import { desk, pixelFrom, stageSize } from "./desk.js";
import { t } from "./words.js";

const MAX_BYTES = 256e6; // of frames kept here
const DIFFERENCE_GAIN = 4;
const kept = new Map(); // by frame: a promise of its grey levels

const ROOT = "../api/v1";

/// An answer of the server; an error says in a sentence why there is none, and its status.
export async function ask(path, options = {}) {
  const headers = { ...options.headers };
  if (desk.token) headers.Authorization = `Bearer ${desk.token}`;
  if (options.body) headers["Content-Type"] = "application/json";
  const answer = await fetch(`${ROOT}/${path}`, { ...options, headers }).catch(() => {
    throw new Error(t("the server does not answer; is it still running?"));
  });
  if (answer.ok) return answer;
  const problem = await answer.json().catch(() => ({}));
  const error = new Error(problem.error ?? `${path}: ${answer.status}`);
  throw Object.assign(error, { status: answer.status });
}

/// The address of something of the clip.
export const ofClip = (path) => `clips/${encodeURIComponent(desk.clip.name)}/${path}`;

export function luma(idx) {
  const frame = kept.get(idx) ?? fetched(idx);
  kept.delete(idx);
  kept.set(idx, frame);
  const nKept = Math.max(12, Math.floor(MAX_BYTES / (desk.clip.width_px * desk.clip.height_px)));
  if (kept.size > nKept) kept.delete(kept.keys().next().value);
  return frame;
}

/// Asks for frames that may be wanted next.
export function foresee(indices) {
  for (const idx of indices) {
    if (idx >= 0 && idx < desk.clip.n_frames) luma(idx).catch(() => {}); // said when it is shown
  }
}

async function fetched(idx) {
  try {
    const answer = await ask(ofClip(`frames/${idx}`));
    const bitmap = await createImageBitmap(await answer.blob(), { colorSpaceConversion: "none" });
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    const levels = new Uint8Array(data.length / 4);
    for (let k = 0; k < levels.length; k++) levels[k] = data[4 * k];
    return levels;
  } catch (error) {
    kept.delete(idx); // asked for again when it is wanted again
    throw error;
  }
}

/// Paints the plane: a frame as it is, or what has changed since another; stretched or not.
export function paint(now, before, isStretched) {
  let levels = now;
  if (before) {
    levels = new Uint8ClampedArray(now.length);
    for (let k = 0; k < now.length; k++) levels[k] = 128 + DIFFERENCE_GAIN * (now[k] - before[k]);
  }
  const [low, high] = isStretched ? rangeInView(levels) : [0, 255];
  const table = new Uint8ClampedArray(256);
  for (let k = 0; k < 256; k++) table[k] = ((k - low) * 255) / Math.max(1, high - low);
  const { width_px, height_px } = desk.clip;
  const picture = new ImageData(width_px, height_px);
  const words = new Uint32Array(picture.data.buffer);
  for (let k = 0; k < levels.length; k++) words[k] = 0xff000000 | (table[levels[k]] * 0x010101);
  Object.assign(desk.plane, { width: width_px, height: height_px });
  desk.plane.getContext("2d").putImageData(picture, 0, 0);
}

/// The grey levels between which all but 1 % of the pixels in view lie.
function rangeInView(levels) {
  const { width_px, height_px } = desk.clip;
  const [from, to] = [pixelFrom([0, 0]), pixelFrom(stageSize())];
  const [x0, y0] = [Math.max(0, Math.round(from.x_px)), Math.max(0, Math.round(from.y_px))];
  const x1 = Math.min(width_px - 1, Math.round(to.x_px));
  const y1 = Math.min(height_px - 1, Math.round(to.y_px));
  const counts = new Uint32Array(256);
  for (let y = y0; y <= y1; y++) {
    for (let x = x0; x <= x1; x++) counts[levels[y * width_px + x]]++;
  }
  const n = counts.reduce((sum, count) => sum + count, 0);
  const levelAt = (share) => {
    let sum = 0;
    return Math.max(0, counts.findIndex((count) => (sum += count) > share * n));
  };
  return [levelAt(0.005), levelAt(0.995)];
}

// The drill on the drawing board: its targets in SI, which one is chosen, what the machine says.
import { computed, signal } from "@preact/signals";
import { act, get, noteError, send } from "../api";
import type { Aim, Drill, Target, Xy } from "../contract";
import { t } from "../words";

export const MAX_TARGETS = 200;
/** Where targets may be: the far half and a little around it. */
export const LIMITS = { x_m: [-6.5, 6.5], y_m: [11.9, 26] } as const;

export const drills = signal<Drill[]>([]);
export const draft = signal<Drill | null>(null);
export const isDirty = signal(false);
export const targetIdx = signal(0);
export const aim = signal<Aim | null>(null);

export const target = computed<Target | null>(() => draft.value?.targets[targetIdx.value] ?? null);

export async function loadDrills(): Promise<void> {
  try {
    drills.value = (await get<{ drills: Drill[] }>("/drills")).drills;
    if (draft.value === null && drills.value[0]) open(drills.value[0]);
  } catch (error) {
    noteError(error);
  }
}

export function open(drill: Drill): void {
  draft.value = structuredClone(drill);
  targetIdx.value = 0;
  isDirty.value = false;
}

function freeName(stem: string, taken: readonly string[]): string {
  if (!taken.includes(stem)) return stem;
  let n = 2;
  while (taken.includes(`${stem} ${n}`)) n += 1;
  return `${stem} ${n}`;
}

export function begin(): void {
  const name = freeName(t("drill.newName"), drills.value.map((one) => one.name));
  open({ name, order: "in turn", period_s: 4, targets: [] });
  addTarget([0, 20]);
}

export function change(news: Partial<Drill>): void {
  if (!draft.value) return;
  draft.value = { ...draft.value, ...news };
  isDirty.value = true;
}

const within = (value: number, [low, high]: readonly [number, number]) =>
  Math.min(high, Math.max(low, Math.round(value * 100) / 100));

export function placed([x, y]: Xy): Xy {
  return [within(x, LIMITS.x_m), within(y, LIMITS.y_m)];
}

export function addTarget(landing_m: Xy): void {
  const now = draft.value;
  if (!now || now.targets.length >= MAX_TARGETS) return;
  const name = freeName(t("drill.newTarget"), now.targets.map((one) => one.name));
  const like = target.value;
  const added: Target = {
    name,
    landing_m: placed(landing_m),
    zone_radius_m: like?.zone_radius_m ?? 1,
    speed_m_s: like?.speed_m_s ?? null,
    spin_rpm: like?.spin_rpm ?? null,
    net_height_m: null,
    apex_m: null,
  };
  change({ targets: [...now.targets, added] });
  targetIdx.value = now.targets.length;
}

export function changeTarget(idx: number, news: Partial<Target>): void {
  const now = draft.value;
  if (!now) return;
  change({ targets: now.targets.map((one, i) => (i === idx ? { ...one, ...news } : one)) });
}

export function removeTarget(idx: number): void {
  const now = draft.value;
  if (!now || now.targets.length < 2) return;
  change({ targets: now.targets.filter((_, i) => i !== idx) });
  targetIdx.value = Math.max(0, Math.min(idx, now.targets.length - 2));
}

/** True when it is stored. */
export async function save(): Promise<boolean> {
  const now = draft.value;
  if (!now) return false;
  const path = `/drills/${encodeURIComponent(now.name)}`;
  const done = await act(() => send<unknown>("PUT", path, now));
  if (done === null) return false;
  isDirty.value = false;
  await loadDrills();
  return true;
}

export async function remove(): Promise<void> {
  const now = draft.value;
  if (!now) return;
  const path = `/drills/${encodeURIComponent(now.name)}`;
  if ((await act(() => send<unknown>("DELETE", path))) === null) return;
  draft.value = null;
  await loadDrills();
}

let n_asked = 0;

/** What the machine would do for it; answers that were overtaken are dropped. */
export async function askAim(wanted: Target): Promise<void> {
  const turn = ++n_asked;
  try {
    const answer = await send<Aim>("POST", "/aim", wanted);
    if (turn === n_asked) aim.value = answer;
  } catch (error) {
    if (turn !== n_asked) return;
    const sentence = error instanceof Error ? error.message : String(error);
    aim.value = {
      reachable: false, sentence, settings: null, landing_m: null, flight_m: null,
      net_height_m: null,
    };
  }
}

// What this browser's person likes, and the token; kept in this browser only.
import { computed, effect, signal } from "@preact/signals";
import { SPEED_UNITS, type SpeedUnit } from "./pure/units";

export type Theme = "auto" | "light" | "dark";
export type Language = "en" | "de";

function stored<T extends string>(key: string, allowed: readonly T[], otherwise: T) {
  let first: T = otherwise;
  try {
    const text = localStorage.getItem(key);
    first = allowed.find((one) => one === text) ?? otherwise;
  } catch {
    // Private windows may refuse; then it lasts as long as the page.
  }
  const value = signal<T>(first);
  effect(() => keep(key, value.value));
  return value;
}

function keep(key: string, text: string | null): void {
  try {
    if (text === null) localStorage.removeItem(key);
    else localStorage.setItem(key, text);
  } catch {
    // As above.
  }
}

function firstToken(): string | null {
  try {
    return localStorage.getItem("court.token");
  } catch {
    return null;
  }
}

const spoken: Language = navigator.language.toLowerCase().startsWith("de") ? "de" : "en";

export const unit = stored<SpeedUnit>("court.unit", SPEED_UNITS, "km/h");
export const language = stored<Language>("court.language", ["en", "de"], spoken);
export const theme = stored<Theme>("court.theme", ["auto", "light", "dark"], "auto");
export const token = signal<string | null>(firstToken());
effect(() => keep("court.token", token.value));

const darkQuery = matchMedia("(prefers-color-scheme: dark)");
const systemIsDark = signal(darkQuery.matches);
darkQuery.addEventListener("change", (event) => (systemIsDark.value = event.matches));

export const isDark = computed(() =>
  theme.value === "auto" ? systemIsDark.value : theme.value === "dark",
);

export function prefersStill(): boolean {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}

// Keys -> words of the chosen language. Another language is another file in words/.
import en from "./words/en.json";
import de from "./words/de.json";
import { computed } from "@preact/signals";
import { language, type Language } from "./settings";

export type Key = keyof typeof en;
const LANGUAGES: Record<Language, Record<Key, string>> = { en, de };

const words = computed(() => LANGUAGES[language.value]);

const sign = computed(
  () =>
    new Intl.NumberFormat(language.value).formatToParts(0.5).find((one) => one.type === "decimal")
      ?.value ?? ".",
);

/** A number's text with the language's decimal sign. */
export function local(text: string): string {
  return text.replace(/(\d)\.(\d)/g, `$1${sign.value}$2`);
}

/** `t("drill.ball", { n: 3 })`: what stands in braces is replaced. */
export function t(key: Key, values?: Record<string, string | number>): string {
  let text = words.value[key];
  for (const [name, value] of Object.entries(values ?? {})) {
    const is_number = typeof value === "number" || /^[<−-]? ?\d+\.\d+$/.test(value);
    text = text.replaceAll(`{${name}}`, is_number ? local(`${value}`) : value);
  }
  return text;
}

/** Words for what the server says by a fixed name; the name itself where there are none. */
export function named(group: string, name: string): string {
  const key = `${group}.${name}`;
  return (words.value as Record<string, string>)[key] ?? name;
}

export const missWords = computed(() => ({
  long: t("miss.long"),
  short: t("miss.short"),
  left: t("miss.left"),
  right: t("miss.right"),
  onTarget: t("miss.onTarget"),
}));

const times = computed(() => new Intl.DateTimeFormat(language.value, { timeStyle: "medium" }));
const days = computed(
  () => new Intl.DateTimeFormat(language.value, { dateStyle: "short", timeStyle: "short" }),
);

export function timeText(at_ms: number): string {
  return times.value.format(at_ms);
}

export function dayText(at_ms: number): string {
  return days.value.format(at_ms);
}

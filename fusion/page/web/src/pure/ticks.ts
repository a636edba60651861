// A range of numbers -> round places for an axis.
export function ticks(low: number, high: number, about: number): number[] {
  if (!(high > low) || !Number.isFinite(low) || !Number.isFinite(high)) return [low];
  const rough = (high - low) / Math.max(1, about);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((one) => one >= rough) ?? 10 * power;
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}

/** Without the noise of binary fractions: 0.30000000000000004 is "0.3". */
export function tickText(value: number): string {
  return `${Number(value.toPrecision(6))}`;
}

/** From the least to the greatest of what is finite, with some air; never empty. */
export function rangeOf(values: readonly number[], least: number): [number, number] {
  const finite = values.filter(Number.isFinite);
  const low = Math.min(...finite, -least);
  const high = Math.max(...finite, least);
  const air = 0.06 * (high - low);
  return [low - air, high + air];
}

// Metres a second -> what a person reads, and back.
export type SpeedUnit = "km/h" | "mph" | "m/s";
export const SPEED_UNITS: readonly SpeedUnit[] = ["km/h", "mph", "m/s"];

const PER_M_S: Record<SpeedUnit, number> = { "km/h": 3.6, mph: 1 / 0.44704, "m/s": 1 };

export function speedFrom(speed_m_s: number, unit: SpeedUnit): number {
  return speed_m_s * PER_M_S[unit];
}

export function metresASecondFrom(speed: number, unit: SpeedUnit): number {
  return speed / PER_M_S[unit];
}

/** "71.0" with as many digits as make sense in that unit. */
export function speedText(speed_m_s: number, unit: SpeedUnit): string {
  return speedFrom(speed_m_s, unit).toFixed(1);
}

/** A sigma keeps one digit more when it is small, so that it never reads "± 0.0". */
export function sigmaText(sigma: number, digits: number): string {
  const floor = 0.5 * 10 ** -digits;
  return sigma > 0 && sigma < floor ? `< ${(10 ** -digits).toFixed(digits)}` : sigma.toFixed(digits);
}

/** Centimetres without decimals; "-0" does not exist. */
export function centimetres(length_m: number): string {
  const cm = Math.round(length_m * 100);
  return `${cm === 0 ? 0 : cm}`;
}

/** "1.23 MB". */
export function sizeText(bytes: number): string {
  if (bytes < 1000) return `${bytes} B`;
  if (bytes < 1e6) return `${(bytes / 1e3).toFixed(0)} kB`;
  return `${(bytes / 1e6).toFixed(1)} MB`;
}

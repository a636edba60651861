// A measured number as large as it deserves, with its one sigma beside it.
import type { ShotRow } from "../contract";
import { missText, spinWay } from "../pure/miss";
import { sigmaText, speedFrom } from "../pure/units";
import { unit } from "../settings";
import { local, missWords, named, t } from "../words";

export function Big(props: {
  name: string;
  value: string | null;
  sigma: string | null;
  unit: string;
  extra?: string | null;
}) {
  return (
    <div class="big">
      <dt>{props.name}</dt>
      <dd>
        <span class="value">{local(props.value ?? "–")}</span>
        {props.value !== null && <span class="unit">{props.unit}</span>}
        <span class="sigma">
          {props.value === null
            ? t("live.notSeen")
            : [props.sigma && `± ${local(props.sigma)}`, props.extra].filter(Boolean).join(" · ")}
        </span>
      </dd>
    </div>
  );
}

const orNull = <T,>(value: number | null, text: (value: number) => T): T | null =>
  value === null ? null : text(value);

export function Numbers(props: { row: ShotRow }) {
  const { row } = props;
  const spin = row.spin_rpm;
  return (
    <dl class="numbers">
      <Big
        name={t("live.speed")}
        value={orNull(row.speed_m_s, (v) => speedFrom(v, unit.value).toFixed(1))}
        sigma={orNull(row.speed_sigma_m_s, (v) => sigmaText(speedFrom(v, unit.value), 1))}
        unit={unit.value}
      />
      <Big
        name={spin === null ? t("live.spin") : named("spin", spinWay(spin))}
        value={orNull(spin, (v) => Math.abs(v).toFixed(0))}
        sigma={orNull(row.spin_sigma_rpm, (v) => sigmaText(v, 0))}
        unit="rpm"
      />
      <Big
        name={t("live.net")}
        value={orNull(row.net_height_m, (v) => (v * 100).toFixed(0))}
        sigma={orNull(row.net_height_sigma_m, (v) => sigmaText(v * 100, 1))}
        unit="cm"
      />
      <Big
        name={t("live.elevation")}
        value={orNull(row.elevation_deg, (v) => `${v.toFixed(1)}°`)}
        sigma={null}
        unit=""
        extra={orNull(row.azimuth_deg, (v) =>
          Math.abs(v) < 0.05
            ? t("live.straight")
            : t(v < 0 ? "live.toLeft" : "live.toRight", { deg: Math.abs(v).toFixed(1) }),
        )}
      />
    </dl>
  );
}

/** "12 cm long, 4 cm left", or why there is no such thing. */
export function landingText(row: ShotRow): string {
  if (row.miss_m) return missText(row.miss_m, missWords.value);
  if (row.landing_m) {
    const [x, y] = row.landing_m;
    const key = x < 0 ? "live.landedLeft" : "live.landedRight";
    return t(key, { x: Math.abs(x).toFixed(2), y: y.toFixed(2) });
  }
  return named("outcome", row.outcome);
}

export function isInZone(row: ShotRow): boolean | null {
  if (!row.miss_m || !row.target) return null;
  return Math.hypot(...row.miss_m) <= row.target.zone_radius_m;
}

/** One sigma along and across. */
export function landingSigma(row: ShotRow): string | null {
  const covariance = row.landing_covariance_m2;
  if (!covariance) return null;
  const [across, along] = [covariance[0][0], covariance[1][1]].map((v) => 100 * Math.sqrt(v));
  if (!Number.isFinite(across) || !Number.isFinite(along)) return null;
  return t("live.sigmas", {
    along: sigmaText(along as number, 1),
    across: sigmaText(across as number, 1),
  });
}

// One target in numbers, and what the machine says about it.
import { useEffect, useState } from "preact/hooks";
import type { Target, Xy } from "../contract";
import { SideView } from "../plots/SideView";
import { metresASecondFrom, speedFrom } from "../pure/units";
import { language, unit } from "../settings";
import { court } from "../store";
import { t } from "../words";
import { aim, askAim, changeTarget, draft, placed, removeTarget, target, targetIdx } from "./draft";

const AIM_AFTER_MS = 200;

/** Keeps what is typed until it is a number; empty is "the machine may choose" where allowed. */
function NumberField(props: {
  label: string;
  unit: string;
  value: number | null;
  digits: number;
  step: number;
  min?: number;
  max?: number;
  optional?: boolean;
  onValue: (value: number | null) => void;
}) {
  const shown = props.value === null ? "" : `${Number(props.value.toFixed(props.digits))}`;
  const [typed, setTyped] = useState<string | null>(null);
  const take = (event: Event) => {
    const text = (event.currentTarget as HTMLInputElement).value;
    setTyped(text);
    const value = Number(text);
    if (text.trim() === "") {
      if (props.optional) props.onValue(null);
    } else if (Number.isFinite(value) && value >= (props.min ?? -Infinity)) {
      if (value <= (props.max ?? Infinity)) props.onValue(value);
    }
  };
  return (
    <label class="field">
      {props.label}
      <span class="with-unit">
        <input
          type="number"
          inputMode="decimal"
          step={props.step}
          min={props.min}
          max={props.max}
          placeholder={props.optional ? t("drill.free") : ""}
          value={typed ?? shown}
          onInput={take}
          onBlur={() => setTyped(null)}
        />
        <span class="unit">{props.unit}</span>
      </span>
    </label>
  );
}

export function TargetForm() {
  const now = target.value;
  const idx = targetIdx.value;
  const text = JSON.stringify(now);
  useEffect(() => {
    if (!now) {
      aim.value = null;
      return;
    }
    const timer = setTimeout(() => void askAim(now), AIM_AFTER_MS);
    return () => clearTimeout(timer);
  }, [text]);
  if (!now) return null;
  const set = (news: Partial<Target>) => changeTarget(idx, news);
  const place = (i: 0 | 1) => (value: number | null) => {
    if (value === null) return;
    const to: Xy = [...now.landing_m];
    to[i] = value;
    set({ landing_m: placed(to) });
  };
  const many = (draft.value?.targets.length ?? 0) > 1;
  return (
    <div class="target-form" key={idx}>
      <label class="field wide">
        {t("drill.targetName")}
        <input
          type="text"
          maxLength={60}
          value={now.name}
          onInput={(event) => set({ name: event.currentTarget.value })}
        />
      </label>
      <div class="grid">
        <NumberField label={t("drill.x")} unit="m" value={now.landing_m[0]} digits={2} step={0.1}
          min={-6.5} max={6.5} onValue={place(0)} />
        <NumberField label={t("drill.y")} unit="m" value={now.landing_m[1]} digits={2} step={0.1}
          min={11.9} max={26} onValue={place(1)} />
        <NumberField label={t("drill.radius")} unit="m" value={now.zone_radius_m} digits={2}
          step={0.1} min={0.1} max={5}
          onValue={(value) => value !== null && set({ zone_radius_m: value })} />
        <NumberField label={t("live.speed")} unit={unit.value} optional digits={1} step={1} min={1}
          value={now.speed_m_s === null ? null : speedFrom(now.speed_m_s, unit.value)}
          onValue={(value) =>
            set({ speed_m_s: value === null ? null : metresASecondFrom(value, unit.value) })
          } />
        <NumberField label={t("drill.spin")} unit="rpm" optional digits={0} step={100}
          value={now.spin_rpm} onValue={(value) => set({ spin_rpm: value })} />
        <NumberField label={t("live.net")} unit="m" optional digits={2} step={0.1} min={0}
          value={now.net_height_m} onValue={(value) => set({ net_height_m: value })} />
        <NumberField label={t("drill.apex")} unit="m" optional digits={2} step={0.1} min={0}
          value={now.apex_m} onValue={(value) => set({ apex_m: value })} />
        <NumberField label={t("drill.repeat")} unit="" digits={0} step={1} min={1} max={1000}
          value={now.repeat ?? 1}
          onValue={(value) => value !== null && set({ repeat: Math.round(value) })} />
        <button type="button" class="end" disabled={!many} onClick={() => removeTarget(idx)}>
          {t("drill.removeTarget")}
        </button>
      </div>
      <Answer />
    </div>
  );
}

function Answer() {
  const answer = aim.value;
  if (!answer) return <p class="aim quiet-text">{t("drill.asking")}</p>;
  const { settings } = answer;
  const words =
    settings && settings.speed_m_s !== null
      ? t("drill.settings", {
          speed: speedFrom(settings.speed_m_s, unit.value).toFixed(1),
          unit: unit.value,
          up: settings.elevation_deg?.toFixed(1) ?? "–",
          side: settings.azimuth_deg?.toFixed(1) ?? "–",
          spin: settings.spin_rpm?.toFixed(0) ?? "–",
        })
      : null;
  return (
    <div class={`aim ${answer.reachable ? "good" : "wrong"}`}>
      <p role="status">
        <strong>{t(answer.reachable ? "drill.reachable" : "drill.unreachable")}</strong>{" "}
        <span lang={language.value === "en" ? undefined : "en"}>{answer.sentence}</span>
      </p>
      {!answer.reachable && answer.landing_m && (
        <button
          type="button"
          onClick={() =>
            answer.landing_m &&
            changeTarget(targetIdx.value, { landing_m: placed(answer.landing_m) })
          }
        >
          {t("drill.takeNearest", {
            x: answer.landing_m[0].toFixed(2),
            y: answer.landing_m[1].toFixed(2),
          })}
        </button>
      )}
      {words && <p class="quiet-text">{words}</p>}
      {answer.flight_m && (
        <SideView court={court.value} flight={null} reference_m={answer.flight_m}
          label={t("drill.side")} />
      )}
    </div>
  );
}

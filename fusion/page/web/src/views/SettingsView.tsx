import type { Signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { note } from "../api";
import { SPEED_UNITS } from "../pure/units";
import { language, theme, token, unit } from "../settings";
import { status } from "../store";
import { t } from "../words";

export function SettingsView() {
  return (
    <div class="view narrow">
      <h1>{t("tab.settings")}</h1>
      <section class="panel">
        <Choice name={t("settings.unit")} of={unit} options={SPEED_UNITS.map((one) => [one, one])} />
        <Choice name={t("settings.language")} of={language}
          options={[["en", "English"], ["de", "Deutsch"]]} />
        <Choice name={t("settings.theme")} of={theme}
          options={[["auto", t("settings.auto")], ["light", t("settings.light")], ["dark", t("settings.dark")]]} />
      </section>
      <Token />
      <section class="panel">
        <h2>{t("settings.about")}</h2>
        <dl class="plain">
          <dt>{t("settings.court")}</dt>
          <dd>{status.value?.court ?? "–"}</dd>
          <dt>{t("settings.version")}</dt>
          <dd>{status.value?.version ?? "–"}</dd>
          <dt>{t("settings.viewers")}</dt>
          <dd>{status.value?.n_viewers ?? "–"}</dd>
          <dt>{t("settings.lost")}</dt>
          <dd>{status.value?.n_lost ?? "–"}</dd>
        </dl>
      </section>
    </div>
  );
}

function Choice<T extends string>(props: { name: string; of: Signal<T>; options: [T, string][] }) {
  return (
    <fieldset class="choice">
      <legend>{props.name}</legend>
      <div class="segments">
        {props.options.map(([value, text]) => (
          <label key={value}>
            <input type="radio" name={props.name} value={value}
              checked={props.of.value === value} onChange={() => (props.of.value = value)} />
            <span>{text}</span>
          </label>
        ))}
      </div>
    </fieldset>
  );
}

function Token() {
  const [typed, setTyped] = useState("");
  const keep = (event: Event) => {
    event.preventDefault();
    if (typed.trim() === "") return;
    token.value = typed.trim();
    setTyped("");
    note("good", t("token.kept"));
  };
  return (
    <section class="panel">
      <h2>{t("token.title")}</h2>
      <p>{t(token.value === null ? "token.none" : "token.have")}</p>
      <form class="bar" onSubmit={keep}>
        <label class="field">
          {t("token.label")}
          <input type="password" autocomplete="off" value={typed}
            onInput={(event) => setTyped(event.currentTarget.value)} />
        </label>
        <button type="submit" class="end">{t("token.keep")}</button>
        {token.value !== null && (
          <button type="button" class="end" onClick={() => (token.value = null)}>
            {t("token.forget")}
          </button>
        )}
      </form>
    </section>
  );
}

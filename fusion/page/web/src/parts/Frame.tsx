// What is around every view: the tabs, the banner of a lost line, notes, the question for the token.
import { useEffect, useRef, useState } from "preact/hooks";
import { dismiss, notes, waiting } from "../api";
import { line, retryAt, tryNow } from "../live";
import { VIEWS, type View } from "../pure/route";
import { token } from "../settings";
import { drill, status, view } from "../store";
import { t } from "../words";

const ICONS: Record<View, string> = {
  live: "M3 18C7 6 13 4 20 12M20 12l1-5M20 12l-5-1M3 21h18",
  session: "M4 4v16h16M8 15l4-5 3 3 5-7",
  drill: "M12 3a9 9 0 100 18 9 9 0 000-18M12 8a4 4 0 100 8 4 4 0 000-8M12 12h.01",
  setup: "M4 8h10l2-3h4v14H4zM9 13.5a2.5 2.5 0 105 0 2.5 2.5 0 00-5 0",
  settings: "M4 7h10M18 7h2M16 5v4M4 17h2M10 17h10M8 15v4",
};

export function Tabs() {
  return (
    <nav class="tabs" aria-label={t("tab.all")}>
      {VIEWS.map((one) => (
        <a key={one} href={`#/${one}`} aria-current={view.value === one ? "page" : undefined}>
          <svg viewBox="0 0 24 24" width="24" height="24" aria-hidden="true">
            <path d={ICONS[one]} />
          </svg>
          <span>{t(`tab.${one}`)}</span>
        </a>
      ))}
    </nav>
  );
}

export function Top() {
  const state = drill.value;
  return (
    <header class="top">
      <a class="brand" href="#/live" aria-label={t("tab.home")}>
        <img src="/icon.svg" width="32" height="32" alt="" />
        <span>{status.value?.court ?? t("tab.court")}</span>
      </a>
      <Tabs />
      <span class="gap" />
      {state?.running && (
        <a class="pill" href="#/drill">
          {state.balls === null
            ? t("drill.pill", { n: state.ball })
            : t("drill.pillOf", { n: state.ball, all: state.balls })}
        </a>
      )}
      <span class={`line ${line.value}`}>
        <i aria-hidden="true" />
        {t(`line.${line.value}`)}
      </span>
    </header>
  );
}

export function Banner() {
  const [now, setNow] = useState(Date.now());
  const is_lost = line.value === "lost";
  useEffect(() => {
    if (!is_lost) return;
    const timer = setInterval(() => setNow(Date.now()), 500);
    return () => clearInterval(timer);
  }, [is_lost]);
  if (!is_lost) return null;
  const seconds = Math.max(0, Math.ceil((retryAt.value - now) / 1000));
  return (
    <div class="banner" role="alert">
      <span>
        <strong>{t("line.lostLong")}</strong>{" "}
        <span aria-hidden="true">{seconds > 0 ? t("line.retry", { n: seconds }) : t("line.trying")}</span>
      </span>
      <button type="button" onClick={tryNow}>{t("line.tryNow")}</button>
    </div>
  );
}

const GOOD_MS = 4000;

export function Notes() {
  const shown = notes.value;
  useEffect(() => {
    const timers = shown
      .filter((one) => one.kind === "good")
      .map((one) => setTimeout(() => dismiss(one.id), GOOD_MS));
    return () => timers.forEach(clearTimeout);
  }, [shown]);
  return (
    <div class="notes" role="alert">
      {shown.map((one) => (
        <div key={one.id} class={`note ${one.kind}`}>
          <p>
            {one.text}
            {one.expected && <span class="expected">{t("error.expected", { what: one.expected })}</span>}
          </p>
          <button type="button" class="quiet" aria-label={t("error.close")} onClick={() => dismiss(one.id)}>
            ✕
          </button>
        </div>
      ))}
    </div>
  );
}

export function TokenDialog() {
  const ref = useRef<HTMLDialogElement>(null);
  const [typed, setTyped] = useState("");
  const now = waiting.value;
  useEffect(() => {
    if (now) ref.current?.showModal();
    else ref.current?.close();
  }, [now]);
  const give = (event: Event) => {
    event.preventDefault();
    if (typed.trim() === "") return;
    token.value = typed.trim();
    setTyped("");
    now?.resume();
  };
  return (
    <dialog ref={ref} aria-labelledby="token-title" onCancel={() => now?.giveUp()}>
      <form onSubmit={give}>
        <h2 id="token-title">{t("token.title")}</h2>
        <p>{now?.why}</p>
        <p class="quiet-text">{t("token.where")}</p>
        <label class="field">
          {t("token.label")}
          <input type="password" autocomplete="off" value={typed}
            onInput={(event) => setTyped(event.currentTarget.value)} />
        </label>
        <div class="bar">
          <button type="submit" class="primary">{t("token.go")}</button>
          <button type="button" onClick={() => now?.giveUp()}>{t("token.cancel")}</button>
        </div>
      </form>
    </dialog>
  );
}

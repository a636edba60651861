import { effect } from "@preact/signals";
import { render } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { start } from "./live";
import { Banner, Notes, TokenDialog, Top } from "./parts/Frame";
import { routeFrom, type View } from "./pure/route";
import { isDark, language, token } from "./settings";
import { status, view } from "./store";
import "./style.css";
import { DrillView } from "./views/DrillView";
import { Announcer, Live } from "./views/Live";
import { SessionView } from "./views/SessionView";
import { SettingsView } from "./views/SettingsView";
import { SetupView } from "./views/SetupView";
import { t } from "./words";

/** The token comes in the address once; it must not stay where it is seen or sent on. */
function takeAddress(): void {
  const route = routeFrom(location.hash);
  if (route.token !== null) {
    token.value = route.token;
    history.replaceState(null, "", "#/live");
  }
  view.value = route.view;
}

const PAGES: Record<View, () => preact.JSX.Element> = {
  live: Live,
  session: SessionView,
  drill: DrillView,
  setup: SetupView,
  settings: SettingsView,
};

function App() {
  const main = useRef<HTMLElement>(null);
  const now = view.value;
  const first = useRef(true);
  useEffect(() => {
    // Whoever goes by keyboard or listens begins at the top of the new view.
    if (!first.current) main.current?.focus({ preventScroll: true });
    first.current = false;
    window.scrollTo(0, 0);
  }, [now]);
  const Page = PAGES[now];
  const skip = (event: Event) => {
    event.preventDefault();
    main.current?.focus();
  };
  return (
    <>
      <a class="skip" href="#main" onClick={skip}>{t("tab.skip")}</a>
      <Top />
      <Banner />
      <main id="main" tabIndex={-1} ref={main} data-view={now}>
        <Page />
      </main>
      <Announcer />
      <Notes />
      <TokenDialog />
    </>
  );
}

takeAddress();
window.addEventListener("hashchange", takeAddress);
effect(() => {
  document.documentElement.lang = language.value;
});
effect(() => {
  document.documentElement.dataset["theme"] = isDark.value ? "dark" : "light";
});
effect(() => {
  const name = t(`tab.${view.value}`);
  const court = status.value?.court;
  document.title = court ? `${name} · ${court}` : name;
});
render(<App />, document.getElementById("page") as HTMLElement);
start();

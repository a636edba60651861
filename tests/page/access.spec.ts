import AxeBuilder from "@axe-core/playwright";
import { PHONE, expect, newest, test } from "./world";

const VIEWS = ["live", "session", "drill", "setup", "settings"];

test.beforeEach(async ({ server }) => server.serve());

for (const theme of ["light", "dark"] as const) {
  for (const [place, size] of Object.entries({ desk: { width: 1280, height: 800 }, phone: PHONE })) {
    test(`axe finds nothing serious: ${theme}, ${place}`, async ({ open, page, server }) => {
      await page.emulateMedia({ colorScheme: theme, reducedMotion: "reduce" });
      await page.setViewportSize(size);
      for (const view of VIEWS) {
        await open(view);
        if (view === "live") await expect.poll(() => newest(page)).toBeGreaterThan(0);
        await page.waitForLoadState("networkidle");
        const { violations, passes } = await new AxeBuilder({ page }).analyze();
        expect(passes.length).toBeGreaterThan(10);
        const bad = violations
          .filter((one) => one.impact === "serious" || one.impact === "critical")
          .map((one) => `${one.id}: ${one.nodes.map((node) => node.html).join("\n")}`);
        const mild = violations.length - bad.length;
        console.log(`axe ${theme} ${place} ${view}: ${bad.length} serious, ${mild} milder, ${passes.length} passed`);
        expect(bad, view).toEqual([]);
      }
      expect(server.url).not.toBe("");
    });
  }
}

test("all tabs are reached and used by keyboard alone", async ({ open }) => {
  const page = await open();
  await page.reload();
  await expect(page.locator(".line.open")).toBeVisible();
  await page.keyboard.press("Tab");
  await expect(page.locator(".skip")).toBeFocused();
  await page.keyboard.press("Enter");
  await expect(page.locator("main")).toBeFocused();
  for (const view of VIEWS.slice(1)) {
    const tab = page.locator(`.tabs a[href="#/${view}"]`);
    await page.locator(".brand").focus();
    for (let i = 0; i < 8; i++) {
      await page.keyboard.press("Tab");
      if (await tab.evaluate((one) => one === document.activeElement)) break;
    }
    await expect(tab).toBeFocused();
    await page.keyboard.press("Enter");
    await expect(page.locator(`main[data-view="${view}"]`)).toBeFocused();
    await expect(tab).toHaveAttribute("aria-current", "page");
  }
});

test("no view holds the keyboard fast", async ({ open }) => {
  for (const view of VIEWS) {
    const page = await open(view);
    await page.waitForLoadState("networkidle");
    await page.locator(".brand").focus();
    let is_out = false;
    for (let i = 0; i < 250 && !is_out; i++) {
      await page.keyboard.press("Tab");
      is_out = await page.evaluate(
        () => document.activeElement === document.body || document.activeElement?.className === "skip",
      );
    }
    expect(is_out, `${view}: Tab comes round`).toBe(true);
  }
});

test("what has the focus is seen to have it", async ({ open }) => {
  const page = await open("settings");
  await page.locator(".brand").focus();
  await page.keyboard.press("Tab");
  const width = await page.evaluate(() => getComputedStyle(document.activeElement!).outlineWidth);
  expect(Number.parseFloat(width)).toBeGreaterThanOrEqual(2);
});

test("speeds are told in the unit that was chosen, and it stays", async ({ open }) => {
  const page = await open("settings");
  await page.getByRole("radio", { name: "mph" }).check();
  await page.locator('.tabs a[href="#/live"]').click();
  await expect(page.locator(".numbers .unit").first()).toHaveText("mph");
  await page.reload();
  await expect(page.locator(".numbers .unit").first()).toHaveText("mph");
  await page.locator('.tabs a[href="#/settings"]').click();
  await page.getByRole("radio", { name: "m/s" }).check();
  await page.locator('.tabs a[href="#/live"]').click();
  await expect(page.locator(".numbers .unit").first()).toHaveText("m/s");
});

test("it speaks German, and the page says that it does", async ({ open }) => {
  const page = await open("settings");
  await page.getByRole("radio", { name: "Deutsch" }).check();
  await expect(page.locator("html")).toHaveAttribute("lang", "de");
  await expect(page.locator("h1")).toHaveText("Optionen");
  await page.locator('.tabs a[href="#/live"]').click();
  await expect(page.getByRole("button", { name: "Maschine stoppen" })).toBeVisible();
  await expect(page.locator(".landing .headline")).toHaveText(/cm|gesehen/);
});

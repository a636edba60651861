import { PHONE, expect, newest, picture, test } from "./world";

test.beforeEach(async ({ server }) => server.serve());

test("a shot appears by itself, with its numbers and its flight", async ({ open }, info) => {
  const page = await open();
  await expect.poll(() => newest(page)).toBeGreaterThan(0);
  const before = await newest(page);
  await expect.poll(() => newest(page)).toBeGreaterThan(before);
  await expect(page.locator(".landing .headline")).toHaveText(/cm (long|short|left|right|off)|seen/);
  await expect(page.locator(".numbers .value").first()).toHaveText(/^\d+\.\d$/);
  await expect(page.locator(".numbers .sigma").first()).toHaveText(/±/);
  await expect(page.getByRole("status").first()).not.toBeEmpty();
  const canvas = page.locator(".stage canvas");
  await expect(canvas).toHaveAttribute("data-drawn", /^\d+$/);
  // What the drawing shows is the ball that the numbers are of.
  await expect
    .poll(async () => {
      const shown = await page.locator(".landing").getAttribute("data-ball");
      return (await canvas.getAttribute("data-drawn")) === shown;
    })
    .toBe(true);
  await expect(page.locator(".sentence")).not.toBeEmpty();
  await picture(page, info, "live", true);
});

test("it is drawn from behind, above, the side and where it landed", async ({ open }, info) => {
  const page = await open();
  const canvas = page.locator(".stage canvas");
  await expect(canvas).toHaveAttribute("data-drawn", /^\d+$/);
  const seen = new Set<string>();
  for (const name of ["Above", "Side", "Landing", "Behind"]) {
    await page.getByRole("button", { name, exact: true }).click();
    await expect(page.getByRole("button", { name, exact: true })).toHaveAttribute("aria-pressed", "true");
    await page.waitForFunction(() => new Promise((go) => setTimeout(() => go(true), 600)));
    seen.add((await canvas.screenshot()).toString("base64"));
    if (name !== "Behind") await picture(page, info, `live-${name.toLowerCase()}`);
  }
  expect(seen.size, "four pictures that differ").toBe(4);
});

test("nothing is drawn while nothing happens", async ({ open, server }) => {
  const page = await open();
  await expect(page.locator(".stage canvas")).toHaveAttribute("data-drawn", /^\d+$/);
  await server.rest();
  await page.emulateMedia({ reducedMotion: "reduce" });
  const n_frames = await page.evaluate(async () => {
    let n = 0;
    const ask = window.requestAnimationFrame;
    window.requestAnimationFrame = (what) => {
      n += 1;
      return ask.call(window, what);
    };
    await new Promise((go) => setTimeout(go, 1500));
    window.requestAnimationFrame = ask;
    return n;
  });
  // A status comes every second and may draw words; a loop would be at 60 a second.
  expect(n_frames).toBeLessThan(20);
});

test("on a phone it fits, and an older ball can be looked at", async ({ open, page }, info) => {
  await page.setViewportSize(PHONE);
  await open();
  await expect(page.locator(".strip button")).not.toHaveCount(0);
  const wider = await page.evaluate(
    () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
  );
  expect(wider, "nothing is wider than the phone").toBeLessThanOrEqual(0);
  await expect(page.getByRole("button", { name: "Stop the machine" })).toBeInViewport();
  await expect(page.locator(".numbers .value").first()).toBeInViewport();
  await picture(page, info, "phone-live");
  await expect.poll(() => page.locator(".strip button").count()).toBeGreaterThan(1);
  await page.locator(".strip button").nth(1).click();
  await expect(page.getByRole("button", { name: "Show the last" })).toBeVisible();
});

test("every button and link of a phone is as big as a finger", async ({ open, page }) => {
  await page.setViewportSize(PHONE);
  for (const view of ["live", "session", "drill", "setup", "settings"]) {
    await open(view);
    await page.waitForLoadState("networkidle");
    const small = await page.evaluate(() =>
      [...document.querySelectorAll<HTMLElement>("button, a[href], select, input, summary")]
        .map((one) => (one.matches(".switch input, .segments input, [type=checkbox]") ? one.closest("label")! : one))
        .filter((one) => one.checkVisibility() && !one.matches(".skip, .brand *"))
        .map((one) => ({ text: one.textContent || one.tagName, box: one.getBoundingClientRect() }))
        .filter(({ box }) => box.height < 43.5 || box.width < 40)
        .map(({ text, box }) => `${text}: ${box.width.toFixed(0)} x ${box.height.toFixed(0)}`),
    );
    expect.soft(small, view).toEqual([]);
  }
});

test("without WebGL it is drawn from above and from the side", async ({ open, page }, info) => {
  await page.addInitScript(() => {
    const get = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, ...rest: never[]) {
      return kind.startsWith("webgl") ? null : get.call(this, kind as never, ...rest);
    } as typeof get;
  });
  await open();
  await expect(page.locator(".stage svg.court-map .flight").first()).toBeAttached();
  await page.getByRole("button", { name: "Side", exact: true }).click();
  await expect(page.locator(".stage svg.side-view .flight").first()).toBeAttached();
  await expect(page.getByRole("button", { name: "Behind", exact: true })).toHaveCount(0);
  await picture(page, info, "live-without-webgl");
});

test("a reload in the middle of a session loses nothing", async ({ open, server }) => {
  const page = await open();
  await expect.poll(() => newest(page)).toBeGreaterThan(0);
  const before = await newest(page);
  await page.reload();
  await expect.poll(() => newest(page)).toBeGreaterThanOrEqual(before);
  // The newest may come by itself before those of before the reload were asked for.
  const n_missed = async () => Math.min(12, await server.nBalls()) - (await page.locator(".strip button").count());
  await expect.poll(n_missed).toBe(0);
  await expect(page.locator(".line.open")).toBeVisible();
});

test("the server is killed and comes again: the page goes on without a reload", async ({ open, server }, info) => {
  const page = await open();
  await expect.poll(() => newest(page)).toBeGreaterThan(0);
  await page.evaluate(() => ((window as never as { mark: number }).mark = 1));
  const before = await newest(page);
  await server.kill();
  await expect(page.getByRole("alert").filter({ hasText: "No connection" })).toBeVisible();
  await picture(page, info, "live-lost");
  await server.start();
  await expect(page.locator(".line.open")).toBeVisible();
  await expect(page.locator(".banner")).toHaveCount(0);
  await server.serve();
  await expect.poll(() => newest(page)).toBeGreaterThan(before);
  expect(await page.evaluate(() => (window as never as { mark: number }).mark)).toBe(1);
});

test("the emergency stop stops, and says so until it is resumed", async ({ open }, info) => {
  const page = await open();
  await page.getByRole("button", { name: "Stop the machine" }).click();
  await expect(page.locator(".warning.strong")).toContainText("Emergency stop");
  await picture(page, info, "live-stopped");
  await page.getByRole("button", { name: "Resume" }).click();
  await expect(page.locator(".warning.strong")).toHaveCount(0);
});

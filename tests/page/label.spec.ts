// Ground truth: a person says where the ball is in a clip, by keyboard and click, and what was saved
// is read as `evaluate` reads it.
import AxeBuilder from "@axe-core/playwright";
import type { Page } from "@playwright/test";
import { mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { PHONE, expect, picture, test } from "./world";

const DATA = process.env["PAGE_DATA"] ?? "";
test.skip(DATA === "", "PAGE_DATA names no folder of a page");

const [WIDTH, HEIGHT, N_FRAMES] = [320, 240, 6];
/** Where a ball of 5 px is drawn in each frame. */
const ballAt = (frame: number): [number, number] => [40 + 35 * frame, 60 + 20 * frame];

/** A clip of a ball before a dull wall. */
function clip(name: string): void {
  const parts = [Buffer.from(`YUV4MPEG2 W${WIDTH} H${HEIGHT} F90:1 Cmono\n`)];
  for (let frame = 0; frame < N_FRAMES; frame++) {
    const luma = Buffer.alloc(WIDTH * HEIGHT, 70);
    const [x, y] = ballAt(frame);
    for (let dy = -2; dy <= 2; dy++) luma.fill(230, (y + dy) * WIDTH + x - 2, (y + dy) * WIDTH + x + 3);
    parts.push(Buffer.from("FRAME\n"), luma);
  }
  mkdirSync(join(DATA, "recordings"), { recursive: true });
  writeFileSync(join(DATA, "recordings", name), Buffer.concat(parts));
  rmSync(join(DATA, "recordings", name.replace(".y4m", ".csv")), { force: true });
}

const saved = (name: string) =>
  readFileSync(join(DATA, "recordings", name.replace(".y4m", ".csv")), "utf8")
    .trim().split("\n").map((line) => line.split(","));

/** Clicks where a pixel of the clip is on the screen: the whole picture is in view, in the middle. */
async function clickPixel(page: Page, [x, y]: [number, number], shift = false): Promise<void> {
  const stage = page.locator("#picture");
  const box = (await stage.boundingBox())!;
  const scale = Math.min(box.width / WIDTH, box.height / HEIGHT);
  const at = (pixel: number, side: number, room: number) => (room - side * scale) / 2 + (pixel + 0.5) * scale;
  const modifiers = shift ? (["Shift"] as const) : [];
  const position = { x: at(x, WIDTH, box.width), y: at(y, HEIGHT, box.height) };
  await stage.click({ position, modifiers: [...modifiers] });
}

const isAt = (page: Page, frame: number) => expect(page.locator("#frame-number")).toHaveText(`${frame}`);

test("three frames are labelled by keyboard and click, and the file has the pixels", async ({ open, page }, info) => {
  clip("serve.y4m");
  await open("setup");
  await page.getByRole("link", { name: "Label serve.y4m" }).click();
  await expect(page.locator("#clip-facts")).toHaveText(`${WIDTH} × ${HEIGHT}, ${N_FRAMES} frames, 90 Hz`);
  await isAt(page, 0);
  await clickPixel(page, ballAt(0)); // and goes on by itself
  await isAt(page, 1);
  await page.keyboard.press("n"); // no ball here
  await isAt(page, 2);
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("ArrowLeft");
  await isAt(page, 3);
  await clickPixel(page, ballAt(3), true);
  await isAt(page, 4);
  await clickPixel(page, ballAt(4));
  await page.keyboard.press("ArrowLeft");
  await page.keyboard.press("Alt+ArrowRight");
  await expect(page.locator("#saved")).toHaveText("saved to serve.csv");
  await picture(page, info, "label", true);
  const rows = saved("serve.y4m");
  expect(rows[0]).toEqual(["frame", "x_px", "y_px", "hard"]);
  expect(rows.slice(1).map(([frame, , , hard]) => [Number(frame), Number(hard)])).toEqual([[0, 0], [3, 1], [4, 0]]);
  for (const [frame, x, y] of rows.slice(1)) {
    const [x_px, y_px] = ballAt(Number(frame));
    const moved = frame === "4" ? 0.1 : 0;
    // A click is on a whole pixel of the screen, of which the clip's has more than one.
    expect(Math.abs(Number(x) - x_px - moved), `x of frame ${frame}`).toBeLessThanOrEqual(0.5);
    expect(Math.abs(Number(y) - y_px), `y of frame ${frame}`).toBeLessThanOrEqual(0.5);
  }
  const [download] = await Promise.all([
    page.waitForEvent("download"),
    page.getByRole("link", { name: "CSV" }).click(),
  ]);
  expect(download.suggestedFilename()).toBe("serve.csv");
  const file = readFileSync((await download.path())!, "utf8");
  expect(file.trim().split("\n").map((line) => line.split(","))).toEqual(rows);
  // A correction and an undo, after it was opened again.
  await page.reload();
  await expect(page.locator("#n-hard")).toHaveText("1");
  await page.keyboard.press("Delete");
  await expect.poll(() => saved("serve.y4m").length).toBe(rows.length - 1);
  await page.keyboard.press("Control+z");
  await expect.poll(() => saved("serve.y4m")).toEqual(rows);
  await page.getByRole("link", { name: "Set-up" }).click();
  await expect(page.getByRole("link", { name: "Labels as CSV" })).toBeVisible();
});

test("who has no token looks, and is asked for it before anything changes", async ({ open, page, server }) => {
  clip("guest.y4m");
  await open("setup", { token: false });
  await page.getByRole("link", { name: "Label guest.y4m" }).click();
  await expect(page.locator("#clip-facts")).toHaveText(`${WIDTH} × ${HEIGHT}, ${N_FRAMES} frames, 90 Hz`);
  await isAt(page, 0);
  await clickPixel(page, ballAt(0));
  const asks = page.getByRole("dialog", { name: "This needs the token" });
  await asks.getByLabel("Token").fill(server.token);
  await asks.getByRole("button", { name: "Go on" }).click();
  await expect(page.locator("#saved")).toHaveText("saved to guest.csv");
  expect(saved("guest.y4m")).toHaveLength(2);
});

test("a file that is no clip is told of in a sentence", async ({ open, page }) => {
  clip("broken.y4m");
  writeFileSync(join(DATA, "recordings", "broken.y4m"), "this is no clip\n");
  await open("setup");
  await page.getByRole("link", { name: "Label broken.y4m" }).click();
  await expect(page.locator("#trouble-words")).toContainText(/cannot be shown: .*broken\.y4m.*YUV4MPEG2/);
  rmSync(join(DATA, "recordings", "broken.y4m"));
});

test("axe finds nothing serious in the tool, which is usable on a phone, and speaks German", async ({ open, page }, info) => {
  clip("serve.y4m");
  for (const size of [{ width: 1280, height: 800 }, PHONE]) {
    await page.setViewportSize(size);
    await open("setup");
    await page.getByRole("link", { name: "Label serve.y4m" }).click();
    await expect(page.locator("#frame-count")).toHaveText(`of 0 to ${N_FRAMES - 1}`);
    const { violations, passes } = await new AxeBuilder({ page }).analyze();
    expect(passes.length).toBeGreaterThan(10);
    const bad = violations.filter((one) => one.impact === "serious" || one.impact === "critical");
    expect(bad.map((one) => `${one.id}: ${one.nodes.map((node) => node.html).join("\n")}`)).toEqual([]);
    const wider = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    expect(wider).toBeLessThanOrEqual(0);
  }
  await picture(page, info, "phone-label");
  await page.evaluate(() => localStorage.setItem("court.language", "de"));
  await page.reload();
  await expect(page.locator("#frame-count")).toHaveText(`von 0 bis ${N_FRAMES - 1}`);
  await expect(page.getByRole("button", { name: "Kein Ball" })).toBeVisible();
});

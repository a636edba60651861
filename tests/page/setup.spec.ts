// Cameras and calibration: beside `demo`, whose boards and pictures are simulated.
import { readFileSync } from "node:fs";
import type { Page } from "@playwright/test";
import { PHONE, expect, picture, test } from "./world";

const DEMO = process.env["DEMO_URL"] ?? "";
test.skip(DEMO === "", "DEMO_URL names no page of a demo");

async function openSetup(page: Page): Promise<void> {
  await page.goto(DEMO);
  await expect(page.locator("main")).toBeVisible();
  await page.goto(`${new URL(DEMO).origin}/#/setup`);
  await expect(page.locator(".line.open")).toBeVisible();
}

test("both cameras are seen, with lines, focus and light", async ({ page }, info) => {
  await openSetup(page);
  await page.getByRole("button", { name: "Take new pictures" }).click();
  await expect(page.locator(".camera .overlaid img")).toHaveCount(2);
  for (const camera of [0, 1]) {
    const image = page.locator(".camera .overlaid img").nth(camera);
    await expect.poll(() => image.evaluate((one: HTMLImageElement) => one.naturalWidth)).toBeGreaterThan(300);
    await expect(page.locator(".camera").nth(camera).locator(".court-line").first()).toBeAttached();
    await expect(page.locator(".camera").nth(camera).locator("meter")).toHaveCount(2);
  }
  await page.locator(".pair").scrollIntoViewIfNeeded();
  await picture(page, info, "setup-cameras");
});

test("the calibration runs to a verdict in centimetres and is used", async ({ page }, info) => {
  await openSetup(page);
  await page.getByRole("button", { name: "Take both pictures" }).click();
  await expect(page.locator(".camera .overlaid img")).toHaveCount(2);
  await page.getByRole("button", { name: /^Calibrate/ }).click();
  const job = page.locator(".wizard .job");
  await expect(job).toHaveAttribute("data-state", /running|done/);
  await expect(job).toHaveAttribute("data-state", "done", { timeout: 45_000 });
  await expect(page.locator(".verdict")).toContainText(/cm/);
  const found = page.locator("img.found");
  await expect.poll(() => found.evaluate((one: HTMLImageElement) => one.naturalWidth)).toBeGreaterThan(300);
  await found.scrollIntoViewIfNeeded();
  await picture(page, info, "setup-calibrated");
  await page.getByRole("button", { name: "Use this calibration" }).click();
  await expect(page.locator(".wizard .aim.good")).not.toBeEmpty();
});

test("on a phone it is usable", async ({ page }, info) => {
  await page.setViewportSize(PHONE);
  await openSetup(page);
  const wider = await page.evaluate(
    () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
  );
  expect(wider).toBeLessThanOrEqual(0);
  await picture(page, info, "phone-setup");
});

test("a clip is recorded and listed, and logs are saved", async ({ page }) => {
  await openSetup(page);
  await page.getByLabel(/^Length/).fill("2");
  await page.getByRole("button", { name: "Record", exact: true }).click();
  await expect(page.locator(".files-list li").first()).toBeVisible({ timeout: 40_000 });
  // The session that went on meanwhile leads to it.
  await page.locator('.tabs a[href="#/session"]').click();
  const [clip] = await Promise.all([
    page.waitForEvent("download"),
    page.getByRole("link", { name: /^MCAP \d/ }).first().click(),
  ]);
  const mcap = readFileSync((await clip.path())!);
  expect(mcap.subarray(1, 5).toString(), "the file begins as MCAP does").toBe("MCAP");
  await page.locator('.tabs a[href="#/setup"]').click();
  const [logs] = await Promise.all([
    page.waitForEvent("download"),
    page.getByRole("button", { name: "Download logs" }).click(),
  ]);
  expect(readFileSync((await logs.path())!).length).toBeGreaterThanOrEqual(0);
});

test("keys for a board are made and carried away", async ({ page }) => {
  await openSetup(page);
  const [file] = await Promise.all([
    page.waitForEvent("download"),
    page.getByRole("button", { name: "File for the left board" }).click(),
  ]);
  expect(file.suggestedFilename()).toMatch(/left\.pair$/);
  expect(readFileSync((await file.path())!).length).toBeGreaterThan(0);
});

import { readFileSync } from "node:fs";
import { PHONE, expect, picture, test } from "./world";

const ENOUGH = 14;

test.beforeAll(async ({ server }) => {
  test.setTimeout(150_000);
  await server.serve();
  await expect.poll(() => server.nBalls(), { timeout: 140_000 }).toBeGreaterThanOrEqual(ENOUGH);
});

test("the map, the trends and the table show the session", async ({ open }, info) => {
  const page = await open("session");
  await expect.poll(() => page.locator(".court-map .point").count()).toBeGreaterThan(5);
  await expect(page.locator(".court-map .scatter").first()).toBeAttached();
  await expect(page.locator(".trend svg")).toHaveCount(3);
  await expect(page.locator(".trend .band").first()).toBeAttached();
  await expect(page.locator("table.balls tbody tr")).not.toHaveCount(0);
  await picture(page, info, "session", true);
});

test("on a phone too", async ({ open, page }, info) => {
  await page.setViewportSize(PHONE);
  await open("session");
  await expect(page.locator(".court-map .point").first()).toBeAttached();
  const wider = await page.evaluate(
    () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
  );
  expect(wider).toBeLessThanOrEqual(0);
  await page.locator(".court-map").scrollIntoViewIfNeeded();
  await picture(page, info, "phone-session");
});

test("the table is filtered and paged", async ({ open }) => {
  const page = await open("session");
  const rows = page.locator("table.balls tbody tr");
  await expect(rows).not.toHaveCount(0);
  const target = page.locator("section:has(table.balls) select").first();
  const name = await target.locator("option").nth(1).textContent();
  await target.selectOption(name);
  await expect
    .poll(async () => {
      const cells = await page.locator("table.balls tbody tr td:nth-child(3)").allTextContents();
      return cells.length > 0 && cells.every((one) => one === name);
    })
    .toBe(true);
  await page.getByLabel("Outcome").selectOption("no court");
  await expect(page.getByText("No ball matches.")).toBeVisible();
  await page.getByLabel("Outcome").selectOption("");
  await page.getByLabel("Until").fill("2020-01-01T00:00");
  await expect(page.getByText("No ball matches.")).toBeVisible();
});

test("what is exported downloads and parses", async ({ open, server }) => {
  await server.rest();
  const page = await open("session");
  const saved = async (name: string) => {
    const [download] = await Promise.all([
      page.waitForEvent("download"),
      page.getByRole("link", { name, exact: true }).click(),
    ]);
    return readFileSync((await download.path())!, "utf8");
  };
  // All balls of the session that is shown, which need not be the longest one.
  const link = await page.getByRole("link", { name: "CSV", exact: true }).getAttribute("href");
  const address = new URL(link!.replace(/\/balls\.csv.*$/, ""), page.url());
  const session = (await (await page.request.get(address.href)).json()) as { n_balls: number };
  expect(session.n_balls).toBeGreaterThan(0);
  const csv = await saved("CSV");
  const lines = csv.trim().split(/\r?\n/);
  const n_columns = lines[0]!.split(",").length;
  expect(n_columns).toBeGreaterThan(1);
  expect(lines.length).toBe(session.n_balls + 1);
  const json = JSON.parse(await saved("JSON")) as Record<string, unknown>;
  expect(Object.keys(json).length).toBeGreaterThan(1);
});

test("every plot is saved as SVG and as PNG", async ({ open }) => {
  const page = await open("session");
  await expect(page.locator(".figure")).toHaveCount(4);
  for (let i = 0; i < 4; i++) {
    const figure = page.locator(".figure").nth(i);
    for (const kind of ["SVG", "PNG"]) {
      const [download] = await Promise.all([
        page.waitForEvent("download"),
        figure.getByRole("button", { name: new RegExp(`as ${kind}$`) }).click(),
      ]);
      const bytes = readFileSync((await download.path())!);
      if (kind === "PNG") {
        expect(bytes.subarray(1, 4).toString()).toBe("PNG");
        expect(bytes.readUInt32BE(16), "pixels across").toBe(1600);
      } else {
        const text = bytes.toString();
        const wrong = await page.evaluate(
          (text) => new DOMParser().parseFromString(text, "image/svg+xml").querySelector("parsererror") !== null,
          text,
        );
        expect(wrong, text.slice(0, 200)).toBe(false);
        expect(text).not.toContain("var(");
      }
    }
  }
});

test("two sessions are compared", async ({ open, server }, info) => {
  const made = await server.tell("POST", "/sessions", { name: "after lunch" });
  expect(made.status).toBeLessThan(300);
  await server.serve();
  const { id } = (await made.json()) as { id: number };
  await expect
    .poll(async () => (await server.ask<{ n_measured: number }>(`/sessions/${id}`)).n_measured, { timeout: 60_000 })
    .toBeGreaterThan(7);
  const page = await open("session");
  const compare = page.getByLabel("Compare with");
  await expect.poll(() => compare.locator("option").count()).toBeGreaterThan(1);
  await compare.selectOption({ index: 1 });
  await expect(page.locator("table.difference tbody tr").first()).toBeVisible();
  await expect(page.locator(".court-map .point.hollow").first()).toBeAttached();
  await picture(page, info, "session-compared");
});

import { PHONE, expect, picture, test } from "./world";

test("a drill starts, counts, and says what it changed and why", async ({ open, server }, info) => {
  await server.rest();
  const page = await open("drill");
  await page.getByRole("button", { name: /^Start/ }).click();
  await expect(page.locator(".run.running")).toBeVisible();
  await expect(page.locator(".run .under")).toHaveText(/Ball [1-9]/);
  await expect.poll(() => page.locator(".told li").count()).toBeGreaterThan(2);
  await expect(page.locator(".told li p").nth(1)).not.toBeEmpty();
  const correcting = page.getByRole("switch", { name: /Correct the machine/ });
  await expect(correcting).toBeChecked();
  await correcting.uncheck();
  await expect
    .poll(async () => (await server.ask<{ drill: { is_correcting: boolean } }>("/status")).drill.is_correcting)
    .toBe(false);
  await correcting.check();
  await picture(page, info, "drill", true);
  await page.getByRole("button", { name: "Stop the drill" }).click();
  await expect(page.getByRole("button", { name: /^Start/ })).toBeVisible();
});

test("a drill of three balls ends by itself", async ({ open, server }) => {
  await server.rest();
  const page = await open("drill");
  await page.getByLabel("Balls", { exact: true }).fill("3");
  await page.getByRole("button", { name: /^Start/ }).click();
  await expect(page.locator(".run.running")).toBeVisible();
  await expect(page.getByRole("button", { name: /^Start/ })).toBeVisible({ timeout: 60_000 });
});

test("a target is drawn by a tap, moved by keys, and kept", async ({ open, server }, info) => {
  const page = await open("drill");
  await page.getByRole("button", { name: "New drill" }).click();
  await page.getByLabel("Name of the drill").fill("from the test");
  const board = page.locator("svg.board");
  const box = (await board.boundingBox())!;
  await board.click({ position: { x: box.width * 0.62, y: box.height * 0.34 } });
  await expect(page.locator("svg.board .target")).toHaveCount(2);
  const across = page.getByLabel("Across (+ right)");
  const x = Number(await across.inputValue());
  expect(x).toBeGreaterThan(0.5);
  expect(x).toBeLessThan(3);
  await page.locator("svg.board .target").nth(1).focus();
  await page.keyboard.press("ArrowLeft");
  await expect(across).toHaveValue(`${Number((x - 0.1).toFixed(2))}`);
  await page.keyboard.press("Shift+ArrowDown");
  await page.getByLabel("Balls in a row").fill("3");
  await expect(page.locator(".aim.good")).toBeVisible();
  await picture(page, info, "drill-draw");
  await page.getByRole("button", { name: "Save" }).click();
  await expect(page.getByRole("button", { name: "Save" })).toBeDisabled();
  const { drills } = await server.ask<{ drills: { name: string; targets: { repeat?: number }[] }[] }>("/drills");
  const kept = drills.find((one) => one.name === "from the test");
  expect(kept?.targets.map((one) => one.repeat ?? 1)).toEqual([1, 3]);
  await page.getByRole("button", { name: "Delete" }).click();
  await expect
    .poll(async () => (await server.ask<{ drills: { name: string }[] }>("/drills")).drills.map((one) => one.name))
    .not.toContain("from the test");
});

test("a target is dragged", async ({ open }) => {
  const page = await open("drill");
  await expect(page.locator("svg.board .target").first()).toBeVisible();
  const along = page.getByLabel(/^Along/);
  await page.locator("svg.board .target").first().focus();
  const before = Number(await along.inputValue());
  const spot = (await page.locator("svg.board .target .point").first().boundingBox())!;
  await page.mouse.move(spot.x + spot.width / 2, spot.y + spot.height / 2);
  await page.mouse.down();
  await page.mouse.move(spot.x, spot.y + 60, { steps: 5 });
  await page.mouse.up();
  await expect.poll(async () => Number(await along.inputValue())).toBeLessThan(before - 0.5);
});

test("what the machine cannot reach is told, with the nearest it can", async ({ open, page }, info) => {
  await page.setViewportSize(PHONE);
  await open("drill");
  await page.getByRole("button", { name: "New drill" }).click();
  await page.getByLabel("Across (+ right)").fill("6.4");
  await page.getByLabel(/^Along/).fill("12.5");
  await expect(page.locator(".aim.wrong")).toBeVisible();
  await page.locator(".aim").scrollIntoViewIfNeeded();
  await picture(page, info, "phone-drill-unreachable");
  const nearest = page.getByRole("button", { name: /Take the nearest/ });
  if (await nearest.count()) {
    await nearest.click();
    await expect.poll(async () => Number(await page.getByLabel("Across (+ right)").inputValue())).toBeLessThan(6.4);
  }
});

test("whoever has no token may watch and is asked for one", async ({ open, server }, info) => {
  await server.rest();
  const page = await open("drill", { token: false });
  await page.getByRole("button", { name: /^Start/ }).click();
  const dialog = page.getByRole("dialog");
  await expect(dialog).toBeVisible();
  await picture(page, info, "token");
  await dialog.getByLabel("Token").fill("wrong");
  await dialog.getByRole("button", { name: "Go on" }).click();
  await expect(dialog).toContainText("not accepted");
  await dialog.getByRole("button", { name: "Cancel" }).click();
  await expect(dialog).toBeHidden();
  await expect(page.locator(".run.running")).toHaveCount(0);
  for (const [method, path, body] of [
    ["POST", "/machine/stop", undefined],
    ["POST", "/drill/start", { name: "x", is_correcting: true, balls: null }],
    ["PUT", "/drills/x", { name: "x", order: "in turn", period_s: 4, targets: [] }],
    ["POST", "/sessions", { name: "x" }],
    ["GET", "/logs.txt", undefined],
  ] as const) {
    const answer = await fetch(server.api(path), {
      method,
      headers: { "Content-Type": "application/json" },
      ...(body === undefined ? {} : { body: JSON.stringify(body) }),
    });
    expect(answer.status, `${method} ${path}`).toBe(401);
  }
  await page.getByRole("button", { name: /^Start/ }).click();
  await dialog.getByLabel("Token").fill(server.token);
  await dialog.getByRole("button", { name: "Go on" }).click();
  await expect(page.locator(".run.running")).toBeVisible();
});

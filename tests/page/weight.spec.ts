// How soon the page is there and how much comes over the line.
import { expect, test } from "./world";

const MAX_BYTES = 1_500_000;
const MAX_FIRST_VIEW_MS = 1000;

test("first view within a second, all within 1.5 MB", async ({ page, server }) => {
  await server.serve();
  const line = await page.context().newCDPSession(page);
  await line.send("Network.enable");
  let n_bytes = 0;
  line.on("Network.loadingFinished", (one) => (n_bytes += one.encodedDataLength));
  await page.goto(`${server.url}/`);
  await expect(page.locator(".stage canvas")).toHaveAttribute("data-drawn", /./);
  await page.waitForLoadState("networkidle");
  const files_bytes = n_bytes;
  const times = await page.evaluate(() => {
    const paint = performance.getEntriesByName("first-contentful-paint")[0];
    return { first_ms: paint?.startTime ?? null };
  });
  // Compressed or not, what the browser unpacks is counted too.
  const unpacked = await page.evaluate(() =>
    performance.getEntriesByType("resource").reduce(
      (sum, one) => sum + (one as PerformanceResourceTiming).decodedBodySize, 0),
  );
  console.log(
    `first view ${times.first_ms?.toFixed(0)} ms; ${files_bytes} bytes on the line, ${unpacked} unpacked`,
  );
  expect(times.first_ms).not.toBeNull();
  expect(times.first_ms!).toBeLessThan(MAX_FIRST_VIEW_MS);
  expect(files_bytes).toBeGreaterThan(10_000);
  expect(files_bytes).toBeLessThan(MAX_BYTES);
  expect(unpacked).toBeLessThan(MAX_BYTES);
});

// Twenty viewers beside each other must not delay a shot. Beside `demo`, where frames come as they
// would from boards: from the ball's bounce (stamped by the camera) to a viewer that has the shot.
import { readFileSync } from "node:fs";
import WebSocket from "ws";
import { expect, test, type Ball } from "./world";

const DEMO = process.env["DEMO_URL"] ?? "";
const N_VIEWERS = 20;
const N_SHOTS = Number(process.env["LATENCY_SHOTS"] ?? 12);

test.skip(DEMO === "", "DEMO_URL names no page of a demo");

/** Stamps are on CLOCK_BOOTTIME, which Node reads from /proc only. */
const bootMinusOwnNs = (() => {
  const guesses = Array.from({ length: 2000 }, () => {
    const boot_s = Number(readFileSync("/proc/uptime", "utf8").split(" ")[0]);
    return boot_s * 1e9 - Number(process.hrtime.bigint());
  });
  // /proc tells hundredths, cut off: the largest difference is nearest to the truth.
  return Math.max(...guesses);
})();

class Viewer {
  readonly delays_ms: number[] = [];
  readonly ids = new Set<number>();
  private readonly socket: WebSocket;

  constructor(url: string) {
    this.socket = new WebSocket(url);
    this.socket.on("message", (data) => {
      const now_ns = Number(process.hrtime.bigint()) + bootMinusOwnNs;
      const text = data.toString();
      if (!text.startsWith('{"type":"ball"')) {
        const { type } = JSON.parse(text) as { type: string };
        if (type !== "ball") return;
      }
      const { ball } = JSON.parse(text) as { ball: Ball };
      this.ids.add(ball.id);
      if (ball.shot.bounce) this.delays_ms.push((now_ns - ball.shot.bounce.t_ns) / 1e6);
    });
  }

  async isOpen(): Promise<void> {
    if (this.socket.readyState === WebSocket.OPEN) return;
    await new Promise((resolve, reject) => {
      this.socket.once("open", resolve);
      this.socket.once("error", reject);
    });
  }

  close(): void {
    this.socket.terminate();
  }
}

const part = (values: number[], p: number) =>
  [...values].sort((a, b) => a - b)[Math.min(values.length - 1, Math.floor(p * values.length))] ?? NaN;

test("a shot is as soon with twenty viewers as with one", async () => {
  test.setTimeout(240_000);
  const { host } = new URL(DEMO);
  const measured = async (n: number) => {
    const viewers = Array.from({ length: n }, () => new Viewer(`ws://${host}/api/v1/live`));
    await Promise.all(viewers.map((one) => one.isOpen()));
    const first = viewers[0] as Viewer;
    await expect.poll(() => first.delays_ms.length, { timeout: 110_000 }).toBeGreaterThanOrEqual(N_SHOTS);
    const ids = [...first.ids];
    const heard = viewers.map((one) => ids.filter((id) => one.ids.has(id)).length);
    viewers.forEach((one) => one.close());
    expect(Math.min(...heard), "every viewer has every shot").toBeGreaterThanOrEqual(ids.length - 1);
    return first.delays_ms;
  };
  const alone = await measured(1);
  const among = await measured(1 + N_VIEWERS);
  const told = (values: number[]) =>
    `p50 ${part(values, 0.5).toFixed(1)} ms, worst ${Math.max(...values).toFixed(1)} ms of ${values.length}`;
  console.log(`bounce to viewer: alone ${told(alone)}; among ${N_VIEWERS + 1} ${told(among)}`);
  expect(part(alone, 0.5)).toBeGreaterThan(0);
  expect(part(among, 0.5), "less than 200 ms after the bounce").toBeLessThan(200);
});

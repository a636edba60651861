// Twenty viewers beside each other must not delay a shot. Beside `demo`, where frames come as they
// would from boards: from the ball's bounce (stamped by the camera) to a viewer that has the shot.
// The simulated cameras' clock begins anywhere, so delays are told above that of the quickest shot.
import WebSocket from "ws";
import { expect, test, type Ball } from "./world";

const DEMO = process.env["DEMO_URL"] ?? "";
const N_VIEWERS = 20;
/** A twentieth of the 200 ms in which a shot is to be seen, and about a frame at 90 a second. */
const FRAME_MS = 10;
const N_SHOTS = Number(process.env["LATENCY_SHOTS"] ?? 12);

test.skip(DEMO === "", "DEMO_URL names no page of a demo");

class Viewer {
  readonly delays_ms: number[] = [];
  readonly ids = new Set<number>();
  private readonly socket: WebSocket;

  constructor(url: string) {
    this.socket = new WebSocket(url);
    this.socket.on("message", (data) => {
      const now_ns = Number(process.hrtime.bigint());
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
  const quickest = Math.min(...alone, ...among);
  const told = (values: number[]) => {
    const later = values.map((one) => one - quickest);
    const [p50, p90] = [part(later, 0.5), part(later, 0.9)].map((one) => one.toFixed(1));
    return `p50 ${p50} ms, p90 ${p90} ms of ${values.length} shots`;
  };
  const more_ms = part(among, 0.5) - part(alone, 0.5);
  console.log(
    `bounce to viewer, above the quickest: alone ${told(alone)}; ` +
      `among ${N_VIEWERS + 1} ${told(among)}; the median moved by ${more_ms.toFixed(1)} ms`,
  );
  expect(more_ms, "the median must not move by more than a frame").toBeLessThan(FRAME_MS);
});

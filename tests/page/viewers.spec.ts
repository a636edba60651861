// Twenty viewers beside each other must not delay a shot. Beside `demo`, where frames come as they
// would from boards, with few flights that come again: the same flight is seen in turn with and
// without viewers, so that what differs between flights (how long a bounce takes to be sure) and
// what else the computer does falls out of the difference. The time is that from the ball's bounce,
// by the cameras' stamps, until the page's server has fusion's shot.
import WebSocket from "ws";
import { expect, test, type Ball } from "./world";

const DEMO = process.env["DEMO_URL"] ?? "";
const N_VIEWERS = 20;
/** Latency may grow by so much of itself. */
const ALLOWED = 0.05;
/** And by no more than this, however uncertain the rest is. */
const FRAME_MS = 10;
const N_PAIRS = Number(process.env["LATENCY_PAIRS"] ?? 20);
/** As `demo --different-shots` was told: odd, so that each flight has its turn both ways. */
const N_FLIGHTS = Number(process.env["DEMO_FLIGHTS"] ?? 5);

test.skip(DEMO === "", "DEMO_URL names no page of a demo");

class Viewer {
  readonly balls = new Map<number, Ball>();
  private readonly socket: WebSocket;

  constructor(url: string) {
    this.socket = new WebSocket(url);
    this.socket.on("message", (data) => {
      const message = JSON.parse(data.toString()) as { type: string; ball: Ball };
      if (message.type === "ball") this.balls.set(message.ball.id, message.ball);
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

function median(values: number[]): number {
  const sorted = [...values].sort((a, b) => a - b);
  const mid = sorted.length / 2;
  return sorted.length % 2 === 1 ? (sorted[Math.floor(mid)] ?? NaN) : ((sorted[mid - 1] ?? NaN) + (sorted[mid] ?? NaN)) / 2;
}

/** 1 sigma of a median, from the median distance to it: a stall of the computer does not count. */
function medianSigma(values: number[]): number {
  const middle = median(values);
  const spread = 1.4826 * median(values.map((one) => Math.abs(one - middle)));
  return (1.2533 * spread) / Math.sqrt(values.length);
}

test("fusion's shots are as soon with twenty viewers as with none", async () => {
  test.setTimeout(60_000 + N_PAIRS * 2 * 5_000);
  const { host } = new URL(DEMO);
  const url = `ws://${host}/api/v1/live`;
  // One listens all the time, in this process; it is none of the twenty.
  const witness = new Viewer(url);
  await witness.isOpen();
  let viewers: Viewer[] = [];
  const visits = new Map<number, { alone: number[]; watched: number[] }>();
  const pairs = () => {
    const both = [...visits.values()].map(({ alone, watched }) => {
      const n = Math.min(alone.length, watched.length);
      return alone.slice(0, n).map((one, i) => [one, watched[i] ?? NaN] as const);
    });
    return both.flat();
  };
  for (let turn = 0; pairs().length < N_PAIRS && turn < 3 * N_PAIRS; turn++) {
    const is_watched = turn % 2 === 1;
    viewers = is_watched ? Array.from({ length: N_VIEWERS }, () => new Viewer(url)) : [];
    await Promise.all(viewers.map((one) => one.isOpen()));
    const n_before = witness.balls.size;
    await expect.poll(() => witness.balls.size, { timeout: 20_000, intervals: [50] }).toBeGreaterThan(n_before);
    const ball = [...witness.balls.values()].at(-1);
    if (is_watched && ball) {
      const have = () => viewers.filter((one) => one.balls.has(ball.id)).length;
      await expect.poll(have, { intervals: [50] }).toBe(N_VIEWERS);
    }
    viewers.forEach((one) => one.close());
    const shot_idx = ball?.shot.shot_idx ?? null;
    if (shot_idx === null || ball?.age_ms == null) continue;
    const flight = shot_idx % N_FLIGHTS;
    const visit = visits.get(flight) ?? { alone: [], watched: [] };
    (is_watched ? visit.watched : visit.alone).push(ball.age_ms);
    visits.set(flight, visit);
  }
  witness.close();
  const both = pairs();
  expect(both.length, "the same flights with and without viewers").toBeGreaterThanOrEqual(N_PAIRS);
  const later = both.map(([alone, watched]) => watched - alone);
  const alone_ms = median(both.map(([alone]) => alone));
  const [more_ms, sigma_ms] = [median(later), medianSigma(later)];
  const [ratio, sigma] = [1 + more_ms / alone_ms, sigma_ms / alone_ms];
  console.log(
    `bounce to shot: median ${alone_ms.toFixed(1)} ms alone; with ${N_VIEWERS} viewers ` +
      `${more_ms >= 0 ? "+" : ""}${more_ms.toFixed(2)} ± ${sigma_ms.toFixed(2)} ms in ${both.length} pairs of the ` +
      `same flight: ratio ${ratio.toFixed(3)} ± ${sigma.toFixed(3)}`,
  );
  expect(more_ms, "the median must not move by more than a frame").toBeLessThan(FRAME_MS);
  expect(sigma, "the difference is known well enough to be judged").toBeLessThan(ALLOWED);
  expect(ratio - 2 * sigma, "longer by more than a twentieth").toBeLessThan(1 + ALLOWED);
});

// Track of a shot -> what is drawn: the flight before the bounce and the hop after it.
import type { Shot, Xyz } from "../contract";

export interface Drawn {
  before: Xyz[];
  after: Xyz[];
}

/** More points than this make no smoother line. */
const MAX_POINTS = 240;

function thinned(points: Xyz[]): Xyz[] {
  if (points.length <= MAX_POINTS) return points;
  const step = (points.length - 1) / (MAX_POINTS - 1);
  return Array.from({ length: MAX_POINTS }, (_, i) => points[Math.round(i * step)] as Xyz);
}

export function drawnFrom(shot: Shot): Drawn {
  const track = [...shot.track].sort((a, b) => a.t_ns - b.t_ns);
  const before: Xyz[] = [];
  const after: Xyz[] = [];
  const bounce_ns = shot.bounce?.t_ns ?? Infinity;
  const launch = shot.launch;
  const first = track[0];
  if (launch && (first === undefined || launch.t_ns < first.t_ns)) before.push(launch.position_m);
  for (const point of track) (point.t_ns < bounce_ns ? before : after).push(point.position_m);
  if (shot.bounce) {
    before.push(shot.bounce.position_m);
    after.unshift(shot.bounce.position_m);
  }
  return { before: thinned(before), after: after.length > 1 ? thinned(after) : [] };
}

/** Height of the net's cord: it hangs from post to post, lowest in the middle. */
export function cordHeight(
  x_m: number,
  net: { posts_x_m: [number, number]; height_post_m: number; height_center_m: number },
): number {
  const [left, right] = net.posts_x_m;
  const part = (2 * (x_m - (left + right) / 2)) / (right - left);
  return net.height_center_m + (net.height_post_m - net.height_center_m) * Math.min(1, part * part);
}

// What the server says, as in /api/v1/openapi.json. SI units; `null` is "not observed", never 0.
export type Xy = [number, number];
export type Xyz = [number, number, number];
export type CameraName = "left" | "right";

export interface Court {
  name: string;
  lines_m: [Xy, Xy][];
  net: {
    y_m: number;
    posts_x_m: [number, number];
    height_post_m: number;
    height_center_m: number;
  };
  launcher_m: Xyz | null;
  cameras_m: Xyz[];
}

interface LaunchSigma {
  speed_m_s: number | null;
  elevation_deg: number | null;
  azimuth_deg: number | null;
  spin_rpm: number | null;
}

export interface Shot {
  shot_idx: number;
  outcome: string;
  launch:
    | (LaunchSigma & { t_ns: number; position_m: Xyz; sigma: LaunchSigma })
    | null;
  bounce: {
    t_ns: number;
    position_m: Xyz;
    velocity_in_m_s: Xyz;
    velocity_out_m_s: Xyz | null;
    covariance_m2: [Xy, Xy];
  } | null;
  net: { height_m: number; sigma_m: number } | null;
  track: {
    t_ns: number;
    position_m: Xyz;
    velocity_m_s: Xyz;
    sigma_m: Xyz;
    left_px: Xy | null;
    right_px: Xy | null;
  }[];
  residual_px: { left: number | null; right: number | null };
  frames_lost?: { left: number | null; right: number | null };
}

export interface Target {
  name: string;
  landing_m: Xy;
  zone_radius_m: number;
  speed_m_s: number | null;
  spin_rpm: number | null;
  net_height_m: number | null;
  apex_m: number | null;
  /** Balls in a row; null is one. */
  repeat?: number | null;
}

export interface ShotRow {
  id: number;
  session_id: number;
  at_ms: number;
  /** How long after its bounce it was told; null when it was recorded. */
  age_ms?: number | null;
  outcome: string;
  speed_m_s: number | null;
  speed_sigma_m_s: number | null;
  elevation_deg: number | null;
  azimuth_deg: number | null;
  spin_rpm: number | null;
  spin_sigma_rpm: number | null;
  net_height_m: number | null;
  net_height_sigma_m: number | null;
  landing_m: Xy | null;
  landing_covariance_m2: [Xy, Xy] | null;
  target: Target | null;
  miss_m: Xy | null;
  sentence: string | null;
}

export interface Settings {
  speed_m_s: number | null;
  elevation_deg: number | null;
  azimuth_deg: number | null;
  spin_rpm: number | null;
}

export interface Correction {
  correction_idx: number;
  reason: string;
  is_trusted: boolean;
  sentence: string;
  target: string | null;
  next: Settings;
  expected_landing_m: [number | null, number | null];
  miss_m: Xy | null;
  parts: { cause: string; off_m: Xy; sigma_m: Xy }[];
  air: { drag: number; drag_sigma: number; wind_m_s: Xy; wind_sigma_m_s: Xy } | null;
}

export interface Ball extends ShotRow {
  shot: Shot;
  reference_m: Xyz[] | null;
  correction: Correction | null;
}

export interface SessionRow {
  id: number;
  name: string;
  started_ms: number;
  ended_ms: number | null;
  n_balls: number;
  n_measured: number;
}

/** Turned from +x towards +y, of the major axis. */
export interface Ellipse {
  center_m: Xy;
  half_axes_m: Xy;
  turned_rad: number;
}

export interface TargetSummary {
  target: Target;
  n: number;
  n_in_zone: number;
  bias_m: Xy | null;
  bias_sigma_m: Xy | null;
  ellipse_95: Ellipse | null;
  mean_ellipse_95: Ellipse | null;
}

export interface TrendPoint {
  shot_id: number;
  at_ms: number;
  miss_m: Xy | null;
  drag: number | null;
  drag_sigma: number | null;
  wind_m_s: Xy | null;
  wind_sigma_m_s: Xy | null;
}

export interface Session extends SessionRow {
  targets: TargetSummary[];
  trend: TrendPoint[];
  pace: { rating: number; sigma: number; n: number } | null;
}

export interface Board {
  camera: CameraName;
  state: "alive" | "silent" | "never seen";
  heard_age_ms: number | null;
  clock_sigma_ms: number | null;
  n_batches: number;
  n_lost: number;
  frames_s: number | null;
  candidates_s: number | null;
}

export interface DrillState {
  running: boolean;
  name: string | null;
  is_correcting: boolean;
  ball: number;
  balls: number | null;
  target: Target | null;
  said: string | null;
}

export interface Job {
  id: number;
  kind: string;
  state: "running" | "done" | "failed";
  progress: number;
  lines: string[];
  verdict: string | null;
  at_ms: number;
}

export interface Watch {
  sentence: string;
  at_ms: number;
}

export interface Status {
  court: string;
  version: string;
  now_ms: number;
  fusion: "alive" | "silent";
  boards: Board[];
  machine: {
    state: string;
    heard_age_ms: number;
    settings: Settings;
    limits: { min: Settings; max: Settings } | null;
  } | null;
  drill: DrillState;
  session: SessionRow | null;
  watch: Watch | null;
  setup: Job | null;
  needs_token: boolean;
  n_viewers: number;
  n_lost: number;
  /** Whether balls are kept: the disk may be full. */
  history?: { n_lost: number; error: string | null };
}

export type Order = string;

export interface Drill {
  name: string;
  order: Order;
  period_s: number;
  targets: Target[];
}

export interface Aim {
  reachable: boolean;
  sentence: string | null;
  settings: Settings | null;
  landing_m: Xy | null;
  flight_m: Xyz[] | null;
  net_height_m: number | null;
}

export interface CameraView {
  camera: CameraName;
  at_ms: number;
  image_px: Xy;
  sharpness: number;
  saturated_part: number;
  dark_part: number;
  median_level: number;
  lines_px: Xy[][];
  candidates_px: { at_px: Xy; width_px: number | null }[];
}

export interface Recording {
  name: string;
  bytes: number;
  at_ms: number;
}

/** A clip that a person can say of where the ball is. */
export interface Clip {
  name: string;
  bytes: number;
  at_ms: number;
  is_labelled: boolean;
}

export interface Problem {
  error: string;
  expected?: string;
}

export type LiveMessage =
  | { type: "status"; status: Status }
  | { type: "ball"; ball: Ball }
  | { type: "correction"; id: number; ball: Ball }
  | { type: "drill"; drill: DrillState }
  | { type: "watch"; watch: Watch | null }
  | { type: "job"; job: Job };

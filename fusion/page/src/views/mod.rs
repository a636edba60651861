//! What goes over the wire: SI units with suffixes; what was not observed is null.

mod labels;
mod setup;
mod status;

pub use labels::*;
pub use setup::*;
pub use status::*;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

/// x to the right, y to the far baseline, m.
pub type Xy = [f64; 2];
/// And z up.
pub type Xyz = [f64; 3];

/// Why something was not done.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Problem {
    /// In a sentence.
    pub error: String,
}

/// The court as it stands still.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Court {
    /// Its name.
    pub name: String,
    /// Painted lines, from end to end.
    pub lines_m: Vec<[[f64; 2]; 2]>,
    /// The net.
    pub net: Net,
    /// Where the ball machine lets go; null if nobody said.
    pub launcher_m: Option<[f64; 3]>,
    /// Where cameras stand, left first; empty without a rig on a court.
    pub cameras_m: Vec<[f64; 3]>,
}

/// The net.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Net {
    /// Its plane.
    pub y_m: f64,
    /// Its posts.
    pub posts_x_m: [f64; 2],
    /// Height there.
    pub height_post_m: f64,
    /// Height in the middle.
    pub height_center_m: f64,
}

/// Something to aim at; at most two of speed, spin, height over the net and apex.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// For people: 1 to 60 characters.
    pub name: String,
    /// Where it should touch the ground.
    pub landing_m: [f64; 2],
    /// A ball within this distance is in the zone.
    pub zone_radius_m: f64,
    /// At the launcher.
    pub speed_m_s: Option<f64>,
    /// Topspin is negative.
    pub spin_rpm: Option<f64>,
    /// Of the ball's centre in the net's plane.
    pub net_height_m: Option<f64>,
    /// Of the ball's centre where it is highest.
    pub apex_m: Option<f64>,
    /// Balls in a row, 1 to 1000; left out it is 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeat: Option<u32>,
}

impl Target {
    /// A place to land at, with nothing else wanted.
    #[must_use]
    pub fn at(name: String, landing_m: Xy, zone_radius_m: f64) -> Self {
        Self {
            name,
            landing_m,
            zone_radius_m,
            speed_m_s: None,
            spin_rpm: None,
            net_height_m: None,
            apex_m: None,
            repeat: None,
        }
    }
}

/// One ball in lists.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
pub struct BallRow {
    /// Of the history; grows for ever.
    pub id: i64,
    /// Its session.
    pub session_id: i64,
    /// When it was told, Unix time.
    pub at_ms: i64,
    /// How long after its bounce it was told; null when the stamps are of a recording.
    #[serde(default)]
    pub age_ms: Option<f64>,
    /// As in shots/1: "measured", "no bounce seen" ...
    pub outcome: String,
    /// At the launcher.
    pub speed_m_s: Option<f64>,
    /// 1 sigma.
    pub speed_sigma_m_s: Option<f64>,
    /// Above the ground.
    pub elevation_deg: Option<f64>,
    /// From +y towards +x.
    pub azimuth_deg: Option<f64>,
    /// Backspin; topspin is negative.
    pub spin_rpm: Option<f64>,
    /// 1 sigma.
    pub spin_sigma_rpm: Option<f64>,
    /// Of the ball's centre in the net's plane.
    pub net_height_m: Option<f64>,
    /// 1 sigma.
    pub net_height_sigma_m: Option<f64>,
    /// Where it touched the ground.
    pub landing_m: Option<[f64; 2]>,
    /// How well that is known.
    pub landing_covariance_m2: Option<[[f64; 2]; 2]>,
    /// What it was for.
    pub target: Option<Target>,
    /// Landing less target.
    pub miss_m: Option<[f64; 2]>,
    /// What fusion said after it.
    pub sentence: Option<String>,
}

/// One ball with all that is known of it.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Ball {
    /// What lists show.
    #[serde(flatten)]
    pub row: BallRow,
    /// The shot as fusion published it, shots/1.
    pub shot: Value,
    /// Where its settings should have taken it.
    pub reference_m: Option<Vec<[f64; 3]>>,
    /// What fusion said after it.
    pub correction: Option<Correction>,
}

/// What a machine is told.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Settings {
    /// At the launcher.
    pub speed_m_s: Option<f64>,
    /// Above the ground.
    pub elevation_deg: Option<f64>,
    /// From +y towards +x.
    pub azimuth_deg: Option<f64>,
    /// Topspin is negative.
    pub spin_rpm: Option<f64>,
}

/// Part of a miss.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
pub struct Part {
    /// What it came of.
    pub cause: String,
    /// So far off.
    pub off_m: [f64; 2],
    /// 1 sigma.
    pub sigma_m: [f64; 2],
}

/// What is believed of the air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Air {
    /// Drag coefficient of the balls.
    pub drag: f64,
    /// 1 sigma.
    pub drag_sigma: f64,
    /// Wind.
    pub wind_m_s: [f64; 2],
    /// 1 sigma.
    pub wind_sigma_m_s: [f64; 2],
}

/// What fusion says after a ball.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
pub struct Correction {
    /// 0, 1, 2 … since fusion started.
    pub correction_idx: u64,
    /// "used", "outlier", "not measured" …
    pub reason: String,
    /// Whether the next settings should be used.
    pub is_trusted: bool,
    /// In words.
    pub sentence: String,
    /// What the next ball is for.
    pub target: Option<String>,
    /// For the next ball.
    pub next: Settings,
    /// Where the next one is expected in the mean.
    pub expected_landing_m: [Option<f64>; 2],
    /// Landing less target of the ball it follows.
    pub miss_m: Option<[f64; 2]>,
    /// They add up to the miss.
    pub parts: Vec<Part>,
    /// After this ball.
    pub air: Option<Air>,
}

/// A session in lists.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SessionRow {
    /// Of the history.
    pub id: i64,
    /// For people.
    pub name: String,
    /// Unix time.
    pub started_ms: i64,
    /// Null while it goes on.
    pub ended_ms: Option<i64>,
    /// Balls told of.
    pub n_balls: i64,
    /// Of them, with a bounce.
    pub n_measured: i64,
}

/// A session with its figures.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Session {
    /// What lists show.
    #[serde(flatten)]
    pub row: SessionRow,
    /// Each target's.
    pub targets: Vec<TargetFigures>,
    /// Ball by ball, at most 2000, the newest.
    pub trend: Vec<TrendPoint>,
    /// ITF court pace of its bounces.
    pub pace: Option<Pace>,
}

/// How it went at one target.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct TargetFigures {
    /// Which.
    pub target: Target,
    /// Measured balls.
    pub n: usize,
    /// In its zone.
    pub n_in_zone: usize,
    /// Mean of landings less target.
    pub bias_m: Option<[f64; 2]>,
    /// 1 sigma of that.
    pub bias_sigma_m: Option<[f64; 2]>,
    /// Where 95 % of balls land.
    pub ellipse_95: Option<Ellipse>,
    /// Where the mean is, to 95 %.
    pub mean_ellipse_95: Option<Ellipse>,
}

/// An ellipse on the ground.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
pub struct Ellipse {
    /// Its middle.
    pub center_m: [f64; 2],
    /// Long and short.
    pub half_axes_m: [f64; 2],
    /// Of the long axis, from +x towards +y.
    pub turned_rad: f64,
}

/// One ball of a trend.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct TrendPoint {
    /// The ball.
    pub shot_id: i64,
    /// Unix time.
    pub at_ms: i64,
    /// Landing less target.
    pub miss_m: Option<[f64; 2]>,
    /// Believed after it.
    pub drag: Option<f64>,
    /// 1 sigma.
    pub drag_sigma: Option<f64>,
    /// Believed after it.
    pub wind_m_s: Option<[f64; 2]>,
    /// 1 sigma.
    pub wind_sigma_m_s: Option<[f64; 2]>,
}

/// ITF court pace rating.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
pub struct Pace {
    /// The mean of balls.
    pub rating: f64,
    /// 1 sigma.
    pub sigma: f64,
    /// Balls.
    pub n: usize,
}

/// Some balls, newest first.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Balls {
    /// At most as many as were asked for.
    pub balls: Vec<BallRow>,
    /// `before` of the next page; null at the end.
    pub next: Option<i64>,
}

/// Some sessions, newest first.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Sessions {
    /// At most as many as were asked for.
    pub sessions: Vec<SessionRow>,
    /// `before` of the next page; null at the end.
    pub next: Option<i64>,
}

/// A drill.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Drill {
    /// Its file's name: 1 to 40 of a-z, A-Z, 0-9, space, '-' and '_'.
    pub name: String,
    /// "in turn" or "random".
    pub order: String,
    /// From ball to ball, 1 to 600.
    pub period_s: f64,
    /// 1 to 200.
    pub targets: Vec<Target>,
}

/// All drills.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Drills {
    /// By name.
    pub drills: Vec<Drill>,
}

/// How a target is aimed at.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Aim {
    /// The machine can do it.
    pub reachable: bool,
    /// Why not.
    pub sentence: Option<String>,
    /// What the machine would be told; of the nearest it can, if not reachable.
    pub settings: Option<Settings>,
    /// Where that lands.
    pub landing_m: Option<[f64; 2]>,
    /// The flight.
    pub flight_m: Option<Vec<[f64; 3]>>,
    /// Of the ball's centre in the net's plane.
    pub net_height_m: Option<f64>,
}

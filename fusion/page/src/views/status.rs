//! How all is, and what is pushed.

use super::{Ball, SessionRow, Settings, Target};
use serde::Serialize;
use utoipa::ToSchema;

/// One board.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Board {
    /// "left" or "right".
    pub camera: &'static str,
    /// "alive", "silent" or "never seen".
    pub state: &'static str,
    /// Since its last candidates.
    pub heard_age_ms: Option<i64>,
    /// 1 sigma of its clock; null while unknown.
    pub clock_sigma_ms: Option<f64>,
    /// Batches that arrived.
    pub n_batches: u64,
    /// Batches lost for good.
    pub n_lost: u64,
    /// In the last second.
    pub frames_s: Option<f64>,
    /// In the last second.
    pub candidates_s: Option<f64>,
}

/// The ball machine.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct MachineState {
    /// As it says: "ready", "jammed" …
    pub state: String,
    /// Since it was heard.
    pub heard_age_ms: i64,
    /// In force.
    pub settings: Settings,
    /// What it can be told.
    pub limits: Limits,
}

/// Bounds of settings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Limits {
    /// The least.
    pub min: Settings,
    /// The most.
    pub max: Settings,
}

/// How a drill stands.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct DrillState {
    /// Balls are being fired.
    pub running: bool,
    /// Which drill.
    pub name: Option<String>,
    /// What fusion learns is used.
    pub is_correcting: bool,
    /// Fired so far.
    pub ball: u32,
    /// Of so many; null: until stopped.
    pub balls: Option<u32>,
    /// Of the ball that is under way.
    pub target: Option<Target>,
    /// Why nothing is fired, or why it ended.
    pub said: Option<String>,
}

/// A camera has turned.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Watch {
    /// In words.
    pub sentence: String,
    /// Unix time.
    pub at_ms: i64,
}

/// Something that takes its time.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Job {
    /// 1, 2, 3 … since the page started.
    pub id: u64,
    /// "calibration", "recording" or "pairing".
    pub kind: String,
    /// "running", "done" or "failed".
    pub state: &'static str,
    /// 0 to 1.
    pub progress: f64,
    /// The last words of its tools.
    pub lines: Vec<String>,
    /// What came of it; of a calibration in centimetres.
    pub verdict: Option<String>,
    /// When it began, Unix time.
    pub at_ms: i64,
}

/// How the history is kept.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct HistoryState {
    /// Balls that could not be kept.
    pub n_lost: u64,
    /// Why not.
    pub error: Option<String>,
}

/// All at a glance.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Status {
    /// The court's name.
    pub court: String,
    /// Of the page.
    pub version: &'static str,
    /// Unix time here.
    pub now_ms: i64,
    /// "alive" or "silent".
    pub fusion: &'static str,
    /// Left, right.
    pub boards: [Board; 2],
    /// Null if none was heard.
    pub machine: Option<MachineState>,
    /// The drill.
    pub drill: DrillState,
    /// The one that goes on.
    pub session: Option<SessionRow>,
    /// What fusion last said of turned cameras.
    pub watch: Option<Watch>,
    /// What runs in the set-up, or ran last.
    pub setup: Option<Job>,
    /// What changes the machine asks for a token.
    pub needs_token: bool,
    /// Who watches.
    pub n_viewers: usize,
    /// Shots this page missed in shared memory.
    pub n_lost: u64,
    /// How balls are kept.
    pub history: HistoryState,
}

/// What is pushed to those who watch.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum Push {
    /// Once a second.
    Status {
        /// It.
        status: Box<Status>,
    },
    /// A shot was told.
    Ball {
        /// It.
        ball: Box<Ball>,
    },
    /// What fusion says of a ball came.
    Correction {
        /// The ball.
        id: i64,
        /// Again, with it.
        ball: Box<Ball>,
    },
    /// The drill changed.
    Drill {
        /// It.
        drill: DrillState,
    },
    /// A camera has turned.
    Watch {
        /// It.
        watch: Watch,
    },
    /// A job went on.
    Job {
        /// It.
        job: Job,
    },
}

//! Clips and where the ball is in them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A clip that can be labelled.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ClipRow {
    /// Its file.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// When it was written last, Unix time.
    pub at_ms: i64,
    /// Whether there is a file of labels beside it.
    pub is_labelled: bool,
}

/// All clips, the newest first.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ClipViews {
    /// They.
    pub clips: Vec<ClipRow>,
}

/// A clip.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ClipView {
    /// Its file.
    pub name: String,
    /// The file of its labels.
    pub labels_file: String,
    /// Of each frame.
    pub width_px: u32,
    /// Of each frame.
    pub height_px: u32,
    /// The first is 0.
    pub n_frames: usize,
    /// As its header says; null if it says nothing.
    pub frame_rate_hz: Option<f64>,
}

/// Where the ball is in a frame; (0, 0) is the centre of the top-left pixel.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct LabelView {
    /// The first is 0.
    pub frame_idx: usize,
    /// To the right.
    pub x_px: f64,
    /// Downwards.
    pub y_px: f64,
    /// Need not be found by a detector.
    pub is_hard: bool,
}

/// All labels of a clip, by frame.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct LabelViews {
    /// They.
    pub labels: Vec<LabelView>,
}

/// Where the ball is.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LabelBody {
    /// To the right.
    pub x_px: f64,
    /// Downwards.
    pub y_px: f64,
    /// Need not be found by a detector.
    pub is_hard: bool,
}

//! Cameras, recordings and what was done.

use serde::Serialize;
use utoipa::ToSchema;

/// What a camera sees, and how well.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct CameraView {
    /// "left" or "right".
    pub camera: &'static str,
    /// When the picture came, Unix time.
    pub at_ms: i64,
    /// Its width and height.
    pub image_px: [f64; 2],
    /// Bigger is sharper; compares pictures of one camera.
    pub sharpness: f64,
    /// Of all pixels.
    pub saturated_part: f64,
    /// Of all pixels.
    pub dark_part: f64,
    /// 0 to 255.
    pub median_level: f64,
    /// The court's lines as calibrated.
    #[schema(value_type = Vec<Vec<[f64; 2]>>)]
    pub lines_px: Vec<Vec<[f64; 2]>>,
    /// Candidates of the last second.
    pub candidates_px: Vec<SpotView>,
}

/// A candidate in a picture.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct SpotView {
    /// Where.
    pub at_px: [f64; 2],
    /// How wide.
    pub width_px: Option<f64>,
}

/// A recording.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Recording {
    /// Its file.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// When it was written last, Unix time.
    pub at_ms: i64,
}

/// All recordings, the newest first.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Recordings {
    /// They.
    pub recordings: Vec<Recording>,
}

/// What was done, in words.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Said {
    /// It.
    pub sentence: String,
}

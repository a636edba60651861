//! Candidates: the ball-like spots one worker found in its strip of one frame.

use crate::StampNs;
use iceoryx2::prelude::ZeroCopySend;

/// Most candidates of one frame, and so of one strip: the largest are kept, the rest are counted.
/// Twenty false spots and a ball are a bad day outdoors; 64 leaves room for three of them.
pub const MAX_CANDIDATES: usize = 64;

/// Most strips (worker processes) a frame is shared between.
pub const MAX_STRIPS: u32 = 8;

/// What a flag may say of the number of workers, for clap's range.
pub const N_STRIPS_RANGE: std::ops::RangeInclusive<i64> = 1..=MAX_STRIPS as i64;

/// One ball-like spot in raw pixels: distorted, as captured, (0,0) the centre of the top-left one.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("tennis/Candidate/1")]
pub struct Candidate {
    /// Centre, to the right.
    pub x_px: f32,
    /// Centre, downwards.
    pub y_px: f32,
    /// Width of the box around the spot.
    pub width_px: f32,
    /// Height of the box around the spot.
    pub height_px: f32,
    /// Number of pixels in the spot.
    pub area_px: f32,
}

/// What one worker says of one frame: the spots whose centre row lies in its strip. A frame is
/// complete when all `n_strips` messages with its `frame_idx` are there.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/StripCandidates/1")]
pub struct StripCandidates {
    /// As in [`crate::FrameInfo`].
    pub recording_id: u64,
    /// As in [`crate::FrameInfo`].
    pub frame_idx: u64,
    /// As in [`crate::FrameInfo`].
    pub exposed_ns: StampNs,
    /// As in [`crate::FrameInfo`].
    pub frame_published_ns: StampNs,
    /// When the worker began with the frame, CLOCK_MONOTONIC of the board.
    pub started_ns: StampNs,
    /// When the worker was done with it, CLOCK_MONOTONIC of the board.
    pub finished_ns: StampNs,
    /// Which strip, from the top.
    pub strip_idx: u32,
    /// How many strips the frame was shared between.
    pub n_strips: u32,
    /// Spots found beyond [`MAX_CANDIDATES`] and left out.
    pub n_dropped: u32,
    /// 1 while the background is still being learned (and so no spots are reported), else 0.
    pub is_learning: u32,
    /// How many entries of `candidates` count, largest area first.
    pub n_candidates: u32,
    /// [`crate::Camera::idx`] of the camera.
    pub camera_idx: u32,
    /// The spots.
    pub candidates: [Candidate; MAX_CANDIDATES],
}

const _: () = assert!(size_of::<StripCandidates>() == 72 + 20 * MAX_CANDIDATES);

impl StripCandidates {
    /// The entries that count. A count beyond the array (a foreign writer) is cut to it.
    #[must_use]
    pub fn spots(&self) -> &[Candidate] {
        let n = (self.n_candidates as usize).min(MAX_CANDIDATES);
        self.candidates.get(..n).unwrap_or_default()
    }
}

impl Default for StripCandidates {
    fn default() -> Self {
        Self {
            recording_id: 0,
            frame_idx: 0,
            exposed_ns: 0,
            frame_published_ns: 0,
            started_ns: 0,
            finished_ns: 0,
            strip_idx: 0,
            n_strips: 1,
            n_dropped: 0,
            is_learning: 0,
            n_candidates: 0,
            camera_idx: 0,
            candidates: [Candidate::default(); MAX_CANDIDATES],
        }
    }
}

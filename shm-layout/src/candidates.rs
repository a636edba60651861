//! Candidates: the ball-like spots one worker found in its strip of one frame.

use crate::StampNs;
use iceoryx2::prelude::ZeroCopySend;
use std::cmp::Ordering;

/// Most candidates of one frame, and so of one strip: the best are kept, the rest are counted.
/// Twenty false spots and a ball are a bad day outdoors; 64 leaves room for three of them.
pub const MAX_CANDIDATES: usize = 64;

/// Most strips (worker processes) a frame is shared between.
pub const MAX_STRIPS: u32 = 8;

/// What a flag may say of the number of workers, for clap's range.
pub const N_STRIPS_RANGE: std::ops::RangeInclusive<i64> = 1..=MAX_STRIPS as i64;

/// One ball-like spot in raw pixels: distorted, as captured, (0,0) the centre of the top-left one.
/// What a method does not observe is NaN.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("tennis/Candidate/2")]
pub struct Candidate {
    /// Centre at mid-exposure, to the right.
    pub x_px: f32,
    /// Centre at mid-exposure, downwards.
    pub y_px: f32,
    /// Variance of `x_px`.
    pub xx_px2: f32,
    /// Covariance of `x_px` and `y_px`.
    pub xy_px2: f32,
    /// Variance of `y_px`.
    pub yy_px2: f32,
    /// Width of the box around the spot.
    pub width_px: f32,
    /// Height of the box around the spot.
    pub height_px: f32,
    /// Number of pixels in the spot.
    pub area_px: f32,
    /// Diameter of the disc that fits best.
    pub diameter_px: f32,
    /// Grey levels brighter (or, negative, darker) than the background.
    pub contrast: f32,
    /// Motion during the exposure, to the right; the opposite is as likely.
    pub streak_x_px: f32,
    /// Motion during the exposure, downwards; the opposite is as likely.
    pub streak_y_px: f32,
    /// How far it stands out of the noise, in sigma.
    pub signal_to_noise: f32,
}

impl Candidate {
    /// A place, and nothing else known.
    #[must_use]
    pub fn at(x_px: f32, y_px: f32) -> Self {
        Self {
            x_px,
            y_px,
            xx_px2: f32::NAN,
            xy_px2: f32::NAN,
            yy_px2: f32::NAN,
            width_px: f32::NAN,
            height_px: f32::NAN,
            area_px: f32::NAN,
            diameter_px: f32::NAN,
            contrast: f32::NAN,
            streak_x_px: f32::NAN,
            streak_y_px: f32::NAN,
            signal_to_noise: f32::NAN,
        }
    }

    /// All fields, in their order.
    #[must_use]
    pub fn to_array(&self) -> [f32; 13] {
        [
            self.x_px,
            self.y_px,
            self.xx_px2,
            self.xy_px2,
            self.yy_px2,
            self.width_px,
            self.height_px,
            self.area_px,
            self.diameter_px,
            self.contrast,
            self.streak_x_px,
            self.streak_y_px,
            self.signal_to_noise,
        ]
    }

    /// The inverse of [`Self::to_array`].
    #[must_use]
    pub fn from_array(fields: [f32; 13]) -> Self {
        let [x_px, y_px, xx_px2, xy_px2, yy_px2, width_px, height_px, area_px, ..] = fields;
        let [.., diameter_px, contrast, streak_x_px, streak_y_px, signal_to_noise] = fields;
        Self {
            x_px,
            y_px,
            xx_px2,
            xy_px2,
            yy_px2,
            width_px,
            height_px,
            area_px,
            diameter_px,
            contrast,
            streak_x_px,
            streak_y_px,
            signal_to_noise,
        }
    }

    /// The better one first: by signal to noise, else area, else from the top left. When there are
    /// more than [`MAX_CANDIDATES`] the last are left out, and who leaves them out does not matter.
    #[must_use]
    pub fn by_worth(&self, other: &Self) -> Ordering {
        other
            .signal_to_noise
            .total_cmp(&self.signal_to_noise)
            .then(other.area_px.total_cmp(&self.area_px))
            .then(self.by_place(other))
    }

    /// The upper one first, then the left one.
    #[must_use]
    pub fn by_place(&self, other: &Self) -> Ordering {
        self.y_px.total_cmp(&other.y_px).then(self.x_px.total_cmp(&other.x_px))
    }
}

/// What one worker says of one frame: the spots whose centre row lies in its strip. A frame is
/// complete when all `n_strips` messages with its `frame_idx` are there.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/StripCandidates/3")]
pub struct StripCandidates {
    /// As in [`crate::FrameInfo`].
    pub recording_id: u64,
    /// As in [`crate::FrameInfo`].
    pub frame_idx: u64,
    /// As in [`crate::FrameInfo`].
    pub exposed_ns: StampNs,
    /// As in [`crate::FrameInfo`].
    pub frame_published_ns: StampNs,
    /// When the worker began with the frame.
    pub started_ns: StampNs,
    /// When the worker was done with it.
    pub finished_ns: StampNs,
    /// Which strip, from the top.
    pub strip_idx: u32,
    /// How many strips the frame was shared between.
    pub n_strips: u32,
    /// Spots found beyond [`MAX_CANDIDATES`] and left out.
    pub n_dropped: u32,
    /// 1 while the background is being learned or does not hold (and so no spots are reported): at
    /// the start, and after a bump of the camera; else 0.
    pub is_learning: u32,
    /// How many entries of `candidates` count, best first.
    pub n_candidates: u32,
    /// [`crate::Camera::idx`] of the camera.
    pub camera_idx: u32,
    /// As in [`crate::FrameInfo`].
    pub clock_sigma_ns: u32,
    /// Keeps the size a multiple of eight; always 0.
    pub reserved: u32,
    /// The spots.
    pub candidates: [Candidate; MAX_CANDIDATES],
}

const _: () = assert!(size_of::<StripCandidates>() == 80 + 52 * MAX_CANDIDATES);

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
            clock_sigma_ns: 0,
            reserved: 0,
            candidates: [Candidate::default(); MAX_CANDIDATES],
        }
    }
}

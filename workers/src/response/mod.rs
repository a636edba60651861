//! Frame → mask: where something the size of a ball stands out of the noise, and is new.
//!
//! A matched filter in place of a binary mask. With d = gI-μ of each pixel, g the gain of the light
//! ([`crate::grid`]) and sums over the 3x3 pixels around one:
//!
//! ```text
//!   D = Σd     kept ⇐ |D| > T n   and   sign(D) ΣΔ > ⅝ |D|    Δ: change since `look_back` frames
//! ```
//!
//! A mask asks each pixel alone whether it is foreground, and the thesis' test 5 then needs ten of
//! sixteen; a far ball covers nine, and half of them by half. The sum needs none to be certain.
//!
//! n is the mean of |D| itself, learned where it stands: noise that neighbours share (compression,
//! leaves that sway) raises it by itself, and a mean of sizes is not blown up by a passing ball as
//! a mean of squares is. T is given in σ (n = 0.80 σ). What still comes up again and again in a
//! block of [`BLOCK_PX`]² raises that block's T until it comes up in 0.3 % of frames: a bush in a
//! gust, a flag (constant false-alarm rate in time).
//!
//! Here is what is kept and what others may ask; `pass` is what a frame does to it. Everything
//! depends on a pixel, its neighbours and its block alone, so the number of strips changes nothing.
//!
//! Memory: 4 bytes of model, 5 of past frames and 9 of the first ones per pixel.

mod pass;

use crate::Settings;
use crate::disc::Picture;
use crate::dispatch::Simd;
use crate::grid::Grid;
use crate::kernels::{CHUNK_PX, GAIN_ONE, MARGIN_PX, level_q7};
use crate::strip::{BLOCK_PX, Strip};
use std::ops::Range;

/// A row is learned every so many frames.
const TURNS: u64 = 4;

/// σ of a Gaussian over the mean of its size: √(π/2).
const SIGMA_OF_MEAN_SIZE: f32 = 1.253_314;

/// Nothing fainter is a ball, grey levels: where noise is small, T is not what limits.
const CONTRAST_MIN: f32 = 7.0;

/// A block's T is 48 n at most, Q10.
const LIMIT_MAX_Q10: u16 = 48 << 10;

/// Frames that the first background is the median of: who walks through is not part of it.
const N_COLLECTED: usize = 9;

/// Least frames of learning: the nine, and a few to learn the noise.
const N_LEARNING_MIN: u64 = 12;

/// What a frame was good for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It was searched.
    Searched,
    /// It was learned from: the start of a recording, or after a bump of the camera.
    Learned,
    /// It showed something else altogether, and was left alone.
    Unknown,
}

/// The background of a strip and what stands out of it.
#[derive(Debug)]
pub struct Response {
    simd: Simd,
    strip: Strip,
    n_learning: u64,
    shift: u32,
    noise_min_q7: u16,
    limit_min_q10: u16,
    stride_px: usize,
    grid: Grid,
    mean: Vec<i16>,
    noise: Vec<u16>,
    /// T of each block, Q10.
    limits: Vec<u16>,
    /// The frames the first background is made of.
    collected: Vec<Vec<u8>>,
    past: Past,
    scratch: Scratch,
    /// What stands out: one bit per pixel of the tested rows, [`CHUNK_PX`] a word.
    stands_out: Vec<u64>,
    /// What of it is new.
    is_new: Vec<u64>,
    n_frames: u64,
    /// How many of them were collected before the background was.
    n_collecting: u64,
    n_changed: u32,
    n_relearned: u64,
}

/// The pixels of the last frames, in turn, with margins of zero all around.
#[derive(Debug)]
struct Past {
    luma: Vec<Vec<u8>>,
    gains_q15: Vec<Vec<u16>>,
    now: usize,
}

/// What is kept of the last three rows.
#[derive(Debug)]
struct Scratch {
    luma: Vec<u8>,
    differences: [Vec<i16>; 3],
    sums: Vec<i16>,
    limit: Vec<u16>,
    stands_out: Vec<u16>,
    sizes: Vec<u16>,
    block_hits: Vec<bool>,
}

impl Response {
    /// A background that has learned nothing, for spots of more than `threshold` σ.
    #[must_use]
    pub fn new(simd: Simd, strip: Strip, threshold: f32, settings: &Settings) -> Self {
        let (width_px, height_px) = (strip.width_px(), strip.height_px());
        let stride_px = (width_px as usize).next_multiple_of(CHUNK_PX);
        let n_learned = strip.learned().len();
        let n_px = n_learned * stride_px;
        let n_tested = strip.tested().len();
        let n_blocks = n_tested.div_ceil(BLOCK_PX as usize) * (stride_px / BLOCK_PX as usize);
        let limit_q10 = threshold * SIGMA_OF_MEAN_SIZE * 1024.0;
        let limit_min_q10 = (limit_q10.round() as u16).min(LIMIT_MAX_Q10);
        let noise_min = 9.0 * CONTRAST_MIN / (threshold * SIGMA_OF_MEAN_SIZE);
        let noise_min_q7 = (noise_min * 128.0).round().min(f32::from(u16::MAX)) as u16;
        let rate = settings.background.learning_rate * TURNS as f32;
        let margined = stride_px + 2 * MARGIN_PX;
        let n_slots = settings.look_back().max(1) + 1;
        Self {
            simd,
            strip,
            n_learning: u64::from(settings.background.n_learning).max(N_LEARNING_MIN),
            shift: (-rate.log2()).round().clamp(0.0, 8.0) as u32,
            noise_min_q7,
            limit_min_q10,
            stride_px,
            grid: Grid::new((width_px, height_px)),
            mean: vec![0; n_px],
            noise: vec![noise_min_q7; n_px],
            limits: vec![limit_min_q10; n_blocks],
            collected: vec![vec![0; n_px]; N_COLLECTED],
            past: Past {
                luma: vec![vec![0; (n_learned + 2) * margined]; n_slots],
                gains_q15: vec![vec![GAIN_ONE; height_px as usize + 2]; n_slots],
                now: 0,
            },
            scratch: Scratch {
                luma: vec![0; stride_px],
                differences: std::array::from_fn(|_| vec![0; stride_px]),
                sums: vec![0; margined],
                limit: vec![limit_min_q10; stride_px],
                stands_out: vec![0; stride_px / CHUNK_PX],
                sizes: vec![0; margined],
                block_hits: vec![false; stride_px / BLOCK_PX as usize],
            },
            stands_out: vec![0; n_tested * (stride_px / CHUNK_PX)],
            is_new: vec![0; n_tested * (stride_px / CHUNK_PX)],
            n_frames: 0,
            n_collecting: 0,
            n_changed: 0,
            n_relearned: 0,
        }
    }

    /// How often the background was learned anew.
    #[must_use]
    pub fn n_relearned(&self) -> u64 {
        self.n_relearned
    }

    /// What is new in a tested row: one bit per pixel, [`CHUNK_PX`] a word.
    #[must_use]
    pub fn mask_row(&self, y: u32) -> &[u64] {
        let n_words = self.stride_px / CHUNK_PX;
        let at = (y - self.strip.tested().start) as usize * n_words;
        &self.is_new[at..at + n_words]
    }

    /// How many pixels stand out in these columns and tested rows, new or not.
    #[must_use]
    pub fn n_standing_out(&self, columns: Range<u32>, rows: Range<u32>) -> u32 {
        let n_words = self.stride_px / CHUNK_PX;
        let (first, last) = (columns.start as usize / CHUNK_PX, columns.end as usize - 1);
        let (before, behind) = (columns.start as usize % CHUNK_PX, last % CHUNK_PX);
        let last = last / CHUNK_PX;
        let of_row = |y: u32| {
            let at = (y - self.strip.tested().start) as usize * n_words;
            let words = self.stands_out[at + first..=at + last].iter().enumerate();
            let cut = |(idx, word): (usize, &u64)| {
                let from = if idx == 0 { u64::MAX << before } else { u64::MAX };
                let to = if first + idx == last { u64::MAX >> (63 - behind) } else { u64::MAX };
                (word & from & to).count_ones()
            };
            words.map(cut).sum::<u32>()
        };
        rows.map(of_row).sum()
    }

    /// σ of the response around a pixel of the tested rows: of the sum of nine, grey levels.
    #[must_use]
    pub fn sigma(&self, x: u32, y: u32) -> f32 {
        let row = (y - self.strip.learned().start) as usize;
        f32::from(self.noise[row * self.stride_px + x as usize]) / 128.0 * SIGMA_OF_MEAN_SIZE
    }

    /// The rows that are searched.
    #[must_use]
    pub fn tested(&self) -> Range<u32> {
        self.strip.tested()
    }

    #[inline(always)]
    fn past_index(&self, learned_row: usize, x: usize) -> usize {
        (learned_row + 1) * (self.stride_px + 2 * MARGIN_PX) + MARGIN_PX + x
    }
}

impl Picture for Response {
    fn simd(&self) -> Simd {
        self.simd
    }

    fn known(&self) -> (Range<u32>, Range<u32>) {
        (0..self.strip.width_px(), self.strip.learned())
    }

    #[inline]
    fn row(&self, y: u32, columns: Range<u32>) -> impl Iterator<Item = (f32, f32)> {
        let row = (y - self.strip.learned().start) as usize;
        let slot = self.past.now;
        let gain_q15 = self.past.gains_q15[slot][y as usize + 1];
        let (first, n_px) = (columns.start as usize, columns.len());
        let luma = &self.past.luma[slot][self.past_index(row, first)..][..n_px];
        let mean = &self.mean[row * self.stride_px + first..][..n_px];
        luma.iter().zip(mean).map(move |(luma, mean)| {
            let difference = level_q7(*luma, gain_q15) - mean;
            (f32::from(difference) / 128.0, f32::from(*mean) / 128.0)
        })
    }

    fn likeness(&self) -> f32 {
        self.grid.likeness()
    }
}

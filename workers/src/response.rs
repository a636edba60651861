//! Frame → mask: where something the size of a ball stands out of the noise, and is new.
//!
//! A matched filter in place of a binary mask. With d = gI-μ of each pixel, g the gain of the light
//! ([`crate::grid`]) and sums over the 3x3 pixels around one:
//!
//! ```text
//!   D = Σd     kept ⇐ |D| > T n   and   sign(D) ΣΔ > (T/√2) n     Δ: change since `look_back` frames
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
//! One pass over the rows, while three of them are in the first-level cache. A row is learned every
//! fourth frame with four times the weight; nothing else is done twice. Everything here depends on
//! a pixel, its neighbours and its block alone, so the number of strips changes nothing.
//!
//! Cost: 6 bytes read and 1 written per pixel, 2 read and 4 written more on every fourth row.

use crate::Settings;
use crate::dispatch::{Simd, Task};
use crate::grid::{Grid, View, toward_one};
use crate::kernels::{
    CHUNK_PX, Columns, GAIN_ONE, Gate, Learning, MARGIN_PX, Responses, level_q7, masks_of_chunk,
    median_of_nine, respond, sum_columns,
};
use crate::strip::{BLOCK_PX, Strip};
use std::ops::Range;

/// A row is learned every so many frames.
const TURNS: u64 = 4;

/// What a difference counts for at most: 32 grey levels. A ball that flies by moves the mean by half
/// a grey level; one that stays is background in 5 to 10 s.
const STEP_MAX_Q7: i16 = 32 << 7;

/// σ of a Gaussian over the mean of its size: √(π/2).
const SIGMA_OF_MEAN_SIZE: f32 = 1.253_314;

/// Nothing fainter is a ball, grey levels: where noise is small, T is not what limits.
const CONTRAST_MIN: f32 = 7.0;

/// A block's T rises by so much (Q10, in units of n) in a frame that finds something there …
const LIMIT_STEP_Q10: u16 = 40;
/// … sinks by one in every eighth frame …
const LIMIT_DECAY_TURNS: u64 = 8;
/// … and rises to 48 n at most.
const LIMIT_MAX_Q10: u16 = 48 << 10;

/// Frames that the first background is the median of: who walks through is not part of it.
const N_COLLECTED: usize = 9;

/// What a median of nine knows, in frames: it is as good as the mean of six.
const MEDIAN_WORTH: u64 = 6;

/// Least frames of learning: the nine, and a few to learn the noise.
const N_LEARNING_MIN: u64 = 12;

/// So many frames in a row that show something else altogether: the camera has been moved.
const N_CHANGED_MAX: u32 = 8;

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
    pub fn new(strip: Strip, threshold: f32, settings: &Settings) -> Self {
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
        let n_slots = settings.look_back.max(1) + 1;
        Self {
            simd: Simd::best(),
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

    /// The same with these instructions.
    #[must_use]
    pub fn with(self, simd: Simd) -> Self {
        Self { simd, ..self }
    }

    /// The instructions used.
    #[must_use]
    pub fn simd(&self) -> Simd {
        self.simd
    }

    /// How often the background was learned anew.
    #[must_use]
    pub fn n_relearned(&self) -> u64 {
        self.n_relearned
    }

    /// Searches or learns a whole frame; the rows of the mask are then up to date.
    pub fn update(&mut self, luma: &[u8]) -> Outcome {
        let mut outcome = Outcome::Unknown;
        let simd = self.simd;
        simd.run(Pass { response: self, luma, outcome: &mut outcome });
        outcome
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

    /// How much a pixel of the learned rows differs from its background, and that, grey levels.
    #[must_use]
    #[inline]
    pub fn pixel(&self, x: u32, y: u32) -> (f32, f32) {
        let row = (y - self.strip.learned().start) as usize;
        let slot = self.past.now;
        let luma = self.past.luma[slot][self.past_index(row, x as usize)];
        let level = level_q7(luma, self.past.gains_q15[slot][y as usize + 1]);
        let mean = self.mean[row * self.stride_px + x as usize];
        (f32::from(level - mean) / 128.0, f32::from(mean) / 128.0)
    }

    /// How much a pixel of the learned rows differs from its background, grey levels.
    #[must_use]
    #[inline]
    pub fn difference(&self, x: u32, y: u32) -> f32 {
        self.pixel(x, y).0
    }

    /// σ of the response around a pixel of the tested rows: of the sum of nine, grey levels.
    #[must_use]
    pub fn sigma(&self, x: u32, y: u32) -> f32 {
        let row = (y - self.strip.learned().start) as usize;
        f32::from(self.noise[row * self.stride_px + x as usize]) / 128.0 * SIGMA_OF_MEAN_SIZE
    }

    /// How much larger σ² of the response is than nine σ² of a pixel.
    #[must_use]
    pub fn likeness(&self) -> f32 {
        self.grid.likeness()
    }

    /// The rows that are searched.
    #[must_use]
    pub fn tested(&self) -> Range<u32> {
        self.strip.tested()
    }

    /// The columns and rows whose pixels are known.
    #[must_use]
    pub fn known(&self) -> (Range<u32>, Range<u32>) {
        (0..self.strip.width_px(), self.strip.learned())
    }

    #[inline(always)]
    fn past_index(&self, learned_row: usize, x: usize) -> usize {
        (learned_row + 1) * (self.stride_px + 2 * MARGIN_PX) + MARGIN_PX + x
    }
}

/// One frame: see [`Response::update`].
struct Pass<'a> {
    response: &'a mut Response,
    luma: &'a [u8],
    outcome: &'a mut Outcome,
}

impl Task for Pass<'_> {
    #[inline(always)]
    fn run(self) {
        *self.outcome = self.response.pass(self.luma);
    }
}

impl Response {
    #[inline(always)]
    fn pass(&mut self, luma: &[u8]) -> Outcome {
        if self.n_frames > 0 && self.grid.look(luma) == View::Changed {
            if self.n_frames < self.n_learning {
                self.forget(); // what was learned so far is not what is seen now
            } else {
                self.n_changed += 1;
                if self.n_changed < N_CHANGED_MAX {
                    return Outcome::Unknown;
                }
                self.n_relearned += 1;
                self.forget();
            }
        }
        self.n_changed = 0;
        self.n_frames += 1;
        let is_learning = self.n_frames <= self.n_learning;
        self.learn_light(luma, is_learning);
        // The first two thirds of learning are collected, the last third refines their median.
        let spacing = (self.n_learning * 2 / 3 / N_COLLECTED as u64).max(1);
        let (slot, rest) = ((self.n_frames - 1) / spacing, (self.n_frames - 1) % spacing);
        if slot < N_COLLECTED as u64 {
            if rest == 0 {
                self.collect(luma, slot as usize);
            }
            self.n_collecting = self.n_frames;
            return Outcome::Learned;
        }
        self.search(luma, is_learning);
        if is_learning { Outcome::Learned } else { Outcome::Searched }
    }

    /// Keeps a frame; of the last one and those before makes the first background.
    #[inline(always)]
    fn collect(&mut self, luma: &[u8], slot: usize) {
        let (width_px, stride_px) = (self.strip.width_px() as usize, self.stride_px);
        let kept = self.collected[slot].chunks_exact_mut(stride_px);
        for (y, kept) in self.strip.learned().zip(kept) {
            kept[..width_px].copy_from_slice(&luma[y as usize * width_px..][..width_px]);
        }
        if slot + 1 == N_COLLECTED {
            for (row, mean) in self.mean.chunks_exact_mut(stride_px).enumerate() {
                let row = row * stride_px..(row + 1) * stride_px;
                let nine = std::array::from_fn(|k| &self.collected[k][row.clone()]);
                median_of_nine(nine, mean);
            }
        }
    }

    fn forget(&mut self) {
        self.n_frames = 0;
        self.noise.fill(self.noise_min_q7);
        self.limits.fill(self.limit_min_q10);
        self.grid.forget();
    }

    #[inline(always)]
    fn learn_light(&mut self, luma: &[u8], is_learning: bool) {
        // The grid learns every frame what the others learn every fourth.
        let shift = if is_learning { self.n_frames.ilog2() } else { self.shift + 2 };
        let dither = (self.n_frames % (1 << shift)) as u16;
        self.grid.learn(luma, shift, dither);
    }

    /// How the rows of this frame are learned: all alike at first, later a fourth of them.
    #[inline(always)]
    fn learning(&self, y: u32, is_learning: bool) -> Option<Learning> {
        let (shift, turn) = if is_learning {
            let n = self.n_frames - self.n_collecting + MEDIAN_WORTH;
            (n.ilog2(), n)
        } else {
            let turn = self.n_frames + u64::from(y);
            if !turn.is_multiple_of(TURNS) {
                return None;
            }
            (self.shift, turn / TURNS)
        };
        let gain_q15 = self.grid.gains_q15()[y as usize];
        Some(Learning {
            shift,
            dither: (turn % (1 << shift)) as u16,
            step_max_q7: STEP_MAX_Q7,
            gain_q15: if is_learning { gain_q15 } else { toward_one(gain_q15) },
            noise_min_q7: self.noise_min_q7,
        })
    }

    #[inline(always)]
    fn search(&mut self, luma: &[u8], is_learning: bool) {
        self.past.now = (self.past.now + 1) % self.past.luma.len();
        let now = self.past.now;
        self.past.gains_q15[now][1..][..self.grid.gains_q15().len()]
            .copy_from_slice(self.grid.gains_q15());
        self.stands_out.fill(0);
        self.is_new.fill(0);
        self.scratch.differences.iter_mut().for_each(|row| row.fill(0));
        self.scratch.block_hits.fill(false);
        let (learned, tested) = (self.strip.learned(), self.strip.tested());
        for y in learned.start..=learned.end {
            if y < learned.end {
                self.columns(luma, y, is_learning);
            } else {
                self.end_columns(y);
            }
            let Some(above) = y.checked_sub(1).filter(|above| tested.contains(above)) else {
                continue;
            };
            self.test_row(above, is_learning);
        }
    }

    /// Differences of row y, and the sums around row y-1.
    #[inline(always)]
    fn columns(&mut self, luma: &[u8], y: u32, is_learning: bool) {
        let (width_px, stride_px) = (self.strip.width_px() as usize, self.stride_px);
        let row = (y - self.strip.learned().start) as usize;
        let mut pixels = &luma[y as usize * width_px..][..width_px];
        if width_px != stride_px {
            self.scratch.luma[..width_px].copy_from_slice(pixels);
            pixels = &self.scratch.luma;
        }
        let gain_q15 = self.grid.gains_q15()[y as usize];
        let learning = self.learning(y, is_learning);
        let kept_at = self.past_index(row, 0);
        let [first, second, third] = &mut self.scratch.differences;
        let (difference, above) = match row % 3 {
            0 => (first, [&second[..], &third[..]]),
            1 => (second, [&first[..], &third[..]]),
            _ => (third, [&first[..], &second[..]]),
        };
        let columns = Columns {
            luma: pixels,
            mean: &mut self.mean[row * stride_px..][..stride_px],
            above,
            difference,
            sums: &mut self.scratch.sums[MARGIN_PX..][..stride_px],
            kept: &mut self.past.luma[self.past.now][kept_at..][..stride_px],
        };
        match learning {
            Some(learning) => sum_columns::<true>(columns, gain_q15, &learning),
            None => sum_columns::<false>(columns, gain_q15, &NOTHING),
        }
    }

    /// Below the last row there is nothing.
    #[inline(always)]
    fn end_columns(&mut self, y: u32) {
        let row = (y - self.strip.learned().start) as usize;
        let [first, second, third] = &self.scratch.differences;
        let (above, before) = match row % 3 {
            0 => (third, second),
            1 => (first, third),
            _ => (second, first),
        };
        let sums = &mut self.scratch.sums[MARGIN_PX..][..self.stride_px];
        for ((sum, above), before) in sums.iter_mut().zip(above).zip(before) {
            *sum = above + before;
        }
    }

    /// Tests row y, whose sums are there, and notes which blocks hold something.
    #[inline(always)]
    fn test_row(&mut self, y: u32, is_learning: bool) {
        let in_tested = y - self.strip.tested().start;
        let in_learned = (y - self.strip.learned().start) as usize;
        let blocks = self.stride_px / BLOCK_PX as usize;
        let first_block = (in_tested / BLOCK_PX) as usize * blocks;
        if in_tested.is_multiple_of(BLOCK_PX) {
            let limits = &self.limits[first_block..first_block + blocks];
            let pixels = self.scratch.limit.chunks_exact_mut(BLOCK_PX as usize);
            pixels.zip(limits).for_each(|(pixels, limit)| pixels.fill(*limit));
        }
        let learning = self.learning(y, is_learning);
        let rows = Responses {
            sums: &self.scratch.sums,
            noise: &mut self.noise[in_learned * self.stride_px..][..self.stride_px],
            limit: &self.scratch.limit,
            stands_out: &mut self.scratch.stands_out,
            sizes: &mut self.scratch.sizes,
        };
        match learning {
            Some(learning) => respond::<true>(rows, &learning),
            None => respond::<false>(rows, &NOTHING),
        }
        if !is_learning {
            self.gate_row(y);
            let is_last =
                (in_tested + 1).is_multiple_of(BLOCK_PX) || y + 1 == self.strip.tested().end;
            if is_last {
                self.adapt_limits(first_block..first_block + blocks);
            }
        }
    }

    /// Keeps what is new of what stands out in row y.
    #[inline(always)]
    fn gate_row(&mut self, y: u32) {
        let n_chunks = self.stride_px / CHUNK_PX;
        let at = (y - self.strip.tested().start) as usize * n_chunks;
        for chunk in 0..n_chunks {
            if self.scratch.stands_out[chunk] != 0 {
                let (stands_out, mut word) = self.gated(y, chunk);
                self.stands_out[at + chunk] = stands_out;
                self.is_new[at + chunk] = word;
                for block in 0..CHUNK_PX / BLOCK_PX as usize {
                    let is_hit = word & ((1 << BLOCK_PX) - 1) != 0;
                    self.scratch.block_hits[chunk * CHUNK_PX / BLOCK_PX as usize + block] |= is_hit;
                    word >>= BLOCK_PX;
                }
            }
        }
    }

    #[inline(always)]
    fn gated(&self, y: u32, chunk: usize) -> (u64, u64) {
        let row = (y - self.strip.learned().start) as usize;
        let x = chunk * CHUNK_PX;
        let model = row * self.stride_px + x;
        let (now, then) = (self.past.now, (self.past.now + 1) % self.past.luma.len());
        let pixels = |slot: usize| {
            std::array::from_fn(|k| {
                // Rows and columns have a margin of zeros, so row-1 and x-1 are there.
                let at = self.past_index(row, x) + k * (self.stride_px + 2 * MARGIN_PX)
                    - (self.stride_px + 2 * MARGIN_PX)
                    - 1;
                first_chunk(&self.past.luma[slot][at..])
            })
        };
        let gains =
            |slot: usize| std::array::from_fn(|k| self.past.gains_q15[slot][y as usize + k]);
        masks_of_chunk(&Gate {
            sums: first_chunk(&self.scratch.sums[MARGIN_PX + x - 1..]),
            noise: first_chunk(&self.noise[model..]),
            limit: first_chunk(&self.scratch.limit[x..]),
            now: pixels(now),
            before: pixels(then),
            gain_now: gains(now),
            gain_before: gains(then),
        })
    }

    #[inline(always)]
    fn adapt_limits(&mut self, blocks: Range<usize>) {
        let least = self.limit_min_q10;
        let decay = u16::from(self.n_frames.is_multiple_of(LIMIT_DECAY_TURNS));
        for (limit, is_hit) in self.limits[blocks].iter_mut().zip(&mut self.scratch.block_hits) {
            let rise = if std::mem::take(is_hit) { LIMIT_STEP_Q10 } else { 0 };
            *limit = (*limit - decay + rise).clamp(least, LIMIT_MAX_Q10);
        }
    }
}

/// For rows that are not learned.
const NOTHING: Learning =
    Learning { shift: 0, dither: 0, step_max_q7: 0, gain_q15: GAIN_ONE, noise_min_q7: 0 };

#[inline(always)]
fn first_chunk<T, const N: usize>(from: &[T]) -> &[T; N] {
    from.first_chunk().expect("rows are whole chunks with margins")
}

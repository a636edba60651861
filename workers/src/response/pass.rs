//! What one frame does to the background and the masks: one pass over its rows, while three of them
//! are in the first-level cache.
//!
//! While learning, nine frames are collected, their median is the first background, and the rest
//! refine it and measure the noise. After that a row is learned every fourth frame with four times
//! the weight; nothing else is done twice.
//!
//! Cost: 6 bytes read and 1 written per pixel, 2 read and 4 written more on every fourth row.

use super::{LIMIT_MAX_Q10, N_COLLECTED, Outcome, Response, TURNS};
use crate::dispatch::Task;
use crate::grid::{View, toward_one};
use crate::kernels::{
    CHUNK_PX, Columns, GAIN_ONE, Gate, Learning, MARGIN_PX, Responses, masks_of_chunk,
    median_of_nine, respond, sum_columns,
};
use crate::strip::BLOCK_PX;
use std::ops::Range;

/// What a difference counts for at most: 32 grey levels. A ball that flies by moves the mean by
/// half a grey level; one that stays is background in 5 to 10 s.
const STEP_MAX_Q7: i16 = 32 << 7;

/// A block's T rises by so much (Q10, in units of n) in a frame that finds something there, and
const LIMIT_STEP_Q10: u16 = 40;
/// sinks by one in every eighth frame.
const LIMIT_DECAY_TURNS: u64 = 8;

/// What a median of nine knows, in frames: it is as good as the mean of six.
const MEDIAN_WORTH: u64 = 6;

/// So many frames in a row that show something else altogether: the camera has been moved.
const N_CHANGED_MAX: u32 = 8;

impl Response {
    /// Searches or learns a whole frame; the rows of the mask are then up to date.
    pub fn update(&mut self, luma: &[u8]) -> Outcome {
        let mut outcome = Outcome::Unknown;
        let simd = self.simd;
        simd.run(Pass { response: self, luma, outcome: &mut outcome });
        outcome
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
        if is_learning {
            self.grid.learn(luma, self.n_frames.ilog2(), (self.n_frames, 1));
        } else {
            self.grid.learn(luma, self.shift, (self.n_frames, TURNS as usize));
        }
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
        self.scratch.differences[row % 3].fill(0);
        let [first, second, third] = &self.scratch.differences;
        let sums = &mut self.scratch.sums[MARGIN_PX..][..self.stride_px];
        for (((sum, a), b), c) in sums.iter_mut().zip(first).zip(second).zip(third) {
            *sum = a + b + c;
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

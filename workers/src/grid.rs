//! Frame → light: how bright each row is against its background, and whether that still holds.
//!
//! A cloud, an exposure that adjusts itself and a flickering lamp change all pixels of a row by one
//! factor. It is estimated on every 32nd row of the *whole* frame by every worker, on
//! a background of its own, so that the answer does not depend on how many share a frame:
//!
//! ```text
//!   g₀ = median over rows of ΣI/Σμ         if the light jumped, else the last g
//!   g ← g (1 + Σ clip(I/g-μ, ±8) / Σμ)     (twice then); what moves through the row counts little
//! ```
//!
//! smoothed over five grid rows and interpolated between them. When pixels differ all over the
//! frame although the light is accounted for, the camera was bumped or covered: then nothing that
//! was learned holds.
//!
//! Cost: a thirtieth of the pixels, three times; a fourth of those is learned.

use crate::kernels::{GAIN_ONE, drawn_towards, level_q7};

/// Every so many rows one is looked at.
const GRID_STEP_PX: usize = 32;

/// A row is judged in so many parts.
const N_SECTORS: usize = 4;

/// A difference counts for at most so much, Q7: 8 grey levels.
const CLIP_Q7: i16 = 8 << 7;

/// The last gain is no start for the next when all rows together have moved by more than this.
const JUMP: f64 = 0.02;

/// A pixel is not explained when it differs by so many grey levels and so many times its noise.
const UNEXPLAINED_Q7: u16 = 10 << 7;
const UNEXPLAINED_NOISES: u16 = 4;

/// A part of a row is not explained when a sixteenth of its pixels are not, and a frame when three
/// fifths of all parts are not: a person who fills a third of the picture does not do that.
const SECTOR_SHARE: usize = 16;
const FRAME_SHARE: (usize, usize) = (3, 5);

/// Gains beyond are no light but a covered lens, a torch, or no picture at all, Q15.
const GAIN_RANGE_Q15: std::ops::RangeInclusive<f64> = 16384.0..=65535.0;

/// What the frame shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// The background, under some light.
    Known,
    /// Something else all over.
    Changed,
}

/// Sums over a grid row's background.
#[derive(Debug, Clone, Copy, Default)]
struct Totals {
    mean_q7: i32,
    of_one: u32,
    of_three: u32,
}

/// Background and light of the grid rows.
#[derive(Debug)]
pub struct Grid {
    width_px: usize,
    height_px: usize,
    /// Grid row k begins at k times the width.
    mean: Vec<i16>,
    noise: Vec<u16>,
    /// The same for sums of three neighbours in a row.
    noise_of_three: Vec<u16>,
    totals: Vec<Totals>,
    /// How much larger the variance of a sum of nine is than nine variances.
    likeness: f32,
    /// What a pixel of each grid row is multiplied by, Q15, before smoothing.
    rows_q15: Vec<f64>,
    /// Scratch: of one row.
    differences: Vec<i16>,
    /// Scratch: ratio of each grid row to its background.
    ratios: Vec<f64>,
    /// What a pixel of each row of the frame is multiplied by, Q15.
    gains_q15: Vec<u16>,
}

impl Grid {
    /// A grid that has learned nothing.
    #[must_use]
    pub fn new((width_px, height_px): (u32, u32)) -> Self {
        let (width_px, height_px) = (width_px as usize, height_px as usize);
        let n_rows = (height_px / GRID_STEP_PX).max(1);
        Self {
            width_px,
            height_px,
            mean: vec![0; n_rows * width_px],
            noise: vec![0; n_rows * width_px],
            noise_of_three: vec![0; n_rows * width_px],
            totals: vec![Totals::default(); n_rows],
            likeness: 1.0,
            rows_q15: vec![f64::from(GAIN_ONE); n_rows],
            differences: vec![0; width_px],
            ratios: Vec::with_capacity(n_rows),
            gains_q15: vec![GAIN_ONE; height_px],
        }
    }

    /// What a pixel of each row is multiplied by to look as in the background's light, Q15.
    #[must_use]
    pub fn gains_q15(&self) -> &[u16] {
        &self.gains_q15
    }

    /// How alike the noise of neighbours is: the variance of a sum of nine over nine variances, 1
    /// for white noise, more where a video was compressed or leaves sway.
    #[must_use]
    pub fn likeness(&self) -> f32 {
        self.likeness
    }

    /// Forgets everything; the next frame is the background.
    pub fn forget(&mut self) {
        self.rows_q15.fill(f64::from(GAIN_ONE));
        self.gains_q15.fill(GAIN_ONE);
    }

    /// Estimates the light of a whole frame, and says whether the frame is what was learned.
    #[inline(always)]
    pub fn look(&mut self, luma: &[u8]) -> View {
        self.estimate_light(luma);
        let is_possible = |gain: &f64| GAIN_RANGE_Q15.contains(gain);
        if !self.rows_q15.iter().all(is_possible) {
            self.rows_q15.fill(f64::from(GAIN_ONE));
            return View::Changed;
        }
        self.interpolate();
        let n_changed = self.n_sectors_changed(luma);
        let n_sectors = self.rows_q15.len() * N_SECTORS;
        if n_changed * FRAME_SHARE.1 > n_sectors * FRAME_SHARE.0 {
            View::Changed
        } else {
            View::Known
        }
    }

    /// Learns every `n_turns`th of the grid's rows, with weight 2^-shift; which ones, `turn` says.
    #[inline(always)]
    pub fn learn(&mut self, luma: &[u8], shift: u32, (turn, n_turns): (u64, usize)) {
        let dither = (turn / n_turns as u64 % (1 << shift)) as u16;
        let first = (turn % n_turns as u64) as usize;
        for k in (first..self.rows_q15.len()).step_by(n_turns) {
            let y = row_of_grid(k, self.height_px);
            let gain_q15 = toward_one(self.gains_q15[y]);
            let row = &luma[y * self.width_px..][..self.width_px];
            let model = k * self.width_px..(k + 1) * self.width_px;
            let pixels = row.iter().zip(&mut self.mean[model.clone()]);
            let noise = self.noise[model.clone()].iter_mut();
            let mut totals = Totals::default();
            for (((&luma, mean), noise), seen) in pixels.zip(noise).zip(&mut self.differences) {
                let difference = level_q7(luma, gain_q15) - *mean;
                *mean += difference.saturating_add(dither as i16) >> shift;
                *noise = drawn_towards(*noise, difference.unsigned_abs(), shift, dither);
                totals.mean_q7 += i32::from(*mean);
                totals.of_one += u32::from(*noise);
                *seen = difference >> 2; // so that three fit
            }
            let threes = self.noise_of_three[model].iter_mut();
            for (noise, three) in threes.zip(self.differences.windows(3)) {
                let size = (three[0] + three[1] + three[2]).unsigned_abs();
                *noise = drawn_towards(*noise, size, shift, dither);
                totals.of_three += u32::from(*noise);
            }
            self.totals[k] = totals;
        }
        let sum = |of: fn(&Totals) -> u32| self.totals.iter().map(of).sum::<u32>() as f32;
        // Alike along a row as across rows: the variance of three over three variances, squared.
        let ratio = 4.0 * sum(|t| t.of_three) / sum(|t| t.of_one).max(1.0);
        self.likeness = (ratio * ratio / 3.0).powi(2).clamp(1.0, 9.0);
    }

    #[inline(always)]
    fn estimate_light(&mut self, luma: &[u8]) {
        let (width_px, height_px) = (self.width_px, self.height_px);
        let rows = |k: usize| {
            let y = row_of_grid(k, height_px);
            (&luma[y * width_px..][..width_px], k * width_px..(k + 1) * width_px)
        };
        self.ratios.clear();
        for (k, gain) in self.rows_q15.iter().enumerate() {
            let (row, _) = rows(k);
            let sum_q7 = 128 * row.iter().map(|&luma| u32::from(luma)).sum::<u32>();
            let mean_q7 = f64::from(self.totals[k].mean_q7) * f64::from(GAIN_ONE);
            self.ratios.push(mean_q7 / f64::from(sum_q7).max(1.0) / gain);
        }
        self.ratios.sort_by(f64::total_cmp);
        let jump = self.ratios[self.ratios.len() / 2];
        let (start, n_rounds) = if (jump - 1.0).abs() > JUMP { (jump, 2) } else { (1.0, 1) };
        for k in 0..self.rows_q15.len() {
            let (row, model) = rows(k);
            let mut gain = self.rows_q15[k] * start;
            for _ in 0..n_rounds {
                if !GAIN_RANGE_Q15.contains(&gain) {
                    break;
                }
                let excess_q7 = excess(row, &self.mean[model.clone()], gain.round() as u16);
                gain *= 1.0 - f64::from(excess_q7) / f64::from(self.totals[k].mean_q7.max(1));
            }
            self.rows_q15[k] = gain;
        }
    }

    /// From the grid's rows to all rows: smoothed, then along straight lines.
    #[inline(always)]
    fn interpolate(&mut self) {
        const WEIGHTS: [f64; 5] = [1.0, 2.0, 3.0, 2.0, 1.0];
        let n = self.rows_q15.len();
        let smooth = |k: usize| {
            let near = WEIGHTS.iter().enumerate().map(|(idx, weight)| {
                weight * self.rows_q15[(k + idx).saturating_sub(2).min(n - 1)]
            });
            near.sum::<f64>() / WEIGHTS.iter().sum::<f64>()
        };
        let mut k = 0;
        let (mut from, mut to) = (smooth(0), smooth(1.min(n - 1)));
        for (y, gain) in self.gains_q15.iter_mut().enumerate() {
            if k + 2 < n && y > row_of_grid(k + 1, self.height_px) {
                k += 1;
                (from, to) = (to, smooth(k + 1));
            }
            let first = row_of_grid(k, self.height_px);
            let part = (y as f64 - first as f64) / GRID_STEP_PX as f64;
            *gain = (from + (to - from) * part.clamp(0.0, 1.0)).round() as u16;
        }
    }

    #[inline(always)]
    fn n_sectors_changed(&self, luma: &[u8]) -> usize {
        let mut n_changed = 0;
        for k in 0..self.rows_q15.len() {
            let y = row_of_grid(k, self.height_px);
            let gain_q15 = self.gains_q15[y];
            for sector in 0..N_SECTORS {
                let edge = |idx: usize| self.width_px * idx / N_SECTORS;
                let columns = edge(sector)..edge(sector + 1);
                let row = &luma[y * self.width_px..][columns.clone()];
                let model = k * self.width_px + columns.start..k * self.width_px + columns.end;
                let pixels = row.iter().zip(&self.mean[model.clone()]).zip(&self.noise[model]);
                let n = pixels.map(|((&luma, mean), noise)| {
                    let size = (level_q7(luma, gain_q15) - mean).unsigned_abs();
                    let explained = noise.saturating_mul(UNEXPLAINED_NOISES);
                    u16::from(size > explained.saturating_add(UNEXPLAINED_Q7))
                });
                n_changed +=
                    usize::from(usize::from(n.sum::<u16>()) * SECTOR_SHARE > columns.len());
            }
        }
        n_changed
    }
}

/// What is learned is a sixteenth nearer to the frame's own light, so that a light that stays
/// becomes the background's (in some 45 s) and its scale cannot drift away over hours.
#[must_use]
pub fn toward_one(gain_q15: u16) -> u16 {
    (i32::from(gain_q15) + (i32::from(GAIN_ONE) - i32::from(gain_q15)) / 16) as u16
}

fn row_of_grid(k: usize, height_px: usize) -> usize {
    (k * GRID_STEP_PX + GRID_STEP_PX / 2).min(height_px - 1)
}

/// Sum of clipped differences, Q7.
#[inline(always)]
fn excess(row: &[u8], mean: &[i16], gain_q15: u16) -> i32 {
    let differences = row.iter().zip(mean).map(|(&luma, &mean)| level_q7(luma, gain_q15) - mean);
    differences.map(|q7| i32::from(q7.clamp(-CLIP_Q7, CLIP_Q7))).sum()
}

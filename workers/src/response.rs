//! Frame → response: where a spot the size of a ball stands out of the noise, and is new.
//!
//! A matched filter in place of a binary mask. With d = I-μ and σ² of each pixel (`foreground`),
//! and c = I-I′ the change since `look_back` frames ago, sums over the 3x3 pixels around one:
//!
//! ```text
//!   kept ⇐ |Σd| > T √Σσ²   and   sign(Σd) Σc > (T / √2) √Σσ²
//! ```
//!
//! A mask asks each pixel alone whether it is foreground, and test 5 then needs ten of sixteen; a
//! far ball covers nine, and half of them by half. The sum needs none of them to be certain. The
//! second condition keeps what has been there for a while (a person, a shadow that moved in) out,
//! without cutting the ball: the centre comes from d over all pixels of the spot that stand out by
//! two σ with its sign, never from the mask. And a ball is alone: where the ring around a spot
//! stands out too, it is part of something that moves.
//!
//! Cost: three f32 images written and read in rows of three; about 1.2 ms for 640x480.

use crate::Settings;
use crate::blobs::Blob;
use crate::foreground::{Background, learned};
use crate::strip::Strip;
use std::ops::Range;

/// Half a side of the box that is summed over.
const REACH_PX: usize = 1;

/// A pixel of a spot stands out by so many σ.
const SPOT_SIGMA: f32 = 2.0;

/// A pixel counts for at most this part of the brightest one, so that the sunlit side does not pull
/// the centre. 0.5, 0.25 and 0.12 leave 0.58, 0.42 and 0.36 px RMS on the thesis' shot (near balls)
/// and 0.34, 0.32 and 0.33 on others; bounces of 40 shots are 13, 10 and 8 mm off in the mean.
const WEIGHT_CLIP: f32 = 0.12;

/// A ball is alone: of the ring this wide around it, at most this share stands out too.
const RING_PX: u32 = 3;
const RING_SHARE_MAX: f32 = 0.15;

// Else a strip would not know the ring of a blob at the edge of its halo, and the answer would
// depend on the number of workers.
const _: () = assert!(RING_PX < crate::method::REACH_PX);

/// The background of a strip, and what the last frame differed from it.
#[derive(Debug)]
pub struct Response {
    background: Background,
    threshold: f32,
    strip: Strip,
    mean: Vec<f32>,
    variance: Vec<f32>,
    /// Luma of the last `look_back` frames, in turn.
    past: Vec<Vec<u8>>,
    difference: Vec<f32>,
    noise2: Vec<f32>,
    change: Vec<f32>,
    row: RowSums,
    is_kept: Vec<u8>,
    n_frames: u64,
}

/// A blob's own pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Centre, weighted by how far each pixel stands out.
    pub center_px: [f32; 2],
    /// Width and height of the box around the pixels.
    pub size_px: [u32; 2],
    /// How many there are.
    pub n_px: u32,
}

/// Columns and rows of the whole frame.
#[derive(Debug, Clone, PartialEq)]
struct Pixels {
    columns: Range<u32>,
    rows: Range<u32>,
}

fn area_of(pixels: &Pixels) -> usize {
    pixels.columns.len() * pixels.rows.len()
}

/// What is known of a pixel in this frame.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    x: u32,
    y: u32,
    difference: f32,
    noise2: f32,
}

impl Pixel {
    fn stands_out(&self) -> bool {
        self.difference * self.difference > SPOT_SIGMA * SPOT_SIGMA * self.noise2
    }
}

/// Adds up the pixels of a spot.
#[derive(Debug, Default)]
struct SpotSums {
    first: Option<Pixel>,
    x_range: (u32, u32),
    y_range: (u32, u32),
    weight: f32,
    x_sum: f32,
    y_sum: f32,
    n_px: u32,
}

impl SpotSums {
    fn add(&mut self, pixel: &Pixel, weight: f32) {
        let Pixel { x, y, .. } = *pixel;
        // Sums are taken from the first pixel, so that f32 keeps its digits at column 4000.
        let first = *self.first.get_or_insert_with(|| {
            (self.x_range, self.y_range) = ((x, x), (y, y));
            *pixel
        });
        self.x_range = (self.x_range.0.min(x), self.x_range.1.max(x));
        self.y_range = (self.y_range.0.min(y), self.y_range.1.max(y));
        self.weight += weight;
        self.x_sum += weight * (x as f32 - first.x as f32);
        self.y_sum += weight * (y as f32 - first.y as f32);
        self.n_px += 1;
    }

    fn spot(&self) -> Option<Spot> {
        let first = self.first?;
        let side = |range: (u32, u32)| range.1 - range.0 + 1;
        Some(Spot {
            center_px: [
                first.x as f32 + self.x_sum / self.weight,
                first.y as f32 + self.y_sum / self.weight,
            ],
            size_px: [side(self.x_range), side(self.y_range)],
            n_px: self.n_px,
        })
    }
}

/// Sums of three rows per column, with a zero column on either side.
#[derive(Debug)]
struct RowSums {
    difference: Vec<f32>,
    noise2: Vec<f32>,
    change: Vec<f32>,
}

impl Response {
    /// A background that has learned nothing.
    #[must_use]
    pub fn new(strip: Strip, threshold: f32, settings: &Settings) -> Self {
        let width_px = strip.width_px() as usize;
        let n_px = strip.learned().len() * width_px;
        let row = || vec![0.0; width_px + 2 * REACH_PX];
        Self {
            background: settings.background,
            threshold,
            strip,
            mean: vec![0.0; n_px],
            variance: vec![0.0; n_px],
            past: vec![vec![0; n_px]; settings.look_back.max(1)],
            difference: vec![0.0; n_px],
            noise2: vec![0.0; n_px],
            change: vec![0.0; n_px],
            row: RowSums { difference: row(), noise2: row(), change: row() },
            is_kept: vec![0; strip.seen().len() * width_px],
            n_frames: 0,
        }
    }

    /// True as long as the last frame belonged to the learning phase.
    #[must_use]
    pub fn is_learning(&self) -> bool {
        self.n_frames <= u64::from(self.background.n_learning)
    }

    /// Learns a whole frame and returns the mask (0 or 1) of the response in the seen rows.
    pub fn update(&mut self, luma: &[u8]) -> &[u8] {
        self.n_frames += 1;
        let width_px = self.strip.width_px() as usize;
        let rows = self.strip.learned();
        let luma = &luma[rows.start as usize * width_px..rows.end as usize * width_px];
        self.learn(luma);
        for row in self.strip.seen() {
            self.sum_rows(row);
            self.decide(row);
        }
        &self.is_kept
    }

    /// The pixels of a blob that stand out with its sign; `None` if none does, or if what is
    /// around them stands out as well: a moving person is full of spots, a ball is alone.
    #[must_use]
    pub fn spot(&self, blob: &Blob) -> Option<Spot> {
        let box_of_blob = self.grown(blob, 1);
        let pixels = || self.pixels(&box_of_blob);
        let sign = pixels().map(|pixel| pixel.difference).sum::<f32>().signum();
        let own =
            || pixels().filter(move |pixel| pixel.stands_out() && pixel.difference * sign > 0.0);
        let peak = own().map(|pixel| pixel.difference.abs()).fold(0.0, f32::max);
        let mut sums = SpotSums::default();
        for pixel in own() {
            // Clipped: the sunlit side of a near ball must not pull its centre.
            sums.add(&pixel, pixel.difference.abs().min(WEIGHT_CLIP * peak));
        }
        let spot = sums.spot()?;
        let around = self.grown(blob, 1 + RING_PX);
        let n_ring = area_of(&around) - area_of(&box_of_blob);
        let n_out = |pixels: &Pixels| self.pixels(pixels).filter(Pixel::stands_out).count();
        let n_ring_out = n_out(&around) - n_out(&box_of_blob);
        (n_ring_out as f32 <= RING_SHARE_MAX * n_ring as f32).then_some(spot)
    }

    /// The box of a blob and so many pixels around it, cut to what is known.
    fn grown(&self, blob: &Blob, by_px: u32) -> Pixels {
        let rows = self.strip.learned();
        Pixels {
            columns: blob.x_min.saturating_sub(by_px)
                ..(blob.x_max + by_px + 1).min(self.strip.width_px()),
            rows: blob.y_min.saturating_sub(by_px).max(rows.start)
                ..(blob.y_max + by_px + 1).min(rows.end),
        }
    }

    fn pixels(&self, of: &Pixels) -> impl Iterator<Item = Pixel> {
        let (width_px, first_row) = (self.strip.width_px(), self.strip.learned().start);
        let columns = of.columns.clone();
        let places = of.rows.clone().flat_map(move |y| columns.clone().map(move |x| (x, y)));
        places.map(move |(x, y)| {
            let at = ((y - first_row) * width_px + x) as usize;
            Pixel { x, y, difference: self.difference[at], noise2: self.noise2[at] }
        })
    }

    fn learn(&mut self, luma: &[u8]) {
        let rate = self.background.rate(self.n_frames);
        let floor2 = self.background.sigma_floor.powi(2);
        let model = self.mean.iter_mut().zip(&mut self.variance);
        let seen = self.difference.iter_mut().zip(&mut self.noise2);
        for ((&level, (mean, variance)), (difference, noise2)) in luma.iter().zip(model).zip(seen) {
            *noise2 = variance.max(floor2);
            *difference = learned(level, mean, variance, rate);
        }
        let slot = (self.n_frames % self.past.len() as u64) as usize;
        let past = self.past[slot].iter_mut().zip(&mut self.change);
        for (&level, (before, change)) in luma.iter().zip(past) {
            *change = f32::from(level) - f32::from(*before);
            *before = level;
        }
    }

    fn sum_rows(&mut self, row: u32) {
        let width_px = self.strip.width_px() as usize;
        let rows = self.strip.learned();
        let first = row.saturating_sub(REACH_PX as u32).max(rows.start);
        let last = (row + REACH_PX as u32).min(rows.end - 1);
        let images = [&self.difference, &self.noise2, &self.change];
        let RowSums { difference, noise2, change } = &mut self.row;
        for (image, sums) in images.into_iter().zip([difference, noise2, change]) {
            let sums = &mut sums[REACH_PX..REACH_PX + width_px];
            sums.fill(0.0);
            for other in first..=last {
                let at = (other - rows.start) as usize * width_px;
                for (sum, &value) in sums.iter_mut().zip(&image[at..at + width_px]) {
                    *sum += value;
                }
            }
        }
    }

    fn decide(&mut self, row: u32) {
        let width_px = self.strip.width_px() as usize;
        let at = (row - self.strip.seen().start) as usize * width_px;
        let kept = &mut self.is_kept[at..at + width_px];
        let (for_spot, for_change) = (self.threshold.powi(2), self.threshold.powi(2) / 2.0);
        let RowSums { difference, noise2, change } = &self.row;
        for (x, kept) in kept.iter_mut().enumerate() {
            let sum = |of: &[f32]| of[x] + of[x + 1] + of[x + 2];
            let (d, noise2, c) = (sum(difference), sum(noise2), sum(change));
            let is_spot = d * d > for_spot * noise2;
            let is_new = d * c > 0.0 && c * c > for_change * noise2;
            *kept = u8::from(is_spot & is_new);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    const SIZE_PX: (u32, u32) = (64, 48);

    /// Noise of σ about 2 around 100, and a spot of 3.4 px diameter and this contrast, if any.
    fn frame(rng: &mut ChaCha8Rng, spot: Option<([f32; 2], f32)>) -> Vec<u8> {
        let places = (0..SIZE_PX.1).flat_map(|y| (0..SIZE_PX.0).map(move |x| (x as f32, y as f32)));
        places
            .map(|(x, y)| {
                let noise: u32 = (0..12).map(|_| rng.next_u32() % 3).sum(); // mean 12, σ 2.8
                let of_spot = spot.map_or(0.0, |([cx, cy], contrast)| {
                    let distance = (x - cx).hypot(y - cy);
                    contrast * (2.2 - distance).clamp(0.0, 1.0)
                });
                (88.0 + noise as f32 + of_spot).round() as u8
            })
            .collect()
    }

    fn learned_response(rng: &mut ChaCha8Rng) -> Response {
        let strip = Strip::new(0, 1, SIZE_PX);
        let mut response = Response::new(strip, 6.0, &Settings::DEFAULT);
        for _ in 0..60 {
            response.update(&frame(rng, None));
        }
        response
    }

    #[test]
    fn a_far_ball_of_four_times_the_noise_is_found_and_noise_is_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut response = learned_response(&mut rng);
        let (mut n_found, mut n_elsewhere, mut squares_px2) = (0, 0, 0.0);
        for k in 0..100 {
            let center = [8.0 + 0.45 * k as f32, 20.3];
            let luma = frame(&mut rng, Some((center, 11.2)));
            let mask = response.update(&luma).to_vec();
            let mut blobs = crate::blobs::Blobs::new(Strip::new(0, 1, SIZE_PX));
            for blob in blobs.update(&mask) {
                let Some(spot) = response.spot(blob) else { continue };
                let off = [spot.center_px[0] - center[0], spot.center_px[1] - center[1]];
                if off[0].hypot(off[1]) < 3.0 {
                    n_found += 1;
                    squares_px2 += off[0] * off[0];
                } else {
                    n_elsewhere += 1;
                }
            }
        }
        let rms_px = (squares_px2 / n_found as f32).sqrt();
        assert!(n_found >= 90 && n_elsewhere <= 5, "{n_found} found, {n_elsewhere} elsewhere");
        assert!(rms_px < 0.5, "{rms_px}");
    }

    #[test]
    fn what_stays_is_not_reported_and_dark_spots_are() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for contrast in [60.0, -60.0] {
            let mut response = learned_response(&mut rng);
            let n_kept: Vec<u32> = (0..8)
                .map(|_| {
                    let luma = frame(&mut rng, Some(([30.0, 20.0], contrast)));
                    response.update(&luma).iter().map(|&m| u32::from(m)).sum()
                })
                .collect();
            assert!(n_kept[..4].iter().all(|&n| n > 8), "{n_kept:?}");
            assert!(n_kept[4..].iter().all(|&n| n == 0), "{n_kept:?}");
        }
    }
}

//! Frame → foreground: which pixels differ from the background, and did not a few frames ago.
//!
//! Each pixel keeps a single Gaussian, updated with every frame (thesis Eq 15 and 16):
//!
//! ```text
//!   μ ← (1-ρ) μ + ρ I                (15)
//!   σ² ← (1-ρ) σ² + ρ (I-μ_old)(I-μ_new)
//! ```
//!
//! Eq 16 as printed squares I-μ_new, which settles 7 % below the true variance; the mixed product
//! is the exact weighted variance. A pixel is foreground when |I-μ_old| > k max(σ, floor): without
//! the floor a quiet pixel's σ goes to zero and one grey level is foreground. Frames of the
//! learning phase weigh equally (ρ = 1/n), so that the model means something when it is over.
//!
//! A pixel is *new* when it is foreground now and was not `look_back` frames ago (the thesis' S3).
//!
//! Cost: 8 bytes of model read and written and 1 byte read per pixel, about 10 operations on f32
//! that vectorise; 640x480: 5 MB of traffic, some 0.3 ms.

use crate::Settings;
use crate::strip::Strip;

/// How the background is learned and what counts as foreground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Background {
    /// ρ: weight of a new frame once the learning phase is over. 1/256 is a memory of 2.8 s at
    /// 90 frames/s; much more and a slow far ball becomes background while it flies.
    pub learning_rate: f32,
    /// How many σ a pixel must differ to be foreground.
    pub sigma_threshold: f32,
    /// Smallest σ believed, grey levels: 8-bit steps alone are 0.3, a quiet sensor 1.5.
    pub sigma_floor: f32,
    /// Frames learned before anything is reported.
    pub n_learning: u32,
}

impl Background {
    /// What holds unless something else is said.
    pub const DEFAULT: Self =
        Self { learning_rate: 1.0 / 256.0, sigma_threshold: 3.0, sigma_floor: 2.0, n_learning: 40 };

    /// Weight of frame `n_frames`, counted from 1. Equal weights while learning. Afterwards ρ at
    /// once: a ball that stands on a pixel for five frames would otherwise raise that pixel's σ
    /// until it is foreground no more.
    fn rate(&self, n_frames: u64) -> f32 {
        let is_learning = n_frames <= u64::from(self.n_learning);
        if is_learning { 1.0 / n_frames as f32 } else { self.learning_rate }
    }
}

/// Updates a pixel's Gaussian (Eq 15, 16) and says how far it was from the mean before.
#[inline]
fn learned(level: u8, mean: &mut f32, variance: &mut f32, rate: f32) -> f32 {
    let difference = f32::from(level) - *mean;
    *mean += rate * difference;
    *variance = (1.0 - rate) * (*variance + rate * difference * difference);
    difference
}

/// The background of a strip, and the last masks for looking back.
#[derive(Debug)]
pub struct Foreground {
    settings: Background,
    strip: Strip,
    mean: Vec<f32>,
    variance: Vec<f32>,
    /// 1 where a pixel was foreground; a ring of `look_back` frames.
    past: Vec<Vec<u8>>,
    is_new: Vec<u8>,
    n_frames: u64,
}

impl Foreground {
    /// A background that has learned nothing.
    #[must_use]
    pub fn new(strip: Strip, is_differenced: bool, settings: &Settings) -> Self {
        let n_px = strip.learned().len() * strip.width_px() as usize;
        let look_back = if is_differenced { settings.look_back() } else { 0 };
        Self {
            settings: settings.background,
            strip,
            mean: vec![0.0; n_px],
            variance: vec![0.0; n_px],
            past: vec![vec![0; n_px]; look_back],
            is_new: vec![0; n_px],
            n_frames: 0,
        }
    }

    /// True as long as the last frame belonged to the learning phase.
    #[must_use]
    pub fn is_learning(&self) -> bool {
        self.n_frames <= u64::from(self.settings.n_learning)
    }

    /// Learns a whole frame and returns the mask (0 or 1) of new foreground in the learned rows.
    pub fn update(&mut self, luma: &[u8]) -> &[u8] {
        self.n_frames += 1;
        let width_px = self.strip.width_px() as usize;
        let rows = self.strip.learned();
        let luma = &luma[rows.start as usize * width_px..rows.end as usize * width_px];
        let rate = self.settings.rate(self.n_frames);
        let threshold2 = self.settings.sigma_threshold.powi(2);
        let floor2 = self.settings.sigma_floor.powi(2);

        let pixels = luma.iter().zip(&mut self.mean).zip(&mut self.variance).zip(&mut self.is_new);
        for (((&level, mean), variance), is_foreground) in pixels {
            let noise2 = variance.max(floor2);
            let difference = learned(level, mean, variance, rate);
            *is_foreground = u8::from(difference * difference > threshold2 * noise2);
        }
        self.keep_new()
    }

    /// Turns the mask of foreground into that of new foreground, remembering the former.
    fn keep_new(&mut self) -> &[u8] {
        if !self.past.is_empty() {
            let slot = (self.n_frames % self.past.len() as u64) as usize;
            for (is_new, was_foreground) in self.is_new.iter_mut().zip(&mut self.past[slot]) {
                let is_foreground = *is_new;
                *is_new &= !*was_foreground;
                *was_foreground = is_foreground;
            }
        }
        &self.is_new
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    const SIZE_PX: (u32, u32) = (16, 8);

    fn foreground(look_back: usize) -> Foreground {
        let settings = Settings { look_back: Some(look_back), ..Settings::DEFAULT };
        Foreground::new(Strip::new(0, 1, SIZE_PX), true, &settings)
    }

    fn noisy(rng: &mut ChaCha8Rng) -> Vec<u8> {
        // Irwin-Hall of 12: mean 100, variance 12 * (n² - 1)/12 with n = 4, so sigma 3.87.
        (0..128)
            .map(|_| {
                let sum: u32 = (0..12).map(|_| rng.next_u32() % 4).sum();
                (82 + sum) as u8
            })
            .collect()
    }

    #[test]
    fn mean_and_variance_are_those_of_the_pixels_seen() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut foreground = foreground(4);
        for _ in 0..2000 {
            foreground.update(&noisy(&mut rng));
        }
        let n = foreground.mean.len() as f32;
        let mean = foreground.mean.iter().sum::<f32>() / n;
        let variance = foreground.variance.iter().sum::<f32>() / n;
        // 128 pixels of effectively 511 frames: 1 sigma of the mean 0.015, of the variance 0.5 %.
        assert!((mean - 100.0).abs() < 0.1, "{mean}");
        assert!((variance / 15.0 - 1.0).abs() < 0.05, "{variance}");
    }

    #[test]
    fn a_spot_is_new_for_look_back_frames() {
        for look_back in [1, 4] {
            let mut foreground = foreground(look_back);
            let empty = vec![100; 128];
            for k in 0..40 {
                let is_empty = foreground.update(&empty).iter().all(|&m| m == 0);
                assert!(is_empty || k == 0, "nothing is known before the first frame");
            }
            let mut with_spot = empty.clone();
            with_spot[37] = 200;
            for k in 0..look_back + 2 {
                let n_new: u32 = foreground.update(&with_spot).iter().map(|&m| u32::from(m)).sum();
                assert_eq!(n_new, u32::from(k < look_back), "frame {k}, looking back {look_back}");
            }
        }
    }

    #[test]
    fn without_differencing_a_spot_stays_until_it_is_background() {
        let mut foreground = foreground(0);
        for _ in 0..40 {
            foreground.update(&[100; 128]);
        }
        let frames = (0..1000).position(|_| foreground.update(&[140; 128])[0] == 0);
        assert!(frames.is_some_and(|n| n > 10), "gone after {frames:?} frames");
    }

    #[test]
    fn noise_within_three_sigma_is_rare() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut foreground = foreground(0);
        let mut n_foreground = 0;
        for k in 0..1200 {
            let mask = foreground.update(&noisy(&mut rng));
            if k >= 200 {
                n_foreground += mask.iter().filter(|&&m| m == 1).count();
            }
        }
        // A Gaussian leaves 0.27 %; the sum of twelve has thinner tails.
        let share = n_foreground as f64 / (1000.0 * 128.0);
        assert!((0.0003..0.0030).contains(&share), "{share}");
    }
}

//! Light -> grey levels with the noise of a small sensor.
//!
//! The sensor collects electrons: a full well of 6000 with shot noise, plus 10 electrons of read
//! noise, both in linear light; then comes the sRGB curve and 8 bits. Near any brightness that is a
//! mean and a standard deviation in grey levels (1.8 in mid-grey, 4 in the dark), which are worked
//! out once. A frame then costs a multiplication and an addition per pixel in 16 bits: Gaussian
//! samples come from a bank drawn at the start, and every row of every frame of every camera reads
//! it from a place chosen by a hash of (seed, camera, frame, row).
//! Units: brightness in 1/64 grey level ("q6"); noise samples have a standard deviation of 4096.
//! Source: the model of data/unpack; gamma: IEC 61966-2-1.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::texture::hash;

const FULL_WELL_E: f64 = 6000.0;
const READ_NOISE_E: f64 = 10.0;
/// Samples in the bank: 1 MB, more than a frame, and still fits a second-level cache.
const BANK_SAMPLES: usize = 1 << 19;
/// Standard deviation of a sample of the bank: 8 sigma fit 16 bits.
const SAMPLE_SIGMA: f64 = 4096.0;
/// Fixed point of brightness: 1/64 grey level, so that 255 and 8 sigma of noise fit 16 bits.
const Q6: f64 = 64.0;
/// Entries of the brightness table for each grey level.
const STEPS_PER_GREY: usize = 4;

/// Mean brightness and noise of a pixel, ready for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level {
    /// In 1/64 grey level.
    pub mean_q6: i16,
    /// Grey levels of noise: times a sample of the bank, over 65536, in 1/64 grey level.
    pub scale: i16,
}

/// The sensor.
#[derive(Clone, Debug)]
pub struct Noise {
    seed: u64,
    bank: Vec<i16>,
    levels: Vec<Level>,
}

/// Which row of which frame of which camera: the key of its noise.
#[derive(Clone, Copy, Debug)]
pub struct RowKey {
    /// 0 left, 1 right.
    pub camera_idx: u64,
    /// Number of the frame.
    pub frame_idx: u64,
    /// Number of the row.
    pub row_idx: usize,
}

impl Noise {
    /// The sensor with its noise multiplied by `noise_level`.
    pub fn new(seed: u64, noise_level: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let sample = |_| {
            let normal: f64 = rng.sample(StandardNormal);
            // `as` saturates, and 8 sigma do not happen.
            (normal * SAMPLE_SIGMA).round() as i16
        };
        let bank = (0..BANK_SAMPLES).map(sample).collect();
        let n_levels = 255 * STEPS_PER_GREY + 1;
        let grey = |idx: usize| idx as f64 / STEPS_PER_GREY as f64;
        let levels = (0..n_levels).map(|idx| level(grey(idx), noise_level)).collect();
        Self { seed, bank, levels }
    }

    /// What a pixel that gets this much light shows on average, and how noisily.
    pub fn level_from_light(&self, light: f32) -> Level {
        let grey = grey_from_light(f64::from(light));
        let near = &self.levels[(grey * STEPS_PER_GREY as f64).round() as usize];
        // The table is coarse; its bias is not, so the mean keeps its fraction.
        let near_grey_q6 = (grey * STEPS_PER_GREY as f64).round() * (Q6 / STEPS_PER_GREY as f64);
        let mean_q6 = f64::from(near.mean_q6) + grey * Q6 - near_grey_q6;
        Level { mean_q6: mean_q6.round() as i16, scale: near.scale }
    }

    /// The Gaussian samples of a row.
    pub fn row(&self, key: RowKey, width_px: usize) -> &[i16] {
        let camera = hash(self.seed ^ key.camera_idx.rotate_left(60));
        let start = hash(hash(camera ^ key.frame_idx) ^ key.row_idx as u64);
        let start = start as usize % (BANK_SAMPLES - width_px);
        &self.bank[start..start + width_px]
    }
}

/// One pixel: brightness plus noise, rounded and clipped to 8 bits.
#[inline(always)]
pub fn grey_from_level(mean_q6: i16, scale: i16, sample: i16) -> u8 {
    let noise_q6 = ((i32::from(scale) * i32::from(sample)) >> 16) as i16;
    // 255 * 64 + 8 sigma of at most 8 grey levels each stays below 2^15: no overflow.
    let rounded = mean_q6.saturating_add(noise_q6).saturating_add(32) >> 6;
    rounded.clamp(0, 255) as u8
}

/// sRGB curve: light 0..1 to grey 0..255, not rounded.
pub fn grey_from_light(light: f64) -> f64 {
    let light = light.clamp(0.0, 1.0);
    let y = if light <= 0.0031308 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    255.0 * y
}

/// The inverse of [`grey_from_light`].
pub fn light_from_grey(grey: f64) -> f64 {
    let y = grey / 255.0;
    if y <= 0.04045 { y / 12.92 } else { ((y + 0.055) / 1.055).powf(2.4) }
}

/// Mean and standard deviation of what the sensor shows for a brightness, by quadrature.
fn level(grey: f64, noise_level: f64) -> Level {
    let light = light_from_grey(grey);
    let read = READ_NOISE_E / FULL_WELL_E;
    let sigma = noise_level * (light / FULL_WELL_E + read * read).sqrt();
    let (mut weights, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for step in -100..=100 {
        let n = f64::from(step) * 0.05;
        let weight = (-0.5 * n * n).exp();
        let shown = grey_from_light(light + sigma * n);
        weights += weight;
        sum += weight * shown;
        squares += weight * shown * shown;
    }
    let mean = sum / weights;
    let variance = (squares / weights - mean * mean).max(0.0);
    let scale = variance.sqrt() * Q6 * 65536.0 / SAMPLE_SIGMA;
    Level { mean_q6: (mean * Q6).round() as i16, scale: scale.round() as i16 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(noise: &Noise, light: f32) -> (f64, f64) {
        let Level { mean_q6, scale } = noise.level_from_light(light);
        let mut values = Vec::new();
        for row_idx in 0..200 {
            let key = RowKey { camera_idx: 0, frame_idx: 3, row_idx };
            let grey = |s: &i16| f64::from(grey_from_level(mean_q6, scale, *s));
            values.extend(noise.row(key, 640).iter().map(grey));
        }
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        (mean, variance.sqrt())
    }

    #[test]
    fn noise_is_that_of_the_sensor_in_light_and_dark() {
        let noise = Noise::new(1, 1.0);
        // Derived: sigma = sqrt(L/6000 + 1/600^2) times the slope of the sRGB curve at L.
        let (mean, sigma) = shown(&noise, light_from_grey(128.0) as f32);
        assert!((mean - 128.0).abs() < 0.1, "{mean}");
        assert!((sigma - 1.82).abs() < 0.1, "{sigma}");
        let (_, dark) = shown(&noise, light_from_grey(12.0) as f32);
        assert!((3.5..5.5).contains(&dark), "{dark}");
    }

    #[test]
    fn without_noise_the_grey_level_is_exact() {
        let noise = Noise::new(1, 0.0);
        for grey in [0.0, 17.0, 128.0, 255.0] {
            assert_eq!(shown(&noise, light_from_grey(grey) as f32), (grey, 0.0));
        }
    }

    #[test]
    fn the_gamma_curve_and_its_inverse_agree() {
        for grey in 0..=255 {
            let there = light_from_grey(f64::from(grey));
            assert!((grey_from_light(there) - f64::from(grey)).abs() < 1e-3);
        }
    }

    #[test]
    fn rows_of_frames_of_cameras_have_noise_of_their_own() {
        let noise = Noise::new(1, 1.0);
        let key = RowKey { camera_idx: 0, frame_idx: 5, row_idx: 7 };
        let row = noise.row(key, 64);
        assert_eq!(row, Noise::new(1, 2.0).row(key, 64));
        assert_ne!(row, noise.row(RowKey { camera_idx: 1, ..key }, 64));
        assert_ne!(row, noise.row(RowKey { frame_idx: 6, ..key }, 64));
        assert_ne!(row, noise.row(RowKey { row_idx: 8, ..key }, 64));
        assert_ne!(row, Noise::new(2, 1.0).row(key, 64));
    }
}

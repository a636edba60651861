//! Place -> mild, repeatable variation: the grain of asphalt, leaves against the sky.
//!
//! Value noise: a hash gives every corner of a unit grid a number, a smooth blend fills the cells,
//! octaves add detail. Integer arithmetic and one fixed blend: the same texture on every machine.
//! A periodic field of blurred Gaussian noise serves what has no place of its own.
//! Source: Perlin's smoothstep; splitmix64 (Steele, Lea, Flood, OOPSLA 2014).

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// A well mixed 64-bit number from another (splitmix64).
pub fn hash(key: u64) -> u64 {
    let mut z = key.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Smooth noise in -1..1 that varies over a distance of about one.
pub fn value_noise(seed: u64, x: f64, y: f64) -> f64 {
    let (x0, y0) = (floor(x), floor(y));
    let (u, v) = (smooth(x - x0 as f64), smooth(y - y0 as f64));
    let corner = |dx: i64, dy: i64| {
        let key = (x0 + dx) as u64 ^ ((y0 + dy) as u64).rotate_left(32);
        hash(key ^ seed.wrapping_mul(0xD6E8_FEB8_6659_FD93)) as i64 as f64 / i64::MAX as f64
    };
    let top = corner(0, 0) * (1.0 - u) + corner(1, 0) * u;
    let bottom = corner(0, 1) * (1.0 - u) + corner(1, 1) * u;
    top * (1.0 - v) + bottom * v
}

/// Octaves of value noise, each half as wide and half as strong; within -1..1.
pub fn fractal_noise(seed: u64, x: f64, y: f64, n_octaves: u32) -> f64 {
    let mut sum = 0.0;
    let mut weight = 0.5;
    let mut scale = 1.0;
    for octave in 0..n_octaves {
        sum += weight * value_noise(seed.wrapping_add(u64::from(octave)), x * scale, y * scale);
        weight *= 0.5;
        scale *= 2.0;
    }
    sum
}

/// Gaussian noise with a standard deviation of one, blurred by a Gaussian of `blur_px`; row-major,
/// and every edge continues at the opposite one.
pub fn periodic_field(seed: u64, n_columns: usize, n_rows: usize, blur_px: f64) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let white: Vec<f32> =
        (0..n_columns * n_rows).map(|_| rng.sample::<f32, _>(StandardNormal)).collect();
    let reach = (3.0 * blur_px).ceil() as usize;
    let weight = |away: usize| (-0.5 * (away as f64 / blur_px).powi(2)).exp();
    let kernel: Vec<f64> = (0..=2 * reach).map(|k| weight(k.abs_diff(reach))).collect();
    // Blurring keeps the share sum(w^2) of the variance, once for each direction.
    let norm = kernel.iter().map(|w| w * w).sum::<f64>().sqrt();
    let kernel: Vec<f32> = kernel.iter().map(|w| (w / norm) as f32).collect();
    let blurred = |source: &[f32], step: usize, n_along: usize| -> Vec<f32> {
        let value = |idx: usize| {
            let along = idx / step % n_along;
            let first = idx - along * step;
            let from = |k: usize| first + (along + n_along + k - reach) % n_along * step;
            kernel.iter().enumerate().map(|(k, w)| w * source[from(k)]).sum()
        };
        (0..source.len()).map(value).collect()
    };
    blurred(&blurred(&white, 1, n_columns), n_columns, n_rows)
}

/// Without SSE 4.1, which is not assumed, `f64::floor` is a call and costs more than the rest.
fn floor(x: f64) -> i64 {
    let whole = x as i64;
    whole - i64::from(x < whole as f64)
}

fn smooth(s: f64) -> f64 {
    s * s * (3.0 - 2.0 * s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_and_bounded() {
        for i in 0..2000 {
            let (x, y) = (i as f64 * 0.037 - 20.0, i as f64 * -0.011 + 3.0);
            let here = fractal_noise(5, x, y, 4);
            assert!(here.abs() <= 1.0);
            assert!((fractal_noise(5, x + 1e-6, y, 4) - here).abs() < 1e-4);
        }
    }

    #[test]
    fn a_field_has_unit_variance_and_no_edges() {
        let (n_columns, n_rows) = (256, 128);
        let field = periodic_field(3, n_columns, n_rows, 2.0);
        let n = field.len() as f32;
        let variance = field.iter().map(|v| v * v).sum::<f32>() / n;
        // About 2600 independent values: 1 sigma of the variance is 3 %.
        assert!((variance - 1.0).abs() < 0.1, "{variance}");
        let step = |a: usize, b: usize| (field[a] - field[b]).powi(2);
        let across = (0..n_rows).map(|r| step(r * n_columns, r * n_columns + n_columns - 1));
        let inside = (0..n_rows).map(|r| step(r * n_columns + 100, r * n_columns + 101));
        let ratio = across.sum::<f32>() / inside.sum::<f32>();
        assert!((0.5..2.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn seeds_give_different_textures() {
        assert_ne!(value_noise(1, 0.5, 0.5), value_noise(2, 0.5, 0.5));
    }
}

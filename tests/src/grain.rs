//! Camera, frame, row -> noise as a video encoder leaves it: neighbours alike, in place and time.
//!
//! An encoder throws away fine detail, so what is left of the noise is blurred over 2 to 3 px and
//! 8x8 blocks are shifted as a whole; and it copies from frame to frame, so half of it stays. Here:
//! a periodic field of blurred Gaussian noise, read from a place drawn anew for every frame, plus a
//! number for each block, and the last five such pictures summed with weights 1, 1/2, 1/4, 1/8,
//! 1/16: an autoregressive process with a correlation of 0.5, yet a function of the frame's number
//! alone. In 16 bits, vectorised.
//! Units: 1/64 grey level ("q6").

use crate::texture::{hash, periodic_field};

/// Correlation from one frame to the next.
const KEPT: f64 = 0.5;
/// Frames that are summed; what is left out is a thousandth of the variance.
const N_TAPS: usize = 5;
/// Blur of the field; neighbours at twice this are correlated by 1/e.
const BLUR_PX: f64 = 1.25;
/// Side of an encoder's block.
const BLOCK_PX: usize = 8;
/// Share of the variance that blocks have as a whole.
const BLOCK_SHARE: f64 = 0.15;
/// The field: wider than a picture, so that frames differ, and a picture of more rows repeats.
const FIELD_COLUMNS: usize = 2048;
const FIELD_ROWS: usize = 512;
/// Samples have this standard deviation, so that 8 sigma fit 16 bits.
const SAMPLE_SIGMA: f64 = 4096.0;
/// Block values are read this far apart in the field, where it has forgotten itself.
const BLOCK_STRIDE: usize = 16;
/// Widest picture.
const WIDTH_MAX_PX: usize = 1440;

/// Noise that is correlated, on top of the sensor's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Grain {
    /// Its standard deviation; 0 is none.
    pub sigma_grey: f64,
}

/// All that is drawn at the start.
#[derive(Clone, Debug)]
pub struct GrainField {
    seed: u64,
    field: Vec<i16>,
    field_scales: [i16; N_TAPS],
    block_scales: [i16; N_TAPS],
}

/// The grain of one frame: where its pictures stand in the field.
#[derive(Clone, Copy, Debug)]
pub struct GrainFrame<'a> {
    of: &'a GrainField,
    places: [u64; N_TAPS],
    /// The blocks of the last row that was asked for.
    block_row: usize,
    blocks_q6: [i16; WIDTH_MAX_PX / BLOCK_PX],
}

impl GrainField {
    /// `None` when there is no grain.
    pub fn new(seed: u64, grain: &Grain) -> Option<Self> {
        if grain.sigma_grey == 0.0 {
            return None;
        }
        let field = periodic_field(seed ^ 0x96a1, FIELD_COLUMNS, FIELD_ROWS, BLUR_PX);
        let weights: [f64; N_TAPS] = std::array::from_fn(|tap| KEPT.powi(tap as i32));
        let norm = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
        // A sample times its scale, over 65536, is in q6.
        let scale = |share: f64| {
            let whole = grain.sigma_grey * share.sqrt() * 64.0 * 65536.0 / SAMPLE_SIGMA;
            weights.map(|weight| (whole * weight / norm).round() as i16)
        };
        Some(Self {
            seed,
            field: field.iter().map(|v| (f64::from(*v) * SAMPLE_SIGMA).round() as i16).collect(),
            field_scales: scale(1.0 - BLOCK_SHARE),
            block_scales: scale(BLOCK_SHARE),
        })
    }

    /// The grain of a frame of a camera.
    pub fn frame(&self, camera_idx: u64, frame_idx: u64) -> GrainFrame<'_> {
        let camera = hash(self.seed ^ 0x6e ^ camera_idx.rotate_left(60));
        let place = |tap: usize| hash(camera ^ frame_idx.wrapping_sub(tap as u64));
        GrainFrame {
            of: self,
            places: std::array::from_fn(place),
            block_row: usize::MAX,
            blocks_q6: [0; WIDTH_MAX_PX / BLOCK_PX],
        }
    }
}

impl GrainFrame<'_> {
    /// The grain of a row.
    pub fn fill_row(&mut self, row_idx: usize, out_q6: &mut [i16]) {
        let width = out_q6.len();
        assert!(width <= WIDTH_MAX_PX, "wider than the field allows");
        if self.block_row != row_idx / BLOCK_PX {
            self.block_row = row_idx / BLOCK_PX;
            self.fill_blocks();
        }
        for (block, offset_q6) in out_q6.chunks_mut(BLOCK_PX).zip(self.blocks_q6) {
            block.fill(offset_q6);
        }
        let slices = self.places.map(|place| {
            let row = (place as usize + row_idx) % FIELD_ROWS;
            let column = (place >> 20) as usize % (FIELD_COLUMNS - WIDTH_MAX_PX);
            &self.of.field[row * FIELD_COLUMNS + column..][..width]
        });
        add_scaled(slices, self.of.field_scales, out_q6);
    }

    fn fill_blocks(&mut self) {
        self.blocks_q6.fill(0);
        for (&place, scale) in self.places.iter().zip(self.of.block_scales) {
            let row = ((place >> 40) as usize + self.block_row * BLOCK_STRIDE) % FIELD_ROWS;
            let samples = &self.of.field[row * FIELD_COLUMNS..][..FIELD_COLUMNS];
            let first = (place >> 48) as usize;
            for (block_idx, offset_q6) in self.blocks_q6.iter_mut().enumerate() {
                let sample = samples[(first + block_idx * BLOCK_STRIDE) % FIELD_COLUMNS];
                *offset_q6 += scaled(sample, scale);
            }
        }
    }
}

/// Kept apart and simple, so that it is vectorised.
fn add_scaled(samples: [&[i16]; N_TAPS], scales: [i16; N_TAPS], out_q6: &mut [i16]) {
    let [a, b, c, d, e] = samples;
    for (((((o, &a), &b), &c), &d), &e) in out_q6.iter_mut().zip(a).zip(b).zip(c).zip(d).zip(e) {
        let newest = scaled(a, scales[0]).wrapping_add(scaled(b, scales[1]));
        let older = scaled(c, scales[2]).wrapping_add(scaled(d, scales[3]));
        // 255 grey levels fit 14 bits, and nobody asks for more noise than that.
        *o = o.wrapping_add(newest).wrapping_add(older).wrapping_add(scaled(e, scales[4]));
    }
}

#[inline(always)]
fn scaled(sample: i16, scale: i16) -> i16 {
    ((i32::from(sample) * i32::from(scale)) >> 16) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH_PX: usize = 640;

    fn picture(field: &GrainField, frame_idx: u64) -> Vec<f64> {
        let mut row = [0; WIDTH_PX];
        let mut frame = field.frame(0, frame_idx);
        let rows = (0..480).flat_map(|row_idx| {
            frame.fill_row(row_idx, &mut row);
            row.to_vec()
        });
        rows.map(|q6| f64::from(q6) / 64.0).collect()
    }

    /// Mean product of values at the same place of two pictures, one of them shifted.
    fn product(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len().min(b.len()) as f64
    }

    #[test]
    fn grain_is_as_strong_as_it_says_and_alike_in_place_and_time() {
        let field = GrainField::new(1, &Grain { sigma_grey: 5.0 }).expect("grain");
        let (now, next, later) = (picture(&field, 7), picture(&field, 8), picture(&field, 19));
        let variance = product(&now, &now);
        assert!((variance.sqrt() / 5.0 - 1.0).abs() < 0.05, "{}", variance.sqrt());
        let alike = |a: &[f64], b: &[f64]| product(a, b) / variance;
        assert!((alike(&now, &next) - 0.5).abs() < 0.05, "{}", alike(&now, &next));
        assert!(alike(&now, &later).abs() < 0.05);
        // 0.85 exp(-1/4 (d/1.25)^2) + 0.15 (1 - d/8): 0.85 at 1 px, 0.40 at 3 px, 0.13 - 0.19 at 5.
        for (away, expected) in [(1, 0.86), (2, 0.56), (3, 0.30), (5, 0.07)] {
            let got = alike(&now, &now[away..]);
            assert!((got - expected).abs() < 0.05, "{away} px: {got}");
        }
    }

    #[test]
    fn blocks_show() {
        let field = GrainField::new(2, &Grain { sigma_grey: 5.0 }).expect("grain");
        let now = picture(&field, 3);
        let step2 = |within: usize| {
            let at =
                (0..now.len() - 8).step_by(8).map(|idx| now[idx + within + 1] - now[idx + within]);
            at.map(|step| step * step).sum::<f64>()
        };
        assert!(step2(7) > 1.3 * step2(3), "{} {}", step2(7), step2(3));
    }

    #[test]
    fn a_frame_has_its_own_grain_and_always_the_same() {
        let field = GrainField::new(1, &Grain { sigma_grey: 3.0 }).expect("grain");
        assert_eq!(picture(&field, 4), picture(&field, 4));
        assert_ne!(picture(&field, 4), picture(&field, 5));
        assert!(GrainField::new(1, &Grain::default()).is_none());
    }
}

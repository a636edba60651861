//! Foreground → filtered: pixels with company, by a low-pass filter on the binary mask.
//!
//! The thesis' test 5: a 4x4 box mean of the mask (0 or 255), kept where it exceeds 150, which is
//! 10 of 16 pixels or more. OpenCV anchors an even kernel at its third pixel,
//!
//! ```text
//!   kept(x, y) ⇐ at least 10 of mask(x-2 ..= x+1, y-2 ..= y+1)
//! ```
//!
//! so the result sits half a pixel right of and below the mask it came from;
//! [`SHIFT_PX`] is taken off again where a centre is reported. Beyond the frame the mask is 0.
//!
//! Cost: two running sums of bytes per pixel, about 0.1 ms for 640x480.

use crate::strip::Strip;

/// Rows above a pixel that its filtered value depends on.
pub const REACH_UP_PX: u32 = 2;
/// Rows below a pixel that its filtered value depends on.
pub const REACH_DOWN_PX: u32 = 1;
/// How far the even kernel moves what it filters, right and down.
pub const SHIFT_PX: f32 = 0.5;

/// Pixels of the 4x4 box that must be foreground: 16 * 150 / 255 = 9.4, so ten.
const MIN_COUNT: u8 = 10;

/// The filtered mask of the rows a strip sees.
#[derive(Debug)]
pub struct Filtered {
    strip: Strip,
    /// Sum of four rows per column, with two zero columns before and one behind.
    column_sums: Vec<u8>,
    is_kept: Vec<u8>,
}

impl Filtered {
    /// Scratch memory for a strip.
    #[must_use]
    pub fn new(strip: Strip) -> Self {
        let width_px = strip.width_px() as usize;
        Self {
            strip,
            column_sums: vec![0; width_px + 3],
            is_kept: vec![0; strip.seen().len() * width_px],
        }
    }

    /// The mask (0 or 1) of the learned rows in, the filtered mask of the seen rows out.
    pub fn update(&mut self, mask: &[u8]) -> &[u8] {
        let width_px = self.strip.width_px() as usize;
        let (learned, seen) = (self.strip.learned(), self.strip.seen());
        for (row, kept) in seen.clone().zip(self.is_kept.chunks_exact_mut(width_px)) {
            let sums = &mut self.column_sums[2..2 + width_px];
            sums.fill(0);
            let first = row.saturating_sub(REACH_UP_PX).max(learned.start);
            let last = (row + REACH_DOWN_PX).min(learned.end - 1);
            for other in first..=last {
                let at = (other - learned.start) as usize * width_px;
                for (sum, &m) in sums.iter_mut().zip(&mask[at..at + width_px]) {
                    *sum += m;
                }
            }
            let sums = &self.column_sums;
            for (x, is_kept) in kept.iter_mut().enumerate() {
                let count = sums[x] + sums[x + 1] + sums[x + 2] + sums[x + 3];
                *is_kept = u8::from(count >= MIN_COUNT);
            }
        }
        &self.is_kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The definition, pixel by pixel.
    fn filtered_by_definition(mask: &[u8], width_px: i32, height_px: i32) -> Vec<u8> {
        let at = |x: i32, y: i32| {
            let is_inside = (0..width_px).contains(&x) && (0..height_px).contains(&y);
            if is_inside { u32::from(mask[(y * width_px + x) as usize]) } else { 0 }
        };
        let mut filtered = Vec::new();
        for y in 0..height_px {
            for x in 0..width_px {
                let count: u32 = (-2..=1)
                    .flat_map(|v| (-2..=1).map(move |u| (u, v)))
                    .map(|(u, v)| at(x + u, y + v))
                    .sum();
                filtered.push(u8::from(255 * count > 16 * 150));
            }
        }
        filtered
    }

    proptest! {
        #[test]
        fn it_is_the_box_mean_over_150_of_255(mask in prop::collection::vec(0..2_u8, 20 * 11)) {
            let mut filtered = Filtered::new(Strip::new(0, 1, (20, 11)));
            prop_assert_eq!(filtered.update(&mask), filtered_by_definition(&mask, 20, 11));
        }
    }

    #[test]
    fn an_even_kernel_moves_a_square_by_half_a_pixel() {
        let (width_px, mut mask) = (20, vec![0; 400]);
        for y in 6..12 {
            mask[y * width_px + 5..y * width_px + 11].fill(1); // centre (7.5, 8.5)
        }
        let mut filtered = Filtered::new(Strip::new(0, 1, (20, 20)));
        let kept: Vec<usize> = filtered
            .update(&mask)
            .iter()
            .enumerate()
            .filter(|&(_, &m)| m == 1)
            .map(|(i, _)| i)
            .collect();
        let mean = |of: fn(usize) -> usize| {
            kept.iter().map(|&i| of(i) as f32).sum::<f32>() / kept.len() as f32
        };
        assert!((mean(|i| i % 20) - SHIFT_PX - 7.5).abs() < 1e-4);
        assert!((mean(|i| i / 20) - SHIFT_PX - 8.5).abs() < 1e-4);
    }
}

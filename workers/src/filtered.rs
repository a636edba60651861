//! Foreground → filtered: the stages of a [`Mask`] applied to the mask, one after another.
//!
//! Beyond the frame the mask is 0. Each stage is a count of ones in small windows: columns are
//! added up row by row, then neighbours along the row.
//!
//! Cost: for one 4x4 window two running sums of bytes per pixel, about 0.1 ms for 640x480.

use crate::kernels::{CHUNK_PX, bits_from_bytes};
use crate::method::{Mask, REACH_PX, Stage, Window};
use crate::strip::Strip;

/// The widest window reaches this far; as many zero columns stand on either side of a row.
const MARGIN_PX: usize = 2;

/// The filtered mask of the rows a strip sees.
#[derive(Debug)]
pub struct Filtered {
    strip: Strip,
    stages: &'static [Stage],
    /// Ones per column in a window's rows, with [`MARGIN_PX`] zeros before and behind.
    column_sums: Vec<u8>,
    /// Masks of the learned rows, read and written in turn.
    from: Vec<u8>,
    to: Vec<u8>,
    /// The result, one bit per pixel.
    words: Vec<u64>,
}

impl Filtered {
    /// Scratch memory for a strip.
    #[must_use]
    pub fn new(strip: Strip, method: &Mask) -> Self {
        let width_px = strip.width_px() as usize;
        let n_px = strip.learned().len() * width_px;
        Self {
            strip,
            stages: method.stages,
            column_sums: vec![0; width_px + 2 * MARGIN_PX],
            from: vec![0; n_px],
            to: vec![0; n_px],
            words: vec![0; strip.seen().len() * width_px.div_ceil(CHUNK_PX)],
        }
    }

    /// The mask (0 or 1) of the learned rows in, the filtered mask of the seen rows out.
    pub fn update(&mut self, mask: &[u8]) -> &[u8] {
        self.from.copy_from_slice(mask);
        for stage in self.stages {
            self.apply(stage);
            std::mem::swap(&mut self.from, &mut self.to);
        }
        let (learned, seen) = (self.strip.learned(), self.strip.seen());
        let width_px = self.strip.width_px() as usize;
        let first = (seen.start - learned.start) as usize * width_px;
        &self.from[first..first + seen.len() * width_px]
    }

    /// The same as rows of bits, [`CHUNK_PX`] a word.
    pub fn update_rows(&mut self, mask: &[u8]) -> impl Iterator<Item = &[u64]> {
        let width_px = self.strip.width_px() as usize;
        let n_words = width_px.div_ceil(CHUNK_PX);
        let mut words = std::mem::take(&mut self.words);
        let filtered = self.update(mask);
        for (row, words) in filtered.chunks_exact(width_px).zip(words.chunks_exact_mut(n_words)) {
            for (pixels, word) in row.chunks(CHUNK_PX).zip(words) {
                let mut bytes = [0; CHUNK_PX];
                bytes[..pixels.len()].copy_from_slice(pixels);
                *word = bits_from_bytes(&bytes);
            }
        }
        self.words = words;
        self.words.chunks_exact(n_words)
    }

    fn apply(&mut self, stage: &Stage) {
        let n_rows = self.strip.learned().len();
        // What is not yet decided: nothing has spoken against it (All), or for it (Any, AtLeast).
        self.to.fill(u8::from(matches!(stage, Stage::All(_))));
        for window in stage.windows() {
            let n_window = (window.columns.clone().count() * window.rows.clone().count()) as u8;
            for row in 0..n_rows {
                self.sum_columns(window, row);
                match stage {
                    Stage::AtLeast(count, _) => self.decide(window, row, *count, |_, is| is),
                    Stage::All(_) => self.decide(window, row, n_window, |was, is| was & is),
                    Stage::Any(_) => self.decide(window, row, 1, |was, is| was | is),
                }
            }
        }
    }

    /// Ones of each column in the window's rows around `row`.
    fn sum_columns(&mut self, window: &Window, row: usize) {
        let width_px = self.strip.width_px() as usize;
        let sums = &mut self.column_sums[MARGIN_PX..MARGIN_PX + width_px];
        sums.fill(0);
        for offset in window.rows.clone() {
            let other = row.wrapping_add_signed(offset as isize);
            // Wrapped around or too far down: outside the mask, where all is 0.
            let Some(mask) = self
                .from
                .get(other.wrapping_mul(width_px)..)
                .filter(|_| other < self.strip.learned().len())
            else {
                continue;
            };
            for (sum, &m) in sums.iter_mut().zip(mask) {
                *sum += m;
            }
        }
    }

    fn decide(&mut self, window: &Window, row: usize, count: u8, join: fn(u8, u8) -> u8) {
        let width_px = self.strip.width_px() as usize;
        let begin = MARGIN_PX.wrapping_add_signed(*window.columns.start() as isize);
        let n_columns = window.columns.clone().count();
        let kept = &mut self.to[row * width_px..(row + 1) * width_px];
        let windows = self.column_sums[begin..].windows(n_columns);
        for (kept, sums) in kept.iter_mut().zip(windows) {
            let sum: u8 = sums.iter().sum();
            *kept = join(*kept, u8::from(sum >= count));
        }
    }
}

const _: () = assert!(REACH_PX as usize >= MARGIN_PX, "a window is at most 5 px high and wide");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::TABLE_1;
    use proptest::prelude::*;

    const WIDTH_PX: i32 = 20;
    const HEIGHT_PX: i32 = 11;

    /// The definition of a stage, pixel by pixel.
    fn staged_by_definition(mask: &[u8], stage: &Stage) -> Vec<u8> {
        let at = |x: i32, y: i32| {
            let is_inside = (0..WIDTH_PX).contains(&x) && (0..HEIGHT_PX).contains(&y);
            if is_inside { u32::from(mask[(y * WIDTH_PX + x) as usize]) } else { 0 }
        };
        let count = |window: &Window, x: i32, y: i32| -> (u32, u32) {
            let places =
                window.rows.clone().flat_map(|v| window.columns.clone().map(move |u| (u, v)));
            places.fold((0, 0), |(n, all), (u, v)| (n + at(x + u, y + v), all + 1))
        };
        let places = (0..HEIGHT_PX).flat_map(|y| (0..WIDTH_PX).map(move |x| (x, y)));
        places
            .map(|(x, y)| {
                let counts = stage.windows().iter().map(|window| count(window, x, y));
                u8::from(match stage {
                    Stage::AtLeast(least, _) => {
                        counts.map(|(n, _)| n).sum::<u32>() >= u32::from(*least)
                    }
                    Stage::All(_) => counts.into_iter().all(|(n, all)| n == all),
                    Stage::Any(_) => counts.into_iter().any(|(n, _)| n > 0),
                })
            })
            .collect()
    }

    proptest! {
        #[test]
        fn every_method_is_what_its_stages_say(
            mask in prop::collection::vec(prop::bool::weighted(0.7), 20 * 11)
        ) {
            let mask: Vec<u8> = mask.into_iter().map(u8::from).collect();
            for method in &TABLE_1 {
                let row = Mask::of(method).unwrap();
                let mut expected = mask.clone();
                for stage in row.stages {
                    expected = staged_by_definition(&expected, stage);
                }
                let strip = Strip::new(0, 1, (WIDTH_PX as u32, HEIGHT_PX as u32));
                let name = method.name;
                let mut filtered = Filtered::new(strip, row);
                prop_assert_eq!(filtered.update(&mask), expected, "{}", name);
            }
        }
    }

    #[test]
    fn a_filter_moves_a_square_by_its_shift() {
        let mut mask = vec![0; 400];
        for y in 6..13 {
            mask[y * 20 + 5..y * 20 + 12].fill(1); // centre (8, 9)
        }
        for method in &TABLE_1 {
            let row = Mask::of(method).unwrap();
            let (name, shift_px) = (method.name, row.shift_px());
            let mut filtered = Filtered::new(Strip::new(0, 1, (20, 20)), row);
            let kept = filtered.update(&mask).iter().enumerate().filter(|&(_, &m)| m == 1);
            let kept: Vec<usize> = kept.map(|(i, _)| i).collect();
            let mean = |of: fn(usize) -> usize| {
                kept.iter().map(|&i| of(i) as f32).sum::<f32>() / kept.len() as f32
            };
            assert!((mean(|i| i % 20) - shift_px - 8.0).abs() < 1e-4, "{name}");
            assert!((mean(|i| i / 20) - shift_px - 9.0).abs() < 1e-4, "{name}");
        }
    }
}

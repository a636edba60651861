//! Background, time -> how much brighter or darker each pixel of the trees is than on a calm day.
//!
//! Every row of the trees moves sideways by itself, slowly as branches do and a little faster as
//! leaves do, and by fractions of a pixel: neighbours are blended. What stands before the trees
//! keeps its share of every pixel. Only the change is worked out, so a calm day costs nothing.
//! Cost, estimated: 60 000 pixels x 8 operations in 16 bits, 0.02 ms.
//! Limits: grey levels are mixed as if they were light, and a pixel keeps the noise of a calm day.

use std::f64::consts::TAU;
use std::ops::Range;

use crate::background::Background;
use crate::noise::Noise;

/// Trees sway no further than this, so that a row can be read without looking beyond its ends.
const SWAY_MAX_PX: usize = 16;
/// Branches and leaves: swings a second, share of the motion, phase from one row to the next.
const SWINGS: [(f64, f64, f64); 2] = [(0.35, 0.7, 0.02), (1.3, 0.3, 0.15)];

/// The trees of one camera's picture.
#[derive(Clone, Debug)]
pub struct SwayingTrees {
    sway_px: f64,
    width_px: usize,
    /// Rows from the top that show trees; 0 on a calm day.
    n_rows: usize,
    light: Vec<f32>,
    open: Vec<f32>,
    grey_q6: Vec<i16>,
    open_q8: Vec<i16>,
}

/// One row at one time.
#[derive(Clone, Debug)]
pub struct SwayedRow<'a> {
    /// The columns that sway; the ends of a row stand still.
    pub columns: Range<usize>,
    /// Whole pixels from which the left one of two neighbours is taken.
    whole_px: i32,
    /// Weight of the right one, in 1/256.
    part_q8: i16,
    light: &'a [f32],
    open: &'a [f32],
    grey_q6: &'a [i16],
    open_q8: &'a [i16],
}

impl SwayingTrees {
    /// Trees that sway by up to `sway_px` to either side.
    pub fn from_background(background: &Background, noise: &Noise, sway_px: f64) -> Self {
        assert!((0.0..SWAY_MAX_PX as f64).contains(&sway_px), "trees sway {sway_px} px");
        let width_px = background.width_px;
        let last_idx = background.trees_open.iter().rposition(|open| *open > 0.0);
        let n_rows = match last_idx {
            Some(idx) if sway_px > 0.0 => idx / width_px + 1,
            _ => 0,
        };
        let light = background.trees_light[..n_rows * width_px].to_vec();
        let open = background.trees_open[..n_rows * width_px].to_vec();
        let grey_q6 = light.iter().map(|&l| noise.level_from_light(l).mean_q6).collect();
        let open_q8 = open.iter().map(|o| (o * 256.0).round() as i16).collect();
        Self { sway_px, width_px, n_rows, light, open, grey_q6, open_q8 }
    }

    /// A row of the picture, if it shows trees that sway.
    pub fn row(&self, row_idx: usize, at_s: f64) -> Option<SwayedRow<'_>> {
        if row_idx >= self.n_rows {
            return None;
        }
        let swing = |(rate_hz, share, phase): (f64, f64, f64)| {
            share * (TAU * rate_hz * at_s + phase * row_idx as f64).sin()
        };
        let shift_px = self.sway_px * SWINGS.into_iter().map(swing).sum::<f64>();
        let whole = shift_px.floor();
        let row = row_idx * self.width_px..(row_idx + 1) * self.width_px;
        Some(SwayedRow {
            columns: SWAY_MAX_PX..self.width_px - SWAY_MAX_PX,
            whole_px: whole as i32,
            part_q8: ((shift_px - whole) * 256.0) as i16,
            light: &self.light[row.clone()],
            open: &self.open[row.clone()],
            grey_q6: &self.grey_q6[row.clone()],
            open_q8: &self.open_q8[row],
        })
    }
}

impl SwayedRow<'_> {
    /// Change of brightness of each of the swaying columns, in 1/64 grey level.
    pub fn changes_q6(&self) -> impl Iterator<Item = i16> {
        let start = self.columns.start;
        let n = self.columns.len();
        let from = start.wrapping_add_signed(self.whole_px as isize);
        let calm = &self.grey_q6[start..start + n];
        let open = &self.open_q8[start..start + n];
        let left = &self.grey_q6[from..from + n];
        let right = &self.grey_q6[from + 1..from + 1 + n];
        let part = i32::from(self.part_q8);
        calm.iter().zip(open).zip(left).zip(right).map(move |(((&c, &o), &l), &r)| {
            let (c, l, r) = (i32::from(c), i32::from(l), i32::from(r));
            let swayed = l + ((part * (r - l)) >> 8);
            ((i32::from(o) * (swayed - c)) >> 8) as i16
        })
    }

    /// Change of light of one pixel; none at the ends of the row.
    pub fn change_of_light(&self, column: usize) -> f32 {
        if !self.columns.contains(&column) {
            return 0.0;
        }
        let from = column.wrapping_add_signed(self.whole_px as isize);
        let part = f32::from(self.part_q8) / 256.0;
        let swayed = self.light[from] + part * (self.light[from + 1] - self.light[from]);
        self.open[column] * (swayed - self.light[column])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 100 columns of trees with one bright leaf, behind a post.
    fn leaf(leaf_column: usize, post_column: usize, sway_px: f64) -> SwayingTrees {
        let mut light = vec![0.01; 100];
        light[leaf_column] = 0.5;
        let mut open = vec![1.0; 100];
        open[post_column] = 0.0;
        let background = Background {
            width_px: 100,
            height_px: 1,
            light: light.clone(),
            net_coverage: vec![0.0; 100],
            trees_light: light,
            trees_open: open,
        };
        SwayingTrees::from_background(&background, &Noise::new(1, 0.0), sway_px)
    }

    #[test]
    fn a_calm_day_has_no_swaying_rows() {
        assert!(leaf(50, 20, 0.0).row(0, 1.0).is_none());
    }

    #[test]
    fn a_leaf_moves_and_a_post_does_not() {
        let trees = leaf(50, 51, 3.0);
        let mut most_away_px = 0.0_f64;
        for step in 0..200 {
            let row = trees.row(0, 0.05 * f64::from(step)).expect("trees");
            let change = |column: usize| row.change_of_light(column);
            assert_eq!(change(51), 0.0);
            let light = |column: usize| trees.light[column] + change(column);
            let columns = (30..70).filter(|c| *c != 51);
            let bright: Vec<usize> = columns.filter(|c| light(*c) > 0.2).collect();
            if let Some(column) = bright.first() {
                most_away_px = most_away_px.max((*column as f64 - 50.0).abs());
            }
        }
        assert!((2.0..=4.0).contains(&most_away_px), "{most_away_px} px");
    }

    #[test]
    fn light_and_grey_levels_sway_alike() {
        let trees = leaf(50, 20, 3.0);
        let noise = Noise::new(1, 0.0);
        for step in 0..50 {
            let row = trees.row(0, 0.1 * f64::from(step)).expect("trees");
            for (column, change_q6) in row.columns.clone().zip(row.changes_q6()) {
                let light = trees.light[column] + row.change_of_light(column);
                let exact = noise.level_from_light(light).mean_q6;
                let mixed = trees.grey_q6[column] + change_q6;
                // Blending a leaf half with its dark neighbour is off by the gamma curve at most.
                assert!((exact - mixed).abs() < 50 * 64, "{exact} {mixed}");
            }
        }
    }
}

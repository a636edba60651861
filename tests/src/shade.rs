//! Ground, time -> patches of shade that move over the court.
//!
//! The shade of leaves in the wind or of torn clouds: a periodic field on the ground, a quarter
//! metre fine, whose peaks are dark with soft edges, and which drifts as a whole. Where each pixel
//! meets the ground is worked out once; a frame then looks the field up, bilinearly.
//! Cost, estimated: 200 000 pixels x 4 ns, 0.8 ms.
//! Limits: balls and people are not shaded, and a shaken camera keeps its ground.

use std::ops::Range;

use nalgebra::{Point2, Vector2};

use crate::camera::Camera;
use crate::texture::periodic_field;

/// Cells of the field along each side; a power of two.
const N_CELLS: usize = 128;
/// Side of a cell.
const CELL_M: f64 = 0.25;
/// Patches are about four times as wide as this blur.
const BLUR_CELLS: f64 = 2.0;
/// Where a patch begins and where it is darkest, in standard deviations of the field: a third of
/// the ground is shaded.
const EDGE: (f32, f32) = (0.1, 0.9);
/// Fixed point of places on the ground, in cells: they wrap around as the field does.
const Q16: f64 = 65536.0;

/// Shade that moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MovingShade {
    /// Share of the light that the darkest patches take; 0 is none.
    pub depth: f64,
    /// How the patches move over the ground.
    pub drift_m_s: Vector2<f64>,
}

/// The shade as one camera sees it.
#[derive(Clone, Debug)]
pub struct ShadedGround {
    drift_cells_s: Vector2<f64>,
    width_px: usize,
    /// Light left within each cell: `c0 + c1 u + (c2 + c3 u) v`.
    cells: Vec<[f32; 4]>,
    /// The columns of each row that show ground.
    columns: Vec<Range<usize>>,
    /// Where each pixel meets the ground, in 1/65536 cell.
    ground_q16: Vec<[u32; 2]>,
}

impl ShadedGround {
    /// `None` when nothing is shaded.
    pub fn new(seed: u64, shade: &MovingShade, camera: &Camera, fence_y_m: f64) -> Option<Self> {
        if shade.depth == 0.0 {
            return None;
        }
        let field = periodic_field(seed ^ 0x5ade, N_CELLS, N_CELLS, BLUR_CELLS);
        let left = |value: &f32| {
            let share = ((value - EDGE.0) / (EDGE.1 - EDGE.0)).clamp(0.0, 1.0);
            1.0 - shade.depth as f32 * share * share * (3.0 - 2.0 * share)
        };
        let eye = &camera.position_in_court_m;
        let ground_m = |idx: usize| {
            let (column, row) = (idx % camera.width_px, idx / camera.width_px);
            let ray = camera.ray_in_court(Point2::new(column as f64, row as f64));
            let ground = eye - ray * (eye.z / ray.z);
            (ray.z < 0.0 && ground.y < fence_y_m).then_some([ground.x, ground.y])
        };
        let n_px = camera.width_px * camera.height_px;
        let ground_m: Vec<Option<[f64; 2]>> = (0..n_px).map(ground_m).collect();
        let columns_of = |row: &[Option<[f64; 2]>]| {
            // The far edge of the ground is a straight line, so a row has one piece of it.
            let first = row.iter().position(Option::is_some).unwrap_or(0);
            first..row.iter().rposition(Option::is_some).map_or(first, |last| last + 1)
        };
        let q16 = |at_m: &Option<[f64; 2]>| at_m.unwrap_or_default().map(|m| q16(m / CELL_M));
        Some(Self {
            drift_cells_s: shade.drift_m_s / CELL_M,
            width_px: camera.width_px,
            cells: cells(&field.iter().map(left).collect::<Vec<f32>>()),
            columns: ground_m.chunks(camera.width_px).map(columns_of).collect(),
            ground_q16: ground_m.iter().map(q16).collect(),
        })
    }

    /// Takes from a row of light what the shade takes at a time.
    pub fn darken_row(&self, row_idx: usize, at_s: f64, light: &mut [f32]) {
        let columns = self.columns[row_idx].clone();
        let row = &self.ground_q16[row_idx * self.width_px..(row_idx + 1) * self.width_px];
        let moved = self.drift_cells_s * at_s;
        let moved = [q16(moved.x), q16(moved.y)];
        for (light, [x, y]) in light[columns.clone()].iter_mut().zip(&row[columns]) {
            let (x, y) = (x.wrapping_sub(moved[0]), y.wrapping_sub(moved[1]));
            let cell_idx = (y >> 16) as usize % N_CELLS * N_CELLS + (x >> 16) as usize % N_CELLS;
            let part = |at_q16: u32| (at_q16 & 0xffff) as i32 as f32 * (1.0 / 65536.0);
            let (u, v) = (part(x), part(y));
            let [c0, c1, c2, c3] = self.cells[cell_idx];
            *light *= c0 + c1 * u + (c2 + c3 * u) * v;
        }
    }
}

/// A place on the field, which repeats long before 32 bits do.
fn q16(cells: f64) -> u32 {
    (cells * Q16).round() as i64 as u32
}

/// The blend of the values at the four corners of each cell.
fn cells(values: &[f32]) -> Vec<[f32; 4]> {
    let blend = |idx: usize| {
        let (column, row) = (idx % N_CELLS, idx / N_CELLS);
        let at = |dx, dy| values[(row + dy) % N_CELLS * N_CELLS + (column + dx) % N_CELLS];
        let (a, b, c, d) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
        [a, b - a, c - a, a - b - c + d]
    };
    (0..N_CELLS * N_CELLS).map(blend).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Rig;

    fn ground(depth: f64, drift_m_s: Vector2<f64>) -> Option<ShadedGround> {
        ShadedGround::new(1, &MovingShade { depth, drift_m_s }, &Rig::reference().left, 30.0)
    }

    #[test]
    fn shade_takes_its_depth_and_no_more_and_spares_what_is_no_ground() {
        let ground = ground(0.1, Vector2::new(0.5, 0.2)).expect("shade");
        let mut all = Vec::new();
        for row_idx in 0..480 {
            let mut light = [1.0; 640];
            ground.darken_row(row_idx, 3.0, &mut light);
            all.extend(light);
        }
        assert!(all[..640].iter().all(|l| *l == 1.0), "trees are not shaded");
        let least = all.iter().copied().fold(f32::MAX, f32::min);
        assert!((0.9..0.905).contains(&least), "{least}");
        let n_shaded = all[240 * 640..].iter().filter(|l| **l < 0.95).count();
        let share = n_shaded as f64 / (240.0 * 640.0);
        assert!((0.1..0.6).contains(&share), "{share}");
    }

    #[test]
    fn shade_drifts() {
        let ground = ground(0.1, Vector2::new(0.0, 1.0)).expect("shade");
        let row = |at_s| {
            let mut light = [1.0; 640];
            ground.darken_row(300, at_s, &mut light);
            light
        };
        assert_ne!(row(1.0), row(1.1));
        // The field is 32 m long.
        let (a, b) = (row(1.0), row(33.0));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-3));
    }

    #[test]
    fn without_depth_there_is_no_shade() {
        assert!(ground(0.0, Vector2::zeros()).is_none());
    }
}

//! Ground, time -> patches of shade that move over the court.
//!
//! The shade of leaves in the wind or of torn clouds: a periodic field on the ground, a quarter
//! metre fine, whose peaks are dark with soft edges, and which drifts as a whole. Where each pixel
//! meets the ground is worked out once; a frame then looks the field up, bilinearly.
//! Cost, estimated: 200 000 pixels x 6 ns, 1.2 ms.
//! Limits: balls and people are not shaded, and a shaken camera keeps its ground.

use nalgebra::{Point2, Vector2};

use crate::camera::Camera;
use crate::texture::periodic_field;

/// Cells of the field along each side; a power of two, and its square fits a first-level cache.
const N_CELLS: usize = 128;
/// Side of a cell.
const CELL_M: f64 = 0.25;
/// Patches are about four times as wide as this blur.
const BLUR_CELLS: f64 = 2.0;
/// Where a patch begins and where it is darkest, in standard deviations of the field: a third of
/// the ground is shaded.
const EDGE: (f32, f32) = (0.1, 0.9);
/// Keeps coordinates positive, so that a cast rounds down; a multiple of the field's period.
const AWAY_CELLS: f32 = 2048.0;

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
    /// Light left, cell by cell.
    light_left: Vec<f32>,
    /// Where each pixel meets the ground, in cells; not a number where it does not.
    cells: Vec<[f32; 2]>,
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
        let cell = |idx: usize| {
            let (column, row) = (idx % camera.width_px, idx / camera.width_px);
            let ray = camera.ray_in_court(Point2::new(column as f64, row as f64));
            let ground = eye - ray * (eye.z / ray.z);
            if ray.z < 0.0 && ground.y < fence_y_m {
                [ground.x, ground.y].map(|at_m| (at_m / CELL_M) as f32)
            } else {
                [f32::NAN; 2]
            }
        };
        Some(Self {
            drift_cells_s: shade.drift_m_s / CELL_M,
            width_px: camera.width_px,
            light_left: field.iter().map(left).collect(),
            cells: (0..camera.width_px * camera.height_px).map(cell).collect(),
        })
    }

    /// Takes from a row of light what the shade takes at a time.
    pub fn darken_row(&self, row_idx: usize, at_s: f64, light: &mut [f32]) {
        let cells = &self.cells[row_idx * self.width_px..(row_idx + 1) * self.width_px];
        let period = N_CELLS as f64;
        let moved = (self.drift_cells_s * at_s).map(|cells| cells.rem_euclid(period) as f32);
        for (light, [x, y]) in light.iter_mut().zip(cells) {
            if !x.is_nan() {
                *light *= self.light_left_at(x - moved.x, y - moved.y);
            }
        }
    }

    fn light_left_at(&self, x_cells: f32, y_cells: f32) -> f32 {
        let (x, y) = (x_cells + AWAY_CELLS, y_cells + AWAY_CELLS);
        let (column, row) = (x as usize, y as usize);
        let (u, v) = (x - column as f32, y - row as f32);
        let at = |dx: usize, dy: usize| {
            self.light_left[(row + dy) % N_CELLS * N_CELLS + (column + dx) % N_CELLS]
        };
        let top = at(0, 0) + u * (at(1, 0) - at(0, 0));
        let bottom = at(0, 1) + u * (at(1, 1) - at(0, 1));
        top + v * (bottom - top)
    }
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

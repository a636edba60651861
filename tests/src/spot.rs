//! Centre and half axes of an ellipse in `court` -> its image as a map to the unit disc, and the
//! points of a pixel at which to ask it.
//!
//! Over a ball's width a camera is an affine map to (R/depth)^2, distortion included: the images of
//! the four ends of the half axes give it.

use nalgebra::{Point3, Vector3};

use crate::camera::{self, Camera};

/// Points along each side of what a pixel sees; instants shift the grid against each other.
const POINTS_PER_SIDE: usize = 4;

/// An ellipse in the picture, as the affine map that makes it the unit disc.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Its centre.
    pub center_px: [f32; 2],
    u_from_px: [f32; 2],
    v_from_px: [f32; 2],
    /// Half its extent along x and y.
    pub half_px: [f32; 2],
}

impl Spot {
    /// The image of the ellipse with two half axes around a centre.
    pub fn from_axes(
        camera: &Camera,
        center_in_court_m: &Point3<f64>,
        axes_m: [Vector3<f64>; 2],
    ) -> Option<Self> {
        let pixel = |offset: Vector3<f64>| camera.pixel_from_court(&(center_in_court_m + offset));
        let (u0, u1) = (pixel(-axes_m[0])?, pixel(axes_m[0])?);
        let (v0, v1) = (pixel(-axes_m[1])?, pixel(axes_m[1])?);
        let center = (u0.coords + u1.coords + v0.coords + v1.coords) * 0.25;
        let (a, b) = ((u1 - u0) * 0.5, (v1 - v0) * 0.5);
        let determinant = a.x * b.y - a.y * b.x;
        if determinant.abs() < 1e-9 {
            return None;
        }
        Some(Self {
            center_px: [center.x as f32, center.y as f32],
            u_from_px: [(b.y / determinant) as f32, (-b.x / determinant) as f32],
            v_from_px: [(-a.y / determinant) as f32, (a.x / determinant) as f32],
            half_px: [a.x.hypot(b.x) as f32, a.y.hypot(b.y) as f32],
        })
    }

    /// A pixel position in the coordinates in which the ellipse is the unit disc.
    pub fn unit(&self, x_px: f32, y_px: f32) -> (f32, f32) {
        let (dx, dy) = (x_px - self.center_px[0], y_px - self.center_px[1]);
        (
            self.u_from_px[0] * dx + self.u_from_px[1] * dy,
            self.v_from_px[0] * dx + self.v_from_px[1] * dy,
        )
    }

    /// Could a pixel see a part of it?
    pub fn may_touch(&self, x_px: f32, y_px: f32) -> bool {
        // A pixel looks up to one pixel around its centre.
        (x_px - self.center_px[0]).abs() < self.half_px[0] + 1.0
            && (y_px - self.center_px[1]).abs() < self.half_px[1] + 1.0
    }
}

/// The points at which a pixel is looked at in one instant: a grid, as its columns and rows.
#[derive(Clone, Copy, Debug, Default)]
pub struct Points {
    x_px: [f32; POINTS_PER_SIDE],
    y_px: [f32; POINTS_PER_SIDE],
}

impl Points {
    /// How many there are.
    pub const COUNT: usize = POINTS_PER_SIDE * POINTS_PER_SIDE;

    /// Each instant shifts the grid by its own fraction of a cell, so that together they sample the
    /// pixel more finely (the R2 sequence of Roberts). The later half of an exposure's instants
    /// mirrors the earlier one, so that no shift moves a ball's middle: without that all were
    /// drawn 0.06 px off, right and down.
    pub fn of_instant(instant_idx: usize, n_instants: usize) -> Self {
        let from_middle = (2 * instant_idx + 1) as f64 - n_instants as f64;
        let spread = |step: f64| {
            let shift = 0.5 + (0.5 * from_middle.abs() * step).fract() * from_middle.signum();
            std::array::from_fn(|i| {
                camera::offset_px((i as f64 + shift.rem_euclid(1.0)) / POINTS_PER_SIDE as f64)
                    as f32
            })
        };
        Self { x_px: spread(0.754_877_666), y_px: spread(0.569_840_291) }
    }

    /// The points, as offsets from the pixel's centre.
    pub fn offsets_px(&self) -> impl Iterator<Item = [f32; 2]> {
        self.y_px.iter().flat_map(|&dy| self.x_px.iter().map(move |&dx| [dx, dy]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Rig;

    #[test]
    fn the_ends_of_the_axes_lie_on_the_unit_circle() {
        let camera = Rig::reference().left;
        let center = Point3::new(0.5, 15.0, 1.0);
        let axes_m = [Vector3::new(0.03, 0.0, 0.01), Vector3::new(0.0, 0.02, 0.05)];
        let spot = Spot::from_axes(&camera, &center, axes_m).expect("in view");
        for (axis, expected) in axes_m.iter().zip([(1.0, 0.0), (0.0, 1.0)]) {
            let p = camera.pixel_from_court(&(center + axis)).expect("in view");
            let (u, v) = spot.unit(p.x as f32, p.y as f32);
            assert!((u - expected.0).abs() < 0.01 && (v - expected.1).abs() < 0.01, "{u} {v}");
        }
    }

    #[test]
    fn an_exposure_looks_evenly_around_a_pixel() {
        for n_instants in 4..=16 {
            let mut sum = [0.0; 2];
            for idx in 0..n_instants {
                let [now, then] = [idx, n_instants - 1 - idx].map(|idx| {
                    Points::of_instant(idx, n_instants).offsets_px().collect::<Vec<_>>()
                });
                for ([x, y], [mirrored_x, mirrored_y]) in now.iter().zip(then.iter().rev()) {
                    assert!((x + mirrored_x).abs() < 1e-5 && (y + mirrored_y).abs() < 1e-5);
                    sum = [sum[0] + x, sum[1] + y];
                }
            }
            assert!(sum[0].abs() < 1e-3 && sum[1].abs() < 1e-3, "{sum:?} of {n_instants}");
        }
    }

    #[test]
    fn an_ellipse_seen_edge_on_is_no_spot() {
        let camera = Rig::reference().left;
        let center = Point3::new(0.5, 15.0, 1.0);
        let sight = (center - camera.position_in_court_m).normalize() * 0.03;
        assert!(Spot::from_axes(&camera, &center, [sight, Vector3::z() * 1e-9]).is_none());
    }
}

//! One camera: raw pixel <-> ray in the camera's frame.
//!
//! Pinhole (thesis Eq 1) with OpenCV's distortion, which acts on *ideal* normalised coordinates:
//! `x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)`, likewise y. The thesis' Eq
//! 2-4 print the same terms as if they led from the distorted to the ideal point; they do not. The
//! way back is by iteration, checked by going forth again.

use crate::Error;
use nalgebra::{Matrix2, Matrix2x3, Point3, SMatrix, Vector3};
use shm_layout::MAX_SIDE_PX;

/// A pixel as captured: distorted; (0,0) is the centre of the top-left pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawPixel {
    /// To the right.
    pub x_px: f64,
    /// Downwards.
    pub y_px: f64,
}

/// A pixel of the pair of ideal cameras rectification makes of the real ones: rows agree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RectifiedPixel {
    /// To the right.
    pub x_px: f64,
    /// Downwards.
    pub y_px: f64,
}

/// Optics of one camera. Holding one proves that its numbers are finite and its focal positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    image_px: [u32; 2],
    focal_px: [f64; 2],
    center_px: [f64; 2],
    distortion: [f64; 5],
}

/// Most rounds of the fixed-point iteration; a tennis camera needs about ten.
const UNDISTORT_ROUNDS_MAX: usize = 100;

/// Normalised coordinates must come back this exactly; 1e-9 of a focal length is 1e-6 px.
const UNDISTORT_TOLERANCE: f64 = 1e-9;

/// A candidate this far outside the image is still of it: a blob's centre may overhang its edge.
const MARGIN_PX: f64 = 1.0;

impl Lens {
    /// `field` is what to call this camera in an error (`left`).
    ///
    /// # Errors
    /// [`Error::RigValue`] for an impossible size, focal length or a number that is not finite.
    pub fn new(
        field: &str,
        image_px: [u32; 2],
        focal_px: [f64; 2],
        center_px: [f64; 2],
        distortion: [f64; 5],
    ) -> Result<Self, Error> {
        let refused = |key: &str, got: String, expected| {
            Err(Error::RigValue { field: format!("{field}.{key}"), got, expected })
        };
        if image_px.iter().any(|&side| side == 0 || side > MAX_SIDE_PX) {
            return refused("image_px", format!("{image_px:?}"), "two sizes from 1 to 4096");
        }
        if focal_px.iter().any(|&f| !(f.is_finite() && f > 0.0)) {
            return refused("focal_px", format!("{focal_px:?}"), "two positive numbers");
        }
        if center_px.iter().any(|c| !c.is_finite()) {
            return refused("center_px", format!("{center_px:?}"), "two finite numbers");
        }
        if distortion.iter().any(|k| !k.is_finite()) {
            return refused("distortion", format!("{distortion:?}"), "k1 k2 p1 p2 k3, all finite");
        }
        Ok(Self { image_px, focal_px, center_px, distortion })
    }

    /// Width and height of the image.
    #[must_use]
    pub fn image_px(&self) -> [u32; 2] {
        self.image_px
    }

    /// fx and fy.
    #[must_use]
    pub fn focal_px(&self) -> [f64; 2] {
        self.focal_px
    }

    /// cx and cy.
    #[must_use]
    pub fn center_px(&self) -> [f64; 2] {
        self.center_px
    }

    /// k1, k2, p1, p2, k3.
    #[must_use]
    pub fn distortion(&self) -> [f64; 5] {
        self.distortion
    }

    /// Whether the image holds this pixel, give or take one. False for NaN.
    #[must_use]
    pub fn contains(&self, pixel: RawPixel) -> bool {
        let within = |v: f64, side: u32| (-MARGIN_PX..f64::from(side) + MARGIN_PX).contains(&v);
        within(pixel.x_px, self.image_px[0]) && within(pixel.y_px, self.image_px[1])
    }

    /// The pixel that shows a point of the camera's frame; None behind the camera.
    #[must_use]
    pub fn raw_from_point(&self, point_in_camera: &Point3<f64>) -> Option<RawPixel> {
        if point_in_camera.z <= 0.0 {
            return None;
        }
        let ideal = [point_in_camera.x / point_in_camera.z, point_in_camera.y / point_in_camera.z];
        let [x, y] = self.distorted(ideal);
        Some(RawPixel {
            x_px: self.focal_px[0] * x + self.center_px[0],
            y_px: self.focal_px[1] * y + self.center_px[1],
        })
    }

    /// The pixel of a point and its derivative by the point; None behind the camera.
    #[must_use]
    pub fn raw_and_slope(
        &self,
        point_in_camera: &Point3<f64>,
    ) -> Option<(RawPixel, Matrix2x3<f64>)> {
        let raw = self.raw_from_point(point_in_camera)?;
        let [k1, k2, p1, p2, k3] = self.distortion;
        let (z, x, y) = (
            point_in_camera.z,
            point_in_camera.x / point_in_camera.z,
            point_in_camera.y / point_in_camera.z,
        );
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let by_r2 = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3);
        let mixed = 2.0 * (x * y * by_r2 + p1 * x + p2 * y);
        let distorted = Matrix2::new(
            radial + 2.0 * (x * x * by_r2 + p1 * y) + 6.0 * p2 * x,
            mixed,
            mixed,
            radial + 2.0 * (y * y * by_r2 + p2 * x) + 6.0 * p1 * y,
        );
        let ideal = Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / z;
        let [fx, fy] = self.focal_px;
        Some((raw, Matrix2::new(fx, 0.0, 0.0, fy) * distorted * ideal))
    }

    /// Derivative of the pixel of a point by fx, fy, cx, cy, k1, k2, p1, p2 and k3; None behind the
    /// camera.
    #[must_use]
    pub fn slope_by_optics(&self, point_in_camera: &Point3<f64>) -> Option<SMatrix<f64, 2, 9>> {
        if point_in_camera.z <= 0.0 {
            return None;
        }
        let [x, y] = [point_in_camera.x / point_in_camera.z, point_in_camera.y / point_in_camera.z];
        let [fx, fy] = self.focal_px;
        let [x_d, y_d] = self.distorted([x, y]);
        let r2 = x * x + y * y;
        let [r4, r6] = [r2 * r2, r2 * r2 * r2];
        let (p1, p2) = ([2.0 * x * y, r2 + 2.0 * y * y], [r2 + 2.0 * x * x, 2.0 * x * y]);
        Some(SMatrix::from_rows(&[
            [x_d, 0.0, 1.0, 0.0, fx * x * r2, fx * x * r4, fx * p1[0], fx * p2[0], fx * x * r6]
                .into(),
            [0.0, y_d, 0.0, 1.0, fy * y * r2, fy * y * r4, fy * p1[1], fy * p2[1], fy * y * r6]
                .into(),
        ]))
    }

    /// fx, fy, cx, cy, k1, k2, p1, p2, k3, in the order of [`Lens::slope_by_optics`].
    #[must_use]
    pub fn optics(&self) -> [f64; 9] {
        let ([fx, fy], [cx, cy], [k1, k2, p1, p2, k3]) =
            (self.focal_px, self.center_px, self.distortion);
        [fx, fy, cx, cy, k1, k2, p1, p2, k3]
    }

    /// Another lens before the same image.
    ///
    /// # Errors
    /// As [`Lens::new`].
    pub fn with_optics(&self, field: &str, optics: [f64; 9]) -> Result<Self, Error> {
        let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = optics;
        Self::new(field, self.image_px, [fx, fy], [cx, cy], [k1, k2, p1, p2, k3])
    }

    /// The ray a pixel looks along, camera's frame, with z = 1. None where the distortion has no
    /// inverse: far outside of the image it was calibrated on.
    #[must_use]
    pub fn ray_from_raw(&self, pixel: RawPixel) -> Option<Vector3<f64>> {
        let distorted = [
            (pixel.x_px - self.center_px[0]) / self.focal_px[0],
            (pixel.y_px - self.center_px[1]) / self.focal_px[1],
        ];
        let [x, y] = self.ideal(distorted)?;
        Some(Vector3::new(x, y, 1.0))
    }

    fn distorted(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [radial, dx, dy] = self.distortion_terms([x, y]);
        [x * radial + dx, y * radial + dy]
    }

    /// Fixed-point iteration: the terms at the last guess, taken off the distorted point.
    fn ideal(&self, distorted: [f64; 2]) -> Option<[f64; 2]> {
        let mut ideal = distorted;
        for _ in 0..UNDISTORT_ROUNDS_MAX {
            let again = self.distorted(ideal);
            let error = (again[0] - distorted[0]).hypot(again[1] - distorted[1]);
            if error < UNDISTORT_TOLERANCE {
                return Some(ideal);
            }
            let [radial, dx, dy] = self.distortion_terms(ideal);
            ideal = [(distorted[0] - dx) / radial, (distorted[1] - dy) / radial];
        }
        None
    }

    /// The radial factor and the two tangential shifts.
    fn distortion_terms(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        [
            1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)),
            2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    fn lens(distortion: [f64; 5]) -> Lens {
        Lens::new("left", [640, 480], [1240.0, 1235.0], [319.5, 239.5], distortion).unwrap()
    }

    /// From a pinhole to a wide-angle lens.
    const DISTORTIONS: [[f64; 5]; 3] =
        [[0.0; 5], [-0.3, 0.1, 0.001, -0.002, 0.0], [0.2, -0.4, 0.0, 0.003, 0.1]];

    #[test]
    fn projecting_inverts_the_ray() {
        for distortion in DISTORTIONS {
            let lens = lens(distortion);
            for x_px in [0.0, 100.0, 319.5, 639.0] {
                for y_px in [0.0, 239.5, 479.0] {
                    let ray = lens.ray_from_raw(RawPixel { x_px, y_px }).unwrap();
                    let pixel = lens.raw_from_point(&Point3::from(ray * 17.0)).unwrap();
                    let error_px = (pixel.x_px - x_px).hypot(pixel.y_px - y_px);
                    assert!(error_px < 1e-5, "{distortion:?} at {x_px},{y_px}: {error_px} px");
                }
            }
        }
    }

    #[test]
    fn the_slope_is_that_of_differences() {
        for distortion in DISTORTIONS {
            let lens = lens(distortion);
            let point = Point3::new(1.3, -0.8, 6.0);
            let (_, slope) = lens.raw_and_slope(&point).unwrap();
            for axis in 0..3 {
                let moved = |step: f64| {
                    let mut moved = point;
                    moved[axis] += step;
                    let RawPixel { x_px, y_px } = lens.raw_from_point(&moved).unwrap();
                    Vector2::new(x_px, y_px)
                };
                let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!((difference - slope.column(axis)).norm() < 1e-4, "{axis}");
            }
        }
    }

    #[test]
    fn the_slope_by_optics_is_that_of_differences() {
        for distortion in DISTORTIONS {
            let lens = lens(distortion);
            let point = Point3::new(1.3, -0.8, 6.0);
            let slope = lens.slope_by_optics(&point).unwrap();
            for i in 0..9 {
                let moved = |step: f64| {
                    let mut optics = lens.optics();
                    optics[i] += step;
                    let lens = lens.with_optics("left", optics).unwrap();
                    let RawPixel { x_px, y_px } = lens.raw_from_point(&point).unwrap();
                    Vector2::new(x_px, y_px)
                };
                let difference = (moved(1e-4) - moved(-1e-4)) / 2e-4;
                assert!((difference - slope.column(i)).norm() < 1e-6, "{i}");
            }
        }
    }

    #[test]
    fn distortion_acts_on_the_ideal_point() {
        // k1 < 0 is a barrel: the corner moves towards the centre, by k1 r² of its distance.
        let lens = lens([-0.1, 0.0, 0.0, 0.0, 0.0]);
        let pixel = lens.raw_from_point(&Point3::new(0.2, 0.0, 1.0)).unwrap();
        assert!((pixel.x_px - (319.5 + 1240.0 * 0.2 * (1.0 - 0.1 * 0.04))).abs() < 1e-9);
    }

    #[test]
    fn a_distortion_without_inverse_has_no_ray() {
        let lens = lens([-30.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(lens.ray_from_raw(RawPixel { x_px: 0.0, y_px: 0.0 }).is_none());
    }

    #[test]
    fn what_is_behind_the_camera_is_not_seen() {
        assert!(lens([0.0; 5]).raw_from_point(&Point3::new(0.0, 0.0, -1.0)).is_none());
        assert!(!lens([0.0; 5]).contains(RawPixel { x_px: f64::NAN, y_px: 1.0 }));
    }
}

//! Rectification of *points*: raw pixel -> the pixel of an ideal camera whose rows agree with those
//! of its partner (thesis 2.4, Bouguet; Eq 8).
//!
//! Two real cameras -> two ideal ones at the same optical centres, looking the same way:
//! 1. the rotation between the cameras is split in halves, each turns half way;
//! 2. `R_rect` turns both so that the line between the centres is their x axis. Its rows are
//!    `e1 = T/|T|` (here from left to right, so that disparity is positive), `e2 = z × e1`, i.e.
//!    orthogonal to e1 within the image plane, and `e3 = e1 × e2`. (The thesis has e3 "orthogonal
//!    to the two epipoles e1 and e2".)
//! 3. both get the same focal length, the mean of the real ones, and the same centre.
//!
//! Then `disparity = x_left − x_right = f B / Z`.

use crate::world::camera::{RawPixel, RectifiedPixel};
use crate::world::rig::Rig;
use nalgebra::{IsometryMatrix3, Matrix3, Point3, Rotation3, Translation3, Vector3};
use shm_layout::Camera;

/// The pair of ideal cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct Rectification {
    /// Focal length of both.
    pub focal_px: f64,
    /// Image centre of both.
    pub center_px: [f64; 2],
    /// Distance of the optical centres.
    pub baseline_m: f64,
    /// Pose of the left ideal camera in the tracking frame.
    pub tracking_from_rectified: IsometryMatrix3<f64>,
    /// Rotation from each real camera's frame to the ideal ones' (they share it).
    rectified_from_camera: [Rotation3<f64>; 2],
    rig: Rig,
}

impl Rectification {
    /// Of a rig, whose checks make every step below possible.
    #[must_use]
    pub fn from_rig(rig: &Rig) -> Self {
        let right_from_left = rig.right_from_left();
        let half = right_from_left.rotation.powf(0.5);
        let right_in_left = right_from_left.inverse().translation.vector;
        let right_in_half = half * right_in_left;
        let e1 = right_in_half.normalize();
        let e2 = Vector3::z().cross(&e1).normalize();
        let e3 = e1.cross(&e2);
        let rows = Matrix3::from_rows(&[e1.transpose(), e2.transpose(), e3.transpose()]);
        let rectified_from_half = Rotation3::from_matrix_unchecked(rows);
        let rectified_from_left = rectified_from_half * half;
        let rectified_from_right = rectified_from_half * half.inverse();
        let lenses = Camera::BOTH.map(|camera| rig.eye(camera).lens);
        let mean_of = |values: [[f64; 2]; 2]| values.iter().flatten().sum::<f64>() / 4.0;
        let [left_center, right_center] = lenses.map(|lens| lens.center_px());
        let left_from_rectified =
            IsometryMatrix3::from_parts(Translation3::identity(), rectified_from_left.inverse());
        Self {
            focal_px: mean_of(lenses.map(|lens| lens.focal_px())),
            center_px: [0, 1].map(|axis| (left_center[axis] + right_center[axis]) / 2.0),
            baseline_m: right_in_left.norm(),
            tracking_from_rectified: rig.tracking_from(Camera::Left) * left_from_rectified,
            rectified_from_camera: [rectified_from_left, rectified_from_right],
            rig: rig.clone(),
        }
    }

    /// Undistorts and rectifies one pixel; None where the lens model or the ideal image ends.
    #[must_use]
    pub fn rectified_from_raw(&self, camera: Camera, pixel: RawPixel) -> Option<RectifiedPixel> {
        let ray_in_camera = self.rig.eye(camera).lens.ray_from_raw(pixel)?;
        let ray = self.rectified_from_camera[camera.idx()] * ray_in_camera;
        (ray.z > 0.0).then(|| RectifiedPixel {
            x_px: self.focal_px * ray.x / ray.z + self.center_px[0],
            y_px: self.focal_px * ray.y / ray.z + self.center_px[1],
        })
    }

    /// Tracking frame from the rectified left camera's.
    #[must_use]
    pub fn point_in_tracking(&self, point_in_rectified: &Point3<f64>) -> Point3<f64> {
        self.tracking_from_rectified * point_in_rectified
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;
    use crate::world::rig::Mounting;

    /// The reference rig with lenses that distort, one camera turned, moved and rolled.
    fn crooked_rig() -> Rig {
        let rig = pretend::reference_rig();
        let mut lines: Vec<&str> = pretend::REFERENCE_RIG.lines().collect();
        for line in lines.iter_mut().filter(|line| line.starts_with("distortion")) {
            *line = "distortion = [-0.2, 0.1, 0.001, -0.002, 0.0]";
        }
        let distorted: Rig = lines.join("\n").parse().unwrap();
        let turn = Rotation3::from_euler_angles(-0.02, 0.01, 0.03);
        let shift = Translation3::new(0.1, -0.3, 0.2);
        let mounting = Mounting::Court {
            court_from_left: rig.tracking_from(Camera::Left)
                * IsometryMatrix3::from_parts(shift, turn),
            court_from_right: rig.tracking_from(Camera::Right),
        };
        let eyes = Camera::BOTH.map(|camera| *distorted.eye(camera));
        Rig::new(eyes, mounting, rig.ball(), None).unwrap()
    }

    #[test]
    fn rectified_rows_agree_and_disparity_is_positive() {
        for rig in [pretend::reference_rig(), crooked_rig()] {
            let rectification = Rectification::from_rig(&rig);
            for x in [-4.0, 0.0, 3.0] {
                for y in [8.0, 15.0, 25.0] {
                    for z in [0.0, 1.0, 2.5] {
                        let point = Point3::new(x, y, z);
                        let [left, right] = Camera::BOTH.map(|camera| {
                            let raw = rig.raw_from_tracking(camera, &point).unwrap();
                            rectification.rectified_from_raw(camera, raw).unwrap()
                        });
                        assert!((left.y_px - right.y_px).abs() < 1e-4, "{left:?} {right:?}");
                        assert!(left.x_px > right.x_px);
                        let in_rectified = rectification.tracking_from_rectified.inverse() * point;
                        let disparity_px =
                            rectification.focal_px * rectification.baseline_m / in_rectified.z;
                        assert!((left.x_px - right.x_px - disparity_px).abs() < 1e-3);
                    }
                }
            }
        }
    }
}

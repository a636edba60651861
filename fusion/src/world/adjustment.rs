//! A rig changed by small numbers, fifteen for each camera, and how sure these are.
//!
//! In this order: fx, fy, cx, cy (px), k1, k2, p1, p2, k3; a turn about the camera's x, y and z
//! (rad); a shift of its optical centre along x, y, z (m, in the tracking frame).
//!
//! A turn ω is about the camera's own axes: `tracking_from_camera · exp(ω)`. Positive about x looks
//! up, about y looks right, about z rolls clockwise as seen through it. Where the rig knows no
//! court the left camera is the frame of reference and only the right one has a pose to change.

use crate::Error;
use crate::world::camera::RawPixel;
use crate::world::rig::{Mounting, Rig};
use nalgebra::{
    IsometryMatrix3, Point3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3,
};
use shm_layout::Camera;

/// Numbers of a lens.
pub const OPTICS: usize = 9;

/// Numbers of a pose.
pub const POSE: usize = 6;

/// Numbers of one camera: its lens, then its pose.
pub const CAMERA: usize = OPTICS + POSE;

/// Numbers of both cameras: left, then right.
pub const RIG: usize = 2 * CAMERA;

/// A change of one camera.
pub type CameraStep = SVector<f64, CAMERA>;

/// A change of a rig.
pub type RigStep = SVector<f64, RIG>;

/// Covariance of a rig's numbers. Those that were taken as given have zeros.
pub type RigCovariance = SMatrix<f64, RIG, RIG>;

/// What each number of a camera is called, with its unit.
pub const NAMES: [&str; CAMERA] = [
    "fx_px",
    "fy_px",
    "cx_px",
    "cy_px",
    "k1",
    "k2",
    "p1",
    "p2",
    "k3",
    "turn_x_rad",
    "turn_y_rad",
    "turn_z_rad",
    "center_x_m",
    "center_y_m",
    "center_z_m",
];

/// The name of a rig's number: `left.fx_px`.
#[must_use]
pub fn name_of(i: usize) -> String {
    let camera = Camera::BOTH[i / CAMERA];
    format!("{camera}.{}", NAMES[i % CAMERA])
}

/// Where the numbers of a camera begin in those of a rig.
#[must_use]
pub fn first_of(camera: Camera) -> usize {
    camera.idx() * CAMERA
}

/// A pose after a turn and a shift.
#[must_use]
pub fn moved(pose: &IsometryMatrix3<f64>, step: &[f64; POSE]) -> IsometryMatrix3<f64> {
    let [a, b, c, x, y, z] = *step;
    let mut rotation = pose.rotation * Rotation3::new(Vector3::new(a, b, c));
    rotation.renormalize();
    let centre = pose.translation.vector + Vector3::new(x, y, z);
    IsometryMatrix3::from_parts(Translation3::from(centre), rotation)
}

/// The turn and shift that lead from one pose to another: the inverse of [`moved`].
#[must_use]
pub fn step_between(from: &IsometryMatrix3<f64>, to: &IsometryMatrix3<f64>) -> [f64; POSE] {
    // By a quaternion: the angle of a matrix is an arc cosine, which loses half of the digits.
    let turn = from.rotation.inverse() * to.rotation;
    let turn = UnitQuaternion::from_rotation_matrix(&turn).scaled_axis();
    let shift = to.translation.vector - from.translation.vector;
    [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z]
}

/// Derivative of a point in the camera's frame by turn and shift of the camera; the point itself
/// stays where it is.
#[must_use]
pub fn slope_of_point(
    pose: &IsometryMatrix3<f64>,
    point_in_camera: &Point3<f64>,
) -> SMatrix<f64, 3, POSE> {
    let mut slope = SMatrix::<f64, 3, POSE>::zeros();
    slope.fixed_columns_mut::<3>(0).copy_from(&point_in_camera.coords.cross_matrix());
    slope.fixed_columns_mut::<3>(3).copy_from(&-pose.rotation.matrix().transpose());
    slope
}

/// The right camera's pose in the left one's frame.
#[must_use]
pub fn relation(rig: &Rig) -> IsometryMatrix3<f64> {
    rig.right_from_left().inverse()
}

/// Derivative of a step of [`relation`] by a step of the rig.
#[must_use]
pub fn relation_by_rig(rig: &Rig) -> SMatrix<f64, POSE, RIG> {
    let left_from_right = relation(rig);
    let (turn, shift) = (left_from_right.rotation.matrix(), left_from_right.translation.vector);
    let mut slope = SMatrix::<f64, POSE, RIG>::zeros();
    let right = first_of(Camera::Right) + OPTICS;
    slope.fixed_view_mut::<3, 3>(0, right).fill_with_identity();
    if matches!(rig.mounting(), Mounting::Stereo { .. }) {
        // The left camera is the frame of reference.
        slope.fixed_view_mut::<3, 3>(3, right + 3).fill_with_identity();
        return slope;
    }
    let left_from_court = rig.tracking_from(Camera::Left).rotation.matrix().transpose();
    slope.fixed_view_mut::<3, 3>(3, right + 3).copy_from(&left_from_court);
    let left = first_of(Camera::Left) + OPTICS;
    slope.fixed_view_mut::<3, 3>(0, left).copy_from(&-turn.transpose());
    slope.fixed_view_mut::<3, 3>(3, left).copy_from(&shift.cross_matrix());
    slope.fixed_view_mut::<3, 3>(3, left + 3).copy_from(&-left_from_court);
    slope
}

impl Rig {
    /// The step that leads from this rig to another: the inverse of [`Rig::adjusted`].
    #[must_use]
    pub fn step_to(&self, other: &Self) -> RigStep {
        let mut step = RigStep::zeros();
        for camera in Camera::BOTH {
            let first = first_of(camera);
            let [from, to] = [self, other].map(|rig| rig.eye(camera).lens.optics());
            for (i, (from, to)) in from.iter().zip(to).enumerate() {
                step[first + i] = to - from;
            }
            let pose = step_between(&self.tracking_from(camera), &other.tracking_from(camera));
            step.fixed_rows_mut::<POSE>(first + OPTICS).copy_from_slice(&pose);
        }
        step
    }

    /// The rig after a step; where it knows no court, a step of the left pose is left out.
    ///
    /// # Errors
    /// [`Error::RigValue`] if no rig can be so.
    pub fn adjusted(&self, step: &RigStep) -> Result<Self, Error> {
        let mut eyes = Camera::BOTH.map(|camera| *self.eye(camera));
        for camera in Camera::BOTH {
            let lens = &mut eyes[camera.idx()].lens;
            let mut optics = lens.optics();
            for (i, value) in optics.iter_mut().enumerate() {
                *value += step[first_of(camera) + i];
            }
            *lens = lens.with_optics(camera.name(), optics)?;
        }
        let pose_after = |camera| {
            let step: [f64; POSE] =
                step.fixed_rows::<POSE>(first_of(camera) + OPTICS).into_owned().into();
            moved(&self.tracking_from(camera), &step)
        };
        let mounting = match self.mounting() {
            Mounting::Court { .. } => Mounting::Court {
                court_from_left: pose_after(Camera::Left),
                court_from_right: pose_after(Camera::Right),
            },
            Mounting::Stereo { .. } => {
                Mounting::Stereo { right_from_left: pose_after(Camera::Right).inverse() }
            }
        };
        self.with_cameras(eyes, mounting)
    }

    /// The raw pixel of `camera` that shows a point, and its derivative by the camera's numbers;
    /// None behind it.
    #[must_use]
    pub fn raw_and_slope_by_camera(
        &self,
        camera: Camera,
        point_in_tracking: &Point3<f64>,
    ) -> Option<(RawPixel, SMatrix<f64, 2, CAMERA>)> {
        let pose = self.tracking_from(camera);
        let point_in_camera = pose.inverse() * point_in_tracking;
        let lens = &self.eye(camera).lens;
        let (raw, by_point) = lens.raw_and_slope(&point_in_camera)?;
        let mut slope = SMatrix::<f64, 2, CAMERA>::zeros();
        slope.fixed_columns_mut::<OPTICS>(0).copy_from(&lens.slope_by_optics(&point_in_camera)?);
        let by_pose = by_point * slope_of_point(&pose, &point_in_camera);
        slope.fixed_columns_mut::<POSE>(OPTICS).copy_from(&by_pose);
        Some((raw, slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;
    use nalgebra::Vector2;

    #[test]
    fn the_slope_is_that_of_differences() {
        let bent = pretend::REFERENCE_RIG
            .replace("0.0, 0.0, 0.0, 0.0, 0.0", "-0.2, 0.1, 1e-3, -1e-3, 0.0");
        for rig in [bent.parse::<Rig>().unwrap(), pretend::courtless_rig()] {
            let point = match rig.mounting() {
                Mounting::Court { .. } => Point3::new(0.7, 15.0, 0.4),
                Mounting::Stereo { .. } => Point3::new(0.7, 0.4, 15.0),
            };
            let (_, slope) = rig.raw_and_slope_by_camera(Camera::Right, &point).unwrap();
            for i in 0..CAMERA {
                let raw_after = |size: f64| {
                    let mut step = RigStep::zeros();
                    step[first_of(Camera::Right) + i] = size;
                    let rig = rig.adjusted(&step).unwrap();
                    let raw = rig.raw_from_tracking(Camera::Right, &point).unwrap();
                    Vector2::new(raw.x_px, raw.y_px)
                };
                let difference = (raw_after(1e-5) - raw_after(-1e-5)) / 2e-5;
                assert!((difference - slope.column(i)).norm() < 1e-4, "{}", NAMES[i]);
            }
        }
    }

    #[test]
    fn a_turn_goes_where_its_sign_says() {
        let pose = pretend::reference_rig().tracking_from(Camera::Left);
        let ahead = pose * Point3::new(0.0, 0.0, 10.0);
        let seen = |step| moved(&pose, &step).inverse() * ahead;
        assert!(seen([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]).y > 0.05, "looking up, all goes down");
        assert!(seen([0.0, 0.01, 0.0, 0.0, 0.0, 0.0]).x < -0.05, "looking right, all goes left");
    }

    #[test]
    fn the_step_between_two_poses_leads_from_one_to_the_other() {
        let pose = pretend::reference_rig().tracking_from(Camera::Left);
        let step = [0.01, -0.02, 0.03, 0.1, -0.2, 0.3];
        let back = step_between(&pose, &moved(&pose, &step));
        assert!(back.iter().zip(step).all(|(back, step)| (back - step).abs() < 1e-12));
    }

    #[test]
    fn the_relation_changes_as_its_slope_says() {
        for rig in [pretend::reference_rig(), pretend::courtless_rig()] {
            let slope = relation_by_rig(&rig);
            for i in 0..RIG {
                let after = |size: f64| {
                    let mut step = RigStep::zeros();
                    step[i] = size;
                    let rig_after = rig.adjusted(&step).unwrap();
                    step_between(&relation(&rig), &relation(&rig_after))
                };
                let (plus, minus) = (after(1e-5), after(-1e-5));
                for k in 0..POSE {
                    let difference = (plus[k] - minus[k]) / 2e-5;
                    assert!((difference - slope[(k, i)]).abs() < 1e-6, "{k} by {i}");
                }
            }
        }
    }

    #[test]
    fn the_step_to_another_rig_leads_there() {
        let rig = pretend::reference_rig();
        let step = RigStep::from_fn(|i, _| 1e-3 * (i as f64 - 14.0));
        let there = rig.adjusted(&step).unwrap();
        assert!((rig.step_to(&there) - step).amax() < 1e-12);
    }

    #[test]
    fn an_impossible_step_is_refused() {
        let mut step = RigStep::zeros();
        step[0] = -2000.0;
        assert!(pretend::reference_rig().adjusted(&step).is_err());
    }
}

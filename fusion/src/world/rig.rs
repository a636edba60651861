//! The rig: two cameras, how they stand to each other and, if known, in the court.
//!
//! `rig.toml` text <-> [`Rig`]. A `Rig` was checked: rotations are rotations, the cameras stand
//! side by side and apart, left is left. The file's form is in `rig_toml`; the checks are here.
//!
//! Convention: `x_cam = R (X − C)`, `C` the optical centre; `court_from_left` holds `Rᵀ` and `C`.
//! The thesis' Eq 5 says the same with `T` for `C`, yet its text reverses the sign of `T`, its Eq 7
//! is derived for `R X + T`, and its program computed `R (p + T)` for the way back. Here
//! `[stereo]` alone follows Eq 7's (OpenCV's) form, `x_right = R x_left + T`, as the file must.

use crate::Error;
use crate::world::adjustment::{RIG, RigCovariance};
use crate::world::air;
use crate::world::ball::{Ball, GRAVITY_M_S2, Physics, SPIN_SIGMA_M_S2};
use crate::world::camera::{Lens, RawPixel};
use nalgebra::{IsometryMatrix3, Matrix2x3, Matrix3, Point3, Rotation3, Translation3, Vector3};
use shm_layout::Camera;

/// One camera apart from where it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    /// Its optics.
    pub lens: Lens,
    /// Rolling shutter: time from one row to the next; 0 for a global shutter.
    pub row_time_us: f64,
    /// How long a row is exposed.
    pub exposure_us: f64,
}

/// Where the cameras stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mounting {
    /// Both poses in the court are known.
    Court {
        /// Rotation: columns are the left camera's axes; translation: its optical centre.
        court_from_left: IsometryMatrix3<f64>,
        /// The same of the right camera.
        court_from_right: IsometryMatrix3<f64>,
    },
    /// Only the cameras' relation is known: `x_right = R x_left + T`.
    Stereo {
        /// OpenCV's R and T.
        right_from_left: IsometryMatrix3<f64>,
    },
}

/// Two calibrated cameras. Holding one proves the checks of [`Rig::new`].
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    eyes: [Eye; 2],
    mounting: Mounting,
    ball: Ball,
    launcher_in_court_m: Option<Point3<f64>>,
    covariance: Option<Box<RigCovariance>>,
    /// See [`Rig::scale`].
    scale: f64,
}

/// Closer than this the pair measures no depth: 1 px of disparity is 10 m at 4 m distance.
const BASELINE_MIN_M: f64 = 0.01;

/// Rounding a file may bring to a rotation: four decimals. It is then made exact.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Below this a rotation is left as it is, so that printing and parsing are inverses.
const ROTATION_EXACT: f64 = 1e-9;

/// Least cosine between "to the right of the left camera" and the way to the right camera.
const SIDEWAYS_MIN: f64 = 0.5;

impl Rig {
    /// # Errors
    /// [`Error::RigValue`] if the cameras coincide, do not stand side by side with left on the
    /// left, or a time, ball or launcher is impossible.
    pub fn new(
        eyes: [Eye; 2],
        mounting: Mounting,
        ball: Ball,
        launcher_in_court_m: Option<Point3<f64>>,
    ) -> Result<Self, Error> {
        let covariance = None;
        let rig = Self { eyes, mounting, ball, launcher_in_court_m, covariance, scale: 1.0 };
        rig.check_eyes()?;
        rig.check_stand()?;
        for (key, value) in [("diameter_m", ball.diameter_m), ("mass_kg", ball.mass_kg)] {
            if !(value > 0.0 && value < 1.0) {
                return Err(refused(&format!("ball.{key}"), value, "between 0 and 1"));
            }
        }
        match launcher_in_court_m {
            Some(launcher) if launcher.iter().any(|v| !v.is_finite()) => Err(refused(
                "launcher.position_in_court_m",
                launcher,
                "three finite numbers in metres",
            )),
            _ => Ok(rig),
        }
    }

    fn check_eyes(&self) -> Result<(), Error> {
        for camera in Camera::BOTH {
            let eye = self.eye(camera);
            for (key, value) in [("row_time_us", eye.row_time_us), ("exposure_us", eye.exposure_us)]
            {
                if !(0.0..1e6).contains(&value) {
                    let field = format!("{camera}.{key}");
                    return Err(refused(&field, value, "0 to 1000000 microseconds"));
                }
            }
        }
        Ok(())
    }

    fn check_stand(&self) -> Result<(), Error> {
        let field = match self.mounting {
            Mounting::Court { .. } => "right.position_in_court_m",
            Mounting::Stereo { .. } => "stereo.translation_m",
        };
        let right_in_left = self.right_from_left().inverse().translation.vector;
        let baseline_m = right_in_left.norm();
        if baseline_m.is_nan() || baseline_m < BASELINE_MIN_M {
            let got = format!("{baseline_m} m from the left camera");
            return Err(refused(field, got, "cameras at least 0.01 m apart"));
        }
        if right_in_left.x < SIDEWAYS_MIN * baseline_m {
            let [x, y, z] = right_in_left.into();
            let got = format!("[{x:.3}, {y:.3}, {z:.3}] m in the left camera's frame");
            return Err(refused(field, got, "a right camera to the right of the left one"));
        }
        Ok(())
    }

    /// One camera apart from where it stands.
    #[must_use]
    pub fn eye(&self, camera: Camera) -> &Eye {
        &self.eyes[camera.idx()]
    }

    /// Where the cameras stand, as the file said it.
    #[must_use]
    pub fn mounting(&self) -> &Mounting {
        &self.mounting
    }

    /// The ball in play.
    #[must_use]
    pub fn ball(&self) -> Ball {
        self.ball
    }

    /// Where the machine lets go of the ball, known to a few centimetres.
    #[must_use]
    pub fn launcher_in_court_m(&self) -> Option<Point3<f64>> {
        self.launcher_in_court_m
    }

    /// Pose of the left camera; None if the rig does not know the court.
    #[must_use]
    pub fn court_from_left(&self) -> Option<IsometryMatrix3<f64>> {
        match self.mounting {
            Mounting::Court { court_from_left, .. } => Some(court_from_left),
            Mounting::Stereo { .. } => None,
        }
    }

    /// `x_right = R x_left + T`; from two poses `R = R_r R_lᵀ` and `T = R_r (C_l − C_r)`, which is
    /// what the thesis' Eq 6 and 7 mean.
    #[must_use]
    pub fn right_from_left(&self) -> IsometryMatrix3<f64> {
        match self.mounting {
            Mounting::Court { court_from_left, court_from_right } => {
                court_from_right.inverse() * court_from_left
            }
            Mounting::Stereo { right_from_left } => right_from_left,
        }
    }

    /// Pose of a camera in the tracking frame: the court if it is known, else the left camera.
    #[must_use]
    pub fn tracking_from(&self, camera: Camera) -> IsometryMatrix3<f64> {
        match (self.mounting, camera) {
            (Mounting::Court { court_from_left, .. }, Camera::Left) => court_from_left,
            (Mounting::Court { court_from_right, .. }, Camera::Right) => court_from_right,
            (Mounting::Stereo { .. }, Camera::Left) => IsometryMatrix3::identity(),
            (Mounting::Stereo { right_from_left }, Camera::Right) => right_from_left.inverse(),
        }
    }

    /// The raw pixel of `camera` that shows a point; None behind it.
    #[must_use]
    pub fn raw_from_tracking(
        &self,
        camera: Camera,
        point_in_tracking: &Point3<f64>,
    ) -> Option<RawPixel> {
        let point_in_camera = self.tracking_from(camera).inverse() * point_in_tracking;
        self.eye(camera).lens.raw_from_point(&point_in_camera)
    }

    /// The same with its derivative by the point.
    #[must_use]
    pub fn raw_and_slope(
        &self,
        camera: Camera,
        point_in_tracking: &Point3<f64>,
    ) -> Option<(RawPixel, Matrix2x3<f64>)> {
        let camera_from_tracking = self.tracking_from(camera).inverse();
        let point_in_camera = camera_from_tracking * point_in_tracking;
        let (raw, slope) = self.eye(camera).lens.raw_and_slope(&point_in_camera)?;
        Some((raw, slope * camera_from_tracking.rotation.matrix()))
    }

    /// How sure the cameras' numbers are; None if nobody said.
    #[must_use]
    pub fn covariance(&self) -> Option<&RigCovariance> {
        self.covariance.as_deref()
    }

    /// The same rig, with how sure its numbers are.
    ///
    /// # Errors
    /// [`Error::RigValue`] if a variance is negative or anything is not finite.
    pub fn with_covariance(self, covariance: RigCovariance) -> Result<Self, Error> {
        let is_covariance =
            covariance.iter().all(|v| v.is_finite()) && (0..RIG).all(|i| covariance[(i, i)] >= 0.0);
        if !is_covariance {
            let got = "with a negative variance or a number that is not finite";
            return Err(refused("calibration.covariance", got, "a covariance"));
        }
        Ok(Self { covariance: Some(Box::new(covariance)), ..self })
    }

    /// The same cameras, ball and launcher with the cameras elsewhere; how sure that is, nobody
    /// said.
    ///
    /// # Errors
    /// As [`Rig::new`].
    pub fn with_mounting(&self, mounting: Mounting) -> Result<Self, Error> {
        self.with_cameras(self.eyes, mounting)
    }

    /// The same ball, launcher and model with other cameras; how sure that is, nobody said.
    pub(crate) fn with_cameras(&self, eyes: [Eye; 2], mounting: Mounting) -> Result<Self, Error> {
        Self::new(eyes, mounting, self.ball, self.launcher_in_court_m)?.with_scale(self.scale)
    }

    /// Of a model of a court: its length over a court's. All other lengths, here and in what is
    /// measured, are those of the court it stands for; times are as they are, so what falls does so
    /// `1 / scale` times as fast.
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// The same rig over a model of a court.
    ///
    /// # Errors
    /// [`Error::RigValue`] if the scale is not 0.01 to 1.
    pub fn with_scale(self, scale: f64) -> Result<Self, Error> {
        if !(0.01..=1.0).contains(&scale) {
            return Err(refused("model.scale", scale, "0.01 to 1"));
        }
        Ok(Self { scale, ..self })
    }

    /// What bends a flight in the tracking frame; without a court no gravity is assumed.
    #[must_use]
    pub fn physics(&self) -> Physics {
        let (gravity_m_s2, unknown_m_s2) = match self.mounting {
            Mounting::Court { .. } => {
                (Vector3::new(0.0, 0.0, -GRAVITY_M_S2 / self.scale), SPIN_SIGMA_M_S2)
            }
            Mounting::Stereo { .. } => (Vector3::zeros(), SPIN_SIGMA_M_S2 + GRAVITY_M_S2),
        };
        Physics {
            ball: self.ball,
            air_density_kg_m3: air::DENSITY_KG_M3,
            gravity_m_s2,
            excess_per_m: [0.0; 3],
            unknown_m_s2,
        }
    }
}

/// A pose or stereo transform from a matrix and a vector of a file.
///
/// # Errors
/// [`Error::RigValue`] if the matrix is not a rotation (a mirror has determinant −1) or anything is
/// not finite.
pub fn isometry_from(
    rotation_field: &str,
    rows: [[f64; 3]; 3],
    translation_field: &str,
    translation_m: [f64; 3],
) -> Result<IsometryMatrix3<f64>, Error> {
    if translation_m.iter().any(|v| !v.is_finite()) {
        let got = format!("{translation_m:?}");
        return Err(refused(translation_field, got, "three finite numbers in metres"));
    }
    let matrix = Matrix3::from_fn(|row, column| rows[row][column]);
    let expected = "a rotation: orthonormal rows, determinant +1";
    let error = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    // amax passes over NaN
    if rows.iter().flatten().any(|v| !v.is_finite()) || error > ROTATION_TOLERANCE {
        let got = format!("{rows:?} (rows off by {error:.1e})");
        return Err(refused(rotation_field, got, expected));
    }
    if matrix.determinant() < 0.0 {
        return Err(refused(rotation_field, "a mirror (determinant -1)", expected));
    }
    let rotation = if error > ROTATION_EXACT {
        Rotation3::from_matrix(&matrix)
    } else {
        Rotation3::from_matrix_unchecked(matrix)
    };
    let translation = Translation3::from(Vector3::from(translation_m));
    Ok(IsometryMatrix3::from_parts(translation, rotation))
}

fn refused(field: &str, got: impl std::fmt::Display, expected: &'static str) -> Error {
    Error::RigValue { field: field.to_owned(), got: got.to_string(), expected }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;

    /// Camera of the thesis: `height_m` up, tilted `tilt_rad` down, looking along +y.
    fn court_from_tilted(height_m: f64, tilt_rad: f64) -> IsometryMatrix3<f64> {
        let (sin, cos) = tilt_rad.sin_cos();
        let rows = [[1.0, 0.0, 0.0], [0.0, -sin, cos], [0.0, -cos, -sin]];
        isometry_from("R", rows, "C", [0.0, 0.0, height_m]).unwrap()
    }

    #[test]
    fn a_model_keeps_its_scale_when_its_cameras_move() {
        let text = format!("{}\n[model]\nscale = 0.1\n", pretend::REFERENCE_RIG);
        let rig: Rig = text.parse().unwrap();
        let moved = rig.with_mounting(*rig.mounting()).unwrap();
        let adjusted = moved.adjusted(&crate::world::adjustment::RigStep::zeros()).unwrap();
        assert_eq!(adjusted.to_string().parse::<Rig>().unwrap().scale(), 0.1);
        let error = text.replace("0.1\n", "10\n").parse::<Rig>().unwrap_err().to_string();
        assert!(error.contains("model.scale") && error.contains("0.01 to 1"), "{error}");
    }

    #[test]
    fn the_order_that_cost_the_thesis_61_cm_costs_nothing_here() {
        let (height_m, tilt_rad) = (3.5, 10_f64.to_radians());
        let court_from_camera = court_from_tilted(height_m, tilt_rad);
        let truth_in_court = Point3::new(0.02, 21.68, 0.033);
        // What the camera sees, written out: the offset from C, along its three axes.
        let (sin, cos) = tilt_rad.sin_cos();
        let offset = truth_in_court - Point3::new(0.0, 0.0, height_m);
        let in_camera = Point3::new(
            offset.x,
            -sin * offset.y - cos * offset.z,
            cos * offset.y - sin * offset.z,
        );

        let in_court = court_from_camera * in_camera;
        assert!((in_court - truth_in_court).norm() < 1e-12, "right order: no bias");

        // The thesis: axes renamed (x right, y forward, z up), then R (p + T) for R p + T.
        let renamed = Vector3::new(in_camera.x, in_camera.z, -in_camera.y);
        let tilt = Rotation3::from_axis_angle(&Vector3::x_axis(), -tilt_rad);
        let thesis = tilt * (renamed + Vector3::new(0.0, 0.0, height_m));
        let bias = thesis - truth_in_court.coords;
        assert!((bias - Vector3::new(0.0, 0.6078, -0.0532)).norm() < 1e-4, "{bias}");
    }

    #[test]
    fn the_right_camera_is_four_metres_to_the_right() {
        let rig = pretend::reference_rig();
        let right_in_left = rig.right_from_left().inverse() * Point3::origin();
        assert!((right_in_left.coords.norm() - 4.0).abs() < 1e-12);
        assert!(right_in_left.x > 3.9);
        let in_court = rig.tracking_from(Camera::Left) * right_in_left;
        assert!((in_court - Point3::new(2.0, 0.0, 3.5)).norm() < 1e-12);
    }

    #[test]
    fn a_rounded_rotation_is_made_exact() {
        let rows = [[0.9945, -0.0182, 0.1029], [-0.1045, -0.1727, 0.9794], [0.0, -0.9848, -0.1736]];
        let isometry = isometry_from("R", rows, "C", [0.0; 3]).unwrap();
        let matrix = isometry.rotation.matrix();
        assert!((matrix.transpose() * matrix - Matrix3::identity()).amax() < 1e-12);
    }
}

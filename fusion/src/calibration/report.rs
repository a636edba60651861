//! What a calibration says of itself -> its JSON (`--json FILE`), the same for every method.
//!
//! A field that a method does not know is `null`, never a guess. Also: what the numbers' sigmas
//! mean in metres, far down the court.

use crate::calibration::consequence;
use crate::world::adjustment::{CAMERA, RIG, first_of, name_of, relation, relation_by_rig};
use crate::world::camera::{Lens, RawPixel};
use crate::world::rectification::Rectification;
use crate::world::rig::Rig;
use nalgebra::{Matrix3, Point3, SMatrix, Vector3};
use serde::Serialize;
use shm_layout::Camera;
use std::collections::BTreeMap;

/// The whole report.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Report {
    /// Name of the subcommand.
    pub method: String,
    /// The left camera by itself.
    pub left: Option<CameraReport>,
    /// The right camera by itself.
    pub right: Option<CameraReport>,
    /// Both together.
    pub pair: Option<PairReport>,
    /// 1 sigma of every number that was measured, by its name in `[calibration]` of rig.toml.
    pub sigma: BTreeMap<String, f64>,
    /// The rig.toml; of one camera alone, its table.
    pub rig_toml: String,
}

/// A view that was not used.
#[derive(Debug, Clone, Serialize)]
pub struct Refused {
    /// Its file or number.
    pub view: String,
    /// Why, in words.
    pub reason: String,
}

/// One camera.
#[derive(Debug, Clone, Default, Serialize)]
pub struct CameraReport {
    /// Files or numbers.
    pub views_used: Vec<String>,
    /// The others.
    pub views_refused: Vec<Refused>,
    /// RMS distance of what was seen from what should have been.
    pub rms_px: Option<f64>,
}

/// Both cameras.
#[derive(Debug, Clone, Default, Serialize)]
pub struct PairReport {
    /// Files or numbers.
    pub views_used: Vec<String>,
    /// The others.
    pub views_refused: Vec<Refused>,
    /// RMS distance of what was seen from what should have been.
    pub rms_px: Option<f64>,
    /// RMS difference of rows after rectification.
    pub row_error_rms_px: Option<f64>,
    /// Distance of the optical centres.
    pub baseline_m: f64,
    /// Its 1 sigma.
    pub baseline_sigma_m: Option<f64>,
    /// 1 sigma of a point 24 m ahead of both cameras by the calibration alone: along x, y and z of
    /// the court, or of the left camera where no court is known.
    pub far_point_sigma_m: Option<[f64; 3]>,
    /// 1 sigma of a bounce near the far baseline by the calibration alone: across and along the
    /// court.
    pub far_bounce_sigma_m: Option<[f64; 2]>,
}

/// Distance at which a rig without a court says what its sigmas mean: the far baseline.
pub const FAR_M: f64 = 24.0;

impl PairReport {
    /// What a rig says of itself; views and residuals are the method's to add.
    #[must_use]
    pub fn of_rig(rig: &Rig) -> Self {
        let [baseline_m, sigma_m] = baseline_m(rig);
        let far = point_sigma_m(rig, &point_ahead(rig, FAR_M));
        let bounce = rig.covariance().and_then(|c| consequence::at_far_baseline(rig, c));
        Self {
            baseline_m,
            baseline_sigma_m: rig.covariance().map(|_| sigma_m),
            far_point_sigma_m: far.map(Into::into),
            far_bounce_sigma_m: bounce.map(|far| [far.across_m, far.along_m]),
            ..Self::default()
        }
    }
}

/// 1 sigma of every number of a rig that was not taken as given.
#[must_use]
pub fn sigma_by_name(rig: &Rig) -> BTreeMap<String, f64> {
    let Some(covariance) = rig.covariance() else { return BTreeMap::new() };
    let sigma = |i| (name_of(i), f64::sqrt(covariance[(i, i)]));
    (0..RIG).map(sigma).filter(|(_, sigma)| *sigma > 0.0).collect()
}

/// Distance of the optical centres and its 1 sigma, which is 0 if the rig does not say.
#[must_use]
pub fn baseline_m(rig: &Rig) -> [f64; 2] {
    let shift = relation(rig).translation.vector;
    let by_shift = relation_by_rig(rig).fixed_rows::<3>(3).into_owned();
    let by_rig = shift.normalize().transpose() * by_shift;
    let variance = rig.covariance().map_or(0.0, |c| (by_rig * c * by_rig.transpose())[(0, 0)]);
    [shift.norm(), variance.max(0.0).sqrt()]
}

/// RMS difference of the rows in which the two cameras see the same points, after rectification;
/// points outside of what a lens is known for do not count.
#[must_use]
pub fn row_error_rms_px(rig: &Rig, points: impl Iterator<Item = [RawPixel; 2]>) -> f64 {
    let rectification = Rectification::from_rig(rig);
    let row = |camera, pixel| rectification.rectified_from_raw(camera, pixel).map(|p| p.y_px);
    let (mut n, mut squares) = (0.0, 0.0);
    for [left, right] in points {
        if let (Some(l), Some(r)) = (row(Camera::Left, left), row(Camera::Right, right)) {
            squares += (l - r) * (l - r);
            n += 1.0;
        }
    }
    (squares / f64::max(n, 1.0)).sqrt()
}

/// 1 sigma of a point's place along x, y and z of the tracking frame, as far as the rig's numbers
/// are to blame: both cameras see it exactly, and the rays are off. None without covariance, or if
/// a camera does not see that way.
#[must_use]
pub fn point_sigma_m(rig: &Rig, point_in_tracking: &Point3<f64>) -> Option<Vector3<f64>> {
    let covariance = rig.covariance()?;
    // Least squares of four coordinates: N δX = −Σ Jᵀ (∂px/∂rig) δrig.
    let mut normal = Matrix3::zeros();
    let mut pull = SMatrix::<f64, 3, RIG>::zeros();
    for camera in Camera::BOTH {
        let (_, by_point) = rig.raw_and_slope(camera, point_in_tracking)?;
        let (_, by_rig) = rig.raw_and_slope_by_camera(camera, point_in_tracking)?;
        normal += by_point.transpose() * by_point;
        let mut columns = pull.fixed_columns_mut::<CAMERA>(first_of(camera));
        columns += by_point.transpose() * by_rig;
    }
    let response = -normal.try_inverse()? * pull;
    let of_point = response * covariance * response.transpose();
    Some(of_point.diagonal().map(|variance| variance.max(0.0).sqrt()))
}

/// A point so far ahead of both cameras: where their axes meet, as well as they do.
#[must_use]
pub fn point_ahead(rig: &Rig, distance_m: f64) -> Point3<f64> {
    let poses = Camera::BOTH.map(|camera| rig.tracking_from(camera));
    let middle = nalgebra::center(&(poses[0] * Point3::origin()), &(poses[1] * Point3::origin()));
    let ahead: Vector3<f64> = poses.iter().map(|pose| pose * Vector3::z()).sum();
    middle + ahead.normalize() * distance_m
}

/// The table of one camera, as in a rig.toml, with its sigmas as comments.
#[must_use]
pub fn camera_toml(camera: Camera, lens: &Lens, sigma: &[f64; 9]) -> String {
    let sigmas = |range: std::ops::Range<usize>| {
        let all: Vec<String> = sigma[range].iter().map(|s| format!("{s:.2e}")).collect();
        format!("  # sigma {}", all.join(", "))
    };
    format!(
        "[{camera}]\nimage_px            = {:?}\nfocal_px            = {:?}{}\n\
         center_px           = {:?}{}\ndistortion          = {:?}{}\n",
        lens.image_px(),
        lens.focal_px(),
        sigmas(0..2),
        lens.center_px(),
        sigmas(2..4),
        lens.distortion(),
        sigmas(4..9),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;
    use crate::world::adjustment::RigCovariance;

    #[test]
    fn a_yaw_of_one_camera_moves_the_far_point_by_what_geometry_says() {
        let rig = pretend::courtless_rig();
        let point = Point3::new(2.0, 0.0, 24.0);
        let mut covariance = RigCovariance::zeros();
        let yaw = first_of(Camera::Right) + 10;
        covariance[(yaw, yaw)] = 1e-3_f64.powi(2);
        let baseline_m = rig.right_from_left().inverse().translation.vector.norm();
        let rig = rig.with_covariance(covariance).unwrap();
        let sigma_m = point_sigma_m(&rig, &point).unwrap();
        // δZ = Z² / B δyaw, for cameras that look straight ahead; these look a bit inwards.
        let expected_m = 24.0 * 24.0 / baseline_m * 1e-3;
        assert!((sigma_m.z / expected_m - 1.0).abs() < 0.1, "{sigma_m} {expected_m}");
        assert_eq!(sigma_by_name(&rig).keys().collect::<Vec<_>>(), ["right.turn_y_rad"]);
    }
}

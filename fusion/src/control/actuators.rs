//! What is told -> what comes of it: four settings, and what is known of the machine and the air,
//! to the [causes](crate::causes) of the flight that should follow; and the way back.
//!
//! Each actuator has an offset and a gain: a wheel that runs 2 % fast, and 1 % more for every
//! 10 m/s. Beside these eight numbers stand drag and wind, which all balls of a session share.
//! Linear in what is known, so that a ball's evidence is one line of a Kalman filter.

use crate::aim::Scatter;
use crate::causes::{Cause, CauseColumn, CauseMatrix, N_CAUSES};
use crate::world::ball::DRAG_COEFFICIENT;
use nalgebra::{Point3, SMatrix, SVector, Vector4};

/// How many numbers are learned.
pub const N_KNOWN: usize = 11;

/// Offset and gain of speed (parts of it), elevation (rad), azimuth (rad), backspin (rad/s), in
/// this order; drag coefficient; wind x and y (m/s).
pub type Known = SVector<f64, N_KNOWN>;

/// Their covariance.
pub type KnownMatrix = SMatrix<f64, N_KNOWN, N_KNOWN>;

/// How the causes of a flight depend on what is known.
pub type Design = SMatrix<f64, N_CAUSES, N_KNOWN>;

/// Where the offsets of speed, elevation, azimuth and backspin stand; each gain follows.
pub const OFFSETS: [usize; 4] = [0, 2, 4, 6];
/// Where the drag coefficient stands.
pub const DRAG: usize = 8;
/// Where the wind's x stands; y follows.
pub const WIND: usize = 9;

/// Settings where gains count nothing, and how far from there they count once.
const CENTRE: [f64; 4] = [22.0, 0.2, 0.0, 0.0];
const SPAN: [f64; 4] = [10.0, 0.175, 0.175, 100.0];

/// 1 sigma before any ball: of machines in use, the balls of one basket and a day's wind.
const PRIOR_SIGMA: [f64; N_KNOWN] =
    [0.04, 0.01, 0.02, 0.006, 0.016, 0.006, 8.0, 12.0, 0.04, 2.0, 2.0];

/// By how much each may change from one ball to the next, 1 sigma: wear, warmth, felt, weather.
const DRIFT_SIGMA: [f64; N_KNOWN] =
    [7e-4, 1e-4, 1e-4, 2e-5, 1e-4, 2e-5, 0.4, 0.2, 8e-4, 0.02, 0.02];

/// 1 sigma from ball to ball of what the machine's own scatter does not say.
/// Spin: what a motor does at rest, and the scatter of lift from ball to ball (Cross & Lindsey
/// 2014: 10 %).
const SPIN_SIGMA_RAD_S: f64 = 5.0;
const LIFT_SCATTER: f64 = 0.1;
/// Two wheels in one plane give none, nor any along the launch.
const SIDESPIN_SIGMA_RAD_S: f64 = 5.0;
/// Balls of one basket (new ones: 0.024, Cross & Lindsey).
const BALL_DRAG_SIGMA: f64 = 0.02;
/// A gust.
const GUST_SIGMA_M_S: f64 = 0.5;
/// Where the machine lets go of the ball: "known to a few centimetres".
const RELEASE_SIGMA_M: f64 = 0.02;

/// The settings' order, as of [`crate::aim`].
const AXES: usize = 4;

fn leverage(axis: usize, setting: f64) -> f64 {
    (setting - CENTRE[axis]) / SPAN[axis]
}

/// What is known before any ball.
#[must_use]
pub fn prior() -> (Known, KnownMatrix) {
    let mut mean = Known::zeros();
    mean[DRAG] = DRAG_COEFFICIENT;
    (mean, squares(&PRIOR_SIGMA))
}

/// Covariance that a ball's time adds.
#[must_use]
pub fn drift() -> KnownMatrix {
    squares(&DRIFT_SIGMA)
}

fn squares(sigmas: &[f64; N_KNOWN]) -> KnownMatrix {
    KnownMatrix::from_diagonal(&Known::from(sigmas.map(|sigma| sigma * sigma)))
}

/// How the causes depend on what is known, at these settings.
#[must_use]
pub fn design(settings: &Vector4<f64>) -> Design {
    let mut design = Design::zeros();
    for axis in 0..AXES {
        let unit = if axis == Cause::Speed.idx() { settings[axis] } else { 1.0 };
        design[(axis, OFFSETS[axis])] = unit;
        design[(axis, OFFSETS[axis] + 1)] = unit * leverage(axis, settings[axis]);
    }
    for (cause, known) in [(Cause::Drag, DRAG), (Cause::WindX, WIND), (Cause::WindY, WIND + 1)] {
        design[(cause.idx(), known)] = 1.0;
    }
    design
}

/// The causes of what a perfect machine would do without any air.
#[must_use]
pub fn told(settings: &Vector4<f64>, launcher_in_court_m: Point3<f64>) -> CauseColumn {
    let mut causes = CauseColumn::zeros();
    causes.fixed_rows_mut::<AXES>(0).copy_from(settings);
    causes[Cause::ReleaseX.idx()] = launcher_in_court_m.x;
    causes[Cause::ReleaseZ.idx()] = launcher_in_court_m.z;
    causes
}

/// What should come of settings.
#[must_use]
pub fn expected(
    settings: &Vector4<f64>,
    known: &Known,
    launcher_in_court_m: Point3<f64>,
) -> CauseColumn {
    told(settings, launcher_in_court_m) + design(settings) * known
}

/// The settings that make a launch: the way back. A gain is a few hundredths, so a few rounds do.
#[must_use]
pub fn settings_for(launch: &Vector4<f64>, known: &Known) -> Vector4<f64> {
    let mut settings = *launch;
    for _ in 0..20 {
        let made = design(&settings) * known;
        settings = launch - made.fixed_rows::<AXES>(0);
    }
    settings
}

/// Covariance from ball to ball around what is expected of these settings.
#[must_use]
pub fn scatter(settings: &Vector4<f64>, machine: &Scatter) -> CauseMatrix {
    let spin = settings[Cause::Backspin.idx()];
    let mut sigmas = CauseColumn::zeros();
    for (cause, sigma) in [
        (Cause::Speed, machine.speed_part * settings[Cause::Speed.idx()]),
        (Cause::Elevation, machine.elevation_rad),
        (Cause::Azimuth, machine.azimuth_rad),
        (Cause::Backspin, SPIN_SIGMA_RAD_S.hypot(spin * machine.spin_part.hypot(LIFT_SCATTER))),
        (Cause::Sidespin, SIDESPIN_SIGMA_RAD_S),
        (Cause::Gyrospin, SIDESPIN_SIGMA_RAD_S),
        (Cause::Drag, BALL_DRAG_SIGMA),
        (Cause::WindX, GUST_SIGMA_M_S),
        (Cause::WindY, GUST_SIGMA_M_S),
        (Cause::ReleaseX, RELEASE_SIGMA_M),
        (Cause::ReleaseZ, RELEASE_SIGMA_M),
    ] {
        sigmas[cause.idx()] = sigma;
    }
    CauseMatrix::from_diagonal(&sigmas.component_mul(&sigmas))
}

/// Wind and drag forget in a pause, the machine does not: after half an hour a tenth is left of
/// what was known of them.
pub fn forget(pause_s: f64, mean: &mut Known, covariance: &mut KnownMatrix) {
    const FORGETS_IN_S: f64 = 780.0;
    let left = (-pause_s.max(0.0) / FORGETS_IN_S).exp();
    let (prior_mean, prior) = prior();
    let mut keep = KnownMatrix::identity();
    for i in DRAG..N_KNOWN {
        keep[(i, i)] = left;
        mean[i] = prior_mean[i] + (mean[i] - prior_mean[i]) * left;
    }
    *covariance = keep * *covariance * keep;
    for i in DRAG..N_KNOWN {
        covariance[(i, i)] += prior[(i, i)] * (1.0 - left * left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_for_a_launch_make_it() {
        let known =
            Known::from([0.05, -0.02, 0.026, 0.01, -0.017, 0.01, 9.0, -14.0, 0.5, 1.0, -2.0]);
        for launch in [[24.0, 0.15, 0.1, 150.0], [12.0, 0.8, -0.17, -250.0]] {
            let launch = Vector4::from(launch);
            let settings = settings_for(&launch, &known);
            let made = expected(&settings, &known, Point3::new(0.0, 0.0, 1.0));
            assert!((made.fixed_rows::<4>(0) - launch).amax() < 1e-6, "{made}");
        }
    }

    #[test]
    fn a_pause_forgets_the_air_and_nothing_else() {
        let (mut mean, mut covariance) = (Known::repeat(0.7), KnownMatrix::identity() * 1e-6);
        forget(1e6, &mut mean, &mut covariance);
        let (prior_mean, prior) = prior();
        for i in 0..N_KNOWN {
            let is_air = i >= DRAG;
            assert!((mean[i] - if is_air { prior_mean[i] } else { 0.7 }).abs() < 1e-9);
            let variance = if is_air { prior[(i, i)] } else { 1e-6 };
            assert!((covariance[(i, i)] - variance).abs() < 1e-9);
        }
    }
}

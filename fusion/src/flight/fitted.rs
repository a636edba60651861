//! What a fit is given besides sightings ([`Scene`]), and what it gives ([`Fitted`]): unknowns,
//! their covariance and the flight, and where each camera should have seen the ball.

use crate::flight::model::{Model, Row};
use crate::flight::unknowns::{CLOCK, Covariance, N, Unknowns};
use crate::motion::seconds_between;
use crate::rectified::Sighting;
use crate::world::ball::Physics;
use crate::world::rig::Rig;
use nalgebra::{DMatrix, DVector, Matrix2x3, Point3, SMatrix, Vector2};
use shm_layout::{Camera, StampNs};

/// What is not fitted.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// The cameras.
    pub rig: &'a Rig,
    /// Gravity, air, the ball.
    pub physics: &'a Physics,
    /// Where the flight begins, if it is known to begin at the launcher.
    pub launcher_m: Option<Point3<f64>>,
    /// Whether the sightings go on after a bounce.
    pub has_bounce: bool,
    /// How far before the first and after the last sighting the flight is followed.
    pub reach_s: [f64; 2],
    /// 1 sigma of each of the ways in which all centres may be off together.
    pub bias_sigma_px: f64,
}

/// A fitted flight.
#[derive(Clone)]
pub struct Fitted {
    /// Time 0 of the model, left clock.
    pub reference_ns: StampNs,
    /// The most likely values.
    pub unknowns: Unknowns,
    /// Their covariance.
    pub covariance: Covariance,
    /// The flight.
    pub model: Model,
    /// Each camera's noise as a multiple of its own sigmas.
    pub noise: [f64; 2],
}

impl Fitted {
    /// Time of a sighting on the model's clock.
    #[must_use]
    pub fn time_s(&self, sighting: &Sighting) -> f64 {
        time_s(sighting, self.reference_ns, &self.unknowns)
    }

    /// Right clock less left clock, and 1 sigma.
    #[must_use]
    pub fn clock_s(&self) -> [f64; 2] {
        [self.unknowns.clock_s, self.covariance[(CLOCK, CLOCK)].sqrt()]
    }

    /// Where a sighting's camera should have seen the ball at its time, the derivative of that by
    /// all unknowns, and how far off the sighting is; None if the ball is behind the camera.
    #[must_use]
    pub fn seen(
        &self,
        sighting: &Sighting,
        rig: &Rig,
    ) -> Option<(SMatrix<f64, 2, N>, Vector2<f64>)> {
        slope_and_off(sighting, self.time_s(sighting), &self.model, rig)
    }

    /// How fast the ball crosses a camera's image at a sighting's time.
    #[must_use]
    pub fn speed_px_s(&self, sighting: &Sighting, rig: &Rig) -> Option<f64> {
        let ball = self.model.place_at(self.time_s(sighting));
        let (_, by_point) = rig.raw_and_slope(sighting.camera, &ball.position_m)?;
        Some((by_point * ball.velocity_m_s).norm())
    }

    /// Mahalanobis distance of a sighting, in sigmas of its own noise and of the fit together.
    #[must_use]
    pub fn distance(&self, sighting: &Sighting, rig: &Rig) -> Option<f64> {
        let (slope, off) = self.seen(sighting, rig)?;
        let noise = self.noise[sighting.camera.idx()];
        let covariance = sighting.total_px2(noise) + slope * self.covariance * slope.transpose();
        Some(off.dot(&(covariance.try_inverse()? * off)).sqrt())
    }

    /// Squared Mahalanobis distance of some sightings together, in sigmas of their own noise and of
    /// the fit, whose doubt they share.
    #[must_use]
    pub fn square_of_all(&self, sightings: &[Sighting], rig: &Rig) -> Option<f64> {
        let mut slopes = DMatrix::zeros(2 * sightings.len(), N);
        let mut offs_px = DVector::zeros(2 * sightings.len());
        let mut noise_px2 = DMatrix::zeros(offs_px.len(), offs_px.len());
        for (i, sighting) in sightings.iter().enumerate() {
            let (slope, off_px) = self.seen(sighting, rig)?;
            let noise = self.noise[sighting.camera.idx()];
            slopes.fixed_view_mut::<2, N>(2 * i, 0).copy_from(&slope);
            offs_px.fixed_rows_mut::<2>(2 * i).copy_from(&off_px);
            noise_px2.fixed_view_mut::<2, 2>(2 * i, 2 * i).copy_from(&sighting.total_px2(noise));
        }
        let covariance_px2 = &slopes * self.covariance * slopes.transpose() + noise_px2;
        Some(offs_px.dot(&covariance_px2.cholesky()?.solve(&offs_px)))
    }
}

/// Time of a sighting with these unknowns, from the reference time on the left clock.
#[must_use]
pub fn time_s(sighting: &Sighting, reference_ns: StampNs, unknowns: &Unknowns) -> f64 {
    let on_its_clock_s = seconds_between(reference_ns, sighting.t_ns);
    match sighting.camera {
        Camera::Left => on_its_clock_s,
        Camera::Right => on_its_clock_s - unknowns.clock_s,
    }
}

/// Derivative of the ball's pixel by all unknowns, and pixel expected less pixel seen.
#[must_use]
pub fn slope_and_off(
    sighting: &Sighting,
    time_s: f64,
    model: &Model,
    rig: &Rig,
) -> Option<(SMatrix<f64, 2, N>, Vector2<f64>)> {
    let ball = model.place_at(time_s);
    let (raw, by_point): (_, Matrix2x3<f64>) =
        rig.raw_and_slope(sighting.camera, &ball.position_m)?;
    let mut slope = by_point * ball.d_position;
    if sighting.camera == Camera::Right {
        let mut by_clock = slope.fixed_columns_mut::<1>(CLOCK);
        by_clock -= by_point * ball.velocity_m_s;
    }
    let off = Vector2::new(raw.x_px - sighting.raw.x_px, raw.y_px - sighting.raw.y_px);
    Some((slope, off))
}

/// One row of derivatives, as a number's 1 sigma.
#[must_use]
pub fn sigma_of(row: &Row, covariance: &Covariance) -> f64 {
    (row * covariance * row.transpose())[(0, 0)].max(0.0).sqrt()
}

//! Path -> flight: what happened, from the launcher through the bounce, with covariance.
//!
//! In this order: [`unknowns`] (what is fitted, and what is known of it beforehand), [`model`]
//! (where the ball is with these unknowns, with derivatives), [`noise`] (what residuals are worth),
//! [`fit`] (the most likely unknowns). [`Flight`] asks the fitted model for what people want to
//! know; each answer's covariance is that of the unknowns through its own derivative.

pub mod fit;
pub mod fitted;
pub mod model;
pub mod noise;
pub mod solved;
pub mod unknowns;

use crate::motion::{later_ns, seconds_between};
use crate::path::Path;
use crate::rectified::Sighting;
use crate::world::rig::Rig;
use fitted::{Fitted, sigma_of};
use model::Instant;
use nalgebra::{Matrix2, Matrix3, SMatrix, Vector3};
use shm_layout::StampNs;
use unknowns::{CLOCK, N, SPIN, spin_axes};

/// Scatter of lift from ball to ball, as a part of it (Cross & Lindsey 2014: 10-15 %): how well a
/// spin is known from the lift it makes.
const LIFT_SCATTER: f64 = 0.1;

/// A fitted flight.
#[derive(Clone)]
pub struct Flight {
    fitted: Fitted,
    sightings: Vec<Sighting>,
    has_bounce: bool,
}

impl Flight {
    /// Of a path; None without a court.
    #[must_use]
    pub fn from_path(path: &Path) -> Option<Self> {
        let Path { sightings, has_bounce, .. } = path.clone();
        Some(Self { fitted: path.fitted.clone()?, sightings, has_bounce })
    }

    /// Whether it was seen after a bounce.
    #[must_use]
    pub fn has_bounce(&self) -> bool {
        self.has_bounce
    }

    /// The sightings it was fitted to, in order of time.
    #[must_use]
    pub fn sightings(&self) -> &[Sighting] {
        &self.sightings
    }

    /// The sightings before the bounce.
    #[must_use]
    pub fn before(&self) -> &[Sighting] {
        let n = self.sightings.partition_point(|s| !self.fitted.model.is_after(self.time_s(s)));
        &self.sightings[..n]
    }

    fn time_s(&self, sighting: &Sighting) -> f64 {
        self.fitted.time_s(sighting)
    }

    /// The ball at a sighting's time.
    #[must_use]
    pub fn at(&self, sighting: &Sighting) -> Instant {
        self.fitted.model.at(self.time_s(sighting))
    }

    /// Where the ball comes down, whether or not that was seen.
    #[must_use]
    pub fn touch(&self) -> Option<Instant> {
        self.fitted.model.touch().copied()
    }

    /// When the ball passes a plane before its bounce, upwards of its axis, from some time before
    /// the first sighting on.
    #[must_use]
    pub fn passing(&self, axis: usize, level_m: f64, before_s: f64) -> Option<Instant> {
        let first_s = self.time_s(self.sightings.first()?);
        self.fitted.model.passing(axis, level_m, first_s - before_s)
    }

    /// Time of an instant.
    #[must_use]
    pub fn t_ns(&self, instant: &Instant) -> StampNs {
        later_ns(self.fitted.reference_ns, instant.t_s)
    }

    /// 1 sigma of the time of an instant that is known by what happens.
    #[must_use]
    pub fn time_sigma_s(&self, instant: &Instant) -> f64 {
        sigma_of(&instant.d_t, &self.fitted.covariance)
    }

    /// Covariance of the position at an instant.
    #[must_use]
    pub fn position_covariance_m2(&self, instant: &Instant) -> Matrix3<f64> {
        let d = &instant.d_position;
        d * self.fitted.covariance * d.transpose()
    }

    /// Covariance of x and y where the ball touches the ground.
    #[must_use]
    pub fn touch_covariance_m2(&self, touch: &Instant) -> Matrix2<f64> {
        let d = touch.d_position.fixed_rows::<2>(0);
        d * self.fitted.covariance * d.transpose()
    }

    /// Covariance of the velocity at an instant.
    #[must_use]
    pub fn velocity_covariance(&self, instant: &Instant) -> Matrix3<f64> {
        let d = &instant.d_velocity;
        d * self.fitted.covariance * d.transpose()
    }

    /// Velocity just after the bounce and its covariance; None if nothing was seen after it.
    #[must_use]
    pub fn out_m_s(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let covariance =
            self.fitted.covariance.fixed_view::<3, 3>(unknowns::OUT, unknowns::OUT).into_owned();
        self.has_bounce.then_some((self.fitted.unknowns.out_m_s, covariance))
    }

    /// Backspin (topspin is negative) at an instant, and 1 sigma, rad/s.
    #[must_use]
    pub fn backspin_rad_s(&self, instant: &Instant) -> [f64; 2] {
        let right = spin_axes(&instant.velocity_m_s).column(1).into_owned();
        let spin = self.fitted.model.spin_at(instant.t_s).dot(&right);
        let covariance = self.fitted.covariance.fixed_view::<3, 3>(SPIN, SPIN).into_owned();
        let variance = right.dot(&(covariance * right));
        [spin, (variance + (LIFT_SCATTER * spin).powi(2)).sqrt()]
    }

    /// Right clock less left clock, and 1 sigma, seconds.
    #[must_use]
    pub fn clock_s(&self) -> [f64; 2] {
        let variance = self.fitted.covariance[(CLOCK, CLOCK)];
        [self.fitted.unknowns.clock_s, variance.sqrt()]
    }

    /// Middle of the sightings, left clock.
    #[must_use]
    pub fn reference_ns(&self) -> StampNs {
        self.fitted.reference_ns
    }

    /// RMS distance (both axes) of each camera's sightings from the flight; None for a camera that
    /// saw nothing.
    #[must_use]
    pub fn residual_px(&self, rig: &Rig) -> [Option<f64>; 2] {
        let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
        for sighting in &self.sightings {
            let Some((_, off)) = self.fitted.seen(sighting, rig) else { continue };
            sums[sighting.camera.idx()] += off.norm_squared();
            counts[sighting.camera.idx()] += 1.0;
        }
        [0, 1].map(|i| (counts[i] > 0.0).then(|| (sums[i] / counts[i]).sqrt()))
    }

    /// Seconds from the first to the last sighting before the bounce.
    #[must_use]
    pub fn seen_for_s(&self) -> f64 {
        match self.before() {
            [first, .., last] => seconds_between(first.t_ns, last.t_ns),
            _ => 0.0,
        }
    }

    /// 1 sigma of a number whose derivative by all unknowns is known.
    #[must_use]
    pub fn sigma(&self, row: &SMatrix<f64, 1, N>) -> f64 {
        sigma_of(row, &self.fitted.covariance)
    }
}

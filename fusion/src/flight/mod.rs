//! Path -> flight: what happened, from the launcher through the bounce, with covariance.
//!
//! In this order: [`unknowns`] (what is fitted, and what is known of it beforehand), [`model`]
//! (where the ball is with these unknowns, with derivatives), [`noise`] (what residuals are worth),
//! [`fit`] (the most likely unknowns), [`evidence`] (what it says of the rig). [`Flight`] asks the
//! fitted model for what people want to know; each answer's covariance is that of the unknowns
//! through its own derivative.

pub mod evidence;
pub mod fit;
pub mod fitted;
pub mod model;
pub mod noise;
pub mod unknowns;

use crate::causes::{self, Causes};
use crate::launch;
use crate::motion::{later_ns, seconds_between};
use crate::path::Path;
use crate::rectified::Sighting;
use crate::world::rig::Rig;
use fitted::{Fitted, sigma_of};
use model::Instant;
use nalgebra::{Matrix2, Matrix3, Vector3};
use shm_layout::StampNs;
use unknowns::{SPIN, spin_axes};

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
        let Path { fitted, sightings, has_bounce, .. } = path;
        let (fitted, sightings) = (fitted.clone()?, sightings.clone());
        Some(Self { fitted, sightings, has_bounce: *has_bounce })
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

    /// What it says of its launch and the air; None if the rig does not say where the launcher is,
    /// or the flight does not come from there.
    #[must_use]
    pub fn causes(&self, rig: &Rig) -> Option<Causes> {
        let launch = launch::instant(self, rig.launcher_in_court_m()?)?;
        causes::from_fitted(&self.fitted, &launch)
    }

    /// Right clock less left clock, and 1 sigma, seconds.
    #[must_use]
    pub fn clock_s(&self) -> [f64; 2] {
        self.fitted.clock_s()
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
}

#[cfg(test)]
mod tests {
    use crate::motion::{azimuth_elevation_rad, seconds_between};
    use crate::pretend::{self, Frames, GOOD_SIGHT, Serve, Truth};
    use crate::shot::Bounce;
    use crate::world::rig::Rig;
    use crate::{Outcome, Settings, Shot};
    use nalgebra::{Matrix2, Vector2};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const CLOCK_AHEAD_NS: i64 = 3_000_000;

    /// A serve without lift, which pretend's ball has as a constant and the fit as a law of spin.
    fn played(seed: u64) -> (Serve, Frames, Truth) {
        let random = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 100_000_000);
        let serve = Serve { lift_coefficient: 0.0, ..random };
        let (mut frames, mut truths) = pretend::seen(&[serve], 150, &GOOD_SIGHT, seed);
        pretend::set_right_clock(&mut frames, CLOCK_AHEAD_NS);
        (serve, frames, truths.remove(0))
    }

    fn measured(rig: Rig, frames: &Frames) -> Shot {
        let settings = Settings { sigma_px: 0.1, ..Settings::default() };
        let (fusion, mut shots) = pretend::told(rig, settings, frames);
        assert_eq!(shots.len(), 1, "{:?}", fusion.rejected());
        shots.remove(0)
    }

    /// How far off each number is, in its own sigmas.
    fn offs_of(shot: &Shot, serve: &Serve, truth: &Bounce) -> Vec<(&'static str, f64)> {
        let launch = shot.launch.as_ref().unwrap();
        let (direction, spin) = (launch.direction.unwrap(), launch.spin.unwrap());
        let [azimuth_rad, elevation_rad] = azimuth_elevation_rad(&serve.velocity_m_s());
        let off = |value: f64, truth: f64, sigma: f64| (value - truth) / sigma;
        let speed_m_s = launch.velocity_m_s.norm();
        let mut offs = vec![
            ("launch speed", off(speed_m_s, serve.speed_m_s, launch.speed_sigma_m_s)),
            ("height", off(launch.position_m.z, 1.0, launch.height_sigma_m)),
            (
                "elevation",
                off(direction.elevation_rad, elevation_rad, direction.elevation_sigma_rad),
            ),
            ("azimuth", off(direction.azimuth_rad, azimuth_rad, direction.azimuth_sigma_rad)),
            ("backspin", off(spin.backspin_rad_s, 0.0, spin.sigma_rad_s)),
        ];
        let clock = shot.clock.unwrap();
        offs.push(("clock", off(clock.right_minus_left_s, 3e-3, clock.sigma_s)));
        let bounce = shot.bounce.as_ref().unwrap();
        let covariance = Matrix2::from(bounce.covariance_m2);
        let off_m: Vector2<f64> = (bounce.position_m - truth.position_m).xy();
        let along = off_m.dot(&(covariance.try_inverse().unwrap() * off_m)).sqrt();
        let late_s = seconds_between(truth.t_ns, bounce.t_ns);
        offs.extend([("bounce", along), ("its time", late_s / bounce.t_sigma_s.unwrap())]);
        let [in_sigma, out_sigma] = bounce.velocity_sigma_m_s.unwrap();
        let in_off = (bounce.velocity_in_m_s - truth.velocity_in_m_s).component_div(&in_sigma);
        offs.extend([("in x", in_off.x), ("in y", in_off.y), ("in z", in_off.z)]);
        if let Some(out_m_s) = bounce.velocity_out_m_s {
            let off = (out_m_s - truth.velocity_out_m_s.unwrap()).component_div(&out_sigma);
            offs.extend([("out x", off.x), ("out y", off.y), ("out z", off.z)]);
        }
        offs
    }

    fn sigma_m(shot: &Shot) -> f64 {
        Matrix2::from(shot.bounce.as_ref().unwrap().covariance_m2).trace().sqrt()
    }

    #[test]
    fn every_number_is_within_four_of_its_own_sigmas_and_these_are_small() {
        let (mut n, mut squares) = (0.0, 0.0);
        for seed in 0..12 {
            let (serve, frames, truth) = played(seed);
            let shot = measured(pretend::reference_rig(), &frames);
            assert_eq!(shot.outcome, Outcome::Measured, "seed {seed}");
            let offs = offs_of(&shot, &serve, &truth.bounce);
            println!("seed {seed}: {offs:.1?}");
            for (name, off) in offs {
                // 12 shots of 14 numbers: beyond 4 sigmas is one in 100 times that all are right.
                assert!(off.abs() < 4.0, "seed {seed}: {name} is {off} sigmas off");
                n += 1.0;
                squares += off * off;
            }
            // 0.1 px of 16 mm, over the square root of a hundred, is nothing; 0.03 px of bias and
            // 10 cm of depth a pixel at 20 m are 3 mm, a lever of 5 along a flat flight.
            let launch = shot.launch.as_ref().unwrap();
            assert!(sigma_m(&shot) < 0.03, "{} m", sigma_m(&shot));
            assert!(launch.speed_sigma_m_s < 0.3 && shot.clock.unwrap().sigma_s < 2e-4);
        }
        // 2 would be sigmas that are 1.4 times too small; they may be too large, for they allow
        // for wind, a scatter of lift and a bias that pretend has not.
        assert!(squares / n < 1.5, "mean square {}", squares / n);
    }

    #[test]
    fn a_bounce_that_nobody_saw_is_extrapolated_and_less_sure() {
        for seed in 20..26 {
            let (serve, frames, truth) = played(seed);
            let seen = measured(pretend::reference_rig(), &frames);
            let mut hidden = frames;
            for (_, frame) in &mut hidden {
                if seconds_between(frame.exposed_ns, truth.bounce.t_ns) < 0.15 {
                    frame.spots.clear();
                }
            }
            let shot = measured(pretend::reference_rig(), &hidden);
            assert_eq!(shot.outcome, Outcome::NoBounceSeen, "seed {seed}");
            assert_eq!(shot.bounce.as_ref().unwrap().velocity_out_m_s, None);
            for (name, off) in offs_of(&shot, &serve, &truth.bounce) {
                assert!(off.abs() < 4.0, "seed {seed}: {name} is {off} sigmas off");
            }
            assert!(sigma_m(&shot) > 1.5 * sigma_m(&seen), "{} {}", sigma_m(&shot), sigma_m(&seen));
        }
    }

    #[test]
    fn a_flight_that_misses_the_launcher_the_rig_tells_of_is_fitted_without_it() {
        let wrong = pretend::REFERENCE_RIG.replace(
            "position_in_court_m = [0.0, 0.0, 1.0]",
            "position_in_court_m = [0.0, 0.0, 1.4]",
        );
        let mut mean_m = 0.0;
        for seed in 30..36 {
            let (serve, frames, truth) = played(seed);
            let shot = measured(wrong.parse().unwrap(), &frames);
            assert_eq!(shot.outcome, Outcome::Measured, "seed {seed}");
            for (name, off) in offs_of(&shot, &serve, &truth.bounce) {
                assert!(off.abs() < 4.0, "seed {seed}: {name} is {off} sigmas off");
            }
            mean_m += (shot.launch.unwrap().position_m.z - 1.0) / 6.0;
        }
        // Each is sure to 4 mm, the mean to 1.7. Adopted with 25 mm, the launcher would pull all up
        // by 0.4 m · (4 / 25)², 10 mm.
        assert!(mean_m.abs() < 0.005, "the launcher pulls by {mean_m} m");
    }
}

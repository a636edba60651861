//! What every shot says of the two cameras' clocks -> how far the right one is ahead, at any time.
//!
//! A ball that moves across the images tells when each was taken: one shot to about 0.1 ms. Here
//! that is carried from shot to shot: offset and rate in a Kalman filter of two states. Before the
//! first shot nothing is known but that free-running cameras differ by less than a frame; crystals
//! differ by less than 100 ppm.

use crate::motion::seconds_between;
use nalgebra::{Matrix2, Vector2};
use shm_layout::StampNs;

/// 1 sigma before the first shot: anything up to a frame of 11 ms either way is as likely.
pub const OFFSET_SIGMA_S: f64 = 6.4e-3;

/// 1 sigma of the difference in rate.
const RATE_SIGMA: f64 = 60e-6;

/// How fast the rate itself wanders (temperature), per root second.
const RATE_WALK: f64 = 0.1e-6;

/// A filter is never surer than this: rows, exposures and stamps have errors of their own.
const SIGMA_MIN_S: f64 = 10e-6;

/// Right clock less left clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    at_ns: Option<StampNs>,
    /// Offset (s) and rate.
    state: Vector2<f64>,
    covariance: Matrix2<f64>,
}

impl Default for Clock {
    fn default() -> Self {
        let variances = Vector2::new(OFFSET_SIGMA_S.powi(2), RATE_SIGMA.powi(2));
        Self {
            at_ns: None,
            state: Vector2::zeros(),
            covariance: Matrix2::from_diagonal(&variances),
        }
    }
}

impl Clock {
    /// Offset and its 1 sigma at a time.
    #[must_use]
    pub fn offset_s(&self, t_ns: StampNs) -> [f64; 2] {
        let (state, covariance) = self.advanced(t_ns);
        [state.x, covariance[(0, 0)].sqrt().max(SIGMA_MIN_S)]
    }

    /// Whether a shot has told anything yet.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.at_ns.is_some()
    }

    /// Takes in the offset of a shot that was fitted with [`Clock::offset_s`] as what was known
    /// beforehand, and its 1 sigma. What the shot itself said is what it knows more.
    pub fn update(&mut self, t_ns: StampNs, [offset_s, sigma_s]: [f64; 2]) {
        let [before_s, before_sigma_s] = self.offset_s(t_ns);
        let information = sigma_s.powi(-2) - before_sigma_s.powi(-2);
        if information.is_nan() || information < 1e-3 * before_sigma_s.powi(-2) {
            return;
        }
        let told_s = (offset_s / sigma_s.powi(2) - before_s / before_sigma_s.powi(2)) / information;
        let (state, covariance) = self.advanced(t_ns);
        let gain = covariance.column(0) / (covariance[(0, 0)] + information.recip());
        self.state = state + gain * (told_s - state.x);
        let left = covariance - gain * covariance.row(0);
        self.covariance = (left + left.transpose()) * 0.5;
        self.at_ns = Some(t_ns);
    }

    fn advanced(&self, t_ns: StampNs) -> (Vector2<f64>, Matrix2<f64>) {
        let Some(at_ns) = self.at_ns else { return (self.state, self.covariance) };
        let dt_s = seconds_between(at_ns, t_ns);
        let f = Matrix2::new(1.0, dt_s, 0.0, 1.0);
        let mut covariance = f * self.covariance * f.transpose();
        covariance[(1, 1)] += RATE_WALK.powi(2) * dt_s.abs();
        (f * self.state, covariance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shots_teach_offset_and_rate() {
        let mut clock = Clock::default();
        let truth_s = |t_s: f64| 4e-3 + 80e-6 * t_s;
        for i in 0..40 {
            let t_s = 3.0 * f64::from(i);
            let t_ns = (t_s * 1e9) as StampNs;
            let [before_s, before_sigma_s] = clock.offset_s(t_ns);
            // A shot that knows 0.1 ms by itself, off by up to as much, and what was known before.
            let told_s = truth_s(t_s) + 1e-4 * f64::from(i % 3 - 1);
            let information = [1e-4_f64.powi(-2), before_sigma_s.powi(-2)];
            let sum = information[0] + information[1];
            let offset_s = (told_s * information[0] + before_s * information[1]) / sum;
            clock.update(t_ns, [offset_s, sum.powf(-0.5)]);
        }
        let [offset_s, sigma_s] = clock.offset_s(130_000_000_000);
        assert!((offset_s - truth_s(130.0)).abs() < 3.0 * sigma_s, "{offset_s} {sigma_s}");
        assert!(sigma_s < 1e-4, "{sigma_s}");
    }

    #[test]
    fn a_shot_that_knows_nothing_more_changes_nothing() {
        let mut clock = Clock::default();
        let before = clock.clone();
        clock.update(5, clock.offset_s(5));
        assert_eq!(clock, before);
        assert!(!clock.is_known());
    }
}

//! What stamps and shots say of the two cameras' clocks -> how far the right one is ahead, at any
//! time.
//!
//! A ball that moves across the images tells when each was taken: one shot to about 0.1 ms. Here
//! that is carried from shot to shot.
//!
//! **Clocks of their own** (recordings): offset and rate in a Kalman filter of two states. Before
//! the first shot nothing is known but that free-running cameras differ by less than a frame;
//! crystals differ by less than 100 ppm.
//!
//! **One clock**: both cameras' stamps were translated to this machine's clock, each with a sigma.
//! Then the offset is 0 within both sigmas. What is left of it is how unlike the two ways over the
//! network are, which changes slowly: what a shot tells is forgotten within `WANDER_S`. When the
//! stamps become worse the doubt grows at once by as much.
//!
//! **Stamps that are not as good as they say**: a ball is looked for, and first measured, with a
//! millisecond more doubt ([`Clock::doubted_s`]). If what the shot then says of the clocks is more
//! than `CONTRADICTED_SIGMAS` off, the shot is believed, and from then on the stamps are taken
//! for as bad as they were found.

use crate::motion::seconds_between;
use nalgebra::{Matrix2, Vector2};
use shm_layout::StampNs;
use shm_layout::stamp::OWN_CLOCK;

/// 1 sigma before the first shot: anything up to a frame of 11 ms either way is as likely. Stamps
/// are never taken for worse.
pub const OFFSET_SIGMA_S: f64 = 6.4e-3;

/// 1 sigma of the difference in rate.
const RATE_SIGMA: f64 = 60e-6;

/// How fast the rate itself wanders (temperature), per root second.
const RATE_WALK: f64 = 0.1e-6;

/// A filter is never surer than this: rows, exposures and stamps have errors of their own.
const SIGMA_MIN_S: f64 = 10e-6;

/// Two cameras' stamps on one clock are never taken for better: a board notes them by interrupt.
const COMMON_SIGMA_MIN_S: f64 = 30e-6;

/// How long the unlikeness of two ways over a network stays what it was.
const WANDER_S: f64 = 60.0;

/// Stated sigmas flicker from frame to frame; a smaller change than this is none.
const CHANGE_MIN: f64 = 1.25;

/// What the sigma of one clock is doubted by until the shot itself has been heard.
const DOUBT_S: f64 = 1e-3;

/// Farther off than this a shot and the stamps contradict each other.
const CONTRADICTED_SIGMAS: f64 = 4.0;

/// Right clock less left clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    at_ns: Option<StampNs>,
    /// Offset (s) and rate.
    state: Vector2<f64>,
    covariance: Matrix2<f64>,
    /// 1 sigma of what stamps on one clock are apart; None if each camera has its own.
    stated_s: Option<f64>,
    /// How far apart shots have found stamps that were said to be nearer.
    found_s: f64,
}

impl Default for Clock {
    fn default() -> Self {
        let variances = Vector2::new(OFFSET_SIGMA_S.powi(2), RATE_SIGMA.powi(2));
        Self {
            at_ns: None,
            state: Vector2::zeros(),
            covariance: Matrix2::from_diagonal(&variances),
            stated_s: None,
            found_s: 0.0,
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

    /// The same with the doubt a sigma deserves that somebody else states.
    #[must_use]
    pub fn doubted_s(&self, t_ns: StampNs) -> [f64; 2] {
        let [offset_s, sigma_s] = self.offset_s(t_ns);
        [offset_s, if self.is_common() { sigma_s.hypot(DOUBT_S) } else { sigma_s }]
    }

    /// Whether a shot has told anything yet.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.at_ns.is_some()
    }

    /// Whether both cameras' stamps are on one clock.
    #[must_use]
    pub fn is_common(&self) -> bool {
        self.stated_s.is_some()
    }

    /// Takes note of the sigmas with which both cameras' frames now come.
    pub fn note_stamps(&mut self, t_ns: StampNs, sigmas_ns: [u32; 2]) {
        let stated_s = common_sigma_s(sigmas_ns)
            .map(|sigma_s| sigma_s.max(self.found_s).clamp(COMMON_SIGMA_MIN_S, OFFSET_SIGMA_S));
        let (Some(before_s), Some(now_s)) = (self.stated_s, stated_s) else {
            if let Some(now_s) = stated_s {
                let covariance = Matrix2::new(now_s.powi(2), 0.0, 0.0, 0.0);
                *self = Self { stated_s, covariance, ..Self::default() };
            } else if self.is_common() {
                *self = Self::default();
            }
            return;
        };
        if (CHANGE_MIN.recip()..=CHANGE_MIN).contains(&(now_s / before_s)) {
            return;
        }
        (self.state, self.covariance) = self.advanced(t_ns);
        self.at_ns = self.at_ns.map(|_| t_ns);
        self.stated_s = stated_s;
        let variance_s2 = &mut self.covariance[(0, 0)];
        if now_s > before_s {
            *variance_s2 += now_s.powi(2) - before_s.powi(2);
        } else if *variance_s2 > now_s.powi(2) {
            // The stamps now say more than shots did.
            (self.state.x, *variance_s2) = (0.0, now_s.powi(2));
        }
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

    /// Whether a shot that was fitted with [`Clock::doubted_s`] contradicts what stamps on one
    /// clock say.
    #[must_use]
    pub fn is_contradicted(&self, t_ns: StampNs, [offset_s, sigma_s]: [f64; 2]) -> bool {
        let [expected_s, expected_sigma_s] = self.offset_s(t_ns);
        let apart_s = (offset_s - expected_s).abs();
        self.is_common() && apart_s > CONTRADICTED_SIGMAS * sigma_s.hypot(expected_sigma_s)
    }

    /// Believes a shot that contradicts the stamps, and them no more than it says.
    pub fn contradict(&mut self, t_ns: StampNs, [offset_s, sigma_s]: [f64; 2]) {
        self.found_s = self.found_s.max(offset_s.abs()).min(OFFSET_SIGMA_S);
        self.stated_s = self.stated_s.map(|stated_s| stated_s.max(self.found_s));
        self.state.x = offset_s;
        self.covariance[(0, 0)] = sigma_s.powi(2);
        self.at_ns = Some(t_ns);
    }

    fn advanced(&self, t_ns: StampNs) -> (Vector2<f64>, Matrix2<f64>) {
        let Some(at_ns) = self.at_ns else { return (self.state, self.covariance) };
        let dt_s = seconds_between(at_ns, t_ns);
        if let Some(stated_s) = self.stated_s {
            // Back to what the stamps say, and to their doubt: a process of Ornstein and Uhlenbeck.
            let kept = (-dt_s.abs() / WANDER_S).exp();
            let variance_s2 = self.covariance[(0, 0)] - stated_s.powi(2);
            let mut covariance = self.covariance;
            covariance[(0, 0)] = stated_s.powi(2) + kept * kept * variance_s2;
            return (self.state * kept, covariance);
        }
        let f = Matrix2::new(1.0, dt_s, 0.0, 1.0);
        let mut covariance = f * self.covariance * f.transpose();
        covariance[(1, 1)] += RATE_WALK.powi(2) * dt_s.abs();
        (f * self.state, covariance)
    }
}

/// Both sigmas together; None if a camera's stamps are on a clock of their own.
fn common_sigma_s(sigmas_ns: [u32; 2]) -> Option<f64> {
    let [left_s, right_s] = sigmas_ns.map(|sigma_ns| f64::from(sigma_ns) * 1e-9);
    (!sigmas_ns.contains(&OWN_CLOCK)).then(|| left_s.hypot(right_s))
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

    const US: u32 = 1000;

    /// Both cameras on one clock from the start, each with a sigma.
    fn common(sigma_ns: u32) -> Clock {
        let mut clock = Clock::default();
        clock.note_stamps(0, [sigma_ns; 2]);
        clock
    }

    fn at(t_s: f64) -> StampNs {
        (t_s * 1e9) as StampNs
    }

    #[test]
    fn stamps_on_one_clock_are_apart_by_both_sigmas_and_never_by_nothing() {
        let [offset_s, sigma_s] = common(300 * US).offset_s(at(5.0));
        assert_eq!(offset_s, 0.0);
        assert!((sigma_s - 300e-6 * 2.0_f64.sqrt()).abs() < 1e-12, "{sigma_s}");
        assert_eq!(common(0).offset_s(0), [0.0, COMMON_SIGMA_MIN_S]);
        assert_eq!(common(1_000_000 * US).offset_s(0), [0.0, OFFSET_SIGMA_S]);
        let [_, doubted_s] = common(0).doubted_s(0);
        assert!(doubted_s > DOUBT_S);
    }

    #[test]
    fn stamps_on_a_clock_of_their_own_change_nothing() {
        for sigmas_ns in [[OWN_CLOCK; 2], [OWN_CLOCK, 0], [5, OWN_CLOCK]] {
            let mut clock = Clock::default();
            clock.note_stamps(7, sigmas_ns);
            assert_eq!(clock, Clock::default());
            assert_eq!(clock.doubted_s(9), clock.offset_s(9));
            clock.update(7, [1e-3, 1e-4]);
            let told = clock.clone();
            clock.note_stamps(8, sigmas_ns);
            assert_eq!(clock, told);
        }
    }

    #[test]
    fn what_a_shot_says_of_one_clock_is_forgotten_as_the_network_wanders() {
        let mut clock = common(700 * US);
        let unknown = clock.offset_s(0);
        // 0.1 ms by itself, and what the stamps said.
        let information = 1e-4_f64.powi(-2) + unknown[1].powi(-2);
        clock.update(0, [1e-3 * 1e-4_f64.powi(-2) / information, information.powf(-0.5)]);
        let [soon_s, soon_sigma_s] = clock.offset_s(at(1.0));
        assert!((soon_s - 1e-3).abs() < 1e-4 && soon_sigma_s < 2.1e-4, "{soon_s} {soon_sigma_s}");
        let [late_s, late_sigma_s] = clock.offset_s(at(10.0 * WANDER_S));
        assert!(late_s.abs() < 1e-6 && (late_sigma_s - unknown[1]).abs() < 1e-6);
    }

    #[test]
    fn a_link_that_gets_worse_is_doubted_at_once_and_one_that_gets_better_is_believed() {
        let mut clock = common(100 * US);
        clock.update(0, [1e-4, 5e-5]);
        clock.note_stamps(at(1.0), [2000 * US; 2]);
        let [_, worse_s] = clock.offset_s(at(1.0));
        assert!((2.7e-3..2.9e-3).contains(&worse_s), "{worse_s}");
        clock.note_stamps(at(2.0), [50 * US; 2]);
        let [offset_s, better_s] = clock.offset_s(at(2.0));
        assert_eq!(offset_s, 0.0);
        assert!((better_s - 50e-6 * 2.0_f64.sqrt()).abs() < 1e-9, "{better_s}");
    }

    #[test]
    fn a_sigma_that_flickers_makes_nothing_forgotten() {
        let mut clock = common(500 * US);
        clock.update(0, [4e-4, 1e-4]);
        let mut steady = clock.clone();
        for i in 0..900 {
            clock.note_stamps(at(f64::from(i) / 90.0), [(480 + i % 40) * US; 2]);
        }
        steady.note_stamps(at(10.0), [500 * US; 2]);
        assert_eq!(clock.offset_s(at(10.0)), steady.offset_s(at(10.0)));
    }

    #[test]
    fn a_shot_that_contradicts_the_stamps_is_believed_for_good() {
        let mut clock = common(20 * US);
        assert!(!clock.is_contradicted(0, [3e-4, 1e-4]));
        assert!(clock.is_contradicted(0, [3e-3, 1e-4]));
        clock.contradict(0, [3e-3, 1e-4]);
        for i in 1..90 {
            clock.note_stamps(at(f64::from(i) / 90.0), [20 * US; 2]);
        }
        let [offset_s, sigma_s] = clock.offset_s(at(1.0));
        assert!((offset_s - 3e-3).abs() < 1e-4 && (1e-4..1e-3).contains(&sigma_s));
        let [offset_s, sigma_s] = clock.offset_s(at(1000.0));
        assert!(offset_s.abs() < 1e-6 && (sigma_s - 3e-3).abs() < 1e-6, "{offset_s} {sigma_s}");
        assert!(!Clock::default().is_contradicted(0, [1.0, 1e-4]), "nothing is stated there");
    }
}

//! Truth of a recording that is played in laps → which ball was served when, and what became of it.

use crate::truth::{Flight, Truth};
use anyhow::Context as _;
use capture::stamps;
use shm_layout::{Shot, StampNs};
use std::path::Path;

/// A shot belongs to the ball that bounced within this of it.
const SAME_BOUNCE_S: f64 = 0.25;

/// Squared distance in sigmas that one honest shot in a thousand exceeds: chi-squared with two
/// degrees of freedom.
const ONE_IN_A_THOUSAND: f64 = 13.816;

/// A ball of a lap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct BallKey {
    /// Which lap since the clock's zero.
    pub lap: i64,
    /// Which ball of it.
    pub ball_idx: usize,
}

/// When a ball flew, on this machine's clock.
#[derive(Debug, Clone, Copy)]
pub struct Flown {
    /// Which.
    pub key: BallKey,
    /// When it left the launcher.
    pub launched_ns: StampNs,
    /// When it touched the ground first; `None` for one that met the net or the fence.
    pub bounced_ns: Option<StampNs>,
}

/// How a shot missed the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Miss {
    /// Found minus true, across and along the court, m.
    pub off_m: [f64; 2],
    /// What the shot said of its error, 1 sigma, m.
    pub sigma_m: [f64; 2],
    /// Squared distance in sigmas, of both together.
    pub squared_sigmas: f64,
}

/// What a shot is, held against the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Held {
    /// A ball, within its own 99.9 % ellipse: how far off (m).
    Right(BallKey, f64),
    /// A ball, outside of it.
    Wrong(BallKey, Miss),
    /// A ball whose bounce was not measured, and nothing was said of it.
    WithoutBounce,
    /// No ball bounced then.
    Invented,
}

/// The balls of each lap.
#[derive(Debug, Clone)]
pub struct Served {
    lap_ns: StampNs,
    flights: Vec<Flight>,
}

impl Served {
    /// From the stamps of the recording, which say how long a lap is.
    ///
    /// # Errors
    /// When they cannot be read.
    pub fn new(timestamps: &Path, truth: &Truth) -> anyhow::Result<Self> {
        let stamps_ns = stamps::from_file(timestamps)?;
        let lap_ns = stamps::lap_ns(&stamps_ns).context("a recording of one frame")?;
        Ok(Self { lap_ns, flights: truth.flights.clone() })
    }

    /// Balls whose first bounce is within a window, in their order.
    #[must_use]
    pub fn bounced_within(&self, window_ns: [StampNs; 2]) -> Vec<Flown> {
        let laps = window_ns[0].div_euclid(self.lap_ns)..=window_ns[1].div_euclid(self.lap_ns);
        let flown = laps.flat_map(|lap| {
            (0..self.flights.len()).map(move |ball_idx| self.flown(BallKey { lap, ball_idx }))
        });
        let is_within = |at_ns: StampNs| window_ns[0] <= at_ns && at_ns < window_ns[1];
        flown.filter(|flown| flown.bounced_ns.is_some_and(is_within)).collect()
    }

    /// A ball of a lap.
    #[must_use]
    pub fn flown(&self, key: BallKey) -> Flown {
        let flight = &self.flights[key.ball_idx];
        let at_ns = |at_s: f64| key.lap * self.lap_ns + (at_s * 1e9).round() as StampNs;
        Flown {
            key,
            launched_ns: at_ns(flight.launch.launched_at_s),
            bounced_ns: flight.bounces.first().map(|bounce| at_ns(bounce.bounced_at_s)),
        }
    }

    /// What a shot is.
    #[must_use]
    pub fn held(&self, shot: &Shot) -> Held {
        if shot.is_measured == 0 {
            return Held::WithoutBounce;
        }
        let within_ns = (SAME_BOUNCE_S * 1e9) as StampNs;
        let window_ns = [shot.bounce_ns - within_ns, shot.bounce_ns + within_ns];
        let Some(flown) = self.bounced_within(window_ns).first().copied() else {
            return Held::Invented;
        };
        let truth = self.flights[flown.key.ball_idx].bounces[0].position_in_court_m;
        let off = [0, 1].map(|axis| shot.bounce_in_court_m[axis] - truth[axis]);
        let [[xx, xy], [_, yy]] = shot.bounce_covariance_m2;
        let determinant = xx * yy - xy * xy;
        let squared = (yy * off[0] * off[0] - 2.0 * xy * off[0] * off[1] + xx * off[1] * off[1])
            / determinant;
        // Not a number is no honest ellipse.
        if squared <= ONE_IN_A_THOUSAND {
            return Held::Right(flown.key, off[0].hypot(off[1]));
        }
        let sigma_m = [xx.sqrt(), yy.sqrt()];
        Held::Wrong(flown.key, Miss { off_m: off, sigma_m, squared_sigmas: squared })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{Scenario, ScenarioOptions};
    use std::io::Write as _;

    #[test]
    fn a_shot_is_held_against_the_ball_of_its_lap() {
        let options = ScenarioOptions { n_shots: 3, ..Default::default() };
        let truth = Truth::from_scenario(&Scenario::from_seed(1, &options));
        let mut file = tempfile::NamedTempFile::new().unwrap();
        write!(file, "0\n5000000000\n10000000000\n").unwrap();
        let served = Served::new(file.path(), &truth).unwrap();
        assert_eq!(served.lap_ns, 15_000_000_000);
        let all = served.bounced_within([0, 150_000_000_000]);
        assert_eq!(all.len(), 30);
        let flown = all[13];
        let at = truth.flights[flown.key.ball_idx].bounces[0].position_in_court_m;
        let held = |later_ns: i64, off_m: f64| {
            let bounce_ns = flown.bounced_ns.unwrap() + later_ns;
            served.held(&shot(1, bounce_ns, [at.x, at.y + off_m, at.z]))
        };
        assert!(matches!(held(1_000_000, 0.007), Held::Right(key, _) if key == flown.key));
        let Held::Wrong(key, miss) = held(0, 0.008) else { panic!("4 sigmas off") };
        assert_eq!((key, miss.sigma_m), (flown.key, [0.001, 0.002]));
        assert!((miss.squared_sigmas - 16.0).abs() < 1e-6, "{miss:?}");
        assert_eq!(held(-400_000_000, 0.0), Held::Invented);
        assert!(matches!(held(0, f64::NAN), Held::Wrong(..)));
        assert_eq!(served.held(&shot(0, 0, [f64::NAN; 3])), Held::WithoutBounce);
    }

    /// 1 mm across the court and 2 mm along it, 1 sigma.
    fn shot(is_measured: u32, bounce_ns: StampNs, bounce_in_court_m: [f64; 3]) -> Shot {
        Shot {
            shot_idx: 0,
            is_measured,
            reserved: 0,
            launch_ns: 0,
            launch_speed_m_s: 0.0,
            launch_elevation_rad: 0.0,
            launch_azimuth_rad: 0.0,
            launch_backspin_rad_s: 0.0,
            launch_sigma: [0.0; 4],
            bounce_ns,
            bounce_in_court_m,
            bounce_covariance_m2: [[1e-6, 0.0], [0.0, 4e-6]],
            velocity_in_m_s: [0.0; 3],
            velocity_out_m_s: [0.0; 3],
        }
    }
}

//! Shots, truth -> how far each is off, and whether it says so.
//!
//! [`Reading::from_shot`] is the only place that knows what a [`Shot`] looks like; what `fusion`
//! does not measure is `None` there and a dash in the table.
//! A measured shot is that of a truth when it bounces within [`SAME_TIME_S`] and [`SAME_PLACE_M`]
//! of it; each truth has one shot at most, the nearest. A truth without one is lost, a measured
//! shot without one is invented. Errors are measured less true, on the left camera's clock.

use fusion::{Outcome, Shot};
use nalgebra::{Matrix2, Vector2};

use super::bound::bounce_bound_m2;
use super::cells::Cell;
use super::sightings::Sightings;
use super::stream::{Cost, Played, Stream};
use crate::truth::{Bounce, Flight};

/// A shot's bounce is a truth's when it is no farther from it than this,
pub const SAME_TIME_S: f64 = 0.1;
/// and this.
pub const SAME_PLACE_M: f64 = 1.0;
/// 95 % of a normal distribution in the plane lie within this squared distance, in sigma.
pub const CHI2_95: f64 = 5.991;
/// A shot that is not whole was launched no further from a truth's launch than this.
const SAME_LAUNCH_S: f64 = 0.5;

/// A number, and 1 sigma of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// As it was stated.
    pub sigma: f64,
}

/// What a shot says.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// Whether it is whole.
    pub outcome: Outcome,
    /// Where and when it bounced.
    pub bounce: Option<BounceReading>,
    /// When it was launched, on the left camera's clock.
    pub launched_at_s: Option<f64>,
    /// Speed at the launcher, m/s.
    pub speed_m_s: Option<Estimate>,
    /// Elevation at the launcher.
    pub elevation_rad: Option<Estimate>,
    /// Azimuth at the launcher.
    pub azimuth_rad: Option<Estimate>,
    /// Backspin at the launcher.
    pub backspin_rad_s: Option<Estimate>,
    /// What the right clock shows less what the left one does.
    pub right_minus_left_s: Option<Estimate>,
}

/// Where and when.
#[derive(Clone, Debug, PartialEq)]
pub struct BounceReading {
    /// On the left camera's clock.
    pub bounced_at_s: f64,
    /// x and y in the court.
    pub position_m: Vector2<f64>,
    /// As it was stated.
    pub covariance_m2: Matrix2<f64>,
}

impl Reading {
    /// Reads a shot.
    pub fn from_shot(shot: &Shot) -> Self {
        let matrix = |m: [[f64; 2]; 2]| Matrix2::from_fn(|row, column| m[row][column]);
        let bounce = shot.bounce.as_ref().map(|bounce| BounceReading {
            bounced_at_s: bounce.t_ns as f64 * 1e-9,
            position_m: bounce.position_m.xy().coords,
            covariance_m2: matrix(bounce.covariance_m2),
        });
        let launch = shot.launch.as_ref();
        let direction = launch.and_then(|launch| launch.direction);
        Self {
            outcome: shot.outcome,
            bounce,
            launched_at_s: launch.map(|launch| launch.t_ns as f64 * 1e-9),
            speed_m_s: launch.map(|launch| Estimate {
                value: launch.velocity_m_s.norm(),
                sigma: launch.speed_sigma_m_s,
            }),
            elevation_rad: direction
                .map(|d| Estimate { value: d.elevation_rad, sigma: d.elevation_sigma_rad }),
            azimuth_rad: direction
                .map(|d| Estimate { value: d.azimuth_rad, sigma: d.azimuth_sigma_rad }),
            backspin_rad_s: launch
                .and_then(|launch| launch.spin)
                .map(|spin| Estimate { value: spin.backspin_rad_s, sigma: spin.sigma_rad_s }),
            right_minus_left_s: shot
                .clock
                .map(|c| Estimate { value: c.right_minus_left_s, sigma: c.sigma_s }),
        }
    }
}

/// How far a number is off, and 1 sigma of it as stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Off {
    /// Measured less true.
    pub by: f64,
    /// As stated.
    pub sigma: f64,
}

impl Off {
    fn of(estimate: Option<Estimate>, truth: f64) -> Option<Self> {
        estimate.map(|e| Self { by: e.value - truth, sigma: e.sigma })
    }

    /// Whether it is off by no more than two of its sigmas, as 95.4 % should be.
    pub fn is_within_2_sigma(&self) -> bool {
        self.by.abs() <= 2.0 * self.sigma
    }
}

/// A measured shot against its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Errors {
    /// x and y of the bounce.
    pub bounce_m: Vector2<f64>,
    /// As it was stated.
    pub bounce_covariance_m2: Matrix2<f64>,
    /// The least covariance that these candidates allow (Cramér and Rao).
    pub bound_m2: Option<Matrix2<f64>>,
    /// When it bounced.
    pub bounce_time_s: f64,
    /// As a fraction of the true speed.
    pub speed: Option<Off>,
    /// At the launcher.
    pub elevation_rad: Option<Off>,
    /// At the launcher.
    pub azimuth_rad: Option<Off>,
    /// At the launcher.
    pub backspin_rad_s: Option<Off>,
    /// Of the clocks.
    pub right_minus_left_s: Option<Off>,
}

impl Errors {
    /// `None` when the shot has no bounce. `right_minus_left_s` is that of the clocks, in truth.
    pub fn from_reading(
        reading: &Reading,
        flight: &Flight,
        bounce: &Bounce,
        right_minus_left_s: f64,
    ) -> Option<Self> {
        let measured = reading.bounce.as_ref()?;
        let launch = &flight.launch;
        let speed_m_s = launch.speed_m_s;
        let speed = reading
            .speed_m_s
            .map(|e| Off { by: e.value / speed_m_s - 1.0, sigma: e.sigma / speed_m_s });
        Some(Self {
            bounce_m: measured.position_m - bounce.position_in_court_m.xy().coords,
            bounce_covariance_m2: measured.covariance_m2,
            bound_m2: None,
            bounce_time_s: measured.bounced_at_s - bounce.bounced_at_s,
            speed,
            elevation_rad: Off::of(reading.elevation_rad, launch.elevation_rad),
            azimuth_rad: Off::of(reading.azimuth_rad, launch.azimuth_rad),
            backspin_rad_s: Off::of(reading.backspin_rad_s, launch.backspin_rad_s),
            right_minus_left_s: Off::of(reading.right_minus_left_s, right_minus_left_s),
        })
    }

    /// Squared distance of the bounce, in its own sigmas; infinite if these are no covariance.
    pub fn bounce_chi2(&self) -> f64 {
        let inverse = self.bounce_covariance_m2.try_inverse();
        let chi2 = inverse.map(|inverse| self.bounce_m.dot(&(inverse * self.bounce_m)));
        chi2.filter(|chi2| *chi2 >= 0.0).unwrap_or(f64::INFINITY)
    }

    /// Whether the truth lies within the stated ellipse of 95 %.
    pub fn is_bounce_covered(&self) -> bool {
        self.bounce_chi2() <= CHI2_95
    }
}

/// A shot that was served.
#[derive(Clone, Debug)]
pub struct ShotScore {
    /// Its number within the stream.
    pub shot_idx: usize,
    /// What really happened.
    pub flight: Flight,
    /// What was measured of it; `None` when it was lost.
    pub errors: Option<Errors>,
    /// From the true bounce until the frame it was told with; `None` at the end of the stream.
    pub delay_s: Option<f64>,
    /// What was said of it: the outcome of the shot that is or may be this one.
    pub said: Option<Outcome>,
}

/// All that came of a stream.
#[derive(Clone, Debug)]
pub struct StreamScore {
    /// What it was drawn from.
    pub seed: u64,
    /// Shots that were served and bounced.
    pub shots: Vec<ShotScore>,
    /// Measured shots that nobody served.
    pub invented: Vec<Reading>,
    /// Shots that were told but not measured.
    pub not_whole: Vec<Reading>,
    /// How well balls were seen.
    pub sightings: Sightings,
    /// What each frame took.
    pub costs: Vec<Cost>,
    /// What `fusion` left out, in its own words.
    pub left_out: String,
}

/// Holds all shots of a stream against its truth.
pub fn from_played(stream: &Stream, played: &Played, cell: &Cell) -> StreamScore {
    let told: Vec<(Reading, Option<f64>)> =
        played.told.iter().map(|told| (Reading::from_shot(&told.shot), told.at_s)).collect();
    let mut is_taken = vec![false; told.len()];
    let mut shots = Vec::new();
    for (shot_idx, flight) in stream.truth.flights.iter().enumerate() {
        let Some(bounce) = flight.bounces.first() else { continue };
        let clocks_s = stream.clocks.right_minus_left_s(bounce.bounced_at_s);
        let errors_of = |(reading, _): &(Reading, Option<f64>)| {
            Errors::from_reading(reading, flight, bounce, clocks_s).filter(|errors| {
                reading.outcome == Outcome::Measured
                    && errors.bounce_time_s.abs() <= SAME_TIME_S
                    && errors.bounce_m.norm() <= SAME_PLACE_M
            })
        };
        let free = told.iter().enumerate().filter(|(idx, _)| !is_taken[*idx]);
        let nearest = free
            .filter_map(|(idx, one)| Some((idx, errors_of(one)?)))
            .min_by(|(_, a), (_, b)| a.bounce_m.norm().total_cmp(&b.bounce_m.norm()));
        let mut score =
            ShotScore { shot_idx, flight: flight.clone(), errors: None, delay_s: None, said: None };
        match nearest {
            Some((idx, mut errors)) => {
                let until_s = told[idx].1.unwrap_or(f64::INFINITY);
                let (level, settings) = (&cell.level, cell.settings());
                errors.bound_m2 =
                    bounce_bound_m2(stream, flight, bounce, until_s, level, &settings);
                is_taken[idx] = true;
                score.said = Some(Outcome::Measured);
                score.delay_s = told[idx].1.map(|at_s| at_s - bounce.bounced_at_s);
                score.errors = Some(errors);
            }
            None => score.said = said_of(&told, flight),
        }
        shots.push(score);
    }
    let free = told.into_iter().zip(is_taken).filter(|(_, is_taken)| !is_taken);
    let (invented, not_whole) = free
        .map(|((reading, _), _)| reading)
        .partition(|reading| reading.outcome == Outcome::Measured);
    StreamScore {
        seed: stream.seed,
        shots,
        invented,
        not_whole,
        sightings: Sightings::from_stream(stream),
        costs: played.costs.clone(),
        left_out: played.left_out.clone(),
    }
}

/// The outcome of whatever was launched at about the same time.
fn said_of(told: &[(Reading, Option<f64>)], flight: &Flight) -> Option<Outcome> {
    let off_s = |reading: &Reading| {
        reading.launched_at_s.map(|at_s| (at_s - flight.launch.launched_at_s).abs())
    };
    let near = told.iter().filter_map(|(reading, _)| Some((off_s(reading)?, reading.outcome)));
    near.filter(|(off_s, _)| *off_s <= SAME_LAUNCH_S)
        .min_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, outcome)| outcome)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;
    use crate::truth::Truth;

    fn thesis() -> Flight {
        Truth::from_scenario(&Scenario::thesis_shot()).flights.remove(0)
    }

    /// A reading that is right, with 1 cm, 1 % and 1 ms of sigma.
    fn perfect(flight: &Flight) -> Reading {
        let bounce = &flight.bounces[0];
        let launch = &flight.launch;
        let sure = |value: f64| Some(Estimate { value, sigma: 0.01 });
        Reading {
            outcome: Outcome::Measured,
            bounce: Some(BounceReading {
                bounced_at_s: bounce.bounced_at_s,
                position_m: bounce.position_in_court_m.xy().coords,
                covariance_m2: Matrix2::identity() * 1e-4,
            }),
            launched_at_s: Some(launch.launched_at_s),
            speed_m_s: sure(launch.speed_m_s),
            elevation_rad: sure(launch.elevation_rad),
            azimuth_rad: sure(launch.azimuth_rad),
            backspin_rad_s: sure(launch.backspin_rad_s),
            right_minus_left_s: sure(0.003),
        }
    }

    fn errors(reading: &Reading, flight: &Flight) -> Errors {
        Errors::from_reading(reading, flight, &flight.bounces[0], 0.003).expect("it bounced")
    }

    #[test]
    fn a_perfect_shot_scores_zero() {
        let flight = thesis();
        let errors = errors(&perfect(&flight), &flight);
        assert_eq!((errors.bounce_m.norm(), errors.bounce_time_s), (0.0, 0.0));
        assert!(errors.is_bounce_covered());
        let offs = [errors.speed, errors.elevation_rad, errors.azimuth_rad, errors.backspin_rad_s];
        for off in offs.into_iter().chain([errors.right_minus_left_s]) {
            let off = off.expect("was read");
            assert!(off.by.abs() < 1e-12 && off.is_within_2_sigma());
        }
    }

    #[test]
    fn a_shot_10_cm_off_its_ellipse_is_not_covered() {
        let flight = thesis();
        let mut reading = perfect(&flight);
        reading.bounce.as_mut().expect("it bounced").position_m.y += 0.1;
        let narrow = errors(&reading, &flight);
        assert!((narrow.bounce_chi2() - 100.0).abs() < 1e-6 && !narrow.is_bounce_covered());
        // 10 cm are 2 sigma of 5 cm: within the ellipse, which reaches to 2.45.
        let wide = Errors { bounce_covariance_m2: Matrix2::identity() * 0.0025, ..narrow };
        assert!(wide.is_bounce_covered());
        let none = Errors { bounce_covariance_m2: Matrix2::zeros(), ..wide };
        assert!(!none.is_bounce_covered());
    }

    #[test]
    fn what_was_not_measured_has_no_error() {
        let flight = thesis();
        let reading = Reading { backspin_rad_s: None, ..perfect(&flight) };
        assert_eq!(errors(&reading, &flight).backspin_rad_s, None);
        let reading = Reading { bounce: None, ..reading };
        assert_eq!(Errors::from_reading(&reading, &flight, &flight.bounces[0], 0.0), None);
    }
}

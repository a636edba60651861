//! The scores of a cell's streams -> its row: figures over all its shots.
//!
//! Figures of errors are those of measured shots; what no shot says is `None`. Delays are those of
//! shots told while the stream went on, and do not hold what a camera, a worker and a network take.

use nalgebra::Matrix2;

use super::figures::{mean, median, percent_true, quantile, rms, worst};
use super::score::{Errors, Off, StreamScore};
use super::sightings::Sightings;
use super::stream::Cost;

/// Streams shorter than two of these have no first and last one.
const MINUTE_S: f64 = 60.0;

/// One row.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The cell.
    pub cell: &'static str,
    /// Shots that were served and bounced.
    pub n_served: usize,
    /// Of these, measured.
    pub n_measured: usize,
    /// Measured shots that nobody served.
    pub n_invented: usize,
    /// Shots told as something else than measured.
    pub n_not_whole: usize,
    /// Mean error of the bounce along x and y.
    pub bias_m: [Option<f64>; 2],
    /// Distance of the bounce: root of the mean square, of both axes together.
    pub rmse_m: Option<f64>,
    /// The distance that 95 % do not exceed.
    pub p95_m: Option<f64>,
    /// The greatest distance.
    pub worst_m: Option<f64>,
    /// Truths within the stated ellipse of 95 %.
    pub covered_percent: Option<f64>,
    /// RMSE over the least that is possible.
    pub over_bound: Option<f64>,
    /// Launch: speed as a fraction, elevation and azimuth in rad, spin in rad/s.
    pub launch: [Spread; 4],
    /// Time of the bounce.
    pub bounce_time_rms_s: Option<f64>,
    /// Clocks: what is off, and what was stated.
    pub clock: Spread,
    /// From the bounce until told: median and worst.
    pub delay_s: [Option<f64>; 2],
    /// Measured shots that were told only when the stream ended.
    pub n_told_at_end: usize,
    /// Time of a frame: median, mean, median of those that tell a shot, and worst.
    pub frame_ms: [Option<f64>; 4],
    /// How well balls were seen.
    pub sightings: Sightings,
    /// Mean time of a frame in the first and in the last minute of long streams.
    pub minute_ms: [Option<f64>; 2],
}

/// How a quantity is off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Root of the mean square.
    pub rms: Option<f64>,
    /// What 95 % do not exceed.
    pub p95: Option<f64>,
    /// Root of the mean of the stated variances.
    pub stated: Option<f64>,
    /// Within two of the stated sigmas; should be 95.
    pub within_2_sigma_percent: Option<f64>,
}

impl Spread {
    fn of(offs: impl Iterator<Item = Option<Off>>) -> Self {
        let offs: Vec<Off> = offs.flatten().collect();
        let sizes: Vec<f64> = offs.iter().map(|off| off.by.abs()).collect();
        let sigmas: Vec<f64> = offs.iter().map(|off| off.sigma).collect();
        let within: Vec<bool> = offs.iter().map(Off::is_within_2_sigma).collect();
        Self {
            rms: rms(&sizes),
            p95: quantile(&sizes, 0.95),
            stated: rms(&sigmas),
            within_2_sigma_percent: percent_true(&within),
        }
    }
}

impl Row {
    /// Sums up the streams of a cell.
    pub fn from_scores(cell: &'static str, scores: &[StreamScore]) -> Self {
        let shots = || scores.iter().flat_map(|score| &score.shots);
        let measured: Vec<&Errors> = shots().filter_map(|shot| shot.errors.as_ref()).collect();
        let off_m = |axis: usize| measured.iter().map(|e| e.bounce_m[axis]).collect::<Vec<_>>();
        let distances_m: Vec<f64> = measured.iter().map(|e| e.bounce_m.norm()).collect();
        let covered: Vec<bool> = measured.iter().map(|e| e.is_bounce_covered()).collect();
        let times_s: Vec<f64> = measured.iter().map(|e| e.bounce_time_s).collect();
        let delays_s: Vec<f64> = shots().filter_map(|shot| shot.delay_s).collect();
        let spread = |off: fn(&Errors) -> Option<Off>| Spread::of(measured.iter().map(|e| off(e)));
        Self {
            cell,
            n_served: shots().count(),
            n_measured: measured.len(),
            n_invented: scores.iter().map(|score| score.invented.len()).sum(),
            n_not_whole: scores.iter().map(|score| score.not_whole.len()).sum(),
            bias_m: [mean(&off_m(0)), mean(&off_m(1))],
            rmse_m: rms(&distances_m),
            p95_m: quantile(&distances_m, 0.95),
            worst_m: worst(&distances_m),
            covered_percent: percent_true(&covered),
            over_bound: over_bound(&measured),
            launch: [
                spread(|e| e.speed),
                spread(|e| e.elevation_rad),
                spread(|e| e.azimuth_rad),
                spread(|e| e.backspin_rad_s),
            ],
            bounce_time_rms_s: rms(&times_s),
            clock: spread(|e| e.right_minus_left_s),
            delay_s: [median(&delays_s), worst(&delays_s)],
            n_told_at_end: measured.len() - delays_s.len(),
            sightings: Sightings::sum(scores.iter().map(|score| &score.sightings)),
            frame_ms: frame_ms(scores),
            minute_ms: minute_ms(scores),
        }
    }

    /// Shots that were served and not measured.
    pub fn n_lost(&self) -> usize {
        self.n_served - self.n_measured
    }
}

/// RMSE over the root of the bounds' mean trace, of the shots that have a bound.
fn over_bound(measured: &[&Errors]) -> Option<f64> {
    let bounded = || measured.iter().filter_map(|e| Some((e.bounce_m.norm(), e.bound_m2?)));
    let distances_m: Vec<f64> = bounded().map(|(distance_m, _)| distance_m).collect();
    let traces_m2: Vec<f64> =
        bounded().map(|(_, bound): (_, Matrix2<f64>)| bound.trace()).collect();
    Some(rms(&distances_m)? / mean(&traces_m2)?.sqrt())
}

fn frame_ms(scores: &[StreamScore]) -> [Option<f64>; 4] {
    let costs = || scores.iter().flat_map(|score| &score.costs);
    let all: Vec<f64> = costs().map(|cost| cost.ms).collect();
    let telling: Vec<f64> = costs().filter(|cost| cost.has_told).map(|cost| cost.ms).collect();
    [median(&all), mean(&all), median(&telling), worst(&all)]
}

fn minute_ms(scores: &[StreamScore]) -> [Option<f64>; 2] {
    let ends_s = scores.iter().filter_map(|score| score.costs.last()).map(|cost| cost.at_s);
    let end_s = ends_s.fold(0.0, f64::max);
    if end_s < 2.0 * MINUTE_S {
        return [None; 2];
    }
    let mean_of = |is_in: &dyn Fn(&Cost) -> bool| {
        let costs = scores.iter().flat_map(|score| &score.costs).filter(|cost| is_in(cost));
        mean(&costs.map(|cost| cost.ms).collect::<Vec<f64>>())
    };
    [mean_of(&|cost| cost.at_s < MINUTE_S), mean_of(&|cost| cost.at_s > end_s - MINUTE_S)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::score::ShotScore;
    use crate::scenario::Scenario;
    use crate::truth::Truth;
    use nalgebra::Vector2;

    fn shot(off_m: Option<[f64; 2]>) -> ShotScore {
        let off = Off { by: 0.01, sigma: 0.004 };
        let errors = off_m.map(|off_m| Errors {
            bounce_m: Vector2::from(off_m),
            bounce_covariance_m2: Matrix2::identity() * 1e-4,
            bound_m2: Some(Matrix2::identity() * 0.5e-4),
            bounce_time_s: 0.001,
            speed: Some(off),
            elevation_rad: None,
            azimuth_rad: None,
            backspin_rad_s: None,
            right_minus_left_s: None,
        });
        let flight = Truth::from_scenario(&Scenario::thesis_shot()).flights.remove(0);
        let delay_s = errors.is_some().then_some(0.2);
        ShotScore { shot_idx: 0, flight, errors, delay_s, said: None }
    }

    #[test]
    fn a_row_sums_up_what_was_measured_and_counts_what_was_not() {
        let score = StreamScore {
            seed: 1,
            shots: vec![shot(Some([0.0, 0.01])), shot(Some([0.0, 0.03])), shot(None)],
            invented: Vec::new(),
            not_whole: Vec::new(),
            sightings: Sightings::default(),
            costs: vec![Cost { at_s: 0.0, ms: 2.0, has_told: false }],
            left_out: String::new(),
        };
        let row = Row::from_scores("clean", &[score]);
        assert_eq!((row.n_served, row.n_measured, row.n_lost()), (3, 2, 1));
        let near = |value: Option<f64>, expected: f64| (value.unwrap() - expected).abs() < 1e-9;
        assert!(near(row.bias_m[1], 0.02) && near(row.bias_m[0], 0.0));
        assert!(near(row.rmse_m, 0.0005f64.sqrt()) && near(row.worst_m, 0.03));
        // 1 cm is 1 sigma of the stated, 3 cm is 3; the bound is 1 cm.
        assert!(near(row.covered_percent, 50.0) && near(row.over_bound, 5f64.sqrt()));
        assert!(near(row.launch[0].p95, 0.01) && row.launch[1].p95.is_none());
        assert!(near(row.launch[0].within_2_sigma_percent, 0.0));
        assert_eq!(
            (row.frame_ms, row.minute_ms),
            ([Some(2.0), Some(2.0), None, Some(2.0)], [None; 2])
        );
    }
}

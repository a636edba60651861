//! A session -> all that can be said of it. Serialised as JSON, schema "session/1".
//!
//! Lengths in metres, court frame, x to the right and y too long; angles in degrees, speeds in m/s;
//! sigmas are 1 sigma. What cannot be told from so few balls is `null`. A ball that was not
//! measured counts as fired and not as measured; an odd one (a gust, a net cord) counts, for it
//! landed where it did.

use super::pace::{self, Pace};
use super::scatter::{Ellipse, Landings, part_of};
use super::{Ball, Machine, Session};
use crate::control::attributed::Why;
use crate::control::words;
use nalgebra::Vector2;
use serde::Serialize;
use std::collections::BTreeMap;

/// A ball whose drag is this much below what was expected, and so many sigmas, is worn.
const WORN: f64 = 0.03;
const WORN_SIGMAS: f64 = 2.0;

/// Balls that a drift is told from, at least.
const N_DRIFT_MIN: usize = 8;

/// All of it.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// "session/1".
    pub schema: &'static str,
    /// Balls that were fired.
    pub n_fired: usize,
    /// Those whose landing was measured.
    pub n_measured: usize,
    /// Those beyond what a session keeps.
    pub n_left_out: u64,
    /// Why balls counted little or not at all, and how many.
    pub reservations: BTreeMap<String, usize>,
    /// Each target, in their order.
    pub targets: Vec<TargetView>,
    /// How all misses changed, per ten balls.
    pub drift_per_10_balls: Option<DriftView>,
    /// As believed after the last ball.
    pub air: Option<AirView>,
    /// As believed after the last ball.
    pub machine: Option<MachineView>,
    /// Balls, from 1, with less drag than the others.
    pub worn_balls: Vec<usize>,
    /// Of the court.
    pub pace: Option<PaceView>,
}

/// One target.
#[derive(Debug, Clone, Serialize)]
pub struct TargetView {
    /// As the drill has it.
    pub name: String,
    /// Where it is.
    pub landing_m: [f64; 2],
    /// How near is in the zone.
    pub zone_radius_m: f64,
    /// Balls fired at it.
    pub n_fired: usize,
    /// Those measured.
    pub n_measured: usize,
    /// Part of the measured ones in the zone, and its 95 % interval.
    pub in_zone: Option<[f64; 3]>,
    /// Mean miss.
    pub bias_m: Option<[f64; 2]>,
    /// Its sigma.
    pub bias_sigma_m: Option<[f64; 2]>,
    /// Where the true mean is, with 95 %, around the mean landing.
    pub mean_ellipse_95: Option<EllipseView>,
    /// Sigma of single balls.
    pub scatter_m: Option<[f64; 2]>,
    /// By how much of itself that is uncertain.
    pub scatter_uncertain_part: Option<f64>,
    /// Where 95 % of balls fall, around the mean landing.
    pub balls_ellipse_95: Option<EllipseView>,
    /// "after 20 balls the mean is known to 10 cm".
    pub sentence: String,
}

/// An ellipse.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EllipseView {
    /// Long and short.
    pub half_axes_m: [f64; 2],
    /// Of the long one, from +x towards +y.
    pub angle_deg: f64,
}

impl From<Ellipse> for EllipseView {
    fn from(ellipse: Ellipse) -> Self {
        let Ellipse { half_axes_m, angle_rad } = ellipse;
        Self { half_axes_m, angle_deg: angle_rad.to_degrees() }
    }
}

/// A drift.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct DriftView {
    /// x and y.
    pub off_m: [f64; 2],
    /// 1 sigma of each.
    pub sigma_m: [f64; 2],
}

/// What is known of the air.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct AirView {
    /// C_D of the balls in play.
    pub drag_coefficient: f64,
    /// 1 sigma.
    pub drag_sigma: f64,
    /// x and y.
    pub wind_m_s: [f64; 2],
    /// 1 sigma of each.
    pub wind_sigma_m_s: [f64; 2],
}

/// What a machine does more than it is told, in the middle of its range, and 1 sigma.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct MachineView {
    /// Percent of the speed.
    pub speed_percent: [f64; 2],
    /// Of the elevation.
    pub elevation_deg: [f64; 2],
    /// Of the azimuth.
    pub azimuth_deg: [f64; 2],
    /// Of the spin; + is more backspin.
    pub spin_rpm: [f64; 2],
}

impl From<&Machine> for MachineView {
    fn from(machine: &Machine) -> Self {
        let of = |i: usize, unit: f64| [machine.value[i] * unit, machine.sigma[i] * unit];
        let degrees = 1_f64.to_degrees();
        Self {
            speed_percent: of(0, 100.0),
            elevation_deg: of(1, degrees),
            azimuth_deg: of(2, degrees),
            spin_rpm: of(3, 60.0 / std::f64::consts::TAU),
        }
    }
}

/// What is known of the court.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct PaceView {
    /// ITF court pace rating, estimated from play.
    pub rating: f64,
    /// 1 sigma.
    pub sigma: f64,
    /// Sliding friction.
    pub friction: f64,
    /// Vertical speed after over before.
    pub restitution: f64,
    /// Bounces that counted.
    pub n_bounces: usize,
}

impl From<Pace> for PaceView {
    fn from(pace: Pace) -> Self {
        let Pace { rating, sigma, friction, restitution, n } = pace;
        Self { rating, sigma, friction, restitution, n_bounces: n }
    }
}

impl Summary {
    /// Of a session.
    #[must_use]
    pub fn new(session: &Session) -> Self {
        let balls = session.balls();
        let misses_m: Vec<Option<Vector2<f64>>> =
            balls.iter().map(|ball| ball.miss_m(session.targets())).collect();
        let mut reservations = BTreeMap::new();
        for ball in balls {
            let why = match ball.trust {
                None => Some("no ball was seen"),
                Some(trust) => words::reservation(trust),
            };
            if let Some(why) = why {
                *reservations.entry(why.to_owned()).or_insert(0) += 1;
            }
        }
        let targets =
            (0..session.targets().len()).map(|idx| target(session, idx, &misses_m)).collect();
        let worn = balls.iter().enumerate().filter(|(_, ball)| is_worn(ball));
        Self {
            schema: "session/1",
            n_fired: balls.len(),
            n_measured: misses_m.iter().flatten().count(),
            n_left_out: session.n_left_out(),
            reservations,
            targets,
            drift_per_10_balls: drift(&misses_m),
            air: balls.last().map(|ball| AirView {
                drag_coefficient: ball.air.value[0],
                drag_sigma: ball.air.sigma[0],
                wind_m_s: [ball.air.value[1], ball.air.value[2]],
                wind_sigma_m_s: [ball.air.sigma[1], ball.air.sigma[2]],
            }),
            machine: session.machine().map(MachineView::from),
            worn_balls: worn.map(|(i, _)| i + 1).collect(),
            pace: pace::from_bounces(balls.iter().filter_map(|ball| ball.bounce.as_ref()))
                .map(PaceView::from),
        }
    }

    /// As JSON, indented.
    #[must_use]
    pub fn text(&self) -> String {
        serde_json::to_string_pretty(self).expect("the views have text keys and plain values")
    }
}

fn target(session: &Session, idx: usize, misses_m: &[Option<Vector2<f64>>]) -> TargetView {
    let target = &session.targets()[idx];
    let mine = || session.balls().iter().zip(misses_m).filter(|(ball, _)| ball.target_idx == idx);
    let mine_m: Vec<Vector2<f64>> = mine().filter_map(|(_, miss_m)| *miss_m).collect();
    let n_in = mine_m.iter().filter(|miss| miss.norm() <= target.zone_radius_m).count();
    let landings = Landings::of(&mine_m);
    let of = |get: fn(&Landings) -> Option<Vector2<f64>>| {
        landings.as_ref().and_then(get).map(<[f64; 2]>::from)
    };
    TargetView {
        name: target.name.clone(),
        landing_m: target.wanted.landing_m().into(),
        zone_radius_m: target.zone_radius_m,
        n_fired: mine().count(),
        n_measured: mine_m.len(),
        in_zone: part_of(n_in, mine_m.len()),
        bias_m: of(|landings| Some(landings.mean_m)),
        bias_sigma_m: of(Landings::mean_sigma_m),
        mean_ellipse_95: landings.and_then(|l| l.mean_ellipse()).map(EllipseView::from),
        scatter_m: of(Landings::sigma_m),
        scatter_uncertain_part: landings.and_then(|l| l.sigma_uncertain_part()),
        balls_ellipse_95: landings.and_then(|l| l.balls_ellipse()).map(EllipseView::from),
        sentence: sentence(mine_m.len(), landings.as_ref()),
    }
}

fn sentence(n: usize, landings: Option<&Landings>) -> String {
    let balls = if n == 1 { "ball" } else { "balls" };
    let known = landings.and_then(Landings::mean_sigma_m);
    match (landings, known) {
        (Some(landings), Some(sigma)) => {
            let [x, y] = [landings.mean_m.x, landings.mean_m.y].map(|off_m| off_m * 100.0);
            let [side, way] =
                [if x < 0.0 { "left" } else { "right" }, if y < 0.0 { "short" } else { "long" }];
            format!(
                "after {n} {balls} the mean is {:.0} cm {way} and {:.0} cm {side}, known to \
                 ±{:.0} and ±{:.0} cm",
                y.abs(),
                x.abs(),
                sigma.y * 100.0,
                sigma.x * 100.0
            )
        }
        _ => format!("after {n} {balls} nothing can be said of the mean"),
    }
}

fn is_worn(ball: &Ball) -> bool {
    ball.parts.iter().any(|part| {
        let (amount, sigma) = (part.amount.x, part.amount_sigma.x);
        part.why == Why::Drag && amount < -WORN && amount < -WORN_SIGMAS * sigma
    })
}

/// A straight line through the misses, by least squares.
fn drift(misses_m: &[Option<Vector2<f64>>]) -> Option<DriftView> {
    let points: Vec<(f64, Vector2<f64>)> = misses_m
        .iter()
        .enumerate()
        .filter_map(|(i, miss)| Some((i as f64 / 10.0, (*miss)?)))
        .collect();
    let n = points.len() as f64;
    if points.len() < N_DRIFT_MIN {
        return None;
    }
    let mean = points.iter().map(|p| p.0).sum::<f64>() / n;
    let mean_m = points.iter().map(|p| p.1).sum::<Vector2<f64>>() / n;
    let square: f64 = points.iter().map(|p| (p.0 - mean).powi(2)).sum();
    let slope = points.iter().map(|p| (p.1 - mean_m) * (p.0 - mean)).sum::<Vector2<f64>>() / square;
    let residual = |p: &(f64, Vector2<f64>)| {
        let off = p.1 - mean_m - slope * (p.0 - mean);
        off.component_mul(&off)
    };
    let variance = points.iter().map(residual).sum::<Vector2<f64>>() / (n - 2.0) / square;
    Some(DriftView { off_m: slope.into(), sigma_m: variance.map(f64::sqrt).into() })
}

//! Many sessions of a variant -> one row: how far the commanded mean is off, and what else counts.
//!
//! A machine's scatter is that of single balls around their mean, of both axes together, with gusts
//! of 0.5 m/s: what no controller can take away. After n balls nobody can know the mean better than
//! scatter/√n, unless the machine's numbers are measured ball by ball, as `fusion` does.

use nalgebra::Vector2;

use super::Variant;
use super::played::{AirOff, Session};
use super::scene::{STEP_IDX, Scene};
use super::targets::{self, N_TARGETS};
use crate::accuracy::figures::{mean, median, percent_true, rms, worst};
use crate::machine::Machine;
use crate::machine::actuators::{Actuators, Build};
use crate::world::World;

/// After how many balls the commanded mean is looked at.
pub const AFTER: [usize; 7] = [0, 1, 3, 5, 7, 10, 20];
/// How many balls after a change of the wind.
pub const AFTER_STEP: [usize; 7] = [0, 1, 2, 3, 5, 8, 12];
/// A change counts as followed when the mean is off by no more than this part of scatter/√5.
const FOLLOWED: f64 = 1.2;
/// Balls of each target that tell the scatter.
const N_SCATTER_BALLS: usize = 200;
/// Their chances come from here.
const SCATTER_SEED: u64 = 99;

/// How far the commanded mean is off: root of the mean square over the targets, of a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Systematic {
    /// Root of the mean square over the sessions.
    pub rms_m: f64,
    /// Half of the sessions are better.
    pub median_m: f64,
    /// The worst session.
    pub worst_m: f64,
}

impl Systematic {
    fn of(sessions: &[Session], n_balls: usize) -> Option<Self> {
        let offs_m: Option<Vec<f64>> = sessions.iter().map(|s| s.systematic_m(n_balls)).collect();
        let offs_m = offs_m?;
        Some(Self { rms_m: rms(&offs_m)?, median_m: median(&offs_m)?, worst_m: worst(&offs_m)? })
    }
}

/// How a number is off, over all sessions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Off {
    /// Root of the mean square.
    pub rms: f64,
    /// Root of the mean square of what was stated.
    pub stated: f64,
    /// Root of the mean square in stated sigmas: 1 if they are honest.
    pub in_sigmas: f64,
}

impl Off {
    fn of(offs: impl Iterator<Item = [f64; 2]>) -> Option<Self> {
        let offs: Vec<[f64; 2]> = offs.collect();
        let each = |value: fn(&[f64; 2]) -> f64| rms(&offs.iter().map(value).collect::<Vec<_>>());
        let in_sigmas = each(|[by, sigma]| by / sigma)?;
        Some(Self { rms: each(|[by, _]| *by)?, stated: each(|[_, sigma]| *sigma)?, in_sigmas })
    }
}

/// What is believed of the air after the last ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AirRow {
    /// As a part of the truth.
    pub drag: Off,
    /// Along x.
    pub wind_x_m_s: Off,
    /// Along y.
    pub wind_y_m_s: Off,
    /// What it moves landings by: root of the mean square, and the worst.
    pub joint_m: [f64; 2],
}

impl AirRow {
    fn of(sessions: &[Session]) -> Option<Self> {
        let airs: Option<Vec<AirOff>> = sessions.iter().map(|session| session.air).collect();
        let airs = airs?;
        let joints_m: Vec<f64> = airs.iter().map(|air| air.joint_m).collect();
        Some(Self {
            drag: Off::of(airs.iter().map(|air| air.drag))?,
            wind_x_m_s: Off::of(airs.iter().map(|air| air.wind_x_m_s))?,
            wind_y_m_s: Off::of(airs.iter().map(|air| air.wind_y_m_s))?,
            joint_m: [rms(&joints_m)?, worst(&joints_m)?],
        })
    }
}

/// Against what happens if nobody corrects anything, session by session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AgainstNone {
    /// How much farther balls miss (root of the mean square) in the worst session, in
    /// scatter/√(number of balls).
    pub worst_sigmas: f64,
    /// Sessions in which that is more than 2.
    pub n_worse: usize,
    /// The seed of the worst.
    pub worst_seed: u64,
}

impl AgainstNone {
    fn of(sessions: &[Session], none: &[Session], scatter_m: f64) -> Option<Self> {
        let excess = |(session, none): (&Session, &Session)| {
            let sigma_m = scatter_m / (session.balls.len() as f64).sqrt();
            let by_m = session.miss_rms_m(0)? - none.miss_rms_m(0)?;
            (session.seed == none.seed).then_some((by_m / sigma_m, session.seed))
        };
        let excesses: Vec<(f64, u64)> = sessions.iter().zip(none).filter_map(excess).collect();
        let (worst_sigmas, worst_seed) =
            excesses.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0))?;
        let n_worse = excesses.iter().filter(|(sigmas, _)| *sigmas > 2.0).count();
        Some(Self { worst_sigmas, n_worse, worst_seed })
    }
}

/// One row.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What was played.
    pub variant: Variant,
    /// How many.
    pub n_sessions: usize,
    /// Of single balls around their mean.
    pub scatter_m: f64,
    /// After so many balls as [`AFTER`] says; `None` beyond the last.
    pub systematic: [Option<Systematic>; 7],
    /// After so many balls as [`AFTER_STEP`] says, counted from the change of the wind.
    pub after_step: Option<[Option<Systematic>; 7]>,
    /// Balls until the change is followed.
    pub n_until_followed: Option<usize>,
    /// What single balls miss by: root of the mean square.
    pub miss_rms_m: Option<f64>,
    /// Of those that left, in the net.
    pub in_net_percent: Option<f64>,
    /// Of those asked for, measured with their bounce.
    pub measured_percent: Option<f64>,
    /// What measured bounces are off by.
    pub measured_off_rms_m: Option<f64>,
    /// Against no correction.
    pub against_none: Option<AgainstNone>,
    /// Of the air.
    pub air: Option<AirRow>,
    /// The most that an attribution's sum is off a miss.
    pub unexplained_worst_m: Option<f64>,
}

impl Row {
    /// Sums up the sessions of a variant; `none` are those that nobody corrected.
    pub fn from_sessions(
        variant: Variant,
        sessions: &[Session],
        none: Option<&[Session]>,
        scatter_m: f64,
    ) -> Self {
        let balls = || sessions.iter().flat_map(|session| &session.balls);
        let misses_m: Vec<f64> = balls().filter_map(|b| b.miss_m).map(|m| m.norm()).collect();
        let in_net: Vec<bool> =
            balls().filter(|b| b.miss_m.is_some()).map(|b| b.is_in_net).collect();
        let is_measured: Vec<bool> = balls().map(|b| b.measured_off_m.is_some()).collect();
        let offs_m: Vec<f64> = balls().filter_map(|b| b.measured_off_m).collect();
        let unexplained_m: Vec<f64> =
            balls().filter_map(|b| b.learned.unexplained_m).map(f64::abs).collect();
        let is_step = variant.scene == Scene::WindStep;
        let after = |n_balls: usize| Systematic::of(sessions, n_balls);
        Self {
            variant,
            n_sessions: sessions.len(),
            scatter_m,
            systematic: AFTER.map(after),
            after_step: is_step.then(|| AFTER_STEP.map(|n| after(STEP_IDX + n))),
            n_until_followed: n_until_followed(sessions, scatter_m).filter(|_| is_step),
            miss_rms_m: rms(&misses_m),
            in_net_percent: percent_true(&in_net),
            measured_percent: percent_true(&is_measured).filter(|_| !offs_m.is_empty()),
            measured_off_rms_m: rms(&offs_m),
            against_none: none.and_then(|none| AgainstNone::of(sessions, none, scatter_m)),
            air: AirRow::of(sessions),
            unexplained_worst_m: worst(&unexplained_m),
        }
    }

    /// A systematic error over scatter/√n.
    pub fn ratio(&self, after_idx: usize) -> Option<f64> {
        let systematic = self.systematic[after_idx].as_ref()?;
        let allowed_m = self.scatter_m / (AFTER[after_idx].max(1) as f64).sqrt();
        Some(systematic.rms_m / allowed_m)
    }
}

/// From how many balls on the mean of all sessions stays near enough.
fn n_until_followed(sessions: &[Session], scatter_m: f64) -> Option<usize> {
    let near_m = FOLLOWED * scatter_m / 5f64.sqrt();
    let offs = (0..).map_while(|n| Systematic::of(sessions, STEP_IDX + n));
    let is_near: Vec<bool> = offs.map(|systematic| systematic.rms_m <= near_m).collect();
    let n_until = is_near.iter().rposition(|is_near| !is_near).map_or(0, |idx| idx + 1);
    (n_until < is_near.len()).then_some(n_until)
}

/// What single balls of a machine scatter by around each target's mean: both axes together.
pub fn scatter_m(build: Build, scene: Scene) -> f64 {
    let mut machine = Machine::with(Actuators::exact(build), SCATTER_SEED);
    if scene == Scene::Calm {
        machine.calm();
    }
    let world = World::default();
    let squares_m2 = targets::six().map(|target| {
        let told = targets::nominal(&target);
        let landings_m: Vec<Vector2<f64>> = (0..N_SCATTER_BALLS)
            .flat_map(|k| machine.fired(&told, k, 0.0).expect("it does"))
            .map(|fired| fired.landing_ignoring_net_m(&world))
            .collect();
        let mean_m = landings_m.iter().sum::<Vector2<f64>>() / landings_m.len() as f64;
        let squares: Vec<f64> = landings_m.iter().map(|l| (l - mean_m).norm_squared()).collect();
        mean(&squares).expect("balls were fired")
    });
    (squares_m2.iter().sum::<f64>() / N_TARGETS as f64).sqrt()
}

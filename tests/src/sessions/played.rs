//! A plan, a controller -> a session, ball by ball: aim, fire, look, learn.
//!
//! What is judged is the commanded mean: where the machine would land balls on average, were it
//! told what the controller would tell it now, for each of the six targets. Its distance from the
//! target is what is wrong systematically, free of scatter. It is worked out by the truth's own
//! integrator for the mean ball in the mean wind.
//! Conventions: errors are those *before* a ball, so number n is after n balls.

use fusion::Shot;
use nalgebra::Vector2;

use super::controllers::{Air, Controller, Learned};
use super::scene::Plan;
use super::sighted::Eyes;
use super::targets::{N_TARGETS, six};
use super::watched::Watched;
use crate::machine::Machine;
use crate::machine::told::Told;
use crate::truth::FlightEnd;
use crate::world::World;

/// From one launch to the next.
pub const PERIOD_S: f64 = 3.5;
/// The first launch; workers have learned the court by then.
pub const FIRST_LAUNCH_S: f64 = 0.85;
/// Frames before a launch belong to the ball before.
pub const MARGIN_S: f64 = 0.1;
/// A shot is a ball's if it was launched within this time of it.
const SAME_LAUNCH_S: f64 = 1.0;

/// One ball of a session.
#[derive(Clone, Debug)]
pub struct Ball {
    /// What was asked for.
    pub target_idx: usize,
    /// What the machine was told.
    pub told: Told,
    /// How far the commanded mean is from each target, before this ball.
    pub systematic_m: [f64; N_TARGETS],
    /// Where it truly landed, less where it should have, or where it would have but for the net;
    /// `None` if none left.
    pub miss_m: Option<Vector2<f64>>,
    /// Whether it ended in the net.
    pub is_in_net: bool,
    /// Whether it was measured with its bounce, and how far that is from the truth.
    pub measured_off_m: Option<f64>,
    /// Shots told of this ball that are not whole, or more than one.
    pub n_other_shots: usize,
    /// What the controller made of it.
    pub learned: Learned,
}

/// How far off a belief of the air is, with its sigmas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AirOff {
    /// Drag, as a part of the truth: off by, sigma.
    pub drag: [f64; 2],
    /// Wind along x: off by, sigma.
    pub wind_x_m_s: [f64; 2],
    /// Wind along y: off by, sigma.
    pub wind_y_m_s: [f64; 2],
    /// What all of it moves the landings of the six targets by: root of the mean square.
    pub joint_m: f64,
}

/// All that came of a session.
#[derive(Clone, Debug)]
pub struct Session {
    /// What it was drawn from.
    pub seed: u64,
    /// The machine it was played with.
    pub machine: Machine,
    /// All balls.
    pub balls: Vec<Ball>,
    /// How far the commanded mean is from each target, after the last ball.
    pub after_m: [f64; N_TARGETS],
    /// What was believed of the air after the last ball.
    pub air: Option<AirOff>,
}

impl Session {
    /// How far the commanded mean is off after so many balls: root of the mean square over the
    /// targets.
    pub fn systematic_m(&self, n_balls: usize) -> Option<f64> {
        let after = (n_balls == self.balls.len()).then_some(&self.after_m);
        let off_m = self.balls.get(n_balls).map(|ball| &ball.systematic_m).or(after)?;
        Some((off_m.iter().map(|m| m * m).sum::<f64>() / N_TARGETS as f64).sqrt())
    }

    /// Root of the mean square of what balls truly missed by, from a ball on.
    pub fn miss_rms_m(&self, from_idx: usize) -> Option<f64> {
        let misses = self.balls.iter().skip(from_idx).filter_map(|ball| ball.miss_m);
        let squares: Vec<f64> = misses.map(|miss_m| miss_m.norm_squared()).collect();
        crate::accuracy::figures::mean(&squares).map(f64::sqrt)
    }
}

/// Plays a session.
pub fn session(plan: &Plan, controller: &mut dyn Controller, eyes: Eyes) -> Session {
    let targets = six();
    let mut watched = Watched::new(plan.seed, eyes);
    let world = watched.scenario().world.clone();
    let mut balls = Vec::with_capacity(plan.n_balls());
    for (ball_idx, &target_idx) in plan.order.iter().enumerate() {
        let systematic_m = systematic_m(plan, controller, ball_idx, &world);
        let told = controller.told(target_idx);
        // Machine and cameras know nothing of each other.
        let phase_s = (ball_idx * 7 % 11) as f64 * 1e-3;
        let at_s = FIRST_LAUNCH_S + ball_idx as f64 * PERIOD_S + phase_s;
        let fired = plan.machine.fired(&told, ball_idx, at_s);
        let fired = fired.expect("a controller keeps to the limits");
        let flights: Vec<_> = fired.iter().map(|fired| fired.flight(&world)).collect();
        let flight = flights.first();
        let bounce = flight.and_then(|flight| flight.bounces.first());
        let bounced_m = bounce.map(|bounce| bounce.position_in_court_m.coords.xy());
        let landed_m = fired.first().map(|fired| fired.landing_ignoring_net_m(&world));
        let mut ball = Ball {
            target_idx,
            told,
            systematic_m,
            miss_m: landed_m.map(|landed_m| landed_m - targets[target_idx].landing_m),
            is_in_net: flight.is_some_and(|flight| flight.end == FlightEnd::Net),
            measured_off_m: None,
            n_other_shots: 0,
            learned: Learned::default(),
        };
        if controller.looks() {
            let until_s = at_s + PERIOD_S - MARGIN_S;
            let fault = plan.machine.fault(ball_idx);
            let shots = watched.shots(ball_idx, flights, until_s, fault);
            let shot = shot_of(&shots, at_s);
            ball.n_other_shots = shots.len() - usize::from(shot.is_some());
            let measured = shot.filter(|shot| shot.outcome == fusion::Outcome::Measured);
            ball.measured_off_m = measured
                .and_then(|shot| shot.bounce.as_ref())
                .zip(bounced_m)
                .map(|(bounce, bounced_m)| (bounce.position_m.coords.xy() - bounced_m).norm());
            ball.learned = controller.learn(target_idx, &told, shot);
        }
        balls.push(ball);
    }
    let after_m = systematic_m(plan, controller, plan.n_balls(), &world);
    let air = controller.air().map(|air| air_off(plan, controller, &air, &world));
    Session { seed: plan.seed, machine: plan.machine.clone(), balls, after_m, air }
}

/// The shot that was launched next to a time.
fn shot_of(shots: &[Shot], at_s: f64) -> Option<&Shot> {
    let apart_s = |shot: &Shot| {
        let launch = shot.launch.as_ref()?;
        let apart_s = (launch.t_ns as f64 * 1e-9 - at_s).abs();
        (apart_s <= SAME_LAUNCH_S).then_some(apart_s)
    };
    let near = shots.iter().filter_map(|shot| Some((apart_s(shot)?, shot)));
    near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, shot)| shot)
}

fn systematic_m(
    plan: &Plan,
    controller: &mut dyn Controller,
    ball_idx: usize,
    world: &World,
) -> [f64; N_TARGETS] {
    let targets = six();
    std::array::from_fn(|idx| {
        let told = controller.told(idx);
        let mean_m = plan.machine.mean_landing_m(&told, ball_idx, world);
        (mean_m - targets[idx].landing_m).norm()
    })
}

/// A belief against the truth of the last ball.
fn air_off(plan: &Plan, controller: &mut dyn Controller, air: &Air, world: &World) -> AirOff {
    let machine = &plan.machine;
    let last_idx = plan.n_balls().saturating_sub(1);
    // fusion's air has the density it assumes; what counts is density times drag.
    let drag = machine.balls.mean_drag(last_idx);
    let wind_m_s = machine.breeze.mean_at(last_idx);
    let believed_wind_m_s = Vector2::new(air.wind_x_m_s[0], air.wind_y_m_s[0]);
    let density = fusion::Settings::default().air_density_kg_m3 / world.air_density_kg_m3;
    let believed_drag = air.drag[0] * density;
    let squares = (0..N_TARGETS).map(|idx| {
        let told = controller.told(idx);
        let landing_m = |drag, wind| machine.landing_in_m(&told, last_idx, drag, wind, world);
        (landing_m(believed_drag, believed_wind_m_s) - landing_m(drag, wind_m_s)).norm_squared()
    });
    let joint_m = (squares.sum::<f64>() / N_TARGETS as f64).sqrt();
    AirOff {
        drag: [believed_drag / drag - 1.0, air.drag[1] * density / drag],
        wind_x_m_s: [air.wind_x_m_s[0] - wind_m_s.x, air.wind_x_m_s[1]],
        wind_y_m_s: [air.wind_y_m_s[0] - wind_m_s.y, air.wind_y_m_s[1]],
        joint_m,
    }
}

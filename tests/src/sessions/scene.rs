//! A name, a seed -> a machine with its weather and its balls, and the order of the targets.
//!
//! In every scene but the first the machine is 5 % too fast or too slow, 1.5 degrees too high or
//! too low and 1 degree aside, and its spin is 10 % of the limit off where it is greatest; the wind
//! is 1.5 m/s (1 sigma) along each axis, gusts are 0.5 m/s, and the balls' mean drag is 5 % (1
//! sigma) off what is assumed. In `calm` that wind has no gusts and all balls are alike, so that
//! nothing but the machine scatters.

use nalgebra::Vector2;
use rand::seq::SliceRandom;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::targets::N_TARGETS;
use crate::machine::Machine;
use crate::machine::actuators::{Actuators, Build};
use crate::machine::balls::{Balls, DRAG_COEFFICIENT};
use crate::machine::breeze::{Breeze, direction};
use crate::machine::faults;

/// What a session meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// Nothing: a machine that does as it is told, in air that is still but for gusts.
    Right,
    /// A machine that is off.
    Bias,
    /// The same in a steady wind, with balls that are all alike.
    Calm,
    /// The wind changes by 3 m/s.
    WindStep,
    /// Gusts of 0.5 m/s, and one of 2-3 m/s now and then that lasts for a ball or two.
    Gusts,
    /// The machine loses 1.25 % of its speed in 25 balls, and balls fluff up by 2.5 %.
    Wear,
    /// Dead balls, jams, two balls at once, cameras that see nothing.
    Faults,
}

/// The wind changes before this ball,
pub const STEP_IDX: usize = 12;
/// by this much.
pub const STEP_M_S: f64 = 3.0;
/// Offsets of speed (a part of it), elevation, azimuth (rad); spin's gain is in [`SPIN_GAIN`].
const OFFSETS: [f64; 4] = [0.05, 1.5 * DEGREE, DEGREE, 0.0];
/// Of spin, as a part of it: up to this, either way.
const SPIN_GAIN: f64 = 0.10;
/// 1 sigma of each axis of the wind, and of the balls' mean drag as a part of it.
const WIND_SIGMA_M_S: f64 = 1.5;
const DRAG_SIGMA: f64 = 0.05;
/// A strong gust begins with this part of the balls.
const STRONG_SHARE: f64 = 0.08;
/// Of a machine that warms up, and of balls that fluff up, with each ball.
const SPEED_DRIFT: f64 = -0.0005;
const DRAG_DRIFT: f64 = 0.001;
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// A session's own numbers come from this stream of the generator.
const SCENE_STREAM: u64 = 5;

impl Scene {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Right,
        Self::Bias,
        Self::Calm,
        Self::WindStep,
        Self::Gusts,
        Self::Wear,
        Self::Faults,
    ];

    /// What to ask for it by.
    pub fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Bias => "bias",
            Self::Calm => "calm",
            Self::WindStep => "wind-step",
            Self::Gusts => "gusts",
            Self::Wear => "wear",
            Self::Faults => "faults",
        }
    }

    /// The scene of this name.
    ///
    /// # Errors
    /// When there is none; the text lists those there are.
    pub fn from_name(name: &str) -> Result<Self, String> {
        let names = Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|scene| scene.name() == name);
        found.ok_or_else(|| format!("expected one of {names}, got {name:?}"))
    }
}

/// What a session is played with, whoever controls it.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// All chances come from this.
    pub seed: u64,
    /// What it meets.
    pub scene: Scene,
    /// The machine, its balls and its weather.
    pub machine: Machine,
    /// The target of each ball.
    pub order: Vec<usize>,
}

impl Plan {
    /// Draws a session of so many balls.
    pub fn drawn(seed: u64, scene: Scene, build: Build, n_balls: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(SCENE_STREAM);
        // In the same order for every scene, so that scenes of a seed can be compared.
        let order = mixed(n_balls, &mut rng);
        let actuators = Actuators::drawn(build, OFFSETS, &mut rng);
        let spin_gain = rng.random_range(-SPIN_GAIN..SPIN_GAIN);
        let normals: [f64; 3] = [(); 3].map(|()| rng.sample(StandardNormal));
        let step_m_s = direction(&mut rng) * STEP_M_S;
        let mut machine = if scene == Scene::Right {
            Machine::with(Actuators::exact(build), seed)
        } else {
            off_machine(actuators, spin_gain, normals, seed)
        };
        match scene {
            Scene::Right | Scene::Bias => (),
            Scene::Calm => machine.calm(),
            Scene::WindStep => machine.breeze.step = Some((STEP_IDX, step_m_s)),
            Scene::Gusts => {
                let breeze = machine.breeze.clone();
                machine.breeze = breeze.with_strong(STRONG_SHARE, n_balls, &mut rng);
            }
            Scene::Wear => {
                machine.actuators.axes[0].drift_per_ball = SPEED_DRIFT;
                machine.balls.drag_drift_per_ball = DRAG_DRIFT;
            }
            Scene::Faults => machine.faults = faults::drawn(n_balls, &mut rng),
        }
        Self { seed, scene, machine, order }
    }

    /// How many balls are asked for.
    pub fn n_balls(&self) -> usize {
        self.order.len()
    }
}

fn off_machine(actuators: Actuators, spin_gain: f64, normals: [f64; 3], seed: u64) -> Machine {
    let [x, y, drag] = normals;
    let mut machine = Machine::with(actuators, seed);
    let spin_max_rad_s = machine.limits.0[3].1;
    machine.actuators.axes[3].gain = spin_gain * spin_max_rad_s;
    machine.breeze = Breeze::around(Vector2::new(x, y) * WIND_SIGMA_M_S);
    // Nobody plays with balls beyond two sigma.
    let drag_scale = 1.0 + DRAG_SIGMA * drag.clamp(-2.0, 2.0);
    machine.balls = Balls { drag_coefficient: DRAG_COEFFICIENT * drag_scale, ..Balls::default() };
    machine
}

/// Six by six, each time in another order.
fn mixed(n_balls: usize, rng: &mut impl Rng) -> Vec<usize> {
    let mut order = Vec::with_capacity(n_balls + N_TARGETS);
    while order.len() < n_balls {
        let mut six: [usize; N_TARGETS] = std::array::from_fn(|idx| idx);
        six.shuffle(rng);
        order.extend(six);
    }
    order.truncate(n_balls);
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_of_a_seed_have_the_same_machine_and_order() {
        let [bias, step, faults] = [Scene::Bias, Scene::WindStep, Scene::Faults]
            .map(|scene| Plan::drawn(3, scene, Build::REAL, 25));
        assert_eq!(bias.order, step.order);
        assert_eq!(bias.machine.actuators, faults.machine.actuators);
        assert_eq!(bias.machine.breeze.mean_m_s, step.machine.breeze.mean_at(0));
        let stepped = step.machine.breeze.mean_at(STEP_IDX) - step.machine.breeze.mean_at(0);
        assert!((stepped.norm() - STEP_M_S).abs() < 1e-9);
        let other = Plan::drawn(4, Scene::Bias, Build::REAL, 25);
        assert_ne!(bias.machine, other.machine);
    }

    #[test]
    fn every_six_balls_have_every_target() {
        for six in Plan::drawn(9, Scene::Bias, Build::REAL, 24).order.chunks(N_TARGETS) {
            let mut sorted = six.to_vec();
            sorted.sort_unstable();
            assert_eq!(sorted, [0, 1, 2, 3, 4, 5]);
        }
    }

    #[test]
    fn a_name_means_one_scene() {
        for scene in Scene::ALL {
            assert_eq!(Scene::from_name(scene.name()), Ok(scene));
        }
        assert!(Scene::from_name("storm").unwrap_err().contains("right, bias, calm, wind-step"));
    }
}

//! A ball machine that is not there: settings in, launches out, with all that makes real ones miss.
//!
//! What is [`told`] is checked against the limits; the [`actuators`] make their own of it, each of
//! the [`balls`] has its own drag and lift, each flies through its own [`breeze`], and there are
//! [`faults`]. Everything that is left to chance is drawn with ChaCha8 from the machine's seed and
//! the ball's number alone: two controllers that play the same machine meet the same chances,
//! whatever they tell it.
//! Sources: 0.52 m along, 0.26 m across, 1.5 km/h at 86 km/h are the scatter of a real machine.
//! Deliberately absent: any code shared with the controller.

pub mod actuators;
pub mod balls;
pub mod breeze;
pub mod faults;
pub mod told;

use nalgebra::{Point3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::scenario::Launch;
use crate::truth::Flight;
use crate::world::World;
use actuators::Actuators;
use balls::Balls;
use breeze::Breeze;
use faults::Fault;
use told::{Limits, Refusal, Told};

/// Balls draw their chances from these streams of the generator; a session's other numbers come
/// from lower ones.
const FIRST_BALL_STREAM: u64 = 1 << 20;

/// A machine on its court.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// All chances come from this.
    pub seed: u64,
    /// Where it lets go of balls.
    pub position_in_court_m: Point3<f64>,
    /// What it can be told.
    pub limits: Limits,
    /// Its motors.
    pub actuators: Actuators,
    /// Its hopper.
    pub balls: Balls,
    /// The wind around it.
    pub breeze: Breeze,
    /// What goes wrong with each ball; nothing with those beyond the end.
    pub faults: Vec<Option<Fault>>,
    /// Somebody has pressed the emergency stop.
    pub is_stopped: bool,
}

/// What chance gives to a ball: numbers of a standard normal distribution.
struct Chances {
    machine: [f64; 4],
    ball: [f64; 2],
    gust: [f64; 2],
}

/// A ball that has left, and the air it flies through.
#[derive(Clone, Debug, PartialEq)]
pub struct Fired {
    /// How it left.
    pub launch: Launch,
    /// Of this ball.
    pub wind_m_s: Vector2<f64>,
}

impl Fired {
    /// The flight of it.
    pub fn flight(&self, world: &World) -> Flight {
        Flight::from_launch(&windy(world, self.wind_m_s), &self.launch)
    }

    /// Where it lands if no net is there.
    pub fn landing_ignoring_net_m(&self, world: &World) -> Vector2<f64> {
        let world = windy(world, self.wind_m_s);
        landing_m(&world, &self.launch)
    }
}

impl Machine {
    /// One with such motors, in still air and with balls as new; thesis' limits and place.
    pub fn with(actuators: Actuators, seed: u64) -> Self {
        Self {
            seed,
            position_in_court_m: Point3::new(0.0, 0.0, 1.0),
            limits: Limits::of_thesis(),
            actuators,
            balls: Balls::default(),
            breeze: Breeze::around(Vector2::zeros()),
            faults: Vec::new(),
            is_stopped: false,
        }
    }

    /// Takes gusts out of the wind, and makes all balls alike.
    pub fn calm(&mut self) {
        self.breeze.gust_sigma_m_s = 0.0;
        (self.balls.drag_scatter, self.balls.lift_scatter) = (0.0, 0.0);
    }

    /// What is wrong with a ball.
    pub fn fault(&self, ball_idx: usize) -> Option<Fault> {
        self.faults.get(ball_idx).copied().flatten()
    }

    /// The ball of this number, or none, or two, from a time on.
    ///
    /// # Errors
    /// When it is told what it cannot do, or was stopped.
    pub fn fired(&self, told: &Told, ball_idx: usize, at_s: f64) -> Result<Vec<Fired>, Refusal> {
        if self.is_stopped {
            return Err(Refusal::Stopped);
        }
        self.limits.check(told)?;
        let mean = self.actuators.mean(&self.limits, told, ball_idx);
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(FIRST_BALL_STREAM + ball_idx as u64);
        let mut one = |at_s: f64| {
            let chances = Chances {
                machine: [(); 4].map(|()| rng.sample(StandardNormal)),
                ball: [(); 2].map(|()| rng.sample(StandardNormal)),
                gust: [(); 2].map(|()| rng.sample(StandardNormal)),
            };
            let left = self.actuators.scattered(&mean, &chances.machine);
            let [drag, lift] = self.balls.drawn(ball_idx, chances.ball);
            let launch = self.launch(&left, at_s, drag, lift);
            Fired { launch, wind_m_s: self.breeze.of_ball(ball_idx, chances.gust) }
        };
        let mut fired = vec![one(at_s)];
        match self.fault(ball_idx) {
            Some(Fault::Jam) => fired.clear(),
            Some(Fault::Dead) => fired[0].launch.speed_m_s *= faults::DEAD_SPEED,
            Some(Fault::Two) => fired.push(one(at_s + faults::TWO_APART_S)),
            Some(Fault::Blocked(_) | Fault::BothBlocked) | None => (),
        }
        Ok(fired)
    }

    /// Where balls land on average if it is told so: the mean ball, the mean wind, no net.
    pub fn mean_landing_m(&self, told: &Told, ball_idx: usize, world: &World) -> Vector2<f64> {
        let mean = self.actuators.mean(&self.limits, told, ball_idx);
        let launch = self.launch(&mean, 0.0, self.balls.mean_drag(ball_idx), 1.0);
        let world = windy(world, self.breeze.mean_at(ball_idx));
        landing_m(&world, &launch)
    }

    /// Where a flight of the mean ball lands if drag and wind are these.
    pub fn landing_in_m(
        &self,
        told: &Told,
        ball_idx: usize,
        drag_coefficient: f64,
        wind_m_s: Vector2<f64>,
        world: &World,
    ) -> Vector2<f64> {
        let mean = self.actuators.mean(&self.limits, told, ball_idx);
        let launch = self.launch(&mean, 0.0, drag_coefficient, 1.0);
        landing_m(&windy(world, wind_m_s), &launch)
    }

    fn launch(&self, left: &Told, at_s: f64, drag_coefficient: f64, lift_scale: f64) -> Launch {
        Launch {
            launched_at_s: at_s,
            position_in_court_m: self.position_in_court_m,
            speed_m_s: left.speed_m_s,
            elevation_rad: left.elevation_rad,
            azimuth_rad: left.azimuth_rad,
            backspin_rad_s: left.backspin_rad_s,
            drag_coefficient,
            lift_scale,
        }
    }
}

fn windy(world: &World, wind_m_s: Vector2<f64>) -> World {
    World { wind_m_s: Vector3::new(wind_m_s.x, wind_m_s.y, 0.0), ..world.clone() }
}

/// Without net and fence: a fast ball before a gust flies as far as that.
fn landing_m(world: &World, launch: &Launch) -> Vector2<f64> {
    let open = World { fence_y_m: f64::INFINITY, ..world.clone() };
    let bounce = Flight::first_bounce_ignoring_net(&open, launch);
    bounce.expect("a ball within the limits comes down").position_in_court_m.coords.xy()
}

#[cfg(test)]
mod tests;

//! Shots -> what to tell the machine for the next one: the ways that are compared.

use fusion::aim::{Scatter, Wanted};
use fusion::control::{Aimed, Control, OutOfReach};
use fusion::world::rebound::HARD_COURT;
use fusion::{Outcome, Shot};
use nalgebra::Vector2;

use super::targets::{N_TARGETS, Nominal, Target, six};
use crate::machine::actuators::Build;
use crate::machine::told::Told;

/// What a controller believes of the air, and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Mean drag coefficient, and 1 sigma.
    pub drag: [f64; 2],
    /// Wind along x, and 1 sigma.
    pub wind_x_m_s: [f64; 2],
    /// Wind along y, and 1 sigma.
    pub wind_y_m_s: [f64; 2],
}

/// What a controller made of a shot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Learned {
    /// Of the miss less the sum of what it is attributed to; `None` if nothing was attributed.
    pub unexplained_m: Option<f64>,
    /// In its own words.
    pub sentence: String,
}

/// Something that corrects a machine.
pub trait Controller {
    /// What to tell the machine for a target, as far as is known now. Changes nothing.
    fn told(&mut self, target_idx: usize) -> Told;

    /// A ball that was asked for, and what was measured of it.
    fn learn(&mut self, target_idx: usize, told: &Told, shot: Option<&Shot>) -> Learned;

    /// What it believes of the air, if it does.
    fn air(&self) -> Option<Air> {
        None
    }

    /// Whether it wants to know what was measured.
    fn looks(&self) -> bool {
        true
    }
}

/// Names of all controllers.
pub const NAMES: [&str; 3] = ["none", "integrator", "control"];

/// The controller of this name for a kind of machine, before the first ball.
///
/// # Errors
/// When there is none; the text lists those there are.
pub fn from_name(name: &str, build: &Build) -> Result<Box<dyn Controller>, String> {
    match name {
        "none" => Ok(Box::new(Blind::default())),
        "integrator" => Ok(Box::new(Integrator::default())),
        "control" => Ok(Box::new(ByModel::new(build))),
        _ => Err(format!("expected one of {}, got {name:?}", NAMES.join(", "))),
    }
}

/// Aims once, and never looks.
pub struct Blind {
    told: [Told; N_TARGETS],
}

impl Default for Blind {
    fn default() -> Self {
        let nominal = Nominal::default();
        let told =
            |target: Target| nominal.told(&target.wanted(Vector2::zeros(), &nominal.machine));
        Self { told: six().map(told) }
    }
}

impl Controller for Blind {
    fn told(&mut self, target_idx: usize) -> Told {
        self.told[target_idx]
    }

    fn learn(&mut self, _: usize, _: &Told, _: Option<&Shot>) -> Learned {
        Learned::default()
    }

    fn looks(&self) -> bool {
        false
    }
}

/// Part of a miss that an integrator takes back.
const GAIN: f64 = 0.5;
/// It never aims farther aside than this: the machine's end, or the net's, would be near.
const ASIDE_MAX_M: f64 = 3.0;

/// For each target: the aim goes back by half of each miss (the classical iterative learning
/// control). The flight's inverse turns metres into settings.
pub struct Integrator {
    nominal: Nominal,
    aside_m: [Vector2<f64>; N_TARGETS],
    told: [Option<Told>; N_TARGETS],
}

impl Default for Integrator {
    fn default() -> Self {
        Self {
            nominal: Nominal::default(),
            aside_m: [Vector2::zeros(); N_TARGETS],
            told: [None; N_TARGETS],
        }
    }
}

impl Controller for Integrator {
    fn told(&mut self, target_idx: usize) -> Told {
        let Self { nominal, aside_m, told } = self;
        *told[target_idx].get_or_insert_with(|| {
            nominal.told(&six()[target_idx].wanted(aside_m[target_idx], &nominal.machine))
        })
    }

    fn learn(&mut self, target_idx: usize, _: &Told, shot: Option<&Shot>) -> Learned {
        let measured = shot.filter(|shot| shot.outcome == Outcome::Measured);
        if let Some(bounce) = measured.and_then(|shot| shot.bounce.as_ref()) {
            let miss_m = bounce.position_m.coords.xy() - six()[target_idx].landing_m;
            let aside_m = self.aside_m[target_idx] - miss_m * GAIN;
            self.aside_m[target_idx] = aside_m.map(|m| m.clamp(-ASIDE_MAX_M, ASIDE_MAX_M));
            self.told[target_idx] = None;
        }
        Learned::default()
    }
}

/// `fusion`'s own, which is told how the machine scatters as its maker would say it: of the real
/// one what is usual.
pub struct ByModel {
    nominal: Nominal,
    control: Control,
}

impl ByModel {
    /// Before the first ball.
    pub fn new(build: &Build) -> Self {
        let mut nominal = Nominal::default();
        if *build == Build::PRECISE {
            let [speed_part, elevation_rad, azimuth_rad, _] = build.scatter;
            let spin_part = build.spin_scatter;
            nominal.machine.scatter = Scatter { speed_part, elevation_rad, azimuth_rad, spin_part };
        }
        let control = Control::new(nominal.machine.clone(), nominal.physics, HARD_COURT);
        Self { nominal, control }
    }

    fn wanted(&self, target_idx: usize) -> Wanted {
        six()[target_idx].wanted(Vector2::zeros(), &self.nominal.machine)
    }
}

/// The nearest if it is out of reach.
fn or_nearest(aimed: Result<Aimed, Box<OutOfReach>>) -> Aimed {
    aimed.unwrap_or_else(|why| why.nearest.expect("a shot that passes the net"))
}

/// In `fusion`'s order, which is the same.
fn told_from(aimed: &Aimed) -> Told {
    Told::from_numbers(aimed.commanded.settings())
}

impl Controller for ByModel {
    fn told(&mut self, target_idx: usize) -> Told {
        told_from(&or_nearest(self.control.preview(&self.wanted(target_idx))))
    }

    fn learn(&mut self, target_idx: usize, told: &Told, shot: Option<&Shot>) -> Learned {
        let aimed = or_nearest(self.control.aimed(&self.wanted(target_idx)));
        assert_eq!(told_from(&aimed), *told, "told as it was asked");
        let Some(shot) = shot else { return Learned::default() };
        let correction = self.control.update(&aimed, shot);
        let sum_m = correction.parts.iter().map(|part| part.off_m).sum::<Vector2<f64>>();
        let miss_m = correction.miss_m.filter(|_| !correction.parts.is_empty());
        Learned {
            unexplained_m: miss_m.map(|miss_m| (miss_m - sum_m).norm()),
            sentence: correction.sentence,
        }
    }

    fn air(&self) -> Option<Air> {
        let [drag, wind_x_m_s, wind_y_m_s] = self.control.air();
        Some(Air { drag, wind_x_m_s, wind_y_m_s })
    }
}

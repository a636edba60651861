//! Balls of a session -> what came of it: per target and for machine, air and court.
//!
//! [`Session`] takes ball after ball and keeps what a report needs; [`summary`] is what follows
//! from it (the JSON "session/1"), [`table`] every ball as CSV, and [`picture`] all of it on one
//! page.
//!
//! Court frame, SI; the three ways out use degrees, km/h and rpm.

pub mod pace;
pub mod picture;
pub mod scatter;
pub mod summary;
pub mod table;

use crate::aim::Wanted;
use crate::control::actuators::OFFSETS;
use crate::control::attributed::Part;
use crate::control::{Aimed, Control, Correction, Trust};
use crate::shot::{Bounce, Shot};
use nalgebra::{Matrix2, Vector2};

/// Balls of a day, one every three seconds. What comes after is counted and not kept.
pub const MAX_BALLS: usize = 28_800;

/// Most targets of a session: a drill's, and what is wanted besides.
pub const MAX_TARGETS: usize = 400;

/// The zone of what is wanted without a drill.
const ZONE_RADIUS_M: f64 = 1.0;

/// Something to aim at.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// For people.
    pub name: String,
    /// What is wanted.
    pub wanted: Wanted,
    /// A ball within this distance is in the zone.
    pub zone_radius_m: f64,
}

/// What is believed of the air, and its sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    /// Drag coefficient, wind x and y (m/s).
    pub value: [f64; 3],
    /// 1 sigma of each.
    pub sigma: [f64; 3],
}

/// What is believed of the machine, and its sigma, at settings in the middle of its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Machine {
    /// What it does more than it is told: parts of the speed, elevation and azimuth (rad), backspin
    /// (rad/s).
    pub value: [f64; 4],
    /// 1 sigma of each.
    pub sigma: [f64; 4],
}

/// One ball.
#[derive(Debug, Clone)]
pub struct Ball {
    /// Which target it was for.
    pub target_idx: usize,
    /// Since the session began.
    pub at_s: f64,
    /// What the machine was told: m/s, rad, rad, rad/s.
    pub settings: [f64; 4],
    /// Where it came down; None if that was not measured.
    pub bounce: Option<Bounce>,
    /// Whether it was believed; None if no ball was seen.
    pub trust: Option<Trust>,
    /// Why it missed.
    pub parts: Vec<Part>,
    /// In words.
    pub sentence: String,
    /// What was believed of the air after it.
    pub air: Air,
}

impl Ball {
    /// Where it came down, less where it should have.
    #[must_use]
    pub fn miss_m(&self, targets: &[Target]) -> Option<Vector2<f64>> {
        let wanted_m = targets.get(self.target_idx)?.wanted.landing_m();
        Some(self.bounce.as_ref()?.position_m.coords.xy() - wanted_m)
    }

    /// How well that is known.
    #[must_use]
    pub fn covariance_m2(&self) -> Option<Matrix2<f64>> {
        self.bounce.as_ref().map(|bounce| Matrix2::from(bounce.covariance_m2))
    }
}

/// All balls so far.
#[derive(Debug, Clone)]
pub struct Session {
    targets: Vec<Target>,
    balls: Vec<Ball>,
    machine: Option<Machine>,
    n_left_out: u64,
}

impl Session {
    /// Nothing was fired yet.
    #[must_use]
    pub fn new(targets: Vec<Target>) -> Self {
        Self { targets, balls: Vec::new(), machine: None, n_left_out: 0 }
    }

    /// What is aimed at.
    #[must_use]
    pub fn targets(&self) -> &[Target] {
        &self.targets
    }

    /// In the order they were fired.
    #[must_use]
    pub fn balls(&self) -> &[Ball] {
        &self.balls
    }

    /// What was believed of the machine after the last ball.
    #[must_use]
    pub fn machine(&self) -> Option<&Machine> {
        self.machine.as_ref()
    }

    /// Balls beyond [`MAX_BALLS`].
    #[must_use]
    pub fn n_left_out(&self) -> u64 {
        self.n_left_out
    }

    /// Takes a ball in: when, what was told, and what came of it, if a ball was seen; `control` is
    /// what was believed afterwards. What was wanted may be a new target, then of this name.
    pub fn note(
        &mut self,
        name: &str,
        at_s: f64,
        aimed: &Aimed,
        seen: Option<(&Shot, &Correction)>,
        control: &Control,
    ) {
        let Some(target_idx) =
            self.target_idx(name, &aimed.wanted).filter(|_| self.balls.len() < MAX_BALLS)
        else {
            self.n_left_out += 1;
            return;
        };
        let (air, machine) = believed(control);
        self.machine = Some(machine);
        self.balls.push(Ball {
            target_idx,
            at_s,
            settings: aimed.commanded.settings(),
            bounce: seen.and_then(|(shot, _)| shot.bounce.clone()),
            trust: seen.map(|(_, correction)| correction.trust),
            parts: seen.map(|(_, correction)| correction.parts.clone()).unwrap_or_default(),
            sentence: seen
                .map_or("no ball was seen", |(_, correction)| correction.sentence.as_str())
                .to_owned(),
            air,
        });
    }
}

impl Session {
    fn target_idx(&mut self, name: &str, wanted: &Wanted) -> Option<usize> {
        let known = self.targets.iter().position(|target| target.wanted == *wanted);
        if known.is_none() && self.targets.len() < MAX_TARGETS {
            let (name, zone_radius_m) = (name.to_owned(), ZONE_RADIUS_M);
            self.targets.push(Target { name, wanted: *wanted, zone_radius_m });
            return Some(self.targets.len() - 1);
        }
        known
    }
}

fn believed(control: &Control) -> (Air, Machine) {
    let (mean, covariance) = (control.belief().mean(), control.belief().covariance());
    let air = control.air();
    let machine = Machine {
        value: OFFSETS.map(|i| mean[i]),
        sigma: OFFSETS.map(|i| covariance[(i, i)].sqrt()),
    };
    (Air { value: air.map(|[value, _]| value), sigma: air.map(|[_, sigma]| sigma) }, machine)
}

#[cfg(test)]
mod tests;

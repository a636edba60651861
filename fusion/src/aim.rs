//! A wanted shot → what to tell the machine, so that [`Reference`] says it lands there.
//!
//! Four numbers are told: speed, elevation, azimuth, spin. The landing place takes two of them, two
//! [`Shape`]s the others. Newton's method on the flight with its exact derivatives
//! ([`trajectory`](crate::world::trajectory)), from a parabola's solutions: the flat one and the
//! lob both, where both exist. What lies beyond the machine's limits or too near the net is refused
//! with the [`nearest`] shot it can do.
//!
//! Court frame; the physics must be those of a rig that knows the court.

pub mod machine;
pub mod machine_toml;
pub mod nearest;
mod starts;

pub use machine::{Machine, Scatter};
pub use nearest::Unreachable;

use crate::landed::{Departure, at_level, longest_flight_s};
use crate::reference::{Commanded, Reference, Refused, apex_s};
use crate::world::acceleration::Breeze;
use crate::world::ball::Physics;
use crate::world::court;
use crate::world::rebound::Surface;
use crate::world::trajectory::{Here, Trajectory};
use nalgebra::{Matrix4, Point3, Vector2, Vector4};

/// What else a shot should be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// At the launcher.
    SpeedMS(f64),
    /// Topspin is negative.
    BackspinRadS(f64),
    /// Of the ball's centre over the ground, in the net's plane.
    NetHeightM(f64),
    /// Of the ball's centre over the ground, where it is highest.
    ApexM(f64),
}

/// A shot that a coach wants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    landing_m: Vector2<f64>,
    shapes: [Shape; 2],
}

/// Beside and behind the court a ball may be wanted too, but not just behind the net.
const SIDE_MAX_M: f64 = 8.0;
const Y_RANGE_M: std::ops::RangeInclusive<f64> = court::NET_Y_M + 1.0..=court::LENGTH_M + 5.0;

impl Shape {
    fn check(self) -> Result<(), Refused> {
        let (field, got, range, expected) = match self {
            Self::SpeedMS(got) => ("speed_m_s", got, 1.0..=70.0, "1 to 70 m/s"),
            Self::BackspinRadS(got) => ("backspin_rad_s", got, -600.0..=600.0, "-600 to 600 rad/s"),
            Self::NetHeightM(got) => ("net_height_m", got, 0.95..=20.0, "0.95 to 20 m"),
            Self::ApexM(got) => ("apex_m", got, 0.1..=20.0, "0.1 to 20 m"),
        };
        // Not a number is in no range.
        if range.contains(&got) { Ok(()) } else { Err(Refused { field, got, expected }) }
    }
}

impl Wanted {
    /// A landing place and one or two shapes. Without a second one the ball has no spin; if spin is
    /// the first, it has the middle of the machine's speeds.
    ///
    /// # Errors
    /// [`Refused`] when a number is out of range, or both shapes say the same.
    pub fn new(
        landing_m: Vector2<f64>,
        first: Shape,
        second: Option<Shape>,
        machine: &Machine,
    ) -> Result<Self, Refused> {
        let [x, y] = landing_m.into();
        for (field, got, is_fit, expected) in [
            ("landing x_m", x, x.abs() <= SIDE_MAX_M, "-8 to 8 m"),
            ("landing y_m", y, Y_RANGE_M.contains(&y), "12.885 to 28.77 m, beyond the net"),
        ] {
            if !is_fit {
                return Err(Refused { field, got, expected });
            }
        }
        let second = second.unwrap_or(match first {
            Shape::BackspinRadS(_) => {
                let [least, most] = [machine.speed_m_s.start(), machine.speed_m_s.end()];
                Shape::SpeedMS(0.5 * (least + most))
            }
            _ => Shape::BackspinRadS(0.0),
        });
        first.check()?;
        second.check()?;
        if std::mem::discriminant(&first) == std::mem::discriminant(&second) {
            let expected = "one that differs in kind from the first";
            return Err(Refused { field: "second shape", got: f64::NAN, expected });
        }
        Ok(Self { landing_m, shapes: [first, second] })
    }

    /// Where it should touch the ground.
    #[must_use]
    pub fn landing_m(&self) -> Vector2<f64> {
        self.landing_m
    }
}

/// What the flight depends on besides the command.
#[derive(Debug, Clone, Copy)]
pub struct Conditions<'a> {
    /// Drag of the balls in use, and wind.
    pub breeze: &'a Breeze,
    /// Gravity, density, the ball.
    pub physics: &'a Physics,
    /// For what follows the bounce.
    pub surface: &'a Surface,
}

/// A command and the flight that should follow.
#[derive(Clone)]
pub struct Solution {
    /// What to tell the machine.
    pub commanded: Commanded,
    /// What should come of it.
    pub reference: Reference,
}

/// All commands within the machine's limits that make the wanted shot, the flattest first.
///
/// # Errors
/// [`Unreachable`] with the nearest shot when there is none.
pub fn aim(
    wanted: &Wanted,
    machine: &Machine,
    conditions: &Conditions<'_>,
) -> Result<Vec<Solution>, Box<Unreachable>> {
    let mut found: Vec<Tried> = Vec::new();
    let mut tried: Vec<Vector4<f64>> = Vec::new();
    for start in starts::of(wanted, machine, conditions.physics) {
        let Some(solved) = solved(start, wanted, machine, conditions) else { continue };
        let is_known = tried.iter().any(|other| (other - solved.settings).norm() < SAME);
        if !is_known {
            tried.push(solved.settings);
            if machine.allows(&solved.settings, solved.clearance_m) {
                found.push(solved);
            }
        }
    }
    found.sort_by(|a, b| a.settings[ELEVATION].total_cmp(&b.settings[ELEVATION]));
    let solutions: Vec<Solution> =
        found.iter().filter_map(|tried| solution(&tried.settings, machine, conditions)).collect();
    if solutions.is_empty() {
        return Err(Box::new(nearest::of(wanted, machine, conditions, &tried)));
    }
    Ok(solutions)
}

/// Order of the settings: m/s, rad, rad, and backspin in rad/s.
const SPEED: usize = 0;
const ELEVATION: usize = 1;
const AZIMUTH: usize = 2;
const BACKSPIN: usize = 3;

/// Two solutions nearer than this are one.
const SAME: f64 = 1e-2;

/// Newton's steps: five are enough from a good start.
const N_STEPS_MAX: usize = 15;

/// Longest step of each setting: a flight bends.
const STEP_MAX: [f64; 4] = [4.0, 0.06, 0.1, 150.0];

/// A tenth of a millimetre, of a millimetre a second and so on.
const SOLVED: f64 = 1e-4;

/// Spin counts so much less than metres: 1 rad/s moves a landing by 3 cm.
const SPIN_SCALE: f64 = 0.03;

/// A flight and how far it is from what is wanted.
#[derive(Debug, Clone, Copy)]
struct Tried {
    settings: Vector4<f64>,
    /// Landing x and y, and both shapes: what it is less what is wanted.
    off: Vector4<f64>,
    d_off: Matrix4<f64>,
    /// Between the ball and the net's edge.
    clearance_m: f64,
    d_clearance: Vector4<f64>,
}

fn solved(
    start: Vector4<f64>,
    wanted: &Wanted,
    machine: &Machine,
    conditions: &Conditions<'_>,
) -> Option<Tried> {
    let mut settings = start;
    for _ in 0..N_STEPS_MAX {
        let here = tried(&settings, wanted, machine, conditions)?;
        if here.off.norm() < SOLVED {
            return Some(here);
        }
        let step = here.d_off.lu().solve(&-here.off)?;
        for (i, most) in STEP_MAX.into_iter().enumerate() {
            settings[i] += step[i].clamp(-most, most);
        }
    }
    None
}

/// Flies a command; None if it does not come down, or not beyond the net.
fn tried(
    settings: &Vector4<f64>,
    wanted: &Wanted,
    machine: &Machine,
    conditions: &Conditions<'_>,
) -> Option<Tried> {
    let [speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s] = (*settings).into();
    let launch = [speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s, 0.0, 0.0];
    let departure = Departure::new(machine.launcher_in_court_m, launch);
    let by_settings = |here: &Here| departure.slope(here).fixed_columns::<4>(0).into_owned();
    let Conditions { breeze, physics, .. } = *conditions;
    let longest_s = longest_flight_s(departure.aloft.velocity_m_s.z, physics);
    let trajectory = Trajectory::new(&departure.aloft, breeze, physics, 0.0, longest_s);
    let flight_s = trajectory.time_at_level(2, physics.ball.radius_m(), -1.0, 0.0)?;
    let net_s = trajectory.time_at_level(1, court::NET_Y_M, 1.0, 0.0)?;

    let landed = trajectory.place_at(flight_s);
    let d_landed = at_level(&landed, &by_settings(&landed), 2);
    let at_net = trajectory.place_at(net_s);
    let d_net = at_level(&at_net, &by_settings(&at_net), 1);
    let edge_m = net_height_m(at_net.position_m.x);
    let mut off = Vector4::zeros();
    let mut d_off = Matrix4::zeros();
    for i in 0..2 {
        off[i] = landed.position_m[i] - wanted.landing_m[i];
        d_off.set_row(i, &d_landed.row(i));
    }
    for (i, shape) in wanted.shapes.into_iter().enumerate() {
        let row = i + 2;
        match shape {
            Shape::SpeedMS(wanted) => {
                off[row] = speed_m_s - wanted;
                d_off[(row, SPEED)] = 1.0;
            }
            Shape::BackspinRadS(wanted) => {
                off[row] = (backspin_rad_s - wanted) * SPIN_SCALE;
                d_off[(row, BACKSPIN)] = SPIN_SCALE;
            }
            Shape::NetHeightM(wanted) => {
                off[row] = at_net.position_m.z - wanted;
                d_off.set_row(row, &d_net.row(2));
            }
            Shape::ApexM(wanted) => {
                let highest = trajectory.place_at(apex_s(&trajectory, flight_s));
                off[row] = highest.position_m.z - wanted;
                d_off.set_row(row, &by_settings(&highest).row(2));
            }
        }
    }
    let clearance_m = if net_s < flight_s {
        at_net.position_m.z - physics.ball.radius_m() - edge_m
    } else {
        -edge_m // it bounces before
    };
    let d_clearance = d_net.row(2).transpose();
    Some(Tried { settings: *settings, off, d_off, clearance_m, d_clearance })
}

/// Of the net's edge: it sags from the posts, 0.914 m beside the doubles court, to the middle.
fn net_height_m(x_m: f64) -> f64 {
    let to_post = (x_m.abs() / (court::DOUBLES_HALF_WIDTH_M + 0.914)).min(1.0);
    let sag_m = court::NET_POST_HEIGHT_M - court::NET_CENTER_HEIGHT_M;
    court::NET_CENTER_HEIGHT_M + sag_m * to_post
}

fn solution(
    settings: &Vector4<f64>,
    machine: &Machine,
    conditions: &Conditions<'_>,
) -> Option<Solution> {
    let [speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s] = (*settings).into();
    let commanded = Commanded::new(speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s).ok()?;
    let Conditions { breeze, physics, surface } = *conditions;
    let launcher: Point3<f64> = machine.launcher_in_court_m;
    let reference = Reference::new(&commanded, launcher, breeze, physics, surface)?;
    Some(Solution { commanded, reference })
}

#[cfg(test)]
mod tests;

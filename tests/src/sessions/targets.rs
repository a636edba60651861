//! The six shots that a session mixes: deep and short, left and right, fast and slow, with spin and
//! without, and a lob. Each is within the machine's limits even if the machine is 5 % too fast or
//! too slow, 1.5 degrees too high or low and 1 degree aside.

use fusion::aim::{self, Conditions, Shape, Wanted};
use fusion::world::acceleration::Breeze;
use fusion::world::ball::{DRAG_COEFFICIENT, Physics};
use fusion::world::rebound::HARD_COURT;
use fusion::{Rig, Settings};
use nalgebra::Vector2;

use crate::machine::told::Told;
use crate::scenario::Scenario;
use crate::shot_folder;

/// How many there are.
pub const N_TARGETS: usize = 6;

/// A shot that a coach asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// What it is called.
    pub name: &'static str,
    /// Where it should land.
    pub landing_m: Vector2<f64>,
    /// What else it should be.
    pub shapes: [Shape; 2],
}

/// All of them.
pub fn six() -> [Target; N_TARGETS] {
    let target = |name, x_m, y_m, shape, backspin_rpm: f64| Target {
        name,
        landing_m: Vector2::new(x_m, y_m),
        shapes: [shape, Shape::BackspinRadS(backspin_rpm * std::f64::consts::PI / 30.0)],
    };
    let speed = |km_h: f64| Shape::SpeedMS(km_h / 3.6);
    [
        target("deep left", -2.5, 22.0, speed(95.0), -600.0),
        target("deep right", 2.5, 21.5, speed(86.0), 0.0),
        target("short left", -1.8, 16.8, speed(68.0), -400.0),
        target("short right", 1.8, 17.5, speed(72.0), 500.0),
        target("lob", 0.5, 20.5, Shape::ApexM(4.0), 0.0),
        target("middle", 0.0, 20.0, speed(98.0), -900.0),
    ]
}

impl Target {
    /// As `fusion` is asked for it; landing elsewhere by so much.
    ///
    /// # Panics
    /// When it is none that can be asked for: a mistake in [`six`].
    pub fn wanted(&self, off_m: Vector2<f64>, machine: &aim::Machine) -> Wanted {
        let [first, second] = self.shapes;
        Wanted::new(self.landing_m + off_m, first, Some(second), machine).expect("a fair shot")
    }
}

/// What an aim needs to know, as somebody knows it who has seen no ball.
#[derive(Clone, Debug)]
pub struct Nominal {
    /// The thesis' machine.
    pub machine: aim::Machine,
    /// Of the reference rig's court.
    pub physics: Physics,
}

impl Default for Nominal {
    fn default() -> Self {
        let rig = shot_folder::rig_toml(&Scenario::empty()).parse::<Rig>();
        let rig = rig.expect("a rig as fusion reads it");
        let air_density_kg_m3 = Settings::default().air_density_kg_m3;
        let physics = Physics { air_density_kg_m3, ..rig.physics() };
        Self { machine: aim::Machine::of_thesis(), physics }
    }
}

impl Nominal {
    /// What to tell a machine that does as it is told, in still air, with middling balls. Of what
    /// is out of reach the nearest.
    ///
    /// # Panics
    /// When no shot passes the net.
    pub fn told(&self, wanted: &Wanted) -> Told {
        let breeze = Breeze { drag_coefficient: DRAG_COEFFICIENT, wind_m_s: Vector2::zeros() };
        let Self { machine, physics } = self;
        let conditions = Conditions { breeze: &breeze, physics, surface: &HARD_COURT };
        let solution = match aim::aim(wanted, machine, &conditions) {
            Ok(mut solutions) => solutions.swap_remove(0),
            Err(why) => why.nearest.expect("a shot that passes the net"),
        };
        Told::from_numbers(solution.commanded.settings())
    }
}

/// [`Nominal::told`] for a target.
pub fn nominal(target: &Target) -> Told {
    let nominal = Nominal::default();
    nominal.told(&target.wanted(Vector2::zeros(), &nominal.machine))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use crate::machine::actuators::{Actuators, Build};
    use crate::truth::Flight;
    use crate::world::World;

    #[test]
    fn every_target_is_within_the_limits_with_margin_and_over_the_net() {
        let limits = crate::machine::told::Limits::of_thesis();
        let world = World::default();
        for target in six() {
            let told = nominal(&target);
            let [speed, elevation, azimuth, spin] = told.numbers();
            println!(
                "{}: {:.1} km/h, {:.2} deg up, {:.2} deg aside, {:.0} rad/s",
                target.name,
                speed * 3.6,
                elevation.to_degrees(),
                azimuth.to_degrees(),
                spin
            );
            for sign in [-1.0, 1.0] {
                let corner = [
                    speed * (1.0 + 0.05 * sign),
                    elevation + sign * 1.5f64.to_radians(),
                    azimuth + sign * 1f64.to_radians(),
                    spin * (1.0 + 0.2 * sign),
                ];
                assert_eq!(limits.check(&Told::from_numbers(corner)), Ok(()), "{}", target.name);
            }
            let machine = Machine::with(Actuators::exact(Build::PRECISE), 1);
            let fired = machine.fired(&told, 0, 0.0).expect("it does");
            let net = Flight::from_launch(&world, &fired[0].launch).net.expect("it passes");
            assert!(net.clearance_m > 0.1, "{}: {} m", target.name, net.clearance_m);
        }
    }

    #[test]
    fn two_integrators_agree_where_a_nominal_shot_lands() {
        let build = Build { steps: [1e-9; 4], ..Build::PRECISE };
        let machine = Machine::with(Actuators::exact(build), 1);
        // fusion assumes 1.20 kg/m3 if nobody says otherwise.
        let world = World { air_density_kg_m3: 1.2, ..World::default() };
        for target in six() {
            let landed_m = machine.mean_landing_m(&nominal(&target), 0, &world);
            let off_m = (landed_m - target.landing_m).norm();
            assert!(off_m < 5e-3, "{}: {off_m} m off", target.name);
        }
    }
}

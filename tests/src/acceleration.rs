//! Ball state -> acceleration and change of spin in the air.
//!
//! Quadratic drag along the air-relative velocity u, Magnus lift along omega x u, gravity. With
//! k = rho A / 2m:
//!
//!   a = -k C_D |u| u + k C_L |u|^2 (omega x u)/|omega x u| - g z
//!   C_L = 1 / (2 + |u|/(R omega_p))
//!
//! where omega_p is the part of the spin across u (the part along u does not lift). The drag
//! coefficient is the ball's own constant: in free flight it hardly depends on speed or spin.
//! Source: Cross & Lindsey, Sports Engineering 17 (2014); C_L: Stepanek, Am. J. Phys. 56 (1988).

use nalgebra::Vector3;

use crate::scenario::Launch;
use crate::world::World;

/// Time in which spin decays to 1/e; published estimates lie between 8 and 20 s.
const SPIN_DECAY_S: f64 = 12.0;

/// Centre, velocity and spin of a ball; also used for their rates of change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallState {
    /// Ball centre in `court`.
    pub position_m: Vector3<f64>,
    /// Its velocity.
    pub velocity_m_s: Vector3<f64>,
    /// Its angular velocity.
    pub spin_rad_s: Vector3<f64>,
}

impl BallState {
    /// This state moved along a rate of change for a time.
    fn advanced(&self, rate: &BallState, step_s: f64) -> Self {
        Self {
            position_m: self.position_m + rate.position_m * step_s,
            velocity_m_s: self.velocity_m_s + rate.velocity_m_s * step_s,
            spin_rad_s: self.spin_rad_s + rate.spin_rad_s * step_s,
        }
    }

    /// The state one classical Runge-Kutta step later.
    pub fn after(&self, world: &World, launch: &Launch, step_s: f64) -> Self {
        let k1 = rate(world, launch, self);
        let k2 = rate(world, launch, &self.advanced(&k1, 0.5 * step_s));
        let k3 = rate(world, launch, &self.advanced(&k2, 0.5 * step_s));
        let k4 = rate(world, launch, &self.advanced(&k3, step_s));
        self.advanced(&k1, step_s / 6.0)
            .advanced(&k2, step_s / 3.0)
            .advanced(&k3, step_s / 3.0)
            .advanced(&k4, step_s / 6.0)
    }
}

/// The rate of change of a state in the air.
fn rate(world: &World, launch: &Launch, state: &BallState) -> BallState {
    let radius_m = world.ball_radius_m;
    let area_m2 = std::f64::consts::PI * radius_m * radius_m;
    let k = world.air_density_kg_m3 * area_m2 / (2.0 * world.ball_mass_kg);
    let u = state.velocity_m_s - world.wind_m_s;
    let speed = u.norm();
    let mut acceleration =
        -k * launch.drag_coefficient * speed * u - Vector3::new(0.0, 0.0, world.gravity_m_s2);
    let across = state.spin_rad_s.cross(&u);
    // |omega x u| = omega_p |u|, and with S = R omega_p / |u| the law reads C_L = S / (2 S + 1).
    if across.norm() > 1e-9 {
        let s = radius_m * across.norm() / (speed * speed);
        let lift = launch.lift_scale * s / (2.0 * s + 1.0);
        acceleration += k * lift * speed * speed * across.normalize();
    }
    BallState {
        position_m: state.velocity_m_s,
        velocity_m_s: acceleration,
        spin_rad_s: -state.spin_rad_s / SPIN_DECAY_S,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    fn lift_of(spin_rad_s: Vector3<f64>) -> Vector3<f64> {
        let world = World { gravity_m_s2: 0.0, ..World::default() };
        let launch = Launch { drag_coefficient: 0.0, ..Scenario::thesis_shot().launches[0] };
        let velocity_m_s = Vector3::new(0.0, 30.0, 0.0);
        let state = BallState { position_m: Vector3::zeros(), velocity_m_s, spin_rad_s };
        rate(&world, &launch, &state).velocity_m_s
    }

    #[test]
    fn backspin_lifts_topspin_pushes_down_and_gyro_spin_does_nothing() {
        assert!(lift_of(Vector3::new(100.0, 0.0, 0.0)).z > 0.0);
        assert!(lift_of(Vector3::new(-100.0, 0.0, 0.0)).z < 0.0);
        assert!(lift_of(Vector3::new(0.0, 100.0, 0.0)).norm() < 1e-12);
        // Spin about +z, seen from above counter-clockwise, curves a ball flying to +y towards -x.
        assert!(lift_of(Vector3::new(0.0, 0.0, 100.0)).x < 0.0);
    }

    #[test]
    fn lift_saturates_at_a_coefficient_of_one_half() {
        let world = World::default();
        let area_m2 = std::f64::consts::PI * world.ball_radius_m.powi(2);
        let k = world.air_density_kg_m3 * area_m2 / (2.0 * world.ball_mass_kg);
        let lift = lift_of(Vector3::new(1e7, 0.0, 0.0)).norm();
        assert!((lift - 0.5 * k * 900.0).abs() < 0.01);
    }
}

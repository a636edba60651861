//! Ball state before touching the ground -> state after.
//!
//! Brody's and Cross' model: the normal velocity is returned times e; friction acts at the contact
//! point, which slides at s = v_t + omega x (-R z). If friction can stop the sliding during the
//! contact the ball grips (and overshoots a little, as felt does), else it slides all through:
//!
//!   slides:  dv_t = -mu (1 + e) |v_z| s/|s|          grips:  dv_t = -(1 + e_x) s a/(1 + a)
//!   d omega = (-R z) x dv_t / (a R^2)                with I = a m R^2, a = 0.55
//!
//! Source: Brody, The Physics Teacher 22 (1984); Cross, Am. J. Phys. 70 (2002).

use nalgebra::Vector3;

use crate::acceleration::BallState;
use crate::world::World;

/// Moment of inertia over m R^2: a hollow ball with a thick wall. Wrong by 10 %, the spin after a
/// bounce is wrong by as much.
const INERTIA_FACTOR: f64 = 0.55;
/// Tangential restitution e_x when gripping; Cross measured 0 to 0.2.
const OVERSHOOT: f64 = 0.1;
/// Normal restitution of a hard bounce: a drop from 2.54 m comes back to 1.40 m (ITF: 1.35-1.47).
const RESTITUTION_FAST: f64 = 0.7746;
/// Below this normal speed the ball flattens less and returns more,
const FAST_MIN_M_S: f64 = 5.0;
/// by this much for each m/s.
const RESTITUTION_PER_M_S: f64 = 0.015;

/// The state just after the ground has been touched.
pub fn from_impact(world: &World, before: &BallState) -> BallState {
    let v_z = -before.velocity_m_s.z;
    assert!(v_z > 0.0, "a ball that touches the ground comes from above");
    let e = RESTITUTION_FAST + RESTITUTION_PER_M_S * (FAST_MIN_M_S - v_z).max(0.0);
    let radius_m = world.ball_radius_m;
    let contact = Vector3::new(0.0, 0.0, -radius_m);
    let v_t = Vector3::new(before.velocity_m_s.x, before.velocity_m_s.y, 0.0);
    let mut slip = v_t + before.spin_rad_s.cross(&contact);
    slip.z = 0.0;
    let stops_slip = slip.norm() * INERTIA_FACTOR / (1.0 + INERTIA_FACTOR);
    let available = world.surface_friction * (1.0 + e) * v_z;
    let change = if slip.norm() < 1e-12 {
        Vector3::zeros()
    } else if available < stops_slip {
        -available * slip.normalize()
    } else {
        // The overshoot, too, is friction's work, so it is limited by what is available.
        -(stops_slip * (1.0 + OVERSHOOT)).min(available) * slip.normalize()
    };
    let mut velocity_m_s = v_t + change;
    velocity_m_s.z = e * v_z;
    BallState {
        position_m: before.position_m,
        velocity_m_s,
        spin_rad_s: before.spin_rad_s
            + contact.cross(&change) / (INERTIA_FACTOR * radius_m * radius_m),
    }
}

/// Kinetic energy of a ball over its mass, in m^2/s^2, without its height.
#[cfg(test)]
pub fn kinetic_energy_m2_s2(world: &World, state: &BallState) -> f64 {
    let inertia_m2 = INERTIA_FACTOR * world.ball_radius_m.powi(2);
    0.5 * (state.velocity_m_s.norm_squared() + inertia_m2 * state.spin_rad_s.norm_squared())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn impact(v_y: f64, v_z: f64, spin_x: f64) -> BallState {
        BallState {
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::new(0.0, v_y, v_z),
            spin_rad_s: Vector3::new(spin_x, 0.0, 0.0),
        }
    }

    #[test]
    fn a_bounce_never_gains_energy() {
        let world = World::default();
        for v_y in [0.0, 3.0, 10.0, 30.0] {
            for v_z in [-0.3, -2.0, -5.0, -12.0] {
                for spin_x in [-300.0, -100.0, 0.0, 100.0, 300.0] {
                    let before = impact(v_y, v_z, spin_x);
                    let after = from_impact(&world, &before);
                    let gain = kinetic_energy_m2_s2(&world, &after)
                        - kinetic_energy_m2_s2(&world, &before);
                    assert!(gain < 0.0, "{before:?} gains {gain}");
                }
            }
        }
    }

    #[test]
    fn the_independent_render_bounces_alike() {
        // blender-a/truth.json: slides; the drop in speed and the topspin after it.
        let after = from_impact(&World::default(), &impact(17.97497751, -5.28026457, 0.0));
        assert!((after.velocity_m_s.y - 12.3529).abs() < 1e-3);
        assert!((after.velocity_m_s.z - 4.0899).abs() < 1e-3);
        let spin_rpm = after.spin_rad_s.x * 60.0 / std::f64::consts::TAU;
        assert!((spin_rpm + 2957.95).abs() < 1.0, "{spin_rpm} rpm");
    }

    #[test]
    fn a_ball_that_rolls_already_keeps_its_speed() {
        let world = World::default();
        let rolling = impact(5.0, -3.0, -5.0 / world.ball_radius_m);
        assert!((from_impact(&world, &rolling).velocity_m_s.y - 5.0).abs() < 1e-9);
    }

    #[test]
    fn a_steep_bounce_grips_whatever_the_friction() {
        let rough = World { surface_friction: 0.9, ..World::default() };
        let steep = impact(3.0, -8.0, 0.0);
        let (a, b) = (from_impact(&World::default(), &steep), from_impact(&rough, &steep));
        assert_eq!(a.velocity_m_s, b.velocity_m_s);
    }
}

//! The ball, and how it would fly on: gravity and a constant drag coefficient.
//!
//! Position and velocity at one time -> the same at another. Used to *predict* (the next token of a
//! tracklet, whether two tracklets meet, the flight back to the launcher), never to measure.
//!
//! `a = g − k C_D |v| v`, `k = ρ A / 2m`, `A = π D²/4` (the thesis' Eq 10 calls A the surface,
//! which is four times as large). `C_D` is a constant: 0.507 ± 0.024 in free flight at any speed
//! and spin of play (Cross & Lindsey 2014); the thesis' Eq 12 is a wind-tunnel fit, 8-60 % above
//! it ([`drag_of_thesis`]). Spin is not known here and left out: over the 0.1 s a prediction looks
//! ahead it moves a ball 2-4 cm. [`crate::world::trajectory`] has all of it.

use nalgebra::{Matrix3, Point3, Vector3};

/// Acceleration of gravity, m/s² (standard 9.80665; the thesis uses 9.81).
pub const GRAVITY_M_S2: f64 = 9.81;

/// Drag coefficient: between free flight (0.507) and worn, fluffed balls (0.55).
pub const DRAG_COEFFICIENT: f64 = 0.53;

/// New balls in free flight, 15-30 m/s, 0-2500 rpm (Cross & Lindsey, Sports Eng. 17, 2014).
pub const DRAG_FREE_FLIGHT: f64 = 0.507;

/// 1 sigma of a ball's own drag coefficient: worn ones lower, fluffed ones higher.
pub const DRAG_SIGMA: f64 = 0.05;

/// Acceleration by spin: 8 m/s² at 2500 rpm and 25 m/s, which few machines reach.
pub const SPIN_SIGMA_M_S2: f64 = 6.0;

/// The thesis' Eq 12 (Stepanek, Am. J. Phys. 56, 1988, in a wind tunnel): 0.55 without spin, up to
/// 0.84. `speed_ratio` is the speed over that of the ball's turning surface.
#[must_use]
pub fn drag_of_thesis(speed_ratio: f64) -> f64 {
    0.55 + 1.0 / (22.5 + 4.2 * speed_ratio.powf(2.5)).powf(0.4)
}

/// The thesis' Eq 11: the lift coefficient at this ratio of speed over that of the surface.
#[must_use]
pub fn lift_of_thesis(speed_ratio: f64) -> f64 {
    1.0 / (2.0 + speed_ratio)
}

/// Integration step: the error of one step at 30 m/s is below a micrometre.
const STEP_S: f64 = 0.02;

/// A tennis ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// ITF Appendix I: 0.0654 to 0.0686.
    pub diameter_m: f64,
    /// ITF Appendix I: 0.0560 to 0.0594.
    pub mass_kg: f64,
}

impl Default for Ball {
    /// A new type 2 ball, within ITF Appendix I.
    fn default() -> Self {
        Self { diameter_m: 0.066, mass_kg: 0.0577 }
    }
}

impl Ball {
    /// Half the diameter: the height of the centre when the ball touches the ground.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.diameter_m / 2.0
    }
}

/// What bends a flight in the tracking frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Physics {
    /// The ball in play.
    pub ball: Ball,
    /// See [`crate::world::air`].
    pub air_density_kg_m3: f64,
    /// Gravity in the tracking frame; zero if that is not known to be level (no court).
    pub gravity_m_s2: Vector3<f64>,
    /// What the air does beyond drag, chiefly lift of a spinning ball: acceleration per speed
    /// squared, along the velocity, upwards across it, and level to its right. Zero if not known.
    pub excess_per_m: [f64; 3],
    /// 1 sigma of what is left out, each axis: spin, another ball, wind; without a court, gravity.
    pub unknown_m_s2: f64,
}

/// Where a ball is and where it goes, tracking frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Centre of the ball.
    pub position_m: Point3<f64>,
    /// Velocity of the ball.
    pub velocity_m_s: Vector3<f64>,
}

impl Physics {
    /// `k = ρ A / 2m`.
    #[must_use]
    pub fn air_per_m(&self) -> f64 {
        let area_m2 = std::f64::consts::PI * self.ball.diameter_m.powi(2) / 4.0;
        self.air_density_kg_m3 * area_m2 / (2.0 * self.ball.mass_kg)
    }

    /// `k C_D` of a ball in the middle of what they are.
    #[must_use]
    pub fn drag_per_m(&self) -> f64 {
        self.air_per_m() * DRAG_COEFFICIENT
    }

    /// Gravity, drag and excess at this velocity.
    #[must_use]
    pub fn acceleration_m_s2(&self, velocity_m_s: &Vector3<f64>) -> Vector3<f64> {
        let drag = -velocity_m_s * (velocity_m_s.norm() * self.drag_per_m());
        if self.excess_per_m == [0.0; 3] {
            return self.gravity_m_s2 + drag;
        }
        let [along, across, right] = self.excess_per_m;
        let axes = flight_axes(velocity_m_s);
        let excess = axes * Vector3::new(along, across, right) * velocity_m_s.norm_squared();
        self.gravity_m_s2 + drag + excess
    }

    /// The same flight with the excess that explains this acceleration at this velocity.
    #[must_use]
    pub fn explaining(
        mut self,
        acceleration_m_s2: &Vector3<f64>,
        velocity_m_s: &Vector3<f64>,
    ) -> Self {
        self.excess_per_m = [0.0; 3];
        let missing_m_s2 = acceleration_m_s2 - self.acceleration_m_s2(velocity_m_s);
        let excess = flight_axes(velocity_m_s).transpose() * missing_m_s2;
        self.excess_per_m = (excess / velocity_m_s.norm_squared()).into();
        self
    }

    /// The state `dt_s` later (earlier if negative), by Runge-Kutta 4.
    #[must_use]
    pub fn propagated(&self, state: State, dt_s: f64) -> State {
        let n_steps = (dt_s.abs() / STEP_S).ceil().clamp(1.0, 1000.0);
        let h = dt_s / n_steps;
        let mut state = state;
        for _ in 0..n_steps as usize {
            let v1 = state.velocity_m_s;
            let a1 = self.acceleration_m_s2(&v1);
            let v2 = v1 + a1 * (h / 2.0);
            let a2 = self.acceleration_m_s2(&v2);
            let v3 = v1 + a2 * (h / 2.0);
            let a3 = self.acceleration_m_s2(&v3);
            let v4 = v1 + a3 * h;
            let a4 = self.acceleration_m_s2(&v4);
            state.position_m += (v1 + 2.0 * v2 + 2.0 * v3 + v4) * (h / 6.0);
            state.velocity_m_s += (a1 + 2.0 * a2 + 2.0 * a3 + a4) * (h / 6.0);
        }
        state
    }
}

/// Columns: along the velocity, upwards across it, level to its right. They turn with the ball, as
/// lift does. A ball that goes straight up has no right; any level direction is then as good.
fn flight_axes(velocity_m_s: &Vector3<f64>) -> Matrix3<f64> {
    let along = velocity_m_s.try_normalize(1e-9).unwrap_or_else(Vector3::y);
    let right = along.cross(&Vector3::z()).try_normalize(1e-9).unwrap_or_else(Vector3::x);
    Matrix3::from_columns(&[along, right.cross(&along), right])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn physics() -> Physics {
        let gravity_m_s2 = Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
        Physics {
            ball: Ball::default(),
            air_density_kg_m3: 1.2,
            gravity_m_s2,
            excess_per_m: [0.0; 3],
            unknown_m_s2: SPIN_SIGMA_M_S2,
        }
    }

    #[test]
    fn going_forth_and_back_ends_where_it_began() {
        let start = State {
            position_m: Point3::new(0.0, 0.0, 1.0),
            velocity_m_s: Vector3::new(1.0, 27.5, 3.9),
        };
        let there = physics().propagated(start, 0.9);
        let back = physics().propagated(there, -0.9);
        assert!((back.position_m - start.position_m).norm() < 1e-6);
        assert!((back.velocity_m_s - start.velocity_m_s).norm() < 1e-6);
    }

    #[test]
    fn the_shot_of_the_thesis_loses_a_third_of_its_speed() {
        // Section 8.3 prints 9.21 m/s at the bounce; 27.8 m/s and 0.97 s of drag leave about 19.
        let start = State {
            position_m: Point3::new(0.0, 0.0, 1.0),
            velocity_m_s: Vector3::new(0.0, 27.5, 3.914),
        };
        let end = physics().propagated(start, 0.97);
        let speed_m_s = end.velocity_m_s.norm();
        assert!((18.0..20.5).contains(&speed_m_s), "{speed_m_s} m/s");
    }

    #[test]
    fn drag_is_that_of_the_cross_section() {
        // rho A / 2m = 0.0356 /m for a 66 mm ball of 57.7 g, times C_D.
        assert!((physics().drag_per_m() - 0.0356 * DRAG_COEFFICIENT).abs() < 2e-4);
    }

    #[test]
    fn the_tunnel_is_above_free_flight_and_lift_saturates() {
        assert!((drag_of_thesis(1e9) - 0.55).abs() < 1e-3);
        assert!((drag_of_thesis(1.0) - 0.82).abs() < 0.01);
        assert!(drag_of_thesis(1e9) > DRAG_FREE_FLIGHT * 1.08);
        assert_eq!(lift_of_thesis(0.0), 0.5);
    }

    #[test]
    fn an_explained_acceleration_comes_back_and_lift_turns_with_the_ball() {
        let velocity = Vector3::new(1.0, 14.0, -6.0);
        let acceleration = Vector3::new(0.5, -6.0, -7.5);
        let explained = physics().explaining(&acceleration, &velocity);
        assert!((explained.acceleration_m_s2(&velocity) - acceleration).norm() < 1e-12);
        let mut lifted = physics();
        lifted.excess_per_m = [0.0, 0.01, 0.0];
        for velocity in [Vector3::new(0.0, 20.0, 8.0), Vector3::new(3.0, 10.0, -9.0)] {
            let lift = lifted.acceleration_m_s2(&velocity) - physics().acceleration_m_s2(&velocity);
            assert!(lift.dot(&velocity).abs() < 1e-9 && lift.z > 0.0);
            assert!((lift.norm() - 0.01 * velocity.norm_squared()).abs() < 1e-9);
        }
    }
}

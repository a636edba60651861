//! Velocity and spin -> acceleration, with derivatives: the ball's equation of motion.
//!
//! With u = v − w relative to the air and k = ρ A / 2m:
//!
//! ```text
//! a = g − k C_D |u| u + k R c / (1 + 2 R |c| / |u|²),   c = ω × u,   ω(t) = ω₀ exp(−t/τ)
//! ```
//!
//! The last term is Eq 11 as a vector: `k C_L |u|² c/|c|` with `C_L = 1/(2 + |u|/(R ω_⊥))`, which
//! is 0/0 at no spin in the thesis' form and smooth in this one.

use crate::world::ball::Physics;
use nalgebra::{Matrix3, Point3, SMatrix, Vector2, Vector3};

/// Time in which spin falls to 1/e; published estimates lie between 8 and 20 s. Within a flight
/// that is less than a tenth, which no flight shows.
pub const SPIN_DECAY_S: f64 = 12.0;

/// Numbers a flight depends on, in this order: position, velocity and spin at time 0, drag
/// coefficient, and the wind's x and y.
pub const COLUMNS: usize = 12;

/// Derivative of a vector by the [`COLUMNS`].
pub type Sensitivity = SMatrix<f64, 3, COLUMNS>;

/// A ball at time 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aloft {
    /// Centre of the ball, court.
    pub position_m: Point3<f64>,
    /// Over ground.
    pub velocity_m_s: Vector3<f64>,
    /// Angular velocity.
    pub spin_rad_s: Vector3<f64>,
}

/// What the air does that is not known beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Breeze {
    /// C_D of this ball.
    pub drag_coefficient: f64,
    /// Velocity of the air over ground: x and y.
    pub wind_m_s: Vector2<f64>,
}

/// How much spin is left at a time; more than all of it before time 0.
#[must_use]
pub fn spin_left(t_s: f64) -> f64 {
    (-t_s / SPIN_DECAY_S).exp()
}

/// Velocity and acceleration, and how both depend on the [`COLUMNS`].
pub struct Rate {
    /// Of the ball.
    pub velocity: Vector3<f64>,
    /// Of the ball.
    pub acceleration: Vector3<f64>,
    /// Of the velocity.
    pub d_velocity: Sensitivity,
    /// Of the acceleration.
    pub d_acceleration: Sensitivity,
}

/// What does not change along a flight.
pub struct Model<'a> {
    /// At time 0.
    pub spin_rad_s: Vector3<f64>,
    /// Drag and wind.
    pub breeze: &'a Breeze,
    /// Gravity, density, the ball.
    pub physics: &'a Physics,
}

impl Model<'_> {
    /// At a time, with this velocity and its derivative.
    #[must_use]
    pub fn rate(&self, t_s: f64, (velocity, d_velocity): (Vector3<f64>, Sensitivity)) -> Rate {
        let k = self.physics.air_per_m();
        let radius_m = self.physics.ball.radius_m();
        let left = spin_left(t_s);
        let spin = self.spin_rad_s * left;
        let wind = self.breeze.wind_m_s;
        let u = velocity - Vector3::new(wind.x, wind.y, 0.0);
        let speed = u.norm().max(1e-9);
        let drag = self.breeze.drag_coefficient * k;
        let c = spin.cross(&u);
        let turn = c.norm();
        let ratio = radius_m * turn / (speed * speed);
        let damp = 1.0 / (1.0 + 2.0 * ratio);
        let lift = k * radius_m * damp;

        let by_drag = -(Matrix3::identity() * speed + u * u.transpose() / speed) * drag;
        let along_c =
            if turn > 1e-12 { c * c.transpose() / (turn * turn) } else { Matrix3::zeros() };
        let by_c = (Matrix3::identity() - along_c * (2.0 * ratio * damp)) * lift;
        let by_speed = c * (lift * 4.0 * ratio * damp / (speed * speed));
        let by_u = by_drag + by_c * spin.cross_matrix() + by_speed * u.transpose();

        let mut d_acceleration = by_u * d_velocity;
        let by_spin = by_c * u.cross_matrix() * -left;
        let mut spins = d_acceleration.fixed_columns_mut::<3>(6);
        spins += by_spin;
        let mut drags = d_acceleration.fixed_columns_mut::<1>(9);
        drags -= u * (k * speed);
        let mut winds = d_acceleration.fixed_columns_mut::<2>(10);
        winds -= by_u.fixed_columns::<2>(0);
        Rate {
            velocity,
            acceleration: self.physics.gravity_m_s2 - u * (drag * speed) + c * lift,
            d_velocity,
            d_acceleration,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;
    use crate::world::ball::lift_of_thesis;

    const STILL: Breeze = Breeze { drag_coefficient: 0.53, wind_m_s: Vector2::new(0.0, 0.0) };

    #[test]
    fn the_lift_is_that_of_equation_11() {
        let physics = pretend::reference_rig().physics();
        let spin = Vector3::new(180.0, 0.0, 0.0);
        let model = Model { spin_rad_s: spin, breeze: &STILL, physics: &physics };
        let velocity = Vector3::new(0.0, 25.0, 0.0);
        let lifted = model.rate(0.0, (velocity, Sensitivity::zeros())).acceleration.z + 9.81;
        let coefficient = lift_of_thesis(25.0 / (0.033 * 180.0));
        let expected = physics.air_per_m() * coefficient * 625.0;
        assert!((lifted - expected).abs() < 1e-9, "{lifted} {expected}");
    }
}

//! What a flight is fitted with, and what is known of it beforehand.
//!
//! | unknown | before anything is seen (1 sigma) | source |
//! |---|---|---|
//! | position, velocity at the reference time | nothing | |
//! | spin, along the flight | 30 rad/s | it lifts nothing |
//! | spin, about the level axis across (top, back) | 250 rad/s | 2400 rpm, a machine's range |
//! | spin, about the axis upwards across (side) | 120 rad/s | seam and machine scatter |
//! | drag coefficient | 0.53 ± 0.05 | [`ball`](crate::world::ball) |
//! | wind, x and y | 1.5 m/s | |
//! | right clock less left | [`crate::clock`] | |
//! | height of the ground at the bounce | `Settings::ground_sigma_m` | |
//! | velocity after the bounce | that of [`rebound`](crate::world::rebound), widely | |

use crate::world::acceleration::{Aloft, Breeze};
use crate::world::ball::{DRAG_COEFFICIENT, DRAG_SIGMA};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Number of unknowns.
pub const N: usize = 17;

/// One number per unknown, in the order of the fields.
pub type Column = SVector<f64, N>;

/// Covariance of all unknowns.
pub type Covariance = SMatrix<f64, N, N>;

/// Derivative of a vector by all unknowns.
pub type Slope = SMatrix<f64, 3, N>;

/// Where the columns of an unknown begin.
pub const SPIN: usize = 6;
/// The drag coefficient.
pub const DRAG: usize = 9;
/// x and y of the wind.
pub const WIND: usize = 10;
/// The clocks.
pub const CLOCK: usize = 12;
/// The ground.
pub const GROUND: usize = 13;
/// Velocity after the bounce.
pub const OUT: usize = 14;

/// Everything that is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unknowns {
    /// Position, velocity and spin at the reference time.
    pub aloft: Aloft,
    /// Drag and wind.
    pub breeze: Breeze,
    /// Stamp of the right camera less that of the left at one instant.
    pub clock_s: f64,
    /// Height of the ground where the ball bounces.
    pub ground_m: f64,
    /// Velocity just after the bounce.
    pub out_m_s: Vector3<f64>,
}

impl Unknowns {
    /// With a step added.
    #[must_use]
    pub fn plus(&self, step: &Column) -> Self {
        let part = |from: usize| step.fixed_rows::<3>(from).into_owned();
        Self {
            aloft: Aloft {
                position_m: self.aloft.position_m + part(0),
                velocity_m_s: self.aloft.velocity_m_s + part(3),
                spin_rad_s: self.aloft.spin_rad_s + part(SPIN),
            },
            breeze: Breeze {
                drag_coefficient: self.breeze.drag_coefficient + step[DRAG],
                wind_m_s: self.breeze.wind_m_s + step.fixed_rows::<2>(WIND),
            },
            clock_s: self.clock_s + step[CLOCK],
            ground_m: self.ground_m + step[GROUND],
            out_m_s: self.out_m_s + part(OUT),
        }
    }

    /// What must be added to `other` to give this.
    #[must_use]
    pub fn less(&self, other: &Self) -> Column {
        let mut step = Column::zeros();
        let mut set = |from: usize, value: Vector3<f64>| {
            step.fixed_rows_mut::<3>(from).copy_from(&value);
        };
        set(0, self.aloft.position_m - other.aloft.position_m);
        set(3, self.aloft.velocity_m_s - other.aloft.velocity_m_s);
        set(SPIN, self.aloft.spin_rad_s - other.aloft.spin_rad_s);
        set(OUT, self.out_m_s - other.out_m_s);
        step[DRAG] = self.breeze.drag_coefficient - other.breeze.drag_coefficient;
        let wind = self.breeze.wind_m_s - other.breeze.wind_m_s;
        step.fixed_rows_mut::<2>(WIND).copy_from(&wind);
        step[CLOCK] = self.clock_s - other.clock_s;
        step[GROUND] = self.ground_m - other.ground_m;
        step
    }
}

/// 1 sigma of the spin along the flight, about the level axis across, and about the third.
pub const SPIN_SIGMA_RAD_S: [f64; 3] = [30.0, 250.0, 120.0];

/// 1 sigma of each horizontal component of the wind.
pub const WIND_SIGMA_M_S: f64 = 1.5;

/// So wide that it says nothing, and keeps the equations solvable.
const POSITION_SIGMA_M: f64 = 100.0;

/// 1 sigma of the speed after a bounce, of the speed before it: along the ground, and up.
const OUT_SIGMA: [f64; 2] = [0.2, 0.12];

/// And what is added to both.
const OUT_SIGMA_M_S: f64 = 0.5;

/// What is known beforehand: a mean, and the inverse of its covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// The most likely values.
    pub mean: Unknowns,
    /// Inverse covariance around them.
    pub information: Covariance,
}

/// What [`Prior::new`] cannot know by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Right clock less left, and 1 sigma.
    pub clock_s: [f64; 2],
    /// 1 sigma of the ground's height.
    pub ground_sigma_m: f64,
    /// Velocity expected after the bounce, and the one before it.
    pub out_and_in_m_s: [Vector3<f64>; 2],
}

impl Prior {
    /// Around a first guess, whose velocity gives the axes of the spin.
    #[must_use]
    pub fn new(start: &Unknowns, known: &Known) -> Self {
        let [out_m_s, in_m_s] = known.out_and_in_m_s;
        let mut mean = Unknowns {
            aloft: Aloft { spin_rad_s: Vector3::zeros(), ..start.aloft },
            breeze: Breeze { drag_coefficient: DRAG_COEFFICIENT, wind_m_s: nalgebra::zero() },
            clock_s: known.clock_s[0],
            ground_m: 0.0,
            out_m_s,
        };
        mean.aloft.velocity_m_s = start.aloft.velocity_m_s;
        let mut information = Covariance::zeros();
        let inverse = |sigma: f64| sigma.powi(-2);
        for i in 0..6 {
            information[(i, i)] = inverse(POSITION_SIGMA_M);
        }
        let axes = spin_axes(&start.aloft.velocity_m_s);
        let spin = Vector3::from(SPIN_SIGMA_RAD_S.map(inverse));
        information
            .fixed_view_mut::<3, 3>(SPIN, SPIN)
            .copy_from(&(axes * Matrix3::from_diagonal(&spin) * axes.transpose()));
        information[(DRAG, DRAG)] = inverse(DRAG_SIGMA);
        information[(WIND, WIND)] = inverse(WIND_SIGMA_M_S);
        information[(WIND + 1, WIND + 1)] = inverse(WIND_SIGMA_M_S);
        information[(CLOCK, CLOCK)] = inverse(known.clock_s[1]);
        information[(GROUND, GROUND)] = inverse(known.ground_sigma_m);
        let level = OUT_SIGMA_M_S + OUT_SIGMA[0] * in_m_s.xy().norm();
        let up = OUT_SIGMA_M_S + OUT_SIGMA[1] * in_m_s.z.abs();
        for (i, sigma) in [level, level, up].into_iter().enumerate() {
            information[(OUT + i, OUT + i)] = inverse(sigma);
        }
        Self { mean, information }
    }

    /// Half of the squared distance from the mean, in sigmas.
    #[must_use]
    pub fn cost(&self, unknowns: &Unknowns) -> f64 {
        let off = unknowns.less(&self.mean);
        0.5 * off.dot(&(self.information * off))
    }
}

/// Columns: along a velocity, level to its right, and upwards across it. Spin about the second is
/// backspin.
#[must_use]
pub fn spin_axes(velocity_m_s: &Vector3<f64>) -> Matrix3<f64> {
    let along = velocity_m_s.try_normalize(1e-9).unwrap_or_else(Vector3::y);
    let right = along.cross(&Vector3::z()).try_normalize(1e-9).unwrap_or_else(Vector3::x);
    Matrix3::from_columns(&[along, right, right.cross(&along)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector2};

    #[test]
    fn plus_and_less_are_inverses_on_every_unknown() {
        let start = Unknowns {
            aloft: Aloft {
                position_m: Point3::new(1.0, 2.0, 3.0),
                velocity_m_s: Vector3::new(0.1, 20.0, 1.0),
                spin_rad_s: Vector3::new(5.0, 6.0, 7.0),
            },
            breeze: Breeze { drag_coefficient: 0.5, wind_m_s: Vector2::new(0.3, 0.2) },
            clock_s: 0.001,
            ground_m: 0.002,
            out_m_s: Vector3::new(0.0, 12.0, 4.0),
        };
        let step = Column::from_fn(|i, _| 0.5 + i as f64);
        assert!((start.plus(&step).less(&start) - step).amax() < 1e-12);
    }

    #[test]
    fn backspin_lifts() {
        let velocity = Vector3::new(2.0, 20.0, 1.0);
        let right = spin_axes(&velocity).column(1).into_owned();
        assert!(right.cross(&velocity).z > 0.0 && right.x > 0.9);
    }
}

//! Position, velocity and spin at one time -> position and velocity at any time, with derivatives.
//!
//! [`acceleration`](crate::world::acceleration) is integrated by Runge-Kutta 4 with a fixed step of
//! [`STEP_S`], with cubic Hermite curves between. Derivatives by the twelve numbers of `COLUMNS`
//! are integrated along (the variational equations `Ṗ = V`, `V̇ = A V + B`), so they are exact to
//! the integrator's error; the tests compare them with differences.
//!
//! **Why a fixed step**: the right side is smooth (a bounce ends a trajectory), so an adaptive one
//! has nothing to adapt to. Against `ode_solvers`' Dopri5 at a tolerance of 1e-12 the fixed step is
//! off by a micrometre after a second (tests), and the kept-up crates bring another nalgebra along.

use crate::world::acceleration::{Aloft, Breeze, Model, Rate, Sensitivity};
use crate::world::ball::Physics;
use nalgebra::{Point3, Vector3};

/// Step of the integrator and distance of the kept states.
pub const STEP_S: f64 = 0.04;

/// Longest a trajectory is followed either way.
const SPAN_MAX_S: f64 = 4.0;

/// One instant of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Here {
    /// Centre of the ball.
    pub position_m: Point3<f64>,
    /// Over ground.
    pub velocity_m_s: Vector3<f64>,
    /// Derivative of the position.
    pub d_position: Sensitivity,
    /// Derivative of the velocity.
    pub d_velocity: Sensitivity,
}

#[derive(Clone, Copy)]
struct Knot {
    position_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    d_position: Sensitivity,
    d_velocity: Sensitivity,
}

/// Weights of position and velocity of two knots, for the position, and of the fall from one to the
/// other and of both velocities, for the velocity.
struct Curve {
    pa: f64,
    va: f64,
    pb: f64,
    vb: f64,
    falls: f64,
    falls_a: f64,
    falls_b: f64,
}

/// A flight around time 0.
#[derive(Clone)]
pub struct Trajectory {
    /// Time of the first knot, a multiple of [`STEP_S`].
    first_s: f64,
    knots: Vec<Knot>,
}

impl Trajectory {
    /// Follows a ball from `from_s` (at most 0) to `to_s` (at least 0), no farther than four
    /// seconds.
    #[must_use]
    pub fn new(start: &Aloft, breeze: &Breeze, physics: &Physics, from_s: f64, to_s: f64) -> Self {
        let n_of = |span_s: f64| (span_s.clamp(0.0, SPAN_MAX_S) / STEP_S).ceil() as usize + 1;
        let (n_back, n_on) = (n_of(-from_s), n_of(to_s));
        let model = Model { spin_rad_s: start.spin_rad_s, breeze, physics };
        let mut d_position = Sensitivity::zeros();
        d_position.fixed_columns_mut::<3>(0).fill_with_identity();
        let mut d_velocity = Sensitivity::zeros();
        d_velocity.fixed_columns_mut::<3>(3).fill_with_identity();
        let middle = Knot {
            position_m: start.position_m.coords,
            velocity_m_s: start.velocity_m_s,
            d_position,
            d_velocity,
        };
        let mut knots = vec![middle; n_back + 1 + n_on];
        for i in (0..n_back).rev() {
            let t_s = (i as f64 + 1.0 - n_back as f64) * STEP_S;
            knots[i] = stepped(&model, &knots[i + 1], t_s, -STEP_S);
        }
        for i in n_back + 1..knots.len() {
            let t_s = (i as f64 - 1.0 - n_back as f64) * STEP_S;
            knots[i] = stepped(&model, &knots[i - 1], t_s, STEP_S);
        }
        Self { first_s: -(n_back as f64) * STEP_S, knots }
    }

    /// The ball at a time; beyond the ends the last curve goes on.
    #[must_use]
    pub fn at(&self, t_s: f64) -> Here {
        let (a, b, curve) = self.around(t_s);
        let place = self.place_at(t_s);
        let d_velocity = (a.d_position - b.d_position) * curve.falls
            + a.d_velocity * curve.falls_a
            + b.d_velocity * curve.falls_b;
        Here { d_velocity, ..place }
    }

    /// The same without the velocity's derivative, which is left zero: what a pixel depends on.
    #[must_use]
    pub fn place_at(&self, t_s: f64) -> Here {
        let (a, b, curve) = self.around(t_s);
        let Curve { pa, va, pb, vb, falls, falls_a, falls_b } = curve;
        let position =
            a.position_m * pa + a.velocity_m_s * va + b.position_m * pb + b.velocity_m_s * vb;
        Here {
            position_m: Point3::from(position),
            velocity_m_s: (a.position_m - b.position_m) * falls
                + a.velocity_m_s * falls_a
                + b.velocity_m_s * falls_b,
            d_position: a.d_position * pa
                + a.d_velocity * va
                + b.d_position * pb
                + b.d_velocity * vb,
            d_velocity: Sensitivity::zeros(),
        }
    }

    /// The knots around a time, and the weights of the cubic Hermite curve between them.
    fn around(&self, t_s: f64) -> (&Knot, &Knot, Curve) {
        let place = (t_s - self.first_s) / STEP_S;
        let idx = (place.max(0.0) as usize).min(self.knots.len() - 2);
        let s = place - idx as f64;
        let (s2, s3) = (s * s, s * s * s);
        let curve = Curve {
            pa: 2.0 * s3 - 3.0 * s2 + 1.0,
            va: (s3 - 2.0 * s2 + s) * STEP_S,
            pb: 3.0 * s2 - 2.0 * s3,
            vb: (s3 - s2) * STEP_S,
            falls: (6.0 * s2 - 6.0 * s) / STEP_S,
            falls_a: 3.0 * s2 - 4.0 * s + 1.0,
            falls_b: 3.0 * s2 - 2.0 * s,
        };
        (&self.knots[idx], &self.knots[idx + 1], curve)
    }

    /// First time from `from_s` on at which a coordinate (0 is x) passes `level` in the direction
    /// of `sign`; None if it does not.
    #[must_use]
    pub fn time_at_level(&self, axis: usize, level: f64, sign: f64, from_s: f64) -> Option<f64> {
        let value = |t_s: f64| sign * (self.place_at(t_s).position_m[axis] - level);
        let n_before = ((from_s - self.first_s) / STEP_S).max(0.0) as usize;
        let time_of = |idx: usize| (self.first_s + idx as f64 * STEP_S).max(from_s);
        let passing = (n_before + 1..self.knots.len())
            .find(|&idx| value(time_of(idx - 1)) < 0.0 && value(time_of(idx)) >= 0.0)?;
        // Bracketed Newton: never outside the step that passes.
        let (mut low_s, mut high_s) = (time_of(passing - 1), time_of(passing));
        let mut t_s = 0.5 * (low_s + high_s);
        for _ in 0..20 {
            let here = self.place_at(t_s);
            let off = sign * (here.position_m[axis] - level);
            if off < 0.0 {
                low_s = t_s
            } else {
                high_s = t_s
            }
            let next_s = t_s - off / (sign * here.velocity_m_s[axis]);
            let is_within = (low_s..=high_s).contains(&next_s);
            let next_s = if is_within { next_s } else { 0.5 * (low_s + high_s) };
            if (next_s - t_s).abs() < 1e-12 {
                return Some(next_s);
            }
            t_s = next_s;
        }
        Some(t_s)
    }
}

/// Runge-Kutta 4 for the ball and its derivatives.
fn stepped(model: &Model, from: &Knot, t_s: f64, h: f64) -> Knot {
    let at = |k: Option<&Rate>, part: f64| match k {
        None => (from.velocity_m_s, from.d_velocity),
        Some(k) => (
            from.velocity_m_s + k.acceleration * (h * part),
            from.d_velocity + k.d_acceleration * (h * part),
        ),
    };
    let k1 = model.rate(t_s, at(None, 0.0));
    let k2 = model.rate(t_s + h / 2.0, at(Some(&k1), 0.5));
    let k3 = model.rate(t_s + h / 2.0, at(Some(&k2), 0.5));
    let k4 = model.rate(t_s + h, at(Some(&k3), 1.0));
    let sixth = h / 6.0;
    Knot {
        position_m: from.position_m
            + (k1.velocity + (k2.velocity + k3.velocity) * 2.0 + k4.velocity) * sixth,
        velocity_m_s: from.velocity_m_s
            + (k1.acceleration + (k2.acceleration + k3.acceleration) * 2.0 + k4.acceleration)
                * sixth,
        d_position: from.d_position
            + (k1.d_velocity + (k2.d_velocity + k3.d_velocity) * 2.0 + k4.d_velocity) * sixth,
        d_velocity: from.d_velocity
            + (k1.d_acceleration
                + (k2.d_acceleration + k3.d_acceleration) * 2.0
                + k4.d_acceleration)
                * sixth,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;
    use crate::world::acceleration::{COLUMNS, spin_left};
    use crate::world::ball::{DRAG_FREE_FLIGHT, drag_of_thesis};
    use nalgebra::Vector2;

    const STILL: Breeze = Breeze { drag_coefficient: 0.53, wind_m_s: Vector2::new(0.0, 0.0) };
    const BLOWN: Breeze = Breeze { drag_coefficient: 0.55, wind_m_s: Vector2::new(1.5, -2.0) };

    fn physics() -> Physics {
        pretend::reference_rig().physics()
    }

    /// Launched from 1 m: speed, elevation in degrees, spin.
    fn launched(speed_m_s: f64, elevation_deg: f64, spin_rad_s: Vector3<f64>) -> Aloft {
        let (sin, cos) = elevation_deg.to_radians().sin_cos();
        Aloft {
            position_m: Point3::new(0.0, 0.0, 1.0),
            velocity_m_s: Vector3::new(0.0, cos, sin) * speed_m_s,
            spin_rad_s,
        }
    }

    fn landing_y_m(start: &Aloft, breeze: &Breeze) -> f64 {
        let trajectory = Trajectory::new(start, breeze, &physics(), 0.0, 3.0);
        let t_s = trajectory.time_at_level(2, 0.033, -1.0, 0.0).unwrap();
        trajectory.at(t_s).position_m.y
    }

    #[test]
    fn the_derivatives_are_those_of_differences() {
        let start = launched(26.0, 8.0, Vector3::new(-150.0, 20.0, 60.0));
        let values = |start: &Aloft, breeze: &Breeze, t_s: f64| {
            Trajectory::new(start, breeze, &physics(), -0.7, 0.9).at(t_s)
        };
        for t_s in [-0.613, -0.02, 0.0, 0.317, 0.871] {
            let here = values(&start, &BLOWN, t_s);
            for column in 0..COLUMNS {
                let step =
                    [1e-3, 1e-3, 1e-2, 1e-4, 1e-3][[0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 4, 4][column]];
                let moved = |sign: f64| {
                    let (mut start, mut breeze) = (start, BLOWN);
                    match column {
                        0..3 => start.position_m[column] += sign * step,
                        3..6 => start.velocity_m_s[column - 3] += sign * step,
                        6..9 => start.spin_rad_s[column - 6] += sign * step,
                        9 => breeze.drag_coefficient += sign * step,
                        _ => breeze.wind_m_s[column - 10] += sign * step,
                    }
                    values(&start, &breeze, t_s)
                };
                let (plus, minus) = (moved(1.0), moved(-1.0));
                let by_position = (plus.position_m - minus.position_m) / (2.0 * step);
                let by_velocity = (plus.velocity_m_s - minus.velocity_m_s) / (2.0 * step);
                let off = (by_position - here.d_position.column(column)).norm();
                assert!(off < 1e-5 * (1.0 + by_position.norm()), "{column} at {t_s}: {off}");
                let off = (by_velocity - here.d_velocity.column(column)).norm();
                assert!(off < 1e-3 * (1.0 + by_velocity.norm()), "{column} at {t_s}: {off}");
            }
        }
    }

    #[test]
    fn the_fixed_step_is_as_good_as_an_adaptive_one() {
        use ode_solvers::dopri5::Dopri5;
        use ode_solvers::{System, Vector6 as State};
        struct Flight(Aloft, Physics);
        impl System<f64, State<f64>> for Flight {
            fn system(&self, t: f64, y: &State<f64>, dy: &mut State<f64>) {
                let model =
                    Model { spin_rad_s: self.0.spin_rad_s, breeze: &BLOWN, physics: &self.1 };
                let v = Vector3::new(y[3], y[4], y[5]);
                let rate = model.rate(t, (v, Sensitivity::zeros()));
                for i in 0..3 {
                    dy[i] = v[i];
                    dy[i + 3] = rate.acceleration[i];
                }
            }
        }
        let start = launched(30.0, 12.0, Vector3::new(-250.0, 30.0, 80.0));
        let (p, v) = (start.position_m, start.velocity_m_s);
        let y0 = State::new(p.x, p.y, p.z, v.x, v.y, v.z);
        let mut stepper = Dopri5::new(Flight(start, physics()), 0.0, 1.0, 0.1, y0, 1e-12, 1e-12);
        stepper.integrate().unwrap();
        let reference = stepper.y_out().last().unwrap();
        let here = Trajectory::new(&start, &BLOWN, &physics(), 0.0, 1.0).at(1.0);
        let off_m = (0..3).map(|i| (here.position_m[i] - reference[i]).abs()).fold(0.0, f64::max);
        println!("one second of flight: {off_m:.1e} m from Dopri5");
        assert!(off_m < 2e-6, "{off_m} m");
    }

    #[test]
    fn curves_between_knots_are_the_flight_itself() {
        let start = launched(28.0, 6.0, Vector3::new(200.0, 0.0, 0.0));
        let whole = Trajectory::new(&start, &STILL, &physics(), 0.0, 0.4);
        // From a start half a step later the knots fall between those of the first.
        let half = whole.at(STEP_S / 2.0);
        let left = spin_left(STEP_S / 2.0);
        let later = Aloft {
            position_m: half.position_m,
            velocity_m_s: half.velocity_m_s,
            spin_rad_s: start.spin_rad_s * left,
        };
        let shifted = Trajectory::new(&later, &STILL, &physics(), 0.0, 0.4);
        let off = whole.at(0.2 + STEP_S / 2.0).position_m - shifted.at(0.2).position_m;
        assert!(off.norm() < 1e-5, "{off}");
    }

    #[test]
    fn the_flights_of_the_thesis_land_where_it_says() {
        // Section 3.4: 30 m/s at 8.1 degrees from 1 m reaches the far baseline (C_D 0.55 of Eq 12).
        let eq12 = Breeze { drag_coefficient: drag_of_thesis(1e9), ..STILL };
        let y_m = landing_y_m(&launched(30.0, 8.1, Vector3::zeros()), &eq12);
        assert!((y_m / 23.77 - 1.0).abs() < 0.02, "{y_m} m");
        // Section 8.3: 100 km/h lands at 21.68 m, which needs free flight's coefficient.
        let free = Breeze { drag_coefficient: DRAG_FREE_FLIGHT, ..STILL };
        let y_m = landing_y_m(&launched(27.78, 8.1, Vector3::zeros()), &free);
        assert!((y_m / 21.68 - 1.0).abs() < 0.015, "{y_m} m");
    }

    #[test]
    fn spin_and_wind_move_the_landing_as_the_notes_say() {
        // Sensitivities of a 24 m/s, 11.6 degree shot: +200 rpm topspin -0.64 m, headwind of
        // 1 m/s -0.37 m, C_D +5 % -0.21 m.
        let spin = |x: f64| launched(24.0, 11.6, Vector3::new(x, 0.0, 0.0));
        let flat_m = landing_y_m(&spin(0.0), &STILL);
        let gusty = Breeze { wind_m_s: Vector2::new(0.0, -1.0), ..STILL };
        let thick = Breeze { drag_coefficient: 0.53 * 1.05, ..STILL };
        for (landed_m, expected_m) in [
            (landing_y_m(&spin(-20.94), &STILL), -0.64),
            (landing_y_m(&spin(0.0), &gusty), -0.37),
            (landing_y_m(&spin(0.0), &thick), -0.21),
        ] {
            let moved_m = landed_m - flat_m;
            assert!((moved_m - expected_m).abs() < 0.06, "{moved_m} for {expected_m}");
        }
    }

    #[test]
    fn drag_only_takes_energy() {
        let start = launched(30.0, 20.0, Vector3::new(-300.0, 50.0, 100.0));
        let trajectory = Trajectory::new(&start, &STILL, &physics(), 0.0, 2.0);
        let energies: Vec<f64> = (0..200)
            .map(|i| trajectory.at(f64::from(i) * 0.01))
            .map(|here| 0.5 * here.velocity_m_s.norm_squared() + 9.81 * here.position_m.z)
            .collect();
        assert!(energies.windows(2).all(|pair| pair[1] < pair[0]));
    }
}

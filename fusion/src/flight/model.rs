//! Unknowns -> where the ball is at any time, and how that depends on every unknown.
//!
//! Two trajectories, joined where the centre comes down to a radius above the ground. The second
//! starts there with the velocity after the bounce (an unknown of its own) and with the spin that
//! this change of velocity must have brought ([`rebound::spin_after`]), so slip and grip need not
//! be told apart. The time of the bounce is no unknown: it follows, and so does its derivative,
//! `dt = (dz_ground − dz)/v_z`.
//!
//! Times are seconds from the reference time, on the left camera's clock.

use crate::flight::unknowns::{CLOCK, DRAG, GROUND, N, OUT, SPIN, Slope, Unknowns};
use crate::world::acceleration::{Aloft, COLUMNS, Sensitivity, spin_left};
use crate::world::ball::Physics;
use crate::world::rebound;
use crate::world::trajectory::{Here, Trajectory};
use nalgebra::{Matrix3, Point3, RowSVector, Vector3};

/// A row of derivatives by all unknowns.
pub type Row = RowSVector<f64, N>;

/// Half of the step by which acceleration is read off a trajectory.
const ACCELERATION_STEP_S: f64 = 5e-4;

/// The ball at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Since the reference time.
    pub t_s: f64,
    /// Its derivative; zero where the time was given.
    pub d_t: Row,
    /// Centre of the ball, court.
    pub position_m: Point3<f64>,
    /// Over ground.
    pub velocity_m_s: Vector3<f64>,
    /// Derivative of the position.
    pub d_position: Slope,
    /// Derivative of the velocity.
    pub d_velocity: Slope,
}

/// How far a flight is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// At most 0.
    pub from_s: f64,
    /// At least 0.
    pub to_s: f64,
    /// Whether the ball goes on after the ground, or through it.
    pub has_bounce: bool,
}

/// A flight with these unknowns.
#[derive(Clone)]
pub struct Model {
    before: Trajectory,
    touch: Option<Instant>,
    after: Option<Rise>,
    spin_rad_s: Vector3<f64>,
}

#[derive(Clone)]
struct Rise {
    trajectory: Trajectory,
    d_spin: Slope,
}

impl Model {
    /// Follows the ball.
    #[must_use]
    pub fn new(unknowns: &Unknowns, physics: &Physics, span: &Span) -> Self {
        let before =
            Trajectory::new(&unknowns.aloft, &unknowns.breeze, physics, span.from_s, span.to_s);
        let spin_rad_s = unknowns.aloft.spin_rad_s;
        let mut model = Self { before, touch: None, after: None, spin_rad_s };
        let height_m = physics.ball.radius_m() + unknowns.ground_m;
        model.touch = model.before.time_at_level(2, height_m, -1.0, 0.0).map(|t_s| {
            let mut d_level = Row::zeros();
            d_level[GROUND] = 1.0;
            model.crossing(t_s, 2, &d_level)
        });
        if let (Some(touch), true) = (&model.touch, span.has_bounce) {
            model.after = Some(Rise::new(touch, unknowns, physics, span.to_s));
        }
        model
    }

    /// Where the ball touches the ground, whether or not it then goes on; None if it does not
    /// within the span.
    #[must_use]
    pub fn touch(&self) -> Option<&Instant> {
        self.touch.as_ref()
    }

    /// Whether a time is after the bounce.
    #[must_use]
    pub fn is_after(&self, t_s: f64) -> bool {
        self.after.is_some() && self.touch.is_some_and(|touch| t_s > touch.t_s)
    }

    /// Angular velocity before the bounce; all of its derivative is [`spin_left`].
    #[must_use]
    pub fn spin_at(&self, t_s: f64) -> Vector3<f64> {
        self.spin_rad_s * spin_left(t_s)
    }

    /// The ball at a time.
    #[must_use]
    pub fn at(&self, t_s: f64) -> Instant {
        match (&self.after, &self.touch) {
            (Some(rise), Some(touch)) if t_s > touch.t_s => rise.at(t_s, touch),
            _ => self.before_bounce_at(t_s),
        }
    }

    /// The same without the velocity's derivative, which is left zero: what a pixel depends on.
    #[must_use]
    pub fn place_at(&self, t_s: f64) -> Instant {
        match (&self.after, &self.touch) {
            (Some(rise), Some(touch)) if t_s > touch.t_s => rise.place_at(t_s, touch),
            _ => widened(t_s, &self.before.place_at(t_s)),
        }
    }

    /// When, from `from_s` on, the ball passes a plane before its bounce, upwards of its axis.
    #[must_use]
    pub fn passing(&self, axis: usize, level_m: f64, from_s: f64) -> Option<Instant> {
        let t_s = self.before.time_at_level(axis, level_m, 1.0, from_s)?;
        Some(self.crossing(t_s, axis, &Row::zeros()))
    }

    fn before_bounce_at(&self, t_s: f64) -> Instant {
        widened(t_s, &self.before.at(t_s))
    }

    /// The instant of a crossing, which moves with the unknowns.
    fn crossing(&self, t_s: f64, axis: usize, d_level: &Row) -> Instant {
        let here = self.before_bounce_at(t_s);
        let d_t = (d_level - here.d_position.row(axis)) / here.velocity_m_s[axis];
        let velocity_at = |t_s: f64| self.before.place_at(t_s).velocity_m_s;
        let acceleration = (velocity_at(t_s + ACCELERATION_STEP_S)
            - velocity_at(t_s - ACCELERATION_STEP_S))
            / (2.0 * ACCELERATION_STEP_S);
        Instant {
            d_t,
            d_position: here.d_position + here.velocity_m_s * d_t,
            d_velocity: here.d_velocity + acceleration * d_t,
            ..here
        }
    }
}

impl Rise {
    fn new(touch: &Instant, unknowns: &Unknowns, physics: &Physics, to_s: f64) -> Self {
        let radius_m = physics.ball.radius_m();
        let left = spin_left(touch.t_s);
        let spin_in = unknowns.aloft.spin_rad_s * left;
        let per_change = rebound::spin_per_change(radius_m);
        let start = Aloft {
            position_m: touch.position_m,
            velocity_m_s: unknowns.out_m_s,
            spin_rad_s: rebound::spin_after(
                &touch.velocity_m_s,
                &unknowns.out_m_s,
                &spin_in,
                radius_m,
            ),
        };
        let mut d_spin = per_change * -touch.d_velocity;
        let mut by_out = d_spin.fixed_columns_mut::<3>(OUT);
        by_out += per_change;
        let mut by_spin = d_spin.fixed_columns_mut::<3>(SPIN);
        by_spin += Matrix3::identity() * left;
        let span_s = (to_s - touch.t_s).max(0.0);
        let trajectory = Trajectory::new(&start, &unknowns.breeze, physics, 0.0, span_s);
        Self { trajectory, d_spin }
    }

    fn at(&self, t_s: f64, touch: &Instant) -> Instant {
        let since_s = t_s - touch.t_s;
        let velocity_at = |t_s: f64| self.trajectory.place_at(t_s).velocity_m_s;
        let acceleration = (velocity_at(since_s + ACCELERATION_STEP_S)
            - velocity_at(since_s - ACCELERATION_STEP_S))
            / (2.0 * ACCELERATION_STEP_S);
        let here = self.trajectory.at(since_s);
        let d_velocity = self.chained(&here.d_velocity, &acceleration, touch);
        Instant { d_velocity, ..self.place_at(t_s, touch) }
    }

    fn place_at(&self, t_s: f64, touch: &Instant) -> Instant {
        let here = self.trajectory.place_at(t_s - touch.t_s);
        Instant {
            t_s,
            d_t: Row::zeros(),
            position_m: here.position_m,
            velocity_m_s: here.velocity_m_s,
            d_position: self.chained(&here.d_position, &here.velocity_m_s, touch),
            d_velocity: Slope::zeros(),
        }
    }

    /// From what the rise depends on to what all depends on; the rate is for its start moving.
    fn chained(&self, by: &Sensitivity, rate: &Vector3<f64>, touch: &Instant) -> Slope {
        let mut slope = by.fixed_columns::<3>(0) * touch.d_position
            + by.fixed_columns::<3>(SPIN) * self.d_spin
            - rate * touch.d_t;
        let mut out = slope.fixed_columns_mut::<3>(OUT);
        out += by.fixed_columns::<3>(3);
        let mut air = slope.fixed_columns_mut::<3>(DRAG);
        air += by.fixed_columns::<3>(DRAG);
        slope
    }
}

/// By all unknowns instead of those of a trajectory.
fn widened(t_s: f64, here: &Here) -> Instant {
    let widened = |by: &Sensitivity| {
        let mut slope = Slope::zeros();
        slope.fixed_columns_mut::<COLUMNS>(0).copy_from(by);
        slope
    };
    Instant {
        t_s,
        d_t: Row::zeros(),
        position_m: here.position_m,
        velocity_m_s: here.velocity_m_s,
        d_position: widened(&here.d_position),
        d_velocity: widened(&here.d_velocity),
    }
}

const _: () = assert!(COLUMNS == CLOCK, "a trajectory's columns are the first of a flight's");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::unknowns::Column;
    use crate::pretend;
    use crate::world::acceleration::Breeze;
    use nalgebra::Vector2;

    fn unknowns() -> Unknowns {
        Unknowns {
            aloft: Aloft {
                position_m: Point3::new(0.1, 11.0, 1.9),
                velocity_m_s: Vector3::new(0.4, 21.0, -1.0),
                spin_rad_s: Vector3::new(-120.0, 15.0, 40.0),
            },
            breeze: Breeze { drag_coefficient: 0.52, wind_m_s: Vector2::new(0.7, -1.1) },
            clock_s: 0.001,
            ground_m: 0.003,
            out_m_s: Vector3::new(0.3, 13.0, 4.1),
        }
    }

    const SPAN: Span = Span { from_s: -0.6, to_s: 1.1, has_bounce: true };

    #[test]
    fn every_derivative_is_that_of_differences() {
        let physics = pretend::reference_rig().physics();
        let steps: [f64; N] = [
            2e-3, 2e-3, 2e-3, 1e-2, 1e-2, 1e-2, 0.1, 0.1, 0.1, 1e-4, 1e-3, 1e-3, 1e-4, 1e-4, 1e-3,
            1e-3, 1e-3,
        ];
        let model = Model::new(&unknowns(), &physics, &SPAN);
        let touch_s = model.touch().unwrap().t_s;
        let looks: [fn(&Model, f64) -> Instant; 3] = [
            |model, t_s| model.at(t_s),
            |model, _| *model.touch().unwrap(),
            |model, _| model.passing(1, 1.5, -0.6).unwrap(),
        ];
        let times_s = [-0.55, 0.0, touch_s - 0.03, touch_s + 0.03, touch_s + 0.2];
        let cases = looks.iter().enumerate().flat_map(|look| times_s.map(|t_s| (look, t_s)));
        for ((kind, look), t_s) in cases {
            let here = look(&model, t_s);
            for (i, step) in steps.into_iter().enumerate() {
                let moved = |sign: f64| {
                    let mut by = Column::zeros();
                    by[i] = sign * step;
                    look(&Model::new(&unknowns().plus(&by), &physics, &SPAN), t_s)
                };
                let (plus, minus) = (moved(1.0), moved(-1.0));
                let position = (plus.position_m - minus.position_m) / (2.0 * step);
                let velocity = (plus.velocity_m_s - minus.velocity_m_s) / (2.0 * step);
                let off = (position - here.d_position.column(i)).norm();
                assert!(off < 2e-4 * (1.0 + position.norm()), "{kind}, {i} at {t_s}: {off}");
                let off = (velocity - here.d_velocity.column(i)).norm();
                assert!(
                    off < 2e-3 * (1.0 + velocity.norm()),
                    "velocity of {kind}, {i} at {t_s}: {off}"
                );
            }
        }
    }

    #[test]
    fn the_ball_is_where_it_bounced_before_and_after() {
        let physics = pretend::reference_rig().physics();
        let model = Model::new(&unknowns(), &physics, &SPAN);
        let touch = model.touch().unwrap();
        assert!((touch.position_m.z - 0.036).abs() < 1e-9);
        let jump = model.at(touch.t_s + 1e-9).position_m - model.at(touch.t_s - 1e-9).position_m;
        assert!(jump.norm() < 1e-6);
        assert!(model.is_after(touch.t_s + 0.01) && !model.is_after(touch.t_s - 0.01));
        let through = Model::new(&unknowns(), &physics, &Span { has_bounce: false, ..SPAN });
        assert!(through.at(touch.t_s + 0.05).position_m.z < 0.0);
    }
}

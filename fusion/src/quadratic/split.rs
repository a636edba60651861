//! Points -> split flight: cut at the first bounce, and arcs (Eq 26) of its parts.
//!
//! **Split.** The thesis splits where "the local acceleration is negative"; at a bounce it is
//! strongly positive. Here: the vertical speed turns from down to up near the ground, and of the
//! places where it may have turned, the one with the least squared error of both sides.
//!
//! **Which part is fitted.** Even with drag's third order an arc drifts off over a whole flight
//! (`arc`), so each quantity comes from the points nearest in time: the bounce from the last
//! [`BOUNCE_WINDOW_S`] before it, the launch from the first [`LAUNCH_WINDOW_S`] seen, anything
//! between from [`TRACK_WINDOW_S`] around it. No window reaches across the bounce.
//!
//! **Bounce.** Where the ball's *centre* comes down to its *radius* (the thesis: to 0, sampled
//! every 2 ms, 4 cm apart), by solving for the time. Its covariance is that of the arc, carried
//! along the flight to the ground, and [`MODEL_SIGMA_M`] along the flight for what the arc cannot
//! follow.
//!
//! Measured on the shot of the thesis, no pixel noise, C_D 4 % off; bounce off along the court, mm:
//!
//! | window        | 0.3 s | 0.45 s | 0.6 s | 0.8 s | all |
//! |---------------|-------|--------|-------|-------|-----|
//! | Eq 26 alone   |     1 |     12 |    40 |   153 | 313 |
//! | and the jerk  |   0.1 |    0.3 |   1.0 |   7.1 |  17 |
//!
//! With 0.3 px, 30 % missed, two false spots per camera and up to 1000 rpm (200 shots, `pretend`):
//! 18 mm RMS from a window of 0.35 s, 16 from 0.45 s, 13 from 0.6 s, 12 from 0.75 s; with 0.1 px
//! and 5 % missed 3.5, 3.1, 3.7 and 5.3 mm, where the model shows.

use crate::motion::seconds_between;
use crate::points::Point;
use crate::quadratic::arc::{Arc, crossing_covariance};
use crate::shot::Bounce;
use crate::world::ball::{GRAVITY_M_S2, Physics};
use nalgebra::{Matrix2, Vector2};
use shm_layout::StampNs;

/// The part of a flight its bounce is extrapolated from.
pub const BOUNCE_WINDOW_S: f64 = 0.6;

/// The part of a flight its launch is extrapolated from.
pub const LAUNCH_WINDOW_S: f64 = 0.4;

/// The part of a flight one point of the track is smoothed over.
pub const TRACK_WINDOW_S: f64 = 0.4;

/// What an arc over [`BOUNCE_WINDOW_S`] may be off by at the bounce, along the flight.
pub const MODEL_SIGMA_M: f64 = 0.01;

/// A ball falls and rises at this speed around a bounce.
const TURN_RATE_M_S: f64 = 6.0;

/// A ball that turns is seen this near the ground, or as near as the gap around its turn lets it.
const TURN_HEIGHT_MAX_M: f64 = 0.6;

/// Least vertical speed before and after a bounce; slower is rolling, or noise.
const TURN_SPEED_MIN_M_S: f64 = 0.5;

/// Points on either side the vertical speed is taken from: 0.07 s.
const N_TURN_POINTS: usize = 6;

/// Fewest points on either side.
const N_TURN_POINTS_MIN: usize = 3;

/// Places after the first possible one that are compared, and points of each side they are
/// compared by: few enough that spin does not bend them.
const N_TURN_PLACES: usize = 6;

/// Squared error, in sigmas, beyond which a point says nothing about where the bounce is.
const TURN_COST_MAX: f64 = 16.0;

/// Crossing and turn may differ by this: a rig whose ground is 10 cm off at 16° of descent.
const CROSSING_SLACK_S: f64 = 0.06;

/// The points of a path, split at its first bounce.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Split<'a> {
    /// What bends it.
    pub physics: Physics,
    /// Up to the bounce, or all.
    pub before: &'a [Point],
    /// After the bounce; empty if none was seen.
    pub after: &'a [Point],
}

impl<'a> Split<'a> {
    /// Splits a path at its first bounce; without a court there is no ground to bounce on.
    #[must_use]
    pub fn from_points(points: &'a [Point], is_court_known: bool, physics: Physics) -> Self {
        let turn = if is_court_known { first_turn(points) } else { None };
        let (before, after) = points.split_at(turn.unwrap_or(points.len()));
        Self { physics, before, after }
    }

    /// Where the ball touched the ground; None if that was not seen.
    #[must_use]
    pub fn bounce(&self, radius_m: f64) -> Option<Bounce> {
        let (last, next) = (self.before.last()?, self.after.first()?);
        let arc = self.arc_from(ending(self.before, BOUNCE_WINDOW_S))?;
        let turn_ns = last.t_ns.midpoint(next.t_ns);
        let t_ns = arc
            .times_at_level(2, radius_m)
            .into_iter()
            .filter(|&t_ns| arc.state_at(t_ns).velocity_m_s.z < 0.0)
            .min_by_key(|t_ns| t_ns.abs_diff(turn_ns))?;
        let is_at_turn = seconds_between(last.t_ns, t_ns) > -CROSSING_SLACK_S
            && seconds_between(t_ns, next.t_ns) > -CROSSING_SLACK_S;
        if !is_at_turn {
            return None;
        }
        let state = arc.state_at(t_ns);
        let [[xx, xy], [yx, yy]] =
            crossing_covariance(&arc.covariance_at(t_ns), &state.velocity_m_s, 2);
        let along = Vector2::new(state.velocity_m_s.x, state.velocity_m_s.y)
            .try_normalize(0.0)
            .unwrap_or_default();
        let model = along * along.transpose() * MODEL_SIGMA_M.powi(2);
        let covariance = Matrix2::new(xx, xy, yx, yy) + model;
        let out = self.arc_from(beginning(self.after, LAUNCH_WINDOW_S));
        Some(Bounce {
            t_ns,
            position_m: state.position_m,
            covariance_m2: covariance.transpose().into(),
            velocity_in_m_s: state.velocity_m_s,
            velocity_out_m_s: out.map(|arc| arc.state_at(t_ns).velocity_m_s),
            t_sigma_s: None,
            velocity_sigma_m_s: None,
        })
    }

    /// The arc of the first points seen.
    #[must_use]
    pub fn launch_arc(&self) -> Option<Arc> {
        self.arc_from(beginning(self.before, LAUNCH_WINDOW_S))
    }

    /// The arc around a time, on its side of the bounce; at an end of the flight the window is
    /// shifted, not cut.
    #[must_use]
    pub fn arc_around(&self, t_ns: StampNs) -> Option<Arc> {
        let is_after = self.after.first().is_some_and(|first| t_ns >= first.t_ns);
        let points = if is_after { self.after } else { self.before };
        let (first, last) = (points.first()?, points.last()?);
        let half_s = TRACK_WINDOW_S / 2.0;
        if seconds_between(first.t_ns, t_ns) < half_s {
            return self.arc_from(beginning(points, TRACK_WINDOW_S));
        }
        if seconds_between(t_ns, last.t_ns) < half_s {
            return self.arc_from(ending(points, TRACK_WINDOW_S));
        }
        let is_near = |point: &Point| seconds_between(t_ns, point.t_ns).abs() <= half_s;
        let from = points.iter().position(is_near)?;
        let n = points[from..].iter().take_while(|point| is_near(point)).count();
        self.arc_from(&points[from..from + n])
    }

    fn arc_from(&self, points: &[Point]) -> Option<Arc> {
        Arc::from_points(points, &self.physics)
    }
}

/// The points of the first `window_s`.
fn beginning(points: &[Point], window_s: f64) -> &[Point] {
    let Some(first) = points.first() else { return points };
    let n = points.partition_point(|point| seconds_between(first.t_ns, point.t_ns) <= window_s);
    &points[..n]
}

/// The points of the last `window_s`.
fn ending(points: &[Point], window_s: f64) -> &[Point] {
    let Some(last) = points.last() else { return points };
    let n = points.partition_point(|point| seconds_between(point.t_ns, last.t_ns) > window_s);
    &points[n..]
}

/// Index of the first point after the first bounce.
fn first_turn(points: &[Point]) -> Option<usize> {
    let n = points.len();
    let is_turn = |&i: &usize| {
        let before = Fall::from_points(&points[i.saturating_sub(N_TURN_POINTS)..i]);
        let after = Fall::from_points(&points[i..n.min(i + N_TURN_POINTS)]);
        let height_m = points[i - 1].position_m.z.min(points[i].position_m.z);
        let gap_s = seconds_between(points[i - 1].t_ns, points[i].t_ns);
        before.speed_at(points[i - 1].t_ns) < -TURN_SPEED_MIN_M_S
            && after.speed_at(points[i].t_ns) > TURN_SPEED_MIN_M_S
            && height_m < TURN_HEIGHT_MAX_M.max(TURN_RATE_M_S * gap_s)
    };
    let places = N_TURN_POINTS_MIN..(n + 1).saturating_sub(N_TURN_POINTS_MIN);
    let first = places.clone().find(is_turn)?;
    let from = first.saturating_sub(N_TURN_PLACES);
    let to = n.min(first + 2 * N_TURN_PLACES);
    let cost = |i: usize| {
        Fall::from_points(&points[from..i]).cost(&points[from..i])
            + Fall::from_points(&points[i..to]).cost(&points[i..to])
    };
    (first..places.end.min(first + N_TURN_PLACES))
        .map(|i| (cost(i), i))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, i)| i)
}

/// Height under gravity alone: `z = z0 + v τ − ½ g τ²`, weighted least squares. Drag bends a tenth
/// of a second by less than a centimetre.
struct Fall {
    reference_ns: StampNs,
    height_m: f64,
    speed_m_s: f64,
}

impl Fall {
    fn from_points(points: &[Point]) -> Self {
        let reference_ns = points.first().map_or(0, |point| point.t_ns);
        let [mut s0, mut s1, mut s2, mut sz, mut stz] = [0.0; 5];
        for point in points {
            let tau_s = seconds_between(reference_ns, point.t_ns);
            let weight = 1.0 / point.covariance_m2[(2, 2)];
            let z_m = point.position_m.z + 0.5 * GRAVITY_M_S2 * tau_s * tau_s;
            s0 += weight;
            s1 += weight * tau_s;
            s2 += weight * tau_s * tau_s;
            sz += weight * z_m;
            stz += weight * tau_s * z_m;
        }
        let determinant = s0 * s2 - s1 * s1;
        Self {
            reference_ns,
            height_m: (s2 * sz - s1 * stz) / determinant,
            speed_m_s: (s0 * stz - s1 * sz) / determinant,
        }
    }

    fn speed_at(&self, t_ns: StampNs) -> f64 {
        let tau_s = seconds_between(self.reference_ns, t_ns);
        self.speed_m_s - GRAVITY_M_S2 * tau_s
    }

    /// Sum of squared errors in sigmas, each at most [`TURN_COST_MAX`].
    fn cost(&self, points: &[Point]) -> f64 {
        let cost_of = |point: &Point| {
            let tau_s = seconds_between(self.reference_ns, point.t_ns);
            let fall_m = 0.5 * GRAVITY_M_S2 * tau_s * tau_s;
            let z_m = self.height_m + self.speed_m_s * tau_s - fall_m;
            let miss_m = point.position_m.z - z_m;
            (miss_m * miss_m / point.covariance_m2[(2, 2)]).min(TURN_COST_MAX)
        };
        points.iter().map(cost_of).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;

    fn physics() -> Physics {
        pretend::reference_rig().physics()
    }

    #[test]
    fn a_flight_splits_where_it_turns_upwards() {
        let points = pretend::bouncing_points();
        let truth_ns = pretend::bouncing_truth().t_ns;
        for lost in [0..0, 78..82, 85..90] {
            let seen: Vec<Point> =
                (0..points.len()).filter(|i| !lost.contains(i)).map(|i| points[i]).collect();
            let flight = Split::from_points(&seen, true, physics());
            assert!(flight.before.last().unwrap().t_ns <= truth_ns);
            assert!(flight.after.first().unwrap().t_ns >= truth_ns);
        }
        let flight = Split::from_points(&points, false, physics());
        assert!(flight.after.is_empty(), "without a court there is no ground");
    }

    #[test]
    fn an_arc_over_the_bounce_window_is_off_by_millimetres() {
        let truth = pretend::bouncing_truth();
        let points = pretend::bouncing_points();
        let flight = Split::from_points(&points, true, physics());
        let mut no_drag = physics();
        no_drag.ball.mass_kg = f64::INFINITY;
        let error_m = |physics: Physics, window_s: f64| {
            let arc = Arc::from_points(ending(flight.before, window_s), &physics).unwrap();
            let t_ns = arc.times_at_level(2, 0.033)[1];
            arc.state_at(t_ns).position_m.y - truth.position_m.y
        };
        for window_s in [0.3, 0.45, 0.6, 0.8, 2.0] {
            let [alone_mm, mended_mm] = [no_drag, physics()].map(|p| error_m(p, window_s) * 1e3);
            println!("window {window_s} s: off by {alone_mm:.1} mm, with jerk {mended_mm:.1} mm");
        }
        assert!(error_m(no_drag, BOUNCE_WINDOW_S).abs() > 0.03, "Eq 26 alone");
        let bounce = flight.bounce(0.033).unwrap();
        let off_m = (bounce.position_m - truth.position_m).norm();
        assert!(off_m < MODEL_SIGMA_M / 2.0, "{off_m} m");
        assert!((bounce.velocity_in_m_s - truth.velocity_in_m_s).norm() < 0.2);
        let out = bounce.velocity_out_m_s.unwrap();
        assert!((out - truth.velocity_out_m_s.unwrap()).norm() < 0.2);
    }

    #[test]
    fn a_bounce_in_a_gap_of_a_third_of_a_second_is_found() {
        let points = pretend::bouncing_points();
        let bounce = Split::from_points(&points, true, physics()).bounce(0.033).unwrap();
        let is_seen = |point: &&Point| seconds_between(bounce.t_ns, point.t_ns).abs() > 0.16;
        let seen: Vec<Point> = points.iter().filter(is_seen).cloned().collect();
        assert!(seen.len() + 20 < points.len(), "the bounce is not in the points");
        let guessed = Split::from_points(&seen, true, physics()).bounce(0.033).unwrap();
        let off_m = (guessed.position_m - bounce.position_m).norm();
        assert!(off_m < 3.0 * guessed.covariance_m2[1][1].sqrt(), "{off_m} m");
    }

    #[test]
    fn a_flight_that_ends_in_the_air_has_no_bounce() {
        let points = pretend::bouncing_points();
        let flight = Split::from_points(&points[..60], true, physics());
        assert!(flight.after.is_empty());
        assert_eq!(flight.bounce(0.033), None);
        assert_eq!(Split::from_points(&[], true, physics()).launch_arc(), None);
    }
}

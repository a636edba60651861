//! A flight that is over -> the same ball, which hops and rolls on until it lies still.
//!
//! The truth ends a flight at the fence, in the net, or when the ball no longer lifts off. On a
//! real court the ball is still there: it comes back from the fence and is in both pictures when
//! the next one is served. Nobody measures it, so its path is simple: gravity, a hop that keeps
//! half of the speed, and friction while it rolls; in steps of 5 ms, straight in between.

use nalgebra::{Point3, Vector3};

use crate::scenario::Scenario;
use crate::truth::{Flight, FlightEnd};

/// Between two places that are kept.
const STEP_S: f64 = 0.005;
/// A ball is picked up after this long.
const LIES_S: f64 = 5.0;
/// Speed that a fence gives back; it is soft.
const FENCE_RESTITUTION: f64 = 0.2;
/// Speed that the net gives back.
const NET_RESTITUTION: f64 = 0.05;
/// Part of the vertical speed that a hop keeps, and the speed below which it rolls.
const HOP: f64 = 0.5;
const HOP_MIN_M_S: f64 = 0.3;
/// Rolling on acrylic.
const ROLLING_M_S2: f64 = 0.4;
/// For the speed at the end of a flight.
const JUST_BEFORE_S: f64 = 0.001;

/// What becomes of a ball after its flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Leftover {
    from_s: f64,
    places_m: Vec<Point3<f64>>,
}

impl Leftover {
    /// Follows a ball after the end of its flight.
    pub fn from_flight(scenario: &Scenario, flight: &Flight) -> Self {
        let from_s = flight.ended_at_s();
        let before = |s: f64| flight.position_in_court_m(from_s - s);
        let launched_m = flight.launch.position_in_court_m;
        let mut p = before(1e-9).unwrap_or(launched_m);
        let earlier = before(JUST_BEFORE_S).unwrap_or(p);
        let mut v = (p - earlier) / JUST_BEFORE_S;
        match flight.end {
            FlightEnd::Fence => v.y *= -FENCE_RESTITUTION,
            FlightEnd::Net => v *= -NET_RESTITUTION,
            // It has just touched the ground, where it came from above.
            FlightEnd::Rolling | FlightEnd::NotFollowed => v.z = 0.0,
        }
        let radius_m = scenario.world.ball_radius_m;
        let mut places_m = vec![p];
        for _ in 0..(LIES_S / STEP_S) as usize {
            p += v * STEP_S;
            v.z -= scenario.world.gravity_m_s2 * STEP_S;
            if p.z <= radius_m {
                p.z = radius_m;
                v.z = if v.z < -HOP_MIN_M_S { -HOP * v.z } else { 0.0 };
                let level = Vector3::new(v.x, v.y, 0.0);
                let slower = (level.norm() - ROLLING_M_S2 * STEP_S).max(0.0);
                let level = level.try_normalize(0.0).unwrap_or_default() * slower;
                v = Vector3::new(level.x, level.y, v.z);
            }
            places_m.push(p);
        }
        Self { from_s, places_m }
    }

    /// Where it is; `None` while it flies and after it was picked up.
    pub fn position_in_court_m(&self, at_s: f64) -> Option<Point3<f64>> {
        let steps = (at_s - self.from_s) / STEP_S;
        if steps < 0.0 {
            return None;
        }
        let idx = steps as usize;
        let (a, b) = (self.places_m.get(idx)?, self.places_m.get(idx + 1)?);
        Some(a + (b - a) * steps.fract())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::Truth;

    #[test]
    fn a_ball_rolls_on_from_where_its_flight_ended_and_slows_down() {
        let scenario = Scenario::thesis_shot();
        let truth = Truth::from_scenario(&scenario);
        let flight = &truth.flights[0];
        let leftover = Leftover::from_flight(&scenario, flight);
        let end_s = flight.ended_at_s();
        assert_eq!(leftover.position_in_court_m(end_s - 0.01), None);
        let last = flight.position_in_court_m(end_s - 1e-9).expect("in flight");
        let next = leftover.position_in_court_m(end_s + 1e-6).expect("rolls on");
        assert!((last - next).norm() < 1e-3, "{last} {next}");
        let y_m = |later_s: f64| {
            let place = leftover.position_in_court_m(end_s + later_s).expect("rolls on");
            assert!(place.z >= scenario.world.ball_radius_m);
            place.y
        };
        assert!(y_m(1.0) < y_m(0.0), "it comes back from the fence");
        assert!((y_m(0.5) - y_m(0.0)).abs() > (y_m(4.5) - y_m(4.0)).abs(), "it slows down");
        assert_eq!(leftover.position_in_court_m(end_s + LIES_S + 0.1), None);
    }
}

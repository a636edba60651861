//! Time -> where a ball is that nobody plays with: it lies on the ground, or rolls to rest.
//!
//! Rolling takes a steady deceleration: 0.3 m/s2 on a hard court.

use nalgebra::{Point2, Point3, Vector2};

/// A ball on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrayBall {
    /// Where it lies before it rolls, on the ground of `court`.
    pub from_in_court_m: Point2<f64>,
    /// How it begins to roll; zero for one that lies.
    pub velocity_m_s: Vector2<f64>,
    /// When it begins to roll.
    pub rolls_at_s: f64,
    /// How it slows down.
    pub deceleration_m_s2: f64,
}

impl StrayBall {
    /// One that lies there all the time.
    pub fn at_rest(x_m: f64, y_m: f64) -> Self {
        Self {
            from_in_court_m: Point2::new(x_m, y_m),
            velocity_m_s: Vector2::zeros(),
            rolls_at_s: 0.0,
            deceleration_m_s2: 0.3,
        }
    }

    /// Its centre.
    pub fn position_in_court_m(&self, radius_m: f64, at_s: f64) -> Point3<f64> {
        let speed_m_s = self.velocity_m_s.norm();
        let mut place = self.from_in_court_m;
        if speed_m_s > 0.0 {
            let rolls_for_s = speed_m_s / self.deceleration_m_s2;
            let since_s = (at_s - self.rolls_at_s).clamp(0.0, rolls_for_s);
            let way_m = since_s * (speed_m_s - 0.5 * self.deceleration_m_s2 * since_s);
            place += self.velocity_m_s * (way_m / speed_m_s);
        }
        Point3::new(place.x, place.y, radius_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_rolls_to_rest_and_stays() {
        let velocity_m_s = Vector2::new(0.6, 0.0);
        let ball = StrayBall { velocity_m_s, rolls_at_s: 1.0, ..StrayBall::at_rest(1.0, 15.0) };
        let x_m = |at_s| ball.position_in_court_m(0.033, at_s).x;
        assert_eq!(x_m(0.5), 1.0);
        // v^2 / 2a = 0.6 m, after v / a = 2 s.
        assert!((x_m(3.0) - 1.6).abs() < 1e-12);
        assert_eq!(x_m(3.0), x_m(9.0));
        assert!(x_m(1.1) - x_m(1.0) > x_m(2.9) - x_m(2.8));
    }
}

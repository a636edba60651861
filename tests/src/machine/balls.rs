//! The hopper: how much drag and lift the next ball has.
//!
//! Balls of a session have a mean drag (worn ones less, fluffed ones more), which may drift as they
//! are used; each ball has its own on top.

/// The mean of all balls: that of [`World`](crate::world::World).
pub const DRAG_COEFFICIENT: f64 = 0.53;

/// Balls of a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balls {
    /// Mean drag coefficient of the first ball.
    pub drag_coefficient: f64,
    /// How much more it is with each ball played, as a part of it.
    pub drag_drift_per_ball: f64,
    /// 1 sigma from ball to ball, as a part of the drag.
    pub drag_scatter: f64,
    /// The same of lift.
    pub lift_scatter: f64,
}

impl Default for Balls {
    /// 3 % of drag and 4 % of lift from ball to ball: balls of one box; a hopper of all ages has
    /// more.
    fn default() -> Self {
        Self {
            drag_coefficient: DRAG_COEFFICIENT,
            drag_drift_per_ball: 0.0,
            drag_scatter: 0.03,
            lift_scatter: 0.04,
        }
    }
}

impl Balls {
    /// Mean drag after so many balls.
    pub fn mean_drag(&self, ball_idx: usize) -> f64 {
        self.drag_coefficient * (1.0 + self.drag_drift_per_ball * ball_idx as f64)
    }

    /// Drag and lift scale of one ball, from two numbers of a standard normal distribution.
    pub fn drawn(&self, ball_idx: usize, chances: [f64; 2]) -> [f64; 2] {
        let drag = self.mean_drag(ball_idx) * (1.0 + self.drag_scatter * chances[0]);
        [drag.max(0.1), (1.0 + self.lift_scatter * chances[1]).max(0.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drag_drifts_with_balls_and_scatters_between_them() {
        let balls = Balls { drag_drift_per_ball: 0.002, ..Balls::default() };
        assert!((balls.mean_drag(25) / DRAG_COEFFICIENT - 1.05).abs() < 1e-9);
        assert_eq!(balls.drawn(0, [0.0, 0.0]), [DRAG_COEFFICIENT, 1.0]);
        let [drag, lift] = balls.drawn(0, [1.0, -1.0]);
        assert!((drag / DRAG_COEFFICIENT - 1.03).abs() < 1e-9 && (lift - 0.96).abs() < 1e-9);
    }
}

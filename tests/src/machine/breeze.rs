//! The wind that each ball flies through: a mean, gusts around it, and what comes up suddenly.

use nalgebra::Vector2;
use rand::{Rng, RngExt};

/// Wind of a session, level, in the court's axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Breeze {
    /// The mean until it changes.
    pub mean_m_s: Vector2<f64>,
    /// From this ball on the mean is more by so much.
    pub step: Option<(usize, Vector2<f64>)>,
    /// 1 sigma of each axis, from ball to ball.
    pub gust_sigma_m_s: f64,
    /// Strong gusts: the ball, and what comes on top for it.
    pub strong: Vec<(usize, Vector2<f64>)>,
}

/// A strong gust is this fast,
const STRONG_M_S: (f64, f64) = (2.0, 3.0);
/// and lasts for two balls as often as for one.
const TWO_BALLS: f64 = 0.5;

impl Breeze {
    /// Gusts of 0.5 m/s around a mean.
    pub fn around(mean_m_s: Vector2<f64>) -> Self {
        Self { mean_m_s, step: None, gust_sigma_m_s: 0.5, strong: Vec::new() }
    }

    /// Draws strong gusts, from any side, that begin at such a part of the balls.
    pub fn with_strong(mut self, share: f64, n_balls: usize, rng: &mut impl Rng) -> Self {
        let mut ball_idx = 0;
        while ball_idx < n_balls {
            if !rng.random_bool(share) {
                ball_idx += 1;
                continue;
            }
            let gust_m_s = direction(rng) * rng.random_range(STRONG_M_S.0..STRONG_M_S.1);
            let n = if rng.random_bool(TWO_BALLS) { 2 } else { 1 };
            self.strong.extend((ball_idx..ball_idx + n).map(|idx| (idx, gust_m_s)));
            // The air is calm for a ball at least.
            ball_idx += n + 1;
        }
        self
    }

    /// The mean at a ball, without gusts.
    pub fn mean_at(&self, ball_idx: usize) -> Vector2<f64> {
        let step = self.step.filter(|(from_idx, _)| ball_idx >= *from_idx);
        self.mean_m_s + step.map_or(Vector2::zeros(), |(_, by_m_s)| by_m_s)
    }

    /// What a ball flies through, from two numbers of a standard normal distribution.
    pub fn of_ball(&self, ball_idx: usize, chances: [f64; 2]) -> Vector2<f64> {
        let strong = self.strong.iter().find(|(idx, _)| *idx == ball_idx);
        self.mean_at(ball_idx)
            + Vector2::from(chances) * self.gust_sigma_m_s
            + strong.map_or(Vector2::zeros(), |(_, gust_m_s)| *gust_m_s)
    }
}

/// Any direction is as likely.
pub fn direction(rng: &mut impl Rng) -> Vector2<f64> {
    let (sin, cos) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
    Vector2::new(sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_step_stays_and_a_strong_gust_goes() {
        let mut breeze = Breeze::around(Vector2::new(1.0, -1.0));
        breeze.step = Some((5, Vector2::new(0.0, 3.0)));
        breeze.strong = vec![(2, Vector2::new(2.5, 0.0))];
        let at = |idx| breeze.of_ball(idx, [0.0, 0.0]);
        assert_eq!((at(1), at(2)), (Vector2::new(1.0, -1.0), Vector2::new(3.5, -1.0)));
        assert_eq!((at(3), at(4)), (at(1), at(1)));
        assert_eq!((at(5), at(9)), (Vector2::new(1.0, 2.0), Vector2::new(1.0, 2.0)));
        assert_eq!(breeze.mean_at(2), Vector2::new(1.0, -1.0));
    }

    #[test]
    fn strong_gusts_are_as_strong_as_was_said_and_last_for_one_ball_or_two() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let breeze = Breeze::around(Vector2::zeros()).with_strong(0.1, 1000, &mut rng);
        assert!((80..200).contains(&breeze.strong.len()), "{}", breeze.strong.len());
        for (_, gust_m_s) in &breeze.strong {
            assert!((2.0..3.0).contains(&gust_m_s.norm()));
        }
        let of_three = breeze.strong.windows(3).filter(|w| w[2].0 == w[0].0 + 2).count();
        assert_eq!(of_three, 0);
    }
}

//! A problem and a guess -> the most likely unknowns, with covariance.
//!
//! Levenberg-Marquardt (Marquardt 1963) on dense normal equations with exact derivatives, solved by
//! faer's Cholesky. Unknowns live where they like (a rotation is not a vector): a problem says how
//! its state is moved by a step. Residuals come in sigmas, one at a time, each with its derivative
//! by the few unknowns it depends on, so that a hundred boards of six unknowns cost what they are.

use crate::solved::{inverse, solved};
use nalgebra::DMatrix;

/// Damping to begin with, its factors after a good and a bad step, and where to give up.
const DAMPING: [f64; 4] = [1e-4, 0.2, 10.0, 1e8];

/// A problem to be solved.
pub trait Problem {
    /// What is unknown.
    type State: Clone;

    /// How many numbers a step has.
    fn n_unknowns(&self) -> usize;

    /// Cost, gradient and curvature; None where the state is impossible.
    fn system(&self, state: &Self::State) -> Option<Normal>;

    /// The state after a step.
    fn moved(&self, state: &Self::State, step: &[f64]) -> Self::State;
}

/// Cost ½ Σ r² of a state, its gradient, and the curvature Jᵀ J.
#[derive(Debug, Clone)]
pub struct Normal {
    /// Jᵀ J, of which only what is on and above the diagonal was added up until it is solved.
    pub curvature: DMatrix<f64>,
    /// Jᵀ r.
    pub gradient: Vec<f64>,
    /// ½ Σ r², or what a robust loss makes of it.
    pub cost: f64,
}

impl Normal {
    /// Of `n` unknowns and no residual.
    #[must_use]
    pub fn new(n: usize) -> Self {
        Self { curvature: DMatrix::zeros(n, n), gradient: vec![0.0; n], cost: 0.0 }
    }

    /// Adds a residual, in sigmas, with its derivatives by some unknowns, each named at most once.
    pub fn add(&mut self, residual: f64, slopes: &[(usize, f64)]) {
        self.add_weighted(residual, slopes, 1.0);
        self.cost += 0.5 * residual * residual;
    }

    /// Adds the residuals of one observation, in sigmas, under Huber's loss: beyond `at` sigmas
    /// they pull no harder.
    pub fn add_robust<const N: usize>(
        &mut self,
        residuals: [f64; N],
        slopes: [&[(usize, f64)]; N],
        at: f64,
    ) {
        let [cost, weight] = huber(residuals.iter().map(|r| r * r).sum(), at);
        for (residual, slopes) in residuals.into_iter().zip(slopes) {
            self.add_weighted(residual, slopes, weight);
        }
        self.cost += cost;
    }

    fn add_weighted(&mut self, residual: f64, slopes: &[(usize, f64)], weight: f64) {
        for &(i, slope) in slopes {
            let pull = slope * weight;
            self.gradient[i] += pull * residual;
            for &(j, other) in slopes {
                if i <= j {
                    self.curvature[(i, j)] += pull * other;
                }
            }
        }
    }

    fn filled(mut self) -> Self {
        self.curvature.fill_lower_triangle_with_upper_triangle();
        self
    }
}

/// Huber's cost and weight at a squared distance in sigmas.
#[must_use]
pub fn huber(square: f64, at: f64) -> [f64; 2] {
    let distance = square.sqrt();
    if distance <= at { [0.5 * square, 1.0] } else { [at * (distance - 0.5 * at), at / distance] }
}

/// The most likely state.
#[derive(Debug, Clone)]
pub struct Solution<S> {
    /// The unknowns.
    pub state: S,
    /// Covariance of a step from there, if the residuals' sigmas are right.
    pub covariance: DMatrix<f64>,
    /// ½ Σ r² there.
    pub cost: f64,
    /// Steps it took.
    pub n_steps: usize,
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub struct Patience {
    /// Most steps.
    pub n_steps_max: usize,
    /// A step this small, in sigmas of the answer, is the last.
    pub step_min: f64,
}

impl Default for Patience {
    fn default() -> Self {
        Self { n_steps_max: 100, step_min: 1e-3 }
    }
}

/// The most likely state from a guess; None if the guess is impossible or the residuals leave an
/// unknown open.
pub fn solution<P: Problem>(
    problem: &P,
    guess: P::State,
    patience: Patience,
) -> Option<Solution<P::State>> {
    let n = problem.n_unknowns();
    let [mut damping, better, worse, damping_max] = DAMPING;
    let mut state = guess;
    let mut system = problem.system(&state)?.filled();
    let mut n_steps = 0;
    while n_steps < patience.n_steps_max && damping < damping_max {
        n_steps += 1;
        let mut damped = system.curvature.clone();
        for i in 0..n {
            damped[(i, i)] *= 1.0 + damping;
        }
        let Some(step) = solved(&damped, &system.gradient) else {
            damping *= worse;
            continue;
        };
        let step: Vec<f64> = step.into_iter().map(|v| -v).collect();
        let next = problem.moved(&state, &step);
        match problem.system(&next).filter(|next| next.cost <= system.cost) {
            Some(next_system) => {
                let size = size_in_sigmas(&system.curvature, &step);
                (state, system) = (next, next_system.filled());
                damping *= better;
                if size < patience.step_min {
                    break;
                }
            }
            None => damping *= worse,
        }
    }
    let inverse = inverse(n, &system.curvature)?;
    let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)]);
    Some(Solution { state, covariance, cost: system.cost, n_steps })
}

/// √(sᵀ A s).
fn size_in_sigmas(curvature: &DMatrix<f64>, step: &[f64]) -> f64 {
    let step = nalgebra::DVectorView::from_slice(step, step.len());
    step.dot(&(curvature * step)).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = a e^(b t), at ten times.
    struct Growth {
        seen: Vec<(f64, f64)>,
        sigma: f64,
    }

    impl Problem for Growth {
        type State = [f64; 2];

        fn n_unknowns(&self) -> usize {
            2
        }

        fn system(&self, [a, b]: &[f64; 2]) -> Option<Normal> {
            let mut normal = Normal::new(2);
            for (t, y) in &self.seen {
                let grown = (b * t).exp();
                let slopes = [(0, grown / self.sigma), (1, a * t * grown / self.sigma)];
                normal.add_robust([(a * grown - y) / self.sigma], [&slopes], 3.0);
            }
            normal.cost.is_finite().then_some(normal)
        }

        fn moved(&self, state: &[f64; 2], step: &[f64]) -> [f64; 2] {
            [state[0] + step[0], state[1] + step[1]]
        }
    }

    fn seen(a: f64, b: f64) -> Vec<(f64, f64)> {
        (0..10).map(|i| f64::from(i) * 0.3).map(|t| (t, a * (b * t).exp())).collect()
    }

    #[test]
    fn a_law_is_found_from_a_poor_guess_and_one_wild_point_does_not_matter() {
        let mut growth = Growth { seen: seen(2.0, 0.7), sigma: 0.01 };
        growth.seen[4].1 += 50.0;
        let found = solution(&growth, [1.0, 0.0], Patience::default()).unwrap();
        // Huber's wild point pulls like 3 sigmas, 0.03.
        assert!((found.state[0] - 2.0).abs() < 0.02 && (found.state[1] - 0.7).abs() < 0.005);
    }

    #[test]
    fn the_covariance_is_the_inverse_of_what_the_points_tell() {
        let growth = Growth { seen: seen(2.0, 0.0), sigma: 0.1 };
        let found = solution(&growth, [2.0, 0.0], Patience::default()).unwrap();
        // y = a + 2 b t, ten times 0 to 2.7: ordinary regression.
        let (n, mean) = (10.0, 1.35);
        let spread: f64 = (0..10).map(|i| (f64::from(i) * 0.3 - mean).powi(2)).sum();
        let expected = 0.01 * (1.0 / n + mean * mean / spread);
        assert!((found.covariance[(0, 0)] / expected - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_nothing_tells_has_no_solution() {
        let growth = Growth { seen: vec![(0.0, 2.0)], sigma: 0.1 };
        assert!(solution(&growth, [1.0, 0.5], Patience::default()).is_none());
        let growth = Growth { seen: seen(f64::NAN, 0.0), sigma: 0.1 };
        assert!(solution(&growth, [1.0, 0.5], Patience::default()).is_none());
    }
}

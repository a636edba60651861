//! Residuals -> how hard each pulls, how large the noise is, and how far the answer scatters.
//!
//! Noise is Student's t with `FREEDOM` degrees of freedom: a ball half behind the net's tape is off
//! by ten times the noise, and must not matter. Under Gaussian noise that costs up to 9 % of sigma
//! (tests).
//!
//! **Noise**: a detector's own sigmas may be all too small or too large. Once fitted, each camera's
//! are scaled to its residuals (maximum likelihood), and the fit is repeated. The covariance is the
//! sandwich of M-estimation, `E ψ² / (E ψ′)²`, and is widened where residuals that follow each
//! other are alike, `(1 + ρ)/(1 − ρ)`: a bias that lasts for some frames is not so many
//! observations. So it means what it says whatever the pixels are worth.

use nalgebra::Vector2;
use shm_layout::Camera;

/// Axes of an image.
pub const AXES: f64 = 2.0;

/// Degrees of freedom of the noise; fewer trust far sightings less.
const FREEDOM: f64 = 3.0;

/// Fewest sightings that tell their own noise.
pub const N_NOISE_MIN: usize = 12;

/// How far the noise may be from what the detector says.
const NOISE_RANGE: [f64; 2] = [0.2, 10.0];

/// Rounds in which the noise is found.
const N_NOISE_ROUNDS: usize = 6;

/// Least curvature of the cost, of what the weights say.
const CURVATURE_MIN: f64 = 0.6;

/// Likeness of residuals that follow each other which is believed, in sigmas of what chance does.
const LIKENESS_SIGMAS: f64 = 2.5;
const LIKENESS_MAX: f64 = 0.9;

/// How hard a sighting pulls at this squared distance, of what it would under Gaussian noise.
#[must_use]
pub fn weight(square: f64) -> f64 {
    (FREEDOM + AXES) / (FREEDOM + square)
}

/// Minus the logarithm of how likely a sighting at this squared distance is.
#[must_use]
pub fn cost(square: f64) -> f64 {
    0.5 * (FREEDOM + AXES) * (square / FREEDOM).ln_1p()
}

/// A camera's noise, of which these squared distances were taken: the scale of Student's t under
/// which they are likeliest.
#[must_use]
pub fn scaled(noise: f64, squares: &[f64]) -> f64 {
    if squares.len() < N_NOISE_MIN / 2 {
        return noise;
    }
    let [smallest, largest] = NOISE_RANGE;
    let mut scale2 = 1.0;
    for _ in 0..N_NOISE_ROUNDS {
        let sum: f64 = squares.iter().map(|s| weight(s / scale2) * s).sum();
        scale2 = sum / (AXES * squares.len() as f64);
    }
    (noise * scale2.sqrt()).clamp(smallest, largest)
}

/// What residuals tell of how an estimate scatters.
#[derive(Default)]
pub struct Scatter {
    n: f64,
    psi2: f64,
    psi_slope: f64,
    weight: f64,
    last: [Option<Vector2<f64>>; 2],
    n_following: f64,
    product: f64,
    square: f64,
}

impl Scatter {
    /// Takes a residual in, in sigmas, with its weight.
    pub fn update(&mut self, camera: Camera, off: &Vector2<f64>, weight: f64) {
        let square = off.norm_squared();
        let pull = off * weight;
        self.n += 1.0;
        self.psi2 += pull.norm_squared() / AXES;
        // Mean of the derivative of the pull by both axes.
        self.psi_slope += weight - square * weight / (FREEDOM + square);
        self.weight += weight;
        self.square += pull.norm_squared();
        if let Some(last) = self.last[camera.idx()].replace(pull) {
            self.product += last.dot(&pull);
            self.n_following += AXES;
        }
    }

    /// Curvature of the cost as a part of what the weights alone say.
    #[must_use]
    pub fn curvature(&self) -> f64 {
        if self.n > 0.0 { (self.psi_slope / self.weight).clamp(CURVATURE_MIN, 1.0) } else { 1.0 }
    }

    /// Variance of an estimate whose pulls are in proportion, as a multiple of that of sigmas that
    /// are right.
    #[must_use]
    pub fn spread_of_pulls(&self) -> f64 {
        if self.n < N_NOISE_MIN as f64 {
            return 1.0;
        }
        self.psi2 / self.n * self.by_likeness()
    }

    /// Variance of the estimate as a multiple of that of equal trust.
    #[must_use]
    pub fn spread(&self) -> f64 {
        if self.n < N_NOISE_MIN as f64 {
            return 1.0;
        }
        let sandwich = (self.psi2 / self.n) / (self.psi_slope / self.n).powi(2);
        sandwich * self.by_likeness()
    }

    /// How many fewer residuals there are than it looks, by how alike those are that follow each
    /// other.
    fn by_likeness(&self) -> f64 {
        let likeness = self.product / self.square;
        let by_chance = LIKENESS_SIGMAS / self.n_following.sqrt();
        let rho = if likeness > by_chance { likeness.min(LIKENESS_MAX) } else { 0.0 };
        (1.0 + rho) / (1.0 - rho)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    /// Residuals of this sigma; those of the second half of each run of ten lean by `bias`.
    fn residuals(sigma: f64, bias: f64) -> Vec<Vector2<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let normal = Normal::new(0.0, sigma).unwrap();
        let lean = |i: usize| if i % 10 < 5 { -bias } else { bias };
        (0..2000)
            .map(|i| Vector2::new(normal.sample(&mut rng) + lean(i), normal.sample(&mut rng)))
            .collect()
    }

    /// Noise as found, and the spread of the answer in these units.
    fn spread_of(residuals: &[Vector2<f64>]) -> (f64, f64) {
        let squares: Vec<f64> = residuals.iter().map(Vector2::norm_squared).collect();
        let noise = scaled(1.0, &squares);
        let mut scatter = Scatter::default();
        for residual in residuals {
            let off = residual / noise;
            scatter.update(Camera::Left, &off, weight(off.norm_squared()));
        }
        (noise, scatter.spread() * noise * noise)
    }

    #[test]
    fn gaussian_noise_costs_less_than_ten_percent_of_sigma() {
        for sigma in [0.3, 1.0, 4.0] {
            let all = residuals(sigma, 0.0);
            let (_, variance) = spread_of(&all);
            let sum: f64 = all.iter().map(Vector2::norm_squared).sum();
            let ratio = variance / (sum / (AXES * all.len() as f64));
            println!("spread {ratio:.3} times that of the mean at {sigma}");
            assert!((1.0..1.22).contains(&ratio), "{ratio} at {sigma}");
        }
    }

    #[test]
    fn a_few_wild_residuals_hardly_matter() {
        let mut wild = residuals(1.0, 0.0);
        let (_, clean) = spread_of(&wild);
        wild.iter_mut().step_by(33).for_each(|r| *r = Vector2::new(30.0, -20.0));
        let (_, spoiled) = spread_of(&wild);
        assert!(spoiled / clean < 1.35, "{spoiled} of {clean}: 3 % at 36 sigma");
    }

    #[test]
    fn residuals_that_lean_together_are_fewer_than_they_look() {
        let (_, alone) = spread_of(&residuals(1.0, 0.0));
        let (_, together) = spread_of(&residuals(1.0, 1.0));
        assert!(together / alone > 2.0, "{together} of {alone}");
    }
}

//! Landings -> their mean and scatter, and how well both are known.
//!
//! Two dimensions, normal. Of n landings with sample covariance S, 95 % of balls fall within
//! `(x − x̄)ᵀ S⁻¹ (x − x̄) ≤ 2 (n+1)(n−1) / (n (n−2)) F`, and the true mean lies within
//! `2 (n−1) / (n (n−2)) F` of x̄ (Hotelling's T²; Johnson & Wichern, Applied Multivariate
//! Statistical Analysis, 5.4 and 5.5). `F` is the 95 % quantile of F(2, n−2), which for two degrees
//! of freedom is `(m/2) (0.05^(−2/m) − 1)` with m = n−2.

use nalgebra::{Matrix2, Vector2};

/// An ellipse around a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// Long and short half axis, m.
    pub half_axes_m: [f64; 2],
    /// Of the long one: from +x towards +y.
    pub angle_rad: f64,
}

impl Ellipse {
    /// The set `vᵀ matrix⁻¹ v ≤ level`.
    #[must_use]
    pub fn new(matrix_m2: &Matrix2<f64>, level: f64) -> Self {
        let eigen = matrix_m2.symmetric_eigen();
        let long = usize::from(eigen.eigenvalues[1] > eigen.eigenvalues[0]);
        let half = |i: usize| (eigen.eigenvalues[i].max(0.0) * level).sqrt();
        let axis = eigen.eigenvectors.column(long);
        Self { half_axes_m: [half(long), half(1 - long)], angle_rad: axis.y.atan2(axis.x) }
    }

    /// Points along it, to draw it around a place.
    #[must_use]
    pub fn outline_m(&self, centre_m: Vector2<f64>) -> Vec<[f64; 2]> {
        const N: usize = 48;
        let (sin, cos) = self.angle_rad.sin_cos();
        let [long, short] = self.half_axes_m;
        let point = |i: usize| {
            let (v, u) = (i as f64 * std::f64::consts::TAU / N as f64).sin_cos();
            let (u, v) = (u * long, v * short);
            [centre_m.x + u * cos - v * sin, centre_m.y + u * sin + v * cos]
        };
        (0..N).map(point).collect()
    }
}

/// Mean and scatter of some landings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landings {
    /// How many there are.
    pub n: usize,
    /// x and y.
    pub mean_m: Vector2<f64>,
    /// Of single balls, with n − 1; None of fewer than two.
    pub covariance_m2: Option<Matrix2<f64>>,
}

impl Landings {
    /// None of none.
    #[must_use]
    pub fn of(places_m: &[Vector2<f64>]) -> Option<Self> {
        let n = places_m.len();
        let mean_m = places_m.iter().sum::<Vector2<f64>>() / n as f64;
        let square = |place: &Vector2<f64>| (place - mean_m) * (place - mean_m).transpose();
        let covariance_m2 =
            (n > 1).then(|| places_m.iter().map(square).sum::<Matrix2<f64>>() / (n - 1) as f64);
        (n > 0).then_some(Self { n, mean_m, covariance_m2 })
    }

    /// 1 sigma of the mean, x and y.
    #[must_use]
    pub fn mean_sigma_m(&self) -> Option<Vector2<f64>> {
        Some(self.sigma_m()? / (self.n as f64).sqrt())
    }

    /// 1 sigma of single balls, x and y.
    #[must_use]
    pub fn sigma_m(&self) -> Option<Vector2<f64>> {
        self.covariance_m2.map(|covariance| covariance.diagonal().map(f64::sqrt))
    }

    /// By how much of itself that is uncertain, 1 sigma: `1/√(2 (n−1))`.
    #[must_use]
    pub fn sigma_uncertain_part(&self) -> Option<f64> {
        (self.n > 1).then(|| (2.0 * (self.n - 1) as f64).powf(-0.5))
    }

    /// Where 95 % of balls fall.
    #[must_use]
    pub fn balls_ellipse(&self) -> Option<Ellipse> {
        let n = self.n as f64;
        Some(Ellipse::new(&self.covariance_m2?, (n + 1.0) * self.hotelling()?))
    }

    /// Where the true mean lies, with 95 %.
    #[must_use]
    pub fn mean_ellipse(&self) -> Option<Ellipse> {
        Some(Ellipse::new(&self.covariance_m2?, self.hotelling()?))
    }

    /// `2 (n−1) / (n (n−2)) F`.
    fn hotelling(&self) -> Option<f64> {
        let free = self.n.checked_sub(2).filter(|free| *free > 0)? as f64;
        let f = 0.5 * free * (0.05_f64.powf(-2.0 / free) - 1.0);
        Some(2.0 * (free + 1.0) / ((free + 2.0) * free) * f)
    }
}

/// Part of `n` that is `n_in`, with its 95 % interval (Wilson 1927).
#[must_use]
pub fn part_of(n_in: usize, n: usize) -> Option<[f64; 3]> {
    const Z: f64 = 1.96;
    let (k, n) = (n_in as f64, n as f64);
    let part = k / n;
    let middle = (part + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
    let half = Z / (1.0 + Z * Z / n) * (part * (1.0 - part) / n + Z * Z / (4.0 * n * n)).sqrt();
    (n > 0.0).then(|| [part, (middle - half).max(0.0), (middle + half).min(1.0)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    #[test]
    fn ellipses_hold_what_they_say() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut normal = |sigma: f64| -> f64 {
            let unit: f64 = rng.sample(StandardNormal);
            unit * sigma
        };
        let holds = |ellipse: &Ellipse, off: Vector2<f64>| {
            let (sin, cos) = ellipse.angle_rad.sin_cos();
            let along = (off.x * cos + off.y * sin) / ellipse.half_axes_m[0];
            let across = (off.y * cos - off.x * sin) / ellipse.half_axes_m[1];
            along.hypot(across) <= 1.0
        };
        let (mut n_mean, mut n_ball, n_rounds) = (0, 0, 4000);
        for _ in 0..n_rounds {
            // Correlated: along is 0.52 m, across 0.26.
            let mut ball = || {
                let (a, b) = (normal(0.52), normal(0.26));
                Vector2::new(b + 0.3 * a, a)
            };
            let balls: Vec<Vector2<f64>> = (0..8).map(|_| ball()).collect();
            let next = ball();
            let landings = Landings::of(&balls).unwrap();
            n_mean += u32::from(holds(&landings.mean_ellipse().unwrap(), -landings.mean_m));
            n_ball += u32::from(holds(&landings.balls_ellipse().unwrap(), next - landings.mean_m));
        }
        // 95 % of 4000: one sigma is 0.34 %.
        for n in [n_mean, n_ball] {
            let part = f64::from(n) / f64::from(n_rounds);
            assert!((part - 0.95).abs() < 0.012, "{part}");
        }
    }

    #[test]
    fn few_balls_say_no_more_than_they_can() {
        assert!(Landings::of(&[]).is_none());
        let one = Landings::of(&[Vector2::new(1.0, 2.0)]).unwrap();
        assert_eq!((one.sigma_m(), one.balls_ellipse()), (None, None));
        let two = Landings::of(&[Vector2::new(0.0, 0.0), Vector2::new(2.0, 2.0)]).unwrap();
        assert!(two.sigma_m().is_some() && two.mean_ellipse().is_none());
        assert_eq!(part_of(0, 0), None);
        // Wilson's own: 0 of 10 is at most 28 %.
        let [part, low, high] = part_of(0, 10).unwrap();
        assert!(part == 0.0 && low < 1e-12 && (high - 0.278).abs() < 0.001, "{low} {high}");
    }
}

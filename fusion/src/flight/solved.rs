//! Normal equations -> solution and inverse, by faer's Cholesky.
//!
//! Scaled first so that the diagonal is one: metres, radians and seconds side by side lose digits.

use crate::flight::unknowns::{Column, Covariance, N};
use faer::linalg::solvers::{DenseSolveCore as _, Solve as _};

fn faer_from(matrix: &Covariance, scale: &Column) -> faer::Mat<f64> {
    faer::Mat::from_fn(N, N, |i, j| matrix[(i, j)] * scale[i] * scale[j])
}

fn scale_of(matrix: &Covariance) -> Option<Column> {
    let scale = Column::from_fn(|i, _| matrix[(i, i)].sqrt().recip());
    scale.iter().all(|s| s.is_finite()).then_some(scale)
}

/// The solution; None if the matrix is not positive definite.
#[must_use]
pub fn solved(matrix: &Covariance, right: &Column) -> Option<Column> {
    let scale = scale_of(matrix)?;
    let cholesky = faer_from(matrix, &scale).llt(faer::Side::Lower).ok()?;
    let column = faer::Mat::from_fn(N, 1, |i, _| right[i] * scale[i]);
    let solution = cholesky.solve(&column);
    Some(Column::from_fn(|i, _| solution[(i, 0)] * scale[i]))
}

/// The inverse; None if the matrix is not positive definite.
#[must_use]
pub fn inverse(matrix: &Covariance) -> Option<Covariance> {
    let scale = scale_of(matrix)?;
    let cholesky = faer_from(matrix, &scale).llt(faer::Side::Lower).ok()?;
    let inverse = cholesky.inverse();
    Some(Covariance::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Positive definite, with scales twelve orders of magnitude apart.
    fn matrix() -> Covariance {
        let root = Covariance::from_fn(|i, j| {
            let mixed = ((i * 7 + j * 3) % 11) as f64 / 11.0 + f64::from(u8::from(i == j)) * 3.0;
            mixed * 10_f64.powi(i as i32 % 7 - 3)
        });
        root * root.transpose()
    }

    #[test]
    fn the_solution_solves_and_the_inverse_inverts() {
        let truth = Column::from_fn(|i, _| 1.0 + i as f64);
        let found = solved(&matrix(), &(matrix() * truth)).unwrap();
        assert!((found - truth).amax() < 1e-6, "{found}");
        let one = inverse(&matrix()).unwrap() * matrix();
        assert!((one - Covariance::identity()).amax() < 1e-6);
    }

    #[test]
    fn what_has_no_inverse_has_none() {
        assert_eq!(solved(&Covariance::zeros(), &Column::zeros()), None);
        assert_eq!(inverse(&-matrix()), None);
        assert_eq!(inverse(&(matrix() * f64::NAN)), None);
    }
}

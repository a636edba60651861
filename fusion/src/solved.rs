//! Normal equations -> solution and inverse, by faer's Cholesky.
//!
//! Scaled first so that the diagonal is one: metres, radians and seconds side by side lose digits.
//! Matrices are symmetric and of any type that is indexed by (row, column).

use faer::Mat;
use faer::linalg::solvers::{DenseSolveCore as _, Solve as _};
use std::ops::Index;

/// A Cholesky factor of the scaled matrix.
struct Factor {
    scale: Vec<f64>,
    cholesky: faer::linalg::solvers::Llt<f64>,
}

impl Factor {
    fn of(n: usize, matrix: &impl Index<(usize, usize), Output = f64>) -> Option<Self> {
        let scale: Vec<f64> = (0..n).map(|i| matrix[(i, i)].sqrt().recip()).collect();
        if !scale.iter().all(|s| s.is_finite()) {
            return None;
        }
        let scaled = Mat::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
        let cholesky = scaled.llt(faer::Side::Lower).ok()?;
        Some(Self { scale, cholesky })
    }
}

/// The solution; None if the matrix is not positive definite.
#[must_use]
pub fn solved(
    matrix: &impl Index<(usize, usize), Output = f64>,
    right: &[f64],
) -> Option<Vec<f64>> {
    let Factor { scale, cholesky } = Factor::of(right.len(), matrix)?;
    let column = Mat::from_fn(right.len(), 1, |i, _| right[i] * scale[i]);
    let solution = cholesky.solve(&column);
    Some(scale.iter().enumerate().map(|(i, scale)| solution[(i, 0)] * scale).collect())
}

/// The inverse of the first `n` rows and columns; None if they are not positive definite.
#[must_use]
pub fn inverse(n: usize, matrix: &impl Index<(usize, usize), Output = f64>) -> Option<Mat<f64>> {
    let Factor { scale, cholesky } = Factor::of(n, matrix)?;
    let inverse = cholesky.inverse();
    Some(Mat::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};

    const N: usize = 17;

    type Square = SMatrix<f64, N, N>;

    /// Positive definite, with scales twelve orders of magnitude apart.
    fn matrix() -> Square {
        let root = Square::from_fn(|i, j| {
            let mixed = ((i * 7 + j * 3) % 11) as f64 / 11.0 + f64::from(u8::from(i == j)) * 3.0;
            mixed * 10_f64.powi(i as i32 % 7 - 3)
        });
        root * root.transpose()
    }

    #[test]
    fn the_solution_solves_and_the_inverse_inverts() {
        let truth = SVector::<f64, N>::from_fn(|i, _| 1.0 + i as f64);
        let found = solved(&matrix(), (matrix() * truth).as_slice()).unwrap();
        assert!((SVector::<f64, N>::from_vec(found) - truth).amax() < 1e-6);
        let inverse = inverse(N, &matrix()).unwrap();
        let one = Square::from_fn(|i, j| inverse[(i, j)]) * matrix();
        assert!((one - Square::identity()).amax() < 1e-6);
    }

    #[test]
    fn what_has_no_inverse_has_none() {
        assert_eq!(solved(&Square::zeros(), &[0.0; N]), None);
        assert!(inverse(N, &-matrix()).is_none());
        assert!(inverse(N, &(matrix() * f64::NAN)).is_none());
    }
}

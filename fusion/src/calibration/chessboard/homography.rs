//! Points of a plane and where they are seen -> the homography between them.
//!
//! Direct linear transform with both sets moved and scaled to the unit circle first (Hartley and
//! Zisserman 2004, alg. 4.2): the least eigenvector of the normal matrix.

use nalgebra::{Matrix3, Point2, SMatrix, SVector, Vector3};

/// `seen ~ H plane`, scaled to a bottom right 1; None for fewer than four points or for points on
/// a line.
#[must_use]
pub fn seen_from_plane(plane: &[Point2<f64>], seen: &[Point2<f64>]) -> Option<Matrix3<f64>> {
    if plane.len() < 4 || plane.len() != seen.len() {
        return None;
    }
    let (unit_from_plane, unit_from_seen) = (unit_from(plane)?, unit_from(seen)?);
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (from, to) in plane.iter().zip(seen) {
        let p = unit_from_plane * from.to_homogeneous();
        let q = unit_from_seen * to.to_homogeneous();
        for (own, other) in [(0, q.x), (1, q.y)] {
            let mut row = SVector::<f64, 9>::zeros();
            for k in 0..3 {
                row[3 * own + k] = p[k];
                row[6 + k] = -other * p[k];
            }
            normal += row * row.transpose();
        }
    }
    let eigen = normal.symmetric_eigen();
    // The solution is the one direction that nothing speaks against; with two there is none.
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    if eigen.eigenvalues[order[1]] < 1e-9 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let least = eigen.eigenvectors.column(order[0]);
    let in_units = Matrix3::from_fn(|row, column| least[3 * row + column]);
    let matrix = unit_from_seen.try_inverse()? * in_units * unit_from_plane;
    let last = matrix[(2, 2)];
    let is_finite = matrix.iter().all(|v| (v / last).is_finite());
    is_finite.then(|| matrix / last)
}

/// Moves the mean to the origin and the mean distance from it to √2.
fn unit_from(points: &[Point2<f64>]) -> Option<Matrix3<f64>> {
    let n = points.len() as f64;
    let mean = points.iter().fold(Vector3::zeros(), |sum, p| sum + p.to_homogeneous()) / n;
    let distance = points.iter().map(|p| (p.x - mean.x).hypot(p.y - mean.y)).sum::<f64>() / n;
    let scale = 2_f64.sqrt() / distance;
    let matrix =
        Matrix3::new(scale, 0.0, -scale * mean.x, 0.0, scale, -scale * mean.y, 0.0, 0.0, 1.0);
    matrix.iter().all(|v| v.is_finite()).then_some(matrix)
}

/// Where a homography puts a point; None at infinity.
#[must_use]
pub fn applied(homography: &Matrix3<f64>, point: &Point2<f64>) -> Option<Point2<f64>> {
    Point2::from_homogeneous(homography * point.to_homogeneous())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_homography_is_found_again() {
        let truth = Matrix3::new(46.0, 6.0, 80.0, -5.0, 44.0, 110.0, 0.004, 0.006, 1.0);
        let plane: Vec<_> =
            (0..12).map(|i| Point2::new(f64::from(i % 4), f64::from(i / 4))).collect();
        let seen: Vec<_> = plane.iter().map(|p| applied(&truth, p).unwrap()).collect();
        let found = seen_from_plane(&plane, &seen).unwrap();
        assert!((found - truth).amax() < 1e-6, "{found}");
    }

    #[test]
    fn points_on_a_line_have_none() {
        let plane: Vec<_> = (0..12).map(|i| Point2::new(f64::from(i), 0.0)).collect();
        assert_eq!(seen_from_plane(&plane, &plane), None);
        assert_eq!(seen_from_plane(&plane[..3], &plane[..3]), None);
    }
}

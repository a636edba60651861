//! Rays of the same points in both cameras -> the essential matrix, and the poses it stands for.
//!
//! `x_rᵀ E x_l = 0` with `E = [T]× R` for `x_right = R x_left + T` (the thesis' Eq 14 with the
//! lenses taken off both sides). Eight points, each set moved and scaled first (Hartley 1997, "In
//! defense of the eight-point algorithm"); the least eigenvector of the normal matrix; two equal
//! singular values and a zero one enforced; four poses (Hartley and Zisserman 2004, result 9.19),
//! of which one has the points in front of both cameras. `T` has length 1: pictures tell no scale.

use nalgebra::{
    IsometryMatrix3, Matrix3, Rotation3, SMatrix, SVector, Translation3, Vector2, Vector3,
};

/// Rays to one point, each in its camera's frame with z = 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rays {
    /// In the left camera's frame.
    pub left: Vector3<f64>,
    /// In the right camera's frame.
    pub right: Vector3<f64>,
}

/// Fewest points that tell the nine numbers of E up to scale.
pub const POINTS_MIN: usize = 8;

/// The essential matrix that eight or more points agree to best; None for fewer, or where they
/// leave more than one matrix open (all on one plane, all on a line).
#[must_use]
pub fn from_rays(rays: &[Rays]) -> Option<Matrix3<f64>> {
    if rays.len() < POINTS_MIN {
        return None;
    }
    let unit_from_left = unit_from(rays.iter().map(|rays| rays.left.xy()))?;
    let unit_from_right = unit_from(rays.iter().map(|rays| rays.right.xy()))?;
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for Rays { left, right } in rays {
        let (l, r) = (unit_from_left * left, unit_from_right * right);
        let row = SVector::<f64, 9>::from_fn(|i, _| r[i / 3] * l[i % 3]);
        normal += row * row.transpose();
    }
    let eigen = normal.symmetric_eigen();
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    if eigen.eigenvalues[order[1]] < 1e-12 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let least = eigen.eigenvectors.column(order[0]);
    let in_units = Matrix3::from_fn(|row, column| least[3 * row + column]);
    let matrix = unit_from_right.transpose() * in_units * unit_from_left;
    if !matrix.iter().all(|v| v.is_finite()) {
        return None;
    }
    let svd = matrix.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    Some(u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)) * v_t)
}

/// The essential matrix of a pose.
#[must_use]
pub fn from_pose(right_from_left: &IsometryMatrix3<f64>) -> Matrix3<f64> {
    right_from_left.translation.vector.cross_matrix() * right_from_left.rotation.matrix()
}

/// The pose with `T` of length 1 that has most of the points in front of both cameras, and how
/// many those are.
#[must_use]
pub fn pose_of(essential: &Matrix3<f64>, rays: &[Rays]) -> Option<(IsometryMatrix3<f64>, usize)> {
    let svd = essential.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let along: Vector3<f64> = u.column(2).into_owned();
    let mut best: Option<(IsometryMatrix3<f64>, usize)> = None;
    for turn in [quarter, quarter.transpose()] {
        let matrix = u * turn * v_t;
        let matrix = matrix * matrix.determinant().signum();
        let mut rotation = Rotation3::from_matrix_unchecked(matrix);
        rotation.renormalize();
        for along in [along, -along] {
            let pose = IsometryMatrix3::from_parts(Translation3::from(along), rotation);
            let is_ahead = |rays: &&Rays| {
                depths(&pose, rays).is_some_and(|[left, right]| left > 0.0 && right > 0.0)
            };
            let n_ahead = rays.iter().filter(is_ahead).count();
            if best.is_none_or(|(_, n)| n_ahead > n) {
                best = Some((pose, n_ahead));
            }
        }
    }
    best
}

/// How far along each ray the two come nearest to each other, in units of `T`; None for parallel
/// rays.
#[must_use]
pub fn depths(right_from_left: &IsometryMatrix3<f64>, rays: &Rays) -> Option<[f64; 2]> {
    // b r − a R l = T, by least squares.
    let l = right_from_left.rotation * rays.left;
    let r = rays.right;
    let t = right_from_left.translation.vector;
    let (ll, lr, rr) = (l.dot(&l), l.dot(&r), r.dot(&r));
    let determinant = ll * rr - lr * lr;
    if determinant <= 1e-14 * ll * rr {
        return None;
    }
    let (lt, rt) = (l.dot(&t), r.dot(&t));
    Some([(lr * rt - rr * lt) / determinant, (ll * rt - lr * lt) / determinant])
}

/// Moves the mean to the origin and the mean distance from it to √2.
fn unit_from(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let n = points.clone().count() as f64;
    let mean = points.clone().sum::<Vector2<f64>>() / n;
    let distance = points.map(|point| (point - mean).norm()).sum::<f64>() / n;
    let scale = 2_f64.sqrt() / distance;
    let matrix =
        Matrix3::new(scale, 0.0, -scale * mean.x, 0.0, scale, -scale * mean.y, 0.0, 0.0, 1.0);
    matrix.iter().all(|v| v.is_finite()).then_some(matrix)
}

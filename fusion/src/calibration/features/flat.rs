//! Matches that a pose explains -> whether less would explain them as well.
//!
//! Where all points lie on one plane, or all are far away, the pictures are one homography apart,
//! eight points leave the essential matrix open, and what the fit then finds is noise. Which of the
//! two holds is decided by Torr's criterion (GRIC; Torr, IJCV 2002): squares of the residuals, cut
//! off, with a price for every dimension and every number of the model.

use crate::calibration::chessboard::homography;
use crate::calibration::features::essential::Rays;
use crate::calibration::features::five::{Five, Matched};
use nalgebra::{Matrix3, Point2, Rotation3, Vector3};

/// What explains the matches as well as a pose does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flat {
    /// They are one turn apart: nothing is near.
    Far,
    /// They are one homography apart.
    Plane,
}

/// Dimensions of what a match may still be, and numbers of the model.
struct Size {
    dimensions: f64,
    numbers: f64,
}

const POSE: Size = Size { dimensions: 3.0, numbers: 5.0 };
const PLANE: Size = Size { dimensions: 2.0, numbers: 8.0 };
const TURN: Size = Size { dimensions: 2.0, numbers: 3.0 };

/// Rounds in which what fits worst is left out.
const ROUNDS: usize = 8;

/// Beyond this many sigmas a match is not of the plane.
const SIGMAS: f64 = 3.0;

/// Farther than this from the plane a match is beside it, whatever its sigma: leaves are deep.
const BESIDE_PX: f64 = 2.0;

/// Fewest matches beside the plane that hold a pose: three more than open numbers.
const BESIDE_MIN: usize = 8;

/// The simplest that explains the matches as well as the pose does; None if nothing does.
///
/// Torr's criterion takes few matches beside a plane for wrong ones. They are not if the pose
/// explains them and leaves fewer over: `n_unexplained` are the matches it does not explain.
#[must_use]
pub fn instead_of(five: &Five, matched: &Matched<'_>, n_unexplained: usize) -> Option<Flat> {
    let squares = |distances: &[f64]| -> Vec<f64> {
        distances.iter().map(|d| (d / five.sigma_px).powi(2)).collect()
    };
    let pose = price(&squares(&matched.distances_px(&five.left_from_right)), &POSE);
    let is_enough = |map: Option<Matrix3<f64>>, size: &Size| {
        let Some(map) = map else { return false };
        let distances = distances_px(matched, &map);
        let beside_px = BESIDE_PX.max(2.0 * SIGMAS * five.sigma_px);
        let n_beside = distances.iter().filter(|distance| **distance > beside_px).count();
        let is_held = n_beside >= BESIDE_MIN && n_beside > n_unexplained;
        !is_held && price(&squares(&distances), size) < pose
    };
    if is_enough(by_rounds(matched, five.sigma_px, turn_of), &TURN) {
        return Some(Flat::Far);
    }
    is_enough(by_rounds(matched, five.sigma_px, plane_of), &PLANE).then_some(Flat::Plane)
}

fn price(squares: &[f64], size: &Size) -> f64 {
    let n = squares.len() as f64;
    let cut = 2.0 * (4.0 - size.dimensions);
    let misfit: f64 = squares.iter().map(|square| square.min(cut)).sum();
    misfit + 4_f64.ln() * size.dimensions * n + (4.0 * n).ln() * size.numbers
}

/// A map of left rays to right ones on all matches, then on those it explains.
fn by_rounds(
    matched: &Matched<'_>,
    sigma_px: f64,
    map_of: impl Fn(&[Rays]) -> Option<Matrix3<f64>>,
) -> Option<Matrix3<f64>> {
    let mut map = map_of(matched.rays)?;
    for _ in 0..ROUNDS {
        let distances = distances_px(matched, &map);
        let mut sizes = distances.clone();
        sizes.sort_by(f64::total_cmp);
        // The better half at least: the first fit is drawn off by what is not of the plane.
        let within_px = (SIGMAS * sigma_px).max(sizes[sizes.len() / 2]);
        let kept = matched.rays.iter().zip(&distances).filter(|(_, d)| **d <= within_px);
        let kept: Vec<Rays> = kept.map(|(rays, _)| *rays).collect();
        map = map_of(&kept)?;
    }
    Some(map)
}

/// How far matches are from what a map says, by its share of both pictures' errors.
fn distances_px(matched: &Matched<'_>, map: &Matrix3<f64>) -> Vec<f64> {
    let distance = |Rays { left, right }: &Rays| {
        let mapped = map * left;
        let off = mapped.xy() / mapped.z - right.xy();
        matched.focal_px[1] * off.norm() / 2_f64.sqrt()
    };
    matched.rays.iter().map(distance).collect()
}

fn plane_of(rays: &[Rays]) -> Option<Matrix3<f64>> {
    let lefts: Vec<Point2<f64>> = rays.iter().map(|rays| rays.left.xy().into()).collect();
    let rights: Vec<Point2<f64>> = rays.iter().map(|rays| rays.right.xy().into()).collect();
    homography::seen_from_plane(&lefts, &rights)
}

/// The rotation that turns the left rays into the right ones best (Kabsch 1976).
fn turn_of(rays: &[Rays]) -> Option<Matrix3<f64>> {
    let sum: Matrix3<f64> = rays
        .iter()
        .map(|Rays { left, right }| right.normalize() * left.normalize().transpose())
        .sum();
    let svd = sum.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let sign = (u * v_t).determinant().signum();
    let matrix = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    Some(Rotation3::from_matrix_unchecked(matrix).into_inner())
}

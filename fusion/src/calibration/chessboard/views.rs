//! Boards as each camera sees them -> how the cameras stand to each other, and which half turn.
//!
//! A board that looks the same after half a turn may be counted from either end. Counted from
//! opposite ends by the two cameras it would put the right camera somewhere else in every view.
//! Each view, counted either way, tells one relation of the cameras; the relation that best tells
//! where the right camera sees the other views' boards is taken (the median view decides, so nearly
//! half may be wrong), and each view is counted as it then must be.

use super::Board;
use crate::world::camera::{Lens, RawPixel};
use nalgebra::{IsometryMatrix3, Point3, Rotation3, Translation3, Vector3};

/// A view of both cameras.
#[derive(Debug, Clone, Copy)]
pub struct PairView<'a> {
    /// The board's pose by the left camera alone.
    pub left_from_board: IsometryMatrix3<f64>,
    /// The same by the right camera, as it was counted.
    pub right_from_board: IsometryMatrix3<f64>,
    /// What the right camera saw.
    pub seen_by_right: &'a [RawPixel],
}

/// How the cameras stand.
#[derive(Debug, Clone, PartialEq)]
pub struct Relation {
    /// The right camera's pose in the left frame, as one view tells it.
    pub left_from_right: IsometryMatrix3<f64>,
    /// Which views the right camera must count from the other end.
    pub is_turned: Vec<bool>,
}

/// The relation most views agree on; None without views.
#[must_use]
pub fn relation(board: &Board, right: &Lens, views: &[PairView<'_>]) -> Option<Relation> {
    let points_m = board.points_m();
    let n_ways = if board.looks_the_same_turned() { 2 } else { 1 };
    let half_turn = half_turn(&points_m);
    let told = views.iter().flat_map(|view| {
        let counted = view.left_from_board * view.right_from_board.inverse();
        let turned = view.left_from_board * (view.right_from_board * half_turn).inverse();
        [counted, turned].into_iter().take(n_ways)
    });
    let off = |left_from_right: &IsometryMatrix3<f64>| {
        let mut all: Vec<f64> = views
            .iter()
            .map(|view| {
                let [counted, turned] = off_px(&points_m, right, left_from_right, view);
                let both = [counted.all_px, turned.all_px];
                both.into_iter().take(n_ways).fold(f64::INFINITY, f64::min)
            })
            .collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let best = told.map(|relation| (off(&relation), relation)).min_by(|a, b| a.0.total_cmp(&b.0));
    let (_, left_from_right) = best?;
    let is_turned = views.iter().map(|view| {
        let [counted, turned] = off_px(&points_m, right, &left_from_right, view);
        n_ways == 2 && turned.shape_px < counted.shape_px
    });
    Some(Relation { left_from_right, is_turned: is_turned.collect() })
}

/// Brings the board onto itself, last corner first.
fn half_turn(points_m: &[Point3<f64>]) -> IsometryMatrix3<f64> {
    let last = points_m.last().copied().unwrap_or_default();
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    IsometryMatrix3::from_parts(Translation3::from(last.coords), turn)
}

/// How far the right camera sees corners from where they should be, RMS.
struct Off {
    all_px: f64,
    /// The same with the mean shift taken away: a relation told by one far board is a bit off, and
    /// that shifts a board more than it turns it.
    shape_px: f64,
}

/// Counted as it was, and from the other end.
fn off_px(
    points_m: &[Point3<f64>],
    right: &Lens,
    left_from_right: &IsometryMatrix3<f64>,
    view: &PairView<'_>,
) -> [Off; 2] {
    let right_from_board = left_from_right.inverse() * view.left_from_board;
    let told: Option<Vec<RawPixel>> =
        points_m.iter().map(|point| right.raw_from_point(&(right_from_board * point))).collect();
    let Some(told) = told else {
        return [0, 1].map(|_| Off { all_px: f64::INFINITY, shape_px: f64::INFINITY });
    };
    let off = |seen: &mut dyn Iterator<Item = &RawPixel>| {
        let pairs = told.iter().zip(seen);
        let off: Vec<[f64; 2]> =
            pairs.map(|(told, seen)| [told.x_px - seen.x_px, told.y_px - seen.y_px]).collect();
        let n = off.len() as f64;
        let [mx, my] = [0, 1].map(|axis| off.iter().map(|off| off[axis]).sum::<f64>() / n);
        let square = off.iter().map(|[x, y]| x * x + y * y).sum::<f64>() / n;
        Off { all_px: square.sqrt(), shape_px: (square - mx * mx - my * my).max(0.0).sqrt() }
    };
    let seen = view.seen_by_right;
    [off(&mut seen.iter()), off(&mut seen.iter().rev())]
}

//! Homographies of a board -> a lens to begin with, and the board's poses.
//!
//! Zhang 2000: the two columns of a rotation are orthogonal and equally long, so each view gives
//! two equations `h₁ᵀ ω h₂ = 0` and `h₁ᵀ ω h₁ = h₂ᵀ ω h₂`. With the principal point in the middle
//! of the image and no skew, ω = diag(1/fx², 1/fy², 1) and they are linear in two unknowns. Where
//! the views do not tell (all boards face the camera) there is none, and the caller guesses.

use super::homography::seen_from_plane;
use crate::world::camera::{Lens, RawPixel};
use nalgebra::{
    IsometryMatrix3, Matrix2, Matrix3, Point2, Point3, Rotation3, Translation3, Vector2, Vector3,
};

/// Focal lengths a lens may have, in image widths.
const FOCAL_MIN: f64 = 0.2;
const FOCAL_MAX: f64 = 20.0;

/// fx and fy; None if the views do not tell.
#[must_use]
pub fn focal_px(image_px: [u32; 2], homographies: &[Matrix3<f64>]) -> Option<[f64; 2]> {
    let [cx, cy] = center_px(image_px);
    let scale = f64::from(image_px[0]);
    let shift =
        Matrix3::new(1.0 / scale, 0.0, -cx / scale, 0.0, 1.0 / scale, -cy / scale, 0.0, 0.0, 1.0);
    let (mut normal, mut right) = (Matrix2::<f64>::zeros(), Vector2::<f64>::zeros());
    for homography in homographies {
        let h = shift * homography;
        let (a, b) = (h.column(0), h.column(1));
        let length = a.norm() * b.norm();
        let cross = Vector2::new(a.x * b.x, a.y * b.y);
        let equal = Vector2::new(a.x * a.x - b.x * b.x, a.y * a.y - b.y * b.y);
        for (row, value) in [(cross, -a.z * b.z), (equal, b.z * b.z - a.z * a.z)] {
            let (row, value) = (row / length, value / length);
            normal += row * row.transpose();
            right += row * value;
        }
    }
    let squares = normal.try_inverse()? * right;
    let focal = [squares.x, squares.y].map(|v| 1.0 / v.sqrt());
    let is_lens = focal.iter().all(|f| (FOCAL_MIN..FOCAL_MAX).contains(f));
    is_lens.then(|| focal.map(|f| f * scale))
}

/// The middle of the image.
#[must_use]
pub fn center_px(image_px: [u32; 2]) -> [f64; 2] {
    image_px.map(|side| 0.5 * (f64::from(side) - 1.0))
}

/// The board's pose by the homography of what the lens sees undistorted; None if it is none.
#[must_use]
pub fn camera_from_board(
    lens: &Lens,
    points_m: &[Point3<f64>],
    seen: &[RawPixel],
) -> Option<IsometryMatrix3<f64>> {
    let (mut plane, mut ideal) = (Vec::new(), Vec::new());
    for (point, seen) in points_m.iter().zip(seen) {
        // A lens that is not yet known may have no ray for a corner.
        if let Some(ray) = lens.ray_from_raw(*seen) {
            plane.push(point.xy());
            ideal.push(Point2::new(ray.x, ray.y));
        }
    }
    let h = seen_from_plane(&plane, &ideal)?;
    let scale = 2.0 / (h.column(0).norm() + h.column(1).norm());
    let scale = if h[(2, 2)] < 0.0 { -scale } else { scale };
    let [a, b, translation]: [Vector3<f64>; 3] = [0, 1, 2].map(|i| h.column(i) * scale);
    let rotation = Rotation3::from_matrix(&Matrix3::from_columns(&[a, b, a.cross(&b)]));
    let pose = IsometryMatrix3::from_parts(Translation3::from(translation), rotation);
    let is_ahead = points_m.iter().all(|point| (pose * point).z > 0.0);
    is_ahead.then_some(pose)
}

//! A rectangle of the ground as a camera sees it -> the camera's pose.

use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, Translation3, Vector3};

/// A rectangle seen in perspective has axes of the same length at right angles, up to the
/// errors of four lines and a focal length that is known to some percent.
const STRETCH_MAX: f64 = 1.35;
const SKEW_MAX: f64 = 0.25;

/// The homography of the unit square's corners (0,0), (1,0), (1,1), (0,1) (Heckbert 1989).
#[must_use]
pub fn ideal_from_unit_square(corners: [[f64; 2]; 4]) -> Option<Matrix3<f64>> {
    let [[x0, y0], [x1, y1], [x2, y2], [x3, y3]] = corners;
    let (dx1, dx2, sx) = (x1 - x2, x3 - x2, x0 - x1 + x2 - x3);
    let (dy1, dy2, sy) = (y1 - y2, y3 - y2, y0 - y1 + y2 - y3);
    let determinant = dx1 * dy2 - dx2 * dy1;
    if determinant.abs() < 1e-12 {
        return None;
    }
    let g = (sx * dy2 - dx2 * sy) / determinant;
    let h = (dx1 * sy - sx * dy1) / determinant;
    Some(Matrix3::new(
        x1 - x0 + g * x1,
        x3 - x0 + h * x3,
        x0,
        y1 - y0 + g * y1,
        y3 - y0 + h * y3,
        y0,
        g,
        h,
        1.0,
    ))
}

/// The pose of which the ground's homography is `λ [r1 r2 t]`; None if its axes are too unlike.
#[must_use]
pub fn pose_from_homography(ideal_from_court: &Matrix3<f64>) -> Option<IsometryMatrix3<f64>> {
    let (h1, h2) = (ideal_from_court.column(0), ideal_from_court.column(1));
    let (n1, n2) = (h1.norm(), h2.norm());
    let stretch = n1 / n2;
    let skew = h1.dot(&h2) / (n1 * n2);
    let is_rigid = (1.0 / STRETCH_MAX..STRETCH_MAX).contains(&stretch) && skew.abs() < SKEW_MAX;
    if !is_rigid {
        return None;
    }
    // The court is in front of the camera: the sign that puts it there.
    let centre_depth = (ideal_from_court * Vector3::new(0.0, 12.0, 1.0)).z;
    let scale = centre_depth.signum() / (n1 * n2).sqrt();
    let (a, b) = (h1 * (scale / (scale.abs() * n1)), h2 * (scale / (scale.abs() * n2)));
    // Half of the skew to either axis.
    let (sum, difference) = ((a + b).normalize(), (a - b).normalize());
    let (r1, r2) = ((sum + difference).normalize(), (sum - difference).normalize());
    let rotation = Matrix3::from_columns(&[r1, r2, r1.cross(&r2)]);
    let centre_in_court = -(rotation.transpose() * (ideal_from_court.column(2) * scale));
    if !centre_in_court.iter().all(|v| v.is_finite()) || centre_in_court.z <= 0.0 {
        return None;
    }
    let court_from_camera = Rotation3::from_matrix_unchecked(rotation.transpose());
    Some(IsometryMatrix3::from_parts(Translation3::from(centre_in_court), court_from_camera))
}

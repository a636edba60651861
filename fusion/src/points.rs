//! Matched pairs -> points in the tracking frame (court, or left without one), with covariance.
//!
//! Linear triangulation. For a rectified pair the four equations of the DLT (thesis 7.3) decouple:
//! the columns give `Z = f B / d` and `X = B (x_l − c_x) / d`, the rows both give Y, and their mean
//! is the best. That closed form is also the maximum-likelihood point for equal pixel noise, which
//! the algebraic least squares of the DLT is only when the rows agree. The Jacobian by the measured
//! `(x_l, x_r, y_l, y_r)` is written out and carries the pixel sigma to the covariance.
//!
//! Then `X_court = Rᵀ x_cam + C`. (The thesis computed `R (p + T)`: 0.608 m and −0.053 m off.)
//!
//! The two sightings may be up to half a frame apart; the point's time is their mean. For cameras
//! on either side of the flight, the columns' errors then cancel in the disparity.

use crate::Dropped;
use crate::history::SpotId;
use crate::matched::Matched;
use crate::motion::World;
use crate::rectified::Sighting;
use crate::world::court;
use crate::world::rectification::Rectification;
use nalgebra::{Matrix3, Matrix3x4, Matrix4, Point3, Vector4};
use shm_layout::{Camera, StampNs};

/// A place a ball may have been at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Mean of the two sightings' times, on the left clock as far as the clocks are known.
    pub t_ns: StampNs,
    /// In the tracking frame.
    pub position_m: Point3<f64>,
    /// Of the position, from the pixels' sigma.
    pub covariance_m2: Matrix3<f64>,
    /// Inverse of the covariance.
    pub information_per_m2: Matrix3<f64>,
    /// In the left camera.
    pub left: Sighting,
    /// In the right camera.
    pub right: Sighting,
    /// Which spots of which frames.
    pub ids: [SpotId; 2],
    /// Rectified row in the right camera less that in the left.
    pub row_mismatch_px: f64,
}

/// All points of one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct PointFrame {
    /// Stamp of the later frame.
    pub t_ns: StampNs,
    /// The points, best pair first.
    pub points: Vec<Point>,
}

/// Triangulates all pairs; with a court, those that cannot be in its volume are left out.
pub fn from_matched(
    pairs: &[Matched],
    t_ns: StampNs,
    rectification: &Rectification,
    world: &World,
    dropped: &mut Dropped,
) -> PointFrame {
    let is_court_known = world.rig.court_from_left().is_some();
    let mut points = Vec::with_capacity(pairs.len());
    for pair in pairs {
        let Some(point) = from_pair(pair, rectification, world) else { continue };
        let position_m = point.position_m;
        if is_court_known && !court::is_sane(position_m.x, position_m.y, position_m.z) {
            dropped.n_points_outside_court += 1;
            continue;
        }
        points.push(point);
    }
    PointFrame { t_ns, points }
}

/// Triangulates a pair; None if its pixels tell nothing.
#[must_use]
pub fn from_pair(pair: &Matched, rectification: &Rectification, world: &World) -> Option<Point> {
    let (left, right) = (pair.left, pair.right);
    let pixels = Vector4::new(left.pixel.x_px, right.pixel.x_px, left.pixel.y_px, right.pixel.y_px);
    let (in_rectified, jacobian) = triangulated(pixels, rectification);
    let [left_px2, right_px2] = [left, right].map(|spot| spot.sighting.sigma_px().powi(2));
    let noise = Vector4::new(left_px2, right_px2, left_px2, right_px2);
    let rotation = rectification.tracking_from_rectified.rotation.matrix();
    let jacobian = rotation * jacobian;
    let covariance_m2 = jacobian * Matrix4::from_diagonal(&noise) * jacobian.transpose();
    let right_ns = world.left_ns(Camera::Right, right.sighting.t_ns);
    Some(Point {
        t_ns: left.sighting.t_ns.midpoint(right_ns),
        position_m: rectification.point_in_tracking(&in_rectified),
        covariance_m2,
        information_per_m2: covariance_m2.try_inverse()?,
        left: left.sighting,
        right: right.sighting,
        ids: pair.ids,
        row_mismatch_px: right.pixel.y_px - left.pixel.y_px,
    })
}

/// The point in the rectified left camera's frame, and its Jacobian by `(x_l, x_r, y_l, y_r)`.
fn triangulated(
    pixels: Vector4<f64>,
    rectification: &Rectification,
) -> (Point3<f64>, Matrix3x4<f64>) {
    let [x_l, x_r, y_l, y_r]: [f64; 4] = pixels.into();
    let [c_x, c_y] = rectification.center_px;
    let b = rectification.baseline_m;
    let d = x_l - x_r;
    let [x, y, z] =
        [x_l - c_x, f64::midpoint(y_l, y_r) - c_y, rectification.focal_px].map(|v| b * v / d);
    // Everything is proportional to 1/d, and d grows with x_l and shrinks with x_r.
    let jacobian = Matrix3x4::new(
        (b - x) / d,
        x / d,
        0.0,
        0.0, //
        -y / d,
        y / d,
        b / (2.0 * d),
        b / (2.0 * d), //
        -z / d,
        z / d,
        0.0,
        0.0,
    );
    (Point3::new(x, y, z), jacobian)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;
    use nalgebra::RowVector4;

    fn pixels_of(point: &Point3<f64>, rectification: &Rectification) -> Vector4<f64> {
        let rig = pretend::reference_rig();
        let [left, right] = Camera::BOTH.map(|camera| {
            let raw = rig.raw_from_tracking(camera, point).unwrap();
            rectification.rectified_from_raw(camera, raw).unwrap()
        });
        Vector4::new(left.x_px, right.x_px, left.y_px, right.y_px)
    }

    #[test]
    fn triangulation_inverts_projection() {
        let rectification = Rectification::from_rig(&pretend::reference_rig());
        for point in [[0.0, 21.6, 0.033], [-3.0, 9.0, 2.0], [4.0, 30.0, 0.5]].map(Point3::from) {
            let (in_rectified, _) = triangulated(pixels_of(&point, &rectification), &rectification);
            let error_m = (rectification.point_in_tracking(&in_rectified) - point).norm();
            assert!(error_m < 1e-6, "{error_m} m");
        }
    }

    #[test]
    fn the_closed_form_is_the_dlt_where_rows_agree() {
        let rectification = Rectification::from_rig(&pretend::reference_rig());
        let [x_l, x_r, y] = [412.3, 198.1, 255.5];
        let (closed, _) = triangulated(Vector4::new(x_l, x_r, y, y), &rectification);
        // Rows of the DLT: x p3 - p1 and y p3 - p2 of P = K [I | -C], twice.
        let (f, [c_x, c_y]) = (rectification.focal_px, rectification.center_px);
        let rows = |x: f64, y: f64, shift_m: f64| {
            [RowVector4::new(-f, 0.0, x - c_x, f * shift_m), RowVector4::new(0.0, -f, y - c_y, 0.0)]
        };
        let [a, b] = rows(x_l, y, 0.0);
        let [c, d] = rows(x_r, y, rectification.baseline_m);
        let svd = Matrix4::from_rows(&[a, b, c, d]).svd(false, true);
        let h = svd.v_t.unwrap().row(3).transpose();
        let dlt = Point3::new(h.x / h.w, h.y / h.w, h.z / h.w);
        assert!((dlt - closed).norm() < 1e-9, "{dlt} {closed}");
    }

    #[test]
    fn the_jacobian_is_that_of_finite_differences() {
        let rectification = Rectification::from_rig(&pretend::reference_rig());
        let pixels = Vector4::new(412.3, 198.1, 255.5, 254.9);
        let (_, jacobian) = triangulated(pixels, &rectification);
        for column in 0..4 {
            let mut step = Vector4::zeros();
            step[column] = 1e-4;
            let (plus, _) = triangulated(pixels + step, &rectification);
            let (minus, _) = triangulated(pixels - step, &rectification);
            let difference = (plus - minus) / 2e-4;
            assert!((difference - jacobian.column(column)).norm() < 1e-6);
        }
    }

    #[test]
    fn depth_noise_at_the_far_baseline_is_four_centimetres() {
        // Z² / (f B) · √2 · 0.3 px at Z = 22 m is 4.1 cm: what section 10 of the notes expects.
        let rectification = Rectification::from_rig(&pretend::reference_rig());
        let point = Point3::new(0.0, 21.6, 0.033);
        let (_, jacobian) = triangulated(pixels_of(&point, &rectification), &rectification);
        let covariance = jacobian * jacobian.transpose() * 0.09;
        let sigma_m = covariance[(2, 2)].sqrt();
        assert!((0.035..0.045).contains(&sigma_m), "{sigma_m} m");
    }
}

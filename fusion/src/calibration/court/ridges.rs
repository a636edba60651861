//! Picture -> points on the ridges of bright lines, with the direction of the line.
//!
//! Steger (1998), "An unbiased detector of curvilinear structures": where the second derivative
//! across a line is most negative and the first one vanishes within the pixel. Derivatives are
//! those of a Gaussian. A line wider than about 3.5 times its sigma has two ridges, so a few sizes
//! are tried and each pixel keeps the one that answers most.

use crate::calibration::picture::Picture;

/// Sizes of the Gaussian; the widest line that answers to the last is about 12 px wide.
const SIGMAS_PX: [f64; 3] = [1.0, 1.8, 3.5];

/// Least height of a ridge over its sides, in grey levels.
const CONTRAST_MIN: f64 = 8.0;

/// Most ridge points of a picture, the strongest; a court has some thousand.
pub const N_POINTS_MAX: usize = 20_000;

/// A point of a bright line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RidgePoint {
    /// Column, sub-pixel.
    pub x_px: f64,
    /// Row, sub-pixel.
    pub y_px: f64,
    /// Direction of the line, a unit vector with y not negative.
    pub along: [f64; 2],
    /// Height over its sides, about, in grey levels.
    pub contrast: f64,
}

/// All ridge points of a picture, strongest first.
#[must_use]
pub fn from_picture(picture: &Picture) -> Vec<RidgePoint> {
    let (width, height) = (picture.width_px(), picture.height_px());
    let mut best: Vec<Option<RidgePoint>> = vec![None; width * height];
    for sigma in SIGMAS_PX {
        let derivatives = Derivatives::new(picture, sigma);
        let margin = (3.0 * sigma).ceil() as usize;
        for y in margin..height.saturating_sub(margin) {
            for x in margin..width.saturating_sub(margin) {
                let Some(point) = derivatives.ridge_at(x, y, sigma) else { continue };
                let slot = &mut best[y * width + x];
                if slot.is_none_or(|other| other.contrast < point.contrast) {
                    *slot = Some(point);
                }
            }
        }
    }
    let mut points: Vec<RidgePoint> = best.into_iter().flatten().collect();
    points.sort_by(|a, b| b.contrast.total_cmp(&a.contrast));
    points.truncate(N_POINTS_MAX);
    points
}

/// First and second derivatives of a picture seen through a Gaussian.
struct Derivatives {
    width: usize,
    x: Vec<f32>,
    y: Vec<f32>,
    xx: Vec<f32>,
    xy: Vec<f32>,
    yy: Vec<f32>,
}

impl Derivatives {
    fn new(picture: &Picture, sigma: f64) -> Self {
        let kernels = [0, 1, 2].map(|order| kernel(sigma, order));
        let along_rows = kernels.each_ref().map(|k| filtered_along_rows(picture, k));
        let size = (picture.width_px(), picture.height_px());
        let both = |x: usize, y: usize| filtered_along_columns(&along_rows[x], size, &kernels[y]);
        Self {
            width: picture.width_px(),
            x: both(1, 0),
            y: both(0, 1),
            xx: both(2, 0),
            xy: both(1, 1),
            yy: both(0, 2),
        }
    }

    fn ridge_at(&self, column: usize, row: usize, sigma: f64) -> Option<RidgePoint> {
        let i = row * self.width + column;
        let [xx, xy, yy] = [&self.xx, &self.xy, &self.yy].map(|d| f64::from(d[i]));
        // The eigenvalue that is most negative, and its direction: across the line.
        let mean = 0.5 * (xx + yy);
        let half = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        let curvature = mean - half;
        // A Gaussian ridge as wide as the filter of height h has h / (2^(3/2) sigma²) there.
        let contrast = -curvature * sigma * sigma * 2.0 * std::f64::consts::SQRT_2;
        if contrast < CONTRAST_MIN || mean + half > -0.5 * curvature {
            return None;
        }
        let (nx, ny) = if xx <= yy { (curvature - yy, xy) } else { (xy, curvature - xx) };
        let norm = nx.hypot(ny);
        let (nx, ny) = (nx / norm, ny / norm);
        let slope = f64::from(self.x[i]) * nx + f64::from(self.y[i]) * ny;
        let step = -slope / curvature;
        let (dx, dy) = (step * nx, step * ny);
        // A little more than half a pixel, so that none falls between two.
        if !(dx.abs() <= 0.6 && dy.abs() <= 0.6) {
            return None;
        }
        let along = if nx >= 0.0 { [-ny, nx] } else { [ny, -nx] };
        Some(RidgePoint { x_px: column as f64 + dx, y_px: row as f64 + dy, along, contrast })
    }
}

/// A derivative of a Gaussian; its sums over 1, x and x² are those of the derivative itself.
fn kernel(sigma: f64, order: usize) -> Vec<f64> {
    let reach = (3.5 * sigma).ceil() as i64;
    let gauss: Vec<(f64, f64)> = (-reach..=reach)
        .map(|i| i as f64)
        .map(|x| (x, (-0.5 * x * x / (sigma * sigma)).exp()))
        .collect();
    let sum: f64 = gauss.iter().map(|(_, g)| g).sum();
    let s2 = sigma * sigma;
    let mut values: Vec<f64> = gauss
        .iter()
        .map(|&(x, g)| match order {
            0 => g / sum,
            1 => x / s2 * g / sum,
            _ => (x * x / s2 - 1.0) / s2 * g / sum,
        })
        .collect();
    if order == 2 {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter_mut().for_each(|v| *v -= mean);
    }
    values
}

fn filtered_along_rows(picture: &Picture, kernel: &[f64]) -> Vec<f32> {
    let (width, reach) = (picture.width_px(), kernel.len() / 2);
    let mut out = vec![0.0; picture.luma().len()];
    for (row, out) in picture.luma().chunks_exact(width).zip(out.chunks_exact_mut(width)) {
        for x in reach..width.saturating_sub(reach) {
            let sum: f64 =
                row[x - reach..].iter().zip(kernel).map(|(v, k)| f64::from(*v) * k).sum();
            out[x] = sum as f32;
        }
    }
    out
}

fn filtered_along_columns(
    image: &[f32],
    (width, height): (usize, usize),
    kernel: &[f64],
) -> Vec<f32> {
    let reach = kernel.len() / 2;
    let mut out = vec![0.0_f32; image.len()];
    for y in reach..height.saturating_sub(reach) {
        let out = &mut out[y * width..(y + 1) * width];
        for (k, weight) in kernel.iter().enumerate() {
            let row = &image[(y + k - reach) * width..][..width];
            for (o, v) in out.iter_mut().zip(row) {
                *o += *v * *weight as f32;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stripe through the picture's middle: its direction and width, over a grey ground.
    fn stripe(angle_rad: f64, width_px: f64, offset_px: f64) -> Picture {
        let (sin, cos) = angle_rad.sin_cos();
        let luma = (0..80 * 60)
            .map(|i| {
                let mut sum = 0.0;
                for sub in 0..25 {
                    let x = (i % 80) as f64 - 40.0 + f64::from(sub % 5) * 0.2 - 0.4;
                    let y = (i / 80) as f64 - 30.0 + f64::from(sub / 5) * 0.2 - 0.4;
                    let across = -sin * x + cos * y - offset_px;
                    sum += if across.abs() < width_px / 2.0 { 200.0 } else { 80.0 };
                }
                (sum / 25.0) as f32
            })
            .collect();
        Picture::new(80, 60, luma)
    }

    #[test]
    fn ridge_points_lie_on_the_middle_of_a_stripe_and_point_along_it() {
        for (angle_rad, width_px) in [(0.02, 0.8), (0.5, 2.0), (1.3, 5.0), (2.6, 9.0)] {
            let picture = stripe(angle_rad, width_px, 0.3);
            let points = from_picture(&picture);
            assert!(points.len() > 30, "{} at {angle_rad}", points.len());
            let (sin, cos) = angle_rad.sin_cos();
            for point in &points {
                let across = -sin * (point.x_px - 40.0) + cos * (point.y_px - 30.0) - 0.3;
                // Inside a wide stripe, small filters answer to its edges too.
                let allowed_px = if width_px > 6.0 { width_px / 2.0 } else { 0.35 };
                assert!(across.abs() < allowed_px, "{across} px off at width {width_px}");
                let cross = point.along[0] * sin - point.along[1] * cos;
                assert!(cross.abs() < 0.2, "{cross} at width {width_px}");
            }
        }
    }

    #[test]
    fn an_edge_and_a_flat_picture_have_no_ridge() {
        let step = (0..80 * 60).map(|i| if i % 80 < 40 { 60.0 } else { 200.0 }).collect();
        assert!(from_picture(&Picture::new(80, 60, step)).len() < 100);
        assert!(from_picture(&Picture::new(80, 60, vec![9.0; 4800])).is_empty());
        assert!(from_picture(&Picture::new(3, 2, vec![9.0; 6])).is_empty());
    }
}

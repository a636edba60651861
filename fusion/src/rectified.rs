//! Candidates of one frame -> rectified pixels, each with its own time and covariance.
//!
//! Only the points are undistorted and rectified, never an image (thesis 7.1). Under a rolling
//! shutter each row has its own time, `exposed + y · row_time`. The covariance is that of the
//! detector, or else what a thresholded centroid is worth.
//!
//! Candidates that are not finite, lie outside the image, or where the lens model has no inverse
//! are dropped and counted.

use crate::candidates::FrameCandidates;
use crate::world::camera::{Lens, RawPixel, RectifiedPixel};
use crate::world::rectification::Rectification;
use crate::world::rig::Rig;
use crate::{Dropped, Settings};
use nalgebra::Matrix2;
use shm_layout::{Camera, Candidate, StampNs};

/// Part of a ball's diameter its centroid may be off by: one side is lit, the other in shadow.
const SHADING_PER_DIAMETER: f64 = 0.05;

/// Wider than this the centre of a ball is less sure, by so many of [`Settings::bias_sigma_px`] per
/// pixel. Rendered balls of 14 px are off by 0.2 px, the same way for many frames: trusted as their
/// noise has it they turn the launch by 0.3°.
const NEAR_DIAMETER_PX: f64 = 8.0;
const NEAR_PER_PX: f64 = 2.5;

/// Nearer to the image's edge than this, in addition to its radius, a ball may be cut.
const CUT_MARGIN_PX: f64 = 1.5;

/// 1 sigma of the centre of a ball that is cut, of its size.
const CUT_SIGMA: f64 = 0.25;

/// A centre less sure than this is none, and no spot is larger than this.
const SIGMA_MAX_PX: f64 = 10.0;
const SIZE_MAX_PX: f64 = 400.0;

/// A detector that is surer of a centre than this does not know its own errors.
const SIGMA_MIN_PX: f64 = 0.03;

/// A spot where it was captured, and when.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Which camera.
    pub camera: Camera,
    /// Mid-exposure of the spot's row, on the camera's own clock.
    pub t_ns: StampNs,
    /// The spot's centre, raw.
    pub raw: RawPixel,
    /// Of the centre, as the detector has it.
    pub covariance_px2: Matrix2<f64>,
    /// Variance of each axis by what the detector does not know: the image's edge, a streak.
    pub hidden_px2: f64,
}

impl Sighting {
    /// Covariance of the centre, if the detector's own noise is so many times what it says.
    #[must_use]
    pub fn total_px2(&self, noise: f64) -> Matrix2<f64> {
        self.covariance_px2 * (noise * noise) + Matrix2::identity() * self.hidden_px2
    }

    /// 1 sigma, mean of both axes.
    #[must_use]
    pub fn sigma_px(&self) -> f64 {
        (0.5 * self.total_px2(1.0).trace()).sqrt()
    }
}

/// A candidate, rectified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectified {
    /// Where and when it was captured.
    pub sighting: Sighting,
    /// Its place in the rectified image.
    pub pixel: RectifiedPixel,
    /// Width, height and area, if the detector gave them.
    pub size: Option<[f64; 3]>,
}

/// One frame's candidates, rectified.
#[derive(Debug, Clone, PartialEq)]
pub struct RectifiedFrame {
    /// Whose.
    pub camera: Camera,
    /// 0, 1, 2 … within the recording.
    pub frame_idx: u64,
    /// Mid-exposure of the first row.
    pub t_ns: StampNs,
    /// 1 sigma of the stamp on this machine's clock, or [`shm_layout::stamp::OWN_CLOCK`].
    pub clock_sigma_ns: u32,
    /// The candidates, by their raw rows.
    pub spots: Vec<Rectified>,
}

/// Rectifies a frame; counts what it leaves out in `dropped`.
pub fn from_candidates(
    camera: Camera,
    frame: &FrameCandidates,
    rig: &Rig,
    rectification: &Rectification,
    settings: &Settings,
    dropped: &mut Dropped,
) -> RectifiedFrame {
    let eye = rig.eye(camera);
    let mut spots = Vec::with_capacity(frame.spots.len());
    for spot in &frame.spots {
        let raw = RawPixel { x_px: f64::from(spot.x_px), y_px: f64::from(spot.y_px) };
        if !(raw.x_px.is_finite() && raw.y_px.is_finite()) {
            dropped.n_not_finite += 1;
            continue;
        }
        let rectified = rectification.rectified_from_raw(camera, raw);
        let Some(pixel) = rectified.filter(|_| eye.lens.contains(raw)) else {
            dropped.n_outside_image += 1;
            continue;
        };
        let size = size_of(spot);
        let row_ns = (raw.y_px * eye.row_time_us * 1e3).round() as StampNs;
        let sighting = Sighting {
            camera,
            t_ns: frame.exposed_ns.saturating_add(row_ns),
            raw,
            covariance_px2: covariance_of(spot, settings),
            hidden_px2: cut_px2(spot, &eye.lens) + near_px2(spot, settings),
        };
        spots.push(Rectified { sighting, pixel, size });
    }
    spots.sort_by(|a, b| a.sighting.raw.y_px.total_cmp(&b.sighting.raw.y_px));
    let FrameCandidates { frame_idx, exposed_ns: t_ns, clock_sigma_ns, .. } = *frame;
    RectifiedFrame { camera, frame_idx, t_ns, clock_sigma_ns, spots }
}

/// Covariance of the centre; the detector's if it is one.
fn covariance_of(spot: &Candidate, settings: &Settings) -> Matrix2<f64> {
    let [xx, xy, yy] = [spot.xx_px2, spot.xy_px2, spot.yy_px2].map(f64::from);
    let least = Matrix2::identity() * SIGMA_MIN_PX.powi(2);
    let told = Matrix2::new(xx, xy, xy, yy);
    if xx > 0.0 && yy > 0.0 && told.determinant() > 0.0 && told.trace() <= SIGMA_MAX_PX.powi(2) {
        return told + least;
    }
    let size = size_of(spot);
    let diameter_px = size.map_or(0.0, |[width, height, _]| f64::midpoint(width, height));
    let sigma_px = settings.sigma_px.hypot(SHADING_PER_DIAMETER * diameter_px);
    Matrix2::identity() * sigma_px.powi(2) + least
}

/// A near ball is a large disc, lit unevenly, with a blurred outline.
fn near_px2(spot: &Candidate, settings: &Settings) -> f64 {
    let Some([width_px, height_px, _]) = size_of(spot) else { return 0.0 };
    let beyond_px = (f64::midpoint(width_px, height_px) - NEAR_DIAMETER_PX).max(0.0);
    (settings.bias_sigma_px * NEAR_PER_PX * beyond_px).powi(2)
}

/// A ball that the image's edge cuts has its centre too far inside.
fn cut_px2(spot: &Candidate, lens: &Lens) -> f64 {
    let Some([width_px, height_px, _]) = size_of(spot) else { return 0.0 };
    let is_cut = |place_px: f32, length_px: f64, side_px: u32| {
        let reach_px = 0.5 * length_px + CUT_MARGIN_PX;
        let last_px = f64::from(side_px) - 1.0;
        let place_px = f64::from(place_px);
        place_px - reach_px < 0.0 || place_px + reach_px > last_px
    };
    let [columns, rows] = lens.image_px();
    let is_cut = is_cut(spot.x_px, width_px, columns) || is_cut(spot.y_px, height_px, rows);
    let length_px = if is_cut { CUT_SIGMA * width_px.max(height_px) } else { 0.0 };
    length_px.powi(2)
}

/// A size counts if all of it is known and none of it is nothing.
fn size_of(spot: &Candidate) -> Option<[f64; 3]> {
    let size = [spot.width_px, spot.height_px, spot.area_px].map(f64::from);
    let [width, height, area] = size;
    let is_length = |length: f64| length > 0.0 && length <= SIZE_MAX_PX;
    let is_size =
        is_length(width) && is_length(height) && area > 0.0 && area <= SIZE_MAX_PX.powi(2);
    is_size.then_some(size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;

    #[test]
    fn what_cannot_be_is_dropped_and_counted() {
        let rig = pretend::reference_rig();
        let rectification = Rectification::from_rig(&rig);
        let places =
            [(320.0, 240.0), (f32::NAN, 1.0), (1.0, f32::INFINITY), (640.9, 0.0), (-5.0, 0.0)];
        let spots = places.map(|(x_px, y_px)| Candidate { x_px, y_px, ..Candidate::default() });
        let frame = pretend::frame(0, 0, spots.to_vec());
        let mut dropped = Dropped::default();
        let settings = Settings::default();
        let rectified =
            from_candidates(Camera::Left, &frame, &rig, &rectification, &settings, &mut dropped);
        assert_eq!(rectified.spots.len(), 2);
        assert_eq!((dropped.n_not_finite, dropped.n_outside_image), (2, 1));
        assert_eq!(rectified.spots[0].size, None);
    }

    #[test]
    fn a_lower_row_is_later_under_a_rolling_shutter() {
        let text =
            pretend::REFERENCE_RIG.replace("row_time_us         = 0.0", "row_time_us = 9.45");
        let rig: Rig = text.parse().unwrap();
        let rectification = Rectification::from_rig(&rig);
        let spot = Candidate { x_px: 320.0, y_px: 400.0, ..Candidate::default() };
        let frame = pretend::frame(0, 1000, vec![spot]);
        let settings = Settings::default();
        let mut dropped = Dropped::default();
        let rectified =
            from_candidates(Camera::Left, &frame, &rig, &rectification, &settings, &mut dropped);
        assert_eq!(rectified.spots[0].sighting.t_ns, 1000 + 3_780_000);
    }
}

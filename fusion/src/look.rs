//! Flight + frame -> what the frame shows where the ball should be: a sighting, nothing, or it
//! should not show it at all; and what that is worth.
//!
//! The frame is asked at the time of the row in which the ball is expected. The gate is
//! [`GATE_SIGMAS`] of the spot's noise and the fit's own doubt together; where that doubt is more
//! than [`DOUBT_MAX_PX`] nothing is looked for.

use crate::flight::fitted::Fitted;
use crate::history::{History, Kept};
use crate::motion::later_ns;
use crate::path::Terms;
use crate::rectified::Sighting;
use crate::seeds::DETECTED;
use crate::world::camera::RawPixel;
use nalgebra::{Matrix2, SMatrix};
use std::f64::consts::TAU;

/// Gate of a sighting.
pub const GATE_SIGMAS: f64 = 4.0;

/// Where the fit itself is more doubtful than this, every spot would fit.
pub const DOUBT_MAX_PX: f64 = 8.0;

/// Rows around the expected one in which a spot may be within its gate, whatever its noise.
const REACH_PX: f64 = 12.0;

/// 1 sigma of a streak's middle, of its length beyond so many pixels. Rendered balls 5 m away, five
/// pixels long, are off by 0.2 px along the streak; those of 2.5 px by 0.03.
const STREAK_SIGMA: f64 = 0.1;
const STREAK_MIN_PX: f64 = 2.0;

/// What a frame that should show the ball shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Look {
    /// Nothing within the gate.
    Missed,
    /// The spot that fits best.
    Seen {
        /// The spot.
        sighting: Sighting,
        /// How much likelier a ball left it than clutter: the logarithm.
        gain: f64,
    },
}

/// What one sighting can be worth: beyond, it is not clutter as it is modelled that it rules out.
const GAIN_MAX: f64 = 8.0;

/// What a frame shows where the ball should be; None if it should not show it.
#[must_use]
pub fn at(
    kept: &Kept,
    fitted: &Fitted,
    span_s: std::ops::Range<f64>,
    history: &History,
    terms: &Terms,
) -> Option<Look> {
    let rig = terms.world.rig;
    let eye = rig.eye(kept.camera);
    let middle_px = f64::from(eye.lens.image_px()[1]) / 2.0;
    let at_row = |row_px: f64| Sighting {
        camera: kept.camera,
        t_ns: later_ns(kept.t_ns, row_px * eye.row_time_us * 1e-6),
        raw: RawPixel { x_px: 0.0, y_px: 0.0 },
        covariance_px2: Matrix2::identity(),
        hidden_px2: 0.0,
    };
    let mut row = at_row(middle_px);
    let mut seen = fitted.seen(&row, rig)?;
    if eye.row_time_us > 0.0 {
        row = at_row(seen.1.y.clamp(0.0, 2.0 * middle_px));
        seen = fitted.seen(&row, rig)?;
    }
    let (slope, expected_px) = seen;
    let time_s = fitted.time_s(&row);
    let is_underground = fitted.model.place_at(time_s).position_m.z < 0.0;
    if !span_s.contains(&time_s) || is_underground {
        return None;
    }
    let across_px = fitted.speed_px_s(&row, rig)? * (eye.exposure_us * 1e-6);
    let streak_px2 = (STREAK_SIGMA * (across_px - STREAK_MIN_PX).max(0.0)).powi(2);
    let doubt: SMatrix<f64, 2, 2> = slope * fitted.covariance * slope.transpose();
    if doubt.trace().sqrt() > DOUBT_MAX_PX {
        return None;
    }
    let reach_px = GATE_SIGMAS * doubt[(1, 1)].sqrt() + REACH_PX;
    let nearest = kept
        .spots_in([expected_px.y - reach_px, expected_px.y + reach_px])
        .map(|(_, spot)| Sighting {
            hidden_px2: spot.sighting.hidden_px2 + streak_px2,
            ..spot.sighting
        })
        .filter_map(|sighting| Some((fitted.distance(&sighting, rig, true)?, sighting)))
        .filter(|(distance, _)| *distance <= GATE_SIGMAS)
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((distance, sighting)) = nearest else {
        let expected = RawPixel { x_px: expected_px.x, y_px: expected_px.y };
        return eye.lens.contains(expected).then_some(Look::Missed);
    };
    let noise = fitted.noise[kept.camera.idx()];
    let area_px2 = TAU * (doubt + sighting.total_px2(noise)).determinant().sqrt();
    let [width_px, height_px] = eye.lens.image_px().map(f64::from);
    let by_chance = history.clutter(kept.camera) / (width_px * height_px) * area_px2;
    let gain = (DETECTED / by_chance).ln().min(GAIN_MAX) - 0.5 * distance * distance;
    Some(Look::Seen { sighting, gain })
}

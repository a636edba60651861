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
        .filter_map(|sighting| Some((fitted.distance(&sighting, rig)?, sighting)))
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
    // A spot that may be anywhere says no more than none.
    let gain = (DETECTED / by_chance).ln().min(GAIN_MAX) - 0.5 * distance * distance;
    if gain < (1.0 - DETECTED).ln() {
        return Some(Look::Missed);
    }
    Some(Look::Seen { sighting, gain })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::World;
    use crate::path::{self, Path};
    use crate::pretend::{self, Frames, GOOD_SIGHT, POOR_SIGHT, Serve, THESIS_SERVE};
    use crate::{Fusion, Settings};
    use shm_layout::Camera;

    const SERVE: Serve = Serve { launch_ns: 100_000_000, ..THESIS_SERVE };

    fn fed(frames: &Frames) -> Fusion {
        pretend::fed(pretend::reference_rig(), Settings::default(), frames).0
    }

    /// The path of a stream's first tracklet, with some of its tokens, through the frames of
    /// another stream.
    fn path_through(shown: &Fusion, fusion: &Fusion, is_token: impl Fn(u64) -> bool) -> Path {
        let mut tracklet = shown.tracklets.all[0].clone();
        tracklet.tokens.retain(|token| is_token(token.id.serial));
        with_terms(fusion, |terms| path::along(&tracklet, &fusion.history, terms).unwrap())
    }

    fn with_terms<T>(fusion: &Fusion, run: impl Fn(&Terms) -> T) -> T {
        let world = World { rig: &fusion.rig, physics: &fusion.physics, clock_s: [0.0, 1e-4] };
        let Settings { ground_sigma_m, bias_sigma_px, .. } = fusion.settings;
        run(&Terms { world, ground_sigma_m, bias_sigma_px })
    }

    #[test]
    fn a_ball_is_worth_far_more_than_a_handful_of_spots_that_lie_on_a_flight() {
        for (sight, least) in [(GOOD_SIGHT, 600.0), (POOR_SIGHT, 200.0)] {
            // 70 frames of two cameras should show it: a sighting is worth 4 to 8 and a miss -0.9.
            let (frames, _) = pretend::seen(&[SERVE], 120, &sight, 1);
            let fusion = fed(&frames);
            let worth = path_through(&fusion, &fusion, |_| true).worth;
            assert!(worth > least, "{worth}");
        }
        // Every twelfth frame's spots alone: 6 of 70 frames, 12 · 8 less 128 · 0.9.
        let (mut frames, _) = pretend::seen(&[SERVE], 120, &GOOD_SIGHT, 1);
        let whole = fed(&frames);
        let is_left = |serial: u64| serial.is_multiple_of(12);
        for (_, frame) in frames.iter_mut().filter(|(_, frame)| !is_left(frame.frame_idx)) {
            frame.spots.clear();
        }
        let path = path_through(&whole, &fed(&frames), is_left);
        assert!(path.sightings.len() >= 8, "{}", path.sightings.len());
        assert!(path.worth < 30.0, "{}", path.worth);
    }

    #[test]
    fn a_frame_shows_the_ball_or_misses_it_or_need_not_show_it() {
        let (mut frames, _) = pretend::seen(&[SERVE], 120, &GOOD_SIGHT, 1);
        let whole = fed(&frames);
        let path = path_through(&whole, &whole, |_| true);
        let fitted = path.fitted.unwrap();
        let always = f64::NEG_INFINITY..f64::INFINITY;
        let looks = |fusion: &Fusion, span_s: &std::ops::Range<f64>| -> Vec<Option<Look>> {
            with_terms(fusion, |terms| {
                let all = fusion.history.since(Camera::Left, 0);
                let look = |kept| at(kept, &fitted, span_s.clone(), &fusion.history, terms);
                all.map(look).collect()
            })
        };
        let is_seen = |look: &Option<Look>| matches!(look, Some(Look::Seen { .. }));
        let whole_looks = looks(&whole, &always);
        let n_spots = frames.iter().filter(|(c, f)| *c == Camera::Left && !f.spots.is_empty());
        let n_seen = whole_looks.iter().filter(|look| is_seen(look)).count();
        // The noise's tails, and frames next to the bounce.
        assert!(n_seen + 3 >= n_spots.count(), "{n_seen}");
        for (_, frame) in &mut frames {
            for spot in &mut frame.spots {
                spot.x_px += 9.0;
            }
        }
        // 9 px are far out of the gate: 4 sigmas of 0.3 px and of less than that of the fit.
        for (whole, moved) in whole_looks.iter().zip(looks(&fed(&frames), &always)) {
            assert!(!is_seen(&moved), "{moved:?}");
            assert!(!is_seen(whole) || moved == Some(Look::Missed));
        }
        assert!(looks(&whole, &(5.0..6.0)).iter().all(Option::is_none), "not in the span");
    }
}

//! Rectified left + right -> pairs that may show the same thing.
//!
//! Frames are never paired by index: each frame meets the other camera's frame nearest in time,
//! within half a frame period, once that one is there. What a tracklet has claimed is left out.
//!
//! Candidates pair if their rows agree, the disparity is that of a possible depth, and their sizes
//! are alike by the thesis' Eq 21, `S = 3 / (s_r² + h_r² + w_r²)`, each ratio the larger over the
//! smaller, so that S is 1 for equals and falls to 0.
//!
//! **Otherwise than the thesis**, which let the most similar right candidate within 50 rows win
//! (S > 0.1): 50 rows is twenty times the real error, a ball of 3 px has no size to speak of, and
//! the winner was not exclusive either way. Here the row decides, to a few pixels; Eq 21 only
//! refuses what is grossly different; *all* pairs that pass are kept, many to many and best first,
//! and the tracker, which knows how a ball moves, has the last word. The row gate widens with the
//! time between the exposures (the ball falls meanwhile), with how little is known of the clocks,
//! and with the spot's size.
//!
//! **Cost**: both sides sorted by row, one sweep with two pointers: linear in candidates and pairs.

use crate::history::{Kept, SpotId};
use crate::motion::{World, seconds_between};
use crate::rectified::Rectified;
use crate::world::rectification::Rectification;
use crate::{Dropped, Settings};
use shm_layout::{Camera, StampNs};
use std::collections::VecDeque;

/// Most pairs of one instant; the best are kept. A ball and twenty false spots per camera give
/// about ten.
pub const MAX_PAIRS: usize = 64;

/// Rows a ball may move per second of time between the exposures: 6 px in half a frame.
const ROW_RATE_PX_S: f64 = 1000.0;

/// Part of a spot's height its row may be off by: centroids of near balls wander with the light.
const ROW_PER_HEIGHT: f64 = 0.15;

/// Nearer than this a ball fills the image, farther than this it is beyond any court.
const DEPTH_RANGE_M: std::ops::Range<f64> = 1.0..60.0;

/// Assumed before enough stamps have been seen to know better.
const FRAME_PERIOD_DEFAULT_NS: StampNs = 1_000_000_000 / 90;

/// Stamp differences a frame period is estimated from.
const N_PERIOD_DIFFERENCES: usize = 32;

/// Fewer of them tell none.
const N_KNOWN: usize = 8;

/// Half a period, and a little for jitter: free-running cameras may be exactly half apart.
const PAIRING_PERIODS: f64 = 0.55;

/// A left and a right candidate that may be one thing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matched {
    /// From the left camera.
    pub left: Rectified,
    /// From the right camera.
    pub right: Rectified,
    /// Which spots they are.
    pub ids: [SpotId; 2],
}

/// How far apart in time the cameras' frames are, learned from their stamps.
#[derive(Default)]
pub struct Period {
    last_ns: Option<StampNs>,
    differences_ns: VecDeque<StampNs>,
}

impl Period {
    /// Takes the stamp of a frame in.
    pub fn update(&mut self, t_ns: StampNs) {
        if let Some(last_ns) = self.last_ns {
            self.differences_ns.push_back(t_ns.saturating_sub(last_ns));
            if self.differences_ns.len() > N_PERIOD_DIFFERENCES {
                self.differences_ns.pop_front();
            }
        }
        self.last_ns = Some(t_ns);
    }

    /// Lower quartile of the differences: frames are lost more often than they are early.
    #[must_use]
    pub fn ns(&self) -> StampNs {
        let mut sorted: Vec<StampNs> = self.differences_ns.iter().copied().collect();
        sorted.sort_unstable();
        match sorted.get(sorted.len() / 4) {
            Some(&period_ns) if sorted.len() >= N_KNOWN => period_ns,
            _ => FRAME_PERIOD_DEFAULT_NS,
        }
    }

    /// Least of the differences: a camera that was slower for a while may be quick again. None
    /// before some frames have come.
    #[must_use]
    pub fn shortest_ns(&self) -> Option<StampNs> {
        self.differences_ns.iter().copied().min().filter(|_| self.differences_ns.len() >= N_KNOWN)
    }
}

/// Whether two frames of different cameras are near enough in time to be matched, given the longer
/// of both periods.
#[must_use]
pub fn is_same_instant(a: &Kept, b: &Kept, period_ns: StampNs) -> bool {
    a.t_ns.abs_diff(b.t_ns) as f64 <= period_ns as f64 * PAIRING_PERIODS
}

/// All pairs of free spots of two frames that pass, best first.
pub fn from_frames(
    left: &Kept,
    right: &Kept,
    rectification: &Rectification,
    world: &World,
    settings: &Settings,
    dropped: &mut Dropped,
) -> Vec<Matched> {
    let free = |kept: &Kept| {
        let mut spots: Vec<(usize, Rectified)> =
            kept.spots.iter().copied().enumerate().filter(|(i, _)| !kept.is_claimed(*i)).collect();
        spots.sort_by(|a, b| a.1.pixel.y_px.total_cmp(&b.1.pixel.y_px));
        spots
    };
    let (lefts, rights) = (free(left), free(right));
    let depth_px_m = rectification.focal_px * rectification.baseline_m;
    let height_max_px = lefts.iter().chain(&rights).map(|(_, s)| height_px(s)).fold(0.0, f64::max);
    let apart_s = apart_s(left, right, world);
    let reach_px = row_gate_px(apart_s, height_max_px, settings);
    let mut ranked = Vec::new();
    let mut first = 0;
    for (l_idx, l) in &lefts {
        while rights.get(first).is_some_and(|(_, r)| r.pixel.y_px < l.pixel.y_px - reach_px) {
            first += 1;
        }
        for (r_idx, r) in &rights[first..] {
            let row_px = r.pixel.y_px - l.pixel.y_px;
            if row_px > reach_px {
                break;
            }
            let disparity_px = l.pixel.x_px - r.pixel.x_px;
            let gate_px = row_gate_px(apart_s, height_px(l).max(height_px(r)), settings);
            let similarity = similarity(l, r);
            if disparity_px > 0.0
                && DEPTH_RANGE_M.contains(&(depth_px_m / disparity_px))
                && row_px.abs() <= gate_px
                && similarity >= settings.similarity_min
            {
                let cost = (row_px / gate_px).powi(2) + 1.0 - similarity;
                let ids = [left.id(*l_idx), right.id(*r_idx)];
                ranked.push((cost, Matched { left: *l, right: *r, ids }));
            }
        }
    }
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    dropped.n_pairs_beyond_max += ranked.len().saturating_sub(MAX_PAIRS) as u64;
    ranked.truncate(MAX_PAIRS);
    ranked.into_iter().map(|(_, pair)| pair).collect()
}

/// How far apart in time the two exposures may be, for all that is known of the clocks. The rows'
/// own times under a rolling shutter are alike, as the rows are.
fn apart_s(left: &Kept, right: &Kept, world: &World) -> f64 {
    let right_ns = world.left_ns(Camera::Right, right.t_ns);
    seconds_between(left.t_ns, right_ns).abs() + 2.0 * world.clock_s[1]
}

fn row_gate_px(apart_s: f64, height_px: f64, settings: &Settings) -> f64 {
    settings.row_gate_px + ROW_RATE_PX_S * apart_s + ROW_PER_HEIGHT * height_px
}

fn height_px(spot: &Rectified) -> f64 {
    spot.size.map_or(0.0, |[_, height_px, _]| height_px)
}

/// Eq 21; 1 where a size is not known, so that it decides nothing.
fn similarity(left: &Rectified, right: &Rectified) -> f64 {
    let (Some(left), Some(right)) = (left.size, right.size) else { return 1.0 };
    let squared_ratios = [0, 1, 2].map(|i| (left[i] / right[i]).max(right[i] / left[i]).powi(2));
    3.0 / squared_ratios.iter().sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::History;
    use crate::pretend;
    use crate::rectified::{RectifiedFrame, Sighting};
    use crate::world::camera::{RawPixel, RectifiedPixel};
    use nalgebra::Matrix2;
    use shm_layout::stamp::OWN_CLOCK;

    fn spot(camera: Camera, x_px: f64, y_px: f64, size: Option<[f64; 3]>) -> Rectified {
        let covariance_px2 = Matrix2::identity() * 0.09;
        let raw = RawPixel { x_px, y_px };
        let sighting = Sighting { camera, t_ns: 0, raw, covariance_px2, hidden_px2: 0.0 };
        Rectified { sighting, pixel: RectifiedPixel { x_px, y_px }, size }
    }

    /// Right columns of the pairs found; clocks known to this sigma.
    fn columns(lefts: Vec<Rectified>, rights: Vec<Rectified>, clock_sigma_s: f64) -> Vec<f64> {
        let rig = pretend::reference_rig();
        let rectification = Rectification::from_rig(&rig);
        let physics = rig.physics();
        let world = World { rig: &rig, physics: &physics, clock_s: [0.0, clock_sigma_s] };
        let mut history = History::default();
        for (camera, spots) in Camera::BOTH.into_iter().zip([lefts, rights]) {
            let (frame_idx, t_ns, clock_sigma_ns) = (0, 0, OWN_CLOCK);
            history.push(RectifiedFrame { camera, frame_idx, t_ns, clock_sigma_ns, spots });
        }
        let [left, right] = Camera::BOTH.map(|camera| history.newest(camera).unwrap());
        let (settings, mut dropped) = (Settings::default(), Dropped::default());
        from_frames(left, right, &rectification, &world, &settings, &mut dropped)
            .iter()
            .map(|pair| pair.right.pixel.x_px)
            .collect()
    }

    fn rights() -> Vec<Rectified> {
        let ball = Some([4.0, 4.0, 12.0]);
        vec![
            spot(Camera::Right, 520.0, 200.0, ball),
            spot(Camera::Right, 410.0, 200.0, ball),
            spot(Camera::Right, 220.0, 200.0, Some([20.0, 20.0, 300.0])),
            spot(Camera::Right, 219.0, 200.5, ball),
            spot(Camera::Right, 220.0, 202.0, ball),
            spot(Camera::Right, 221.0, 208.0, ball),
        ]
    }

    #[test]
    fn row_disparity_and_size_decide_and_all_that_pass_are_kept() {
        let ball = Some([4.0, 4.0, 12.0]);
        let left = vec![spot(Camera::Left, 420.0, 200.0, ball)];
        assert_eq!(columns(left.clone(), rights(), 1e-4), [219.0, 220.0], "best row first");
        assert_eq!(columns(left, rights(), 5e-3), [219.0, 220.0, 221.0], "clocks unknown");
    }

    #[test]
    fn the_sweep_finds_what_comparing_all_with_all_finds() {
        let ball = Some([4.0, 4.0, 12.0]);
        let place = |i: usize| ((i * 7919) % 640) as f64;
        let row = |i: usize| ((i * 104_729) % 97) as f64 * 2.3;
        let lefts: Vec<Rectified> =
            (0..40).map(|i| spot(Camera::Left, place(i), row(i), ball)).collect();
        let rights: Vec<Rectified> =
            (40..80).map(|i| spot(Camera::Right, place(i), row(i), ball)).collect();
        let mut all: Vec<f64> = Vec::new();
        let gate_px = row_gate_px(2e-4, 4.0, &Settings::default());
        for l in &lefts {
            for r in &rights {
                let disparity_px = l.pixel.x_px - r.pixel.x_px;
                let is_row = (l.pixel.y_px - r.pixel.y_px).abs() <= gate_px;
                let is_depth =
                    disparity_px > 0.0 && DEPTH_RANGE_M.contains(&(4960.0 / disparity_px));
                all.extend((is_row && is_depth).then_some(r.pixel.x_px));
            }
        }
        let mut found = columns(lefts, rights, 1e-4);
        found.sort_by(f64::total_cmp);
        all.sort_by(f64::total_cmp);
        assert!(all.len() > 5);
        assert_eq!(found, all);
    }

    #[test]
    fn similarity_is_one_for_equals_and_symmetric() {
        let a = spot(Camera::Left, 0.0, 0.0, Some([4.0, 5.0, 14.0]));
        let b = spot(Camera::Left, 0.0, 0.0, Some([8.0, 5.0, 28.0]));
        assert_eq!(similarity(&a, &a), 1.0);
        assert_eq!(similarity(&a, &b), 3.0 / 9.0);
        assert_eq!(similarity(&a, &b), similarity(&b, &a));
    }

    #[test]
    fn a_lost_frame_does_not_double_the_period() {
        let mut period = Period::default();
        (0..40).filter(|i| i % 5 != 2).for_each(|i| period.update(i * 100));
        assert_eq!(period.ns(), 100);
    }
}

//! Rectified left + right -> pairs that may show the same thing.
//!
//! Frames are never paired by index: each left frame meets the right frame nearest in time, within
//! half a frame period. The side that is ahead waits, up to [`Settings::n_waiting_frames`].
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
//! time between the exposures (the ball falls meanwhile) and with the spot's size.

use crate::rectified::{Rectified, RectifiedFrame};
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

/// Half a period, and a little for jitter: free-running cameras may be exactly half apart.
const PAIRING_PERIODS: f64 = 0.55;

/// A left and a right candidate that may be one thing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matched {
    /// From the left camera.
    pub left: Rectified,
    /// From the right camera.
    pub right: Rectified,
}

/// All pairs of one left frame and the right frame nearest in time.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchedFrame {
    /// Mean of the two frames' stamps; the left one's where there is no right frame.
    pub t_ns: StampNs,
    /// The pairs, best first; none if the right frame is missing.
    pub pairs: Vec<Matched>,
}

#[derive(Default)]
struct Side {
    waiting: VecDeque<RectifiedFrame>,
    last_ns: Option<StampNs>,
    differences_ns: VecDeque<StampNs>,
}

impl Side {
    fn push(&mut self, frame: RectifiedFrame) {
        if let Some(last_ns) = self.last_ns {
            self.differences_ns.push_back(frame.t_ns.saturating_sub(last_ns));
            if self.differences_ns.len() > N_PERIOD_DIFFERENCES {
                self.differences_ns.pop_front();
            }
        }
        self.last_ns = Some(frame.t_ns);
        self.waiting.push_back(frame);
    }

    /// Lower quartile of the differences: frames are lost more often than they are early.
    fn period_ns(&self) -> StampNs {
        let mut sorted: Vec<StampNs> = self.differences_ns.iter().copied().collect();
        sorted.sort_unstable();
        match sorted.get(sorted.len() / 4) {
            Some(&period_ns) if sorted.len() >= 8 => period_ns,
            _ => FRAME_PERIOD_DEFAULT_NS,
        }
    }
}

/// Brings the two cameras together in time.
#[derive(Default)]
pub struct Pairing {
    sides: [Side; 2],
}

impl Pairing {
    /// Takes a frame in; gives out the left frames whose nearest right frame is now known.
    pub fn update(
        &mut self,
        camera: Camera,
        frame: RectifiedFrame,
        rectification: &Rectification,
        settings: &Settings,
        dropped: &mut Dropped,
    ) -> Vec<MatchedFrame> {
        self.sides[camera.idx()].push(frame);
        let mut matched = Vec::new();
        loop {
            let [left, right] = &self.sides;
            let Some(first) = left.waiting.front() else { break };
            let is_known = right.waiting.back().is_some_and(|last| last.t_ns >= first.t_ns);
            if !is_known && left.waiting.len() <= settings.n_waiting_frames {
                break;
            }
            matched.extend(self.next_left(rectification, settings, dropped));
        }
        let right = &mut self.sides[Camera::Right.idx()].waiting;
        while right.len() > settings.n_waiting_frames {
            right.pop_front();
            dropped.n_unpaired_frames += 1;
        }
        matched
    }

    /// No more frames will come: gives out the left frames that still wait.
    pub fn finish(
        &mut self,
        rectification: &Rectification,
        settings: &Settings,
        dropped: &mut Dropped,
    ) -> Vec<MatchedFrame> {
        let matched =
            std::iter::from_fn(|| self.next_left(rectification, settings, dropped)).collect();
        self.sides = [Side::default(), Side::default()];
        matched
    }

    /// The first left frame that waits, with the nearest right frame there is.
    fn next_left(
        &mut self,
        rectification: &Rectification,
        settings: &Settings,
        dropped: &mut Dropped,
    ) -> Option<MatchedFrame> {
        let period_ns = self.sides.iter().map(Side::period_ns).max().unwrap_or_default();
        let [left_side, right_side] = &mut self.sides;
        let left = left_side.waiting.pop_front()?;
        let distance_ns = |right: &RectifiedFrame| right.t_ns.abs_diff(left.t_ns);
        // Left stamps increase, so a right frame farther than the next one is of no more use.
        while let [first, second] = [right_side.waiting.front(), right_side.waiting.get(1)]
            && let (Some(first), Some(second)) = (first, second)
            && distance_ns(second) <= distance_ns(first)
        {
            right_side.waiting.pop_front();
        }
        let nearest = right_side.waiting.front();
        let limit_ns = period_ns as f64 * PAIRING_PERIODS;
        let Some(right) = nearest.filter(|right| distance_ns(right) as f64 <= limit_ns) else {
            dropped.n_unpaired_frames += 1;
            return Some(MatchedFrame { t_ns: left.t_ns, pairs: Vec::new() });
        };
        let t_ns = left.t_ns.midpoint(right.t_ns);
        let pairs = from_rectified(&left, right, rectification, settings, dropped);
        Some(MatchedFrame { t_ns, pairs })
    }
}

/// All pairs of two frames that pass, best first.
fn from_rectified(
    left: &RectifiedFrame,
    right: &RectifiedFrame,
    rectification: &Rectification,
    settings: &Settings,
    dropped: &mut Dropped,
) -> Vec<Matched> {
    let depth_px_m = rectification.focal_px * rectification.baseline_m;
    let mut ranked = Vec::new();
    for l in &left.spots {
        for r in &right.spots {
            let disparity_px = l.pixel.x_px - r.pixel.x_px;
            let row_px = (l.pixel.y_px - r.pixel.y_px).abs();
            let gate_px = row_gate_px(l, r, settings);
            let similarity = similarity(l, r);
            if disparity_px > 0.0
                && DEPTH_RANGE_M.contains(&(depth_px_m / disparity_px))
                && row_px <= gate_px
                && similarity >= settings.similarity_min
            {
                let cost = (row_px / gate_px).powi(2) + 1.0 - similarity;
                ranked.push((cost, Matched { left: *l, right: *r }));
            }
        }
    }
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    dropped.n_pairs_beyond_max += ranked.len().saturating_sub(MAX_PAIRS) as u64;
    ranked.truncate(MAX_PAIRS);
    ranked.into_iter().map(|(_, pair)| pair).collect()
}

fn row_gate_px(left: &Rectified, right: &Rectified, settings: &Settings) -> f64 {
    let apart_s = left.sighting.t_ns.abs_diff(right.sighting.t_ns) as f64 * 1e-9;
    let height_px = match (left.size, right.size) {
        (Some([_, left_px, _]), Some([_, right_px, _])) => left_px.max(right_px),
        _ => 0.0,
    };
    settings.row_gate_px + ROW_RATE_PX_S * apart_s + ROW_PER_HEIGHT * height_px
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
    use crate::pretend;
    use crate::rectified::Sighting;
    use crate::world::camera::{RawPixel, RectifiedPixel};

    fn spot(t_ns: StampNs, x_px: f64, y_px: f64, size: Option<[f64; 3]>) -> Rectified {
        Rectified {
            sighting: Sighting { t_ns, raw: RawPixel { x_px, y_px } },
            pixel: RectifiedPixel { x_px, y_px },
            sigma_px: 0.3,
            size,
        }
    }

    fn frame(t_ns: StampNs, x_px: f64) -> RectifiedFrame {
        RectifiedFrame { t_ns, spots: vec![spot(t_ns, x_px, 200.0, None)] }
    }

    /// Runs two streams of stamps through; returns (time, whether paired) of each left frame.
    fn paired(left_ns: &[StampNs], right_ns: &[StampNs]) -> (Vec<(StampNs, bool)>, Dropped) {
        let rectification = Rectification::from_rig(&pretend::reference_rig());
        let settings = Settings::default();
        let (mut pairing, mut dropped) = (Pairing::default(), Dropped::default());
        let mut events: Vec<(StampNs, Camera)> =
            left_ns.iter().map(|&t| (t, Camera::Left)).collect();
        events.extend(right_ns.iter().map(|&t| (t, Camera::Right)));
        events.sort();
        let mut all = Vec::new();
        for (t_ns, camera) in events {
            let x_px = if camera == Camera::Left { 420.0 } else { 220.0 };
            let frame = frame(t_ns, x_px);
            all.extend(pairing.update(camera, frame, &rectification, &settings, &mut dropped));
        }
        all.extend(pairing.finish(&rectification, &settings, &mut dropped));
        (all.iter().map(|m| (m.t_ns, !m.pairs.is_empty())).collect(), dropped)
    }

    fn stamps(n: i64, period_ns: i64, offset_ns: i64) -> Vec<StampNs> {
        (0..n).map(|i| i * period_ns + offset_ns).collect()
    }

    #[test]
    fn frames_pair_by_time_whatever_offset_and_rate() {
        for (left, right) in [
            (stamps(50, 11_111_111, 0), stamps(50, 11_111_111, 0)),
            (stamps(50, 11_111_111, 0), stamps(50, 11_111_111, 5_500_000)),
            (stamps(50, 11_111_111, 5_500_000), stamps(50, 11_111_111, 0)),
            (stamps(90, 11_111_111, 0), stamps(60, 16_666_667, 3_000_000)),
            (stamps(60, 16_666_667, 0), stamps(90, 11_111_111, 3_000_000)),
        ] {
            let (matched, _) = paired(&left, &right);
            assert_eq!(matched.len(), left.len());
            let n_paired = matched.iter().filter(|(_, is_paired)| *is_paired).count();
            // Until their rates are known, cameras of different rates may miss each other.
            assert!(n_paired + 4 >= left.len(), "{n_paired} of {}", left.len());
        }
    }

    #[test]
    fn a_lost_right_frame_leaves_one_left_frame_alone() {
        let left = stamps(60, 11_111_111, 0);
        let mut right = stamps(60, 11_111_111, 1_000_000);
        right.remove(40);
        let (matched, dropped) = paired(&left, &right);
        let alone: Vec<usize> =
            matched.iter().enumerate().filter(|(_, m)| !m.1).map(|(i, _)| i).collect();
        assert_eq!(alone, [40]);
        assert_eq!(dropped.n_unpaired_frames, 1);
    }

    #[test]
    fn a_silent_camera_fills_no_memory_and_time_goes_on() {
        for silent in Camera::BOTH {
            let stream = stamps(1000, 11_111_111, 0);
            let (left, right) =
                if silent == Camera::Right { (stream, vec![]) } else { (vec![], stream) };
            let (matched, dropped) = paired(&left, &right);
            assert_eq!(matched.len(), left.len());
            let n_max = Settings::default().n_waiting_frames;
            let n_waiting_at_end = if silent == Camera::Left { n_max } else { 0 };
            assert_eq!(dropped.n_unpaired_frames as usize, 1000 - n_waiting_at_end);
        }
    }

    #[test]
    fn row_disparity_and_size_decide_and_all_that_pass_are_kept() {
        let rectification = Rectification::from_rig(&pretend::reference_rig());
        let ball = Some([4.0, 4.0, 12.0]);
        let rights = vec![
            spot(0, 220.0, 202.0, ball),
            spot(0, 219.0, 200.5, ball),
            spot(0, 220.0, 206.0, ball),
            spot(0, 520.0, 200.0, ball),
            spot(0, 410.0, 200.0, ball),
            spot(0, 220.0, 200.0, Some([20.0, 20.0, 300.0])),
        ];
        let left = RectifiedFrame { t_ns: 0, spots: vec![spot(0, 420.0, 200.0, ball)] };
        let right = RectifiedFrame { t_ns: 0, spots: rights };
        let settings = Settings::default();
        let mut dropped = Dropped::default();
        let pairs = from_rectified(&left, &right, &rectification, &settings, &mut dropped);
        let columns: Vec<f64> = pairs.iter().map(|pair| pair.right.pixel.x_px).collect();
        assert_eq!(columns, [219.0, 220.0], "best row first");
    }

    #[test]
    fn similarity_is_one_for_equals_and_symmetric() {
        let a = spot(0, 0.0, 0.0, Some([4.0, 5.0, 14.0]));
        let b = spot(0, 0.0, 0.0, Some([8.0, 5.0, 28.0]));
        assert_eq!(similarity(&a, &a), 1.0);
        assert_eq!(similarity(&a, &b), 3.0 / 9.0);
        assert_eq!(similarity(&a, &b), similarity(&b, &a));
    }
}

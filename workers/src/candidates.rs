//! Blobs → candidates: whole ones, of a size and shape a ball can have, largest first.

use crate::blobs::Blob;
use crate::method::Method;
use crate::response::{Response, Spot};
use crate::strip::{MAX_BALL_PX, Strip};
use shm_layout::{Candidate, MAX_CANDIDATES, StripCandidates};
use std::cmp::Ordering;

/// Longest box side over the shorter: a ball at 30 m/s across 2 ms of exposure is a streak of two
/// diameters, a line or a racket handle is longer.
const MAX_ASPECT: u32 = 4;

/// Nearer to the edge of the frame the filter's box reaches beyond it.
const EDGE_PX: u32 = 2;

/// The candidates of a strip. None are reported while the background `is_learning`.
#[must_use]
pub fn from_blobs(
    blobs: &[Blob],
    strip: Strip,
    method: &Method,
    is_learning: bool,
    response: Option<&Response>,
) -> StripCandidates {
    let mut message = StripCandidates {
        strip_idx: strip.idx(),
        n_strips: strip.n(),
        is_learning: u32::from(is_learning),
        ..StripCandidates::default()
    };
    if is_learning {
        return message;
    }
    let mut n = 0;
    let own = strip.own();
    let is_own = |blob: &&Blob| own.contains(&blob.y_min.midpoint(blob.y_max));
    let is_candidate = |blob: &&Blob| {
        blob.n_px >= method.min_area_px && is_ball_like(blob) && is_inside(blob, strip)
    };
    for blob in blobs.iter().filter(is_own).filter(is_candidate) {
        let candidate = match response {
            Some(response) => response.spot(blob).and_then(|spot| from_spot(&spot, method)),
            None => Some(from_blob(blob, method)),
        };
        let Some(candidate) = candidate else { continue };
        let kept = &mut message.candidates[..n];
        let rank = kept.partition_point(|other| by_worth(other, &candidate) == Ordering::Less);
        if n < MAX_CANDIDATES {
            n += 1;
        } else {
            message.n_dropped += 1;
        }
        if rank < n {
            message.candidates[rank..n].rotate_right(1);
            message.candidates[rank] = candidate;
        }
    }
    message.n_candidates = n as u32;
    message
}

/// Larger first; equal ones from the top left, so that the order never depends on strips.
pub(crate) fn by_worth(a: &Candidate, b: &Candidate) -> Ordering {
    b.area_px.total_cmp(&a.area_px).then(a.y_px.total_cmp(&b.y_px)).then(a.x_px.total_cmp(&b.x_px))
}

fn is_ball_like(blob: &Blob) -> bool {
    let (width_px, height_px) = box_of(blob);
    let (short_px, long_px) = (width_px.min(height_px), width_px.max(height_px));
    long_px <= MAX_BALL_PX && long_px <= MAX_ASPECT * short_px
}

/// A ball cut by the edge of the frame has its centre elsewhere; it pulls the start of a flight.
fn is_inside(blob: &Blob, strip: Strip) -> bool {
    blob.x_min >= EDGE_PX
        && blob.y_min >= EDGE_PX
        && blob.x_max + EDGE_PX < strip.width_px()
        && blob.y_max + EDGE_PX < strip.height_px()
}

fn from_blob(blob: &Blob, method: &Method) -> Candidate {
    let (width_px, height_px) = box_of(blob);
    let mean = |sum: u64| (sum as f64 / f64::from(blob.n_px)) as f32;
    Candidate {
        x_px: mean(blob.x_sum) - method.shift_px(),
        y_px: mean(blob.y_sum) - method.shift_px(),
        width_px: width_px as f32,
        height_px: height_px as f32,
        area_px: blob.n_px as f32,
    }
}

fn from_spot(spot: &Spot, method: &Method) -> Option<Candidate> {
    let [width_px, height_px] = spot.size_px.map(|side_px| side_px as f32);
    let [x_px, y_px] = spot.center_px;
    let area_px = spot.n_px as f32;
    (spot.n_px >= method.min_area_px).then_some(Candidate {
        x_px,
        y_px,
        width_px,
        height_px,
        area_px,
    })
}

fn box_of(blob: &Blob) -> (u32, u32) {
    (blob.x_max - blob.x_min + 1, blob.y_max - blob.y_min + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x_min: u32, y_min: u32, side_px: u32) -> Blob {
        let n_px = side_px * side_px;
        Blob {
            n_px,
            x_min,
            x_max: x_min + side_px - 1,
            y_min,
            y_max: y_min + side_px - 1,
            x_sum: u64::from(n_px) * u64::from(2 * x_min + side_px - 1) / 2,
            y_sum: u64::from(n_px) * u64::from(2 * y_min + side_px - 1) / 2,
        }
    }

    fn whole() -> Strip {
        Strip::new(0, 1, (640, 480))
    }

    #[test]
    fn size_and_shape_are_bounded() {
        let line = Blob { x_max: 100, n_px: 91, ..square(10, 10, 1) };
        let blobs = [square(5, 5, 1), square(20, 20, 3), square(100, 100, 65), line];
        let message = from_blobs(&blobs, whole(), &Method::TEST_5, false, None);
        assert_eq!(message.spots().len(), 1);
        let spot = message.spots()[0];
        assert_eq!((spot.x_px, spot.y_px, spot.area_px), (20.5, 20.5, 9.0));
    }

    #[test]
    fn what_the_edge_of_the_frame_cuts_is_not_reported() {
        let cut = [square(1, 50, 5), square(50, 1, 5), square(634, 50, 5), square(50, 474, 5)];
        assert_eq!(from_blobs(&cut, whole(), &Method::TEST_5, false, None).n_candidates, 0);
        let inside = [square(2, 2, 5), square(633, 473, 5)];
        assert_eq!(from_blobs(&inside, whole(), &Method::TEST_5, false, None).n_candidates, 2);
    }

    #[test]
    fn the_largest_are_kept_and_the_rest_are_counted() {
        let blobs: Vec<Blob> = (0..100)
            .map(|k| square((k % 10) * 60 + 5, (k / 10) * 40 + 5, 2 + (k * 7) % 30))
            .collect();
        let message = from_blobs(&blobs, whole(), &Method::TEST_5, false, None);
        assert_eq!((message.spots().len(), message.n_dropped), (MAX_CANDIDATES, 36));
        let mut areas: Vec<f32> = blobs.iter().map(|blob| blob.n_px as f32).collect();
        areas.sort_by(|a, b| b.total_cmp(a));
        let kept: Vec<f32> = message.spots().iter().map(|spot| spot.area_px).collect();
        assert_eq!(kept, areas[..MAX_CANDIDATES]);
    }

    #[test]
    fn nothing_is_reported_while_learning() {
        let message = from_blobs(&[square(20, 20, 5)], whole(), &Method::TEST_5, true, None);
        assert_eq!((message.n_candidates, message.is_learning), (0, 1));
    }
}

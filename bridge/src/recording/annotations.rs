//! Strips of one camera → a circle for each candidate, frame by frame, for viewers.
//!
//! Strips of several workers arrive out of order: a frame is drawn when it is whole, or when
//! [`MAX_WAITING`] later ones wait. A frame without candidates is drawn once after one with some,
//! for a viewer shows the last circles until others come.

use super::times::{Times, timestamp_from};
use foxglove::messages::{CircleAnnotation, Color, ImageAnnotations, Point2};
use shm_layout::{Candidate, MAX_STRIPS, StampNs, StripCandidates};
use std::collections::BTreeMap;

/// Most frames that wait for a strip.
pub const MAX_WAITING: usize = 8;

/// A ring stands this far off the ball, so that it stays visible.
const AROUND_PX: f64 = 6.0;

/// Of a candidate whose size is not known.
const UNKNOWN_DIAMETER_PX: f32 = 6.0;

const YELLOW: Color = Color { r: 1.0, g: 0.9, b: 0.0, a: 1.0 };

#[derive(Debug, Clone, Default)]
struct Waiting {
    strips_seen: u32,
    exposed_ns: StampNs,
    clock_sigma_ns: u32,
    spots: Vec<Candidate>,
}

/// The frames of one camera.
#[derive(Debug, Clone, Default)]
pub struct Annotations {
    recording_id: u64,
    waiting: BTreeMap<u64, Waiting>,
    is_drawn: bool,
}

impl Annotations {
    /// Takes a strip in; gives out the frames that are to be drawn, and when they were exposed.
    pub fn update(&mut self, strip: &StripCandidates, times: Times) -> Vec<ImageAnnotations> {
        if strip.strip_idx >= strip.n_strips || strip.n_strips > MAX_STRIPS {
            return Vec::new();
        }
        if strip.recording_id != self.recording_id {
            *self = Self { recording_id: strip.recording_id, ..Self::default() };
        }
        let frame = self.waiting.entry(strip.frame_idx).or_default();
        frame.strips_seen |= 1 << strip.strip_idx;
        (frame.exposed_ns, frame.clock_sigma_ns) = (strip.exposed_ns, strip.clock_sigma_ns);
        frame.spots.extend(strip.spots());
        let mut ready = Vec::new();
        if frame.strips_seen.count_ones() >= strip.n_strips {
            ready.extend(self.waiting.remove(&strip.frame_idx));
        } else if self.waiting.len() > MAX_WAITING {
            ready.extend(self.waiting.pop_first().map(|(_, frame)| frame));
        }
        ready.iter().filter_map(|frame| self.drawn(frame, times)).collect()
    }

    fn drawn(&mut self, frame: &Waiting, times: Times) -> Option<ImageAnnotations> {
        if frame.spots.is_empty() && !self.is_drawn {
            return None;
        }
        self.is_drawn = !frame.spots.is_empty();
        let day_ns = times.exposed_day_ns(frame.exposed_ns, frame.clock_sigma_ns);
        let timestamp = Some(timestamp_from(day_ns));
        let circle = |spot: &Candidate| CircleAnnotation {
            timestamp,
            position: Some(Point2 { x: f64::from(spot.x_px), y: f64::from(spot.y_px) }),
            diameter: f64::from(diameter_px(spot)) + 2.0 * AROUND_PX,
            thickness: 1.0,
            fill_color: None,
            outline_color: Some(YELLOW),
            metadata: Vec::new(),
        };
        let circles = frame.spots.iter().map(circle).collect();
        Some(ImageAnnotations { timestamp, circles, ..ImageAnnotations::default() })
    }
}

fn diameter_px(spot: &Candidate) -> f32 {
    [spot.diameter_px, spot.width_px]
        .into_iter()
        .find(|size_px| size_px.is_finite() && *size_px > 0.0)
        .unwrap_or(UNKNOWN_DIAMETER_PX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strip(frame_idx: u64, strip_idx: u32, n_strips: u32, xs_px: &[f32]) -> StripCandidates {
        let mut strip = StripCandidates { frame_idx, strip_idx, n_strips, ..Default::default() };
        strip.recording_id = 3;
        strip.n_candidates = xs_px.len() as u32;
        for (spot, x_px) in strip.candidates.iter_mut().zip(xs_px) {
            *spot = Candidate::at(*x_px, 7.0);
        }
        strip
    }

    fn counts(annotations: &mut Annotations, strip: &StripCandidates) -> Vec<usize> {
        let drawn = annotations.update(strip, Times { day_minus_stamp_ns: 0 });
        drawn.iter().map(|frame| frame.circles.len()).collect()
    }

    #[test]
    fn a_frame_is_drawn_when_all_its_strips_are_there() {
        let mut annotations = Annotations::default();
        assert!(counts(&mut annotations, &strip(0, 1, 2, &[1.0, 2.0])).is_empty());
        assert!(counts(&mut annotations, &strip(1, 1, 2, &[1.0])).is_empty());
        assert_eq!(counts(&mut annotations, &strip(0, 0, 2, &[3.0])), [3]);
        assert_eq!(counts(&mut annotations, &strip(1, 0, 2, &[])), [1]);
    }

    #[test]
    fn circles_vanish_once_with_the_candidates() {
        let mut annotations = Annotations::default();
        assert!(counts(&mut annotations, &strip(0, 0, 1, &[])).is_empty());
        assert_eq!(counts(&mut annotations, &strip(1, 0, 1, &[4.0])), [1]);
        assert_eq!(counts(&mut annotations, &strip(2, 0, 1, &[])), [0]);
        assert!(counts(&mut annotations, &strip(3, 0, 1, &[])).is_empty());
    }

    #[test]
    fn a_strip_that_never_comes_holds_up_eight_frames_at_most() {
        let mut annotations = Annotations::default();
        for frame_idx in 0..MAX_WAITING as u64 {
            assert!(counts(&mut annotations, &strip(frame_idx, 0, 2, &[1.0])).is_empty());
        }
        assert_eq!(counts(&mut annotations, &strip(8, 0, 2, &[1.0])), [1]);
        assert_eq!(annotations.waiting.len(), MAX_WAITING);
        assert_eq!(counts(&mut annotations, &strip(8, 1, 2, &[])), [1]);
    }

    #[test]
    fn numbers_that_cannot_be_are_left_out() {
        let mut annotations = Annotations::default();
        assert!(counts(&mut annotations, &strip(0, 40, 41, &[1.0])).is_empty());
        assert!(counts(&mut annotations, &strip(0, 2, 2, &[1.0])).is_empty());
    }
}

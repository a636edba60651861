//! A camera that is faster than it was asked to be → frames at the rate that was asked for.
//!
//! A sensor keeps to its frame duration, and its buffers must come back to it at once. libcamera's
//! virtual camera and some others fill a buffer whenever they get one: they are held back by giving
//! them buffers no sooner than frames are due. Which of the two a camera is, its first frames tell.

use shm_layout::StampNs;
use std::time::{Duration, Instant};

/// Intervals between first frames that are looked at.
pub const N_WATCHED: usize = 16;

/// A sensor's rate is within a row of what was asked; faster than this is not kept to it.
const FASTEST: f64 = 1.05;

/// Whether stamps of a camera that gets its buffers back at once show that it must be held back.
#[must_use]
pub fn is_too_fast(stamps_ns: &[StampNs], frame_rate_hz: f64) -> bool {
    let mut intervals_ns: Vec<i64> = stamps_ns.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals_ns.sort_unstable();
    let median_ns = intervals_ns.get(intervals_ns.len() / 2).copied().unwrap_or(i64::MAX);
    (median_ns as f64) * frame_rate_hz * FASTEST < 1e9
}

/// When the next buffer may be given to a camera that is held back.
#[derive(Debug)]
pub struct Steady {
    period: Duration,
    next_at: Instant,
}

impl Steady {
    /// The first buffer may be given at once.
    #[must_use]
    pub fn new(frame_rate_hz: f64) -> Self {
        Self { period: Duration::from_secs_f64(1.0 / frame_rate_hz), next_at: Instant::now() }
    }

    /// Whether one may be given now; if so, the next one a period later. What was missed by more
    /// than a period is not made up for: no burst.
    pub fn may_give(&mut self, now: Instant) -> bool {
        if now < self.next_at {
            return false;
        }
        self.next_at = (self.next_at + self.period).max(now);
        true
    }

    /// How long until one may be given.
    #[must_use]
    pub fn wait_from(&self, now: Instant) -> Duration {
        self.next_at.saturating_duration_since(now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_off_by_a_row_keeps_its_buffers_and_a_virtual_camera_does_not() {
        let every = |ns: i64| (0..17).map(|k| k * ns).collect::<Vec<_>>();
        assert!(!is_too_fast(&every(11_111_111), 90.0));
        assert!(!is_too_fast(&every(11_111_111 - 19_000), 90.0), "a row sooner");
        assert!(!is_too_fast(&every(33_333_333), 90.0), "slower is another matter");
        assert!(is_too_fast(&every(300_000), 90.0));
        assert!(is_too_fast(&every(8_333_333), 90.0), "120 frames/s");
        assert!(!is_too_fast(&[5], 90.0));
    }

    #[test]
    fn a_late_frame_does_not_make_the_next_ones_late_and_a_pause_makes_no_burst() {
        let mut steady = Steady::new(100.0);
        let begun = steady.next_at;
        let at = |ms: u64| begun + Duration::from_millis(ms);
        assert!(steady.may_give(at(0)));
        assert!(!steady.may_give(at(9)));
        assert!(steady.may_give(at(13)), "3 ms late");
        assert_eq!(steady.wait_from(at(13)), Duration::from_millis(7), "and on time again");
        assert!(steady.may_give(at(500)));
        assert!(steady.may_give(at(500)), "one that was due");
        assert!(!steady.may_give(at(509)), "and no others");
    }
}

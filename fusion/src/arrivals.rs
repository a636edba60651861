//! Frames of one camera, in order -> which ones never came.
//!
//! A camera numbers its frames, so a number that is left out is a frame that was lost: in its
//! board, or on the link and no longer to be had. When it was taken follows from the frames before
//! and after it. What a camera lost last is not known by a number: of one that was waited for in
//! vain it follows from its period.
//!
//! **Limit**: the last [`MAX_GAPS`] gaps are remembered.

use crate::motion::seconds_between;
use shm_layout::StampNs;
use std::collections::VecDeque;
use std::ops::RangeInclusive;

/// Most gaps remembered: 3 s in which every other frame of 180 a second is lost.
pub const MAX_GAPS: usize = 256;

/// A frame that came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Arrived {
    frame_idx: u64,
    t_ns: StampNs,
}

/// Two frames that came, and none between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Gap {
    before: Arrived,
    after: Arrived,
}

/// What came of one camera, and what did not.
#[derive(Debug, Clone, Default)]
pub struct Arrivals {
    last: Option<Arrived>,
    gaps: VecDeque<Gap>,
}

impl Arrivals {
    /// Takes note of a frame, later than the last.
    pub fn update(&mut self, frame_idx: u64, t_ns: StampNs) {
        let after = Arrived { frame_idx, t_ns };
        if let Some(before) = self.last.replace(after)
            && frame_idx > before.frame_idx.saturating_add(1)
        {
            if self.gaps.len() == MAX_GAPS {
                self.gaps.pop_front();
            }
            self.gaps.push_back(Gap { before, after });
        }
    }

    /// Stamp of the last frame that came.
    #[must_use]
    pub fn last_ns(&self) -> Option<StampNs> {
        self.last.map(|last| last.t_ns)
    }

    /// Numbers of the frames between two times that are known to be lost, as they were taken.
    pub fn lost(
        &self,
        [from_ns, to_ns]: [StampNs; 2],
    ) -> impl Iterator<Item = RangeInclusive<u64>> {
        self.gaps.iter().filter_map(move |gap| gap.within(from_ns, to_ns))
    }

    /// How many frames between two times are known to be lost.
    #[must_use]
    pub fn n_lost(&self, span_ns: [StampNs; 2]) -> u64 {
        self.lost(span_ns).fold(0, |n: u64, lost| n.saturating_add(1 + lost.end() - lost.start()))
    }

    /// How many frames, a period apart, should have come between two times since the last.
    #[must_use]
    pub fn n_missing(&self, [from_ns, to_ns]: [StampNs; 2], period_ns: StampNs) -> u64 {
        let Some(last) = self.last else { return 0 };
        let period_s = period_ns as f64 * 1e-9;
        let n_until = |t_ns| (seconds_between(last.t_ns, t_ns) / period_s).floor().max(0.0);
        (n_until(to_ns) - n_until(from_ns.saturating_sub(1))) as u64
    }
}

/// Numbers of the frames that were lost between two that came, each with its stamp, as far as they
/// were taken within a span.
#[must_use]
pub fn lost_between(
    ends: [(u64, StampNs); 2],
    [from_ns, to_ns]: [StampNs; 2],
) -> Option<RangeInclusive<u64>> {
    let [before, after] = ends.map(|(frame_idx, t_ns)| Arrived { frame_idx, t_ns });
    let is_gap = after.frame_idx > before.frame_idx.saturating_add(1);
    is_gap.then_some(Gap { before, after }).and_then(|gap| gap.within(from_ns, to_ns))
}

impl Gap {
    /// The lost frames that were taken within a span.
    fn within(&self, from_ns: StampNs, to_ns: StampNs) -> Option<RangeInclusive<u64>> {
        let n_steps = self.after.frame_idx - self.before.frame_idx;
        let step_s = seconds_between(self.before.t_ns, self.after.t_ns) / n_steps as f64;
        let steps_until = |t_ns| seconds_between(self.before.t_ns, t_ns) / step_s;
        // Casts of floats saturate, so that leaps of number or stamp are no harm.
        let first = (steps_until(from_ns).ceil() as u64).max(1);
        let last = (steps_until(to_ns).floor().max(0.0) as u64).min(n_steps - 1);
        let idx = |steps: u64| self.before.frame_idx + steps;
        (first <= last).then(|| idx(first)..=idx(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: StampNs = 10_000_000;

    /// Frames at their times, some of which did not come.
    fn arrived(n: u64, is_lost: impl Fn(u64) -> bool) -> Arrivals {
        let mut arrivals = Arrivals::default();
        for frame_idx in (0..n).filter(|&frame_idx| !is_lost(frame_idx)) {
            arrivals.update(frame_idx, frame_idx as StampNs * PERIOD_NS);
        }
        arrivals
    }

    fn span_ns(first: StampNs, last: StampNs) -> [StampNs; 2] {
        [first * PERIOD_NS, last * PERIOD_NS]
    }

    #[test]
    fn a_number_that_is_left_out_is_lost_when_its_frame_was_taken() {
        let arrivals = arrived(100, |idx| idx == 7 || (20..30).contains(&idx));
        let lost = |first, last| -> Vec<_> { arrivals.lost(span_ns(first, last)).collect() };
        assert_eq!(lost(0, 99), [7..=7, 20..=29]);
        assert_eq!(lost(7, 7), [7..=7]);
        assert_eq!(lost(8, 19), []);
        assert_eq!(lost(25, 26), [25..=26]);
        assert_eq!(lost(25, 90), [25..=29]);
        assert_eq!(arrivals.n_lost(span_ns(0, 99)), 11);
        assert_eq!(arrivals.n_lost(span_ns(29, 99)), 1);
        assert_eq!(arrived(100, |_| false).n_lost(span_ns(0, 99)), 0);
    }

    #[test]
    fn what_did_not_come_since_the_last_frame_follows_from_the_period() {
        let arrivals = arrived(51, |_| false);
        assert_eq!(arrivals.n_missing(span_ns(40, 60), PERIOD_NS), 10);
        assert_eq!(arrivals.n_missing(span_ns(56, 60), PERIOD_NS), 5);
        assert_eq!(arrivals.n_missing(span_ns(20, 50), PERIOD_NS), 0);
        assert_eq!(Arrivals::default().n_missing(span_ns(20, 50), PERIOD_NS), 0);
    }

    #[test]
    fn leaps_of_number_and_stamp_are_no_harm_and_gaps_have_a_limit() {
        let mut arrivals = Arrivals::default();
        for (idx, t_ns) in [(0, StampNs::MIN), (1 << 60, 0), (u64::MAX, StampNs::MAX)] {
            arrivals.update(idx, t_ns);
        }
        assert!(arrivals.n_lost([StampNs::MIN, StampNs::MAX]) > 1 << 60);
        for idx in 0..10_000 {
            arrivals.update(2 * idx, 2 * idx as StampNs);
        }
        assert_eq!(arrivals.gaps.len(), MAX_GAPS);
    }
}

//! Frame numbers -> when both cameras truly expose, and what their stamps say.
//!
//! The left camera's clock is that of the truth. The right one's is ahead by an offset that grows:
//!
//!   stamp_right = (1 + drift) t + offset
//!
//! A phase is no such thing: the right camera really exposes later, and its stamps say so. `fusion`
//! is told neither.

use rand::{Rng, RngExt};

use crate::camera::Side;

/// What clocks of a stream are drawn from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockRanges {
    /// Frames a second, left and right.
    pub rates_hz: [f64; 2],
    /// True when the cameras know nothing of each other: any phase is as likely.
    pub is_free_running: bool,
    /// The right clock is ahead or behind by up to this.
    pub offset_max_s: f64,
    /// The right clock is faster or slower by up to this, in parts per million.
    pub drift_max_ppm: f64,
}

impl ClockRanges {
    /// Both cameras expose at the same instants, and say so.
    pub const TOGETHER: Self = Self {
        rates_hz: [90.0, 90.0],
        is_free_running: false,
        offset_max_s: 0.0,
        drift_max_ppm: 0.0,
    };

    /// Cameras at 90 Hz that know nothing of each other, with clocks that differ by up to this.
    pub const fn free(offset_max_s: f64) -> Self {
        Self { is_free_running: true, offset_max_s, ..Self::TOGETHER }
    }
}

/// The clocks of a stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clocks {
    /// Frames a second, left and right.
    pub rates_hz: [f64; 2],
    /// How much later than the left camera's first frame the right one's is.
    pub right_phase_s: f64,
    /// How far the right clock is ahead at time 0.
    pub right_offset_s: f64,
    /// How much faster it runs: 1e-6 is a part per million.
    pub right_drift: f64,
}

impl Clocks {
    /// Draws clocks; always as many numbers, whatever the ranges are.
    pub fn drawn(rng: &mut impl Rng, ranges: &ClockRanges) -> Self {
        let phase = rng.random_range(0.0..1.0);
        let [offset, drift] = [(); 2].map(|()| rng.random_range(-1.0..=1.0));
        let phase_s = phase / ranges.rates_hz[1];
        Self {
            rates_hz: ranges.rates_hz,
            right_phase_s: if ranges.is_free_running { phase_s } else { 0.0 },
            right_offset_s: offset * ranges.offset_max_s,
            right_drift: drift * ranges.drift_max_ppm * 1e-6,
        }
    }

    /// When a camera's frame is truly exposed: the middle of its first row's exposure.
    pub fn exposed_at_s(&self, side: Side, frame_idx: u64) -> f64 {
        match side {
            Side::Left => frame_idx as f64 / self.rates_hz[0],
            Side::Right => frame_idx as f64 / self.rates_hz[1] + self.right_phase_s,
        }
    }

    /// The stamp of that frame.
    pub fn stamp_ns(&self, side: Side, frame_idx: u64) -> i64 {
        let at_s = self.exposed_at_s(side, frame_idx);
        let ahead_s = match side {
            Side::Left => 0.0,
            Side::Right => self.right_minus_left_s(at_s),
        };
        ((at_s + ahead_s) * 1e9).round() as i64
    }

    /// What the right clock shows less what the left one does, at a time.
    pub fn right_minus_left_s(&self, at_s: f64) -> f64 {
        self.right_offset_s + self.right_drift * at_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_offset_moves_stamps_and_the_phase_moves_exposures() {
        let clocks = Clocks {
            rates_hz: [90.0, 60.0],
            right_phase_s: 0.004,
            right_offset_s: -0.002,
            right_drift: 100e-6,
        };
        assert!((clocks.exposed_at_s(Side::Left, 90) - 1.0).abs() < 1e-12);
        assert_eq!(clocks.stamp_ns(Side::Left, 90), 1_000_000_000);
        assert!((clocks.exposed_at_s(Side::Right, 60) - 1.004).abs() < 1e-12);
        // 1.004 s, less 2 ms, and 100.4 us of drift.
        assert_eq!(clocks.stamp_ns(Side::Right, 60), 1_002_100_400);
    }
}

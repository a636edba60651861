//! Which rows of a frame are a worker's own, and which it must see besides.
//!
//! ```text
//!   own.start - HALO_PX ┄┄┄┄┄┄┄┄┄┄┄┄┄┄┄┐
//!   own.start           ─────────────┐ │ seen: blobs are joined here
//!                        own rows    │ │
//!   own.end             ─────────────┘ │
//!   own.end + HALO_PX   ┄┄┄┄┄┄┄┄┄┄┄┄┄┄┄┘
//! ```
//!
//! A blob belongs to the strip that holds the middle row of its box. A blob of a possible height
//! whose middle row is in the strip ends inside the halo with a row to spare, so it is seen whole.
//! A blob cut by the edge of the halo reaches to that edge, so its middle lies outside the own rows
//! unless it is higher than any ball. Hence strips agree with a single worker, bit for bit.

use crate::method::REACH_PX;
use std::ops::Range;

/// Tallest and widest box of a ball: at 1240 px focal length 6.6 cm are 64 px at 1.3 m.
pub const MAX_BALL_PX: u32 = 64;

/// Two spots whose middles are nearer than this are one ball seen twice.
pub const DUPLICATE_PX: u32 = 4;

/// Rows seen beyond the own ones, so that the tallest ball ends one row before the edge, and so
/// does the one it might be a duplicate of.
pub const HALO_PX: u32 = MAX_BALL_PX / 2 + 1 + DUPLICATE_PX;

/// Side of the squares in which clutter is counted. A strip looks at whole ones.
pub const BLOCK_PX: u32 = 16;

/// One of the strips that share a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Strip {
    idx: u32,
    n: u32,
    width_px: u32,
    height_px: u32,
}

impl Strip {
    /// Strip `idx` of `n`, from the top, of frames of this size.
    ///
    /// # Panics
    /// When there is no such strip, or the frame has no pixels.
    #[must_use]
    pub fn new(idx: u32, n: u32, (width_px, height_px): (u32, u32)) -> Self {
        assert!(idx < n && width_px > 0 && height_px > 0, "checked where flags and frames come in");
        Self { idx, n, width_px, height_px }
    }

    /// Which strip, from the top.
    #[must_use]
    pub fn idx(self) -> u32 {
        self.idx
    }

    /// How many strips share a frame.
    #[must_use]
    pub fn n(self) -> u32 {
        self.n
    }

    /// Width of the frame.
    #[must_use]
    pub fn width_px(self) -> u32 {
        self.width_px
    }

    /// Height of the frame.
    #[must_use]
    pub fn height_px(self) -> u32 {
        self.height_px
    }

    /// The rows this worker answers for.
    #[must_use]
    pub fn own(self) -> Range<u32> {
        let edge =
            |idx: u32| (u64::from(self.height_px) * u64::from(idx) / u64::from(self.n)) as u32;
        edge(self.idx)..edge(self.idx + 1)
    }

    /// The rows blobs are joined in: the own ones and the halo.
    #[must_use]
    pub fn seen(self) -> Range<u32> {
        self.grown_by(HALO_PX)
    }

    /// The rows that are searched: those seen and what the filter needs around them, to whole
    /// blocks of the frame.
    #[must_use]
    pub fn tested(self) -> Range<u32> {
        let rows = self.grown_by(HALO_PX + REACH_PX);
        let end = rows.end.next_multiple_of(BLOCK_PX).min(self.height_px);
        rows.start / BLOCK_PX * BLOCK_PX..end
    }

    /// The rows whose background is kept: one more on either side.
    #[must_use]
    pub fn learned(self) -> Range<u32> {
        let rows = self.tested();
        rows.start.saturating_sub(1)..(rows.end + 1).min(self.height_px)
    }

    fn grown_by(self, rows_px: u32) -> Range<u32> {
        let own = self.own();
        own.start.saturating_sub(rows_px)..(own.end + rows_px).min(self.height_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_own_rows_of_all_strips_are_the_frame_without_overlap() {
        for n in 1..=8 {
            for height_px in [8, 33, 480, 481, 1088] {
                let rows: Vec<u32> =
                    (0..n).flat_map(|idx| Strip::new(idx, n, (10, height_px)).own()).collect();
                assert_eq!(rows, (0..height_px).collect::<Vec<_>>(), "{n} strips of {height_px}");
            }
        }
    }

    #[test]
    fn the_tallest_ball_in_the_own_rows_ends_before_the_edge_of_what_is_seen() {
        let strip = Strip::new(1, 3, (640, 480));
        for middle in strip.own() {
            let highest = middle - MAX_BALL_PX / 2;
            let lowest = middle + MAX_BALL_PX / 2;
            assert!(strip.seen().start < highest && lowest < strip.seen().end);
        }
    }
}

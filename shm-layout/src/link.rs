//! Link: what a bridge knows of the way between a board and fusion, for whoever shows or keeps it.
//!
//! Beside fusion the bridge there says all of it. On the board itself its bridge says what it
//! knows: whether fusion is heard, how much it has sent, and the clock's sigma, which comes with
//! every ping; the rest is 0.

use crate::StampNs;
use iceoryx2::prelude::ZeroCopySend;

/// The state of one board's link; all counts since the bridge that says it started.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("tennis/Link/1")]
pub struct Link {
    /// When this was so.
    pub noted_ns: StampNs,
    /// How far the board's clock is ahead of this machine's.
    pub board_minus_here_ns: i64,
    /// The least round trip seen lately.
    pub round_trip_ns: i64,
    /// How much faster the board's clock runs than this machine's: 1e-6 is a microsecond a second.
    pub rate: f64,
    /// Batches that arrived; on the board: that were sent.
    pub n_batches: u64,
    /// Those of them that had to be asked for.
    pub n_filled: u64,
    /// Batches that can no longer be had; on the board 0: it does not know what was not heard.
    pub n_lost: u64,
    /// Payloads of its keys that were no message of ours.
    pub n_refused: u64,
    /// 1 sigma of `board_minus_here_ns`; [`crate::stamp::OWN_CLOCK`] while nothing is known.
    pub clock_sigma_ns: u32,
    /// [`crate::Camera::idx`] of the board.
    pub camera_idx: u32,
    /// 1 while the other bridge is heard and speaks our version.
    pub is_alive: u32,
    /// Keeps the size a multiple of eight; always 0.
    pub reserved: u32,
}

const _: () = assert!(size_of::<Link>() == 80, "no padding may hide in a shared type");

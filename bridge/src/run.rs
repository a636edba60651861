//! The number of a run of a board's bridge: which board, and which of its runs.
//!
//! A bridge that was killed is started again within milliseconds. The far end must not take it for
//! a second board that claims the same camera (which is not heard while the first one is): runs
//! with the same upper half are of one board since it was started, so its clock is the same, too;
//! and of those the one with the greater lower half began later, so it takes over at once.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::os::unix::fs::MetadataExt as _;

/// Runs begin at least this far apart: 497 days of them fit 32 bits.
const STEP_NS: i64 = 10_000_000;

/// The number of a run that begins now.
#[must_use]
pub fn id_now() -> u64 {
    // A board is where processes meet and have one clock: containers of one kernel have a /dev/shm
    // each, and may have a clock each.
    let boot = std::fs::read("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    let memory = std::fs::metadata("/dev/shm").map_or(0, |folder| folder.dev());
    let clock = std::fs::read_link("/proc/self/ns/time").unwrap_or_default();
    let mut hasher = DefaultHasher::new();
    (boot, memory, clock).hash(&mut hasher);
    let began = shm_layout::stamp::now_ns() / STEP_NS;
    u64::from(hasher.finish() as u32) << 32 | u64::from(began as u32)
}

/// Whether two runs are of the same board since it was started.
#[must_use]
pub const fn is_same_board(a_id: u64, b_id: u64) -> bool {
    a_id >> 32 == b_id >> 32
}

/// Whether the run `id` takes over from the run `before_id` of the same board.
#[must_use]
pub const fn is_next_of(id: u64, before_id: u64) -> bool {
    is_same_board(id, before_id) && id > before_id
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_later_run_of_this_board_takes_over_and_no_other_does() {
        let first = id_now();
        assert!(is_same_board(first, id_now()));
        assert!(is_next_of(first + 1, first) && !is_next_of(first, first + 1));
        assert!(!is_next_of(first, first));
        assert!(!is_next_of(first + (1 << 32) + 1, first), "another board");
    }
}

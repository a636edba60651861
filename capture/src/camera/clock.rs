//! A camera's stamp → this machine's clock (CLOCK_BOOTTIME, as all stamps of a board are).
//!
//! libcamera says BOOTTIME and V4L2 MONOTONIC, but drivers stamp with MONOTONIC whatever libcamera
//! says. The two differ by how long the machine slept (never on a Pi), or between time namespaces.
//! A frame was exposed shortly before it arrived, which tells the two apart.

use rustix::time::{ClockId, clock_gettime};
use shm_layout::StampNs;
use shm_layout::stamp::now_ns;

/// A frame is older than this when it is handed out only if the machine is badly overloaded.
const OLDEST_NS: i64 = 2_000_000_000;

/// Stamps come from another reading of the same clock: they may be this much ahead.
const AHEAD_NS: i64 = 1_000_000;

/// The stamp on CLOCK_BOOTTIME; `None` if it is on neither clock.
#[must_use]
pub fn onto_our_clock(stamp_ns: i64) -> Option<StampNs> {
    let monotonic = clock_gettime(ClockId::Monotonic);
    let monotonic_ns = monotonic.tv_sec * 1_000_000_000 + monotonic.tv_nsec;
    translated(stamp_ns, now_ns(), monotonic_ns)
}

fn translated(stamp_ns: i64, boot_ns: i64, monotonic_ns: i64) -> Option<StampNs> {
    let is_recent = |now_ns: i64| (-AHEAD_NS..OLDEST_NS).contains(&now_ns.saturating_sub(stamp_ns));
    if is_recent(boot_ns) {
        Some(stamp_ns)
    } else if is_recent(monotonic_ns) {
        Some(stamp_ns + (boot_ns - monotonic_ns))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_of_both_clocks_come_out_on_one() {
        let (boot_ns, monotonic_ns) = (90_000_000_000, 50_000_000_000);
        assert_eq!(translated(89_990_000_000, boot_ns, monotonic_ns), Some(89_990_000_000));
        assert_eq!(translated(49_990_000_000, boot_ns, monotonic_ns), Some(89_990_000_000));
        for on_none in [0, 60_000_000_000, 91_000_000_000, i64::MIN, i64::MAX] {
            assert_eq!(translated(on_none, boot_ns, monotonic_ns), None, "{on_none}");
        }
        let now = now_ns();
        assert_eq!(onto_our_clock(now), Some(now));
    }
}

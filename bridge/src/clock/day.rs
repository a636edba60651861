//! Clocks of the day that something else keeps together → how far a board's clock is ahead.
//!
//! PTP with hardware stamps keeps machines within a microsecond, chrony in a LAN within some tens
//! (30, measured by others; a Pi 4 has no hardware stamps, a CM4, CM5 and Pi 5 have). Both steer
//! the clock of the day, not that of stamps, which is never set; but how far the one is ahead of
//! the other changes only when a clock is set, so each machine reads it off, and the difference of
//! both is how far the board's stamps are ahead.
//!
//! Whether something steers the clocks, and how well, no machine knows of the other, and the kernel
//! not even of itself (its error bound is 0 where `phc2sys` or `systemd-timesyncd` left it so). The
//! operator says it; and messages tell whether that can be: an hour's difference is no microsecond.

use super::Estimate;
use shm_layout::stamp::now_ns;
use std::time::{SystemTime, UNIX_EPOCH};

/// Readings of both clocks, of which the one with the shortest pause between counts.
const N_READINGS: usize = 3;

/// Further apart than so many sigmas of what is said and of what messages tell is not together.
const APART_SIGMAS: f64 = 5.0;

/// How far this machine's clock of the day is ahead of that of stamps.
#[must_use]
pub fn day_minus_stamp_ns() -> i64 {
    let readings = (0..N_READINGS).map(|_| {
        let before_ns = now_ns();
        let day = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let pause_ns = now_ns() - before_ns;
        let day_ns = i64::try_from(day.as_nanos()).unwrap_or(i64::MAX);
        (pause_ns, day_ns.saturating_sub(before_ns + pause_ns / 2))
    });
    readings.min().map_or(0, |(_, ahead_ns)| ahead_ns)
}

/// What was said of the clocks of the day, and whether it was so.
#[derive(Debug)]
pub(super) struct Synced {
    sigma_ns: f64,
    /// How far they are apart, since it was seen that they are.
    apart_ns: Option<i64>,
    is_told: bool,
}

impl Synced {
    pub fn new(sigma_ns: f64) -> Self {
        Self { sigma_ns, apart_ns: None, is_told: false }
    }

    /// As it was said.
    pub fn sigma_ns(&self) -> f64 {
        self.sigma_ns
    }

    /// The estimate by clocks of the day, if it can be true and is better than by messages.
    pub fn better(&mut self, by_messages: &Estimate, ahead_by_day_ns: i64) -> Option<Estimate> {
        // A board that is further ahead by messages than by day has its clock of the day ahead.
        let apart_ns = by_messages.board_minus_here_ns.saturating_sub(ahead_by_day_ns);
        let limit_ns = APART_SIGMAS * self.sigma_ns.hypot(by_messages.sigma_ns);
        if apart_ns.unsigned_abs() as f64 > limit_ns {
            self.apart_ns = Some(apart_ns);
            return None;
        }
        (self.apart_ns, self.is_told) = (None, false);
        (self.sigma_ns < by_messages.sigma_ns).then_some(Estimate {
            board_minus_here_ns: ahead_by_day_ns,
            // Steered clocks run at one rate.
            rate: 0.0,
            sigma_ns: self.sigma_ns,
            ..*by_messages
        })
    }

    /// Said once, until they have been together again.
    pub fn newly_apart_ns(&mut self) -> Option<i64> {
        let apart_ns = self.apart_ns.filter(|_| !self.is_told)?;
        self.is_told = true;
        Some(apart_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AHEAD_NS: i64 = 5_000_000_000_000;

    fn by_messages() -> Estimate {
        Estimate {
            at_ns: 7,
            board_minus_here_ns: AHEAD_NS + 150_000,
            rate: 3e-6,
            sigma_ns: 200_000.0,
            round_trip_ns: 4_000_000,
        }
    }

    #[test]
    fn the_better_of_both_is_used() {
        let found = Synced::new(30_000.0).better(&by_messages(), AHEAD_NS).unwrap();
        assert_eq!((found.board_minus_here_ns, found.sigma_ns), (AHEAD_NS, 30_000.0));
        assert_eq!((found.at_ns, found.round_trip_ns), (7, 4_000_000));
        assert_eq!(found.here_from_board(AHEAD_NS + 1_000_000_000), 1_000_000_000);
        assert_eq!(Synced::new(300_000.0).better(&by_messages(), AHEAD_NS), None, "it is worse");
    }

    #[test]
    fn clocks_that_are_not_together_are_not_used_and_it_is_said_once() {
        let mut synced = Synced::new(1_000.0);
        let hour_ns = 3_600_000_000_000;
        let day_ahead_ns = AHEAD_NS - hour_ns;
        for _ in 0..3 {
            assert_eq!(synced.better(&by_messages(), day_ahead_ns), None);
        }
        assert_eq!(synced.newly_apart_ns(), Some(hour_ns + 150_000));
        assert_eq!(synced.newly_apart_ns(), None);
        assert!(synced.better(&by_messages(), AHEAD_NS).is_some(), "they are set right");
        assert_eq!(synced.better(&by_messages(), i64::MIN), None);
        assert!(synced.newly_apart_ns().is_some(), "said anew");
    }

    #[test]
    fn both_clocks_of_this_machine_are_read_within_microseconds() {
        let [first, second] = [day_minus_stamp_ns(), day_minus_stamp_ns()];
        assert!(first > 0, "it is later than 1970: {first}");
        // Steered by at most 500 ppm; three readings in a row that are interrupted are rare.
        assert!((first - second).abs() < 1_000_000, "{first} {second}");
    }
}

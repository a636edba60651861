//! Stamps → the time of day in a file.
//!
//! Stamps count since the machine was started; viewers expect the time of day. The difference is
//! taken once, when a recording begins, so that times in a file never leap.

use crate::clock;
use foxglove::messages::Timestamp;
use shm_layout::StampNs;
use shm_layout::stamp::OWN_CLOCK;

/// How the clock of stamps and the time of day differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// Time of day, nanoseconds since 1970, less a stamp.
    pub day_minus_stamp_ns: i64,
}

impl Times {
    /// As they differ now.
    #[must_use]
    pub fn of_now() -> Self {
        Self { day_minus_stamp_ns: clock::day_minus_stamp_ns() }
    }

    /// The time of day of a stamp; nothing is before 1970.
    #[must_use]
    pub fn day_ns(self, stamp_ns: StampNs) -> u64 {
        stamp_ns.saturating_add(self.day_minus_stamp_ns).max(0).unsigned_abs()
    }

    /// The time of day of an exposure; as it is, if its clock is no machine's.
    #[must_use]
    pub fn exposed_day_ns(self, exposed_ns: StampNs, clock_sigma_ns: u32) -> u64 {
        match clock_sigma_ns {
            OWN_CLOCK => exposed_ns.max(0).unsigned_abs(),
            _ => self.day_ns(exposed_ns),
        }
    }
}

/// As messages for viewers carry it.
#[must_use]
pub fn timestamp_from(day_ns: u64) -> Timestamp {
    let seconds = u32::try_from(day_ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (day_ns % 1_000_000_000) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_layout::stamp::now_ns;

    #[test]
    fn machines_stamps_become_times_of_day_and_others_stay() {
        let times = Times { day_minus_stamp_ns: 1_000 };
        assert_eq!(times.day_ns(5), 1_005);
        assert_eq!(times.exposed_day_ns(5, 70), 1_005);
        assert_eq!(times.exposed_day_ns(5, OWN_CLOCK), 5);
        assert_eq!(times.exposed_day_ns(StampNs::MIN, OWN_CLOCK), 0);
        assert_eq!(times.day_ns(StampNs::MIN), 0);
        assert_eq!(times.day_ns(StampNs::MAX), StampNs::MAX.unsigned_abs());
        assert!(Times::of_now().day_ns(now_ns()) > 1_500_000_000_000_000_000, "it is after 2017");
    }

    #[test]
    fn a_time_keeps_its_nanoseconds() {
        let time = timestamp_from(12_000_000_034);
        assert_eq!((time.sec(), time.nsec()), (12, 34));
        assert_eq!(timestamp_from(u64::MAX).sec(), u32::MAX);
    }
}

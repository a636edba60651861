//! How long a process lived → how long its next start waits.
//!
//! At once the first time: most deaths are accidents, and frames are missing. One that dies again
//! right away waits for twice as long each time, for what is wrong will not be right sooner.

use std::time::Duration;

/// The second start in a row waits so long. Frames are missed for less than a second even if five
/// accidents follow each other within seconds.
const FIRST: Duration = Duration::from_millis(100);

/// Longest wait: a camera that is plugged in is found within it.
pub const LONGEST: Duration = Duration::from_secs(4);

/// A process that lived so long was well: its death is an accident again.
pub const HEALTHY: Duration = Duration::from_secs(1);

/// The waits of one process.
#[derive(Debug, Clone, Copy, Default)]
pub struct BackOff {
    next: Duration,
}

impl BackOff {
    /// The wait before the next start of a process that has lived for so long.
    pub fn update(&mut self, lived: Duration) -> Duration {
        let wait = if lived >= HEALTHY { Duration::ZERO } else { self.next };
        self.next = (wait * 2).clamp(FIRST, LONGEST);
        wait
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_once_then_doubling_to_a_limit_and_at_once_again_after_a_healthy_while() {
        let mut back_off = BackOff::default();
        let mut wait_ms = |lived_ms| back_off.update(Duration::from_millis(lived_ms)).as_millis();
        let waits: Vec<u128> = (0..8).map(|_| wait_ms(30)).collect();
        assert_eq!(waits, [0, 100, 200, 400, 800, 1600, 3200, 4000]);
        assert_eq!([wait_ms(1000), wait_ms(999), wait_ms(30)], [0, 100, 200]);
    }
}

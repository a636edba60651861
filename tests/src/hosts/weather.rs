//! A frame and the moment it is sent → when it leaves for the other hosts, if ever.
//!
//! As `tc netem` does it: a frame may be lost; it waits for the frames before it on a line of so
//! many bits a second; then it is held for a delay that is uniform in `delay ± jitter`. While
//! `overtaking` is on, every frame has a delay of its own and so passes slower ones (netem without
//! a rate does the same); else none leaves before the one sent before it. At most `max_frames` are
//! on their way, a further one is dropped. Numbers come from a seed. No clock in here.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt;
use std::time::Duration;

/// How bad a host's way out is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weather {
    /// Mean time a frame is held.
    pub delay: Duration,
    /// It is held this much shorter or longer, uniformly.
    pub jitter: Duration,
    /// Share of frames that are lost, 0 to 1.
    pub loss: f64,
    /// Whether frames may pass others.
    pub overtaking: bool,
    /// Bits a second; `None` for no limit.
    pub rate_bit_s: Option<u64>,
    /// Most frames on their way.
    pub max_frames: usize,
}

impl Weather {
    /// Nothing is held or lost.
    pub const FAIR: Self = Self {
        delay: Duration::ZERO,
        jitter: Duration::ZERO,
        loss: 0.0,
        overtaking: false,
        rate_bit_s: None,
        max_frames: 1000, // netem's default
    };

    /// The Wi-Fi that must be stood: 5 ms ± 3 ms, 2 % lost, overtaking, 20 Mbit/s.
    pub const WIFI: Self = Self {
        delay: Duration::from_millis(5),
        jitter: Duration::from_millis(3),
        loss: 0.02,
        overtaking: true,
        rate_bit_s: Some(20_000_000),
        max_frames: 1000,
    };

    /// The words for `tc qdisc add dev X root netem`. With a rate netem keeps the order, so
    /// overtaking is asked for by its own word: a quarter of the frames are not held.
    #[must_use]
    pub fn netem_arguments(&self) -> Vec<String> {
        let us = |time: Duration| format!("{}us", time.as_micros());
        let mut words = vec!["limit".to_owned(), self.max_frames.to_string()];
        words.extend(["delay".to_owned(), us(self.delay), us(self.jitter)]);
        words.extend(["loss".to_owned(), format!("{:.4}%", self.loss * 100.0)]);
        if self.overtaking && !self.delay.is_zero() {
            words.extend(["reorder", "25%"].map(str::to_owned));
        }
        // In order means with a rate: a hundred gigabits hold nothing up.
        let rate_bit_s = self.rate_bit_s.or((!self.overtaking).then_some(100_000_000_000));
        if let Some(rate_bit_s) = rate_bit_s {
            words.extend(["rate".to_owned(), format!("{rate_bit_s}bit")]);
        }
        words
    }
}

impl fmt::Display for Weather {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} ± {:?}, {:.1} % lost", self.delay, self.jitter, self.loss * 100.0)?;
        if self.overtaking {
            write!(f, ", overtaking")?;
        }
        match self.rate_bit_s {
            Some(rate_bit_s) => write!(f, ", {} Mbit/s", rate_bit_s as f64 / 1e6),
            None => Ok(()),
        }
    }
}

/// What became of a host's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Sent by the host.
    pub n_sent: u64,
    /// Lost, as asked.
    pub n_lost: u64,
    /// Dropped because too many were on their way.
    pub n_overflowed: u64,
    /// Dropped because the sender or the receiver was cut off.
    pub n_cut: u64,
}

/// One host's way out.
#[derive(Debug)]
pub struct WayOut {
    weather: Weather,
    rng: ChaCha8Rng,
    /// When the line is free again.
    free_ns: u64,
    /// When the latest frame so far leaves.
    last_ns: u64,
}

/// What becomes of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It leaves at this time.
    LeavesAt(u64),
    /// It is lost, as asked.
    Lost,
    /// There is no room for it.
    Overflows,
}

impl WayOut {
    /// A way out whose numbers come from this seed.
    #[must_use]
    pub fn new(weather: Weather, seed: u64) -> Self {
        Self { weather, rng: ChaCha8Rng::seed_from_u64(seed), free_ns: 0, last_ns: 0 }
    }

    /// The weather changes for frames that are sent from now on.
    pub fn change(&mut self, weather: Weather) {
        self.weather = weather;
    }

    /// Decides on a frame of `n_bytes` sent at `now_ns` while `n_frames` are on their way.
    pub fn send(&mut self, now_ns: u64, n_bytes: usize, n_frames: usize) -> Fate {
        let weather = &self.weather;
        if weather.loss > 0.0 && self.rng.random_bool(weather.loss) {
            return Fate::Lost;
        }
        if n_frames >= weather.max_frames {
            return Fate::Overflows;
        }
        let mut leaves_ns = now_ns;
        if let Some(rate_bit_s) = weather.rate_bit_s {
            let on_line_ns = (n_bytes as u64 * 8).saturating_mul(1_000_000_000) / rate_bit_s.max(1);
            self.free_ns = self.free_ns.max(now_ns) + on_line_ns;
            leaves_ns = self.free_ns;
        }
        let (delay_ns, jitter_ns) = (ns_of(weather.delay), ns_of(weather.jitter));
        let shortest_ns = delay_ns.saturating_sub(jitter_ns);
        leaves_ns += self.rng.random_range(shortest_ns..=delay_ns + jitter_ns);
        if !weather.overtaking {
            leaves_ns = leaves_ns.max(self.last_ns);
            self.last_ns = leaves_ns;
        }
        Fate::LeavesAt(leaves_ns)
    }
}

fn ns_of(time: Duration) -> u64 {
    time.as_nanos().try_into().unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn leaving(weather: Weather, n: u64, every_ns: u64) -> Vec<(u64, Fate)> {
        let mut way_out = WayOut::new(weather, 7);
        (0..n).map(|i| (i * every_ns, way_out.send(i * every_ns, 500, 0))).collect()
    }

    fn held_ns(fates: &[(u64, Fate)]) -> Vec<u64> {
        let held = |&(sent_ns, fate): &(u64, Fate)| match fate {
            Fate::LeavesAt(at_ns) => Some(at_ns - sent_ns),
            Fate::Lost | Fate::Overflows => None,
        };
        fates.iter().filter_map(held).collect()
    }

    #[test]
    fn in_fair_weather_every_frame_leaves_at_once() {
        assert_eq!(held_ns(&leaving(Weather::FAIR, 100, MS)), vec![0; 100]);
    }

    #[test]
    fn frames_are_held_uniformly_and_lost_as_often_as_asked() {
        let weather = Weather { rate_bit_s: None, ..Weather::WIFI };
        let mut held_ns = held_ns(&leaving(weather, 20_000, MS));
        let lost = 1.0 - held_ns.len() as f64 / 20_000.0;
        // Three sigma of 20000 draws: sqrt(0.02 * 0.98 / 20000) = 0.001 each.
        assert!((lost - 0.02).abs() < 0.003, "{lost}");
        held_ns.sort_unstable();
        let at = |share: f64| held_ns[(share * held_ns.len() as f64) as usize] as f64 / MS as f64;
        assert!(at(0.0) >= 2.0 && at(0.9999) <= 8.0, "{} to {}", at(0.0), at(0.9999));
        for (share, expected_ms) in [(0.1, 2.6), (0.5, 5.0), (0.9, 7.4)] {
            assert!((at(share) - expected_ms).abs() < 0.1, "{share}: {}", at(share));
        }
    }

    #[test]
    fn frames_pass_others_only_when_they_may() {
        for overtaking in [true, false] {
            let weather = Weather { overtaking, loss: 0.0, ..Weather::WIFI };
            let fates = leaving(weather, 1000, MS);
            let leaves: Vec<u64> =
                held_ns(&fates).iter().zip(&fates).map(|(held, (sent, _))| sent + held).collect();
            let n_passed = leaves.windows(2).filter(|pair| pair[1] < pair[0]).count();
            assert_eq!(n_passed > 100, overtaking, "{n_passed} of 999 pass");
            assert_eq!(n_passed == 0, !overtaking, "{n_passed} of 999 pass");
        }
    }

    #[test]
    fn a_line_of_20_mbit_s_passes_5000_frames_of_500_bytes_a_second() {
        let weather = Weather { rate_bit_s: Some(20_000_000), ..Weather::FAIR };
        let fates = leaving(weather, 1000, 0);
        assert_eq!(fates[999].1, Fate::LeavesAt(200 * MS));
        // An idle line owes nothing for the time it was idle.
        assert_eq!(held_ns(&leaving(weather, 10, MS)), vec![200_000; 10]);
    }

    #[test]
    fn a_frame_too_many_overflows() {
        let mut way_out = WayOut::new(Weather::FAIR, 1);
        assert_eq!(way_out.send(0, 500, 999), Fate::LeavesAt(0));
        assert_eq!(way_out.send(0, 500, 1000), Fate::Overflows);
    }

    #[test]
    fn netem_is_told_the_same() {
        assert_eq!(
            Weather::WIFI.netem_arguments().join(" "),
            "limit 1000 delay 5000us 3000us loss 2.0000% reorder 25% rate 20000000bit"
        );
        assert_eq!(
            Weather::FAIR.netem_arguments().join(" "),
            "limit 1000 delay 0us 0us loss 0.0000% rate 100000000000bit"
        );
    }
}

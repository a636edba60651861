//! Pings and pongs → how far a board's clock is ahead of ours, and how sure that is.
//!
//! *Problem.* Stamps of two boards must meet on one clock: a ball flies 0.3 mm in 10 µs. Each
//! machine counts nanoseconds since its own start, and crystals run up to 50 ppm fast or slow.
//!
//! *The naive plan* starts both cameras by one message (the thesis: up to 6.9 ms apart), or asks
//! for the time and takes half the round trip. On Wi-Fi a packet waits for others 1 to 20 ms, on
//! one way and not on the other: half of that is the error (5 ms RMS in simulation). Taking the
//! quickest exchange of ten seconds is better, but a clock 20 ppm fast has moved by 200 µs in them.
//!
//! *The method.* An exchange has four stamps: sent (here), received and answered (there), returned
//! (here). `received − sent` is the offset and what the ping took, `answered − returned` the offset
//! less what the pong took. Nothing is quicker than the quickest, so over a minute the first lie on
//! and above a line, the second on and below one, both as steep as the clocks differ in rate; the
//! offset runs midway between them. Each way is bounded by its own quickest packet, so no exchange
//! has to be quick both ways, which makes the error fall as 1/n instead of 1/√n. For every rate the
//! two lines are known at once (only points of the convex hulls can touch them); rates are weighed
//! by how far apart they keep the lines, which is the likelihood when waiting is exponential, and
//! by the prior that crystals are within ±50 ppm.
//!
//! *How sure it is.* The line can be moved by about one spacing of the quickest packets; rates that
//! are as likely give other offsets; and how much longer one way takes than the other *always* can
//! be told by no exchange of messages: it is stated as a share of the quickest round trip. Shots
//! find it: fusion fits the difference of the cameras' clocks to the ball.
//!
//! *Better clocks.* Where PTP or chrony keeps the machines' clocks of the day together, and the
//! operator says how well, that is used if it is better than what messages tell (module `day`).
//!
//! Source: the four stamps of NTP (RFC 5905, section 8); the lines of Moon, Skelly and Towsley,
//! "Estimation and removal of clock skew from network delay measurements" (INFOCOM 1999).

mod day;
mod lines;

use day::Synced;
pub use day::day_minus_stamp_ns;
use lines::{Bound, Middle};
use shm_layout::StampNs;
use std::collections::VecDeque;

/// How long an exchange counts.
const WINDOW_NS: i64 = 60_000_000_000;

/// Most exchanges kept: [`WINDOW_NS`] at 25 a second.
const MAX_EXCHANGES: usize = 1500;

/// Exchanges before anything is told.
const N_FIRST: usize = 8;

/// 1 sigma of how far a crystal's rate is from another's: cheap ones are specified to ±30 to 50
/// ppm.
const RATE_SIGMA: f64 = 50e-6;

/// What stamping costs even on an idle machine: a wake-up of a thread, to either side.
const STAMP_SIGMA_NS: f64 = 20_000.0;

/// 1 sigma of the difference of the two ways, as a share of the quickest round trip.
const ASYMMETRY: f64 = 0.08;

/// What a crystal's rate may change within the window (temperature), as an error of the line.
const WANDER_SIGMA_NS: f64 = 3_000.0;

/// The four stamps of one exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exchange {
    /// Ping left, our clock.
    pub sent_ns: StampNs,
    /// Ping came, the board's clock.
    pub received_ns: StampNs,
    /// Pong left, the board's clock.
    pub answered_ns: StampNs,
    /// Pong came, our clock.
    pub returned_ns: StampNs,
    /// How far the board's clock is ahead if both machines' clocks of the day are the same.
    pub ahead_by_day_ns: i64,
}

impl Exchange {
    fn round_trip_ns(&self) -> i64 {
        let here_ns = self.returned_ns.saturating_sub(self.sent_ns);
        here_ns.saturating_sub(self.answered_ns.saturating_sub(self.received_ns))
    }

    fn is_possible(&self) -> bool {
        self.sent_ns <= self.returned_ns
            && self.received_ns <= self.answered_ns
            && self.round_trip_ns() >= 0
    }
}

/// Where a board's clock is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The time, on our clock, at which `board_minus_here_ns` is meant.
    pub at_ns: StampNs,
    /// How far the board's clock is ahead.
    pub board_minus_here_ns: i64,
    /// How much faster it runs: 1e-6 is a microsecond a second.
    pub rate: f64,
    /// 1 sigma of `board_minus_here_ns`.
    pub sigma_ns: f64,
    /// The quickest round trip of the window.
    pub round_trip_ns: i64,
}

impl Estimate {
    /// A stamp of the board on our clock.
    #[must_use]
    pub fn here_from_board(&self, board_ns: StampNs) -> StampNs {
        let near_ns = board_ns.saturating_sub(self.board_minus_here_ns);
        let since_ns = near_ns.saturating_sub(self.at_ns) as f64;
        near_ns.saturating_sub((since_ns * self.rate).round() as i64)
    }
}

/// Keeps the exchanges of the last minute.
#[derive(Debug, Default)]
pub struct Clock {
    exchanges: VecDeque<Exchange>,
    estimate: Option<Estimate>,
    synced: Option<Synced>,
}

impl Clock {
    /// A clock nothing is known of. `synced_sigma_ns`: if something else keeps the machines' clocks
    /// of the day together, how well, 1 sigma.
    #[must_use]
    pub fn new(synced_sigma_ns: Option<f64>) -> Self {
        Self { synced: synced_sigma_ns.map(Synced::new), ..Self::default() }
    }

    /// Nothing is known any more: another machine's clock is to be told.
    pub fn forget(&mut self) {
        *self = Self::new(self.synced.as_ref().map(Synced::sigma_ns));
    }

    /// Takes an exchange in, in the order of their returns; false if its stamps cannot be.
    pub fn update(&mut self, exchange: Exchange) -> bool {
        if !exchange.is_possible() {
            return false;
        }
        let now_ns = exchange.returned_ns;
        self.exchanges.push_back(exchange);
        while self.exchanges.len() > MAX_EXCHANGES
            || self.exchanges.front().is_some_and(|first| first.sent_ns < now_ns - WINDOW_NS)
        {
            self.exchanges.pop_front();
        }
        if self.exchanges.len() >= N_FIRST {
            let fitted = self.fitted(now_ns);
            let better = |synced: &mut Synced| synced.better(&fitted, exchange.ahead_by_day_ns);
            self.estimate = Some(self.synced.as_mut().and_then(better).unwrap_or(fitted));
        }
        true
    }

    /// The estimate as of the last exchange; `None` before there were eight.
    #[must_use]
    pub fn estimate(&self) -> Option<Estimate> {
        self.estimate
    }

    /// How far the clocks of the day are apart (the board's is ahead if positive), if the last
    /// exchange showed that they are not kept together as was said.
    #[must_use]
    pub fn newly_unsynced_ns(&mut self) -> Option<i64> {
        self.synced.as_mut().and_then(Synced::newly_apart_ns)
    }

    fn fitted(&self, now_ns: StampNs) -> Estimate {
        let newest = self.exchanges.back().expect("fitted after an exchange came in");
        let origin_ns = newest.received_ns.saturating_sub(newest.sent_ns);
        let point = |there_ns: StampNs, here_ns: StampNs| {
            let since_s = here_ns.saturating_sub(now_ns) as f64 * 1e-9;
            let offset_ns = there_ns.saturating_sub(here_ns).saturating_sub(origin_ns);
            [since_s, offset_ns as f64]
        };
        let pings = self.exchanges.iter().map(|e| point(e.received_ns, e.sent_ns));
        let pongs = self.exchanges.iter().map(|e| point(e.answered_ns, e.returned_ns));
        let pings = Bound::below(pings);
        let pongs = Bound::below(pongs.map(|[since_s, offset_ns]| [since_s, -offset_ns]));
        let middle = Middle::between(&pings, &pongs, RATE_SIGMA * 1e9, STAMP_SIGMA_NS);
        let asymmetry_ns = ASYMMETRY * middle.round_trip_ns;
        let sigma_ns = [STAMP_SIGMA_NS, WANDER_SIGMA_NS, asymmetry_ns]
            .into_iter()
            .fold(middle.sigma_ns, f64::hypot);
        Estimate {
            at_ns: now_ns,
            board_minus_here_ns: origin_ns.saturating_add(middle.offset_ns.round() as i64),
            rate: middle.rate_ns_s * 1e-9,
            sigma_ns,
            round_trip_ns: middle.round_trip_ns.round() as i64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    const SECOND_NS: i64 = 1_000_000_000;

    /// A link: the least each way takes, and how long it keeps a packet beyond that.
    struct Way {
        least_ns: [f64; 2],
        extra_ns: fn(&mut ChaCha8Rng) -> f64,
    }

    /// Errors of the estimate and its sigmas, one for each exchange after the first `from_s`.
    fn errors(way: &Way, ppm: f64, seconds: i64, from_s: i64, seed: u64) -> Vec<[f64; 2]> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut clock = Clock::default();
        let ahead_ns = 123_456_789_012_345_i64;
        let board_from_here = |ns: f64| ahead_ns + (ns * (1.0 + ppm * 1e-6)).round() as i64;
        let mut found = Vec::new();
        for idx in 0..seconds * 20 {
            let sent = (idx * SECOND_NS / 20) as f64;
            let received = sent + way.least_ns[0] + (way.extra_ns)(&mut rng);
            let answered = received + 30_000.0;
            let returned = answered + way.least_ns[1] + (way.extra_ns)(&mut rng);
            assert!(clock.update(Exchange {
                sent_ns: sent as i64,
                received_ns: board_from_here(received),
                answered_ns: board_from_here(answered),
                returned_ns: returned as i64,
                ahead_by_day_ns: 0,
            }));
            if let Some(estimate) = clock.estimate().filter(|_| idx >= from_s * 20) {
                let truth_ns = board_from_here(returned) - returned as i64;
                let error_ns = (estimate.board_minus_here_ns - truth_ns) as f64;
                found.push([error_ns, estimate.sigma_ns]);
                let stamp_ns = board_from_here(returned - 5e8);
                let back_ns = estimate.here_from_board(stamp_ns) as f64 - (returned - 5e8);
                // Half a second at a rate that may be three sigma off.
                assert!((back_ns + error_ns).abs() < 75_000.0, "{back_ns} {error_ns}");
            }
        }
        found
    }

    /// (p99 of the error, ns; share of errors within two sigma)
    fn score(mut errors: Vec<[f64; 2]>) -> (f64, f64) {
        let n_within = errors.iter().filter(|[e, sigma]| e.abs() < 2.0 * sigma).count();
        let share = n_within as f64 / errors.len() as f64;
        errors.sort_by(|a, b| a[0].abs().total_cmp(&b[0].abs()));
        (errors[errors.len() * 99 / 100][0].abs(), share)
    }

    #[test]
    fn a_wire_is_known_to_some_microseconds_whatever_the_crystals_do() {
        for (seed, ppm) in [(1, -80.0), (2, 0.0), (3, 20.0), (4, 80.0)] {
            let way = Way {
                least_ns: [80_000.0; 2],
                extra_ns: |rng| 10_000.0 * -rng.random::<f64>().max(1e-9).ln(),
            };
            let (p99_ns, share) = score(errors(&way, ppm, 120, 5, seed));
            assert!(p99_ns < 15_000.0, "{ppm} ppm: {p99_ns} ns");
            assert!(share > 0.95, "{ppm} ppm: {share}");
        }
    }

    #[test]
    fn a_link_that_keeps_packets_for_milliseconds_is_known_to_less_than_half_of_one() {
        for (seed, ppm) in [(1, -50.0), (2, 0.0), (3, 50.0)] {
            let way = Way {
                least_ns: [2e6; 2],
                extra_ns: |rng| match rng.random::<f64>() {
                    lost if lost < 0.02 => 2e8,
                    _ => 6e6 * rng.random::<f64>(),
                },
            };
            let (p99_ns, share) = score(errors(&way, ppm, 120, 5, seed));
            assert!(p99_ns < 500_000.0, "{ppm} ppm: {p99_ns} ns");
            assert!(share > 0.95, "{ppm} ppm: {share}");
        }
    }

    #[test]
    fn the_first_estimates_know_that_they_are_first() {
        let mut all = Vec::new();
        for seed in 0..300 {
            let way = Way { least_ns: [2e6; 2], extra_ns: |rng| 6e6 * rng.random::<f64>() };
            all.extend(errors(&way, 30.0, 2, 0, seed));
        }
        let (_, share) = score(all);
        assert!(share > 0.95, "{share}");
    }

    #[test]
    fn a_way_that_is_always_longer_is_within_what_is_stated() {
        let way =
            Way { least_ns: [80_000.0, 100_000.0], extra_ns: |rng| 20_000.0 * rng.random::<f64>() };
        let (p99_ns, share) = score(errors(&way, 20.0, 100, 5, 9));
        assert!(p99_ns > 8_000.0, "an asymmetry of 20 us cannot be seen: {p99_ns}");
        assert!(share > 0.95, "{share}");
    }

    #[test]
    fn stamps_that_cannot_be_are_refused_and_change_nothing() {
        let mut clock = Clock::default();
        let [sent_ns, received_ns, answered_ns, returned_ns] = [0, 50, 60, 100];
        let good = Exchange { sent_ns, received_ns, answered_ns, returned_ns, ahead_by_day_ns: 0 };
        for bad in [
            Exchange { returned_ns: -1, ..good },
            Exchange { answered_ns: 40, ..good },
            Exchange { answered_ns: 500, ..good },
            Exchange { sent_ns: i64::MAX, ..good },
            Exchange { received_ns: i64::MIN, answered_ns: i64::MAX, ..good },
        ] {
            assert!(!clock.update(bad), "{bad:?}");
        }
        assert!(clock.update(good) && clock.estimate().is_none());
    }
}

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
//! (here). With `offset = ((received − sent) + (answered − returned)) / 2` its error is half the
//! difference of the two ways, which is at most half of what the round trip took longer than the
//! quickest can. So: of the last minute the quickest tenth is kept, and a straight line (offset and
//! rate) is fitted to them, each weighted by that bound. The rate's prior is ±50 ppm.
//!
//! *What it does not know* is how much longer one way takes than the other always: no exchange of
//! messages can tell. It is stated as a share of the quickest round trip ([`ASYMMETRY`]). Shots
//! find it: fusion fits the difference of the cameras' clocks to the ball.
//!
//! Source: the on-wire offset of NTP (RFC 5905, section 8) and its minimum-delay filter (section
//! 10); the line is that of Paxson, "On calibrating measurements of packet transit times" (1998).

use shm_layout::StampNs;
use std::collections::VecDeque;

/// How long an exchange counts.
const WINDOW_NS: i64 = 60_000_000_000;

/// Most exchanges kept: [`WINDOW_NS`] at 25 a second.
const MAX_EXCHANGES: usize = 1500;

/// Of the exchanges in the window, the share that is used.
const QUICKEST: f64 = 0.1;

/// Fewest that are used, if there are as many.
const N_USED_MIN: usize = 12;

/// Exchanges before anything is told.
const N_FIRST: usize = 8;

/// 1 sigma of how far a crystal's rate is from another's: cheap ones are specified to ±30 to 50 ppm.
const RATE_SIGMA: f64 = 50e-6;

/// What stamping costs even on an idle machine: a wake-up of a thread, to either side.
const STAMP_SIGMA_NS: f64 = 10_000.0;

/// 1 sigma of the difference of the two ways, as a share of the quickest round trip.
const ASYMMETRY: f64 = 0.08;

/// What a crystal's rate may change within the window (temperature), as an error of the line.
const WANDER_SIGMA_NS: f64 = 2_000.0;

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
}

impl Exchange {
    fn round_trip_ns(&self) -> i64 {
        let here_ns = self.returned_ns.saturating_sub(self.sent_ns);
        here_ns.saturating_sub(self.answered_ns.saturating_sub(self.received_ns))
    }

    /// Board's clock less ours. Halved one by one: the sum of two stamps may be too large.
    fn offset_ns(&self) -> i64 {
        let [ping_ns, pong_ns] =
            [(self.received_ns, self.sent_ns), (self.answered_ns, self.returned_ns)]
                .map(|(there_ns, here_ns)| there_ns.saturating_sub(here_ns));
        ping_ns / 2 + pong_ns / 2
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
}

impl Clock {
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
            self.estimate = Some(self.fitted(now_ns));
        }
        true
    }

    /// The estimate as of the last exchange; `None` before there were [`N_FIRST`].
    #[must_use]
    pub fn estimate(&self) -> Option<Estimate> {
        self.estimate
    }

    fn fitted(&self, now_ns: StampNs) -> Estimate {
        let mut by_round_trip: Vec<&Exchange> = self.exchanges.iter().collect();
        by_round_trip.sort_unstable_by_key(|exchange| exchange.round_trip_ns());
        let n_quickest = (self.exchanges.len() as f64 * QUICKEST) as usize;
        by_round_trip.truncate(n_quickest.max(N_USED_MIN));
        let quickest = by_round_trip[0];
        // The quickest seen is not the quickest there can be: it is less by about a spacing.
        let spacing_ns = match by_round_trip.get(2) {
            Some(third) => (third.round_trip_ns() - quickest.round_trip_ns()) as f64 / 2.0,
            None => 0.0,
        };
        let least_ns = quickest.round_trip_ns() as f64 - spacing_ns;
        let origin_ns = quickest.offset_ns();
        let points = by_round_trip.iter().map(|exchange| {
            let since_s = exchange.returned_ns.saturating_sub(now_ns) as f64 * 1e-9;
            let off_ns = exchange.offset_ns().saturating_sub(origin_ns) as f64;
            // Uniform within half of what it took longer.
            let slack_ns = (exchange.round_trip_ns() as f64 - least_ns) / 12_f64.sqrt();
            [since_s, off_ns, STAMP_SIGMA_NS.hypot(slack_ns)]
        });
        let line = Line::through(points, RATE_SIGMA * 1e9);
        let asymmetry_ns = ASYMMETRY * quickest.round_trip_ns() as f64;
        Estimate {
            at_ns: now_ns,
            board_minus_here_ns: origin_ns.saturating_add(line.at_zero.round() as i64),
            rate: line.slope * 1e-9,
            sigma_ns: line.sigma.hypot(asymmetry_ns).hypot(WANDER_SIGMA_NS),
            round_trip_ns: quickest.round_trip_ns(),
        }
    }
}

/// A weighted straight line and how sure it is at x = 0.
struct Line {
    at_zero: f64,
    slope: f64,
    sigma: f64,
}

impl Line {
    /// Through points `[x, y, sigma]`, with a prior of 0 ± `slope_sigma` for the slope.
    fn through(points: impl Iterator<Item = [f64; 3]> + Clone, slope_sigma: f64) -> Self {
        let mut sums = [0.0; 5];
        for [x, y, sigma] in points.clone() {
            let weight = sigma.powi(-2);
            for (sum, term) in sums.iter_mut().zip([1.0, x, x * x, y, x * y]) {
                *sum += weight * term;
            }
        }
        let [w, wx, wxx, wy, wxy] = sums;
        let wxx = wxx + slope_sigma.powi(-2);
        let determinant = w * wxx - wx * wx;
        let at_zero = (wxx * wy - wx * wxy) / determinant;
        let slope = (w * wxy - wx * wy) / determinant;
        let (n, squares) = points.fold((0.0, 0.0), |(n, squares), [x, y, sigma]| {
            (n + 1.0, squares + ((y - at_zero - slope * x) / sigma).powi(2))
        });
        // Points that scatter more than they should say that the sigmas are too small.
        let scatter = (squares / f64::max(n - 1.0, 1.0)).max(1.0);
        Self { at_zero, slope, sigma: (wxx / determinant * scatter).sqrt() }
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
        let good = Exchange { sent_ns: 0, received_ns: 50, answered_ns: 60, returned_ns: 100 };
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

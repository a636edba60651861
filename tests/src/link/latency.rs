//! What was sent and what was heard → how long it took.

use super::Times;
use super::board::{N_STRIPS, Sent};
use super::heard::Heard;
use hdrhistogram::Histogram;
use serde::Serialize;
use shm_layout::StampNs;

/// Times in nanoseconds, by share of the messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Latency {
    /// How many messages.
    pub n: u64,
    /// Half of them took at most this.
    pub p50_ns: u64,
    /// Nine of ten.
    pub p90_ns: u64,
    /// 99 of a hundred.
    pub p99_ns: u64,
    /// 999 of a thousand.
    pub p999_ns: u64,
    /// The slowest.
    pub max_ns: u64,
}

impl Latency {
    /// From times; those below a nanosecond count as one.
    ///
    /// # Panics
    /// Never: the bounds of the histogram fit.
    #[must_use]
    pub fn from_ns(times_ns: impl IntoIterator<Item = StampNs>) -> Self {
        let mut histogram = Histogram::<u64>::new_with_bounds(1, 1_000_000_000_000, 3)
            .expect("1 ns to 1000 s at three digits is within what it can hold");
        for time_ns in times_ns {
            histogram.saturating_record(time_ns.max(1).unsigned_abs());
        }
        Self {
            n: histogram.len(),
            p50_ns: histogram.value_at_quantile(0.5),
            p90_ns: histogram.value_at_quantile(0.9),
            p99_ns: histogram.value_at_quantile(0.99),
            p999_ns: histogram.value_at_quantile(0.999),
            max_ns: histogram.max(),
        }
    }

    /// From the writing of candidates on the board to their arrival in fusion's shared memory:
    /// in the ordinary state, and of what was sent while a cut was being got over.
    #[must_use]
    pub fn from_heard(sent: &[Sent], heard: &Heard, times: &Times) -> [Self; 2] {
        let took_ns = heard.strips.iter().filter_map(|strip| {
            let sent = sent.iter().find(|sent| sent.camera == strip.camera)?;
            let frame = sent.finished_ns.get(usize::try_from(strip.frame_idx).ok()?)?;
            let finished_ns = *frame.get((strip.strip_idx % N_STRIPS) as usize)?;
            let is_ours = strip.recording_id == sent.recording_id;
            is_ours.then_some((finished_ns, strip.arrived_ns - finished_ns))
        });
        let is_late = |finished_ns: StampNs| {
            times.cut_ns.is_some_and(|(cut_ns, _)| finished_ns >= cut_ns)
                && !times.is_ordinary(finished_ns)
        };
        let took_ns: Vec<(StampNs, StampNs)> = took_ns.collect();
        let those = |is_it: &dyn Fn(StampNs) -> bool| {
            Self::from_ns(took_ns.iter().filter(|(at_ns, _)| is_it(*at_ns)).map(|(_, ns)| *ns))
        };
        [those(&|at_ns| times.is_ordinary(at_ns)), those(&is_late)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_times() {
        let latency = Latency::from_ns((1..=1000).map(|us| us * 1000));
        assert_eq!((latency.n, latency.max_ns / 1000), (1000, 1000));
        for (got_ns, expected_us) in
            [(latency.p50_ns, 500), (latency.p90_ns, 900), (latency.p99_ns, 990)]
        {
            // Three digits.
            assert!(got_ns.abs_diff(expected_us * 1000) <= expected_us, "{latency:?}");
        }
    }
}

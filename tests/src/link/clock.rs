//! What the bridge beside fusion says of a board's clock, and the stamps it translated → how wrong
//! they are, and whether it knew.

use super::Times;
use super::board::Sent;
use super::heard::Heard;
use serde::Serialize;
use shm_layout::Camera;
use shm_layout::stamp::OWN_CLOCK;

/// Errors of many estimates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClockError {
    /// How many.
    pub n: usize,
    /// How many more said that they know nothing.
    pub n_unknown: usize,
    /// Half of the errors are at most this, whatever their sign.
    pub p50_ns: i64,
    /// 99 of a hundred.
    pub p99_ns: i64,
    /// The worst.
    pub max_ns: i64,
    /// Their mean, with the sign: positive when the board's clock is taken to be too far ahead.
    pub mean_ns: i64,
    /// The median of what was said: 1 sigma.
    pub sigma_p50_ns: u32,
    /// Share of the errors within two of the stated sigmas.
    pub within_2_sigma: f64,
}

impl ClockError {
    fn from_errors(errors: &[(i64, u32)]) -> Self {
        let known: Vec<(i64, u32)> =
            errors.iter().filter(|(_, sigma_ns)| *sigma_ns != OWN_CLOCK).copied().collect();
        let mut sizes: Vec<i64> = known.iter().map(|(error_ns, _)| error_ns.abs()).collect();
        let mut sigmas: Vec<u32> = known.iter().map(|(_, sigma_ns)| *sigma_ns).collect();
        sizes.sort_unstable();
        sigmas.sort_unstable();
        let idx = |share: f64| (known.len().saturating_sub(1) as f64 * share).round() as usize;
        let size = |share: f64| sizes.get(idx(share)).copied().unwrap_or(0);
        let is_within =
            |(error_ns, sigma_ns): &&(i64, u32)| error_ns.abs() <= 2 * i64::from(*sigma_ns);
        let n = known.len().max(1);
        let sum_ns: i128 = known.iter().map(|(error_ns, _)| i128::from(*error_ns)).sum();
        Self {
            n: known.len(),
            n_unknown: errors.len() - known.len(),
            p50_ns: size(0.5),
            p99_ns: size(0.99),
            max_ns: size(1.0),
            mean_ns: i64::try_from(sum_ns / n as i128).unwrap_or(i64::MAX),
            sigma_p50_ns: sigmas.get(idx(0.5)).copied().unwrap_or(0),
            within_2_sigma: known.iter().filter(is_within).count() as f64 / n as f64,
        }
    }

    /// Of the service `links`: `board_minus_here_ns` against the truth. Everything after the
    /// settling counts, cuts too: an uncertainty must grow by itself.
    #[must_use]
    pub fn from_links(camera: Camera, heard: &Heard, times: &Times, truth_ns: i64) -> Self {
        let ours = heard.links.iter().filter(|link| {
            let is_ours = Camera::from_idx(link.camera_idx) == Some(camera);
            is_ours && link.noted_ns >= times.settled_ns()
        });
        let errors = ours.map(|link| (link.board_minus_here_ns - truth_ns, link.clock_sigma_ns));
        Self::from_errors(&errors.collect::<Vec<_>>())
    }

    /// Of the stamps: `exposed_ns` of candidates in fusion's shared memory against when the board
    /// exposed the frame. Fusion's clock is this machine's.
    #[must_use]
    pub fn from_stamps(sent: &Sent, heard: &Heard, times: &Times) -> Self {
        let ours = heard.strips.iter().filter(|strip| strip.camera == sent.camera);
        let errors = ours.filter_map(|strip| {
            let exposed_ns = sent.exposed_ns.get(usize::try_from(strip.frame_idx).ok()?)?;
            let is_ours = strip.recording_id == sent.recording_id;
            // Ahead taken too large moves a stamp back.
            let error_ns = exposed_ns - strip.exposed_ns;
            let counts = is_ours && *exposed_ns >= times.settled_ns();
            counts.then_some((error_ns, strip.clock_sigma_ns))
        });
        Self::from_errors(&errors.collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_held_against_what_was_stated() {
        let errors: Vec<(i64, u32)> = (1..=100)
            .map(|i| (if i % 2 == 0 { i } else { -i }, 40))
            .chain([(7, OWN_CLOCK)])
            .collect();
        let error = ClockError::from_errors(&errors);
        assert_eq!((error.n, error.n_unknown), (100, 1));
        assert_eq!((error.p50_ns, error.p99_ns, error.max_ns), (51, 99, 100));
        assert_eq!((error.mean_ns, error.sigma_p50_ns, error.within_2_sigma), (0, 40, 0.8));
    }

    #[test]
    fn nothing_known_is_no_error() {
        let error = ClockError::from_errors(&[(5, OWN_CLOCK)]);
        assert_eq!((error.n, error.n_unknown, error.p99_ns), (0, 1, 0));
    }
}

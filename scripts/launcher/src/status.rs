//! Counts, clock and machine → one line that says how the board is.

use crate::account::Counts;
use std::fmt::Write as _;
use std::io::{IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

/// Where nobody looks on (a journal), the line is written this often.
const IN_A_JOURNAL_EVERY: Duration = Duration::from_secs(10);

/// What the line says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Status {
    /// Frames a second.
    pub frame_rate_hz: f64,
    /// Of all frames so far.
    pub counts: Counts,
    /// Candidates of a frame, of all strips.
    pub candidates_per_frame: f64,
    /// 1 sigma of the board's clock.
    pub clock_sigma_ns: Option<u32>,
    /// The processor's temperature.
    pub cpu_celsius: Option<f32>,
    /// Whether it is slowed down.
    pub is_throttled: Option<bool>,
    /// How often something was started again.
    pub n_restarts: u64,
    /// Who does not run, and why.
    pub waiting: Vec<String>,
}

impl Status {
    /// The line.
    #[must_use]
    pub fn line(&self) -> String {
        let Counts { n_frames, n_lost, .. } = self.counts;
        let mut line = format!("{:5.1} frames/s, {n_lost} of {n_frames} lost", self.frame_rate_hz);
        let _ = write!(line, ", {:.1} candidates/frame", self.candidates_per_frame);
        let told = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
        let clock = self.clock_sigma_ns.map(|ns| format!("±{:.0} us", f64::from(ns) * 1e-3));
        let celsius = self.cpu_celsius.map(|celsius| format!("{celsius:.0} C"));
        let throttled = self.is_throttled.map(|is| if is { "THROTTLED" } else { "full speed" });
        let throttled = throttled.map(str::to_owned);
        let _ = write!(line, ", clock {}, {}, {}", told(clock), told(celsius), told(throttled));
        let _ = write!(line, ", {} restarts", self.n_restarts);
        for who in &self.waiting {
            let _ = write!(line, "; {who}");
        }
        line
    }
}

/// Words on stderr: the status in place where somebody looks on, and now and then otherwise.
#[derive(Debug)]
pub struct Words {
    name: String,
    is_terminal: bool,
    written: Option<Instant>,
}

impl Words {
    /// Words of a board called so.
    #[must_use]
    pub fn new(name: String) -> Self {
        Self { name, is_terminal: std::io::stderr().is_terminal(), written: None }
    }

    /// Says something of its own line.
    pub fn say(&self, words: &str) {
        let clear = if self.is_terminal { "\r\x1b[2K" } else { "" };
        let _ = writeln!(std::io::stderr(), "{clear}{}: {words}", self.name);
    }

    /// Shows the status. The cursor stays at its start: what a process says stands over it.
    pub fn show(&mut self, line: &str, now: Instant) {
        if self.is_terminal {
            let width = rustix::termios::tcgetwinsize(std::io::stderr()).map_or(80, |w| w.ws_col);
            let line = format!("{}: {line}", self.name);
            let line: String = line.chars().take(usize::from(width.max(2)) - 1).collect();
            let _ = write!(std::io::stderr(), "\r\x1b[2K{line}\r");
        } else if self.written.is_none_or(|at| now - at >= IN_A_JOURNAL_EVERY) {
            self.written = Some(now);
            self.say(line);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_tells_is_a_dash() {
        assert_eq!(
            Status::default().line(),
            "  0.0 frames/s, 0 of 0 lost, 0.0 candidates/frame, clock -, -, -, 0 restarts"
        );
        let status = Status {
            frame_rate_hz: 89.96,
            counts: Counts { n_frames: 5400, n_lost: 3, ..Counts::default() },
            candidates_per_frame: 1.25,
            clock_sigma_ns: Some(42_400),
            cpu_celsius: Some(61.2),
            is_throttled: Some(true),
            n_restarts: 2,
            waiting: vec!["capture failed with exit code 69 (no camera)".to_owned()],
        };
        assert_eq!(
            status.line(),
            " 90.0 frames/s, 3 of 5400 lost, 1.2 candidates/frame, clock ±42 us, 61 C, THROTTLED, \
             2 restarts; capture failed with exit code 69 (no camera)"
        );
    }
}

//! What the operator wants: flags, or the environment of a systemd unit.

use clap::Parser;
use shm_layout::{Camera, N_STRIPS_RANGE};
use std::ffi::OsString;
use std::path::PathBuf;

/// Runs one board: capture, workers and bridge, started again when they die.
///
/// Once a second it says how the board is: frames a second; how many were lost (not captured to the
/// end, or some strip not done) of all; candidates a frame; 1 sigma of the board's clock as fusion
/// knows it; the processor; how often something was started again. "-" is what nobody tells.
/// Exit code 0: stopped, or the recording is over; 1: cannot run; 2: misused.
#[derive(Debug, Clone, Parser)]
#[command(name = "board", version)]
pub struct Flags {
    /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
    #[arg(long, env = "TENNIS_COURT")]
    pub court: String,
    /// Which camera's board: left or right.
    #[arg(long, env = "TENNIS_CAMERA")]
    pub camera: Camera,
    /// How many workers share a frame [default: one core is left to the others].
    #[arg(long, env = "TENNIS_WORKERS")]
    #[arg(value_parser = clap::value_parser!(u32).range(N_STRIPS_RANGE))]
    pub workers: Option<u32>,
    /// Where the bridge beside fusion listens, as tls/192.168.1.5:7447 [default: found in the
    /// network with keys, on this machine without].
    #[arg(long, value_name = "ENDPOINT", env = "TENNIS_CONNECT", value_delimiter = ',')]
    pub connect: Vec<String>,
    /// Folder of the keys [default: ~/.config/tennis/COURT, if there].
    #[arg(long, value_name = "DIR", env = "TENNIS_KEYS")]
    pub keys: Option<PathBuf>,
    /// Where recordings go [default: $XDG_STATE_HOME/tennis, or ~/recordings].
    #[arg(long, value_name = "DIR", env = "TENNIS_RECORDINGS")]
    pub recordings: Option<PathBuf>,
    /// Flags of every worker, separated by blanks, as "--learning-frames 45".
    #[arg(long, value_name = "FLAGS", env = "TENNIS_WORKER_FLAGS", allow_hyphen_values = true)]
    pub worker_flags: Option<String>,
    /// Flags of capture, separated by blanks, for an environment: what stands after -- goes before.
    #[arg(long, value_name = "FLAGS", env = "TENNIS_CAPTURE", allow_hyphen_values = true)]
    pub capture_flags: Option<String>,
    /// Let the system choose the core of every process.
    #[arg(long, env = "TENNIS_NO_PINNING")]
    pub no_pinning: bool,
    /// End when the process that started this one has ended.
    #[arg(long)]
    pub with_parent: bool,
    /// Flags of capture: -- --recording FILE --repeat.
    #[arg(last = true, value_name = "CAPTURE FLAGS")]
    pub capture: Vec<OsString>,
}

impl Flags {
    /// Flags of capture: what stands after `--`, else the environment's.
    #[must_use]
    pub fn of_capture(&self) -> Vec<OsString> {
        if self.capture.is_empty() { words(&self.capture_flags) } else { self.capture.clone() }
    }

    /// Flags of each worker.
    #[must_use]
    pub fn of_worker(&self) -> Vec<OsString> {
        words(&self.worker_flags)
    }
}

fn words(text: &Option<String>) -> Vec<OsString> {
    text.iter().flat_map(|text| text.split_whitespace()).map(Into::into).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flags(words: &[&str]) -> Flags {
        let needed = ["board", "--court", "rose", "--camera", "left"];
        Flags::try_parse_from(needed.iter().chain(words)).unwrap()
    }

    #[test]
    fn what_stands_after_the_dashes_goes_before_the_environments() {
        let text = ["--capture-flags", "--source libcamera  --size 640x480"];
        assert_eq!(flags(&text).of_capture(), ["--source", "libcamera", "--size", "640x480"]);
        let both = [&text[..], &["--", "--recording", "a file"]].concat();
        assert_eq!(flags(&both).of_capture(), ["--recording", "a file"]);
        assert!(flags(&[]).of_capture().is_empty());
    }

    #[test]
    fn more_workers_than_strips_are_misuse() {
        let words = ["board", "--court", "rose", "--camera", "left", "--workers", "9"];
        assert!(Flags::try_parse_from(words).unwrap_err().to_string().contains("1..=8"));
    }
}

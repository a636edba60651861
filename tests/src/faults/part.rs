//! The processes of a court, by what they do there.

use anyhow::Context as _;
use rustix::process::Pid;
use shm_layout::Camera;
use std::fmt;
use std::str::FromStr;

/// Workers of each board.
pub const N_WORKERS: u32 = 2;

/// A process that may die, and is started again: on a board by its launcher, beside fusion by a
/// [`super::keeper::Keeper`] in place of systemd.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Frames of a camera.
    Capture(Camera),
    /// Candidates of a strip.
    Worker(Camera, u32),
    /// A board's end of the link.
    BoardBridge(Camera),
    /// Fusion's end of it.
    FusionBridge,
    /// Shots.
    Fusion,
    /// What the coach sees.
    Page,
    /// What is kept.
    Recorder,
}

impl Part {
    /// All that a court has.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let of_board = |camera| {
            let workers = (0..N_WORKERS).map(move |strip_idx| Self::Worker(camera, strip_idx));
            [Self::Capture(camera), Self::BoardBridge(camera)].into_iter().chain(workers)
        };
        let boards = Camera::BOTH.into_iter().flat_map(of_board);
        boards.chain([Self::FusionBridge, Self::Fusion, Self::Page, Self::Recorder]).collect()
    }

    /// Whether candidates that were found while it is away may not come to fusion.
    #[must_use]
    pub fn is_bridge(self) -> bool {
        matches!(self, Self::BoardBridge(_) | Self::FusionBridge)
    }

    /// Whether shots depend on it.
    #[must_use]
    pub fn is_needed_for_shots(self) -> bool {
        !matches!(self, Self::Page | Self::Recorder)
    }

    /// Words of its command line.
    fn words(self) -> Vec<String> {
        let of = |camera: Camera| format!("--camera {camera} ");
        match self {
            Self::Capture(camera) => vec!["/capture ".to_owned(), of(camera)],
            Self::Worker(camera, strip_idx) => {
                vec!["/worker ".to_owned(), of(camera), format!("--strip {strip_idx} ")]
            }
            Self::BoardBridge(camera) => vec!["/bridge board ".to_owned(), of(camera)],
            Self::FusionBridge => vec!["/bridge fusion ".to_owned()],
            Self::Fusion => vec!["/fusion ".to_owned()],
            Self::Page => vec!["/page ".to_owned()],
            Self::Recorder => vec!["/record ".to_owned()],
        }
    }

    /// Its process; an error while there is none.
    ///
    /// # Errors
    /// When no process of the court has its words.
    pub fn process(self, court: &str) -> anyhow::Result<Pid> {
        process(court, &self.words())
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Capture(camera) => write!(f, "capture {camera}"),
            Self::Worker(camera, strip_idx) => write!(f, "worker {camera} {strip_idx}"),
            Self::BoardBridge(camera) => write!(f, "bridge {camera}"),
            Self::FusionBridge => f.write_str("bridge fusion"),
            Self::Fusion => f.write_str("fusion"),
            Self::Page => f.write_str("page"),
            Self::Recorder => f.write_str("record"),
        }
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let names: Vec<String> = Self::all().iter().map(Self::to_string).collect();
        let found = Self::all().into_iter().find(|part| part.to_string() == text);
        found.ok_or_else(|| format!("expected one of {}; got {text:?}", names.join(", ")))
    }
}

/// The process of a court with these words in its command line.
///
/// # Errors
/// When there is none.
pub fn process(court: &str, words: &[String]) -> anyhow::Result<Pid> {
    for entry in std::fs::read_dir("/proc")? {
        let name = entry?.file_name();
        let Some(number) = name.to_str().and_then(|name| name.parse().ok()) else { continue };
        let line = std::fs::read(format!("/proc/{number}/cmdline")).unwrap_or_default();
        let line = String::from_utf8_lossy(&line).replace('\0', " ");
        let is_ours = line.contains(&format!("--court {court} "));
        if is_ours && words.iter().all(|word| line.contains(word)) {
            return Pid::from_raw(number).context("a process has no number");
        }
    }
    anyhow::bail!("no process with {words:?} in its command line")
}

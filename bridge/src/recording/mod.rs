//! Shared memory of a domain → a file, and back.
//!
//! The file is MCAP, which other people's viewers open. What was read from shared memory stands in
//! it as bytes of [`crate::wire::batch`], in the order in which it was read: that is what a replay
//! feeds fusion with, and fusion fed with the same messages in the same order tells the same shots,
//! bit by bit. Everything else is for viewers: circles around candidates, pictures, the flight in
//! a scene of the court, clocks and shots as JSON.
//!
//! Read in this order: [`topics`] is what a file holds, [`times`] its clock, [`queue`] the way from
//! the thread that reads to the one that writes, [`annotations`] and [`scene`] what is drawn,
//! [`writer`] a file, [`files`] one after another, and [`recorder`] all of it. [`reader`] reads a
//! file, [`replayer`] plays it.
//!
//! **A killed recorder** loses what came in its last half second: chunks are closed and handed to
//! the system at least that often, never half. Such a file has no index, so viewers read it from
//! the front. A power cut costs what the system has not written yet.
//!
//! **Limits**: a shot depends on what fusion had learned before it (the cameras' clocks). So the
//! same bits come from a recorder that was there before the boards; a later one gives nearly the
//! same, and so does every file of a long recording but the first. The index of a file grows in
//! memory with every chunk, until it is written at the end.

pub mod annotations;
pub mod files;
pub mod queue;
pub mod reader;
pub mod recorder;
pub mod replayer;
pub mod scene;
pub mod times;
pub mod topics;
pub mod writer;

#[cfg(test)]
mod tests;

use shm_layout::services;
use std::path::{Path, PathBuf};

/// Why something cannot be recorded or replayed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Shared memory cannot be had.
    #[error(transparent)]
    Services(#[from] services::Error),
    /// The system refused; `what` says which step.
    #[error("{}: cannot {what}: {why}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// The step that failed.
        what: &'static str,
        /// The reason.
        why: String,
    },
    /// There is a file already, which is not ours to overwrite.
    #[error("{}: is there already, and a recording is not overwritten", .0.display())]
    Exists(PathBuf),
    /// It is no recording of ours.
    #[error("{}: expected a recording: {why}", path.display())]
    NotARecording {
        /// Which file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// Pixels are only on boards.
    #[error("--frames: expected --place left or right, for only boards have pixels")]
    NoFrames,
    /// A court is in use.
    #[error("court {0}: somebody writes candidates there already; replay into a court of its own")]
    CourtInUse(String),
    /// Nobody reads, or no more.
    #[error("court {court}: fusion has taken nothing in for {waited_s} s")]
    NobodyTakes {
        /// The court.
        court: String,
        /// How long it was waited for.
        waited_s: u64,
    },
    /// A thread of this process is gone, which only a bug can do.
    #[error("the thread that writes ended early")]
    WriterGone,
}

impl From<queue::Gone> for Error {
    fn from(_: queue::Gone) -> Self {
        Self::WriterGone
    }
}

fn file(path: &Path, what: &'static str) -> impl FnOnce(&dyn std::fmt::Display) -> Error {
    let path = path.to_owned();
    move |why| Error::File { path, what, why: why.to_string() }
}

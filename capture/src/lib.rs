//! Room 1: light → frame.
//!
//! Read in this order: [`recording`] and [`pictures`] are where frames come from, [`stamps`] when
//! they were exposed, [`source`] is the door all of them stand behind (cameras will too), and
//! [`publisher`] lends shared memory, has it filled and publishes it; [`pace`] decides when, and
//! [`orders`] whether at all.
//!
//! [`average`] is for calibration: what stands still in a recording, as one picture.
//!
//! Deliberately absent: image processing otherwise, geometry, and a copy of a frame: a source
//! writes straight into the memory that workers read.
#![forbid(unsafe_code)]

pub mod average;
pub mod orders;
pub mod pace;
pub mod pictures;
pub mod publisher;
pub mod recording;
pub mod source;
pub mod stamps;

use shm_layout::services;
use std::path::PathBuf;

/// Why frames cannot be had or published. Every message names the place.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file or directory cannot be read.
    #[error("{path}: {why}", path = path.display())]
    Unreadable {
        /// What was to be read.
        path: PathBuf,
        /// The system's reason.
        why: std::io::Error,
    },
    /// A file is not what it should be; `place` is a line or frame in it.
    #[error("{path}: {place}: expected {expected}, got {got}", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The line or frame.
        place: String,
        /// What would have been right.
        expected: String,
        /// What stands there.
        got: String,
    },
    /// Shared memory cannot be had.
    #[error(transparent)]
    Services(#[from] services::Error),
    /// Nobody takes the frames.
    #[error(
        "waited {waited_s} s for {n_workers} workers{and_bridge}: {n_workers_here} workers are here"
    )]
    NobodyListens {
        /// How long.
        waited_s: u64,
        /// How many were expected.
        n_workers: usize,
        /// How many came.
        n_workers_here: usize,
        /// " and the bridge (missing)" or nothing.
        and_bridge: &'static str,
    },
    /// A recording may not lose frames, and this one would have.
    #[error("frame {frame_idx} reached {n_reached} of {n_workers} workers: one has gone")]
    WorkerGone {
        /// The frame.
        frame_idx: u64,
        /// Workers that have it.
        n_reached: usize,
        /// Workers that should.
        n_workers: usize,
    },
    /// Workers are there but do not answer.
    #[error("no worker has finished a frame for {waited_s} s; oldest unfinished: {frame_idx}")]
    WorkersStuck {
        /// How long.
        waited_s: u64,
        /// The oldest frame some strip of which is missing.
        frame_idx: u64,
    },
    /// Ctrl-C or SIGTERM came before the recording was over.
    #[error("stopped")]
    Stopped,
}

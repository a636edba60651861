//! What a person does once: looking at the cameras, calibrating, pairing, recording.
//!
//! The tools that do it (`bridge command`, `calibrate`, `record`, `bridge pair`) stand beside this
//! binary and are run as processes, one of a kind at a time, each with a time limit; their words
//! are kept for whoever watches, and for the log.

pub mod jobs;
pub mod look;
pub mod tool;

use crate::clips::Clips;
use crate::locked;
use jobs::Jobs;
use look::Seen;
use shm_layout::Camera;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// Lines of words that are kept.
const MAX_WORDS: usize = 2000;

/// Where tools find what they need.
#[derive(Debug, Clone, Default)]
pub struct Place {
    /// The court's name.
    pub court: String,
    /// Folder of history, drills and recordings.
    pub data: PathBuf,
    /// The rig's file.
    pub rig: Option<PathBuf>,
    /// Where the bridge beside fusion listens, if not where it does by itself.
    pub connect: Option<String>,
    /// Folder of fusion's keys.
    pub keys: Option<PathBuf>,
}

/// The set-up.
#[derive(Debug, Default)]
pub struct Setup {
    /// Where tools find what they need.
    pub place: Place,
    /// What runs and ran.
    pub jobs: Jobs,
    /// What can be labelled.
    pub clips: Arc<Clips>,
    seen: Mutex<[Option<Seen>; 2]>,
    words: Mutex<VecDeque<String>>,
}

/// Why something was not done.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Something else is being done.
    #[error("{0} is under way: wait for it")]
    Busy(String),
    /// A tool failed; its last words.
    #[error("{tool}: {why}")]
    Tool {
        /// Which.
        tool: String,
        /// Why.
        why: String,
    },
    /// A picture or a file cannot be read or written.
    #[error("{0}")]
    File(String),
}

impl Setup {
    /// Nothing was done yet.
    #[must_use]
    pub fn new(place: Place) -> Self {
        let clips = Arc::new(Clips::of_folder(place.data.join("recordings")));
        Self { place, clips, ..Self::default() }
    }

    /// The last picture of a camera.
    #[must_use]
    pub fn seen(&self, camera: Camera) -> Option<Seen> {
        locked(&self.seen)[camera.idx()].clone()
    }

    fn see(&self, camera: Camera, seen: Seen) {
        locked(&self.seen)[camera.idx()] = Some(seen);
    }

    /// Keeps a line for the log.
    pub fn say(&self, line: &str) {
        let mut words = locked(&self.words);
        if words.len() == MAX_WORDS {
            words.pop_front();
        }
        words.push_back(format!("{} {line}", crate::desk::now_ms()));
    }

    /// What was said lately: a line each, with its Unix time in ms.
    #[must_use]
    pub fn log(&self) -> String {
        locked(&self.words).iter().map(|line| format!("{line}\n")).collect()
    }
}

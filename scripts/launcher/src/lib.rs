//! The launcher of a board: capture, workers and bridge as one thing that runs.
//!
//! Read in this order: [`flags`] say what is wanted, [`plans`] which processes that takes;
//! [`processes`] is how one of this house is started, signalled and ended, [`back_off`] when it is
//! started again, [`supervisor`] does both. Shared [`memory`] gives an [`account`] of every frame,
//! which becomes the [`status`] line; [`systemd`] hears it, too. A worker that is [`stuck`] is
//! killed. A [`claim`] keeps two launchers from one camera, and [`board`] is all of it together.
//!
//! Deliberately absent: what a process does. The launcher knows capture's exit codes and nothing
//! else of the rooms.
#![forbid(unsafe_code)]

pub mod account;
pub mod back_off;
pub mod board;
pub mod claim;
pub mod flags;
pub mod memory;
pub mod plans;
pub mod processes;
pub mod status;
pub mod stuck;
pub mod supervisor;
pub mod systemd;

use shm_layout::{Camera, services};
use std::path::PathBuf;

/// Why a board cannot run.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Another launcher has it.
    #[error("another launcher runs the {camera} board of court {court}")]
    Claimed {
        /// The court.
        court: String,
        /// Which board.
        camera: Camera,
    },
    /// Processes of this board run without their launcher, and do not end.
    #[error("processes of this board run already: {}", names.join(", "))]
    StillRunning {
        /// Their names and numbers.
        names: Vec<String>,
    },
    /// A binary is not where this one is.
    #[error("{}: expected beside this binary", path.display())]
    NotBuilt {
        /// Where it should be.
        path: PathBuf,
    },
    /// A process does not know its flags, and has said so.
    #[error("{name} was given wrong flags (above)")]
    Misused {
        /// Its name.
        name: String,
    },
    /// The system refused.
    #[error("cannot {what}: {why}")]
    System {
        /// What was tried.
        what: String,
        /// The reason.
        why: std::io::Error,
    },
    /// Signals cannot be heard.
    #[error(transparent)]
    Signals(#[from] std::io::Error),
    /// Shared memory cannot be had.
    #[error(transparent)]
    Services(#[from] services::Error),
}

impl Error {
    /// 2 where flags are wrong, else 1.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Misused { .. } | Self::Services(services::Error::CourtName(_)) => 2,
            _ => 1,
        }
    }
}

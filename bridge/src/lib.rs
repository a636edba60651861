//! Room 3: candidates ↔ wire ↔ candidates.
//!
//! Read in this order: [`wire`] is messages as bytes, [`keys`] where they are published,
//! [`session`] the Zenoh session both ends open ([`pairing`] makes the keys, [`access`] says who
//! may speak under which), [`presence`] whether the other end is there. On a board [`ring`] is the
//! last ten seconds, [`run`] numbers the bridge's runs, and [`outbound`] is all of it (shared
//! memory → network). Beside fusion [`gaps`] brings batches into order, [`clock`] knows the board's
//! time, and [`inbound`] is all of it (network → shared memory); [`launcher`] is what a ball
//! machine and who commands it say. [`command`] is what boards are
//! told to do, and how they are; [`recording`] keeps what stood in shared memory in a file, and
//! plays it again.
//!
//! Who may join: [`discovery`] finds fusion in the network, [`refusal`] and [`once`] tell of those
//! who may not, [`one_thread`] keeps TLS sound; [`router`] joins many courts and [`follow`] listens
//! to them.
//!
//! Deliberately absent: what a message means. Stamps are translated, for in shared memory they are
//! on the clock of the machine they are read on.
#![forbid(unsafe_code)]

pub mod access;
mod askers;
pub mod clock;
pub mod command;
pub mod discovery;
pub mod follow;
pub mod gaps;
pub mod inbound;
pub mod keys;
pub mod launcher;
pub mod once;
pub mod one_thread;
pub mod outbound;
pub mod pairing;
pub mod presence;
pub mod recording;
pub mod refusal;
pub mod ring;
pub mod router;
pub mod run;
pub mod session;
pub mod wire;

use shm_layout::services;

/// Why messages cannot be moved.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Shared memory cannot be had.
    #[error(transparent)]
    Services(#[from] services::Error),
    /// Keys cannot be used.
    #[error(transparent)]
    Keys(#[from] pairing::Error),
    /// An address beyond this machine, and no keys.
    #[error("{0}: without keys bridges meet on loopback only; {1}")]
    NoKeys(String, String),
    /// An address cannot be used.
    #[error("{0}: {1}")]
    Endpoint(String, String),
    /// What is read on stdout has no reader.
    #[error("stdout: {0}")]
    Stdout(std::io::Error),
    /// The network cannot be had; `what` says which step.
    #[error("network: cannot {what}: {why}")]
    Network {
        /// The step that failed.
        what: String,
        /// Zenoh's words.
        why: String,
    },
    /// A thread of this process is gone, which only a bug can do.
    #[error("the network thread ended early")]
    NetworkThreadGone,
}

fn network(what: impl std::fmt::Display) -> impl FnOnce(zenoh::Error) -> Error {
    move |why| Error::Network { what: what.to_string(), why: why.to_string() }
}

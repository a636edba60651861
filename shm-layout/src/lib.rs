//! Room 0: what two processes must agree on. Plain `repr(C)` data and the one table of services.
//!
//! Read in this order: [`stamp`] (which camera, when), [`frame`], [`candidates`], [`link`],
//! [`taken`], [`shot`], [`correction`] and [`launcher`] — the messages in the order of the chain —
//! [`text`] and [`commands`], what a board is told to do; then the [`table`] of services and
//! [`services`], the only place where one is opened, [`stop`], the one way a process of this house
//! ends, [`log`], how it says what it does, and what the [`machine`] tells of itself.
//!
//! Deliberately absent: anything that looks into a message, and unsafe code.
#![forbid(unsafe_code)]

pub mod candidates;
pub mod commands;
pub mod correction;
pub mod dev_shm;
pub mod frame;
pub mod launcher;
pub mod link;
pub mod log;
pub mod machine;
pub mod ports;
pub mod services;
pub mod shot;
pub mod stamp;
pub mod stop;
pub mod table;
pub mod taken;
pub mod text;

pub use candidates::{Candidate, MAX_CANDIDATES, MAX_STRIPS, N_STRIPS_RANGE, StripCandidates};
pub use correction::{Correction, Wanted};
pub use frame::{FrameInfo, MAX_SIDE_PX};
pub use launcher::{LauncherAnswer, LauncherCommand};
pub use link::Link;
pub use shot::Shot;
pub use stamp::{Camera, StampNs};
pub use taken::Taken;

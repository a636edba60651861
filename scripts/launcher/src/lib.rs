//! The launcher of a board: capture, workers and bridge as one thing that runs.
//!
//! Read in this order: [`flags`] say what is wanted, [`plans`] which processes that takes;
//! [`processes`] is how one of this house is started, signalled and ended, [`back_off`] when it is
//! started again, [`supervisor`] does both; an [`account`] of every frame and the machine's own
//! word become the [`status`] line, which [`systemd`] hears, too; a [`claim`] keeps two launchers
//! from one camera.
//!
//! Deliberately absent: what a process does. The launcher knows capture's exit codes and nothing
//! else of the rooms.
#![forbid(unsafe_code)]

pub mod back_off;
pub mod processes;

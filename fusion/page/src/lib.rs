//! Fusion's window: what it publishes -> a coach's phone, and what the coach wants -> fusion and
//! the ball machine.
//!
//! A process of its own, so that neither twenty browsers nor a bad request, a full disk or an error
//! here delays a shot: it joins shared memory as any reader does. Read in this order: [`heard`]
//! (texts and messages of shared memory), [`views`] (what goes out, in SI units), [`ball`] (shot,
//! command and correction of one ball put together), [`history`] (SQLite), [`desk`] (who knows
//! all of it and tells those who watch), [`figures`] (what came of a session), [`aiming`] (what a
//! target takes), [`drills`] (their files), [`drill`] (who fires balls), [`setup`] (tools that
//! are run as processes), [`labels`] (where a person says the ball is in a clip), [`label_file`]
//! (kept on disk), [`clips`] (which there are), [`guard`] (who may ask for what), [`api`] (the
//! routes and their OpenAPI).
//!
//! Deliberately absent: measuring and controlling (fusion's), the look of the page (`web/`).
#![forbid(unsafe_code)]

pub mod aiming;
pub mod api;
pub mod ball;
pub mod clips;
pub mod court;
pub mod desk;
pub mod drill;
pub mod drills;
pub mod figures;
pub mod guard;
pub mod heard;
pub mod history;
pub mod label_file;
pub mod labels;
mod parts;
pub mod setup;
pub mod views;

use std::sync::{Mutex, MutexGuard, PoisonError};

/// That one who held it panicked is no reason for all others to stop.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

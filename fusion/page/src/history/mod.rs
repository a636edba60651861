//! Balls and sessions <-> SQLite.
//!
//! One thread writes, each ball in a transaction of its own, in write-ahead mode: whoever kills the
//! process loses no ball that was written, and whoever reads waits for nobody. What cannot be
//! written (a full disk) is counted and said; play goes on.

mod read;

pub use read::{Filter, Outline};

use crate::locked;
use crate::views::{Ball, HistoryState};
use rusqlite::{Connection, OpenFlags, params};
use rusqlite_migration::{M, Migrations};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// Changes that wait for the disk: some minutes of balls.
const MAX_WAITING: usize = 1024;
/// Another process may hold the file for a moment.
const BUSY_FOR: Duration = Duration::from_secs(2);

/// The steps from an empty file to the newest form, in their order; each is applied once.
const STEPS: &[M<'static>] = &[M::up(include_str!("1.sql")), M::up(include_str!("2.sql"))];

/// Why the history cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be opened or read.
    #[error("{}: {why}", path.display())]
    Sqlite {
        /// Which.
        path: PathBuf,
        /// Why.
        why: rusqlite::Error,
    },
    /// It is of another program, or a newer one.
    #[error("{}: {why}", path.display())]
    Form {
        /// Which.
        path: PathBuf,
        /// Why.
        why: rusqlite_migration::Error,
    },
    /// What stands there is not what was written.
    #[error("the history holds what this version cannot read: {0}")]
    Json(#[from] serde_json::Error),
}

/// A change.
#[derive(Debug, Clone)]
pub enum Change {
    /// A session begins; those before it have ended.
    Begin {
        /// Its number.
        id: i64,
        /// Its name.
        name: String,
        /// Unix time.
        at_ms: i64,
    },
    /// A ball, new or with more known of it.
    Ball(Box<Ball>),
}

/// The history.
#[derive(Debug)]
pub struct History {
    path: PathBuf,
    reader: Mutex<Connection>,
    changes: Option<SyncSender<Change>>,
    writer: Option<JoinHandle<()>>,
    state: Arc<Mutex<HistoryState>>,
}

impl History {
    /// Opens a file, or makes it.
    ///
    /// # Errors
    /// When it cannot be had.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let wrong = |why| Error::Sqlite { path: path.to_owned(), why };
        let mut connection = Connection::open(path).map_err(wrong)?;
        connection.busy_timeout(BUSY_FOR).map_err(wrong)?;
        connection.pragma_update(None, "journal_mode", "WAL").map_err(wrong)?;
        connection.pragma_update(None, "synchronous", "NORMAL").map_err(wrong)?;
        connection.pragma_update(None, "foreign_keys", true).map_err(wrong)?;
        Migrations::from_slice(STEPS)
            .to_latest(&mut connection)
            .map_err(|why| Error::Form { path: path.to_owned(), why })?;
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let reader = Connection::open_with_flags(path, flags).map_err(wrong)?;
        reader.busy_timeout(BUSY_FOR).map_err(wrong)?;
        let state = Arc::new(Mutex::new(HistoryState { n_lost: 0, error: None }));
        let (changes, waiting) = sync_channel(MAX_WAITING);
        let writer = {
            let state = Arc::clone(&state);
            std::thread::spawn(move || write_all(&connection, &waiting, &state))
        };
        Ok(Self {
            path: path.to_owned(),
            reader: Mutex::new(reader),
            changes: Some(changes),
            writer: Some(writer),
            state,
        })
    }

    /// How it is kept.
    #[must_use]
    pub fn state(&self) -> HistoryState {
        locked(&self.state).clone()
    }

    /// Leaves it to the thread that writes.
    pub fn write(&self, change: Change) {
        let is_taken = self.changes.as_ref().is_some_and(|out| out.try_send(change).is_ok());
        if !is_taken {
            let mut state = locked(&self.state);
            state.n_lost += 1;
            state.error = Some("the disk does not keep up".to_owned());
        }
    }
}

impl Drop for History {
    /// What waits is written.
    fn drop(&mut self) {
        self.changes = None;
        if let Some(writer) = self.writer.take() {
            let _ = writer.join(); // if it panicked there is nothing more to be done
        }
    }
}

fn write_all(connection: &Connection, waiting: &Receiver<Change>, state: &Mutex<HistoryState>) {
    for change in waiting {
        let outcome = written(connection, &change);
        let mut state = locked(state);
        match outcome {
            Ok(()) => state.error = None,
            Err(why) => {
                state.n_lost += 1;
                tracing::warn!(%why, "a ball is not kept");
                state.error = Some(why.to_string());
            }
        }
    }
}

fn written(connection: &Connection, change: &Change) -> Result<(), Box<dyn std::error::Error>> {
    match change {
        Change::Begin { id, name, at_ms } => {
            let over = "UPDATE session SET ended_ms = ?1 WHERE ended_ms IS NULL";
            connection.execute(over, [at_ms])?;
            let new = "INSERT INTO session (id, name, started_ms) VALUES (?1, ?2, ?3)";
            connection.execute(new, params![id, name, at_ms])?;
        }
        Change::Ball(ball) => {
            let row = &ball.row;
            let reference = ball.reference_m.as_ref().map(serde_json::to_string).transpose()?;
            let correction = ball.correction.as_ref().map(serde_json::to_string).transpose()?;
            let mut statement = connection.prepare_cached(
                "INSERT OR REPLACE INTO ball (id, session_id, at_ms, outcome, is_measured, \
                 target_name, row, shot, reference, correction) \
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)",
            )?;
            statement.execute(params![
                row.id,
                row.session_id,
                row.at_ms,
                row.outcome,
                row.landing_m.is_some(),
                row.target.as_ref().map(|target| &target.name),
                serde_json::to_string(row)?,
                serde_json::to_string(&ball.shot)?,
                reference,
                correction,
            ])?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod many;
#[cfg(test)]
mod tests;

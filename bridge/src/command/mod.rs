//! Commands on the network → done on the board, each answered with success or the reason.
//!
//! Read in this order: [`seen`] is what the bridge counts while it moves data, [`recording`] a
//! recorder as a child, [`board`] does what is asked; here questions are taken and answered.
//! [`relay`] passes them on beside fusion. [`commander`] is the asking end, [`cli`] its command
//! line.
//!
//! Commands have a thread of their own, so that data never waits for one. They are done one after
//! another, and every one has an answer within [`ANSWER_WITHIN`] of its arrival: one whose turn
//! comes too late is told to ask again. Once a second the same thread publishes the board's health.
//!
//! The way: commander → the bridge beside fusion ([`relay`]) → board. A commander is a client of
//! Zenoh's: it sees the boards' tokens, which peers do not pass on to other peers.

pub mod board;
pub mod cli;
pub mod commander;
pub mod recording;
pub mod relay;
pub mod seen;

use crate::keys;
use crate::wire::command::{Answer, Command};
use crate::{Error, network};
use board::Board;
use crossbeam::channel::{Receiver, RecvTimeoutError, bounded};
use seen::Seen;
use shm_layout::stop::Stop;
use shm_layout::{Camera, services};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use zenoh::bytes::ZBytes;
use zenoh::key_expr::OwnedKeyExpr;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{Query, Queryable, Reply};
use zenoh::{Session, Wait};

/// Every command is answered this long after it came, whatever else is asked.
pub const ANSWER_WITHIN: Duration = Duration::from_millis(1900);

/// A question and its answer are on their way for so long at most: an image on a slow link.
const UNDER_WAY: Duration = Duration::from_secs(3);

/// Processes of the board have so long to answer, and a frame to come: two commands fit into
/// [`ANSWER_WITHIN`].
const WORK_WITHIN: Duration = Duration::from_millis(800);

/// Commands that may wait while one is done; more than that is no person.
const MAX_WAITING: usize = 16;

/// How often health is published.
const HEALTH_EVERY: Duration = Duration::from_secs(1);

/// Why a command is not done. Its words go to whoever asked.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Nobody publishes frames.
    #[error("no capture runs on this board")]
    NoCapture,
    /// Nobody looks for balls.
    #[error("no worker runs on this board")]
    NoWorkers,
    /// Processes are there but say nothing.
    #[error("{n_silent} of {n_asked} processes of this board do not answer")]
    Silent {
        /// How many say nothing.
        n_silent: usize,
        /// How many were asked.
        n_asked: usize,
    },
    /// Capture or a worker refuses.
    #[error("{0}")]
    Process(String),
    /// Nothing to take an image from.
    #[error("no frame came within {within_ms} ms: are frames stopped, or is a recording over?")]
    NoFrame {
        /// How long was waited.
        within_ms: u128,
    },
    /// An image that no message holds.
    #[error("a frame of {width_px}x{height_px} is too large to be sent")]
    TooLarge {
        /// Of the frame.
        width_px: u32,
        /// Of the frame.
        height_px: u32,
    },
    /// One recording at a time.
    #[error("{} is being recorded already", .0.display())]
    Recording(PathBuf),
    /// The recorder is not where this binary is.
    #[error("{}: the recorder is not there", .0.display())]
    NotBuilt(PathBuf),
    /// How much room a recording needs is not known yet.
    #[error("no frame has come yet: how large a recording becomes is not known")]
    NothingSeen,
    /// Not enough room.
    #[error("{}: {free_mib} MiB are free, {need_mib} MiB are needed", folder.display())]
    DiskFull {
        /// Where recordings go.
        folder: PathBuf,
        /// Free now.
        free_mib: u64,
        /// Needed, with what is left free for others.
        need_mib: u64,
    },
    /// The recorder failed; the board's log has its words.
    #[error("the recorder ended at once ({0}); the board's log says why")]
    RecorderEnded(std::process::ExitStatus),
    /// The system refuses.
    #[error("{what}: {why}")]
    System {
        /// What was tried, or the file.
        what: String,
        /// The reason.
        why: std::io::Error,
    },
    /// Shared memory cannot be had.
    #[error(transparent)]
    Services(#[from] services::Error),
    /// Other commands took all the time.
    #[error("other commands were done first: ask again")]
    Busy,
}

/// What commands need to know of a board.
#[derive(Debug, Clone)]
pub struct Setting {
    /// The court.
    pub court: String,
    /// The board's camera.
    pub camera: Camera,
    /// Where recordings go.
    pub recordings: PathBuf,
    /// What the bridge counts.
    pub seen: Arc<Seen>,
}

/// Commands are taken until this is dropped.
#[derive(Debug)]
pub struct Serving {
    queryable: Option<Queryable<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Serving {
    fn drop(&mut self) {
        // The thread ends when nobody can put commands into its queue any more.
        if let Some(queryable) = self.queryable.take() {
            drop(queryable.undeclare().wait());
        }
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread of commands has panicked");
        }
    }
}

/// Begins to take commands, and to publish health. `stop` is raised by a command to shut down.
///
/// # Errors
/// When shared memory or the network cannot be had.
pub fn serve(session: &Session, setting: Setting, stop: Stop) -> Result<Serving, Error> {
    let (court, camera) = (setting.court.clone(), setting.camera);
    let (to_thread, queries) = bounded::<(Query, Instant)>(MAX_WAITING);
    let (ready, is_ready) = bounded(1);
    let health = session
        .declare_publisher(keys::of_board(&court, camera, "health")?)
        .congestion_control(CongestionControl::Drop)
        .priority(Priority::DataLow)
        .express(false)
        .wait()
        .map_err(network("publish health"))?;
    let thread = std::thread::spawn(move || {
        // Ports of shared memory stay on the thread that opened them.
        match Board::open(setting) {
            Ok(board) => {
                drop(ready.send(Ok(())));
                answer_all(board, &queries, &health, &stop);
            }
            Err(why) => drop(ready.send(Err(why))),
        }
    });
    is_ready.recv().map_err(|_| Error::NetworkThreadGone)??;
    let queryable = session
        .declare_queryable(keys::of_board(&court, camera, "command")?)
        .callback(move |query| {
            // Not answered here: this is Zenoh's only thread, and an answer may wait for it.
            if to_thread.try_send((query, Instant::now())).is_err() {
                tracing::warn!("too many commands wait: one is left out");
            }
        })
        .wait()
        .map_err(network("take commands"))?;
    Ok(Serving { queryable: Some(queryable), thread: Some(thread) })
}

/// Asks for what a command says, at most this long; `None` if nobody answers.
fn asked(
    session: &Session,
    key: OwnedKeyExpr,
    command: &[u8],
    within: Duration,
) -> zenoh::Result<Option<Reply>> {
    let (to_us, replies) = bounded(1);
    let priority = match Command::from_bytes(command) {
        // Answers have the priority of their question; the board says why others are refused.
        Ok(Command::Image) => Priority::DataLow,
        _ => Priority::InteractiveLow,
    };
    session
        .get(key)
        .payload(command)
        .priority(priority)
        .timeout(within)
        .callback(move |reply| {
            // One board answers; a second one that says it is this camera is not heard.
            drop(to_us.try_send(reply));
        })
        .wait()?;
    // The callback, and with it the other end, is dropped when time is up.
    Ok(replies.recv().ok())
}

/// Ends when the queryable is gone.
fn answer_all(
    mut board: Board,
    queries: &Receiver<(Query, Instant)>,
    health: &Publisher<'_>,
    stop: &Stop,
) {
    let mut due = Instant::now() + HEALTH_EVERY;
    loop {
        match queries.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok((query, came)) => {
                let answer = answer(&mut board, &query, came + ANSWER_WITHIN);
                reply(&query, answer);
                if board.is_shut_down() {
                    stop.raise();
                }
            }
            Err(RecvTimeoutError::Timeout) => {
                due = Instant::now() + HEALTH_EVERY;
                board.tick();
                // What the network has no room for is not worth more: the next comes in a second.
                drop(health.put(board.health().to_bytes()).wait());
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

fn answer(board: &mut Board, query: &Query, until: Instant) -> Result<Answer, String> {
    let payload = query.payload().map(ZBytes::to_bytes).unwrap_or_default();
    let command = Command::from_bytes(&payload).map_err(|refusal| {
        tracing::warn!("a command is refused: {refusal}");
        refusal.to_string()
    })?;
    let left = until.saturating_duration_since(Instant::now());
    let outcome = match left < WORK_WITHIN {
        true => Err(Refused::Busy),
        false => board.done(&command, WORK_WITHIN),
    };
    match &outcome {
        Ok(_) => tracing::info!(?command, "done"),
        Err(why) => tracing::warn!(?command, "refused: {why}"),
    }
    outcome.map_err(|refused| refused.to_string())
}

/// An answer, or the reason as text. Who asked and is gone does not hear it.
fn reply(query: &Query, answer: Result<Answer, String>) {
    let sent = match answer {
        Ok(answer) => query.reply(query.key_expr().clone(), answer.to_bytes()).wait(),
        Err(reason) => query.reply_err(reason).wait(),
    };
    if let Err(why) = sent {
        tracing::debug!("an answer cannot be sent: {why}");
    }
}

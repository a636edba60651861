//! A command and a board's name → the board's answer, or why there is none.

use super::{ANSWER_WITHIN, UNDER_WAY, asked};
use crate::keys::{self, version_of};
use crate::wire::command::{Answer, Command};
use crate::wire::{Refusal, VERSION};
use crate::{Error, network};
use crossbeam::channel::bounded;
use shm_layout::Camera;
use shm_layout::services::Place;
use std::time::{Duration, Instant};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

/// How long a board is waited for; a session that is new needs some of it.
const HERE_WITHIN: Duration = Duration::from_secs(3);

/// The bridge beside fusion says itself when a board is silent for longer than it may be.
const TOLD_WITHIN: Duration = Duration::from_secs(1);

/// The way to fusion's bridge is known this long after a board's token, at the latest.
const WAY_WITHIN: Duration = Duration::from_secs(1);

/// Pause between two tries until then.
const ASK_EVERY: Duration = Duration::from_millis(20);

/// Most tokens of one place that are looked at.
const MAX_TOKENS: usize = 64;

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Not even the bridge beside fusion is there.
    #[error("no bridge beside fusion is reached: is it running, and does it have fusion's keys?")]
    NoFusion,
    /// The board is not there.
    #[error("the board is not there: it is off, not connected, or of another court")]
    NotThere,
    /// The board is of another version.
    #[error(transparent)]
    Version(Refusal),
    /// Not even the bridge beside fusion says that the board is silent.
    #[error("the bridge beside fusion does not answer")]
    Silent,
    /// The board says why not.
    #[error("{0}")]
    Refused(String),
    /// The answer is none of ours.
    #[error("the answer is refused: {0}")]
    Answer(Refusal),
    /// The network cannot be had.
    #[error(transparent)]
    Bridge(#[from] Error),
}

/// Asks a board, once it is there.
///
/// # Errors
/// Why there is no answer.
pub fn ask(
    session: &Session,
    court: &str,
    camera: Camera,
    command: &Command,
) -> Result<Answer, Failure> {
    wait_for(session, court, camera)?;
    let begun = Instant::now();
    loop {
        match ask_once(session, court, camera, command) {
            // The token may be here before the way is known: then nobody was asked.
            Err(Failure::Silent) if begun.elapsed() < WAY_WITHIN => std::thread::sleep(ASK_EVERY),
            outcome => return outcome,
        }
    }
}

fn ask_once(
    session: &Session,
    court: &str,
    camera: Camera,
    command: &Command,
) -> Result<Answer, Failure> {
    let within = ANSWER_WITHIN + UNDER_WAY + TOLD_WITHIN;
    let reply = asked(session, keys::command(court, camera)?, &command.to_bytes(), within)
        .map_err(network("ask the board"))?
        .ok_or(Failure::Silent)?;
    match reply.result() {
        Ok(sample) => Answer::from_bytes(&sample.payload().to_bytes()).map_err(Failure::Answer),
        Err(error) => {
            let text = error.payload().to_bytes();
            Err(Failure::Refused(String::from_utf8_lossy(&text).into_owned()))
        }
    }
}

/// Waits for the board's token, which also tells its version.
fn wait_for(session: &Session, court: &str, camera: Camera) -> Result<(), Failure> {
    let (to_us, tokens) = bounded(MAX_TOKENS);
    let mut watched = Vec::new();
    for place in [Place::Board(camera), Place::Fusion] {
        let to_us = to_us.clone();
        let subscriber = session
            .liveliness()
            .declare_subscriber(keys::alive_in_any_version(court, place)?)
            .history(true)
            .callback(move |token| {
                let version = version_of(token.key_expr().as_str());
                // More tokens than fit are of nobody we look for.
                let _ = to_us.try_send((place, version, token.kind() == SampleKind::Put));
            })
            .wait()
            .map_err(network(format!("watch for {}", place.name())))?;
        watched.push(subscriber);
    }
    let begun = Instant::now();
    let (mut other_version, mut is_fusion_there) = (None, false);
    while let Ok(token) = tokens.recv_timeout(HERE_WITHIN.saturating_sub(begun.elapsed())) {
        match token {
            (Place::Board(_), Some(VERSION), true) => return Ok(()),
            (Place::Board(_), Some(theirs), true) => other_version = Some(theirs),
            (Place::Board(_), _, false) => other_version = None,
            (Place::Fusion, _, is_there) => is_fusion_there = is_there,
            _ => {}
        }
    }
    Err(match other_version {
        Some(theirs) => Failure::Version(Refusal::Version { theirs }),
        None if is_fusion_there => Failure::NotThere,
        None => Failure::NoFusion,
    })
}

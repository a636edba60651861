//! Beside fusion: a commander's question → the board's answer.
//!
//! Zenoh would pass both on by itself, but on its one thread ([`crate::one_thread`]): what passes
//! through has to wait for room in a queue that the same thread would empty. An image stopped the
//! bridge beside fusion for 5 s so, and was lost. Here threads of our own ask and answer, one a
//! board; while they wait, Zenoh's works.

use super::{ANSWER_WITHIN, UNDER_WAY};
use crate::wire::command::Command;
use crate::{Error, keys, network};
use crossbeam::channel::{Receiver, bounded};
use shm_layout::Camera;
use zenoh::bytes::ZBytes;
use zenoh::key_expr::OwnedKeyExpr;
use zenoh::qos::Priority;
use zenoh::query::{Query, Queryable, Reply};
use zenoh::{Session, Wait};

/// Questions for one board that may wait; more than that is no person.
const MAX_WAITING: usize = 16;

/// Questions are passed on until this is dropped.
#[derive(Debug)]
pub struct Relay {
    _boards: [Queryable<()>; 2],
}

/// Begins to pass questions on.
///
/// # Errors
/// When the network cannot be had.
pub fn serve(session: &Session, court: &str) -> Result<Relay, Error> {
    Ok(Relay {
        _boards: [board(session, court, Camera::Left)?, board(session, court, Camera::Right)?],
    })
}

fn board(session: &Session, court: &str, camera: Camera) -> Result<Queryable<()>, Error> {
    let to_board = keys::of_board(court, camera, "command")?;
    let (to_thread, questions) = bounded(MAX_WAITING);
    let asker = session.clone();
    std::thread::spawn(move || pass_all(&asker, &to_board, &questions));
    session
        .declare_queryable(keys::command(court, camera)?)
        .callback(move |question| {
            if to_thread.try_send(question).is_err() {
                tracing::warn!("too many commands for the {camera} board wait: one is left out");
            }
        })
        .wait()
        .map_err(network(format!("take commands for the {camera} board")))
}

/// Ends when the queryable is gone.
fn pass_all(session: &Session, to_board: &OwnedKeyExpr, questions: &Receiver<Query>) {
    for question in questions {
        let payload = question.payload().map(ZBytes::to_bytes).unwrap_or_default();
        let sent = match asked(session, to_board, &payload) {
            Ok(reply) => match reply.into_result() {
                Ok(sample) => {
                    question.reply(question.key_expr().clone(), sample.payload().clone()).wait()
                }
                Err(refusal) => question.reply_err(refusal.payload().clone()).wait(),
            },
            Err(why) => question.reply_err(why).wait(),
        };
        if let Err(why) = sent {
            tracing::debug!("an answer cannot be passed on: {why}");
        }
    }
}

fn asked(session: &Session, to_board: &OwnedKeyExpr, payload: &[u8]) -> Result<Reply, String> {
    let (to_us, replies) = bounded(1);
    let priority = match Command::from_bytes(payload) {
        // Answers have the priority of their question; the board says why others are refused.
        Ok(Command::Image) => Priority::DataLow,
        _ => Priority::InteractiveLow,
    };
    session
        .get(to_board.clone())
        .payload(payload)
        .priority(priority)
        .timeout(ANSWER_WITHIN + UNDER_WAY)
        .callback(move |reply| {
            // One board answers; a second one that says it is this camera is not heard.
            drop(to_us.try_send(reply));
        })
        .wait()
        .map_err(|why| format!("the board cannot be asked: {why}"))?;
    // The callback, and with it the other end, is dropped when time is up.
    replies.recv().map_err(|_| "the board does not answer".to_owned())
}

//! Beside fusion: a commander's question → the board's answer.
//!
//! Zenoh would pass both on by itself, but on its one thread ([`crate::one_thread`]): what passes
//! through has to wait for room in a queue that the same thread would empty. An image stopped the
//! bridge beside fusion for 5 s so, and was lost. Here threads of our own ask and answer, one a
//! board; while they wait, Zenoh's works.

use super::{ANSWER_WITHIN, UNDER_WAY, asked};
use crate::{Error, keys, network};
use crossbeam::channel::{Receiver, bounded};
use shm_layout::Camera;
use zenoh::bytes::ZBytes;
use zenoh::key_expr::OwnedKeyExpr;
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
        let sent = match answer_of(session, to_board, &payload) {
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

fn answer_of(session: &Session, to_board: &OwnedKeyExpr, payload: &[u8]) -> Result<Reply, String> {
    asked(session, to_board.clone(), payload, ANSWER_WITHIN + UNDER_WAY)
        .map_err(|why| format!("the board cannot be asked: {why}"))?
        .ok_or_else(|| "the board does not answer".to_owned())
}

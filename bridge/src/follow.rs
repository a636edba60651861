//! Shots of one court or of all → JSON lines on stdout.

use crate::session::{self, Options};
use crate::{Error, network};
use crossbeam::channel::{RecvTimeoutError, bounded};
use serde_json::json;
use shm_layout::stop::{LOOK_EVERY, Stop};
use std::io::Write;
use zenoh::Wait;

/// Shots waiting for stdout: a shot a second of forty courts for 25 s.
const MAX_WAITING: usize = 1000;

/// Prints every shot as `{"court":"rose","shot":...}` until stopped; `shot` is the text as it came.
/// Of `court` alone, or of all that can be heard.
///
/// # Errors
/// When the network cannot be had, or nobody reads stdout.
pub fn run(options: &Options, court: Option<&str>, stop: &Stop) -> Result<(), Error> {
    let mut options = options.clone();
    if !session::discover(&mut options, stop)? {
        return Ok(());
    }
    let session = session::open(&options)?;
    let key = format!("court/{}/shot", court.unwrap_or("*"));
    let (to_stdout, from_network) = bounded(MAX_WAITING);
    let _subscriber = session
        .declare_subscriber(key.clone())
        .callback(move |sample| {
            let Some(court) = court_from_key(sample.key_expr().as_str()) else { return };
            let Ok(shot) = sample.payload().try_to_string() else {
                tracing::warn!("a shot of {court} is no text");
                return;
            };
            if to_stdout.try_send((court.to_owned(), shot.into_owned())).is_err() {
                tracing::warn!("nobody reads: a shot of {court} is dropped");
            }
        })
        .wait()
        .map_err(network(format!("subscribe to {key}")))?;
    let mut stdout = std::io::stdout().lock();
    while !stop.is_raised() {
        match from_network.recv_timeout(LOOK_EVERY) {
            Ok((court, shot)) => writeln!(stdout, "{}", json!({ "court": court, "shot": shot }))
                .and_then(|()| stdout.flush())
                .map_err(Error::Stdout)?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(Error::NetworkThreadGone),
        }
    }
    Ok(())
}

fn court_from_key(key: &str) -> Option<&str> {
    key.strip_prefix("court/")?.strip_suffix("/shot")
}

//! Tokens on the network → whether the other end is there and speaks our version.
//!
//! Zenoh opens a session whether or not anybody takes it; only a token that its owner declared
//! tells that it is reached, and it goes within a second of the link.

use crate::keys::{alive, alive_in_any_version, version_of};
use crate::wire::{Refusal, VERSION};
use crate::{Error, network};
use shm_layout::services::Place;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

/// Says that this end is here, until it is dropped.
///
/// # Errors
/// When the network cannot be had.
pub fn announce(session: &Session, court: &str, place: Place) -> Result<LivelinessToken, Error> {
    session
        .liveliness()
        .declare_token(alive(court, place)?)
        .wait()
        .map_err(network(format!("say that {} is here", place.name())))
}

/// Watches one place of a court; nobody is there once it is dropped.
#[derive(Debug)]
pub struct Presence {
    is_there: Arc<AtomicBool>,
    _tokens: Subscriber<()>,
}

impl Presence {
    /// Begins to watch.
    ///
    /// # Errors
    /// When the network cannot be had.
    pub fn watch(session: &Session, court: &str, place: Place) -> Result<Self, Error> {
        let is_there = Arc::new(AtomicBool::new(false));
        let (seen, name) = (Arc::clone(&is_there), place.name());
        let tokens = session
            .liveliness()
            .declare_subscriber(alive_in_any_version(court, place)?)
            .history(true)
            .callback(move |token| match version_of(token.key_expr().as_str()) {
                Some(VERSION) => {
                    let is_there = token.kind() == SampleKind::Put;
                    seen.store(is_there, Ordering::Relaxed);
                    let state = if is_there { "is here" } else { "is gone" };
                    tracing::info!("{name} {state}");
                }
                Some(theirs) if token.kind() == SampleKind::Put => {
                    tracing::error!("{name}: {}", Refusal::Version { theirs });
                }
                _ => {}
            })
            .wait()
            .map_err(network(format!("watch for {name}")))?;
        Ok(Self { is_there, _tokens: tokens })
    }

    /// Whether it is there now, and speaks our version.
    #[must_use]
    pub fn is_there(&self) -> bool {
        self.is_there.load(Ordering::Relaxed)
    }
}

//! What Zenoh logs → each thing said once, then counted.
//!
//! Zenoh opens a session whether the peer takes it or not; that it does not stands only in the log,
//! again at every try, as words of TLS. Here [`refusal`] makes a sentence of it, which is
//! said once, and with a count at most once a minute for as long as it goes on. A stranger that
//! hammers at the door costs a line a minute.

use crate::refusal::{self, Said};
use std::collections::HashMap;
use std::fmt::{Debug, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::{Event, Subscriber};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::{Context, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, fmt};

/// Something that goes on is said again after so long.
pub const SAY_EVERY: Duration = Duration::from_secs(60);
/// Different things remembered; those beyond are one thing.
const MAX_THINGS: usize = 64;

/// Sends this process' words to stderr: its own as `RUST_LOG` says, Zenoh's once each; with
/// `RUST_LOG` set Zenoh's own words as well.
pub fn init() {
    let mut own =
        EnvFilter::builder().with_default_directive(LevelFilter::ERROR.into()).from_env_lossy();
    if std::env::var_os("RUST_LOG").is_none_or(|filter| filter.is_empty()) {
        for zenoh in ["zenoh=off", "zenoh_link_tls=off", "zenoh_transport=off"] {
            own = own.add_directive(zenoh.parse().expect("a directive by its form"));
        }
    }
    tracing_subscriber::registry()
        .with(fmt::layer().with_writer(std::io::stderr).with_filter(own))
        .with(Once::new(|sentence| eprintln!("bridge: {sentence}")).with_filter(heard()))
        .init();
}

/// What of Zenoh's log is listened to.
#[must_use]
pub fn heard() -> Targets {
    Targets::new()
        .with_target("zenoh", LevelFilter::WARN)
        .with_target("zenoh::net::runtime::orchestrator", LevelFilter::TRACE)
        .with_target("zenoh::net::routing::interceptor::access_control", LevelFilter::TRACE)
}

/// The layer that does it.
pub struct Once {
    counts: Mutex<Counts>,
    say: Box<dyn Fn(&str) + Send + Sync>,
}

impl Once {
    /// With a function that is given each sentence to say.
    #[must_use]
    pub fn new(say: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self { counts: Mutex::default(), say: Box::new(say) }
    }
}

impl<S: Subscriber> Layer<S> for Once {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut words = Words::default();
        event.record(&mut words);
        let metadata = event.metadata();
        let Some(said) = refusal::said(metadata.target(), *metadata.level(), &words.0) else {
            return;
        };
        // A thread that died while it held this leaves counts that are good enough.
        let mut counts = self.counts.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let sentence = counts.note(said, Instant::now());
        drop(counts);
        if let Some(sentence) = sentence {
            (self.say)(&sentence);
        }
    }
}

#[derive(Default)]
struct Words(String);

impl Visit for Words {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            let _ = write!(self.0, "{value:?}"); // a String takes all
        }
    }
}

/// What was said when, and how often it happened since.
#[derive(Debug, Default)]
struct Counts(HashMap<String, (Instant, u64)>);

impl Counts {
    fn note(&mut self, said: Said, now: Instant) -> Option<String> {
        let is_known = self.0.contains_key(&said.thing);
        let thing = if is_known || self.0.len() < MAX_THINGS { said.thing } else { String::new() };
        let Some((said_at, n_since)) = self.0.get_mut(&thing) else {
            self.0.insert(thing, (now, 0));
            return Some(said.sentence);
        };
        *n_since += 1;
        if now.duration_since(*said_at) < SAY_EVERY {
            return None;
        }
        let n = std::mem::take(n_since);
        *said_at = now;
        Some(format!("{} ({n} times since this was said)", said.sentence))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(thing: &str) -> Said {
        Said { thing: thing.to_owned(), sentence: format!("{thing}!") }
    }

    #[test]
    fn a_thing_is_said_once_and_then_once_a_minute_with_its_count() {
        let (mut counts, start) = (Counts::default(), Instant::now());
        let after = |ms: u64| start + Duration::from_millis(ms);
        assert_eq!(counts.note(said("a"), start).as_deref(), Some("a!"));
        let within = (1..5_000).filter_map(|ms| counts.note(said("a"), after(ms))).count();
        assert_eq!(within, 0);
        assert_eq!(counts.note(said("b"), after(5_000)).as_deref(), Some("b!"));
        let again = counts.note(said("a"), after(60_000)).unwrap();
        assert_eq!(again, "a! (5000 times since this was said)");
        assert_eq!(counts.note(said("a"), after(60_001)), None);
    }

    #[test]
    fn ever_new_things_are_one_thing_in_the_end() {
        let (mut counts, now) = (Counts::default(), Instant::now());
        let n = (0..10_000).filter_map(|n| counts.note(said(&n.to_string()), now)).count();
        assert_eq!(n, MAX_THINGS + 1);
        assert_eq!(counts.0.len(), MAX_THINGS + 1);
    }
}

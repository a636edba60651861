//! A line of Zenoh's log → what it means to who runs a court, and what to do.
//!
//! The words on the left are Zenoh 1.10's and rustls 0.23's, seen in `tests/joining.rs`. TLS tells
//! the listening side no address; where it is known it is in the sentence.

use std::cell::Cell;
use tracing::Level;

/// A thing that happened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Said {
    /// The same for each time it happens.
    pub thing: String,
    /// What to say of it.
    pub sentence: String,
}

/// Words of TLS, and their meaning to the side that listens.
const LISTENING: [(&str, &str); 9] = [
    (
        "peer sent no certificates",
        "somebody without keys wants to connect and is refused; if it is one of yours, pair it: \
         scripts/pair",
    ),
    (
        "certificate expired",
        "somebody whose keys have expired wants to connect and is refused; pair it again, if \
         this computer's clock is right",
    ),
    (
        "invalid peer certificate",
        "somebody with keys of another court, or of an earlier pairing, wants to connect and is \
         refused; if it is one of yours, pair it again: scripts/pair",
    ),
    (
        "alert: UnknownCA",
        "somebody with keys of another court, or of an earlier pairing, does not take this \
         computer for its fusion and went; if it is one of yours, pair it again: scripts/pair",
    ),
    (
        "alert: UnsupportedCertificate",
        "this computer listens with keys that are not made for it, and those who connect refuse \
         it; make fusion's with scripts/pair court",
    ),
    (
        "alert: CertificateExpired",
        "somebody refuses this computer's keys as expired: make new ones with scripts/pair, or \
         set the clock over there",
    ),
    (
        "corrupt message",
        "somebody speaks something else than TLS to this port and is refused; a bridge without \
         keys says tcp/, here it is tls/",
    ),
    ("handshake eof", "somebody connected, said nothing and went"),
    ("Timeout during TLS handshake", "somebody connected and said nothing; it is cut off"),
];

/// Words of TLS, and their meaning to the side that connects.
const CONNECTING: [(&str, &str); 8] = [
    ("extended key usage", "who listens there has a board's keys and is no fusion; not connected"),
    ("certificate expired", "the keys of who listens there have expired, or this clock is wrong"),
    (
        "invalid peer certificate",
        "who listens there is of another court, or of another pairing; pair this machine again",
    ),
    ("alert: CertificateExpired", "this machine's keys have expired there; pair it again"),
    ("alert: CertificateRequired", "it wants keys and this machine has none; pair it"),
    (
        "alert:",
        "it refuses this machine's keys: they are of another court, or of an earlier pairing; \
         pair this machine again",
    ),
    ("corrupt message", "who listens there speaks no TLS; without keys it is tcp/ on one machine"),
    ("handshake eof", "who listens there hung up; is it a bridge?"),
];

/// Warnings of Zenoh about what is meant to be so.
const MEANT: [&str; 4] = [
    "Skipping name verification",
    "Gossip is disabled",
    "Scouting delay elapsed",
    "Unable to connect to any locator of scouted peer", // its reason is said
];

/// What a line means; `None` when it is nothing to say.
#[must_use]
pub fn said(target: &str, level: Level, line: &str) -> Option<Said> {
    if target.ends_with("access_control") {
        return denied(line);
    }
    if let Some((address, why)) = failed_address(line) {
        let (words, meaning) = CONNECTING.iter().find(|(words, _)| why.contains(words))?;
        return Some(Said {
            thing: format!("{address} {words}"),
            sentence: format!("{address}: {meaning}"),
        });
    }
    if level > Level::WARN || MEANT.iter().any(|meant| line.starts_with(meant)) {
        return None;
    }
    let line = line.strip_suffix(". Hint: increase the system open file limit.").unwrap_or(line);
    if target.starts_with("zenoh_link_tls")
        && let Some((words, meaning)) = LISTENING.iter().find(|(words, _)| line.contains(words))
    {
        return Some(Said { thing: (*words).to_owned(), sentence: (*meaning).to_owned() });
    }
    // Numbers are what makes the same thing look new: ports, ids, seconds.
    let thing = line.chars().filter(|c| !c.is_ascii_hexdigit()).collect();
    Some(Said { thing, sentence: format!("network: {line}") })
}

/// The address that was not reached, and the reason.
fn failed_address(line: &str) -> Option<(&str, &str)> {
    if let Some(rest) = line.strip_prefix("Unable to connect to configured peer ") {
        return rest.split_once("! ");
    }
    let rest = line.strip_prefix("Unable to connect to newly scouted peer ")?;
    rest.split_once(" on ")?.1.split_once(": ")
}

thread_local! {
    /// Answers still to come that Zenoh only notes for later.
    static N_NOTED: Cell<u32> = const { Cell::new(0) };
}

/// Zenoh notes in advance what a peer may do with a key, nine answers of which are no message.
const N_ANSWERS: u32 = 9;

/// A message that access control dropped on its way in.
fn denied(line: &str) -> Option<Said> {
    if line.starts_with("ACL (") {
        N_NOTED.set(N_ANSWERS);
        return None;
    }
    if let Some((id, _)) = line.split_once(" did not match any configured ACL subject") {
        return Some(Said {
            thing: "stranger".to_owned(),
            sentence: format!(
                "somebody is connected whose keys are good, but not for here ({id}); it is not \
                 listened to and told nothing"
            ),
        });
    }
    let (who, what) = match line.strip_prefix("Using cached result: ") {
        Some(line) => line.split_once(" is unauthorized to ")?,
        None if N_NOTED.get() > 0 => {
            N_NOTED.set(N_NOTED.get() - 1);
            return None;
        }
        None => line.split_once(" is unauthorized to ")?,
    };
    let (message, key) = what.split_once(" (ingress) on ")?;
    let who = who
        .split_once("CertCommonName(")
        .and_then(|(_, rest)| rest.split_once(')'))
        .map_or(who, |(name, _)| name);
    Some(Said {
        thing: format!("{who} {message}"),
        sentence: format!("{who} may not do this and is not listened to: {message} on {key}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TLS: &str = "zenoh_link_tls::unicast";
    const ACL: &str = "zenoh::net::routing::interceptor::access_control";

    #[test]
    fn the_same_refusal_is_one_thing_whatever_its_numbers() {
        let line = |at: u64| {
            let line = format!(
                "invalid peer certificate: certificate expired: verification time {at} (UNIX), but \
                 certificate is not valid after 17. Hint: increase the system open file limit."
            );
            said(TLS, Level::WARN, &line).unwrap()
        };
        assert_eq!(line(1_795_357_896), line(1_795_357_999));
        assert!(line(1).sentence.contains("pair it again"));
    }

    #[test]
    fn who_connects_is_told_where_and_what_to_do() {
        let line = "Unable to connect to configured peer tls/10.0.0.1:7447! received fatal alert: \
                    UnknownCA at unicast.rs:226.. Retry in 20ms.";
        let refused = said("zenoh::net::runtime::orchestrator", Level::DEBUG, line).unwrap();
        assert!(refused.sentence.starts_with("tls/10.0.0.1:7447: it refuses this machine's keys"));
        let absent = "Unable to connect to configured peer tls/10.0.0.1:7447! Connection refused \
                      (os error 111). Retry in 20ms.";
        assert_eq!(said("zenoh::net::runtime::orchestrator", Level::DEBUG, absent), None);
    }

    #[test]
    fn a_dropped_message_is_told_and_what_is_noted_for_later_is_not() {
        let denied = "ab on Interface(lo)+CertCommonName(rose/left)+Transport(Tls)+ab is \
                      unauthorized to Put (ingress) on court/rose/right/candidates";
        let said = |line: &str| said(ACL, Level::TRACE, line);
        assert_eq!(said("ACL (ingress): caching permissions for `court/rose/right/x` ..."), None);
        let noted: Vec<_> = (0..9).filter_map(|_| said(denied)).collect();
        assert_eq!(noted, []);
        let told = said(denied).unwrap();
        assert!(told.sentence.starts_with("rose/left may not do this"), "{}", told.sentence);
        assert_eq!(said(&denied.replace("unauthorized", "authorized")), None);
    }
}

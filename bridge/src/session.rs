//! The Zenoh session both ends open.
//!
//! One court needs no router: the computer beside fusion listens, the boards connect and keep
//! trying until it is there. Without keys for TLS only loopback is safe, so that is the default.

use crate::{Error, network};
use zenoh::{Config, Session, Wait};

/// Where the two ends meet unless told otherwise.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// Which end of the connection this is.
#[derive(Debug, Clone, Copy)]
pub enum End<'a> {
    /// Beside fusion: waits for boards at an address.
    Listen(&'a str),
    /// On a board: connects to that address.
    Connect(&'a str),
}

/// Opens a session.
///
/// # Errors
/// When the address is malformed or taken. A peer that is not there yet is no error.
pub fn open(end: End<'_>) -> Result<Session, Error> {
    let (listen, connect) = match end {
        End::Listen(endpoint) => (format!("[{endpoint:?}]"), "[]".to_owned()),
        End::Connect(endpoint) => ("[]".to_owned(), format!("[{endpoint:?}]")),
    };
    let mut config = Config::default();
    for (key, value) in [
        ("mode", "\"peer\""),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
        ("listen/endpoints", &listen),
        ("connect/endpoints", &connect),
        ("connect/timeout_ms", "-1"),
        ("connect/exit_on_failure", "false"),
        ("connect/retry", "{ period_init_ms: 20, period_max_ms: 500, period_increase_factor: 2 }"),
    ] {
        config.insert_json5(key, value).map_err(network(format!("set {key} to {value}")))?;
    }
    let what = match end {
        End::Listen(endpoint) => format!("listen at {endpoint}"),
        End::Connect(endpoint) => format!("connect to {endpoint}"),
    };
    zenoh::open(config).wait().map_err(network(what))
}

//! All of Zenoh's work on one thread, because its TLS link needs that.
//!
//! zenoh-link-tls 1.10 reads and writes one rustls connection from two tasks through an
//! `UnsafeCell` (eclipse-zenoh/zenoh#2557, open). On two threads that is a data race: with both
//! directions busy a connection broke every 10 to 20 s here ("handshake not complete"), and memory
//! may break too. Tasks on one thread take turns, so a read never meets a write. Zenoh reads the
//! number of its threads from an environment variable alone, once, and a process cannot change its
//! own environment safely: so it starts itself anew, once, with the variable set.
//!
//! One thread is enough: two boards' batches and pings are some 1200 messages a second. A router is
//! left on Zenoh's own threads ([`leave`]): what it passes on may have to wait for room, and on one
//! thread nobody would make it (eight courts came to a standstill). So between machines its
//! sessions may break now and then, and are made anew; a court's boards need no router.

use std::os::unix::process::CommandExt as _;
use std::process::Command;

const VARIABLE: &str = "ZENOH_RUNTIME";

/// Every runtime of Zenoh is the one called tx, which has one thread.
const ONE_THREAD: &str =
    "(rx: (handover: tx), acc: (handover: tx), net: (handover: tx), app: (handover: tx))";

/// Makes sure of it; returns in a process that has the variable. To be called before anything else.
///
/// # Errors
/// When this binary cannot be started anew.
pub fn ensure() -> std::io::Result<()> {
    if std::env::var(VARIABLE).is_ok_and(|value| value == ONE_THREAD) {
        return Ok(());
    }
    Err(anew()?.env(VARIABLE, ONE_THREAD).exec())
}

/// Makes sure of the opposite.
///
/// # Errors
/// When this binary cannot be started anew.
pub fn leave() -> std::io::Result<()> {
    if std::env::var_os(VARIABLE).is_none() {
        return Ok(());
    }
    Err(anew()?.env_remove(VARIABLE).exec())
}

/// The same process once more: who started it, its number and its files stay as they are.
fn anew() -> std::io::Result<Command> {
    let mut words = std::env::args_os();
    let mut command = Command::new(std::env::current_exe()?);
    if let Some(name) = words.next() {
        command.arg0(name);
    }
    command.args(words);
    Ok(command)
}

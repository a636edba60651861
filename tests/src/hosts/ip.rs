//! Words → what `ip` and other commands of the system did about them.

use super::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Where `ip netns` keeps its namespaces.
pub const NAMESPACES: &str = "/run/netns";

/// The file that stands for a namespace.
#[must_use]
pub fn file_of(namespace: &str) -> PathBuf {
    Path::new(NAMESPACES).join(namespace)
}

/// Runs `ip` with these words, separated by spaces.
///
/// # Errors
/// When it fails, with its own words.
pub fn ip(words: &str) -> Result<(), Error> {
    run("ip", words)
}

/// Runs a command with these words, separated by spaces.
///
/// # Errors
/// When it fails, with its own words.
pub fn run(command: &str, words: &str) -> Result<(), Error> {
    let what = format!("{command} {words}");
    let output = Command::new(command).args(words.split_whitespace()).output();
    let output =
        output.map_err(|why| Error::Refused { what: what.clone(), why: why.to_string() })?;
    if output.status.success() {
        return Ok(());
    }
    let why = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    Err(Error::Refused { what, why })
}

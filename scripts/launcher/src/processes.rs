//! A process of this house: found beside the running one, started in a group of its own, asked to
//! end, killed when it does not, and how it ended in words.

use rustix::process::{Pid, Signal, kill_process};
use std::io;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How long a process may take to end after SIGTERM before it is killed.
pub const STOP_WITHIN: Duration = Duration::from_secs(5);

/// How often processes that are to end are looked at.
pub const LOOK_EVERY: Duration = Duration::from_millis(5);

/// The folder of the running binary, in which those of the others stand.
///
/// # Errors
/// When the running binary cannot be found.
pub fn folder() -> io::Result<PathBuf> {
    let mut folder = std::env::current_exe()?;
    folder.pop();
    if folder.ends_with("deps") {
        folder.pop(); // a test binary stands one below the others
    }
    Ok(folder)
}

/// A command that runs a binary in a process group of its own, so that Ctrl-C reaches the starter
/// alone, which then stops the others. Its words go to our stderr, its data nowhere.
#[must_use]
pub fn alone(mut command: Command) -> Command {
    command.stdin(Stdio::null()).stdout(Stdio::null()).process_group(0);
    command
}

/// Where a binary stands in `folder`; `None` if it does not.
#[must_use]
pub fn binary(folder: &Path, name: &str) -> Option<PathBuf> {
    Some(folder.join(name)).filter(|path| path.is_file())
}

/// Its process number, for calls of the system.
#[must_use]
pub fn pid(child: &Child) -> Option<Pid> {
    i32::try_from(child.id()).ok().and_then(Pid::from_raw)
}

/// Sends a signal. It may have ended since: then there is nobody to signal.
pub fn signal(child: &Child, signal: Signal) {
    if let Some(pid) = pid(child) {
        let _ = kill_process(pid, signal);
    }
}

/// Asks all to end, and kills those that have not after [`STOP_WITHIN`]; how many that were.
pub fn end_all(children: &mut [&mut Child]) -> usize {
    for child in &*children {
        signal(child, Signal::TERM);
    }
    let begun = Instant::now();
    let mut n_killed = 0;
    for child in children {
        let mut is_killed = false;
        while matches!(child.try_wait(), Ok(None)) {
            if !is_killed && begun.elapsed() > STOP_WITHIN {
                signal(child, Signal::KILL);
                is_killed = true;
                n_killed += 1;
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }
    n_killed
}

/// "failed with exit code 1", "was killed by signal 9".
#[must_use]
pub fn how_ended(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(0), _) => "ended early".to_owned(),
        (Some(code), _) => format!("failed with exit code {code}"),
        (None, Some(signal)) => format!("was killed by signal {signal}"),
        (None, None) => format!("ended: {status}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Child {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        alone(command).spawn().unwrap()
    }

    #[test]
    fn an_end_is_told_in_words() {
        for (script, words) in [
            ("exit 0", "ended early"),
            ("exit 69", "failed with exit code 69"),
            ("kill -9 $$", "was killed by signal 9"),
        ] {
            assert_eq!(how_ended(shell(script).wait().unwrap()), words);
        }
    }

    #[test]
    fn one_that_listens_is_not_killed() {
        let mut children = [shell("exec sleep 60"), shell("exec sleep 60")];
        let mut all: Vec<&mut Child> = children.iter_mut().collect();
        assert_eq!(end_all(&mut all), 0);
        for mut child in children {
            assert_eq!(how_ended(child.wait().unwrap()), "was killed by signal 15");
        }
    }
}

//! A tool, run as a person at a terminal would: its words come line by line, and it ends in time.

use super::Error;
use std::ffi::OsString;
use std::io::{BufRead as _, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// Bytes of a line; the rest is left out.
const MAX_LINE: u64 = 2000;
/// How often a tool that says nothing is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// What is run.
#[derive(Debug, Clone)]
pub struct Tool {
    name: &'static str,
    arguments: Vec<OsString>,
    within: Duration,
}

impl Tool {
    /// The binary of this name beside ours.
    #[must_use]
    pub fn new(name: &'static str, within: Duration) -> Self {
        Self { name, arguments: Vec::new(), within }
    }

    /// With more arguments.
    #[must_use]
    pub fn args<S: Into<OsString>>(mut self, arguments: impl IntoIterator<Item = S>) -> Self {
        self.arguments.extend(arguments.into_iter().map(Into::into));
        self
    }

    /// Runs it; `say` hears every line of both its outputs. Gives its last line of words.
    ///
    /// # Errors
    /// When it cannot be started, fails or takes too long: with its last words.
    pub fn run(&self, mut say: impl FnMut(&str)) -> Result<Vec<String>, Error> {
        let failed = |why: String| Error::Tool { tool: self.name.to_owned(), why };
        let beside = std::env::current_exe().map_err(|why| failed(why.to_string()))?;
        let path = beside.with_file_name(self.name);
        let mut child = Command::new(&path)
            .args(&self.arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|why| failed(format!("{}: {why}", path.display())))?;
        let (lines, said) = channel();
        if let Some(stdout) = child.stdout.take() {
            read_lines(stdout, lines.clone());
        }
        if let Some(stderr) = child.stderr.take() {
            read_lines(stderr, lines);
        }
        let begun = Instant::now();
        let mut all = Vec::new();
        loop {
            match said.recv_timeout(LOOK_EVERY) {
                Ok(line) => {
                    say(&line);
                    all.push(line);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if begun.elapsed() > self.within {
                end(&mut child);
                return Err(failed(format!("took longer than {} s", self.within.as_secs())));
            }
        }
        let status = child.wait().map_err(|why| failed(why.to_string()))?;
        if status.success() {
            return Ok(all);
        }
        Err(failed(all.pop().unwrap_or_else(|| format!("ended with {status} and said nothing"))))
    }
}

fn end(child: &mut Child) {
    // It may have ended by itself meanwhile.
    let _ = child.kill();
    let _ = child.wait();
}

fn read_lines(from: impl Read + Send + 'static, to: Sender<String>) {
    std::thread::spawn(move || {
        let mut reader = BufReader::new(from);
        loop {
            let mut line = Vec::new();
            let n = reader.by_ref().take(MAX_LINE).read_until(b'\n', &mut line);
            let line = String::from_utf8_lossy(&line).trim_end().to_owned();
            if n.is_err() || n.is_ok_and(|n| n == 0) || to.send(line).is_err() {
                return;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Programs of the system stand elsewhere: a path from ours leads there.
    fn shell(script: &str, within_ms: u64) -> Result<Vec<String>, Error> {
        let tool = Tool::new("/bin/sh", Duration::from_millis(within_ms));
        tool.args(["-c", script]).run(|_| ())
    }

    #[test]
    fn a_tool_s_words_come_and_its_failure_has_its_last_ones() {
        assert_eq!(shell("echo one; echo two >&2", 60_000).unwrap().len(), 2);
        let why = shell("echo no camera >&2; exit 1", 60_000).unwrap_err().to_string();
        assert_eq!(why, "/bin/sh: no camera");
        let why = shell("exit 3", 60_000).unwrap_err().to_string();
        assert!(why.contains("said nothing"), "{why}");
    }

    #[test]
    fn a_tool_that_hangs_is_ended() {
        let why = shell("exec sleep 60", 200).unwrap_err().to_string();
        assert!(why.contains("took longer"), "{why}");
        let why = Tool::new("no-such-tool", Duration::from_secs(1)).run(|_| ()).unwrap_err();
        assert!(why.to_string().contains("no-such-tool"), "{why}");
    }
}

//! Units → processes that run, and are started again when they end, as systemd does with the units
//! of `scripts/systemd`.

use super::part::Part;
use anyhow::Context as _;
use launcher::processes::{self, how_ended};
use std::ffi::OsString;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// `RestartSec` of the units.
pub const RESTART_AFTER: Duration = Duration::from_millis(100);

/// How often it is looked who has ended.
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// A process that is to run always.
pub struct Unit {
    /// Which it is.
    pub part: Part,
    /// Its binary.
    pub binary: PathBuf,
    /// Its flags the n-th time it is started.
    pub arguments: Box<dyn Fn(u64) -> Vec<OsString> + Send>,
}

/// An end that nobody asked for.
#[derive(Debug, Clone)]
pub struct End {
    /// Whose.
    pub part: Part,
    /// "was killed by signal 9".
    pub how: String,
}

/// Keeps units running until it is dropped.
#[derive(Debug)]
pub struct Keeper {
    ends: Arc<Mutex<Vec<End>>>,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

struct Kept {
    unit: Unit,
    child: Option<Child>,
    due: Instant,
    n_starts: u64,
}

impl Keeper {
    /// Starts them in their order; what they say goes to files in `folder`.
    ///
    /// # Errors
    /// When one cannot be started the first time.
    pub fn start(units: Vec<Unit>, folder: &Path) -> anyhow::Result<Self> {
        let now = Instant::now();
        let kept = units.into_iter().map(|unit| Kept { unit, child: None, due: now, n_starts: 0 });
        let mut kept: Vec<Kept> = kept.collect();
        for kept in &mut kept {
            kept.start(folder)?;
        }
        let (ends, is_over): (Arc<Mutex<Vec<End>>>, Arc<AtomicBool>) = Default::default();
        let thread = std::thread::spawn({
            let (folder, ends) = (folder.to_owned(), Arc::clone(&ends));
            let is_over = Arc::clone(&is_over);
            move || {
                while !is_over.load(Ordering::Relaxed) {
                    for kept in &mut kept {
                        kept.look(&folder, &ends);
                    }
                    std::thread::sleep(LOOK_EVERY);
                }
                let mut children: Vec<&mut Child> =
                    kept.iter_mut().filter_map(|kept| kept.child.as_mut()).collect();
                processes::end_all(&mut children);
            }
        });
        Ok(Self { ends, is_over, thread: Some(thread) })
    }

    /// Ends so far.
    #[must_use]
    pub fn ends(&self) -> Vec<End> {
        self.ends.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join(); // a panic there has said why
        }
    }
}

impl Kept {
    fn start(&mut self, folder: &Path) -> anyhow::Result<()> {
        let Unit { part, binary, arguments } = &self.unit;
        let words = folder.join(format!("{part}.words"));
        let words = File::options().create(true).append(true).open(words)?;
        let mut command = Command::new(binary);
        command.args(arguments(self.n_starts)).arg("--with-parent");
        let mut command = processes::alone(command);
        self.child = Some(command.stderr(words).spawn().with_context(|| part.to_string())?);
        self.n_starts += 1;
        Ok(())
    }

    fn look(&mut self, folder: &Path, ends: &Mutex<Vec<End>>) {
        let how = match &mut self.child {
            Some(child) => match child.try_wait() {
                Ok(Some(status)) => how_ended(status),
                _ => return,
            },
            None if Instant::now() >= self.due => match self.start(folder) {
                Ok(()) => return,
                Err(why) => format!("not started: {why:#}"),
            },
            None => return,
        };
        (self.child, self.due) = (None, Instant::now() + RESTART_AFTER);
        let end = End { part: self.unit.part, how };
        ends.lock().unwrap_or_else(PoisonError::into_inner).push(end);
    }
}

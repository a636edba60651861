//! How a process of this house ends: SIGTERM and Ctrl-C raise a flag that its loop looks at, so
//! that its shared memory is given back before it goes. Nobody is killed by a signal handler.

use std::fmt::Display;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What capture's end tells a launcher, as sysexits.h has it: it is started again after every one
/// of them but [`exit_code::MISUSED`], and why is said.
pub mod exit_code {
    /// Nothing else fits.
    pub const FAILURE: u8 = 1;
    /// Its flags are wrong, and will not be right the next time; clap ends any process so.
    pub const MISUSED: u8 = 2;
    /// There is no such camera, or no way to speak to it.
    pub const UNAVAILABLE: u8 = 69;
    /// It is busy or has gone: try again.
    pub const TEMPORARY: u8 = 75;
    /// This user may not.
    pub const NO_PERMISSION: u8 = 77;
    /// It cannot do what is asked.
    pub const CONFIGURATION: u8 = 78;
}

/// Longest a loop may wait before it looks at its [`Stop`] again.
pub const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Raised once the process was asked to end.
#[derive(Debug, Clone)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Listens to SIGTERM and SIGINT. With `with_parent` the process is also asked to end when the
    /// one that started it is gone, so that a killed launcher leaves nobody behind.
    ///
    /// # Errors
    /// When the system refuses the handlers, or the parent is gone already.
    pub fn on_signals(with_parent: bool) -> std::io::Result<Self> {
        let raised = Arc::new(AtomicBool::new(false));
        for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
            signal_hook::flag::register(signal, Arc::clone(&raised))?;
        }
        if with_parent {
            let signal = rustix::process::Signal::TERM;
            rustix::process::set_parent_process_death_signal(Some(signal))?;
            if rustix::process::getppid().is_none_or(rustix::process::Pid::is_init) {
                return Err(std::io::Error::other("the process that started this one is gone"));
            }
        }
        Ok(Self(raised))
    }

    /// Runs a process' work to its exit code, saying `name: why` of a failure. Once it was asked to
    /// end, an error is only the way it ended: a call that a signal interrupted, a neighbour that
    /// went first.
    pub fn run<E: Display + From<std::io::Error>>(
        name: impl Display,
        with_parent: bool,
        work: impl FnOnce(&Self) -> Result<(), E>,
    ) -> ExitCode {
        Self::run_to_code(name, with_parent, work, |_| exit_code::FAILURE)
    }

    /// The same with an exit code for each failure.
    pub fn run_to_code<E: Display + From<std::io::Error>>(
        name: impl Display,
        with_parent: bool,
        work: impl FnOnce(&Self) -> Result<(), E>,
        code: impl FnOnce(&E) -> u8,
    ) -> ExitCode {
        let outcome = Self::on_signals(with_parent).map_err(E::from).and_then(|stop| {
            let outcome = work(&stop);
            if stop.is_raised() { Ok(()) } else { outcome }
        });
        match outcome {
            Ok(()) => ExitCode::SUCCESS,
            Err(why) => {
                eprintln!("{name}: {why:#}");
                ExitCode::from(code(&why))
            }
        }
    }

    /// Asks the process to end, as a signal does: it was told to by a command.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// True once the process was asked to end.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

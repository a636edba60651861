//! The real binaries: started, watched, stopped, and nothing left in shared memory.
//!
//! Whoever starts a [`Household`] gets every process's end reported: one that ends when it should
//! not is an error with its name and how it ended. Dropping a household stops it all the same, so
//! neither an early return nor a panic leaves anybody behind.

use crate::hosts::Host;
use launcher::processes::{self, LOOK_EVERY, how_ended, signal};
use shm_layout::Camera;
use shm_layout::dev_shm;
use shm_layout::services::{self, Domain, Place};
use shm_layout::stop::Stop;
use std::ffi::OsStr;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Why the processes could not do what they were started for.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A binary is not where this one is.
    #[error("{}: not built; run: cargo build --release --workspace", path.display())]
    NotBuilt {
        /// Where it should be.
        path: PathBuf,
    },
    /// The system refused.
    #[error("cannot {what}: {why}")]
    System {
        /// What was tried.
        what: String,
        /// The reason.
        why: std::io::Error,
    },
    /// A process ended that should have gone on, or failed.
    #[error("{name} {how}")]
    Ended {
        /// Its name.
        name: String,
        /// "was killed by signal 9", "failed with exit code 1".
        how: String,
    },
    /// Ctrl-C or SIGTERM.
    #[error("stopped")]
    Stopped,
    /// Shared memory could not be looked at.
    #[error(transparent)]
    Services(#[from] services::Error),
    /// Something was left behind.
    #[error("left in /dev/shm: {}", names.join(" "))]
    LeftBehind {
        /// Names of the files.
        names: Vec<String>,
    },
}

/// When the end of a process is no error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Until {
    /// It must run until it is stopped.
    Stopped,
    /// It may end with success when its work is done.
    Done,
}

#[derive(Debug)]
struct Resident {
    name: String,
    child: Child,
    until: Until,
    is_done: bool,
}

/// The processes of one court, on one machine.
#[derive(Debug)]
pub struct Household {
    court: String,
    binaries: PathBuf,
    residents: Vec<Resident>,
}

impl Household {
    /// An empty household for a court, whose binaries stand beside the running one.
    ///
    /// # Errors
    /// When the running binary cannot be found.
    pub fn new(court: &str) -> Result<Self, Error> {
        Ok(Self { court: court.to_owned(), binaries: binaries()?, residents: Vec::new() })
    }

    /// Starts a binary with `--court`, `--with-parent` and these arguments. Its words go to stderr
    /// of this process; `stdout` says where its data goes.
    ///
    /// # Errors
    /// When it is not built or cannot be started.
    pub fn start<S: AsRef<OsStr>>(
        &mut self,
        name: &str,
        binary: &str,
        arguments: &[S],
        until: Until,
        stdout: Stdio,
    ) -> Result<&mut Child, Error> {
        self.start_on(None, name, binary, arguments, until, stdout)
    }

    /// The same on a host of a network of tests; on this machine itself if it is `None`.
    ///
    /// # Errors
    /// When it is not built or cannot be started.
    pub fn start_on<S: AsRef<OsStr>>(
        &mut self,
        host: Option<&Host>,
        name: &str,
        binary: &str,
        arguments: &[S],
        until: Until,
        stdout: Stdio,
    ) -> Result<&mut Child, Error> {
        let path = self.binary(binary)?;
        let mut command = host.map_or_else(|| Command::new(&path), |host| host.command(&path));
        command.args(arguments).args(["--court", &self.court, "--with-parent"]);
        let child = processes::alone(command)
            .stdout(stdout)
            .spawn()
            .map_err(|why| Error::System { what: format!("start {}", path.display()), why })?;
        let name = name.to_owned();
        self.residents.push(Resident { name, child, until, is_done: false });
        let last = self.residents.len() - 1;
        Ok(&mut self.residents[last].child)
    }

    /// Where a binary stands.
    ///
    /// # Errors
    /// When it is not built.
    pub fn binary(&self, binary: &str) -> Result<PathBuf, Error> {
        binary_in(&self.binaries, binary)
    }

    /// Names and process numbers of those still running.
    #[must_use]
    pub fn running(&self) -> Vec<(&str, u32)> {
        let running = self.residents.iter().filter(|resident| !resident.is_done);
        running.map(|resident| (resident.name.as_str(), resident.child.id())).collect()
    }

    /// Waits until the process called `name` is done.
    ///
    /// # Errors
    /// When any process ends that should not, or `stop` is raised.
    pub fn wait_for(&mut self, name: &str, stop: &Stop) -> Result<(), Error> {
        loop {
            if stop.is_raised() {
                return Err(Error::Stopped);
            }
            self.look()?;
            if self.residents.iter().any(|resident| resident.is_done && resident.name == name) {
                return Ok(());
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }

    /// Asks the process called `name` to end, and waits until it has with success.
    ///
    /// # Errors
    /// When it fails, or ended before.
    pub fn end(&mut self, name: &str) -> Result<(), Error> {
        self.look()?;
        let resident = self.residents.iter_mut().rfind(|r| r.name == name && !r.is_done);
        let Some(resident) = resident else {
            return Err(Error::Ended { name: name.to_owned(), how: "ended early".to_owned() });
        };
        signal(&resident.child, rustix::process::Signal::TERM);
        let status = resident.child.wait();
        let status =
            status.map_err(|why| Error::System { what: format!("wait for {name}"), why })?;
        resident.is_done = true;
        if status.success() {
            return Ok(());
        }
        Err(Error::Ended { name: name.to_owned(), how: how_ended(status) })
    }

    /// Looks at every process once.
    ///
    /// # Errors
    /// When one has ended that should not have.
    pub fn look(&mut self) -> Result<(), Error> {
        for resident in self.residents.iter_mut().filter(|resident| !resident.is_done) {
            let name = resident.name.clone();
            let status = resident
                .child
                .try_wait()
                .map_err(|why| Error::System { what: format!("look at {name}"), why })?;
            let Some(status) = status else { continue };
            resident.is_done = true;
            if resident.until == Until::Stopped || !status.success() {
                return Err(Error::Ended { name, how: how_ended(status) });
            }
        }
        Ok(())
    }

    /// Stops every process and makes sure that nothing of the court is left in shared memory.
    ///
    /// # Errors
    /// When something is left all the same.
    pub fn stop(mut self) -> Result<(), Error> {
        self.end_all();
        let names = close_court(&self.court)?;
        if names.is_empty() { Ok(()) } else { Err(Error::LeftBehind { names }) }
    }

    fn end_all(&mut self) {
        let residents = self.residents.iter_mut().filter(|resident| !resident.is_done);
        let mut children: Vec<&mut Child> = Vec::new();
        for resident in residents {
            resident.is_done = true;
            children.push(&mut resident.child);
        }
        processes::end_all(&mut children);
    }
}

impl Drop for Household {
    fn drop(&mut self) {
        self.end_all();
        // After `stop` there is nothing to do; after an error this is the last chance.
        let _ = close_court(&self.court);
    }
}

/// Where a binary stands beside the running one.
///
/// # Errors
/// When it is not built.
pub fn binary(name: &str) -> Result<PathBuf, Error> {
    binary_in(&binaries()?, name)
}

fn binary_in(folder: &Path, name: &str) -> Result<PathBuf, Error> {
    processes::binary(folder, name).ok_or_else(|| Error::NotBuilt { path: folder.join(name) })
}

fn binaries() -> Result<PathBuf, Error> {
    processes::folder()
        .map_err(|why| Error::System { what: "find the running binary".to_owned(), why })
}

/// The court of this process: its number makes it unique, `what` says whose it is. What courts of
/// killed processes of this kind left in shared memory is removed.
///
/// # Errors
/// When shared memory cannot be looked at.
pub fn own_court(what: &str) -> Result<String, Error> {
    for court in dev_shm::courts()? {
        let number = court.strip_prefix(what).and_then(|rest| rest.strip_prefix('-'));
        let is_gone = |number: &str| !Path::new("/proc").join(number).exists();
        if number.is_some_and(is_gone) {
            close_court(&court)?;
        }
    }
    Ok(format!("{what}-{}", std::process::id()))
}

/// Ends all domains of a court; names of what its processes leaked.
fn close_court(court: &str) -> Result<Vec<String>, Error> {
    let mut leaked = Vec::new();
    for place in [Place::Fusion, Place::Board(Camera::Left), Place::Board(Camera::Right)] {
        leaked.extend(Domain::new(court, place)?.close()?);
    }
    Ok(leaked)
}

/// A TCP endpoint on loopback that was free a moment ago.
///
/// # Errors
/// When the system has none.
pub fn free_endpoint() -> Result<String, Error> {
    let address = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr());
    let address =
        address.map_err(|why| Error::System { what: "find a free TCP port".to_owned(), why })?;
    Ok(format!("tcp/{address}"))
}

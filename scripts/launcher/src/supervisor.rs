//! Plans → processes that run, and are started again when they die.
//!
//! A death is noticed by the kernel's file of the process, not by looking now and then: what is
//! started again at once is there some milliseconds later. One that ends with success was told to,
//! by a command or because the recording is over.

use crate::back_off::BackOff;
use crate::plans::{Plan, Role};
use crate::processes::{self, alone, binary, end_all, how_ended, pid, signal};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fd::OwnedFd;
use rustix::process::{PidfdFlags, Signal, pidfd_open};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use shm_layout::stop::exit_code;
use std::io;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

/// Capture is waited for so long before the others are asked to end, too.
const CAPTURE_WITHIN: Duration = Duration::from_secs(1);

/// A worker is done with a frame within this; one that is not loses the last.
const LAST_FRAME_WITHIN: Duration = Duration::from_millis(30);

/// What became of a process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// It died, and is started again after a while.
    Died {
        /// Its name.
        name: String,
        /// "was killed by signal 9", "failed with exit code 69 (no camera)".
        how: String,
        /// How long until then.
        wait: Duration,
    },
    /// Nothing of this board is to go on: the recording is over, or a command said so.
    Over,
    /// Its flags are wrong, and it has said which.
    Misused {
        /// Its name.
        name: String,
    },
}

#[derive(Debug)]
enum State {
    Running { child: Child, ends: Option<OwnedFd>, since: Instant },
    Waiting { until: Instant, why: String },
    Ended,
}

#[derive(Debug)]
struct Resident {
    plan: Plan,
    binary: PathBuf,
    state: State,
    back_off: BackOff,
    n_restarts: u64,
}

/// The processes of one board.
#[derive(Debug)]
pub struct Supervisor {
    residents: Vec<Resident>,
    /// What stands before capture's command to give it a real-time priority.
    real_time: Vec<&'static str>,
}

impl Supervisor {
    /// Nothing runs yet; `Err` is a binary that is not there.
    ///
    /// # Errors
    /// The path of a binary that is not in `folder`.
    pub fn new(plans: Vec<Plan>, folder: &std::path::Path) -> Result<Self, PathBuf> {
        let mut residents = Vec::new();
        for plan in plans {
            let name = plan.role.binary();
            let binary = binary(folder, name).ok_or_else(|| folder.join(name))?;
            let state = State::Waiting { until: Instant::now(), why: String::new() };
            let (back_off, n_restarts) = (BackOff::default(), 0);
            residents.push(Resident { plan, binary, state, back_off, n_restarts });
        }
        Ok(Self { residents, real_time: Vec::new() })
    }

    /// Capture is started by this command, which runs the rest of its line.
    pub fn set_real_time(&mut self, command: &[&'static str]) {
        self.real_time = command.to_vec();
    }

    /// Starts whoever is due.
    pub fn start_due(&mut self, now: Instant) -> Vec<Event> {
        let mut events = Vec::new();
        for resident in &mut self.residents {
            let State::Waiting { until, why } = &resident.state else { continue };
            if *until > now {
                continue;
            }
            let is_again = !why.is_empty();
            let real_time: &[&str] =
                if resident.plan.role == Role::Capture { &self.real_time } else { &[] };
            match started(&resident.plan, &resident.binary, real_time) {
                Ok(child) => {
                    let ends = pid(&child).and_then(|p| pidfd_open(p, PidfdFlags::empty()).ok());
                    resident.n_restarts += u64::from(is_again);
                    resident.state = State::Running { child, ends, since: now };
                }
                Err(why) => {
                    let how = format!("cannot be started: {why}");
                    events.push(resident.died(how, Duration::ZERO, now));
                }
            }
        }
        events
    }

    /// Waits until somebody dies or is due, a signal comes, or `most` has passed.
    pub fn wait(&self, most: Duration) {
        let now = Instant::now();
        let due = self.residents.iter().filter_map(|resident| match &resident.state {
            State::Waiting { until, .. } => Some(until.saturating_duration_since(now)),
            _ => None,
        });
        let timeout = due.min().unwrap_or(most).min(most);
        let fds = self.residents.iter().filter_map(|resident| match &resident.state {
            State::Running { ends: Some(ends), .. } => Some(PollFd::new(ends, PollFlags::IN)),
            _ => None,
        });
        let mut fds: Vec<PollFd<'_>> = fds.collect();
        let timeout = timeout.try_into().ok();
        // Interrupted by a signal or not: the caller looks.
        let _ = poll(&mut fds, timeout.as_ref());
    }

    /// Looks who has ended.
    ///
    /// # Errors
    /// When the system does not tell.
    pub fn look(&mut self, now: Instant) -> io::Result<Vec<Event>> {
        let mut events = Vec::new();
        for resident in &mut self.residents {
            let State::Running { child, since, .. } = &mut resident.state else { continue };
            let Some(status) = child.try_wait()? else { continue };
            let lived = now.saturating_duration_since(*since);
            events.push(match code_of(status) {
                Some(0) if resident.plan.role != Role::Worker => {
                    resident.state = State::Ended;
                    Event::Over
                }
                Some(exit_code::MISUSED) => {
                    resident.state = State::Ended;
                    Event::Misused { name: resident.plan.name.clone() }
                }
                _ => resident.died(how(resident.plan.role, status), lived, now),
            });
        }
        Ok(events)
    }

    /// Workers that were started.
    #[must_use]
    pub fn n_workers(&self) -> u32 {
        let workers = self.residents.iter().filter(|resident| resident.plan.role == Role::Worker);
        workers.count() as u32
    }

    /// Kills a worker that has run for so long, if it has; it is started again like any dead one.
    pub fn kill_worker(&mut self, strip_idx: u32, lived: Duration) -> bool {
        let mut workers =
            self.residents.iter().filter(|resident| resident.plan.role == Role::Worker);
        match workers.nth(strip_idx as usize).map(|worker| &worker.state) {
            Some(State::Running { child, since, .. }) if since.elapsed() >= lived => {
                signal(child, Signal::KILL);
                true
            }
            _ => false,
        }
    }

    /// How often something was started again.
    #[must_use]
    pub fn n_restarts(&self) -> u64 {
        self.residents.iter().map(|resident| resident.n_restarts).sum()
    }

    /// Who does not run, and why: "capture failed with exit code 69 (no camera)".
    #[must_use]
    pub fn waiting(&self) -> Vec<String> {
        let waiting = self.residents.iter().filter_map(|resident| match &resident.state {
            State::Waiting { why, .. } => Some(format!("{} {why}", resident.plan.name)),
            _ => None,
        });
        waiting.collect()
    }

    /// Names and process numbers of those that run.
    #[must_use]
    pub fn running(&self) -> Vec<(&str, u32)> {
        let running = self.residents.iter().filter_map(|resident| match &resident.state {
            State::Running { child, .. } => Some((resident.plan.name.as_str(), child.id())),
            _ => None,
        });
        running.collect()
    }

    /// Ends all; how many had to be killed. Capture goes first, so that the others are done with
    /// its last frame.
    pub fn end(&mut self) -> usize {
        let begun = Instant::now();
        for resident in &mut self.residents {
            let State::Running { child, .. } = &mut resident.state else { continue };
            if resident.plan.role == Role::Capture {
                signal(child, Signal::TERM);
                while matches!(child.try_wait(), Ok(None)) && begun.elapsed() < CAPTURE_WITHIN {
                    std::thread::sleep(processes::LOOK_EVERY);
                }
                std::thread::sleep(LAST_FRAME_WITHIN);
            }
        }
        let running = self.residents.iter_mut().filter_map(|resident| match &mut resident.state {
            State::Running { child, .. } => Some(child),
            _ => None,
        });
        end_all(&mut running.collect::<Vec<&mut Child>>())
    }
}

impl Drop for Supervisor {
    fn drop(&mut self) {
        self.end();
    }
}

impl Resident {
    fn died(&mut self, how: String, lived: Duration, now: Instant) -> Event {
        let wait = self.back_off.update(lived);
        self.state = State::Waiting { until: now + wait, why: how.clone() };
        Event::Died { name: self.plan.name.clone(), how, wait }
    }
}

/// Starts a process on its cores: it inherits them from this thread, before its first instruction.
fn started(plan: &Plan, binary: &std::path::Path, before: &[&str]) -> io::Result<Child> {
    let mut command = match before {
        [first, rest @ ..] => {
            let mut command = Command::new(first);
            command.args(rest).arg(binary);
            command
        }
        [] => Command::new(binary),
    };
    command.args(&plan.arguments).env_remove("NOTIFY_SOCKET").env_remove("WATCHDOG_USEC");
    let ours = if plan.cores.is_empty() { None } else { sched_getaffinity(None).ok() };
    let mut cores = CpuSet::new();
    plan.cores.iter().for_each(|core| cores.set(*core));
    if ours.is_some()
        && let Err(why) = sched_setaffinity(None, &cores)
    {
        tracing::debug!("{} is not pinned to {:?}: {why}", plan.name, plan.cores);
    }
    let child = alone(command).spawn();
    if let Some(Err(why)) = ours.map(|ours| sched_setaffinity(None, &ours)) {
        tracing::debug!("the launcher stays on {:?}: {why}", plan.cores);
    }
    child
}

/// An exit code is eight bits.
fn code_of(status: ExitStatus) -> Option<u8> {
    status.code().and_then(|code| u8::try_from(code).ok())
}

/// How a process ended; what capture means by its exit codes is said.
fn how(role: Role, status: ExitStatus) -> String {
    let meaning = match (role, code_of(status)) {
        (Role::Capture, Some(exit_code::UNAVAILABLE)) => " (no camera)",
        (Role::Capture, Some(exit_code::TEMPORARY)) => " (camera busy or unplugged)",
        (Role::Capture, Some(exit_code::NO_PERMISSION)) => " (no permission)",
        (Role::Capture, Some(exit_code::CONFIGURATION)) => " (the camera cannot do this)",
        _ => "",
    };
    how_ended(status) + meaning
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    /// A folder with one binary, which is a script.
    fn folder(script: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("capture");
        std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        folder
    }

    fn capture(cores: Vec<usize>) -> Vec<Plan> {
        let (role, name, arguments) = (Role::Capture, "capture".to_owned(), Vec::new());
        vec![Plan { role, name, arguments, cores }]
    }

    /// Events until there were `n`.
    fn events(supervisor: &mut Supervisor, n: usize) -> Vec<Event> {
        let mut events = Vec::new();
        while events.len() < n {
            supervisor.start_due(Instant::now());
            supervisor.wait(Duration::from_secs(60));
            events.extend(supervisor.look(Instant::now()).unwrap());
        }
        events
    }

    #[test]
    fn a_camera_that_is_not_there_is_tried_again_later_and_later() {
        let folder = folder("exit 69");
        let mut supervisor = Supervisor::new(capture(Vec::new()), folder.path()).unwrap();
        let events = events(&mut supervisor, 3);
        let died = |wait_ms| Event::Died {
            name: "capture".to_owned(),
            how: "failed with exit code 69 (no camera)".to_owned(),
            wait: Duration::from_millis(wait_ms),
        };
        assert_eq!(events, [died(0), died(100), died(200)]);
        assert_eq!(supervisor.n_restarts(), 2);
        assert_eq!(supervisor.waiting(), ["capture failed with exit code 69 (no camera)"]);
        assert!(supervisor.running().is_empty());
    }

    #[test]
    fn success_is_the_end_and_misuse_is_not_tried_again() {
        let over = folder("exit 0");
        let mut supervisor = Supervisor::new(capture(Vec::new()), over.path()).unwrap();
        assert_eq!(events(&mut supervisor, 1), [Event::Over]);
        let misused = folder("exit 2");
        let mut supervisor = Supervisor::new(capture(Vec::new()), misused.path()).unwrap();
        assert_eq!(events(&mut supervisor, 1), [Event::Misused { name: "capture".to_owned() }]);
    }

    #[test]
    fn a_process_has_its_cores_from_the_start_and_we_keep_ours() {
        let ours = sched_getaffinity(None).unwrap();
        let core = (0..CpuSet::MAX_CPU).find(|core| ours.is_set(*core)).unwrap();
        let list = "$(sed -n 's/^Cpus_allowed_list:.//p' /proc/self/status)";
        let folder = folder(&format!("[ {list} = {core} ] && exit 0; exit 1"));
        let mut supervisor = Supervisor::new(capture(vec![core]), folder.path()).unwrap();
        assert_eq!(events(&mut supervisor, 1), [Event::Over]);
        assert_eq!(sched_getaffinity(None).unwrap(), ours);
    }

    #[test]
    fn a_binary_that_is_not_there_is_named() {
        let folder = folder("");
        std::fs::remove_file(folder.path().join("capture")).unwrap();
        let missing = Supervisor::new(capture(Vec::new()), folder.path()).unwrap_err();
        assert_eq!(missing, folder.path().join("capture"));
    }
}

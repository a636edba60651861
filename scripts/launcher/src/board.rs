//! Flags → a board that runs until it is stopped.

use crate::account::Counts;
use crate::claim::Claim;
use crate::flags::Flags;
use crate::memory::Memory;
use crate::plans;
use crate::status::{Status, Words};
use crate::stuck::STUCK_AFTER;
use crate::supervisor::{Event, Supervisor};
use crate::{Error, processes, systemd};
use rustix::thread::{CpuSet, sched_getaffinity};
use shm_layout::machine;
use shm_layout::services::{Domain, Place};
use shm_layout::stop::{LOOK_EVERY, Stop};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// How often it is said how the board is.
const STATUS_EVERY: Duration = Duration::from_secs(1);

/// Processes of a launcher that was killed end within this.
const LEFT_OVER_WITHIN: Duration = Duration::from_secs(6);

/// Runs capture with a real-time priority: util-linux' own, so that nothing here is unsafe. Ten of
/// 99 is above everything ordinary and below the kernel's own threads.
const REAL_TIME: [&str; 3] = ["chrt", "--fifo", "10"];

/// Runs a board until `stop` is raised or its recording is over.
///
/// # Errors
/// When it cannot run at all; what a process dies of is said, and no error.
pub fn run(flags: &Flags, stop: &Stop) -> Result<(), Error> {
    let domain = Domain::new(&flags.court, Place::Board(flags.camera))?;
    let claim = Claim::of(&flags.court, flags.camera).map_err(system("claim the board"))?;
    let _claim =
        claim.ok_or_else(|| Error::Claimed { court: flags.court.clone(), camera: flags.camera })?;
    let folder = processes::folder().map_err(system("find the running binary"))?;
    let plans = plans::from_flags(flags, &cores());
    let mut supervisor =
        Supervisor::new(plans, &folder).map_err(|path| Error::NotBuilt { path })?;
    clear(&domain, stop)?;
    if may_be_real_time() {
        supervisor.set_real_time(&REAL_TIME);
    }
    let after_bridge = flags.of_capture().iter().any(|word| word == "--wait-for-bridge");
    let mut memory = opened(&domain, after_bridge)?;

    let words = Words::new(format!("board {}", flags.camera));
    let mut board = Board { words, domain: &domain, supervisor, told: Told::default() };
    let outcome = board.supervise(&mut memory, stop);
    systemd::stopping();
    let n_killed = board.supervisor.end();
    memory.take()?;
    let Counts { n_frames, n_complete, n_lost, .. } = memory.account.counts(true);
    drop(memory);
    // Somebody may listen: what that one has open is not ours to remove.
    let left = if is_empty(&domain)? { domain.close()? } else { Vec::new() };
    let n_restarts = board.supervisor.n_restarts();
    board.words.say(&format!(
        "stopped: {n_frames} frames, {n_complete} complete, {n_lost} lost, {n_restarts} restarts"
    ));
    if n_killed > 0 {
        board.words.say(&format!("{n_killed} processes did not end and were killed"));
    }
    if !left.is_empty() {
        board.words.say(&format!("removed from /dev/shm what nobody answers for: {left:?}"));
    }
    outcome
}

struct Board<'a> {
    words: Words,
    domain: &'a Domain,
    supervisor: Supervisor,
    told: Told,
}

/// When the status was told last, and the counts then.
struct Told {
    at: Instant,
    counts: Counts,
}

impl Default for Told {
    fn default() -> Self {
        Self { at: Instant::now(), counts: Counts::default() }
    }
}

impl Board<'_> {
    fn supervise(&mut self, memory: &mut Memory, stop: &Stop) -> Result<(), Error> {
        let mut is_ready = false;
        while !stop.is_raised() {
            let now = Instant::now();
            let mut events = self.supervisor.start_due(now);
            if !is_ready {
                is_ready = true;
                systemd::ready();
            }
            self.supervisor.wait(LOOK_EVERY);
            let looked = self.supervisor.look(Instant::now());
            events.extend(looked.map_err(system("look at the processes"))?);
            for event in events {
                match event {
                    Event::Died { name, how, wait } => self.bury(&name, &how, wait),
                    Event::Over => return Ok(()),
                    Event::Misused { name } => return Err(Error::Misused { name }),
                }
            }
            memory.take()?;
            self.kill_stuck(memory);
            if self.told.at.elapsed() >= STATUS_EVERY {
                self.tell(memory);
            }
        }
        Ok(())
    }

    /// What it held is given back before its next life begins.
    fn bury(&self, name: &str, how: &str, wait: Duration) {
        if let Err(why) = self.domain.remove_stale() {
            tracing::warn!("what {name} held is not given back: {why}"); // its next life tries, too
        }
        let again = match wait {
            Duration::ZERO => "started again at once".to_owned(),
            wait => format!("started again in {} s", wait.as_secs_f64()),
        };
        self.words.say(&format!("{name} {how}; {again}"));
    }

    /// A worker that does nothing is no better than a dead one.
    fn kill_stuck(&mut self, memory: &mut Memory) {
        for idx in memory.answers.stuck(self.supervisor.n_workers(), Instant::now()) {
            if self.supervisor.kill_worker(idx, STUCK_AFTER) {
                let seconds = STUCK_AFTER.as_secs();
                self.words.say(&format!(
                    "worker {idx} is done with no frame for {seconds} s: it is killed"
                ));
            }
            memory.answers.update(idx);
        }
    }

    fn tell(&mut self, memory: &Memory) {
        let (now, counts) = (Instant::now(), memory.account.counts(false));
        let elapsed_s = (now - self.told.at).as_secs_f64();
        let before = std::mem::replace(&mut self.told, Told { at: now, counts }).counts;
        let n_complete = (counts.n_complete - before.n_complete) as f64;
        let n_candidates = (counts.n_candidates - before.n_candidates) as f64;
        let sys = Path::new("/sys");
        let status = Status {
            frame_rate_hz: (counts.n_frames - before.n_frames) as f64 / elapsed_s,
            counts,
            candidates_per_frame: n_candidates / n_complete.max(1.0),
            clock_sigma_ns: memory.clock_sigma_ns(),
            cpu_celsius: machine::cpu_celsius(sys),
            is_throttled: machine::is_throttled(sys),
            n_restarts: self.supervisor.n_restarts(),
            waiting: self.supervisor.waiting(),
        };
        let line = status.line();
        systemd::alive(&line);
        self.words.show(&line, now);
    }
}

/// The board's shared memory. Whoever was killed while it made a service may have left half of one,
/// which nobody accounts for: all is removed then, if nobody is there.
fn opened(domain: &Domain, after_bridge: bool) -> Result<Memory, Error> {
    match Memory::open(domain, after_bridge) {
        Err(why) if !is_empty(domain)? => Err(why.into()),
        Err(why) => {
            tracing::warn!("{why}: what is left in shared memory is removed");
            domain.close()?;
            Ok(Memory::open(domain, after_bridge)?)
        }
        Ok(memory) => Ok(memory),
    }
}

fn is_empty(domain: &Domain) -> Result<bool, Error> {
    Ok(domain.members()?.iter().all(|member| !member.is_alive))
}

/// Waits for the processes of a launcher that was killed, and removes what they left.
fn clear(domain: &Domain, stop: &Stop) -> Result<(), Error> {
    let begun = Instant::now();
    loop {
        let members = domain.members()?;
        let ours = |name: &str| {
            ["capture", "bridge", "launcher"].contains(&name) || name.starts_with("worker-")
        };
        let alive: Vec<String> = members
            .iter()
            .filter(|member| member.is_alive && ours(&member.name))
            .map(|member| format!("{} ({})", member.name, member.process_id))
            .collect();
        if alive.is_empty() {
            domain.remove_stale()?;
            return Ok(());
        }
        if stop.is_raised() || begun.elapsed() > LEFT_OVER_WITHIN {
            return Err(Error::StillRunning { names: alive });
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

/// The cores that this process may use.
fn cores() -> Vec<usize> {
    let Ok(set) = sched_getaffinity(None) else { return Vec::new() };
    (0..CpuSet::MAX_CPU).filter(|core| set.is_set(*core)).collect()
}

/// Whether the system lets us: asked by doing it once.
fn may_be_real_time() -> bool {
    let mut command = Command::new(REAL_TIME[0]);
    command.args(&REAL_TIME[1..]).arg("true").stdin(Stdio::null());
    let is_allowed = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
    let is_allowed = is_allowed.is_ok_and(|status| status.success());
    if !is_allowed {
        tracing::debug!("capture runs at an ordinary priority: no real-time one is allowed");
    }
    is_allowed
}

fn system(what: &str) -> impl Fn(std::io::Error) -> Error + '_ {
    move |why| Error::System { what: what.to_owned(), why }
}

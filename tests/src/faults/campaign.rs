//! A site and a seed → its processes killed and stood still at random, and how it took that.

use super::gauges::Gauges;
use super::part::Part;
use super::report::{Inputs, Report};
use super::served::{Held, Served};
use super::site::Site;
use anyhow::{Context as _, ensure};
use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rustix::process::{Pid, Signal, kill_process};
use serde::Serialize;
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use shm_layout::{Camera, StampNs};
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A part that is not back after so long will not be.
const GIVE_UP_AFTER: Duration = Duration::from_secs(30);

/// Workers learn the background before balls are counted.
const LEARNING: Duration = Duration::from_secs(3);

/// The last balls are told within this.
const LAST_SHOT_WITHIN_NS: i64 = 1_500_000_000;

/// How often processes are gauged.
const GAUGE_EVERY: Duration = Duration::from_secs(5);

/// For how long a part is stood still: a worker that is longer is taken for stuck, and killed.
const STILL_MS: std::ops::Range<u64> = 100..1500;

/// What is done, and for how long.
#[derive(Debug, Clone, Serialize)]
pub struct Plan {
    /// Of chance.
    pub seed: u64,
    /// At first nothing is done, s.
    pub calm_s: f64,
    /// Then faults come for so long, s.
    pub faults_s: f64,
    /// And no more than so many.
    pub n_faults: usize,
    /// From a recovery to the next fault, s: between these.
    pub pause_s: [f64; 2],
    /// Whom they meet, each as likely.
    #[serde(skip)]
    pub parts: Vec<Part>,
    /// Part of the faults that stand a process still (SIGSTOP) in place of killing it (SIGKILL).
    pub still_share: f64,
}

/// What was done to a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// SIGKILL.
    Killed,
    /// SIGSTOP, and SIGCONT later.
    Still,
}

/// A fault, and what followed.
#[derive(Debug, Clone)]
pub struct Fault {
    /// Whom it met.
    pub part: Part,
    /// What was done.
    pub kind: Kind,
    /// When.
    pub at_ns: StampNs,
    /// When the process was let go on; for a killed one when it was killed.
    pub until_ns: StampNs,
    /// When the part did its work again.
    pub recovered_ns: StampNs,
    /// Other parts that were not the same process afterwards.
    pub took_along: Vec<Part>,
}

impl Fault {
    /// How long the part was away by itself, ms.
    #[must_use]
    pub fn recovery_ms(&self) -> f64 {
        (self.recovered_ns - self.until_ns).max(0) as f64 * 1e-6
    }
}

/// A shot as it came.
#[derive(Debug, Clone, Copy)]
pub struct Told {
    /// Held against the truth.
    pub held: Held,
    /// From the bounce until it was read, ms; not a number without a bounce.
    pub after_ms: f64,
}

/// Does as planned; `say` hears how far it is, 0 to 1.
///
/// # Errors
/// When a part does not come back, or it was stopped.
pub fn run(
    site: Site,
    plan: &Plan,
    stop: &Stop,
    mut say: impl FnMut(f64),
) -> anyhow::Result<Report> {
    let listener = Listener::start(&site)?;
    let mut chance = ChaCha8Rng::seed_from_u64(plan.seed);
    let mut gauges = Gauges::default();
    let mut faults: Vec<Fault> = Vec::new();
    std::thread::sleep(LEARNING);
    let (begun, begun_ns) = (Instant::now(), now_ns());
    let calm = Duration::from_secs_f64(plan.calm_s);
    let whole = calm + Duration::from_secs_f64(plan.faults_s);
    let (mut gauge_at, mut fault_at) = (begun, begun + calm);
    let mut calm_ended_ns = None;
    while begun.elapsed() < whole {
        ensure!(!stop.is_raised(), crate::processes::Error::Stopped);
        let now = Instant::now();
        if now >= gauge_at {
            gauges.update(&site)?;
            gauge_at = now + GAUGE_EVERY;
        }
        if now >= fault_at {
            calm_ended_ns.get_or_insert_with(now_ns);
            if faults.len() == plan.n_faults {
                break;
            }
            faults.push(do_fault(&site, &listener, plan, &mut chance)?);
            let pause_s = chance.random_range(plan.pause_s[0]..=plan.pause_s[1]);
            fault_at = Instant::now() + Duration::from_secs_f64(pause_s);
        }
        let by_time = begun.elapsed().as_secs_f64() / whole.as_secs_f64();
        say(by_time.max(faults.len() as f64 / plan.n_faults.max(1) as f64).min(1.0));
        std::thread::sleep(Duration::from_millis(5));
    }
    let ended_ns = now_ns();
    let calm_ended_ns = calm_ended_ns.unwrap_or(ended_ns);
    gauges.update(&site)?;
    site.stop_frames()?;
    let told = listener.end()?;
    let seen_on_boards = site.on_boards.each_ref().map(|witness| witness.seen().clone());
    let seen_at_fusion = site.at_fusion.seen().clone();
    let served = site.served.bounced_within([begun_ns, ended_ns - LAST_SHOT_WITHIN_NS]);
    let (ends, n_restarts_at_start) = (site.ends(), site.n_restarts_at_start);
    let (boards, left) = site.end()?;
    Ok(Report::new(Inputs {
        plan: plan.clone(),
        windows_ns: [[begun_ns, calm_ended_ns], [calm_ended_ns, ended_ns]],
        served,
        told,
        faults,
        gauges,
        seen_on_boards,
        seen_at_fusion,
        ends,
        n_restarts_at_start,
        boards,
        left,
    }))
}

fn do_fault(
    site: &Site,
    listener: &Listener,
    plan: &Plan,
    chance: &mut ChaCha8Rng,
) -> anyhow::Result<Fault> {
    let part = *plan.parts.choose(chance).context("nobody for a fault to meet")?;
    let is_still = chance.random_bool(plan.still_share);
    let still = Duration::from_millis(chance.random_range(STILL_MS));
    let before = site.running();
    let pid = before.iter().find(|(other, _)| *other == part).map(|(_, pid)| *pid);
    let pid = pid.with_context(|| format!("{part} does not run"))?;
    let at_ns = now_ns();
    let kind = if is_still { Kind::Still } else { Kind::Killed };
    if is_still {
        kill_process(pid, Signal::STOP).context("stand a process still")?;
        std::thread::sleep(still);
        kill_process(pid, Signal::CONT).context("let a process go on")?;
    } else {
        kill_process(pid, Signal::KILL).context("kill a process")?;
    }
    let until_ns = if is_still { now_ns() } else { at_ns };
    let mut recovered_ns = None;
    let what = format!("recovery of {part} ({kind:?})");
    site.wait_until(&what, GIVE_UP_AFTER, || {
        recovered_ns = recovered(site, listener, part, (kind, pid), until_ns);
        recovered_ns.is_some()
    })?;
    let after = site.running();
    let is_other = |&(other, pid): &(Part, Pid)| other != part && !after.contains(&(other, pid));
    let took_along = before.iter().filter(|entry| is_other(entry)).map(|(other, _)| *other);
    let took_along = took_along.collect();
    let recovered_ns = recovered_ns.unwrap_or_default();
    Ok(Fault { part, kind, at_ns, until_ns, recovered_ns, took_along })
}

/// When a part did its work again after `since_ns`, if it does.
fn recovered(
    site: &Site,
    listener: &Listener,
    part: Part,
    (kind, pid): (Kind, Pid),
    since_ns: StampNs,
) -> Option<StampNs> {
    let frames_of = |camera: Camera| {
        let last = site.at_fusion.seen().last[camera.idx()];
        last.complete_ns.filter(|_| last.published_ns > since_ns)
    };
    let is_new = || kind == Kind::Still || part.process(&site.court).is_ok_and(|new| new != pid);
    match part {
        Part::Capture(camera) | Part::Worker(camera, _) | Part::BoardBridge(camera) => {
            frames_of(camera)
        }
        Part::FusionBridge => {
            let [left, right] = Camera::BOTH.map(frames_of);
            Some(left?.max(right?))
        }
        Part::Fusion => listener.taken_after(since_ns).filter(|_| is_new()),
        Part::Page => (is_new() && answers(&site.page)).then(now_ns),
        Part::Recorder => (is_new() && site.newest_recording_grows_since(since_ns)).then(now_ns),
    }
}

/// Whether the page answers a request.
fn answers(page: &str) -> bool {
    let ask = || -> std::io::Result<bool> {
        let mut stream = TcpStream::connect(page)?;
        stream.set_read_timeout(Some(Duration::from_secs(1)))?;
        let head = format!("GET /api/v1/status HTTP/1.1\r\nHost: {page}\r\n");
        write!(stream, "{head}Connection: close\r\n\r\n")?;
        let mut answer = [0; 12];
        stream.read_exact(&mut answer)?;
        Ok(answer.ends_with(b"200"))
    };
    ask().unwrap_or(false)
}

/// Reads shots, and how far fusion has come.
#[derive(Debug)]
struct Listener {
    told: Arc<Mutex<Vec<Told>>>,
    taken_ns: Arc<AtomicI64>,
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<Result<(), shm_layout::services::Error>>,
}

impl Listener {
    fn start(site: &Site) -> anyhow::Result<Self> {
        let domain = Domain::new(&site.court, Place::Fusion)?;
        let served: Served = site.served.clone();
        let told: Arc<Mutex<Vec<Told>>> = Arc::default();
        let (taken_ns, is_over): (Arc<AtomicI64>, Arc<AtomicBool>) = Default::default();
        let (reads, is_reading) = std::sync::mpsc::channel();
        let thread = std::thread::spawn({
            let (told, taken_ns) = (Arc::clone(&told), Arc::clone(&taken_ns));
            let is_over = Arc::clone(&is_over);
            move || {
                let member = domain.join("listener")?;
                let (shots, taken) = (member.shots()?.reader()?, member.taken()?.reader()?);
                let _ = reads.send(()); // who started this one may be gone
                while !is_over.load(Ordering::Relaxed) {
                    while let Some(shot) = shots.receive()? {
                        let after_ms = match shot.is_measured {
                            0 => f64::NAN,
                            _ => (now_ns() - shot.bounce_ns) as f64 * 1e-6,
                        };
                        let shot = Told { held: served.held(&shot), after_ms };
                        told.lock().unwrap_or_else(PoisonError::into_inner).push(shot);
                    }
                    while taken.receive()?.is_some() {
                        taken_ns.store(now_ns(), Ordering::Relaxed);
                    }
                    std::thread::sleep(Duration::from_millis(1));
                }
                Ok(())
            }
        });
        is_reading.recv().context("the listener cannot read")?;
        Ok(Self { told, taken_ns, is_over, thread })
    }

    fn taken_after(&self, since_ns: StampNs) -> Option<StampNs> {
        Some(self.taken_ns.load(Ordering::Relaxed)).filter(|at_ns| *at_ns > since_ns)
    }

    fn end(self) -> anyhow::Result<Vec<Told>> {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().map_err(|_| anyhow::anyhow!("the listener panicked"))??;
        Ok(std::mem::take(&mut self.told.lock().unwrap_or_else(PoisonError::into_inner)))
    }
}

//! Many courts behind one router → what each costs and how soon its candidates and shots arrive.
//!
//! Every court is two boards that are not there ([`Board`]), their real bridges, the real bridge
//! beside fusion and a reader in fusion's place ([`Listener`]); all bridges connect to one
//! `bridge router`, and one `bridge follow` hears the shots of all. Everything runs on this
//! machine, so its processor is shared by what would be three computers a court.

use crate::link::board::Board;
use crate::link::heard::{Heard, Listener};
use crate::link::latency::Latency;
use crate::link::{Error, Times};
use crate::processes::{self, Household, Until, free_endpoint};
use serde::Serialize;
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use shm_layout::text::TextWriter;
use shm_layout::{Camera, StampNs};
use std::io::{BufRead as _, BufReader};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest all bridges may take to meet.
const MEET_WITHIN: Duration = Duration::from_secs(60);
/// A machine serves a ball this often.
const SHOT_EVERY: Duration = Duration::from_secs(3);
/// A shot of a flight seen in 150 frames is about this long.
const SHOT_BYTES: usize = 40_000;
/// A tick of /proc/<pid>/stat.
const TICKS_PER_S: f64 = 100.0;

/// What was seen of one court.
#[derive(Debug, Clone, Serialize)]
pub struct CourtReport {
    /// Strips its boards wrote, and those that arrived.
    pub n_strips: [usize; 2],
    /// From a board's shared memory to fusion's.
    pub latency: Latency,
    /// Share of one core that its three bridges take.
    pub cores: f64,
}

/// What was seen of the club.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// How long all played.
    pub seconds: f64,
    /// One for each court.
    pub courts: Vec<CourtReport>,
    /// Share of one core that the router takes.
    pub router_cores: f64,
    /// Batches through the router each second: infos and candidates.
    pub batches_per_s: f64,
    /// Shots written, and those that the follower printed.
    pub n_shots: [usize; 2],
    /// From fusion's shared memory to the follower's line.
    pub shot_latency: Latency,
}

/// Kills its process when dropped.
struct Single(Child);

impl Drop for Single {
    fn drop(&mut self) {
        // It may have ended by itself: then there is nobody to kill.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

struct Court {
    house: Household,
    listener: Listener,
    boards: Vec<Board>,
    shots: TextWriter,
    _member: shm_layout::services::Member,
}

/// Plays `n_courts` for so long.
///
/// # Errors
/// When processes or shared memory cannot be had, or a bridge ends early.
pub fn measure(n_courts: usize, play: Duration, stop: &Stop) -> Result<Report, Error> {
    let endpoint = free_endpoint()?;
    let binary = Household::new("club")?.binary("bridge")?;
    let start = |arguments: &[&str], stdout: Stdio| {
        let mut command = Command::new(&binary);
        let started = command.args(arguments).arg("--with-parent").stdout(stdout).spawn();
        let what = format!("start {}", binary.display());
        started.map(Single).map_err(|why| processes::Error::System { what, why })
    };
    let router = start(&["router", "--listen", &endpoint], Stdio::null())?;
    let mut follow = start(&["follow", "--connect", &endpoint], Stdio::piped())?;
    let lines = Lines::start(follow.0.stdout.take());
    let is_over = Arc::new(AtomicBool::new(false));
    let mut courts = Vec::new();
    for idx in 0..n_courts {
        courts.push(Court::start(
            &processes::own_court(&format!("club{idx}"))?,
            &endpoint,
            &is_over,
        )?);
    }
    let outcome = played(&mut courts, play, stop, &router);
    is_over.store(true, Ordering::Relaxed);
    let played = outcome?;
    let mut reports = Vec::new();
    for (court, cores) in courts.into_iter().zip(played.cores) {
        reports.push(court.finished(cores, played.begun_ns)?);
    }
    std::thread::sleep(Duration::from_millis(500));
    drop(follow);
    let shots_ns = lines.join()?;
    let seconds = played.seconds;
    let n_strips: usize = reports.iter().map(|court| court.n_strips[1]).sum();
    Ok(Report {
        seconds,
        router_cores: played.router_cores,
        // A board sends a batch for each strip and one for each frame's info.
        batches_per_s: n_strips as f64 * 1.5 / seconds,
        n_shots: [played.n_shots, shots_ns.len()],
        shot_latency: Latency::from_ns(shots_ns),
        courts: reports,
    })
}

struct Played {
    begun_ns: StampNs,
    seconds: f64,
    cores: Vec<f64>,
    router_cores: f64,
    n_shots: usize,
}

fn played(
    courts: &mut [Court],
    play: Duration,
    stop: &Stop,
    router: &Single,
) -> Result<Played, Error> {
    let started = Instant::now();
    while !courts.iter().all(|court| court.boards.iter().all(Board::is_playing)) {
        if started.elapsed() > MEET_WITHIN || stop.is_raised() {
            return Err(Error::NotMet);
        }
        for court in &mut *courts {
            court.house.look()?;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_secs(3)); // connections and clocks settle
    let before: Vec<f64> = courts.iter().map(Court::cpu_s).collect();
    let router_before = cpu_s(router.0.id());
    let (begun, begun_ns) = (Instant::now(), now_ns());
    let mut n_shots = 0;
    let mut due = Duration::ZERO;
    while begun.elapsed() < play && !stop.is_raised() {
        if begun.elapsed() >= due {
            due += SHOT_EVERY;
            for court in &mut *courts {
                court.house.look()?;
                let pad = " ".repeat(SHOT_BYTES);
                court.shots.send(&format!("{{\"sent_ns\":{}{pad}}}", now_ns()))?;
                n_shots += 1;
            }
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let seconds = begun.elapsed().as_secs_f64();
    let share = |court: &Court, before: &f64| (court.cpu_s() - before) / seconds;
    Ok(Played {
        begun_ns,
        seconds,
        cores: courts.iter().zip(&before).map(|(court, before)| share(court, before)).collect(),
        router_cores: (cpu_s(router.0.id()) - router_before) / seconds,
        n_shots,
    })
}

impl Court {
    fn start(name: &str, endpoint: &str, is_over: &Arc<AtomicBool>) -> Result<Self, Error> {
        let mut house = Household::new(name)?;
        let listener = Listener::start(name)?;
        let member = Domain::new(name, Place::Fusion)?.join("shots")?;
        let shots = member.shots_json()?.writer()?;
        let to_router = ["--connect", endpoint];
        let mut bridge = |what: &[&str]| {
            let arguments = [what, &to_router].concat();
            let name = format!("bridge {}", what.join(" "));
            house.start(&name, "bridge", &arguments, Until::Stopped, Stdio::null()).map(drop)
        };
        bridge(&["fusion"])?;
        let mut boards = Vec::new();
        for camera in Camera::BOTH {
            bridge(&["board", "--camera", camera.name()])?;
            boards.push(Board::start(name, camera, 0, Arc::clone(is_over))?);
        }
        Ok(Self { house, listener, boards, shots, _member: member })
    }

    fn cpu_s(&self) -> f64 {
        self.house.running().iter().map(|(_, pid)| cpu_s(*pid)).sum()
    }

    fn finished(self, cores: f64, begun_ns: StampNs) -> Result<CourtReport, Error> {
        let sent = self.boards.into_iter().map(Board::join).collect::<Result<Vec<_>, _>>()?;
        let n_sent = sent.iter().map(|sent| sent.n_strips()).sum();
        let heard: Heard = self.listener.join(n_sent, Duration::from_secs(3))?;
        // Settled when the measurement began, which Times takes for the start.
        let times = Times { begun_ns, cut_ns: None };
        let [latency, _] = Latency::from_heard(&sent, &heard, &times);
        drop((self.shots, self._member));
        self.house.stop()?;
        Ok(CourtReport { n_strips: [n_sent, heard.strips.len()], latency, cores })
    }
}

/// Times from a shot's writing to the follower's line.
struct Lines(JoinHandle<Vec<StampNs>>);

impl Lines {
    fn start(stdout: Option<ChildStdout>) -> Self {
        Self(std::thread::spawn(move || {
            let Some(stdout) = stdout else { return Vec::new() };
            let lines = BufReader::new(stdout).lines().map_while(Result::ok);
            lines.filter_map(|line| Some(now_ns() - sent_ns(&line)?)).collect()
        }))
    }

    fn join(self) -> Result<Vec<StampNs>, Error> {
        self.0.join().map_err(|_| Error::ThreadGone)
    }
}

fn sent_ns(line: &str) -> Option<StampNs> {
    let line: serde_json::Value = serde_json::from_str(line).ok()?;
    let shot: serde_json::Value = serde_json::from_str(line.get("shot")?.as_str()?).ok()?;
    shot.get("sent_ns")?.as_i64()
}

/// Processor time of a process so far; 0 once it is gone.
fn cpu_s(pid: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // After the name, which may hold spaces: state is the third field, utime the fourteenth.
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    let ticks: f64 = fields.skip(11).take(2).filter_map(|field| field.parse::<f64>().ok()).sum();
    ticks / TICKS_PER_S
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "{} courts through one router for {:.0} s", self.courts.len(), self.seconds)?;
        writeln!(f, "court  strips sent  arrived   p50 ms   p99 ms   max ms  cores")?;
        let ms = |ns: u64| ns as f64 * 1e-6;
        for (idx, court) in self.courts.iter().enumerate() {
            let ([sent, arrived], Latency { p50_ns, p99_ns, max_ns, .. }) =
                (court.n_strips, court.latency);
            writeln!(
                f,
                "{idx:5} {sent:12} {arrived:8} {:8.2} {:8.2} {:8.2} {:6.3}",
                ms(p50_ns),
                ms(p99_ns),
                ms(max_ns),
                court.cores
            )?;
        }
        let [sent, heard] = self.n_shots;
        writeln!(f, "router: {:.0} batches/s, {:.3} cores", self.batches_per_s, self.router_cores)?;
        let Latency { p50_ns, max_ns, .. } = self.shot_latency;
        writeln!(
            f,
            "shots of {SHOT_BYTES} bytes: {heard} of {sent} followed, p50 {:.1} ms, max {:.1} ms",
            ms(p50_ns),
            ms(max_ns)
        )
    }
}

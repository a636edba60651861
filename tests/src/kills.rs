//! A board whose processes are killed one after another, under load: how soon frames come again
//! beside fusion, what is lost, whether all count it alike, and what is left.
//!
//! The board is the real one: the launcher, capture playing at the speed of a camera, two workers
//! and the bridge; beside fusion another bridge and a [`Witness`]. One more watches on the board.

use crate::chain::Chain;
use crate::faults::part::process;
use crate::processes::{Household, free_endpoint};
use crate::witness::{Seen, Witness};
use anyhow::{Context as _, ensure};
use fusion::intake::{FrameCounts, Intake};
use launcher::processes;
use rustix::process::{Signal, kill_process};
use shm_layout::commands::{Command as Order, Kind};
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::{Camera, FrameInfo, StampNs, StripCandidates};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// Workers of the board.
pub const N_WORKERS: u32 = 2;

/// Frames between two deaths: whoever is killed has lived for more than two seconds then.
const N_BETWEEN: u64 = 70;

/// A board that is silent for so long will not speak again.
const GIVE_UP_AFTER: Duration = Duration::from_secs(30);

/// Messages of a killed bridge may have been on their way for so long.
const ON_THE_WAY_NS: i64 = 100_000_000;

/// Who is killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Victim {
    /// A worker, one strip after the other.
    Worker,
    /// The capture.
    Capture,
    /// The board's bridge.
    Bridge,
}

impl Victim {
    /// In the order of their deaths.
    pub const ALL: [Self; 3] = [Self::Worker, Self::Capture, Self::Bridge];

    /// Words of its command line.
    fn words(self, idx: usize) -> [String; 2] {
        let strip = (idx / Self::ALL.len()) as u32 % N_WORKERS;
        match self {
            Self::Worker => ["/worker ".to_owned(), format!("--strip {strip} ")],
            Self::Capture => ["/capture ".to_owned(), String::new()],
            Self::Bridge => ["/bridge board ".to_owned(), String::new()],
        }
    }
}

/// A death.
#[derive(Debug, Clone, Copy)]
pub struct Death {
    /// Whose.
    pub victim: Victim,
    /// When it was killed.
    pub killed_ns: StampNs,
    /// When the first frame published after that was complete beside fusion.
    pub resumed_ns: StampNs,
}

/// What came of it.
#[derive(Debug)]
pub struct Report {
    /// In their order.
    pub deaths: Vec<Death>,
    /// Files of the court in /dev/shm and the root folder, before each death.
    pub n_files: Vec<usize>,
    /// The same after the launcher was asked to end.
    pub left: Vec<String>,
    /// What was really captured and complete on the board.
    pub truth: Seen,
    /// What was seen beside fusion.
    pub at_fusion: Seen,
    /// How fusion itself counts that.
    pub fusion_counts: FrameCounts,
    /// The launcher's words.
    pub words: String,
    /// Its exit code.
    pub exit_code: Option<i32>,
}

impl Report {
    /// Milliseconds without frames after each death of one kind, shortest first.
    #[must_use]
    pub fn silences_ms(&self, victim: Victim) -> Vec<f64> {
        let deaths = self.deaths.iter().filter(|death| death.victim == victim);
        let silences = deaths.map(|death| (death.resumed_ns - death.killed_ns) as f64 * 1e-6);
        let mut silences: Vec<f64> = silences.collect();
        silences.sort_by(f64::total_cmp);
        silences
    }

    /// Frames complete on the board and not beside fusion, though no bridge was dead.
    #[must_use]
    pub fn unexplained(&self) -> Vec<(u64, u64)> {
        let bridges = self.deaths.iter().filter(|death| death.victim == Victim::Bridge);
        let dead = bridges.map(|death| death.killed_ns - ON_THE_WAY_NS..=death.resumed_ns);
        // At the start the bridge is not there yet either.
        let first_ns = self.at_fusion.frames.values().map(|frame| frame.published_ns).min();
        let start = StampNs::MIN..=first_ns.unwrap_or_default();
        let dead: Vec<_> = dead.chain([start]).collect();
        let complete = self.truth.frames.iter().filter(|(_, frame)| frame.complete_ns.is_some());
        let missed = complete.filter(|(key, _)| {
            self.at_fusion.frames.get(key).is_none_or(|there| there.complete_ns.is_none())
        });
        let is_explained = |at: &StampNs| dead.iter().any(|window| window.contains(at));
        missed.filter(|(_, frame)| !is_explained(&frame.published_ns)).map(|(k, _)| *k).collect()
    }

    /// The line that a well-counting launcher ends with.
    #[must_use]
    pub fn expected_words(&self) -> String {
        let (n_frames, n_complete) = (self.truth.n_captured(), self.truth.n_complete);
        let (n_lost, n) = (n_frames - n_complete, self.deaths.len());
        format!("stopped: {n_frames} frames, {n_complete} complete, {n_lost} lost, {n} restarts")
    }
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for victim in Victim::ALL {
            let silences = self.silences_ms(victim);
            let at = |share: f64| {
                let idx = (silences.len() as f64 * share) as usize;
                silences.get(idx.min(silences.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
            };
            let (n, p50, p99, most) = (silences.len(), at(0.5), at(0.99), at(1.0));
            writeln!(
                f,
                "{victim:?}: {n} killed, frames again after {p50:.0} ms p50, {p99:.0} ms p99, \
                 {most:.0} ms at most"
            )?;
        }
        let (n_frames, n_complete) = (self.truth.n_captured(), self.truth.n_complete);
        writeln!(f, "board: {n_frames} frames, {} lost", n_frames - n_complete)?;
        writeln!(f, "fusion: {:?}", self.fusion_counts)?;
        let n_files = &self.n_files;
        writeln!(
            f,
            "files: {:?} before the first deaths, {:?} at last, {} left",
            &n_files[..n_files.len().min(4)],
            n_files.last(),
            self.left.len()
        )
    }
}

/// The launcher of the left board; killed when dropped, and its processes with it.
struct Board {
    child: Child,
    words: PathBuf,
}

impl Board {
    fn start(
        house: &Household,
        court: &str,
        endpoint: &str,
        folder: &Path,
    ) -> anyhow::Result<Self> {
        let words = folder.join("words");
        let mut command = Command::new(house.binary("board")?);
        command.args(["--court", court, "--camera", "left", "--connect", endpoint]);
        command.args(["--workers", &N_WORKERS.to_string(), "--with-parent", "--"]);
        command.args(["--repeat", "--speed", "real", "--recording"]).arg(folder.join("left.y4m"));
        let mut command = processes::alone(command);
        let child = command.stderr(File::create(&words)?).spawn().context("start the board")?;
        Ok(Self { child, words })
    }

    fn said(&self) -> String {
        std::fs::read_to_string(&self.words).unwrap_or_default()
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        // After `wait` there is nobody to kill.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Kills `n_kills` processes of a board of `court` that plays `folder`'s left.y4m.
///
/// # Errors
/// When a process cannot be started, or frames do not come again.
pub fn run(court: &str, folder: &Path, n_kills: usize) -> anyhow::Result<Report> {
    let mut house = Household::new(court)?;
    let endpoint = free_endpoint()?;
    let place = Place::Board(Camera::Left);
    let (here, beside) = (Domain::new(court, place)?, Domain::new(court, Place::Fusion)?);
    let at_fusion = Witness::of(&beside)?;
    let chain = Chain { n_workers: N_WORKERS, worker_flags: Vec::new(), endpoint };
    chain.start_fusion_bridge(&mut house)?;
    let mut board = Board::start(&house, court, &chain.endpoint, folder)?;
    let on_board = Witness::of(&here)?;

    let (mut deaths, mut n_files) = (Vec::new(), Vec::new());
    for idx in 0..n_kills {
        let victim = Victim::ALL[idx % Victim::ALL.len()];
        let n_before = at_fusion.seen().n_complete;
        wait_until(&board, || at_fusion.seen().n_complete >= n_before + N_BETWEEN)?;
        n_files.push(files_of(court)?.len());
        let pid = process(court, &victim.words(idx))?;
        let killed_ns = now_ns();
        kill_process(pid, Signal::KILL).context("kill a process")?;
        wait_until(&board, || at_fusion.seen().last[Camera::Left.idx()].published_ns > killed_ns)?;
        let resumed_ns = at_fusion.seen().last[Camera::Left.idx()].complete_ns.unwrap_or_default();
        deaths.push(Death { victim, killed_ns, resumed_ns });
    }
    let n_before = at_fusion.seen().n_complete;
    wait_until(&board, || at_fusion.seen().n_complete >= n_before + N_BETWEEN)?;
    n_files.push(files_of(court)?.len());

    // Frames stop, so that all have seen the same when they are asked.
    {
        let member = here.join("test")?;
        let client = member.commands()?.client()?;
        let answers = client.ask(Order::new(Kind::Stop), Duration::from_secs(10))?;
        ensure!(!answers.answers.is_empty(), "nobody stops the frames");
    }
    let mut before = (0, 0);
    let mut since = Instant::now();
    wait_until(&board, || {
        let now = (on_board.seen().n_complete, at_fusion.seen().n_complete);
        if now != std::mem::replace(&mut before, now) {
            since = Instant::now();
        }
        since.elapsed() > Duration::from_millis(700)
    })?;
    let (truth, at_fusion) = (on_board.end()?, at_fusion.end()?);
    let pid = processes::pid(&board.child).context("the board's number")?;
    kill_process(pid, Signal::TERM).context("ask the board to end")?;
    let exit_code = board.child.wait().context("wait for the board")?.code();
    let left = files_of(court)?.into_iter().filter(|name| name.contains("_left_")).collect();
    house.end("bridge fusion")?;
    let fusion_counts = counted(&at_fusion);
    let words = board.said();
    Ok(Report { deaths, n_files, left, truth, at_fusion, fusion_counts, words, exit_code })
}

/// Fusion's own account of what came.
fn counted(seen: &Seen) -> FrameCounts {
    let mut intake = Intake::default();
    let mut frames: Vec<_> = seen.frames.iter().collect();
    frames.sort_by_key(|(_, frame)| frame.published_ns);
    for ((recording_id, frame_idx), frame) in frames {
        let (recording_id, frame_idx) = (*recording_id, *frame_idx);
        intake.update_info(&FrameInfo { recording_id, frame_idx, ..FrameInfo::default() });
        if frame.complete_ns.is_some() {
            intake.update(&StripCandidates { recording_id, frame_idx, ..Default::default() });
        }
    }
    intake.finish();
    intake.counts()
}

fn wait_until(board: &Board, mut is_so: impl FnMut() -> bool) -> anyhow::Result<()> {
    let begun = Instant::now();
    while !is_so() {
        ensure!(begun.elapsed() < GIVE_UP_AFTER, "no frames any more; said: {}", board.said());
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}

/// Files of a court: its part of /dev/shm and of iceoryx2's root folder.
///
/// # Errors
/// When a folder cannot be read.
pub fn files_of(court: &str) -> std::io::Result<Vec<String>> {
    let prefix = format!("tennis_{court}_");
    let root = format!("/tmp/tennis-{}", rustix::process::getuid().as_raw());
    let mut open = vec![PathBuf::from("/dev/shm"), PathBuf::from(root)];
    let mut files = Vec::new();
    while let Some(folder) = open.pop() {
        // A folder may go while it is looked at.
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else if entry.file_name().to_string_lossy().starts_with(&prefix) {
                files.push(path.display().to_string());
            }
        }
    }
    files.sort();
    Ok(files)
}

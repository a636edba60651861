//! A court with everything that runs there: both boards under their launchers, and beside fusion
//! the units, kept by a [`Keeper`]. Balls are served as recorded, on this machine's clock: the two
//! cameras see the same moment whoever was started anew.

use super::keeper::{End, Keeper, Unit};
use super::part::{N_WORKERS, Part};
use super::served::Served;
use super::spoiled::{Spoiled, spoil};
use crate::processes::{binary, free_endpoint, own_court};
use crate::scenario::{Scenario, ScenarioOptions};
use crate::shot_folder;
use crate::truth::Truth;
use crate::witness::Witness;
use anyhow::{Context as _, ensure};
use launcher::processes;
use rustix::process::{Signal, kill_process};
use shm_layout::commands::{Command as Order, Kind};
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::{Camera, StampNs};
use std::ffi::OsString;
use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant, SystemTime};

/// Empty court after the last ball of a lap.
const PAUSE_S: f64 = 1.0;

/// Where in a site's folder the recorder keeps its files.
pub const KEPT: &str = "kept";

/// What a site is made of.
#[derive(Debug, Clone)]
pub struct SiteOptions {
    /// Of the served balls.
    pub seed: u64,
    /// Different balls; then they are served again.
    pub n_shots: usize,
    /// Frames of the second before a lap ends that are spoiled, and how.
    pub spoiled: Vec<(Range<u64>, Spoiled)>,
    /// Where recordings and words go; needs 50 MB a ball and camera.
    pub folder: PathBuf,
}

/// Everything runs until it is dropped.
#[derive(Debug)]
pub struct Site {
    /// Its name.
    pub court: String,
    /// Which ball was served when.
    pub served: Served,
    /// Who watches each board's shared memory, and fusion's.
    pub on_boards: [Witness; 2],
    /// The same beside fusion.
    pub at_fusion: Witness,
    /// Where the page listens.
    pub page: String,
    /// How often launchers started something again before all ran: many processes that make the
    /// same services in the same millisecond may refuse each other once.
    pub n_restarts_at_start: [usize; 2],
    /// The same for the units.
    n_ends_at_start: usize,
    folder: PathBuf,
    boards: [Board; 2],
    keeper: Keeper,
}

/// A board's launcher; killed when dropped, and its processes with it.
#[derive(Debug)]
struct Board {
    child: Child,
    words: PathBuf,
}

impl Drop for Board {
    fn drop(&mut self) {
        // After `wait` there is nobody to kill.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What a board's launcher said in the end.
#[derive(Debug, Clone)]
pub struct BoardEnd {
    /// All of its words.
    pub words: String,
    /// Its exit code.
    pub exit_code: Option<i32>,
}

impl Site {
    /// Films the balls, starts all and waits until both boards' frames come to fusion. `say` hears
    /// how far the filming is, 0 to 1.
    ///
    /// # Errors
    /// When something cannot be written or started.
    pub fn start(options: &SiteOptions, say: impl Fn(f64) + Sync) -> anyhow::Result<Self> {
        let court = own_court("site")?;
        let folder = options.folder.clone();
        let served = film(options, say)?;
        let (endpoint, page) = (free_endpoint()?, free_endpoint()?.replace("tcp/", ""));
        let places = [Place::Board(Camera::Left), Place::Board(Camera::Right), Place::Fusion];
        let mut witnesses = Vec::new();
        for place in places {
            witnesses.push(Witness::of(&Domain::new(&court, place)?)?);
        }
        let Ok([left, right, at_fusion]) = <[Witness; 3]>::try_from(witnesses) else {
            anyhow::bail!("three places");
        };
        let units = units(&court, &folder, &endpoint, &page)?;
        let keeper = Keeper::start(units, &folder)?;
        let board = |camera| Board::start(&court, camera, &endpoint, &folder);
        let boards = [board(Camera::Left)?, board(Camera::Right)?];
        let on_boards = [left, right];
        let (n_restarts_at_start, n_ends_at_start) = ([0; 2], 0);
        let mut site = Self {
            court,
            served,
            on_boards,
            at_fusion,
            page,
            n_restarts_at_start,
            n_ends_at_start,
            folder,
            boards,
            keeper,
        };
        let all_come = || {
            let seen = site.at_fusion.seen();
            seen.last.iter().all(|frame| frame.complete_ns.is_some())
        };
        site.wait_until("frames of both boards", Duration::from_secs(30), all_come)?;
        let n_restarts = |camera| site.board_words(camera).matches("started again").count();
        site.n_restarts_at_start = Camera::BOTH.map(n_restarts);
        site.n_ends_at_start = site.keeper.ends().len();
        Ok(site)
    }

    /// Ends of units since all ran.
    #[must_use]
    pub fn ends(&self) -> Vec<End> {
        self.keeper.ends().split_off(self.n_ends_at_start)
    }

    /// A board's launcher, by its process number.
    #[must_use]
    pub fn launcher(&self, camera: Camera) -> u32 {
        self.boards[camera.idx()].child.id()
    }

    /// What a board's launcher said so far.
    #[must_use]
    pub fn board_words(&self, camera: Camera) -> String {
        std::fs::read_to_string(&self.boards[camera.idx()].words).unwrap_or_default()
    }

    /// What a unit said so far.
    #[must_use]
    pub fn unit_words(&self, part: Part) -> String {
        std::fs::read_to_string(self.folder.join(format!("{part}.words"))).unwrap_or_default()
    }

    /// Whether the recorder's newest file was written to after that.
    #[must_use]
    pub fn newest_recording_grows_since(&self, since_ns: StampNs) -> bool {
        let age_ns = now_ns() - since_ns;
        let since = SystemTime::now() - Duration::from_nanos(age_ns.max(0).unsigned_abs());
        let files = std::fs::read_dir(self.folder.join(KEPT)).into_iter().flatten().flatten();
        let recordings = files
            .filter(|file| file.path().extension().is_some_and(|extension| extension == "mcap"));
        let times = recordings.filter_map(|file| file.metadata().and_then(|m| m.modified()).ok());
        times.max().is_some_and(|newest| newest > since)
    }

    /// Process numbers of those that run.
    #[must_use]
    pub fn running(&self) -> Vec<(Part, rustix::process::Pid)> {
        let parts = Part::all().into_iter();
        parts.filter_map(|part| Some((part, part.process(&self.court).ok()?))).collect()
    }

    /// Waits until it is so.
    ///
    /// # Errors
    /// When it is not in that time.
    pub fn wait_until(
        &self,
        what: &str,
        within: Duration,
        mut is_so: impl FnMut() -> bool,
    ) -> anyhow::Result<()> {
        let begun = Instant::now();
        while !is_so() {
            let said = || Camera::BOTH.map(|camera| self.board_words(camera)).join("\n");
            ensure!(begun.elapsed() < within, "no {what} within {within:?}; said:\n{}", said());
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }

    /// Stops the frames and waits until all that was captured has arrived everywhere.
    ///
    /// # Errors
    /// When the boards do not stop.
    pub fn stop_frames(&self) -> anyhow::Result<()> {
        for camera in Camera::BOTH {
            let member = Domain::new(&self.court, Place::Board(camera))?.join("site")?;
            let client = member.commands()?.client()?;
            let answers = client.ask(Order::new(Kind::Stop), Duration::from_secs(10))?;
            ensure!(!answers.answers.is_empty(), "nobody stops the frames of {camera}");
        }
        let (mut before, mut since) = ([0; 3], Instant::now());
        self.wait_until("rest", Duration::from_secs(30), || {
            let [left, right] = &self.on_boards;
            let now = [left, right, &self.at_fusion].map(|witness| witness.seen().n_complete);
            if now != std::mem::replace(&mut before, now) {
                since = Instant::now();
            }
            since.elapsed() > Duration::from_millis(1500)
        })
    }

    /// Ends all; what the launchers said, and files of the court that are left.
    ///
    /// # Errors
    /// When a process cannot be waited for.
    pub fn end(self) -> anyhow::Result<([BoardEnd; 2], Vec<String>)> {
        let Self { court, mut boards, keeper, on_boards, at_fusion, .. } = self;
        let mut ends = Vec::new();
        for board in &mut boards {
            let pid = processes::pid(&board.child).context("a board's number")?;
            kill_process(pid, Signal::TERM).context("ask a board to end")?;
        }
        for board in &mut boards {
            let exit_code = board.child.wait().context("wait for a board")?.code();
            let words = std::fs::read_to_string(&board.words).unwrap_or_default();
            ends.push(BoardEnd { words, exit_code });
        }
        drop(keeper);
        for witness in on_boards.into_iter().chain([at_fusion]) {
            witness.end()?;
        }
        let mut left = Vec::new();
        for place in [Place::Fusion, Place::Board(Camera::Left), Place::Board(Camera::Right)] {
            left.extend(Domain::new(&court, place)?.close()?);
        }
        let Ok(ends) = <[BoardEnd; 2]>::try_from(ends) else { anyhow::bail!("two boards") };
        Ok((ends, left))
    }
}

impl Board {
    fn start(court: &str, camera: Camera, endpoint: &str, folder: &Path) -> anyhow::Result<Self> {
        let words = folder.join(format!("board {camera}.words"));
        let mut command = Command::new(binary("board")?);
        command.args(["--court", court, "--camera", camera.name(), "--connect", endpoint]);
        command.args(["--workers", &N_WORKERS.to_string(), "--with-parent", "--recordings"]);
        command.arg(folder.join("recordings")).args(["--", "--as-camera", "--recording"]);
        command.arg(folder.join(format!("{camera}.y4m")));
        let mut command = processes::alone(command);
        let child = command.stderr(File::create(&words)?).spawn().context("start the board")?;
        Ok(Self { child, words })
    }
}

/// Writes the recordings that the boards play, and the rig.
fn film(options: &SiteOptions, say: impl Fn(f64) + Sync) -> anyhow::Result<Served> {
    let scenario_options = ScenarioOptions { n_shots: options.n_shots, ..Default::default() };
    let scenario = Scenario::from_seed(options.seed, &scenario_options);
    let truth = Truth::from_scenario(&scenario);
    let ended_at_s = truth.flights.iter().map(|flight| flight.ended_at_s()).fold(0.0, f64::max);
    let n_frames = ((ended_at_s + PAUSE_S) * scenario.frame_rate_hz).ceil() as u64;
    let said = |n: u64| say(n as f64 / n_frames as f64);
    shot_folder::write(&options.folder, &scenario, &truth, n_frames, said)
        .with_context(|| options.folder.display().to_string())?;
    let pause_from = n_frames - (PAUSE_S * scenario.frame_rate_hz) as u64;
    for camera in Camera::BOTH {
        let recording = options.folder.join(format!("{camera}.y4m"));
        for (frames, how) in &options.spoiled {
            let frames = pause_from + frames.start..pause_from + frames.end;
            spoil(&recording, frames, *how, options.seed)?;
        }
    }
    Served::new(&options.folder.join("left.timestamps"), &truth)
}

/// The units of `scripts/systemd`, and a recorder.
fn units(court: &str, folder: &Path, endpoint: &str, page: &str) -> anyhow::Result<Vec<Unit>> {
    let rig = folder.join("rig.toml").into_os_string();
    let data = folder.join("page");
    std::fs::create_dir_all(&data).with_context(|| data.display().to_string())?;
    let unit = |part, name: &str, arguments: Vec<OsString>| {
        let arguments: Vec<OsString> =
            arguments.into_iter().chain(["--court".into(), court.into()]).collect();
        let arguments = Box::new(move |_| arguments.clone());
        anyhow::Ok(Unit { part, binary: binary(name)?, arguments })
    };
    let bridge = vec!["fusion".into(), "--listen".into(), endpoint.into()];
    let fusion = vec!["--rig".into(), rig.clone()];
    let page = vec![
        "--listen".into(),
        page.into(),
        "--data".into(),
        data.into_os_string(),
        "--rig".into(),
        rig,
    ];
    let recordings = folder.join(KEPT);
    std::fs::create_dir_all(&recordings).with_context(|| recordings.display().to_string())?;
    let of_court: [OsString; 4] =
        ["--court".into(), court.into(), "--place".into(), "fusion".into()];
    let recorder = Unit {
        part: Part::Recorder,
        binary: binary("record")?,
        arguments: Box::new(move |n_starts| {
            let file = recordings.join(format!("court-{n_starts}.mcap"));
            of_court.iter().cloned().chain(["--out".into(), file.into()]).collect()
        }),
    };
    Ok(vec![
        unit(Part::Fusion, "fusion", fusion)?,
        unit(Part::FusionBridge, "bridge", bridge)?,
        unit(Part::Page, "page", page)?,
        recorder,
    ])
}

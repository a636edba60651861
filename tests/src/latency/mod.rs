//! The real processes on boards that are not there -> how long every stage takes.
//!
//! A [`heard::Listener`] reads along in shared memory and changes nothing, a [`browser`] watches
//! the page; [`stages`] joins what they heard to a time for every stage, [`usage`] says what each
//! process cost. Frames are due by the clock, whether or not those before them came in time, so a
//! stall is seen by all it delayed. [`transport`] is the same frames through a pipe and a socket,
//! beside shared memory.

pub mod browser;
pub mod heard;
pub mod picture;
pub mod report;
pub mod stages;
pub mod transport;
pub mod usage;

use crate::chain::Chain;
use crate::processes::{self, Household, Until, free_endpoint};
use crate::scenario::{Scenario, ScenarioOptions};
use crate::shot_folder;
use anyhow::{Context as _, ensure};
use browser::Browser;
use clap::ValueEnum;
use heard::Listener;
use report::Report;
use serde::Serialize;
use shm_layout::Camera;
use shm_layout::stop::Stop;
use std::ffi::OsString;
use std::process::Stdio;
use std::time::{Duration, Instant};
use usage::Usage;

/// What is going on beside the ball.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum CourtLoad {
    /// A calm day, little noise.
    Idle,
    /// Trees sway and the sensor is noisy: more spots, and tracklets of them.
    Busy,
}

/// What is measured.
#[derive(Debug, Clone, Serialize)]
pub struct Options {
    /// Frames a second of each camera.
    pub fps: f64,
    /// Their pixels.
    pub size_px: [usize; 2],
    /// Workers of each board.
    pub n_workers: u32,
    /// Beside the ball.
    pub court_load: CourtLoad,
    /// Whether fusion tells shots `--early`.
    pub is_early: bool,
    /// How long is measured, after the background was learned.
    pub seconds: f64,
}

/// Workers learn the background and clocks are compared before it counts.
const WARM_UP: Duration = Duration::from_secs(3);
/// What was published last is on its way for so long at most.
const AFTERWARDS: Duration = Duration::from_millis(500);
/// Different shots; then they are played again.
const N_SHOTS: usize = 40;

/// Starts the processes, listens, and ends them again; `say` hears how far it is, 0 to 1.
///
/// # Errors
/// When a process cannot be started or ends, or nothing is heard.
pub fn measure(options: &Options, stop: &Stop, mut say: impl FnMut(f64)) -> anyhow::Result<Report> {
    let court = processes::own_court("latency")?;
    let mut house = Household::new(&court)?;
    let scenario = scenario_of(options);
    let rig = tempfile::NamedTempFile::new().context("cannot write the rig")?;
    std::fs::write(rig.path(), shot_folder::rig_toml(&scenario))?;

    let mut arguments: Vec<OsString> = vec!["--rig".into(), rig.path().into()];
    arguments.extend(options.is_early.then(|| "--early".into()));
    house.start("fusion", "fusion", &arguments, Until::Stopped, Stdio::null())?;
    let chain = Chain {
        n_workers: options.n_workers,
        worker_flags: Vec::new(),
        endpoint: free_endpoint()?,
    };
    chain.start_fusion_bridge(&mut house)?;
    for camera in Camera::BOTH {
        chain.start_board(&mut house, camera)?;
    }
    let (data, address) = (tempfile::tempdir()?, free_endpoint()?.replace("tcp/", ""));
    let arguments: [OsString; 6] = [
        "--listen".into(),
        (&address).into(),
        "--data".into(),
        data.path().into(),
        "--rig".into(),
        rig.path().into(),
    ];
    house.start("page", "page", &arguments, Until::Stopped, Stdio::null())?;
    let listener = Listener::new(&court)?;
    let browser = Browser::open(&address)?;
    let arguments = simulate_arguments(options);
    house.start("simulate", "simulate", &arguments, Until::Stopped, Stdio::null())?;

    rest(WARM_UP, &mut house, stop, |_| ())?;
    let before = Usage::of(&house)?;
    listener.begin();
    let length = Duration::from_secs_f64(options.seconds);
    rest(length, &mut house, stop, &mut say)?;
    listener.end_window();
    let after = Usage::of(&house)?;
    rest(AFTERWARDS, &mut house, stop, |_| ())?;
    let mut heard = listener.end()?;
    heard.pushed = browser.end()?;
    house.stop()?;
    let exposed_for_ns = (scenario.exposed_for_s() * 1e9).round() as i64;
    let report = Report::new(options, &heard, exposed_for_ns, &after.since(&before));
    ensure!(report.n_frames > 0, "no frame was heard of");
    Ok(report)
}

fn scenario_of(options: &Options) -> Scenario {
    let scenario_options =
        ScenarioOptions { n_shots: 1, frame_rate_hz: options.fps, ..ScenarioOptions::default() };
    let mut scenario = Scenario::from_seed(1, &scenario_options);
    for camera in [&mut scenario.rig.left, &mut scenario.rig.right] {
        *camera = camera.clone().with_size_px(options.size_px);
    }
    scenario
}

fn simulate_arguments(options: &Options) -> Vec<String> {
    let [width, height] = options.size_px;
    let mut arguments = vec!["--live".to_owned(), "--machine-clock".to_owned()];
    let mut add = |flag: &str, value: String| arguments.extend([flag.to_owned(), value]);
    add("--fps", options.fps.to_string());
    add("--size", format!("{width}x{height}"));
    add("--workers", options.n_workers.to_string());
    add("--shots", N_SHOTS.to_string());
    if options.court_load == CourtLoad::Busy {
        add("--noise", "3".to_owned());
        add("--sway-px", "2".to_owned());
    }
    arguments
}

/// Waits, and looks whether all still run.
fn rest(
    length: Duration,
    house: &mut Household,
    stop: &Stop,
    mut say: impl FnMut(f64),
) -> anyhow::Result<()> {
    let begun = Instant::now();
    while begun.elapsed() < length {
        ensure!(!stop.is_raised(), processes::Error::Stopped);
        house.look()?;
        std::thread::sleep(Duration::from_millis(50));
        say((begun.elapsed().as_secs_f64() / length.as_secs_f64()).min(1.0));
    }
    Ok(())
}

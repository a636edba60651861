//! `demo`: a simulated machine serves, the real processes measure, each shot is printed beside the
//! truth as it happens.

use anyhow::Context as _;
use clap::Parser;
use shm_layout::ports::MessageReader;
use shm_layout::services::{Domain, Place};
use shm_layout::stop::Stop;
use shm_layout::{Camera, FrameInfo, N_STRIPS_RANGE, Shot};
use std::ffi::OsString;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{ExitCode, Stdio};
use std::time::{Duration, Instant};
use tests::camera::Side;
use tests::chain::Chain;
use tests::player::Programme;
use tests::processes::{self, Household, Until, free_endpoint};
use tests::scenario::{Scenario, ScenarioOptions};
use tests::truth::Truth;

/// After the last frame, how long a shot may still be on its way.
const LAST_SHOT_WITHIN: Duration = Duration::from_secs(3);

/// Simulated shots, measured by the real processes on this computer.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// End after this many shots [default: go on until Ctrl-C].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    shots: Option<u32>,
    /// Shots of the scenario; when more are wanted they are played again.
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=1000))]
    different_shots: u32,
    /// Same seed, same court, same shots, same noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Workers of each board.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(N_STRIPS_RANGE))]
    workers: u32,
    /// A page of it, at this address: what a coach sees.
    #[arg(long, value_name = "ADDRESS")]
    page: Option<SocketAddr>,
    /// Where the page keeps what it keeps [default: a folder that goes with the demo].
    #[arg(long, value_name = "DIR", requires = "page")]
    page_data: Option<PathBuf>,
}

/// The ball machine of the page; in a demo nobody commands it.
const MACHINE: &str = include_str!("../../../fusion/rigs/machine.toml");

fn main() -> ExitCode {
    match run(&Flags::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) if matches!(e.downcast_ref(), Some(processes::Error::Stopped)) => {
            ExitCode::SUCCESS // Ctrl-C is how an endless demo ends
        }
        Err(e) => {
            eprintln!("demo: {e:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(flags: &Flags) -> anyhow::Result<()> {
    let stop = Stop::on_signals(false).context("cannot listen to signals")?;
    let court = processes::own_court("demo")?;
    let mut house = Household::new(&court)?;
    let outcome = show(flags, &court, &mut house, &stop);
    let emptied = house.stop();
    outcome?;
    Ok(emptied?)
}

fn show(flags: &Flags, court: &str, house: &mut Household, stop: &Stop) -> anyhow::Result<()> {
    let n_different = flags.different_shots.min(flags.shots.unwrap_or(u32::MAX)) as usize;
    let options = ScenarioOptions { n_shots: n_different, ..ScenarioOptions::default() };
    let scenario = Scenario::from_seed(flags.seed, &options);
    let truth = Truth::from_scenario(&scenario);
    let programme = Programme::new(&scenario, &truth, flags.shots.map(|n| n as usize));

    let rig = tempfile::NamedTempFile::new().context("cannot write the rig")?;
    std::fs::write(rig.path(), tests::shot_folder::rig_toml(&scenario))?;
    let member = Domain::new(court, Place::Fusion)?.join("demo")?;
    let shots = member.shots()?.reader()?;
    let mut clock = Clock { infos: member.frames_info()?.reader()?, begun_ns: None };
    let endpoint = start(flags, house, rig.path().as_os_str().to_owned(), n_different)?;
    let data = tempfile::tempdir().context("cannot make a folder for the page")?;
    if let Some(address) = flags.page {
        start_page(flags, address, house, rig.path(), data.path(), &endpoint)?;
    }

    println!("two simulated boards serve a ball every {} s; Ctrl-C ends", options.period_s);
    let mut score = Score::default();
    let mut over_at = None;
    loop {
        match house.look() {
            _ if stop.is_raised() => break,
            outcome => outcome?,
        }
        clock.update(&scenario)?;
        while let Some(shot) = shots.receive()? {
            score.print(&shot, clock.bounced_at_s(&shot), &programme);
        }
        if house.running().iter().all(|(name, _)| *name != "simulate") {
            let over_at: &Instant = over_at.get_or_insert_with(Instant::now);
            if over_at.elapsed() > LAST_SHOT_WITHIN {
                break;
            }
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    score.print_summary(flags.shots);
    Ok(())
}

fn start(
    flags: &Flags,
    house: &mut Household,
    rig: OsString,
    n_different: usize,
) -> Result<String, processes::Error> {
    let arguments = ["--rig".into(), rig];
    house.start("fusion", "fusion", &arguments, Until::Stopped, Stdio::null())?;
    let endpoint = free_endpoint()?;
    let chain = Chain { n_workers: flags.workers, worker_flags: Vec::new(), endpoint };
    chain.start_fusion_bridge(house)?;
    for camera in Camera::BOTH {
        chain.start_board(house, camera)?;
    }
    let seed = flags.seed.to_string();
    let (n_different, workers) = (n_different.to_string(), flags.workers.to_string());
    // Stamps as of cameras: whoever watches may know how old a shot is.
    let mut arguments: Vec<&str> =
        vec!["--live", "--machine-clock", "--seed", &seed, "--workers", &workers];
    arguments.extend(["--shots", &n_different]);
    let n_played = flags.shots.map(|n| n.to_string());
    if let Some(n_played) = &n_played {
        arguments.extend(["--play-shots", n_played]);
    }
    house.start("simulate", "simulate", &arguments, Until::Done, Stdio::null())?;
    Ok(chain.endpoint)
}

/// The page says its address itself, on stdout.
fn start_page(
    flags: &Flags,
    address: SocketAddr,
    house: &mut Household,
    rig: &Path,
    own_data: &Path,
    endpoint: &str,
) -> anyhow::Result<()> {
    // Its own copy: a calibration is written there.
    let data = flags.page_data.as_deref().unwrap_or(own_data);
    std::fs::create_dir_all(data).with_context(|| data.display().to_string())?;
    let (own_rig, machine) = (data.join("rig.toml"), data.join("machine.toml"));
    std::fs::copy(rig, &own_rig).with_context(|| own_rig.display().to_string())?;
    std::fs::write(&machine, MACHINE).with_context(|| machine.display().to_string())?;
    let arguments: [OsString; 12] = [
        "--listen".into(),
        address.to_string().into(),
        "--data".into(),
        data.into(),
        "--rig".into(),
        own_rig.into(),
        "--machine".into(),
        machine.into(),
        "--connect".into(),
        endpoint.into(),
        "--keys".into(),
        data.join("keys").into(),
    ];
    house.start("page", "page", &arguments, Until::Stopped, Stdio::inherit())?;
    Ok(())
}

/// When the scenario began, by this machine's clock: what the truth is compared by.
struct Clock {
    infos: MessageReader<FrameInfo>,
    begun_ns: Option<i64>,
}

impl Clock {
    /// Any frame tells: it says its number and when it was exposed. Later ones are only read.
    fn update(&mut self, scenario: &Scenario) -> anyhow::Result<()> {
        while let Some(info) = self.infos.receive()? {
            let side = Camera::from_idx(info.camera_idx).map(|camera| Side::BOTH[camera.idx()]);
            if let (None, Some(side)) = (self.begun_ns, side) {
                let own_ns = scenario.stamp_ns(side, info.frame_idx);
                self.begun_ns = Some(info.exposed_ns - own_ns);
            }
        }
        Ok(())
    }

    /// In the scenario; no shot comes before its frames.
    fn bounced_at_s(&self, shot: &Shot) -> f64 {
        (shot.bounce_ns - self.begun_ns.unwrap_or_default()) as f64 * 1e-9
    }
}

/// What was printed so far.
#[derive(Debug, Default)]
struct Score {
    n_measured: u32,
    errors_m: Vec<f64>,
}

impl Score {
    fn print(&mut self, shot: &Shot, bounced_at_s: f64, programme: &Programme<'_>) {
        let number = shot.shot_idx + 1;
        println!("shot {number}: launch {}", launch_text(shot));
        if shot.is_measured == 0 {
            println!("        no bounce measured");
            return;
        }
        self.n_measured += 1;
        let [x_m, y_m, _] = shot.bounce_in_court_m;
        let sigma_m = |axis: usize| shot.bounce_covariance_m2[axis][axis].sqrt();
        let speed = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
        println!(
            "        bounce x {x_m:+.3} ± {:.3} m, y {y_m:.3} ± {:.3} m, at {:.1} km/h",
            sigma_m(0),
            sigma_m(1),
            km_h(speed(shot.velocity_in_m_s)),
        );
        if let Some((dx_m, dy_m, launch_error_m_s)) = errors(shot, bounced_at_s, programme) {
            println!(
                "        error  x {:+.1} cm, y {:+.1} cm; launch speed {:+.2} km/h",
                dx_m * 100.0,
                dy_m * 100.0,
                km_h(launch_error_m_s),
            );
            self.errors_m.push(dx_m.hypot(dy_m));
        } else {
            println!("        no such ball was served");
        }
    }

    fn print_summary(&self, wanted: Option<u32>) {
        let of = wanted.map_or(String::new(), |n| format!(" of {n}"));
        let n = self.errors_m.len().max(1) as f64;
        let mean_m = self.errors_m.iter().sum::<f64>() / n;
        let worst_m = self.errors_m.iter().copied().fold(0.0, f64::max);
        println!(
            "{}{of} shots measured; bounce error mean {:.1} cm, worst {:.1} cm",
            self.n_measured,
            mean_m * 100.0,
            worst_m * 100.0,
        );
    }
}

fn launch_text(shot: &Shot) -> String {
    let [speed, elevation, azimuth, backspin] = shot.launch_sigma;
    format!(
        "{:.1} ± {:.1} km/h, {:.2} ± {:.2}° up, {:+.2} ± {:.2}° right, {:+.0} ± {:.0} rpm",
        km_h(shot.launch_speed_m_s),
        km_h(speed),
        shot.launch_elevation_rad.to_degrees(),
        elevation.to_degrees(),
        shot.launch_azimuth_rad.to_degrees(),
        azimuth.to_degrees(),
        rpm(shot.launch_backspin_rad_s),
        rpm(backspin),
    )
}

fn rpm(spin_rad_s: f64) -> f64 {
    spin_rad_s * 60.0 / std::f64::consts::TAU
}

/// Bounce (x, y) and launch speed, measured minus true, of the ball that bounced at that time.
fn errors(shot: &Shot, bounced_at_s: f64, programme: &Programme<'_>) -> Option<(f64, f64, f64)> {
    (0..).map(|idx| programme.flight(idx)).find_map(|(flight, later_s)| {
        if flight.launch.launched_at_s + later_s > bounced_at_s {
            return Some(None); // served later than it bounced: there is none
        }
        let bounce = flight.bounces.first()?;
        let is_it = (bounce.bounced_at_s + later_s - bounced_at_s).abs() < 0.5;
        is_it.then(|| {
            Some((
                shot.bounce_in_court_m[0] - bounce.position_in_court_m.x,
                shot.bounce_in_court_m[1] - bounce.position_in_court_m.y,
                shot.launch_speed_m_s - flight.launch.speed_m_s,
            ))
        })
    })?
}

fn km_h(speed_m_s: f64) -> f64 {
    speed_m_s * 3.6
}

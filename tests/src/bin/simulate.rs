//! Plays a scenario on a court that is not there.
//!
//! `simulate --write DIR` writes a shot folder for `track`, `--still FILE` one picture, `--live`
//! plays into shared memory in place of both captures, `--time` says how long a frame takes. Data
//! to files, words to stderr.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use clap::{Args, Parser, ValueEnum};
use shm_layout::stop::Stop;
use tests::camera::{self, Side};
use tests::player::{Programme, Stamps};
use tests::renderer::Renderer;
use tests::scenario::{Scenario, ScenarioOptions};
use tests::scenes;
use tests::shot_folder;
use tests::truth::Truth;

/// Frames go on for this long after the last ball is gone.
const AFTER_LAST_FLIGHT_S: f64 = 0.2;
/// Frames that --time looks at.
const N_TIMED_FRAMES: u64 = 900;

/// A tennis ball machine and two cameras, simulated.
#[derive(Parser)]
#[command(version, about)]
struct Flags {
    #[command(flatten)]
    play: PlayFlags,
    #[command(flatten)]
    output: OutputFlags,
}

/// Flags that a scene leaves nothing to say to.
const PLAY_FLAGS: [&str; 15] = [
    "seed",
    "shots",
    "thesis_shot",
    "period_s",
    "first_launch_s",
    "wind_sigma_m_s",
    "noise",
    "sway_px",
    "contrast",
    "fps",
    "exposure_us",
    "row_time_us",
    "size",
    "right_offset_ns",
    "right_phase_ns",
];

/// What is played, and how it is seen.
#[derive(Args)]
struct PlayFlags {
    /// Same seed, same court, same shots, same noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How many balls the machine serves.
    #[arg(long, default_value_t = 1)]
    shots: usize,
    /// A scene of the binary `scenes`, its first take.
    #[arg(long, conflicts_with_all = PLAY_FLAGS)]
    scene: Option<String>,
    /// The thesis' own shot: 100 km/h at 8.1 degrees, no spin.
    #[arg(long, conflicts_with_all = ["shots", "period_s", "first_launch_s", "wind_sigma_m_s"])]
    thesis_shot: bool,
    /// Time from one launch to the next.
    #[arg(long, default_value_t = 3.0)]
    period_s: f64,
    /// Empty court before the first launch, to learn the background from (at least 0.7).
    #[arg(long, default_value_t = 0.7)]
    first_launch_s: f64,
    /// Spread of the wind's horizontal components, constant within a scenario.
    #[arg(long, default_value_t = 0.0)]
    wind_sigma_m_s: f64,
    /// Sensor noise: 1 is a small sensor by day, 0 none.
    #[arg(long, default_value_t = 1.0)]
    noise: f64,
    /// How far trees sway to either side; 0 is a calm day.
    #[arg(long, default_value_t = 0.0)]
    sway_px: f64,
    /// Share of the ground's light that comes straight from the sun; default: drawn.
    #[arg(long)]
    contrast: Option<f64>,
    /// Frames a second.
    #[arg(long, default_value_t = 90.0)]
    fps: f64,
    /// Exposure of both cameras.
    #[arg(long, default_value_t = 2000.0)]
    exposure_us: f64,
    /// Rolling shutter of both cameras; 0 is a global shutter.
    #[arg(long, default_value_t = 0.0)]
    row_time_us: f64,
    /// How far the right camera's clock is ahead of the left one's.
    #[arg(long, default_value_t = 0, allow_hyphen_values = true)]
    right_offset_ns: i64,
    /// Pixels of both cameras, with the same view from left to right; default: 640x480.
    #[arg(long, value_name = "WxH", value_parser = camera::size_px_from_text)]
    size: Option<[usize; 2]>,
    /// How much later than the left camera the right one really exposes.
    #[arg(long, default_value_t = 0, allow_hyphen_values = true)]
    right_phase_ns: i64,
}

/// Where the frames go.
#[derive(Args)]
#[group(required = true, multiple = false)]
struct Destination {
    /// Write a shot folder here.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// Write one frame as a picture (.png).
    #[arg(long, value_name = "FILE")]
    still: Option<PathBuf>,
    /// Say how long a frame takes to render.
    #[arg(long)]
    time: bool,
    /// Play into the shared memory of both boards of --court, in real time.
    #[arg(long, requires = "court")]
    live: bool,
}

#[derive(Args)]
struct OutputFlags {
    #[command(flatten)]
    destination: Destination,
    /// Name of the court to play live on.
    #[arg(long)]
    court: Option<String>,
    /// Live: workers of each board to wait for.
    #[arg(long, default_value_t = 1)]
    workers: usize,
    /// Live: end after this many shots, played again from the first if there are fewer; default:
    /// go on until stopped.
    #[arg(long)]
    play_shots: Option<usize>,
    /// Live: stamps on this machine's clock, as a camera's are, not on one that begins at 0.
    #[arg(long)]
    machine_clock: bool,
    /// Live: end when the process that started this one has ended.
    #[arg(long)]
    with_parent: bool,
    /// How long the folder is; default: until the last ball is gone.
    #[arg(long)]
    seconds: Option<f64>,
    /// Which camera a still is from.
    #[arg(long, value_enum, default_value_t = CameraName::Left)]
    camera: CameraName,
    /// When a still is taken.
    #[arg(long, default_value_t = 1.0)]
    at_s: f64,
}

#[derive(Clone, Copy, ValueEnum)]
enum CameraName {
    Left,
    Right,
}

fn main() -> anyhow::Result<()> {
    let flags = Flags::parse();
    let scenario = match &flags.play.scene {
        Some(name) => {
            scenes::from_name(name).map_err(anyhow::Error::msg)?.takes.swap_remove(0).scenario
        }
        None => scenario_from_flags(&flags.play),
    };
    let truth = Truth::from_scenario(&scenario);
    let output = &flags.output;
    let side = match output.camera {
        CameraName::Left => Side::Left,
        CameraName::Right => Side::Right,
    };
    if let Some(directory) = &output.destination.write {
        write_folder(directory, &scenario, &truth, output.seconds)?;
    }
    if let Some(file) = &output.destination.still {
        write_still(file, &scenario, &truth, side, output.at_s)?;
    }
    if output.destination.live {
        let stop = Stop::on_signals(output.with_parent).context("cannot listen to signals")?;
        let court = output.court.as_deref().context("--live needs --court")?;
        let programme = Programme::new(&scenario, &truth, output.play_shots);
        let stamps = if output.machine_clock { Stamps::Machine } else { Stamps::Own };
        programme.stamped(stamps).play(court, output.workers, &stop)?;
    }
    if output.destination.time {
        time_frames(&scenario, &truth, side);
    }
    Ok(())
}

fn scenario_from_flags(flags: &PlayFlags) -> Scenario {
    let mut scenario = if flags.thesis_shot {
        Scenario { seed: flags.seed, ..Scenario::thesis_shot() }
    } else {
        let options = ScenarioOptions {
            n_shots: flags.shots,
            period_s: flags.period_s,
            first_launch_s: flags.first_launch_s,
            wind_sigma_m_s: flags.wind_sigma_m_s,
            frame_rate_hz: flags.fps,
            ..ScenarioOptions::default()
        };
        Scenario::from_seed(flags.seed, &options)
    };
    scenario.noise_level = flags.noise;
    scenario.sway_px = flags.sway_px;
    scenario.frame_rate_hz = flags.fps;
    scenario.right_offset_ns = flags.right_offset_ns;
    scenario.right_phase_ns = flags.right_phase_ns;
    if let Some(contrast) = flags.contrast {
        scenario.light.contrast = contrast;
    }
    for camera in [&mut scenario.rig.left, &mut scenario.rig.right] {
        camera.exposure_s = flags.exposure_us * 1e-6;
        camera.row_time_s = flags.row_time_us * 1e-6;
        if let Some(size_px) = flags.size {
            *camera = camera.clone().with_size_px(size_px);
        }
    }
    scenario
}

fn write_folder(
    directory: &Path,
    scenario: &Scenario,
    truth: &Truth,
    seconds: Option<f64>,
) -> anyhow::Result<()> {
    let ended_at_s = truth.flights.iter().map(|f| f.ended_at_s()).fold(0.0, f64::max);
    let duration_s = seconds.unwrap_or(ended_at_s + AFTER_LAST_FLIGHT_S);
    let n_frames = (duration_s * scenario.frame_rate_hz).ceil() as u64;
    let every = scenario.frame_rate_hz.ceil() as u64;
    let progress = |n_done: u64| {
        if n_done.is_multiple_of(every) || n_done == n_frames {
            eprint!("\r{n_done} of {n_frames} frames");
        }
    };
    shot_folder::write(directory, scenario, truth, n_frames, progress)
        .with_context(|| format!("writing the shot folder {}", directory.display()))?;
    eprintln!("\n{} shots in {}", truth.flights.len(), directory.display());
    Ok(())
}

fn write_still(
    file: &Path,
    scenario: &Scenario,
    truth: &Truth,
    side: Side,
    at_s: f64,
) -> anyhow::Result<()> {
    let renderer = Renderer::new(scenario, truth, side);
    let camera = renderer.camera();
    let mut luma = vec![0; camera.width_px * camera.height_px];
    let frame_idx = (at_s * scenario.frame_rate_hz).round() as u64;
    renderer.render_into(frame_idx, at_s, &mut luma);
    let (width, height) = (camera.width_px as u32, camera.height_px as u32);
    image::GrayImage::from_raw(width, height, luma)
        .context("the buffer has the size of the picture")?
        .save(file)
        .with_context(|| format!("writing {}", file.display()))
}

fn time_frames(scenario: &Scenario, truth: &Truth, side: Side) {
    let started = Instant::now();
    let renderer = Renderer::new(scenario, truth, side);
    eprintln!("background: {:.0} ms", started.elapsed().as_secs_f64() * 1e3);
    let mut luma = vec![0; renderer.camera().width_px * renderer.camera().height_px];
    let mut took_us = Vec::new();
    for frame_idx in 0..N_TIMED_FRAMES {
        let started = Instant::now();
        renderer.render_into(frame_idx, scenario.exposed_at_s(side, frame_idx), &mut luma);
        took_us.push(started.elapsed().as_secs_f64() * 1e6);
    }
    took_us.sort_by(f64::total_cmp);
    let share = |share: f64| took_us[(share * (took_us.len() - 1) as f64) as usize];
    let (median, slow, worst) = (share(0.5), share(0.99), share(1.0));
    println!("us a frame: median {median:.0}, 99 % below {slow:.0}, worst {worst:.0}");
}

// Only the conversion of flags could go wrong without a compiler noticing.
#[cfg(test)]
mod flags {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn flags_are_consistent() {
        use clap::CommandFactory;
        Flags::command().debug_assert();
    }

    #[test]
    fn flags_reach_the_scenario() {
        let args = ["simulate", "--time", "--thesis-shot", "--row-time-us", "9.45"];
        let scenario = scenario_from_flags(&Flags::parse_from(args).play);
        assert!((scenario.rig.right.row_time_s - 9.45e-6).abs() < 1e-15);
        assert_eq!(scenario.world.wind_m_s, Vector3::zeros());
    }
}

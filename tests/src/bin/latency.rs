//! `latency`: how long every stage takes, from a ball's exposure to its shot.
//!
//! Plays two boards that are not there into the real processes and listens on every service.
//! `--sweep` does so for rates, sizes and numbers of workers, `--transport` sends the same frames
//! through shared memory, pipes and sockets. Tables on stdout, words on stderr.

use anyhow::Context as _;
use clap::Parser;
use shm_layout::N_STRIPS_RANGE;
use shm_layout::stop::Stop;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tests::camera;
use tests::latency::report::{Report, transport_text};
use tests::latency::transport::{self, Way};
use tests::latency::{CourtLoad, Options, measure, picture};
use tests::progress;

/// Sizes of the sweep and of the comparison: the thesis' mode, HD, the global shutter camera's.
const SIZES_PX: [[usize; 2]; 3] = [[640, 480], [1280, 720], [1456, 1088]];
/// Rates of the sweep.
const SWEEP_FPS: [f64; 4] = [60.0, 90.0, 120.0, 200.0];

/// Latency of every stage, on simulated boards.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Frames a second of each camera.
    #[arg(long, default_value_t = 90.0)]
    fps: f64,
    /// Their pixels.
    #[arg(long, value_name = "WxH", default_value = "640x480",
          value_parser = camera::size_px_from_text)]
    size: [usize; 2],
    /// Workers of each board.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(N_STRIPS_RANGE))]
    workers: u32,
    /// What goes on beside the ball.
    #[arg(long, value_enum, default_value_t = CourtLoad::Idle)]
    court_load: CourtLoad,
    /// Let fusion tell shots as soon as their bounce is sure.
    #[arg(long)]
    early: bool,
    /// How long it is measured.
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Measure many rates, sizes and numbers of workers, each for --seconds.
    #[arg(long, conflicts_with_all = ["fps", "size", "workers", "transport"])]
    sweep: bool,
    /// Send frames of three sizes through shared memory, a pipe and a Unix socket instead.
    #[arg(long)]
    transport: bool,
    /// The same as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// A picture of the stages.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sweep", "transport"])]
    svg: Option<PathBuf>,
    /// Be a reader of --transport.
    #[arg(long, hide = true, requires = "read_from")]
    read: Option<Way>,
    /// Where it reads.
    #[arg(long, hide = true)]
    read_from: Option<String>,
    /// Frames of each size and way.
    #[arg(long, default_value_t = 900)]
    frames: usize,
    /// End when the process that started this one has ended.
    #[arg(long, hide = true)]
    with_parent: bool,
}

fn main() -> ExitCode {
    let flags = Flags::parse();
    Stop::run("latency", flags.with_parent, |stop| run(&flags, stop))
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    if let (Some(way), Some(place)) = (flags.read, &flags.read_from) {
        return transport::read(way, place, flags.frames, stop);
    }
    anyhow::ensure!(
        (1.0..=1000.0).contains(&flags.fps) && (1.0..=10_000.0).contains(&flags.seconds),
        "--fps is {}, --seconds {}: expected 1 to 1000, 1 to 10000",
        flags.fps,
        flags.seconds
    );
    if flags.transport {
        let lines = transport::compare(&SIZES_PX, flags.fps, flags.frames, stop)?;
        print!("{}", transport_text(&lines));
        return write_json(flags.json.as_deref(), &lines);
    }
    if flags.sweep {
        return sweep(flags, stop);
    }
    let options = Options {
        fps: flags.fps,
        size_px: flags.size,
        n_workers: flags.workers,
        court_load: flags.court_load,
        is_early: flags.early,
        seconds: flags.seconds,
    };
    let report = measure(&options, stop, progress::said(20))?;
    eprintln!();
    print!("{report}");
    if let Some(path) = &flags.svg {
        std::fs::write(path, picture::svg(&report)).with_context(|| path.display().to_string())?;
    }
    write_json(flags.json.as_deref(), &report)
}

fn sweep(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let mut reports = Vec::new();
    println!("{}", Report::head());
    let rates = SWEEP_FPS.into_iter().map(|fps| (SIZES_PX[0], fps, 1));
    let workers = (2..=4).map(|n_workers| (SIZES_PX[0], flags.fps, n_workers));
    let sizes = SIZES_PX[1..].iter().map(|size_px| (*size_px, flags.fps, 1));
    for (size_px, fps, n_workers) in rates.chain(workers).chain(sizes) {
        let (court_load, is_early, seconds) = (flags.court_load, flags.early, flags.seconds);
        let options = Options { fps, size_px, n_workers, court_load, is_early, seconds };
        let report = measure(&options, stop, |_| ())?;
        println!("{}", report.line());
        reports.push(report);
    }
    write_json(flags.json.as_deref(), &reports)
}

fn write_json(path: Option<&Path>, value: &impl serde::Serialize) -> anyhow::Result<()> {
    let Some(path) = path else { return Ok(()) };
    let text = serde_json::to_string_pretty(value)?;
    std::fs::write(path, text + "\n").with_context(|| path.display().to_string())
}

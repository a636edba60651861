//! `fusion`: candidates of both boards in, shots out.

mod boards;
mod files;
mod outputs;
mod steering;
mod table;

use anyhow::{Context as _, ensure};
use clap::Parser;
use fusion::merged::Waits;
use fusion::world::air;
use fusion::{Fit, Fusion, Rig, Settings};
use outputs::Outputs;
use shm_layout::Camera;
use shm_layout::stop::Stop;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use table::{Asked, Table};

/// Measures shots from the candidates of two cameras.
///
/// Live, each shot is a line of JSON on stdout, a message of the service `shots` and a text of the
/// service `shots-json`; a line
/// "watch/1" says that a camera has turned since the rig was calibrated. With
/// --recorded, ends when the recordings are over; then --json FILE holds all of them.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
    #[arg(long)]
    court: String,
    /// The calibrated rig; without it candidates can be written, but nothing is measured.
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// End when this camera's recording is over; may be given for both.
    #[arg(long, value_name = "CAMERA", conflicts_with_all = ["left_csv", "right_csv"])]
    recorded: Vec<Camera>,
    /// Candidates from this file instead of from a board.
    #[arg(long, value_name = "FILE")]
    left_csv: Option<PathBuf>,
    /// Candidates from this file instead of from a board.
    #[arg(long, value_name = "FILE")]
    right_csv: Option<PathBuf>,
    /// Where all shots go in the end, as "shots/1"; - is stdout.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Where every frame's candidates go, as left.csv and right.csv.
    #[arg(long, value_name = "DIR")]
    candidates: Option<PathBuf>,
    /// How shots are measured.
    #[arg(long, value_enum, default_value = "physics")]
    fit: FitFlag,
    /// Temperature of the air, for its density.
    #[arg(long, value_name = "C", default_value_t = 20.0, allow_hyphen_values = true)]
    temperature_c: f64,
    /// Height of the court above the sea, for the density of the air.
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_hyphen_values = true)]
    altitude_m: f64,
    /// Measure on with the rig as it now seems to stand when a camera was found to have turned.
    #[arg(long)]
    refine_rig: bool,
    /// Tell a shot as soon as its bounce is sure, most often with the first frame after it, some 45
    /// ms earlier: where it bounced is known as well, how it went on from there is not.
    #[arg(long)]
    early: bool,
    /// The ball machine: what to tell it for the next ball is published as `corrections`, for what
    /// is `wanted` or a drill.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["recorded", "left_csv", "right_csv"])]
    machine: Option<PathBuf>,
    /// Targets, one after the other.
    #[arg(long, value_name = "FILE", requires = "machine")]
    drill: Option<PathBuf>,
    /// Where the session's report goes and is renewed: session.json, balls.csv, session.svg.
    #[arg(long, value_name = "DIR", requires = "machine")]
    report: Option<PathBuf>,
    /// Of a drill's order of chance.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Say why a ball was lost, stage by stage, on stdout in the end; no shots are written there.
    #[arg(long)]
    explain: bool,
    /// Explain from half a second before this time to two seconds after it, in seconds since the
    /// first frame.
    #[arg(long, value_name = "S", requires = "explain")]
    explain_at_s: Option<f64>,
    /// Explain this shot, counted from 1.
    #[arg(long, value_name = "N", requires = "explain", conflicts_with = "explain_at_s")]
    explain_shot: Option<u64>,
    /// End when the process that started this one has ended.
    #[arg(long)]
    with_parent: bool,
}

/// [`Fit`] on the command line.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum FitFlag {
    /// Drag, lift and bounce fitted to raw pixels.
    Physics,
    /// The thesis' quadratics through triangulated points.
    Quadratic,
}

fn main() -> ExitCode {
    shm_layout::log::to_stderr();
    let flags = Flags::parse();
    Stop::run("fusion", flags.with_parent, |stop| run(&flags, stop))
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let rig = flags.rig.as_deref().map(rig_from_file).transpose()?;
    ensure!(
        rig.is_some() || flags.json.is_none(),
        "--json needs --rig: without it no shot is measured"
    );
    ensure!(rig.is_some() || !flags.explain, "--explain needs --rig: without it nothing is lost");
    let is_one_camera =
        flags.recorded.len() == 1 || flags.left_csv.is_some() != flags.right_csv.is_some();
    if let Some(rig) = rig.as_ref().filter(|_| is_one_camera) {
        eprintln!("fusion: one camera: {}", what_one_camera_gives(rig, flags.fit));
    }
    let outputs = Outputs::open(flags)?;
    ensure!(
        (-50.0..=60.0).contains(&flags.temperature_c),
        "--temperature-c is {}, expected -50 to 60",
        flags.temperature_c
    );
    ensure!(
        (-500.0..=6000.0).contains(&flags.altitude_m),
        "--altitude-m is {}, expected -500 to 6000",
        flags.altitude_m
    );
    let mut settings = Settings {
        fit: match flags.fit {
            FitFlag::Physics => Fit::Physics,
            FitFlag::Quadratic => Fit::Quadratic,
        },
        air_density_kg_m3: air_density_kg_m3(flags),
        refines_rig: flags.refine_rig,
        tells_early: flags.early,
        ..Settings::default()
    };
    if !flags.recorded.is_empty() {
        settings.waits = Waits::RECORDED;
    }
    let fusion = rig.clone().map(|rig| match flags.explain {
        true => Fusion::traced(rig, settings),
        false => Fusion::new(rig, settings),
    });
    let corrections = steering::corrections_of(flags, rig.as_ref())?;
    let table = Table { rig, fusion, outputs, asked: asked(flags), steering: None };
    if flags.left_csv.is_some() || flags.right_csv.is_some() {
        files::run(flags, table)
    } else {
        boards::run(flags, table, corrections, stop)
    }
}

fn air_density_kg_m3(flags: &Flags) -> f64 {
    air::density_kg_m3(flags.temperature_c, flags.altitude_m)
}

/// What is to be explained.
fn asked(flags: &Flags) -> Option<Asked> {
    let window = flags.explain_at_s.map(Asked::AtS).or(flags.explain_shot.map(Asked::Shot));
    flags.explain.then_some(window.unwrap_or(Asked::Whole))
}

/// What to expect if only one camera is there.
fn what_one_camera_gives(rig: &Rig, fit: FitFlag) -> &'static str {
    let is_place_known = rig.court_from_left().is_some() && rig.launcher_in_court_m().is_some();
    match fit {
        FitFlag::Physics if is_place_known => {
            "shots are measured from the launcher's place; what it does not see has wide sigmas"
        }
        FitFlag::Physics => {
            "the rig has no court with a launcher: no shot can be measured, only candidates are \
             written"
        }
        FitFlag::Quadratic => {
            "--fit quadratic needs two: no shot can be measured, only candidates are written"
        }
    }
}

fn rig_from_file(path: &Path) -> anyhow::Result<Rig> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    Ok(Rig::from_file_text(&path.display().to_string(), &text)?)
}

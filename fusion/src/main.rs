//! `fusion`: candidates of both boards in, shots out.

use anyhow::{Context as _, bail, ensure};
use clap::Parser;
use fusion::candidates_csv::CsvWriter;
use fusion::intake::{FrameCounts, Intake};
use fusion::merged::Waits;
use fusion::shot::ClockOffset;
use fusion::watch::{Alarm, words};
use fusion::world::air;
use fusion::{
    Fit, FrameCandidates, Fusion, Rig, Settings, Shot, candidates_csv, message, shots_json,
};
use shm_layout::ports::MessageWriter;
use shm_layout::services::{Domain, Place};
use shm_layout::stop::Stop;
use shm_layout::text::TextWriter;
use shm_layout::{Camera, FrameInfo};
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// A recording that brings nothing new for this long is not coming.
const NEWS_WITHIN: Duration = Duration::from_secs(30);
/// Strips that are not here this long after the last frame was announced are lost.
const STRAGGLERS_WITHIN: Duration = Duration::from_secs(2);
/// Most shots kept for the document at the end; a day of one every three seconds.
const MAX_SHOTS: usize = 28_800;

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
    tracing_subscriber::fmt()
        .with_env_filter(tracing_subscriber::EnvFilter::from_default_env())
        .with_writer(std::io::stderr)
        .init();
    let flags = Flags::parse();
    Stop::run("fusion", flags.with_parent, |stop| run(&flags, stop))
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let rig = flags.rig.as_deref().map(rig_from_file).transpose()?;
    ensure!(
        rig.is_some() || flags.json.is_none(),
        "--json needs --rig: without it no shot is measured"
    );
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
        air_density_kg_m3: air::density_kg_m3(flags.temperature_c, flags.altitude_m),
        refines_rig: flags.refine_rig,
        ..Settings::default()
    };
    if !flags.recorded.is_empty() {
        settings.waits = Waits::RECORDED;
    }
    let fusion = rig.clone().map(|rig| Fusion::new(rig, settings));
    let table = Table { rig, fusion, outputs };
    if flags.left_csv.is_some() || flags.right_csv.is_some() {
        from_files(flags, table)
    } else {
        from_boards(flags, table, stop)
    }
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

/// Where frames are laid on, wherever they come from.
struct Table {
    rig: Option<Rig>,
    fusion: Option<Fusion>,
    outputs: Outputs,
}

impl Table {
    fn take(&mut self, camera: Camera, frames: &[FrameCandidates]) -> anyhow::Result<()> {
        for frame in frames {
            self.outputs.write_candidates(camera, frame)?;
            if let Some(fusion) = &mut self.fusion {
                let shots = fusion.update(camera, frame);
                self.outputs.write_shots(shots)?;
                self.outputs.tell(&fusion.take_alarms());
            }
        }
        Ok(())
    }

    fn finish(mut self, frames: [Option<FrameCounts>; 2]) -> anyhow::Result<()> {
        if let Some(fusion) = &mut self.fusion {
            self.outputs.clock = fusion.clock();
            let shots = fusion.finish();
            let told = shots.last().and_then(|shot| shot.clock);
            self.outputs.clock = told.or(self.outputs.clock);
            self.outputs.write_shots(shots)?;
            self.outputs.tell(&fusion.take_alarms());
            let (dropped, rejected) = (fusion.dropped(), fusion.rejected());
            tracing::info!(?dropped, ?rejected, "fusion ends");
        }
        self.outputs.finish(frames)
    }

    fn check_size(&self, camera: Camera, info: &FrameInfo) -> anyhow::Result<()> {
        let Some(rig) = &self.rig else { return Ok(()) };
        let expected = rig.eye(camera).lens.image_px();
        let got = [info.width_px, info.height_px];
        ensure!(
            got == expected,
            "{camera} images are {}x{}, rig.toml says {}x{}",
            got[0],
            got[1],
            expected[0],
            expected[1]
        );
        Ok(())
    }
}

fn from_files(flags: &Flags, mut table: Table) -> anyhow::Result<()> {
    let mut all = Vec::new();
    let mut counts = [None; 2];
    for (camera, path) in Camera::BOTH.into_iter().zip([&flags.left_csv, &flags.right_csv]) {
        let Some(path) = path else { continue };
        let label = path.display().to_string();
        let file = File::open(path).with_context(|| label.clone())?;
        let frames = candidates_csv::frames_from(file, &label)?;
        let n = frames.len() as u64;
        counts[camera.idx()] = Some(FrameCounts { captured: n, processed: n, lost: 0 });
        all.extend(frames.into_iter().map(|frame| (camera, frame)));
    }
    // In the order of their time, as two boards would send them.
    all.sort_by_key(|(camera, frame)| (frame.exposed_ns, *camera));
    for (camera, frame) in all {
        table.take(camera, &[frame])?;
    }
    table.finish(counts)
}

fn from_boards(flags: &Flags, mut table: Table, stop: &Stop) -> anyhow::Result<()> {
    let member = Domain::new(&flags.court, Place::Fusion)?.join("fusion")?;
    table.outputs.shots_out = Some(member.shots()?.writer()?);
    table.outputs.texts_out = Some(member.shots_json()?.writer()?);
    let (candidates, frames_info) = (member.candidates()?, member.frames_info()?);
    let (strips, alarm) = (candidates.reader()?, candidates.alarm()?);
    let infos = frames_info.reader()?;

    let mut intakes = [Intake::default(), Intake::default()];
    let mut news_at = Instant::now();
    while !stop.is_raised() {
        while let Some(info) = infos.receive()? {
            let Some(camera) = Camera::from_idx(info.camera_idx) else { continue };
            table.check_size(camera, &info)?;
            intakes[camera.idx()].update_info(&info);
            news_at = Instant::now();
        }
        while let Some(strip) = strips.receive()? {
            let Some(camera) = Camera::from_idx(strip.camera_idx) else { continue };
            let frames = intakes[camera.idx()].update(&strip);
            table.take(camera, &frames)?;
            news_at = Instant::now();
        }
        if !flags.recorded.is_empty() && is_over(&intakes, &flags.recorded, news_at.elapsed())? {
            break;
        }
        alarm.wait()?;
    }
    if stop.is_raised() && !flags.recorded.is_empty() {
        return Ok(()); // half a recording is not what was asked for: nothing is written
    }
    let mut counts = [None; 2];
    for camera in Camera::BOTH {
        let intake = &mut intakes[camera.idx()];
        let frames = intake.finish();
        table.take(camera, &frames)?;
        let is_there = intake.counts() != FrameCounts::default();
        counts[camera.idx()] = is_there.then(|| intake.counts());
    }
    table.finish(counts)
}

/// True when all frames of all recordings are here, or what is missing will not come.
fn is_over(intakes: &[Intake; 2], recorded: &[Camera], silence: Duration) -> anyhow::Result<bool> {
    let of = |camera: &Camera| &intakes[camera.idx()];
    if recorded.iter().all(|camera| of(camera).is_whole()) {
        return Ok(true);
    }
    if recorded.iter().all(|camera| of(camera).has_last()) {
        return Ok(silence > STRAGGLERS_WITHIN);
    }
    if silence > NEWS_WITHIN {
        let counts = recorded.iter().map(|camera| format!("{camera} {:?}", of(camera).counts()));
        let counts: Vec<String> = counts.collect();
        bail!("no news of the recording for {} s: {}", silence.as_secs(), counts.join(", "));
    }
    Ok(false)
}

fn rig_from_file(path: &Path) -> anyhow::Result<Rig> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    Ok(Rig::from_file_text(&path.display().to_string(), &text)?)
}

/// Where shots and candidates go.
struct Outputs {
    json: Option<PathBuf>,
    is_live: bool,
    refines_rig: bool,
    shots: Vec<Shot>,
    n_shots: u64,
    clock: Option<ClockOffset>,
    shots_out: Option<MessageWriter<shm_layout::Shot>>,
    texts_out: Option<TextWriter>,
    candidates: [Option<CsvWriter<BufWriter<File>>>; 2],
}

impl Outputs {
    fn open(flags: &Flags) -> anyhow::Result<Self> {
        let mut candidates = [None, None];
        if let Some(directory) = &flags.candidates {
            let inputs = [flags.left_csv.is_some(), flags.right_csv.is_some()];
            for camera in Camera::BOTH {
                let is_input = inputs[camera.idx()] || flags.recorded.contains(&camera);
                let is_live = flags.recorded.is_empty() && inputs == [false, false];
                if is_input || is_live {
                    let path = directory.join(format!("{camera}.csv"));
                    let label = path.display().to_string();
                    let file = File::create(&path).with_context(|| label.clone())?;
                    candidates[camera.idx()] = Some(CsvWriter::new(BufWriter::new(file), label)?);
                }
            }
        }
        Ok(Self {
            json: flags.json.clone(),
            is_live: flags.json.is_none() && flags.candidates.is_none(),
            refines_rig: flags.refine_rig,
            shots: Vec::new(),
            n_shots: 0,
            clock: None,
            shots_out: None,
            texts_out: None,
            candidates,
        })
    }

    fn write_candidates(&mut self, camera: Camera, frame: &FrameCandidates) -> anyhow::Result<()> {
        if let Some(writer) = &mut self.candidates[camera.idx()] {
            writer.write(frame)?;
        }
        Ok(())
    }

    fn write_shots(&mut self, shots: Vec<Shot>) -> anyhow::Result<()> {
        for shot in shots {
            if let Some(writer) = &self.shots_out {
                writer.send(message::from_shot(&shot, self.n_shots))?;
            }
            self.n_shots += 1;
            if self.is_live || self.texts_out.is_some() {
                let text = shots_json::text_from_shot(&shot);
                if let Some(writer) = &self.texts_out {
                    writer.send(&text)?;
                }
                if self.is_live {
                    println!("{text}");
                }
            }
            if self.json.is_some() {
                ensure!(
                    self.shots.len() < MAX_SHOTS,
                    "more than {MAX_SHOTS} shots in one document"
                );
                self.shots.push(shot);
            }
        }
        Ok(())
    }

    /// A camera that has turned: in words on stderr, and live as a line of JSON too.
    fn tell(&self, alarms: &[Alarm]) {
        for alarm in alarms {
            eprintln!("fusion: {}", words::sentence(alarm));
            if self.is_live {
                println!("{}", words::json_from(alarm, self.refines_rig));
            }
        }
    }

    fn finish(self, frames: [Option<FrameCounts>; 2]) -> anyhow::Result<()> {
        for writer in self.candidates.into_iter().flatten() {
            writer.finish()?;
        }
        let Some(path) = &self.json else { return Ok(()) };
        let text = shots_json::text_from(&self.shots, frames, self.clock);
        if path.as_os_str() == "-" {
            writeln!(std::io::stdout(), "{text}").context("stdout")
        } else {
            std::fs::write(path, text + "\n").with_context(|| path.display().to_string())
        }
    }
}

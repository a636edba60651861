//! `track`: a recorded shot in, a measured shot out, through the real processes.

use anyhow::Context as _;
use clap::Parser;
use shm_layout::stop::Stop;
use shm_layout::{Camera, N_STRIPS_RANGE};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{ExitCode, Stdio};
use tests::chain::Chain;
use tests::processes::{self, Household, Until, free_endpoint};

/// Exit code after Ctrl-C: what was asked for was not done, and no one is to blame.
const INTERRUPTED: u8 = 130;

/// Measures the shots of a folder (left.y4m, left.timestamps … rig.toml) with two boards, each with
/// capture, workers and bridge, and fusion. Or its candidates (left.csv …) with fusion alone. Or a
/// recording of `record`, which gives the shots that were told when it was recorded, bit by bit.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// The shot folder, or a recording of `record`.
    folder: PathBuf,
    /// The rig [default: the folder's rig.toml, or the one that was recorded].
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Where the shots go, as "shots/1"; - is stdout.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Where every frame's candidates go, as left.csv and right.csv.
    #[arg(long, value_name = "DIR")]
    candidates: Option<PathBuf>,
    /// Workers of each board.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(N_STRIPS_RANGE))]
    workers: u32,
    /// Play at the speed of the recording instead of as fast as nothing is lost.
    #[arg(long)]
    real_speed: bool,
    /// How shots are measured: physics, or the thesis' quadratic.
    #[arg(long, value_name = "FIT", default_value = "physics")]
    fit: String,
    /// Further flags for fusion, such as "--temperature-c 12 --altitude-m 800".
    #[arg(long, value_name = "FLAGS", allow_hyphen_values = true, default_value = "")]
    fusion_flags: String,
    /// Flags for every worker, such as "--learning-frames 43".
    #[arg(long, value_name = "FLAGS", allow_hyphen_values = true, default_value = "")]
    worker_flags: String,
}

fn main() -> ExitCode {
    match run(&Flags::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) if matches!(e.downcast_ref(), Some(processes::Error::Stopped)) => {
            eprintln!("track: stopped");
            ExitCode::from(INTERRUPTED)
        }
        Err(e) => {
            eprintln!("track: {e:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(flags: &Flags) -> anyhow::Result<()> {
    anyhow::ensure!(
        flags.json.is_some() || flags.candidates.is_some(),
        "nothing to write: expected --json FILE or --candidates DIR"
    );
    let shot = match flags.folder.is_file() {
        true => Folder::of_recording(&flags.folder, flags.rig.is_some())?,
        false => Folder::open(&flags.folder, flags.rig.is_some())?,
    };
    if let Some(directory) = &flags.candidates {
        std::fs::create_dir_all(directory).with_context(|| directory.display().to_string())?;
    }
    let stop = Stop::on_signals(false).context("cannot listen to signals")?;
    let court = processes::own_court("track")?;
    let mut house = Household::new(&court)?;
    let outcome = play(flags, &shot, &mut house, &stop);
    let emptied = house.stop();
    outcome?;
    Ok(emptied?)
}

fn play(
    flags: &Flags,
    shot: &Folder,
    house: &mut Household,
    stop: &Stop,
) -> Result<(), processes::Error> {
    let mut arguments: Vec<OsString> = vec!["--fit".into(), flags.fit.as_str().into()];
    arguments.extend(flags.fusion_flags.split_whitespace().map(Into::into));
    let recorded_rig = shot.recorded_rig.as_ref().map(|file| file.path());
    if let Some(path) = flags.rig.as_deref().or(shot.rig.as_deref()).or(recorded_rig) {
        arguments.extend(["--rig".into(), path.into()]);
    }
    if let Some(path) = &flags.json {
        arguments.extend(["--json".into(), path.into()]);
    }
    if let Some(path) = &flags.candidates {
        arguments.extend(["--candidates".into(), path.into()]);
    }
    let speed = if flags.real_speed { "real" } else { "max" };
    if shot.inputs.is_empty() {
        return replay(&flags.folder, speed, &arguments, house, stop);
    }
    for (camera, input) in &shot.inputs {
        match input {
            Input::Video(_) => arguments.extend(["--recorded".into(), camera.name().into()]),
            Input::Candidates(path) => {
                arguments.extend([format!("--{camera}-csv").into(), path.into()]);
            }
        }
    }
    house.start("fusion", "fusion", &arguments, Until::Done, Stdio::inherit())?;
    if shot.inputs.iter().any(|(_, input)| matches!(input, Input::Video(_))) {
        let chain = Chain {
            n_workers: flags.workers,
            worker_flags: flags.worker_flags.split_whitespace().map(Into::into).collect(),
            endpoint: free_endpoint()?,
        };
        chain.start_fusion_bridge(house)?;
        for (camera, input) in &shot.inputs {
            if let Input::Video(path) = input {
                chain.start_board(house, *camera)?;
                chain.start_capture(house, *camera, path, speed)?;
            }
        }
    }
    house.wait_for("fusion", stop)
}

/// Fusion measures as in play, and is stopped when it has taken all in: so its shots are the same.
fn replay(
    recording: &Path,
    speed: &str,
    arguments: &[OsString],
    house: &mut Household,
    stop: &Stop,
) -> Result<(), processes::Error> {
    house.start("fusion", "fusion", arguments, Until::Stopped, Stdio::inherit())?;
    let arguments = [recording.as_os_str(), "--speed".as_ref(), speed.as_ref()];
    house.start("replay", "replay", &arguments, Until::Done, Stdio::inherit())?;
    house.wait_for("replay", stop)?;
    house.end("fusion")
}

/// What a shot folder holds; a recording has no inputs, it is played.
#[derive(Debug)]
struct Folder {
    inputs: Vec<(Camera, Input)>,
    rig: Option<PathBuf>,
    recorded_rig: Option<tempfile::NamedTempFile>,
}

#[derive(Debug)]
enum Input {
    Video(PathBuf),
    Candidates(PathBuf),
}

impl Folder {
    fn of_recording(recording: &Path, has_rig: bool) -> anyhow::Result<Self> {
        let mut recorded_rig = None;
        if let Some(text) = bridge::recording::reader::rig_from(recording)? {
            let file = tempfile::NamedTempFile::new().context("cannot write the rig")?;
            std::fs::write(file.path(), text)?;
            recorded_rig = Some(file);
        }
        anyhow::ensure!(
            has_rig || recorded_rig.is_some(),
            "{}: was recorded without a rig: expected --rig FILE",
            recording.display()
        );
        Ok(Self { inputs: Vec::new(), rig: None, recorded_rig })
    }

    fn open(folder: &Path, has_rig: bool) -> anyhow::Result<Self> {
        anyhow::ensure!(
            folder.is_dir(),
            "{}: expected a shot folder or a recording",
            folder.display()
        );
        let there = |name: String| Some(folder.join(name)).filter(|path| path.exists());
        let mut inputs = Vec::new();
        for camera in Camera::BOTH {
            let video = there(format!("{camera}.y4m")).map(Input::Video);
            let found = video.or_else(|| there(format!("{camera}.csv")).map(Input::Candidates));
            inputs.extend(found.map(|input| (camera, input)));
        }
        anyhow::ensure!(
            !inputs.is_empty(),
            "{}: expected left.y4m, right.y4m, left.csv or right.csv",
            folder.display()
        );
        let n_videos = inputs.iter().filter(|(_, input)| matches!(input, Input::Video(_))).count();
        anyhow::ensure!(
            n_videos == 0 || n_videos == inputs.len(),
            "{}: expected two videos or two candidate files, got one of each",
            folder.display()
        );
        let rig = there("rig.toml".to_owned());
        anyhow::ensure!(
            has_rig || rig.is_some() || inputs.len() == 1,
            "{}: expected rig.toml, without which two cameras cannot measure",
            folder.display()
        );
        Ok(Self { inputs, rig, recorded_rig: None })
    }
}

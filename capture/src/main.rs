//! `capture`: frames of a camera, or from disk, into the shared memory of a board.

use anyhow::Context as _;
use capture::camera::recorded::RecordedCamera;
use capture::camera::{self, Kind, Settings, Wanted, listed, size_from_text};
use capture::film::film;
use capture::orders::Orders;
use capture::pace::{InFlight, Speed};
use capture::play::{Play, play};
use capture::preview::{self, Preview};
use capture::publisher::Publisher;
use capture::source::{Source, Stamps};
use clap::Parser;
use shm_layout::services::{Domain, Member, Place};
use shm_layout::stop::{Stop, exit_code::FAILURE};
use shm_layout::{Camera, N_STRIPS_RANGE};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Frames a second that are asked of a camera.
const FRAME_RATE_HZ: f64 = 90.0;

/// A preview's words and picture come this often.
const PREVIEW_EVERY: Duration = Duration::from_secs(1);

/// Publishes the frames of one camera into shared memory.
///
/// Exit codes: 0 the recording is over, or it was stopped; 69 no camera; 75 busy or unplugged; 77
/// no permission; 78 the camera cannot do this; 1 anything else; 2 wrong flags.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
    #[arg(long, required_unless_present_any = ["list", "preview"])]
    court: Option<String>,
    /// Which camera this is: left or right.
    #[arg(long, required_unless_present_any = ["list", "preview"])]
    camera: Option<Camera>,

    /// Shows the cameras that are there and what they can do.
    #[arg(long)]
    list: bool,
    /// Frames come from a camera.
    #[arg(long, value_enum, group = "origin")]
    source: Option<Kind>,
    /// Which one: a part of its name (libcamera), or /dev/video0 [default: the first].
    #[arg(long, requires = "source")]
    device: Option<String>,
    /// Width and height of frames.
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size_from_text)]
    size: (u32, u32),
    /// How long a frame is exposed [default: as an automatic start finds, 2000 at most].
    #[arg(long, requires = "source", value_parser = exposure_from_text)]
    exposure_us: Option<f64>,
    /// Analogue gain; in units of its driver for a USB camera [default: as found].
    #[arg(long, requires = "source", value_parser = gain_from_text)]
    gain: Option<f64>,
    /// What is in focus, as one over its distance in metres, where a lens can move.
    #[arg(long, default_value_t = 0.1, value_parser = dioptres_from_text)]
    focus_dioptres: f64,
    /// End after so many frames.
    #[arg(long, requires = "source")]
    frames: Option<u64>,
    /// For aiming: focus and light as a line a second, and the frame as a PNG picture.
    #[arg(long, value_name = "FILE", requires = "origin")]
    preview: Option<PathBuf>,

    /// A YUV4MPEG2 file, mono or 4:2:0.
    #[arg(long, value_name = "FILE", group = "origin")]
    recording: Option<PathBuf>,
    /// A directory of PNG or PGM pictures, in the order of their names.
    #[arg(long, value_name = "DIR", group = "origin")]
    pictures: Option<PathBuf>,
    /// One integer a line, nanoseconds [default: beside the recording, named *.timestamps].
    #[arg(long, value_name = "FILE", conflicts_with = "frame_rate_hz")]
    timestamps: Option<PathBuf>,
    /// Of a camera [default: 90], or for frames without stamps: evenly spaced.
    #[arg(long, value_name = "HZ", value_parser = frame_rate_from_text)]
    frame_rate_hz: Option<f64>,
    /// As recorded, or as fast as the workers keep up without a loss.
    #[arg(long, value_enum, default_value = "real")]
    speed: Speed,
    /// Again from the start when it is over, until stopped; stamps go on.
    #[arg(long)]
    repeat: bool,
    /// Over and over in place of a camera that sees it now: what is due is told by this machine's
    /// clock, so two boards stay together, and one that begins anew goes on where the other is.
    #[arg(long, conflicts_with_all = ["source", "speed", "repeat"])]
    as_camera: bool,

    /// Workers to wait for before the first frame [default: 1 for a recording, none for a camera].
    #[arg(long, value_parser = clap::value_parser!(u32).range(N_STRIPS_RANGE))]
    workers: Option<u32>,
    /// Also wait for the bridge.
    #[arg(long)]
    wait_for_bridge: bool,
    /// End when the process that started this one has ended.
    #[arg(long)]
    with_parent: bool,
}

fn main() -> ExitCode {
    shm_layout::log::to_stderr();
    let flags = Flags::parse();
    #[cfg(not(feature = "libcamera"))]
    if flags.source == Some(Kind::Libcamera) || flags.list {
        go_on_as_neighbour();
    }
    if flags.list {
        print!("{}", listed::all());
        return ExitCode::SUCCESS;
    }
    let name = flags.camera.map_or_else(String::new, |camera| format!(" {camera}"));
    Stop::run_to_code(
        format_args!("capture{name}"),
        flags.with_parent,
        |stop| if flags.preview.is_some() { look(&flags, stop) } else { run(&flags, stop) },
        |why: &anyhow::Error| {
            why.downcast_ref::<capture::Error>().map_or(FAILURE, capture::Error::exit_code)
        },
    )
}

/// A package for boards has a second `capture` that was built with libcamera: it takes the same
/// flags. Returns if there is none or it does not start, and this one says what is missing.
#[cfg(not(feature = "libcamera"))]
fn go_on_as_neighbour() {
    use std::os::unix::process::CommandExt as _;
    use std::process::Command;
    let Ok(here) = std::env::current_exe() else { return };
    let neighbour = here.with_file_name("capture-libcamera");
    if !neighbour.is_file() {
        return;
    }
    // Without its libraries it ends before it is itself, and cameras on USB would not be listed.
    let why = match Command::new(&neighbour).arg("--version").output() {
        Ok(tried) if tried.status.success() => {
            Command::new(&neighbour).args(std::env::args_os().skip(1)).exec().to_string()
        }
        Ok(tried) => String::from_utf8_lossy(&tried.stderr).trim().to_owned(),
        Err(why) => why.to_string(),
    };
    eprintln!("capture: {} does not start: {why}", neighbour.display());
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let (Some(court), Some(side)) = (&flags.court, flags.camera) else {
        anyhow::bail!("expected --court and --camera");
    };
    let member = Domain::new(court, Place::Board(side))?.join("capture")?;
    match flags.source {
        Some(kind) => run_camera(flags, kind, &member, side, stop),
        None => run_recording(flags, &member, side, stop),
    }
}

fn run_camera(
    flags: &Flags,
    kind: Kind,
    member: &Member,
    side: Camera,
    stop: &Stop,
) -> anyhow::Result<()> {
    let wanted = wanted(flags, Some(side));
    let camera = camera::open(kind, &wanted)?;
    film_with(camera, flags, wanted.frame_rate_hz, member, side, stop)
}

/// A recording as fast as its stamps, or as workers keep up; or in place of a camera.
fn run_recording(flags: &Flags, member: &Member, side: Camera, stop: &Stop) -> anyhow::Result<()> {
    let mut source = source_of(flags)?;
    anyhow::ensure!(
        !flags.repeat || source.stamps_ns().len() > 1,
        "--repeat needs two frames or more"
    );
    if flags.as_camera {
        let camera = RecordedCamera::new(source).context("--as-camera needs two frames or more")?;
        return film_with(Box::new(camera), flags, FRAME_RATE_HZ, member, side, stop);
    }
    let n_workers = flags.workers.unwrap_or(1);
    let mut in_flight = InFlight::new(&member.candidates()?, n_workers)?;
    let mut publisher = Publisher::new(member, side, source.size_px())?.on_own_clock();
    let mut orders = Orders::new(member, stop)?;
    let n_workers = n_workers as usize;
    publisher.wait_for_readers(n_workers, flags.wait_for_bridge, || orders.look())?;
    let how = Play { speed: flags.speed, is_repeated: flags.repeat, n_workers };
    Ok(play(&mut source, &mut publisher, &mut in_flight, &mut orders, how)?)
}

fn film_with(
    mut camera: Box<dyn camera::Camera>,
    flags: &Flags,
    rate_hz: f64,
    member: &Member,
    side: Camera,
    stop: &Stop,
) -> anyhow::Result<()> {
    let mut publisher = Publisher::new(member, side, camera.size_px())?;
    let mut orders = Orders::new(member, stop)?.of_camera();
    if flags.workers.is_some() || flags.wait_for_bridge {
        let n_workers = flags.workers.unwrap_or(0) as usize;
        publisher.wait_for_readers(n_workers, flags.wait_for_bridge, || orders.look())?;
    }
    let (settled, (width_px, height_px)) = (camera.settled(), camera.size_px());
    tracing::info!(camera = camera.name(), width_px, height_px, ?settled, "filming");
    let n_wanted = flags.frames;
    match film(camera.as_mut(), &mut publisher, &mut orders, rate_hz, n_wanted) {
        Ok(filmed) => {
            eprintln!("capture {side}: {filmed}");
            Ok(())
        }
        Err(why) => {
            // A camera that has gone may never answer being stopped; this process must end.
            std::mem::forget(camera);
            Err(why.into())
        }
    }
}

/// Looks at a frame a second until stopped, or the pictures are over.
fn look(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let path = flags.preview.as_deref().unwrap_or(Path::new("preview.png"));
    let mut preview = Preview::default();
    let mut show = |luma: &[u8], size_px: (u32, u32)| -> anyhow::Result<()> {
        println!("{}", preview.look(luma, size_px.0));
        Ok(preview::write(path, luma, size_px)?)
    };
    let Some(kind) = flags.source else {
        let mut source = source_of(flags)?;
        let (width_px, height_px) = source.size_px();
        let mut luma = vec![0; width_px as usize * height_px as usize];
        for _ in source.stamps_ns().to_vec() {
            source.read_into(&mut luma)?;
            show(&luma, (width_px, height_px))?;
            if stop.is_raised() {
                break;
            }
        }
        return Ok(());
    };
    let mut camera = camera::open(kind, &wanted(flags, flags.camera))?;
    let (width_px, height_px) = camera.size_px();
    let mut luma = vec![0; width_px as usize * height_px as usize];
    let (mut n_looks, mut look_at, mut heard_at) = (0, Instant::now(), Instant::now());
    while !stop.is_raised() && flags.frames.is_none_or(|n_frames| n_looks < n_frames) {
        let Some(frame) = camera.next_frame(Duration::from_millis(50))? else {
            let silent_s = heard_at.elapsed().as_secs_f64();
            anyhow::ensure!(silent_s < 5.0, "{}: no frame for {silent_s:.0} s", camera.name());
            continue;
        };
        heard_at = Instant::now();
        if heard_at >= look_at {
            frame.pixels.copy_into(&mut luma, width_px)?;
            show(&luma, (width_px, height_px))?;
            (n_looks, look_at) = (n_looks + 1, heard_at + PREVIEW_EVERY);
        }
        camera.give_back()?;
    }
    Ok(())
}

fn wanted(flags: &Flags, side: Option<Camera>) -> Wanted {
    let (exposure_us, gain) = (flags.exposure_us, flags.gain);
    Wanted {
        device: flags.device.clone(),
        size_px: flags.size,
        frame_rate_hz: flags.frame_rate_hz.unwrap_or(FRAME_RATE_HZ),
        settings: Settings { exposure_us, gain, frame_rate_hz: None },
        focus_dioptres: flags.focus_dioptres,
        side,
    }
}

fn source_of(flags: &Flags) -> anyhow::Result<Source> {
    let stamps = |beside: Option<PathBuf>| match (&flags.timestamps, flags.frame_rate_hz, beside) {
        (Some(path), _, _) => Ok(Stamps::File(path.clone())),
        (None, Some(frame_rate_hz), _) => Ok(Stamps::FrameRateHz(frame_rate_hz)),
        (None, None, Some(path)) => Ok(Stamps::File(path)),
        (None, None, None) => Err(anyhow::anyhow!("pictures need --timestamps or --frame-rate-hz")),
    };
    Ok(match (&flags.recording, &flags.pictures) {
        (Some(path), None) => {
            Source::from_recording(path, &stamps(Some(path.with_extension("timestamps")))?)?
        }
        (None, Some(directory)) => Source::from_pictures(directory, &stamps(None)?)?,
        _ => {
            anyhow::bail!("expected --source libcamera or usb, --recording FILE or --pictures DIR")
        }
    })
}

fn number_from_text(text: &str, least: f64, most: f64, what: &str) -> Result<f64, String> {
    let expected = || format!("expected {least} to {most}{what}, got {text:?}");
    let number: f64 = text.parse().map_err(|_| expected())?;
    if (least..=most).contains(&number) { Ok(number) } else { Err(expected()) }
}

fn frame_rate_from_text(text: &str) -> Result<f64, String> {
    number_from_text(text, 1.0, 1000.0, " frames/s")
}

fn exposure_from_text(text: &str) -> Result<f64, String> {
    number_from_text(text, 1.0, 1e6, " us")
}

fn gain_from_text(text: &str) -> Result<f64, String> {
    number_from_text(text, 0.0, 65_535.0, "")
}

fn dioptres_from_text(text: &str) -> Result<f64, String> {
    number_from_text(text, 0.0, 32.0, " dioptres")
}

//! `worker`: frames of one camera in, the candidates of one strip out.

use clap::Parser;
use shm_layout::commands::{CommandServer, Kind, Outcome};
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use shm_layout::{Camera, FrameInfo, N_STRIPS_RANGE};
use std::process::ExitCode;
use workers::foreground::Background;
use workers::method::Method;
use workers::strip::Strip;
use workers::{Settings, Worker};

const DEFAULT: Settings = Settings::DEFAULT;

/// Finds ball candidates in one strip of every frame of a camera.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
    #[arg(long)]
    court: String,
    /// Which camera's frames: left or right.
    #[arg(long)]
    camera: Camera,
    /// Which strip of the frame, from the top, counted from 0.
    #[arg(long, default_value_t = 0)]
    strip: u32,
    /// How many workers share a frame.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(N_STRIPS_RANGE))]
    of: u32,
    /// How balls are found: matched, or test-1 to test-7, the rows of the thesis' Table 1.
    #[arg(long, default_value = DEFAULT.method.name, value_parser = Method::from_name)]
    method: Method,
    /// New is what was not there this many frames ago; 0 (test-1 to test-7): all foreground is new.
    #[arg(long, value_parser = look_back_from_text)]
    look_back_frames: Option<usize>,
    /// Weight of a new frame in the background.
    #[arg(long, default_value_t = DEFAULT.background.learning_rate, value_parser = rate_from_text)]
    learning_rate: f32,
    /// Foreground differs from the background by more than this many sigma (test-1 to test-7).
    #[arg(long, default_value_t = DEFAULT.background.sigma_threshold, value_parser = sigma)]
    sigma_threshold: f32,
    /// Smallest sigma of a pixel believed, grey levels (test-1 to test-7).
    #[arg(long, default_value_t = DEFAULT.background.sigma_floor, value_parser = sigma)]
    sigma_floor: f32,
    /// Frames learned before candidates are reported.
    #[arg(long, default_value_t = DEFAULT.background.n_learning)]
    learning_frames: u32,
    /// End when the process that started this one has ended.
    #[arg(long)]
    with_parent: bool,
}

fn main() -> ExitCode {
    shm_layout::log::to_stderr();
    let flags = Flags::parse();
    Stop::run(
        format_args!("worker {} {}/{}", flags.camera, flags.strip, flags.of),
        flags.with_parent,
        |stop| run(&flags, stop),
    )
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    anyhow::ensure!(flags.strip < flags.of, "--strip {} of {}", flags.strip, flags.of);
    let settings = Settings {
        method: flags.method.clone(),
        background: Background {
            learning_rate: flags.learning_rate,
            sigma_threshold: flags.sigma_threshold,
            sigma_floor: flags.sigma_floor,
            n_learning: flags.learning_frames,
        },
        look_back: flags.look_back_frames,
    };
    let name = format!("worker-{}", flags.strip);
    let member = Domain::new(&flags.court, Place::Board(flags.camera))?.join(&name)?;
    let candidates = member.candidates()?.writer()?;
    // Before frames are read: once they flow, commands are answered.
    let commands = member.commands()?.server()?;
    let service = member.frames()?;
    let (frames, alarm) = (service.reader()?, service.alarm()?);

    let mut current: Option<(FrameInfo, Worker)> = None;
    let mut forget_at = None;
    while !stop.is_raised() {
        obey(&commands, &mut forget_at, stop)?;
        while let Some(frame) = frames.receive()? {
            obey(&commands, &mut forget_at, stop)?;
            let started_ns = now_ns();
            let info = *frame.user_header();
            if !info_fits(&info, frame.payload().len()) {
                tracing::warn!(?info, n_bytes = frame.payload().len(), "frame refused");
                continue;
            }
            if current.as_ref().is_some_and(|(newest, _)| is_overtaken(&info, newest)) {
                // Of a capture that was killed, behind its successor's first: no strip goes back.
                tracing::debug!(?info, "frame of a recording that is over");
                continue;
            }
            if forget_at.is_some_and(|first_idx| info.frame_idx >= first_idx) {
                (current, forget_at) = (None, None);
            }
            let worker = match &mut current {
                Some((before, worker)) if is_same_recording(before, &info) => {
                    *before = info;
                    worker
                }
                slot => {
                    // Another camera mode or run: its background is not ours, nor its numbers.
                    forget_at = None;
                    // It goes first, lest the heap keep room for two.
                    *slot = None;
                    let strip = Strip::new(flags.strip, flags.of, (info.width_px, info.height_px));
                    &mut slot.insert((info, Worker::new(strip, &settings))).1
                }
            };
            let n_relearned = worker.n_relearned();
            let mut message = worker.update(&info, frame.payload());
            if worker.n_relearned() > n_relearned {
                tracing::warn!(frame_idx = info.frame_idx, "another picture stays: learned anew");
            }
            message.started_ns = started_ns;
            message.finished_ns = now_ns();
            candidates.send(message)?;
        }
        alarm.wait()?;
    }
    Ok(())
}

/// Answers the commands that wait. `forget_at` becomes the frame at which the background is to be
/// forgotten.
fn obey(commands: &CommandServer, forget_at: &mut Option<u64>, stop: &Stop) -> anyhow::Result<()> {
    while let Some(asked) = commands.receive()? {
        let command = asked.command();
        match command.kind() {
            Some(Kind::LearnBackground) => {
                *forget_at = Some(command.from_frame_idx);
                asked.answer(Outcome::Done, "the background is learned anew")?;
            }
            Some(Kind::Shutdown) => {
                stop.raise();
                asked.answer(Outcome::Done, "a worker ends")?;
            }
            Some(Kind::Start | Kind::Stop | Kind::SetCamera) => {
                asked.answer(Outcome::NotMine, "")?;
            }
            None => asked.answer(Outcome::Refused, "this worker does not know the command")?,
        }
    }
    Ok(())
}

fn info_fits(info: &FrameInfo, n_bytes: usize) -> bool {
    let n_px = u64::from(info.width_px) * u64::from(info.height_px);
    n_px > 0 && n_px == n_bytes as u64
}

fn is_same_recording(before: &FrameInfo, info: &FrameInfo) -> bool {
    let identity = |i: &FrameInfo| (i.recording_id, i.width_px, i.height_px);
    identity(before) == identity(info)
}

/// Whether a frame is of an earlier recording than the newest frame so far.
fn is_overtaken(info: &FrameInfo, newest: &FrameInfo) -> bool {
    info.recording_id != newest.recording_id && info.published_ns < newest.published_ns
}

fn number_from_text(text: &str, least: f32, most: f32) -> Result<f32, String> {
    let expected = || format!("expected {least} to {most}, got {text:?}");
    let number: f32 = text.parse().map_err(|_| expected())?;
    if (least..=most).contains(&number) { Ok(number) } else { Err(expected()) }
}

fn rate_from_text(text: &str) -> Result<f32, String> {
    number_from_text(text, 0.0, 1.0)
}

fn sigma(text: &str) -> Result<f32, String> {
    number_from_text(text, 0.1, 100.0)
}

fn look_back_from_text(text: &str) -> Result<usize, String> {
    number_from_text(text, 0.0, 64.0).map(|n| n as usize)
}

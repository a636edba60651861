//! `capture`: frames from disk into the shared memory of a board.

use capture::Error;
use capture::orders::Orders;
use capture::pace::{self, InFlight, MAX_IN_FLIGHT, Speed};
use capture::publisher::Publisher;
use capture::source::{Source, Stamps};
use capture::stamps;
use clap::Parser;
use shm_layout::services::{Domain, Place};
use shm_layout::stop::Stop;
use shm_layout::{Camera, N_STRIPS_RANGE};
use std::path::PathBuf;
use std::process::ExitCode;

/// Publishes the frames of one camera into shared memory.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
    #[arg(long)]
    court: String,
    /// Which camera this is: left or right.
    #[arg(long)]
    camera: Camera,
    /// A YUV4MPEG2 file, mono or 4:2:0.
    #[arg(long, value_name = "FILE", group = "source")]
    recording: Option<PathBuf>,
    /// A directory of PNG or PGM pictures, in the order of their names.
    #[arg(long, value_name = "DIR", group = "source")]
    pictures: Option<PathBuf>,
    /// One integer a line, nanoseconds [default: beside the recording, named *.timestamps].
    #[arg(long, value_name = "FILE", conflicts_with = "frame_rate_hz")]
    timestamps: Option<PathBuf>,
    /// For frames without stamps: evenly spaced.
    #[arg(long, value_name = "HZ", value_parser = frame_rate_from_text)]
    frame_rate_hz: Option<f64>,
    /// As recorded, or as fast as the workers keep up without a loss.
    #[arg(long, value_enum, default_value = "real")]
    speed: Speed,
    /// Again from the start when it is over, until stopped; stamps go on.
    #[arg(long)]
    repeat: bool,
    /// Workers to wait for before the first frame.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(N_STRIPS_RANGE))]
    workers: u32,
    /// Also wait for the bridge.
    #[arg(long)]
    wait_for_bridge: bool,
    /// End when the process that started this one has ended.
    #[arg(long)]
    with_parent: bool,
}

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_env_filter(tracing_subscriber::EnvFilter::from_default_env())
        .with_writer(std::io::stderr)
        .init();
    let flags = Flags::parse();
    Stop::run(format_args!("capture {}", flags.camera), flags.with_parent, |stop| run(&flags, stop))
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let mut source = source_of(flags)?;
    let member = Domain::new(&flags.court, Place::Board(flags.camera))?.join("capture")?;
    let mut in_flight = InFlight::new(&member.candidates()?, flags.workers)?;
    let mut publisher = Publisher::new(&member, flags.camera, source.size_px())?.on_own_clock();
    let mut orders = Orders::new(&member, stop)?;
    let n_workers = flags.workers as usize;
    publisher.wait_for_readers(n_workers, flags.wait_for_bridge, || orders.look())?;

    let stamps_ns = source.stamps_ns().to_vec();
    let lap_ns = if flags.repeat { stamps::lap_ns(&stamps_ns) } else { None };
    anyhow::ensure!(lap_ns.is_some() || !flags.repeat, "--repeat needs two frames or more");
    let begun = orders.now();
    let mut n_missed = 0_usize;
    let n_frames = if flags.repeat { usize::MAX } else { stamps_ns.len() };
    for idx in 0..n_frames {
        let (lap, idx_in_lap) = (idx / stamps_ns.len(), idx % stamps_ns.len());
        if idx_in_lap == 0 && lap > 0 {
            source.go_to_start()?;
        }
        let exposed_ns = stamps_ns[idx_in_lap] + lap as i64 * lap_ns.unwrap_or(0);
        match flags.speed {
            Speed::Max => {
                in_flight.wait_until_at_most(MAX_IN_FLIGHT - 1, || orders.look())?;
                orders.wait_while_paused()?;
            }
            Speed::Real => {
                orders.wait_until(pace::due_at(begun, stamps_ns[0], exposed_ns))?;
                in_flight.take_progress()?;
            }
        }
        let is_last = idx + 1 == n_frames;
        let published = publisher.publish(exposed_ns, is_last, |luma| source.read_into(luma))?;
        in_flight.add(published.frame_idx);
        if published.n_reached < n_workers {
            n_missed += 1;
            if flags.speed == Speed::Max {
                let (frame_idx, n_reached) = (published.frame_idx, published.n_reached);
                return Err(Error::WorkerGone { frame_idx, n_reached, n_workers }.into());
            }
        }
    }
    // What was published goes with its publisher: stay until the workers have done with it.
    in_flight.wait_until_at_most(0, || orders.look())?;
    let elapsed_s = (orders.now() - begun).as_secs_f64();
    tracing::info!(n_frames, n_missed, elapsed_s, "recording published");
    Ok(())
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
        _ => anyhow::bail!("expected --recording FILE or --pictures DIR"),
    })
}

fn frame_rate_from_text(text: &str) -> Result<f64, String> {
    let expected = || format!("expected 1 to 1000 frames/s, got {text:?}");
    let frame_rate_hz: f64 = text.parse().map_err(|_| expected())?;
    if (1.0..=1000.0).contains(&frame_rate_hz) { Ok(frame_rate_hz) } else { Err(expected()) }
}

//! `record`: what stands in a court's shared memory, into a file that viewers open.

use bridge::recording::recorder::{self, Options, place_from, words_from};
use clap::Parser;
use shm_layout::services::Place;
use shm_layout::stop::Stop;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Records candidates, clocks, shots and corrections of a court to an MCAP file, which Foxglove and
/// other viewers open and `track` measures again.
///
/// Ends with Ctrl-C or SIGTERM. A killed recorder's file lacks its last half second.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
    #[arg(long)]
    court: String,
    /// Which of its computers this is: fusion, left or right.
    #[arg(long, value_name = "PLACE", value_parser = place_from)]
    place: Place,
    /// The file; one that is there already is not overwritten.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Pixels too, on a board: 27 MB/s of 640x480 at 90 frames/s.
    #[arg(long)]
    frames: bool,
    /// End after this long.
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u32).range(1..))]
    seconds: Option<u32>,
    /// Begin another file after this long, behind a shot: FILE-2, FILE-3. A file of two boards
    /// grows by 0.36 GB/h, and its index in memory by 2.3 MiB/h.
    #[arg(long, value_name = "MIN", default_value = "10",
          value_parser = clap::value_parser!(u32).range(1..=1440))]
    minutes_per_file: u32,
    /// A rig to keep with the recording, for whoever measures it again.
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// End when the process that started this one has ended.
    #[arg(long)]
    with_parent: bool,
}

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::builder()
                .with_default_directive(tracing::level_filters::LevelFilter::ERROR.into())
                .from_env_lossy(),
        )
        .with_writer(std::io::stderr)
        .init();
    let flags = Flags::parse();
    let options = Options {
        court: flags.court,
        place: flags.place,
        with_frames: flags.frames,
        lasting: flags.seconds.map(|seconds| Duration::from_secs(seconds.into())),
        out: flags.out,
        each_lasts: Duration::from_secs(60 * u64::from(flags.minutes_per_file)),
        rig: flags.rig,
    };
    // That a recording could not be ended counts, although the process was asked to end.
    let mut is_whole = true;
    let code = Stop::run("record", flags.with_parent, |stop| {
        match recorder::run(&options, stop) {
            Ok(recorded) => eprintln!("record: {}", words_from(&recorded, &options.out)),
            Err(why) => {
                eprintln!("record: {why}");
                is_whole = false;
            }
        }
        Ok::<(), std::io::Error>(())
    });
    if is_whole { code } else { ExitCode::FAILURE }
}

//! `replay`: a recording, to the fusion of a court of its own.

use bridge::recording::replayer::{self, Speed};
use clap::{Parser, ValueEnum};
use shm_layout::stop::Stop;
use std::path::PathBuf;
use std::process::ExitCode;

/// Plays a recording of `record` to a fusion that was started as for play, and ends when that has
/// taken all of it in: its shots are then those of the recording, bit by bit.
///
/// `track FILE.mcap` does all of it.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// The recording.
    file: PathBuf,
    /// Name of the court, on which nothing else plays.
    #[arg(long)]
    court: String,
    /// How fast.
    #[arg(long, value_enum, default_value = "max")]
    speed: SpeedFlag,
    /// End when the process that started this one has ended.
    #[arg(long)]
    with_parent: bool,
}

/// [`Speed`] on the command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum SpeedFlag {
    /// As it was recorded.
    Real,
    /// As fast as fusion takes it in.
    Max,
}

fn main() -> ExitCode {
    let flags = Flags::parse();
    let speed = match flags.speed {
        SpeedFlag::Real => Speed::Real,
        SpeedFlag::Max => Speed::Max,
    };
    Stop::run("replay", flags.with_parent, |stop| -> anyhow::Result<()> {
        let replayed = replayer::run(&flags.file, &flags.court, speed, stop)?;
        let file = flags.file.display();
        if replayed.is_cut_off {
            eprintln!("replay: {file}: was cut off after {:.1} s", replayed.lasted_s);
        }
        eprintln!(
            "replay: {file}: {:.1} s, {} strips of candidates, {} shots when it was recorded",
            replayed.lasted_s, replayed.n_strips, replayed.n_shots
        );
        Ok(())
    })
}

//! `club`: many simulated courts through one router on this machine, and what each costs.

use clap::Parser;
use shm_layout::stop::Stop;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Messages a second, latency and processor of many courts behind one router.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// How many.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u8).range(1..=40))]
    courts: u8,
    /// How long they play.
    #[arg(long, default_value_t = 15)]
    seconds: u64,
    /// Where to write the same as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn main() -> ExitCode {
    let flags = Flags::parse();
    Stop::run("club", false, |stop| run(&flags, stop))
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let play = Duration::from_secs(flags.seconds);
    let report = tests::club::measure(usize::from(flags.courts), play, stop)?;
    print!("{report}");
    if let Some(path) = &flags.json {
        std::fs::write(path, serde_json::to_string_pretty(&report)?)?;
    }
    Ok(())
}

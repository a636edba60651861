//! `calibrate`: pictures or balls in, rig.toml with its uncertainty out. One subcommand per method.

mod chessboard;
mod court;
mod features;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Calibrates the two cameras of a court, and says how sure it is.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    #[command(subcommand)]
    method: Method,
}

/// One each; see `calibrate METHOD --help`.
#[derive(Debug, Subcommand)]
enum Method {
    /// From the court's white lines.
    Court(court::Args),
    Chessboard(chessboard::Args),
    Features(features::Args),
}

fn run(flags: Flags) -> anyhow::Result<()> {
    match flags.method {
        Method::Court(args) => court::run(&args),
        Method::Chessboard(args) => chessboard::run(&args),
        Method::Features(args) => features::run(&args),
    }
}

fn main() -> ExitCode {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("info"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    match run(Flags::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("calibrate: {error:#}");
            ExitCode::FAILURE
        }
    }
}

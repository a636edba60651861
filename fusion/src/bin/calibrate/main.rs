//! `calibrate`: pictures or balls in, rig.toml with its uncertainty out. One subcommand per method.

mod aim;
mod ball;
mod board;
mod chessboard;
mod court;
mod export;
mod features;
mod files;
mod import;
mod overlay;
mod pictures;
mod siting;

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
    Chessboard(chessboard::Args),
    Court(court::Args),
    Features(features::Args),
    Ball(ball::Args),
    /// Reads a rig that another tool calibrated: OpenCV, ROS, Kalibr.
    Import(import::Args),
    /// Writes a rig as OpenCV's FileStorage YAML.
    Export(export::Args),
    /// Draws a chessboard to print.
    Board(board::Args),
    Aim(aim::Args),
    /// Shows what cameras would see of the court, and how well they would measure.
    Siting(siting::Args),
}

fn run(flags: Flags) -> anyhow::Result<()> {
    match flags.method {
        Method::Chessboard(args) => chessboard::run(&args),
        Method::Court(args) => court::run(&args),
        Method::Features(args) => features::run(&args),
        Method::Ball(args) => ball::run(&args),
        Method::Import(args) => import::run(&args),
        Method::Export(args) => export::run(&args),
        Method::Board(args) => board::run(&args),
        Method::Aim(args) => aim::run(&args),
        Method::Siting(args) => siting::run(&args),
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

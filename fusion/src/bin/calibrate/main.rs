//! `calibrate`: pictures or balls in, rig.toml with its uncertainty out. One subcommand per method.

mod ball;

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
    Ball(ball::Args),
}

fn run(flags: Flags) -> anyhow::Result<()> {
    match flags.method {
        Method::Ball(args) => ball::run(&args),
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

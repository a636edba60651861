//! `board`: everything that runs on one board, until it is stopped.

use clap::Parser as _;
use launcher::flags::Flags;
use launcher::{Error, board};
use shm_layout::stop::Stop;
use std::process::ExitCode;

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_env_filter(tracing_subscriber::EnvFilter::from_default_env())
        .with_writer(std::io::stderr)
        .init();
    let flags = Flags::parse();
    let stop = Stop::on_signals(flags.with_parent).map_err(Error::from);
    match stop.and_then(|stop| board::run(&flags, &stop)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("board {}: {why}", flags.camera);
            ExitCode::from(why.exit_code())
        }
    }
}

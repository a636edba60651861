//! `board`: everything that runs on one board, until it is stopped.

use clap::Parser as _;
use launcher::flags::Flags;
use launcher::{Error, board};
use shm_layout::stop::Stop;
use std::process::ExitCode;

fn main() -> ExitCode {
    shm_layout::log::to_stderr();
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

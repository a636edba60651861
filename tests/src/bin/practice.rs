//! `practice`: a ball machine and a court that are not there, for whoever commands a launcher.
//!
//! Answers launcher commands as a launcher does, and serves the frames of each ball to the `fusion`
//! of the court as the bridge beside it would: at candidate level, as fast as `fusion` takes them,
//! so stamps run ahead of the clock. A line of JSON on stdout for each ball says where it truly
//! landed; words go to stderr.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Parser;
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use tests::machine::actuators::Build;
use tests::sessions::practice::Practice;
use tests::sessions::scene::{Plan, Scene};
use tests::sessions::sighted::{Eyes, Sighted};
use tests::shot_folder;

/// A launcher and a court that are not there, in shared memory.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Name of the court: 1 to 32 of a-z, 0-9 and '-'.
    #[arg(long)]
    court: String,
    /// real or precise.
    #[arg(long, default_value = "real")]
    machine: String,
    /// right, bias, wind-step, gusts, wear or faults.
    #[arg(long, default_value = "bias")]
    scene: String,
    /// Of everything that is left to chance.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The hopper: after so many balls it is empty.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    balls: u32,
    /// Where the rig goes that `fusion` needs; then nothing else is done.
    #[arg(long, value_name = "FILE")]
    write_rig: Option<PathBuf>,
    /// End when the process that started this one has ended.
    #[arg(long)]
    with_parent: bool,
}

fn main() -> ExitCode {
    let flags = Flags::parse();
    Stop::run("practice", flags.with_parent, |stop| run(&flags, stop))
}

fn run(flags: &Flags, stop: &Stop) -> anyhow::Result<()> {
    let sighted = Sighted::new(flags.seed, Eyes::Drawn, 0.0);
    if let Some(path) = &flags.write_rig {
        let text = shot_folder::rig_toml(sighted.scenario());
        return std::fs::write(path, text).with_context(|| path.display().to_string());
    }
    let build = Build::from_name(&flags.machine).map_err(anyhow::Error::msg)?;
    let scene = Scene::from_name(&flags.scene).map_err(anyhow::Error::msg)?;
    let plan = Plan::drawn(flags.seed, scene, build, flags.balls as usize);
    let member = Domain::new(&flags.court, Place::Fusion)?.join("practice")?;
    let mut practice = Practice::open(&member, plan, sighted, now_ns(), stop)?;
    while !stop.is_raised() {
        for ball in practice.answer()? {
            println!("{ball}");
        }
    }
    Ok(())
}

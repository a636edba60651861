//! `calibrate export`: rig.toml in, OpenCV's FileStorage YAML out.

use crate::files::rig_from;
use anyhow::Context;
use fusion::calibration::exchange::opencv;
use fusion::world::rig::Mounting;
use std::path::PathBuf;

/// A rig for another tool.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The rig
    rig: PathBuf,
    /// Where to write M1 D1 M2 D2 R T as OpenCV's FileStorage reads them
    #[arg(long)]
    opencv: PathBuf,
}

/// Reads, writes and says what is left out.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let rig = rig_from(&args.rig)?;
    let place = args.opencv.display();
    std::fs::write(&args.opencv, opencv::text_from(&rig))
        .with_context(|| format!("cannot write {place}"))?;
    println!("written to {place}: M1 D1 M2 D2 R T, in metres");
    if matches!(rig.mounting(), Mounting::Court { .. }) {
        println!("left out, for OpenCV has no place for it: where the cameras stand in the court");
    }
    Ok(())
}

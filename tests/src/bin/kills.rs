//! Kills a board's processes one after another and says how soon frames come again:
//! `kills FOLDER --kills 1000`, where FOLDER has what `simulate --write FOLDER` writes.

use clap::Parser;
use std::path::PathBuf;
use tests::kills;
use tests::processes::own_court;

/// Kills a board's processes under load.
#[derive(Parser)]
#[command(version)]
struct Flags {
    /// A shot folder: its left.y4m is played again and again.
    folder: PathBuf,
    /// How many are killed: a worker, the capture, the bridge, and so on.
    #[arg(long, default_value_t = 100)]
    kills: usize,
}

fn main() -> anyhow::Result<()> {
    let flags = Flags::parse();
    let report = kills::run(&own_court("kills")?, &flags.folder, flags.kills)?;
    print!("{report}");
    let unexplained = report.unexplained();
    anyhow::ensure!(unexplained.is_empty(), "lost, and no bridge was dead: {unexplained:?}");
    let expected = report.expected_words();
    anyhow::ensure!(report.words.contains(&expected), "{expected:?} not in {}", report.words);
    anyhow::ensure!(report.left.is_empty(), "left: {:?}", report.left);
    Ok(())
}

//! `accuracy`: how well `fusion` measures shots, cell by cell, against the truth.
//!
//! The tables go to stdout, words to stderr. `--write` renews the ones in the repository; `--csv`
//! keeps every shot, to find the one that went wrong.

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;

use anyhow::Context as _;
use clap::Parser;
use tests::accuracy::cells::{self, Cell};
use tests::accuracy::row::Row;
use tests::accuracy::{self, shot_csv, table};

/// Tables of cells: shots measured, lost and invented; errors, delays and costs.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Names of cells with commas between; default: all that need no rendering.
    #[arg(long)]
    cells: Option<String>,
    /// The rendered cells as well: a few seconds for each shot.
    #[arg(long, conflicts_with = "cells")]
    pixels: bool,
    /// Shots of each cell; default: what each cell has. `long` and `empty` are always whole.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    shots: Option<u32>,
    /// The first stream's; each other stream has the next one.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Tell shots as soon as their bounce is sure.
    #[arg(long, conflicts_with = "write")]
    early: bool,
    /// Renew tests/results/accuracy.md.
    #[arg(long, conflicts_with = "cells")]
    write: bool,
    /// A line for each shot, for looking closer.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let flags = Flags::parse();
    let mut cells = cells_from_flags(&flags)?;
    cells.iter_mut().for_each(|cell| cell.is_early = flags.early);
    let n_shots = flags.shots.map(|n| n as usize);
    let scores = accuracy::scores(&cells, n_shots, flags.seed, |words| eprintln!("{words}"));
    let rows: Vec<Row> =
        cells.iter().zip(&scores).map(|(cell, s)| Row::from_scores(cell.name, s)).collect();
    print!("{}", table::text_from(&rows));
    if let Some(path) = &flags.csv {
        let file = File::create(path).with_context(|| path.display().to_string())?;
        let by_cell = cells.iter().zip(&scores).map(|(cell, s)| (cell.name, s.as_slice()));
        shot_csv::write(BufWriter::new(file), by_cell)
            .with_context(|| path.display().to_string())?;
    }
    if flags.write {
        let path = table::snapshot_path();
        std::fs::write(&path, table::document_from(&cells, &rows, flags.seed))
            .with_context(|| path.display().to_string())?;
        eprintln!("{}", path.display());
    }
    Ok(())
}

fn cells_from_flags(flags: &Flags) -> anyhow::Result<Vec<Cell>> {
    match &flags.cells {
        Some(text) => {
            text.split(',').map(|name| cells::from_name(name).map_err(anyhow::Error::msg)).collect()
        }
        None => {
            let wanted = |cell: &Cell| flags.pixels || !cell.is_rendered();
            Ok(cells::all().into_iter().filter(wanted).collect())
        }
    }
}

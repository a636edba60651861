//! `calibrate board`: a chessboard to print.

use crate::files::two_from;
use anyhow::{Context, bail};
use fusion::calibration::board::Board;
use std::path::PathBuf;

/// A chessboard to print at true size.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Inner corners, across and down
    #[arg(long, default_value = "9x6", value_parser = corners)]
    corners: [u32; 2],
    /// Side of a square
    #[arg(long, default_value_t = 25.0)]
    square_mm: f64,
    /// Paper: a4, a3, or width and height in millimetres as 420x594mm
    #[arg(long, default_value = "a4", value_parser = paper_mm)]
    paper: [f64; 2],
    /// Where to write it: a .pdf or .svg
    #[arg(long)]
    out: PathBuf,
}

fn corners(text: &str) -> Result<[u32; 2], String> {
    two_from(text).ok_or_else(|| "expected inner corners across and down, as 9x6".to_owned())
}

fn paper_mm(text: &str) -> Result<[f64; 2], String> {
    match text.to_ascii_lowercase().as_str() {
        "a4" => return Ok([210.0, 297.0]),
        "a3" => return Ok([297.0, 420.0]),
        _ => {}
    }
    let sides = text.strip_suffix("mm").and_then(two_from);
    sides.ok_or_else(|| "expected a4, a3, or millimetres as 420x594mm".to_owned())
}

/// Draws, writes, and says how to print.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let board = Board::new(args.corners, args.square_mm, args.paper)?;
    let place = args.out.display();
    let bytes = match args.out.extension().and_then(|extension| extension.to_str()) {
        Some("pdf") => board.pdf(),
        Some("svg") => board.svg().into_bytes(),
        _ => bail!("{place}: expected a name that ends in .pdf or .svg"),
    };
    std::fs::write(&args.out, bytes).with_context(|| format!("cannot write {place}"))?;
    let ([across, down], [width, height]) = (args.corners, board.paper_mm());
    println!(
        "written to {place}: {across}x{down} inner corners, squares of {} mm, paper {width} x \
         {height} mm\nprint at 100 % and measure the ruler: it must be 100 mm long",
        args.square_mm
    );
    if board.is_symmetric() {
        eprintln!(
            "note: turned upside down this board looks the same ({across} + {down} corners are an \
             even number), so a view from its other side is taken for one from this side; \
             {}x{down} would not",
            across + 1
        );
    }
    Ok(())
}

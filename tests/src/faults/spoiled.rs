//! A recording as it was filmed → one with frames that no camera should give.
//!
//! Frames are exchanged in place: same stamps, same size.

use anyhow::{Context as _, ensure};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::Path;

/// What every frame begins with, in what `simulate` writes.
const FRAME_LINE: &[u8] = b"FRAME\n";

/// Side of a false ball, pixels.
const SPOT_PX: usize = 5;

/// What is in place of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spoiled {
    /// The frame with so many bright spots of a ball's size, elsewhere in every frame.
    Spots(usize),
    /// Every pixel at random.
    Noise,
    /// Light that saturates all of it.
    White,
    /// A covered lens.
    Black,
    /// The frame before the first of them, again and again.
    Repeated,
}

/// Spoils frames of a recording (8-bit mono, as `simulate` writes).
///
/// # Errors
/// When it cannot be read or written, or is shorter.
pub fn spoil(recording: &Path, frames: Range<u64>, how: Spoiled, seed: u64) -> anyhow::Result<()> {
    let place = recording.display().to_string();
    let mut file =
        File::options().read(true).write(true).open(recording).with_context(|| place.clone())?;
    let mut line = String::new();
    BufReader::new(&mut file).read_line(&mut line)?;
    let side = |letter| {
        let word = line.split_whitespace().find_map(|word| word.strip_prefix(letter));
        word.and_then(|word| word.parse::<usize>().ok()).with_context(|| format!("{place}: {line}"))
    };
    let (width, height) = (side('W')?, side('H')?);
    let n_frame_bytes = (FRAME_LINE.len() + width * height) as u64;
    let at = |frame_idx: u64| line.len() as u64 + frame_idx * n_frame_bytes;
    ensure!(
        at(frames.end) <= file.metadata()?.len(),
        "{place}: shorter than {} frames",
        frames.end
    );
    ensure!(frames.start > 0, "{place}: the first frame has none before it");
    let mut chance = ChaCha8Rng::seed_from_u64(seed);
    let mut frame = vec![0; n_frame_bytes as usize];
    for frame_idx in frames.clone() {
        let from = if how == Spoiled::Repeated { frames.start - 1 } else { frame_idx };
        file.seek(SeekFrom::Start(at(from)))?;
        file.read_exact(&mut frame)?;
        ensure!(frame.starts_with(FRAME_LINE), "{place}: frame {from} does not begin with FRAME");
        let luma = &mut frame[FRAME_LINE.len()..];
        match how {
            Spoiled::Repeated => {}
            Spoiled::White => luma.fill(255),
            Spoiled::Black => luma.fill(0),
            Spoiled::Noise => chance.fill(luma),
            Spoiled::Spots(n) => {
                for _ in 0..n {
                    let x = chance.random_range(0..width - SPOT_PX);
                    let y = chance.random_range(0..height - SPOT_PX);
                    for row in luma.chunks_exact_mut(width).skip(y).take(SPOT_PX) {
                        row[x..x + SPOT_PX].fill(250);
                    }
                }
            }
        }
        file.seek(SeekFrom::Start(at(frame_idx)))?;
        file.write_all(&frame)?;
    }
    Ok(())
}

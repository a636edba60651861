//! `background`: the empty court as one picture, for `calibrate court`.

use anyhow::Context as _;
use capture::average;
use capture::source::{Source, Stamps};
use clap::Parser;
use std::path::PathBuf;

/// Averages the frames of a recording into one picture: without noise, and without whoever walks
/// by for less than a quarter of the time.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// A YUV4MPEG2 file, or a directory of PNG or PGM pictures.
    frames: PathBuf,
    /// How many frames are averaged, evenly spread over the recording.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u16).range(1..=200))]
    n_frames: u16,
    /// The picture: a PNG of 16 bits.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

fn main() -> anyhow::Result<()> {
    let flags = Flags::parse();
    // When the frames were taken does not matter to a picture of what stands still.
    let stamps = Stamps::FrameRateHz(1.0);
    let mut source = if flags.frames.is_dir() {
        Source::from_pictures(&flags.frames, &stamps)?
    } else {
        Source::from_recording(&flags.frames, &stamps)?
    };
    let (width_px, height_px) = source.size_px();
    let grey = average::from_source(&mut source, flags.n_frames.into())?;
    let picture = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(width_px, height_px, grey)
        .context("a value for each pixel")?;
    picture.save(&flags.out).with_context(|| flags.out.display().to_string())?;
    let n_averaged = source.stamps_ns().len().min(flags.n_frames.into());
    println!("{}: {width_px}x{height_px}, {n_averaged} frames", flags.out.display());
    Ok(())
}

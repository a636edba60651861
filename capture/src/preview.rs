//! Is a camera aimed, sharp and well exposed? A line of words and a picture, again and again.
//!
//! Where the court's lines should be in the picture, `calibrate aim` draws: rigs are fusion's.

use crate::Error;
use image::GrayImage;
use std::fmt;
use std::path::Path;

/// Bars of the histogram.
const N_BARS: usize = 16;

/// This and brighter holds no more light; a ball in it has no edge.
const SATURATED: u8 = 250;
/// This and darker is lost in noise.
const BLACK: u8 = 5;

/// More of a frame than this saturated or black is worth a word.
const TOO_MUCH: f64 = 0.05;

/// What one frame looks like.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    /// Mean square of the differences to the next pixel but one, over the square of the mean level,
    /// in thousandths: grows with sharpness and hardly changes with light. Brenner et al. 1976.
    pub focus: f64,
    /// The best since the preview began.
    pub best_focus: f64,
    /// Share of pixels per sixteenth of the range, dark ones first.
    pub histogram: [f64; N_BARS],
    /// Share of pixels that hold no more light.
    pub saturated: f64,
    /// Share of pixels without light.
    pub black: f64,
    /// Mean level.
    pub mean: f64,
}

/// Remembers the best focus seen, so that a lens can be turned until it is reached again.
#[derive(Debug, Default)]
pub struct Preview {
    best_focus: f64,
}

impl Preview {
    /// Looks at a frame, `width_px` wide.
    ///
    /// # Panics
    /// When it is not whole rows of three pixels or more.
    pub fn look(&mut self, luma: &[u8], width_px: u32) -> Look {
        let width = width_px as usize;
        assert!(width > 2 && !luma.is_empty() && luma.len().is_multiple_of(width), "whole rows");
        let mut counts = [0_u64; 256];
        let mut squares = 0_u64;
        for row in luma.chunks_exact(width) {
            for (&level, &second) in row.iter().zip(&row[2..]) {
                squares += u64::from(level.abs_diff(second)).pow(2);
            }
            for &level in row {
                counts[usize::from(level)] += 1;
            }
        }
        let n = luma.len() as f64;
        let share = |levels: std::ops::RangeInclusive<u8>| {
            let levels = usize::from(*levels.start())..=usize::from(*levels.end());
            counts[levels].iter().sum::<u64>() as f64 / n
        };
        let mean = (0_u64..).zip(&counts).map(|(level, n)| level * n).sum::<u64>() as f64 / n;
        let n_pairs = (luma.len() / width * (width - 2)) as f64;
        let focus = 1000.0 * squares as f64 / n_pairs / mean.max(1.0).powi(2);
        self.best_focus = self.best_focus.max(focus);
        let bar = |idx: usize| share((idx * 16) as u8..=(idx * 16 + 15) as u8);
        Look {
            focus,
            best_focus: self.best_focus,
            histogram: std::array::from_fn(bar),
            saturated: share(SATURATED..=u8::MAX),
            black: share(0..=BLACK),
            mean,
        }
    }
}

impl fmt::Display for Look {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const BARS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
        let tallest = self.histogram.iter().copied().fold(0.0, f64::max);
        write!(f, "focus {:6.2} (best {:6.2})  dark [", self.focus, self.best_focus)?;
        for share in self.histogram {
            // Whatever is there at all is shown.
            write!(f, "{}", BARS[(8.0 * share / tallest).ceil() as usize])?;
        }
        let (mean, saturated, black) = (self.mean, 100.0 * self.saturated, 100.0 * self.black);
        write!(f, "] bright  mean {mean:3.0}, {saturated:.1} % saturated, {black:.1} % black")?;
        if self.saturated > TOO_MUCH {
            write!(f, ": too bright, less --exposure-us or --gain")?;
        } else if self.black > TOO_MUCH {
            write!(f, ": too dark, more light or --gain")?;
        }
        Ok(())
    }
}

/// Writes a picture so that whoever looks at the file never sees half of one.
///
/// # Errors
/// When it cannot be written.
///
/// # Panics
/// When `luma` is not as large as it should be.
pub fn write(path: &Path, luma: &[u8], (width_px, height_px): (u32, u32)) -> Result<(), Error> {
    let unwritable = |why| Error::Unwritable { path: path.to_owned(), why };
    let picture = GrayImage::from_raw(width_px, height_px, luma.to_vec()).expect("a whole frame");
    let beside = path.with_extension("part");
    picture
        .save_with_format(&beside, image::ImageFormat::Png)
        .map_err(|why| unwritable(std::io::Error::other(why)))?;
    std::fs::rename(&beside, path).map_err(unwritable)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A white line across grey, blurred over so many pixels.
    fn line(blur_px: usize) -> Vec<u8> {
        let level = |x: usize| {
            let covered = (0..blur_px).filter(|k| (30..34).contains(&(x + k))).count();
            (80 + 120 * covered / blur_px) as u8
        };
        (0..64 * 8).map(|k| level(k % 64)).collect()
    }

    #[test]
    fn focus_falls_with_blur_and_not_with_light() {
        let mut preview = Preview::default();
        let looks = [1, 3, 6].map(|blur_px| preview.look(&line(blur_px), 64));
        assert!(looks[0].focus > 1.3 * looks[1].focus, "{looks:?}");
        assert!(looks[1].focus > 1.3 * looks[2].focus, "{looks:?}");
        assert_eq!(looks[2].best_focus, looks[0].focus);
        let darker: Vec<u8> = line(3).iter().map(|level| level / 2).collect();
        let off = Preview::default().look(&darker, 64).focus / looks[1].focus - 1.0;
        assert!(off.abs() < 0.05, "{off}");
    }

    #[test]
    fn light_is_told_as_it_is() {
        let mut luma = vec![128; 640];
        luma[..64].fill(255);
        luma[64..96].fill(0);
        let look = Preview::default().look(&luma, 64);
        assert_eq!((look.saturated, look.black), (0.1, 0.05));
        assert_eq!((look.histogram[15], look.histogram[0], look.histogram[8]), (0.1, 0.05, 0.85));
        let words = look.to_string();
        assert!(words.contains("10.0 % saturated") && words.contains("too bright"), "{words}");
        let black = Preview::default().look(&[0; 640], 64).to_string();
        assert!(black.contains("too dark"), "{black}");
    }

    #[test]
    fn a_picture_is_written_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("left.png");
        write(&path, &line(3), (64, 8)).unwrap();
        let read = image::open(&path).unwrap().into_luma8();
        assert_eq!((read.dimensions(), read.into_raw()), ((64, 8), line(3)));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing beside it");
        let nowhere = folder.path().join("no/left.png");
        let why = write(&nowhere, &line(3), (64, 8)).unwrap_err().to_string();
        assert!(why.contains("no/left.png"), "{why}");
    }
}

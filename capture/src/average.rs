//! Frames → the picture of what stands still in them.
//!
//! Of each pixel's brightnesses the middle half is averaged: noise falls nearly as in a mean, and
//! whoever covers a pixel for less than a quarter of the time is not in it. What is left is finer
//! than a grey level, so it is a picture of 16 bits, 257 for each level of the frames.

use crate::Error;
use crate::source::Source;

/// Most frames that are averaged: 200 of 640x480 are 60 MB.
pub const N_FRAMES_MAX: usize = 200;

/// Grey levels of 16 bits in one of 8.
const FINE: u32 = 257;

/// The middle half of each pixel in up to `n_frames` of a source's frames, evenly spread over it.
///
/// # Errors
/// When the source fails.
pub fn from_source(source: &mut Source, n_frames: usize) -> Result<Vec<u16>, Error> {
    let (width_px, height_px) = source.size_px();
    let n_pixels = width_px as usize * height_px as usize;
    let n_there = source.stamps_ns().len();
    let n_taken = n_frames.clamp(1, N_FRAMES_MAX).min(n_there);
    let mut luma = vec![0; n_pixels];
    let mut taken: Vec<Vec<u8>> = Vec::new();
    for frame_idx in 0..n_there {
        source.read_into(&mut luma)?;
        // The k-th is taken once k + 1 of n_taken parts of the frames are begun.
        if frame_idx * n_taken / n_there >= taken.len() {
            taken.push(luma.clone());
        }
    }
    Ok(middle_half(&taken, n_pixels))
}

fn middle_half(frames: &[Vec<u8>], n_pixels: usize) -> Vec<u16> {
    let mut values = vec![0; frames.len()];
    let drop = frames.len() / 4;
    (0..n_pixels)
        .map(|pixel| {
            for (value, frame) in values.iter_mut().zip(frames) {
                *value = frame[pixel];
            }
            values.sort_unstable();
            let kept = &values[drop..frames.len() - drop];
            let sum: u32 = kept.iter().map(|&v| u32::from(v)).sum();
            let n = kept.len() as u32;
            ((FINE * sum + n / 2) / n) as u16
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_walks_by_is_not_in_the_picture_and_noise_averages_out() {
        // 100.5 with noise of a level; somebody bright stands there in a fifth of the frames.
        let frames: Vec<Vec<u8>> =
            (0..40_u8).map(|i| vec![if i % 5 == 0 { 250 } else { 99 + i % 4 }]).collect();
        let kept = f64::from(middle_half(&frames, 1)[0]) / f64::from(FINE);
        assert!((kept - 100.5).abs() < 0.6, "{kept}");
        assert_eq!(middle_half(&[vec![7], vec![7]], 1), [7 * 257]);
    }
}

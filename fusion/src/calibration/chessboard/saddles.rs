//! Picture -> places where dark and bright squares meet crosswise, to about a pixel.
//!
//! The smoothed brightness has a saddle there: its Hessian's determinant is most negative (Beaudet
//! 1978). Around a true one a ring of samples is bright, dark, bright, dark, and the same half a
//! turn on (the idea of ChESS, Bennett and Lasenby 2014). The four changes tell both edges.
//!
//! Brightness is only compared within a ring, so uneven light does no harm. Angles in radians, from
//! the picture's x axis towards its y axis (down).

use super::super::picture::Picture;
use std::f64::consts::{PI, TAU};

/// Most saddles of a picture; the strongest are kept. A 20x20 board has 400.
pub const MAX_SADDLES: usize = 1500;

/// Local maxima that are looked at more closely.
const MAX_PEAKS: usize = 8000;

/// Smoothing before derivatives, px: of the order of a sharp picture's own blur.
const SMOOTHING_PX: f64 = 1.2;

/// Squares of 8 px still have their own ring.
const RING_PX: f64 = 3.5;

const N_RING: usize = 32;

/// A saddle is the strongest within so many pixels each way.
const PEAK_HALF_PX: usize = 2;

/// Of bright minus dark, brightness levels; noise after smoothing is about one.
const CONTRAST_MIN: f64 = 8.0;

/// A ring and itself half a turn on may differ by this much of its contrast, RMS.
const ASYMMETRY_MAX: f64 = 0.3;

/// Edges that cross at less than this, or at more than half a turn less this, are no board.
const EDGE_ANGLE_MIN_RAD: f64 = 0.3;

/// Where four squares meet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Saddle {
    /// To the right.
    pub x_px: f64,
    /// Downwards.
    pub y_px: f64,
    /// Directions of both edges, the first from 0 to half a turn, the second beyond it by less than
    /// half a turn: between them it is bright.
    pub edges_rad: [f64; 2],
    /// Minus the Hessian's determinant, brightness² per px⁴.
    pub strength: f64,
}

/// The saddles of a picture, strongest first.
#[must_use]
pub fn from_picture(picture: &Picture) -> Vec<Saddle> {
    let (width, height) = (picture.width_px(), picture.height_px());
    let margin = RING_PX.ceil() as usize + 1;
    if width <= 2 * margin || height <= 2 * margin {
        return Vec::new();
    }
    let smooth = smoothed(picture, SMOOTHING_PX);
    let strength = strength_of(&smooth);
    let mut peaks = Vec::new();
    for y in margin..height - margin {
        for x in margin..width - margin {
            let here = strength[y * width + x];
            // A ring of CONTRAST_MIN has a multiple of this in its middle.
            if here > 0.5 && is_peak(&strength, width, x, y) {
                peaks.push((here, x, y));
            }
        }
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.truncate(MAX_PEAKS);
    let saddles = peaks.into_iter().filter_map(|(strength, x, y)| {
        let edges_rad = edges_around(&smooth, x as f64, y as f64)?;
        Some(Saddle { x_px: x as f64, y_px: y as f64, edges_rad, strength: f64::from(strength) })
    });
    saddles.take(MAX_SADDLES).collect()
}

/// A Gaussian's, row by row and column by column; the border repeats its last pixel.
#[must_use]
pub fn smoothed(picture: &Picture, sigma_px: f64) -> Picture {
    let (width, height) = (picture.width_px(), picture.height_px());
    let half = (3.0 * sigma_px).ceil() as isize;
    let weights: Vec<f32> =
        (-half..=half).map(|i| (-0.5 * (i as f64 / sigma_px).powi(2)).exp() as f32).collect();
    let sum: f32 = weights.iter().sum();
    let weights: Vec<f32> = weights.into_iter().map(|w| w / sum).collect();
    let within = |v: isize, n: usize| v.clamp(0, n as isize - 1) as usize;
    let mut rows = vec![0.0_f32; width * height];
    for (row, line) in rows.chunks_mut(width).zip(picture.luma().chunks(width)) {
        for (x, out) in row.iter_mut().enumerate() {
            let from = x as isize - half;
            *out = if from >= 0 && x as isize + half < width as isize {
                let pixels = &line[from as usize..];
                weights.iter().zip(pixels).map(|(w, p)| w * p).sum()
            } else {
                let pixels = (from..).map(|x| line[within(x, width)]);
                weights.iter().zip(pixels).map(|(w, p)| w * p).sum()
            };
        }
    }
    let mut luma = vec![0.0_f32; width * height];
    for (y, out) in luma.chunks_mut(width).enumerate() {
        for (i, weight) in weights.iter().enumerate() {
            let from = within(y as isize - half + i as isize, height) * width;
            for (out, pixel) in out.iter_mut().zip(&rows[from..from + width]) {
                *out += weight * pixel;
            }
        }
    }
    Picture::new(width, height, luma)
}

/// Half the size, each pixel the mean of four.
#[must_use]
pub fn halved(picture: &Picture) -> Picture {
    let (width, height) = (picture.width_px() / 2, picture.height_px() / 2);
    let mean = |x: usize, y: usize| {
        let (x, y) = (2 * x, 2 * y);
        let sum = picture.at(x, y)
            + picture.at(x + 1, y)
            + picture.at(x, y + 1)
            + picture.at(x + 1, y + 1);
        0.25 * sum
    };
    let luma = (0..height).flat_map(|y| (0..width).map(move |x| mean(x, y))).collect();
    Picture::new(width, height, luma)
}

/// Minus the Hessian's determinant at every pixel but the outermost.
fn strength_of(smooth: &Picture) -> Vec<f32> {
    let (width, height) = (smooth.width_px(), smooth.height_px());
    let mut strength = vec![0.0; width * height];
    for y in 1..height - 1 {
        let line = |y: usize| &smooth.luma()[y * width..(y + 1) * width];
        let [above, here, below] = [line(y - 1), line(y), line(y + 1)];
        for x in 1..width - 1 {
            let xx = here[x + 1] - 2.0 * here[x] + here[x - 1];
            let yy = below[x] - 2.0 * here[x] + above[x];
            let xy = 0.25 * (below[x + 1] - below[x - 1] - above[x + 1] + above[x - 1]);
            strength[y * width + x] = xy * xy - xx * yy;
        }
    }
    strength
}

/// Whether nothing near is stronger; of equals the last counts.
fn is_peak(strength: &[f32], width: usize, x: usize, y: usize) -> bool {
    let here = strength[y * width + x];
    let half = PEAK_HALF_PX;
    (y - half..=y + half).all(|v| {
        let row = &strength[v * width + x - half..=v * width + x + half];
        row.iter().enumerate().all(|(i, &near)| {
            let is_later = v > y || (v == y && i > half);
            near < here || (near == here && !is_later)
        })
    })
}

/// Both edges through a point, as [`Saddle::edges_rad`]; None if its ring is not that of a saddle.
#[must_use]
pub fn edges_around(smooth: &Picture, x_px: f64, y_px: f64) -> Option<[f64; 2]> {
    let angle_of = |i: f64| TAU * i / N_RING as f64;
    let mut ring = [0.0; N_RING];
    for (i, value) in ring.iter_mut().enumerate() {
        let (sin, cos) = angle_of(i as f64).sin_cos();
        *value = smooth.between(x_px + RING_PX * cos, y_px + RING_PX * sin)?;
    }
    let (low, high) = ring.iter().fold((f64::MAX, f64::MIN), |(a, b), &v| (a.min(v), b.max(v)));
    let contrast = high - low;
    let middle = 0.5 * (low + high);
    let half = N_RING / 2;
    let unlike: f64 = (0..half).map(|i| (ring[i] - ring[i + half]).powi(2)).sum();
    if contrast < CONTRAST_MIN || (unlike / half as f64).sqrt() > ASYMMETRY_MAX * contrast {
        return None;
    }
    // Where the ring becomes bright, and where dark.
    let (mut rises, mut falls) = (Vec::new(), Vec::new());
    for i in 0..N_RING {
        let (before, after) = (ring[i] - middle, ring[(i + 1) % N_RING] - middle);
        let at = angle_of(i as f64 + before / (before - after));
        if before < 0.0 && after >= 0.0 {
            rises.push(at);
        } else if before >= 0.0 && after < 0.0 {
            falls.push(at);
        }
    }
    let [Some(rise), Some(fall)] = [line_of(&rises), line_of(&falls)] else { return None };
    let opening = (fall - rise).rem_euclid(PI);
    let is_open = (EDGE_ANGLE_MIN_RAD..PI - EDGE_ANGLE_MIN_RAD).contains(&opening);
    is_open.then_some([rise, rise + opening])
}

/// The line, 0 to half a turn, through two opposite angles; None if they are not.
fn line_of(angles: &[f64]) -> Option<f64> {
    let [a, b] = angles else { return None };
    let off = (b - a - PI).rem_euclid(TAU);
    let off = if off > PI { off - TAU } else { off };
    (off.abs() < 0.6).then(|| (a + 0.5 * off).rem_euclid(PI))
}

/// Angle between two lines, 0 to a quarter turn.
#[must_use]
pub fn angle_between_lines(a_rad: f64, b_rad: f64) -> f64 {
    let off = (a_rad - b_rad).rem_euclid(PI);
    off.min(PI - off)
}

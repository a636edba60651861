//! Start → the pixels a ball is fitted to, in light.

use super::{LANES, Lanes, MOTION_MAX, Start};
use crate::light;

/// Pixels farther outside the outline than this are left out.
const MARGIN_PX: f32 = 2.0;

/// Most pixels looked at: of a larger window every second, third … row and column is taken.
pub const MAX_PIXELS: usize = 512;

/// Some of the window's pixels; those that are not there weigh nothing.
#[derive(Debug, Clone, Copy)]
pub struct Pixels {
    pub x: Lanes,
    pub y: Lanes,
    /// Light beyond that of the background.
    pub seen: Lanes,
    /// Light of the background.
    pub background: Lanes,
    /// Grey levels for a unit of light.
    pub weight: Lanes,
}

impl Pixels {
    const NONE: Self = Self {
        x: [0.0; LANES],
        y: [0.0; LANES],
        seen: [0.0; LANES],
        background: [0.0; LANES],
        weight: [0.0; LANES],
    };
}

/// The pixels around a start.
#[derive(Debug)]
pub struct Window {
    pixels: [Pixels; MAX_PIXELS / LANES],
    /// How many there are.
    pub n_px: f32,
    /// Each stands for so many.
    pub worth: f32,
    /// Sum of their squares, grey levels.
    pub total2: f32,
}

impl Window {
    /// Those within these columns and rows (first, end).
    pub fn around(
        start: &Start,
        pixel: impl Fn(u32, u32) -> (f32, f32),
        (columns, rows): ((u32, u32), (u32, u32)),
    ) -> Self {
        let Start { center_px: [x, y], radius_px, motion_px, .. } = *start;
        let reach = radius_px * 1.3 + MARGIN_PX;
        let range = |middle: f32, motion: f32, (first, end): (u32, u32)| {
            let half = reach + 0.5 * motion.abs().min(MOTION_MAX * 2.0 * radius_px);
            let from = (middle - half).ceil().max(first as f32) as u32;
            let to = ((middle + half).floor().max(0.0) as u32 + 1).min(end);
            (from, to.max(from))
        };
        let (columns, rows) = (range(x, motion_px[0], columns), range(y, motion_px[1], rows));
        let n_taken = |step: u32| {
            ((columns.1 - columns.0).div_ceil(step) * (rows.1 - rows.0).div_ceil(step)) as usize
        };
        let mut step = 1;
        while n_taken(step) > MAX_PIXELS {
            step += 1;
        }
        let mut window = Self {
            pixels: [Pixels::NONE; MAX_PIXELS / LANES],
            n_px: n_taken(step) as f32,
            worth: (step * step) as f32,
            total2: 0.0,
        };
        let places = (rows.0..rows.1)
            .step_by(step as usize)
            .flat_map(|y| (columns.0..columns.1).step_by(step as usize).map(move |x| (x, y)));
        for (idx, (x, y)) in places.enumerate() {
            let (difference, behind) = pixel(x, y);
            let background = light::from_grey(behind);
            let seen = light::from_grey(behind + difference) - background;
            // Noise is about alike in grey levels. The brighter of both, lest a pixel that happens
            // to be dark should count more.
            let weight = 1.0 / light::slope(behind + difference.max(0.0));
            let (chunk, lane) = (&mut window.pixels[idx / LANES], idx % LANES);
            (chunk.x[lane], chunk.y[lane]) = (x as f32, y as f32);
            (chunk.seen[lane], chunk.background[lane]) = (seen, background);
            chunk.weight[lane] = weight;
            window.total2 += (weight * seen).powi(2);
        }
        window
    }

    /// The pixels.
    pub fn pixels(&self) -> &[Pixels] {
        &self.pixels[..(self.n_px as usize).div_ceil(LANES)]
    }
}

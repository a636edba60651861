//! Start → the pixels a ball is fitted to, in light.

use super::model::sum_of;
use super::{LANES, Lanes, MOTION_MAX, Picture, Start};
use crate::dispatch::Task;
use crate::light;
use arrayvec::ArrayVec;
use std::ops::Range;

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

    /// Difference and background of those that are there, grey levels → light.
    #[inline(always)]
    fn turn_to_light(&mut self) {
        for i in 0..LANES {
            let (difference, behind) = (self.seen[i], self.background[i]);
            let background = light::from_grey(behind);
            self.background[i] = background;
            self.seen[i] = light::from_grey(behind + difference) - background;
            // Noise is about alike in grey levels. The brighter of both, lest a pixel that happens
            // to be dark should count more.
            self.weight[i] /= light::slope(behind + difference.max(0.0));
        }
    }

    /// What is seen, squared, grey levels.
    #[inline(always)]
    fn squares(&self) -> Lanes {
        std::array::from_fn(|i| (self.weight[i] * self.seen[i]).powi(2))
    }
}

/// The pixels around a start.
#[derive(Debug)]
pub struct Window {
    pixels: ArrayVec<Pixels, { MAX_PIXELS / LANES }>,
    /// How many there are.
    pub n_px: f32,
    /// Each stands for so many.
    pub worth: f32,
    /// Sum of their squares, grey levels.
    total2: f32,
    /// By how much a pixel's own variance is smaller than σ².
    likeness: f32,
}

impl Window {
    /// Those that are known.
    pub fn around(start: &Start, picture: &impl Picture) -> Self {
        let Start { center_px: [x, y], radius_px, motion_px, .. } = *start;
        let reach = radius_px * 1.3 + MARGIN_PX;
        let range = |middle: f32, motion: f32, known: Range<u32>| {
            let half = reach + 0.5 * motion.abs().min(MOTION_MAX * 2.0 * radius_px);
            let first = (middle - half).ceil().max(known.start as f32) as u32;
            let end = ((middle + half).floor().max(0.0) as u32 + 1).min(known.end);
            first..end.max(first)
        };
        let known = picture.known();
        let (columns, rows) = (range(x, motion_px[0], known.0), range(y, motion_px[1], known.1));
        let n_taken = |step: usize| columns.len().div_ceil(step) * rows.len().div_ceil(step);
        let mut step = 1;
        while n_taken(step) > MAX_PIXELS {
            step += 1;
        }
        let mut window = Self {
            pixels: ArrayVec::new(),
            n_px: n_taken(step) as f32,
            worth: (step * step) as f32,
            total2: 0.0,
            likeness: picture.likeness(),
        };
        let (mut chunk, mut lane) = (Pixels::NONE, 0);
        for y in rows.step_by(step) {
            let row = picture.row(y, columns.clone());
            // `step_by` of anything but a range takes three times as long.
            let row = columns.clone().zip(row).enumerate();
            for (_, (x, pixel)) in row.filter(|(at, _)| step == 1 || at % step == 0) {
                (chunk.x[lane], chunk.y[lane]) = (x as f32, y as f32);
                (chunk.seen[lane], chunk.background[lane]) = pixel;
                chunk.weight[lane] = 1.0;
                lane += 1;
                if lane == LANES {
                    window.pixels.push(chunk);
                    lane = 0;
                }
            }
        }
        if lane > 0 {
            chunk.weight[lane..].fill(0.0);
            window.pixels.push(chunk);
        }
        picture.simd().run(ToLight(&mut window));
        window
    }

    /// Inverse variance of a pixel, of a thinned-out window of all that it stands for.
    pub fn weight(&self, start: &Start) -> f32 {
        self.worth / (start.sigma * start.sigma)
    }

    /// Which part of the squares beyond the noise is explained when so many are left.
    pub fn explained(&self, residual2: f32, start: &Start) -> f32 {
        self.explained_of([self.n_px, self.total2, residual2], start)
    }

    /// The same of some pixels: their number, their squares, and what is left of those.
    pub fn explained_of(&self, [n_px, total2, residual2]: [f32; 3], start: &Start) -> f32 {
        let noise2 = n_px * start.sigma * start.sigma / self.likeness;
        1.0 - (residual2 - noise2).max(0.0) / (total2 - noise2).max(noise2)
    }

    /// The pixels.
    pub fn pixels(&self) -> &[Pixels] {
        &self.pixels
    }
}

/// Grey levels of a window → light.
struct ToLight<'a>(&'a mut Window);

impl Task for ToLight<'_> {
    #[inline(always)]
    fn run(self) {
        let mut squares = [0.0; LANES];
        for chunk in &mut self.0.pixels {
            chunk.turn_to_light();
            for (sum, square) in squares.iter_mut().zip(chunk.squares()) {
                *sum += square;
            }
        }
        self.0.total2 = sum_of(squares);
    }
}

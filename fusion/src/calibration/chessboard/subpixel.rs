//! A saddle to a pixel -> the crossing of its two edges, to hundredths.
//!
//! The squares around a corner are two crossing edges, each blurred by lens and shutter:
//! `I(d) = level + slope·d − A tanh(n₁·d / s) tanh(n₂·d / s)`, `d` from the corner, `n` the edges'
//! normals. Nine unknowns are fitted to the pixels of a disc that ends before the next corner. All
//! pixels along the edges count, the blur is measured with it, and uneven light is its own unknown.
//! How it compares with OpenCV's gradient search stands in [`super`].
//!
//! Limits: edges are straight within the disc, and blur is the same on both.

use super::super::least_squares::{Normal, Patience, Problem, solution};
use super::super::picture::Picture;
use crate::world::camera::RawPixel;

/// The disc's radius, in distances to the nearest corner, and in pixels.
const RADIUS_PER_SIDE: f64 = 0.45;
const RADIUS_PX: [f64; 2] = [2.5, 9.0];

/// A corner may be this far from its guess, in radii.
const OFF_MAX: f64 = 0.6;

/// Bright minus dark, brightness levels, below which noise moves the corner by half a pixel.
const CONTRAST_MIN: f64 = 6.0;

/// A tanh of scale 1 rises like a step blurred by this sigma.
const SIGMA_PER_SCALE: f64 = 0.8;

/// Blur to begin with, as scale in px.
const SCALE_PX: f64 = 1.0;

/// A corner of squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Where the edges cross.
    pub at: RawPixel,
    /// Sigma of the blur across the edges.
    pub blur_px: f64,
}

/// x, y, both edges' angles, contrast, level, its slope along x and y, scale of the blur.
type Unknowns = [f64; 9];

struct Disc<'a> {
    picture: &'a Picture,
    center: [f64; 2],
    radius_px: f64,
}

impl Disc<'_> {
    fn pixels(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        let reach = |center: f64, n: usize| {
            let from = (center - self.radius_px).ceil().max(0.0) as usize;
            let to = (center + self.radius_px).floor().max(0.0) as usize;
            from..(to + 1).min(n)
        };
        let rows = reach(self.center[1], self.picture.height_px());
        let columns = reach(self.center[0], self.picture.width_px());
        rows.flat_map(move |y| columns.clone().map(move |x| (x, y))).filter_map(|(x, y)| {
            let (u, v) = (x as f64, y as f64);
            let distance = (u - self.center[0]).hypot(v - self.center[1]);
            (distance <= self.radius_px).then(|| (u, v, f64::from(self.picture.at(x, y))))
        })
    }
}

impl Problem for Disc<'_> {
    type State = Unknowns;

    fn n_unknowns(&self) -> usize {
        9
    }

    fn system(&self, state: &Unknowns) -> Option<Normal> {
        let [x, y, first, second, contrast, level, along_x, along_y, scale] = *state;
        if scale <= 0.05 || !state.iter().all(|v| v.is_finite()) {
            return None;
        }
        let mut normal = Normal::new(9);
        let ([sin1, cos1], [sin2, cos2]) = (pair(first.sin_cos()), pair(second.sin_cos()));
        for (u, v, seen) in self.pixels() {
            let (dx, dy) = (u - x, v - y);
            let (across1, across2) = (dy * cos1 - dx * sin1, dy * cos2 - dx * sin2);
            let (t1, t2) = ((across1 / scale).tanh(), (across2 / scale).tanh());
            // Derivatives by the distances across the edges.
            let by1 = -contrast * (1.0 - t1 * t1) * t2 / scale;
            let by2 = -contrast * (1.0 - t2 * t2) * t1 / scale;
            let told = level + along_x * dx + along_y * dy - contrast * t1 * t2;
            let slopes = [
                (0, by1 * sin1 + by2 * sin2 - along_x),
                (1, -by1 * cos1 - by2 * cos2 - along_y),
                (2, -by1 * (dy * sin1 + dx * cos1)),
                (3, -by2 * (dy * sin2 + dx * cos2)),
                (4, -t1 * t2),
                (5, 1.0),
                (6, dx),
                (7, dy),
                (8, -(by1 * across1 + by2 * across2) / scale),
            ];
            normal.add(told - seen, &slopes);
        }
        normal.cost.is_finite().then_some(normal)
    }

    fn moved(&self, state: &Unknowns, step: &[f64]) -> Unknowns {
        std::array::from_fn(|i| state[i] + step[i])
    }
}

fn pair((a, b): (f64, f64)) -> [f64; 2] {
    [a, b]
}

/// The corner near `guess`, whose edges run about so and whose nearest neighbour is `side_px` away;
/// None if the pixels show none there.
#[must_use]
pub fn corner_near(
    picture: &Picture,
    guess: RawPixel,
    edges_rad: [f64; 2],
    side_px: f64,
) -> Option<Corner> {
    let radius_px = (RADIUS_PER_SIDE * side_px).clamp(RADIUS_PX[0], RADIUS_PX[1]);
    let mut center = [guess.x_px, guess.y_px];
    let mut found = None;
    // The disc is laid anew around the first answer, so that its border does not pull.
    for _ in 0..2 {
        let disc = Disc { picture, center, radius_px };
        let lumas = || disc.pixels().map(|(_, _, luma)| luma);
        let (n, sum) = lumas().fold((0.0, 0.0), |(n, sum), luma| (n + 1.0, sum + luma));
        let (low, high) = lumas().fold((f64::MAX, f64::MIN), |(a, b), l| (a.min(l), b.max(l)));
        let contrast = 0.5 * (high - low);
        let [first, second] = edges_rad;
        let start: Unknowns =
            [center[0], center[1], first, second, contrast, sum / n, 0.0, 0.0, SCALE_PX];
        let state = solution(&disc, start, Patience { n_steps_max: 25, step_min: 0.05 })?.state;
        let off = (state[0] - guess.x_px).hypot(state[1] - guess.y_px);
        if off > OFF_MAX * radius_px || state[4] < 0.5 * CONTRAST_MIN {
            return None;
        }
        center = [state[0], state[1]];
        found = Some(state);
    }
    let [x_px, y_px, .., scale] = found?;
    Some(Corner { at: RawPixel { x_px, y_px }, blur_px: SIGMA_PER_SCALE * scale })
}

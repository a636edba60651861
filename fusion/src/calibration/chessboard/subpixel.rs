//! A saddle to a pixel -> the crossing of its two edges, to hundredths.
//!
//! The squares around a corner are two crossing edges, each blurred by lens and shutter:
//! `I(d) = level + slope·d − A tanh(n₁·d / s) tanh(n₂·d / s)`, `d` from the corner, `n` the edges'
//! normals. Nine unknowns are fitted to the pixels of a disc that ends before the next corner. All
//! pixels along the edges count, the blur is measured with it, and uneven light is its own unknown.
//! How it compares with OpenCV's gradient search stands in [`super`].
//!
//! Limits: edges are straight within the disc, and blur is the same on both. A picture sharper than
//! its pixels (drawn, not taken: a lens blurs by half a pixel) whose edges run along rows and
//! columns does not tell where they are: 0.09 px RMS instead of 0.01 to 0.03.

use super::super::least_squares::{Normal, Patience, Problem, solution};
use super::super::picture::Picture;
use crate::world::camera::RawPixel;

/// The disc's radius in distances to the nearest corner, and when noise led it astray.
const RADII_PER_SIDE: [f64; 2] = [0.45, 0.3];

/// Larger discs meet bent edges, px; but they must hold the blur, this many sigmas.
const RADIUS_MAX_PX: f64 = 9.0;
const RADIUS_MAX_BLURS: f64 = 4.0;

/// Smaller discs hold too few pixels for nine unknowns.
const RADIUS_MIN_PX: f64 = 2.5;

/// Bright minus dark, brightness levels, below which noise moves the corner by half a pixel.
const CONTRAST_MIN: f64 = 6.0;

/// A tanh of scale 1 rises like a step blurred by this sigma.
const SIGMA_PER_SCALE: f64 = 0.8;

/// Blur of lens and shutter to begin with, as scale in px.
const SCALE_PX: f64 = 1.0;

/// What a pixel's own width adds to it: a box of 1 px has a sigma of 0.29 px. Without this floor
/// the edge of a picture sharper than its pixels could lie anywhere within one.
const PIXEL_SCALE: f64 = 0.36;

/// Where the picture is that sharp nothing tells how sharp; brightness levels for a scale of 1.
const SHARPNESS_PULL: f64 = 0.5;

/// A corner of squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Where the edges cross.
    pub at: RawPixel,
    /// Sigma of the blur across the edges.
    pub blur_px: f64,
}

/// x, y, both edges' angles, contrast, level, its slope along x and y, scale of the lens' blur.
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
        let [x, y, first, second, contrast, level, along_x, along_y, lens_scale] = *state;
        if !state.iter().all(|v| v.is_finite()) {
            return None;
        }
        let scale = lens_scale.hypot(PIXEL_SCALE);
        let mut normal = Normal::new(9);
        normal.add(SHARPNESS_PULL * lens_scale, &[(8, SHARPNESS_PULL)]);
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
                (8, -(by1 * across1 + by2 * across2) / scale * (lens_scale / scale)),
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

/// The corner at most `off_max_px` from `guess`, whose edges run about so and whose nearest
/// neighbour is `side_px` away; None if the pixels show none there.
#[must_use]
pub fn corner_near(
    picture: &Picture,
    guess: RawPixel,
    off_max_px: f64,
    edges_rad: [f64; 2],
    side_px: f64,
) -> Option<Corner> {
    let fitted = |radius_per_side: f64| {
        let side_px = radius_per_side * side_px;
        let mut radius_px = side_px.min(RADIUS_MAX_PX);
        let mut center = [guess.x_px, guess.y_px];
        let mut found = None;
        // The disc is laid anew around the first answer, so that its border does not pull.
        for _ in 0..2 {
            let disc = Disc { picture, center, radius_px: radius_px.max(RADIUS_MIN_PX) };
            let state = fitted_to(&disc, edges_rad)?;
            let off_px = (state[0] - guess.x_px).hypot(state[1] - guess.y_px);
            if off_px > off_max_px || state[4] < 0.5 * CONTRAST_MIN {
                return None;
            }
            center = [state[0], state[1]];
            let blur_px = SIGMA_PER_SCALE * state[8].hypot(PIXEL_SCALE);
            radius_px = side_px.min(f64::max(RADIUS_MAX_PX, RADIUS_MAX_BLURS * blur_px));
            found = Some(Corner { at: RawPixel { x_px: state[0], y_px: state[1] }, blur_px });
        }
        found
    };
    RADII_PER_SIDE.into_iter().find_map(fitted)
}

fn fitted_to(disc: &Disc<'_>, edges_rad: [f64; 2]) -> Option<Unknowns> {
    let lumas = || disc.pixels().map(|(_, _, luma)| luma);
    let (n, sum) = lumas().fold((0.0, 0.0), |(n, sum), luma| (n + 1.0, sum + luma));
    let (low, high) = lumas().fold((f64::MAX, f64::MIN), |(a, b), l| (a.min(l), b.max(l)));
    let contrast = 0.5 * (high - low);
    let ([x, y], [first, second]) = (disc.center, edges_rad);
    let start = [x, y, first, second, contrast, sum / n, 0.0, 0.0, SCALE_PX];
    Some(solution(disc, start, Patience { n_steps_max: 25, step_min: 0.05 })?.state)
}

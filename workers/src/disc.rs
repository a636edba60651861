//! Pixels → ball: where its middle is, with the variance, however it is lit.
//!
//! A centroid of what is bright follows the sun: it is off by a twentieth of the diameter and more.
//! What does not move with the light is the outline, so a lit sphere in front of the background is
//! fitted to all pixels around the spot, without any threshold:
//!
//! ```text
//!   I - μ ≈ K (L - μ),   L = shadow + max(0, sun · n),   K = S((R - r)/w + ½)
//! ```
//!
//! n is the sphere's normal, r the distance from its middle, K how much of the pixel it covers: S
//! is the smoothstep, w what pixel and lens blur. μ is each pixel's own background, so a ball half
//! in front of a white line is no less a ball. Motion during the exposure stretches the outline
//! along its streak, evenly to both sides, so the middle stays that of the middle of the exposure.
//!
//! Gauss-Newton, seven unknowns, on the sum of squares over the noise. Priors stand for what a
//! small ball cannot tell: light comes from above, more or less, and the radius is within 30 % of
//! what the spot looks like. The inverse of the normal matrix is the covariance, so a far ball that
//! might be lit from one side says so in its variance; where the model does not fit, the variance
//! grows by χ² per pixel.
//!
//! Cost: some 60 operations per pixel and iteration; 5-15 µs for a far ball.

use crate::dispatch::{Simd, Task};
use nalgebra::{Cholesky, SMatrix, SVector};

/// Blur of the outline: pixel and lens, and for near balls what their motion adds. Of 1.6, 1.9, 2.2
/// and 2.5 px the one with the smallest RMS over the scenes; with nothing per radius near balls
/// come out too small.
const EDGE_WIDTH_PX: f32 = 1.6;
const EDGE_PER_RADIUS: f32 = 0.05;

/// Pixels farther outside the outline than this are left out.
const MARGIN_PX: f32 = 2.5;

/// 1-sigma of the sun's and the shadow side's contrast, as a part of the spot's.
const LIGHT_SIGMA: f32 = 1.0;
/// What the fit begins with, as parts of the spot's contrast.
const SUN_FIRST: f32 = 0.5;
const SHADOW_FIRST: f32 = 0.4;
/// Light comes from above: the sun's upward part, and its 1-sigma (and that of the sideward part).
const SUN_UP: f32 = 0.4;
const SUN_SIGMA: f32 = 1.0;

/// 1-sigma of the radius: a part of it, and a constant.
const RADIUS_SIGMA: (f32, f32) = (0.3, 0.2);

/// No ball is seen smaller than this: the pixels' own width.
pub const RADIUS_MIN_PX: f32 = 1.2;

const N_ITERATIONS: usize = 8;

/// A fit that explains less than this after so many iterations is given up.
const HOPELESS: f32 = 0.4;
const HOPELESS_AFTER: usize = 2;

/// Of a disc wider than this many pixels every second, third … row and column is enough.
const PIXELS_ACROSS: f32 = 14.0;

/// What the fit begins with.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// Middle of the spot.
    pub center_px: [f32; 2],
    /// Half its width across the streak.
    pub radius_px: f32,
    /// Unit vector along the streak.
    pub streak: [f32; 2],
    /// Length over width, 1 for a ball at rest.
    pub stretch: f32,
    /// Grey levels above the background.
    pub contrast: f32,
    /// The background's grey level around the spot.
    pub background: f32,
    /// σ of a pixel, grey levels: a third of that of a sum of nine, so that it stands for noise
    /// that neighbours share.
    pub sigma: f32,
    /// By how much a pixel's own variance is smaller than that.
    pub likeness: f32,
}

/// A ball's image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Its middle.
    pub center_px: [f32; 2],
    /// Variances of the middle, and their covariance: xx, xy, yy.
    pub covariance_px2: [f32; 3],
    /// Half its width across the streak.
    pub radius_px: f32,
    /// Grey levels above the background, at its middle.
    pub contrast: f32,
    /// Which part of the squares beyond the noise the disc explains: 1 all.
    pub explained: f32,
    /// Twice the negative logarithm of how likely this is: the fit with the least is the best.
    pub cost: f32,
    /// As in [`Start`].
    pub stretch: f32,
}

/// Pixels that are worked on at once: arithmetic on arrays, which the compiler vectorises.
const LANES: usize = 8;
type Lanes = [f32; LANES];

/// Most pixels looked at: a window of 26 x 26 at the most after thinning out.
const MAX_PIXELS: usize = 768;

/// Some of the window's pixels; those that are not there weigh nothing.
#[derive(Debug, Clone, Copy)]
struct Pixels {
    x: Lanes,
    y: Lanes,
    seen: Lanes,
    background: Lanes,
    weight: Lanes,
}

impl Pixels {
    const NONE: Self = Self {
        x: [0.0; LANES],
        y: [0.0; LANES],
        seen: [0.0; LANES],
        background: [0.0; LANES],
        weight: [0.0; LANES],
    };

    fn set(&mut self, lane: usize, [x, y, seen, background]: [f32; 4]) {
        (self.x[lane], self.y[lane]) = (x, y);
        (self.seen[lane], self.background[lane]) = (seen, background);
        self.weight[lane] = 1.0;
    }
}

/// Unknowns: centre, radius, the shadow side's contrast, the sun (right, down, towards the camera).
const N: usize = 7;

#[derive(Debug, Clone, Copy)]
struct Model {
    start: Start,
    at: [f32; N],
}

impl Model {
    fn from_start(start: Start) -> Self {
        let Start { center_px: [x, y], radius_px, contrast, .. } = start;
        let sun = SUN_FIRST * contrast.abs();
        let level = start.background + contrast - sun;
        Self { start, at: [x, y, radius_px, level, 0.0, 0.0, sun] }
    }

    /// The difference that the ball makes at some pixels, and its derivatives.
    #[inline(always)]
    fn values(&self, pixels: &Pixels) -> (Lanes, [Lanes; N]) {
        let [cx, cy, radius, shadow, b, c, f] = self.at;
        let ([ex, ey], q) = (self.start.streak, self.start.stretch);
        let edge_px = EDGE_WIDTH_PX + EDGE_PER_RADIUS * self.start.radius_px;
        let mut values = [0.0; LANES];
        let mut by = [[0.0; LANES]; N];
        for i in 0..LANES {
            let (dx, dy) = (pixels.x[i] - cx, pixels.y[i] - cy);
            let (along, across) = ((dx * ex + dy * ey) / q, dy * ex - dx * ey);
            let r = (along * along + across * across).sqrt().max(1e-3);
            let t = ((radius - r) / edge_px + 0.5).clamp(0.0, 1.0);
            let cover = t * t * (3.0 - 2.0 * t);
            let slope = 6.0 * t * (1.0 - t) / edge_px;
            // The sphere's normal; beyond the outline, where blur shows it, that of the outline.
            let over = (r / radius).max(1.0);
            let (u, v) = (along / (radius * over), across / (radius * over));
            let w = (1.0 - u * u - v * v).max(0.0).sqrt();
            let sunlight = b * u + c * v + f * w;
            let is_lit = if sunlight > 0.0 { 1.0 } else { 0.0 };
            let light = shadow + is_lit * sunlight - pixels.background[i];
            // Moving the centre by one pixel right moves (along, across) by (-ex/q, ey), down by
            // (-ey/q, -ex). How w changes is left out: the fit still ends where it should, nearly.
            let inner = is_lit * cover / radius / over;
            let (of_along, of_across) =
                (inner * b - slope * light * along / r, inner * c - slope * light * across / r);
            values[i] = cover * light;
            by[0][i] = -of_along * ex / q + of_across * ey;
            by[1][i] = -of_along * ey / q - of_across * ex;
            by[2][i] = slope * light - inner * (b * u + c * v);
            by[3][i] = cover;
            by[4][i] = is_lit * cover * u;
            by[5][i] = is_lit * cover * v;
            by[6][i] = is_lit * cover * w;
        }
        (values, by)
    }

    /// What is known beforehand: value and inverse variance, which is 0 where nothing is.
    fn prior(&self) -> [(f32, f32); N] {
        let Start { radius_px, contrast, .. } = self.start;
        let radius_sigma = RADIUS_SIGMA.0 * radius_px + RADIUS_SIGMA.1;
        let light_sigma = LIGHT_SIGMA * contrast.abs();
        let known = |value: f32, sigma: f32| (value, 1.0 / (sigma * sigma));
        let none = (0.0, 0.0);
        let level = self.start.background + SHADOW_FIRST * contrast;
        let shadow = known(level, light_sigma);
        let sun = SUN_UP * contrast.abs();
        let [ex, ey] = self.start.streak;
        [
            none,
            none,
            known(radius_px, radius_sigma),
            shadow,
            known(-sun * ey, SUN_SIGMA * contrast.abs()),
            known(-sun * ex, SUN_SIGMA * contrast.abs()),
            known(0.0, light_sigma),
        ]
    }
}

/// The window's pixels, every `step`th.
#[derive(Debug, Clone, Copy)]
struct Window {
    x: (u32, u32),
    y: (u32, u32),
    step: u32,
}

impl Window {
    fn around(start: &Start, columns: (u32, u32), rows: (u32, u32)) -> Self {
        let Start { center_px: [x, y], radius_px, streak: [ex, ey], stretch, .. } = *start;
        let reach = radius_px * 1.3 + MARGIN_PX;
        let longer = radius_px * (stretch - 1.0);
        let range = |middle: f32, part: f32, (first, end): (u32, u32)| {
            let half = reach + longer * part.abs();
            let from = (middle - half).ceil().max(first as f32) as u32;
            let to = ((middle + half).floor().max(0.0) as u32 + 1).min(end);
            (from, to.max(from))
        };
        let step = (2.0 * radius_px / PIXELS_ACROSS) as u32 + 1;
        Self { x: range(x, ex, columns), y: range(y, ey, rows), step }
    }

    fn places(self) -> impl Iterator<Item = (u32, u32)> {
        let step = self.step as usize;
        let columns = self.x;
        (self.y.0..self.y.1)
            .step_by(step)
            .flat_map(move |y| (columns.0..columns.1).step_by(step).map(move |x| (x, y)))
    }
}

/// Sums over all pixels.
#[derive(Debug)]
struct Sums {
    normal: [[f32; N]; N],
    gradient: [f32; N],
    residual2: f32,
}

/// The sums of a model over pixels, in the machine's best instructions.
struct Summing<'a> {
    model: &'a Model,
    all: &'a [Pixels],
    sums: &'a mut Sums,
}

impl Task for Summing<'_> {
    #[inline(always)]
    fn run(self) {
        *self.sums = Sums::of(self.model, self.all);
    }
}

impl Sums {
    const ZERO: Self = Self { normal: [[0.0; N]; N], gradient: [0.0; N], residual2: 0.0 };

    #[inline(always)]
    fn of(model: &Model, all: &[Pixels]) -> Self {
        let mut normal = [[[0.0_f32; LANES]; N]; N];
        let mut gradient = [[0.0_f32; LANES]; N];
        let mut residual2 = [0.0_f32; LANES];
        for pixels in all {
            let (values, by) = model.values(pixels);
            for i in 0..LANES {
                let residual = pixels.weight[i] * (pixels.seen[i] - values[i]);
                residual2[i] += residual * residual;
                for row in 0..N {
                    let here = pixels.weight[i] * by[row][i];
                    gradient[row][i] += here * residual;
                    for column in 0..=row {
                        normal[row][column][i] += here * by[column][i];
                    }
                }
            }
        }
        let sum = |lanes: Lanes| lanes.iter().sum::<f32>();
        Self {
            normal: normal.map(|row| row.map(sum)),
            gradient: gradient.map(sum),
            residual2: sum(residual2),
        }
    }
}

/// Fits a ball to the pixels (difference, background) around a start, within these columns and rows
/// (first, end); `None` when there is no such ball near.
#[must_use]
pub fn fit(
    simd: Simd,
    pixel: impl Fn(u32, u32) -> (f32, f32),
    (columns, rows): ((u32, u32), (u32, u32)),
    start: Start,
) -> Option<Disc> {
    let window = Window::around(&start, columns, rows);
    let mut buffer = [Pixels::NONE; MAX_PIXELS / LANES];
    let mut n_px = 0;
    let mut total2 = 0.0;
    for (x, y) in window.places().take(MAX_PIXELS) {
        let (seen, background) = pixel(x, y);
        buffer[n_px / LANES].set(n_px % LANES, [x as f32, y as f32, seen, background]);
        total2 += seen * seen;
        n_px += 1;
    }
    let pixels = &buffer[..n_px.div_ceil(LANES)];
    let n_px = n_px as f32;
    let noise2 = n_px * start.sigma * start.sigma / start.likeness;
    let explained_by =
        |residual2: f32| 1.0 - (residual2 - noise2).max(0.0) / (total2 - noise2).max(noise2);
    // Of a thinned-out window each pixel stands for step² of them.
    let weight = (window.step * window.step) as f32 / (start.sigma * start.sigma);

    let mut model = Model::from_start(start);
    let prior = model.prior();
    let step_max = f64::from(0.5 * start.radius_px).max(0.5);
    let mut last = None;
    for iteration in 0..N_ITERATIONS {
        let mut sums = Sums::ZERO;
        simd.run(Summing { model: &model, all: pixels, sums: &mut sums });
        // The lower triangle is all that is read.
        let mut matrix = SMatrix::<f64, N, N>::zeros();
        let mut right = SVector::<f64, N>::zeros();
        for i in 0..N {
            let (value, strength) = prior[i];
            right[i] = f64::from(weight * sums.gradient[i] + strength * (value - model.at[i]));
            for j in 0..=i {
                matrix[(i, j)] = f64::from(weight * sums.normal[i][j]);
            }
            matrix[(i, i)] += f64::from(strength);
        }
        let root = Cholesky::new(matrix)?;
        let step = root.solve(&right);
        let longest = step.as_slice()[..3].iter().fold(0.0_f64, |most, s| most.max(s.abs()));
        let scale = if longest > step_max { step_max / longest } else { 1.0 };
        for (at, step) in model.at.iter_mut().zip(&step) {
            *at += (scale * step) as f32;
        }
        model.at[2] = model.at[2].max(RADIUS_MIN_PX);
        let explained = explained_by(sums.residual2);
        last = Some((root, sums.residual2));
        // What looks nothing like a ball by now will not: a limb, a branch.
        if iteration == HOPELESS_AFTER && explained < HOPELESS {
            return None;
        }
        if longest < 0.03 {
            break;
        }
    }
    let (root, residual2) = last?;
    let pulls =
        prior.iter().zip(model.at).map(|((value, strength), at)| strength * (at - value).powi(2));
    let misfit = (residual2 * weight / (n_px - N as f32).max(1.0)).max(1.0);
    let [x, y, radius_px, ..] = model.at;
    let contrast = model.at[3] + model.at[6].max(0.0) - start.background;
    let off = ((x - start.center_px[0]).powi(2) + (y - start.center_px[1]).powi(2)).sqrt();
    let is_near = off < start.radius_px * start.stretch + 1.0 && contrast * start.contrast > 0.0;
    let column = |k: usize| root.solve(&SVector::from_fn(|i, _| f64::from(u8::from(i == k))));
    let (of_x, of_y) = (column(0), column(1));
    let covariance_px2 = [of_x[0], of_x[1], of_y[1]].map(|value| value as f32 * misfit);
    is_near.then_some(Disc {
        center_px: [x, y],
        covariance_px2,
        radius_px,
        contrast,
        explained: explained_by(residual2),
        cost: residual2 * weight + pulls.sum::<f32>(),
        stretch: start.stretch,
    })
}

//! Pixels → ball: where its middle is, with the variance, however it is lit.
//!
//! A centroid of what is bright follows the sun: it is off by a twentieth of the diameter and more.
//! What does not move with the light is the outline, so a lit sphere in front of the background is
//! fitted to all pixels around the spot, without any threshold, in [`crate::light`]:
//!
//! ```text
//!   I - μ ≈ K (L - μ),   L = shadow + max(0, sun · n),   K = S((R - r)/w + ½)
//! ```
//!
//! n is the sphere's normal, r the distance from its middle, K how much of the pixel it covers: S
//! is the smoothstep, w what pixel and lens blur. μ is each pixel's own background, so a ball half
//! in front of a white line is no less a ball. A ball that moves during the exposure is the mean of
//! such balls along its way; its middle is that of the middle of the exposure.
//!
//! Gauss-Newton, seven unknowns or nine, on the sum of squares over the noise. Priors stand for
//! what a small ball cannot tell: light comes from above, more or less, and the radius is within
//! 20 % of what the spot looks like. The inverse of the normal matrix is the covariance, so a far
//! ball that might be lit from one side says so in its variance; where the model does not fit, the
//! variance grows by χ² per pixel.
//!
//! Cost: some 60 operations per pixel and iteration, for a streak for each of its instants as well;
//! 5-15 µs for a far ball.

mod model;
mod window;

use crate::dispatch::Simd;
use crate::light;
use model::{Model, N};
use nalgebra::{Cholesky, SMatrix, SVector};
use window::Window;

/// No ball is seen smaller than this: the pixels' own width.
pub const RADIUS_MIN_PX: f32 = 1.2;

/// Farthest that a ball moves during an exposure, in diameters.
pub const MOTION_MAX: f32 = 3.0;

const N_ITERATIONS: usize = 8;
/// A streak that is twice as long as it seemed takes so many.
const N_ITERATIONS_OF_STREAK: usize = 14;

/// A fit that explains less than this after so many iterations is given up.
const HOPELESS: f32 = 0.4;
const HOPELESS_AFTER: usize = 2;
/// A streak's light may be far off for longer.
const HOPELESS_AFTER_OF_STREAK: usize = 4;

/// What the fit begins with.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// Middle of the spot.
    pub center_px: [f32; 2],
    /// Half its width across the streak.
    pub radius_px: f32,
    /// How far it moves during the exposure: right and down, either way. Nothing for a ball that
    /// is taken to be at rest.
    pub motion_px: [f32; 2],
    /// Grey levels above the background.
    pub contrast: f32,
    /// The background's grey level around the spot.
    pub background: f32,
    /// Light of the shadow side and of the sun, where it is known.
    pub light: Option<[f32; 4]>,
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
    /// How far it moved during the exposure, either way.
    pub motion_px: [f32; 2],
    /// Grey levels above the background, at its middle.
    pub contrast: f32,
    /// Which part of the squares beyond the noise the disc explains: 1 all.
    pub explained: f32,
    /// Twice the negative logarithm of how likely this is: the fit with the least is the best.
    pub cost: f32,
    /// Light of the shadow side, and of the sun: right, down, towards the camera.
    pub light: [f32; 4],
}

/// Pixels that are worked on at once: arithmetic on arrays, which the compiler vectorises.
const LANES: usize = 8;
type Lanes = [f32; LANES];

/// Fits a ball to the pixels (difference, background) around a start, within these columns and rows
/// (first, end); `None` when there is no such ball near.
#[must_use]
pub fn fit(
    simd: Simd,
    pixel: impl Fn(u32, u32) -> (f32, f32),
    known: ((u32, u32), (u32, u32)),
    start: Start,
) -> Option<Disc> {
    let window = Window::around(&start, pixel, known);
    let noise2 = window.n_px * start.sigma * start.sigma / start.likeness;
    let explained_by =
        |residual2: f32| 1.0 - (residual2 - noise2).max(0.0) / (window.total2 - noise2).max(noise2);
    // Of a thinned-out window each pixel stands for step² of them.
    let weight = window.worth / (start.sigma * start.sigma);

    let mut model = Model::from_start(&start);
    let step_max = f64::from(0.5 * start.radius_px).max(0.5);
    let mut last = None;
    let (n_iterations, hopeless_after) = if start.motion_px == [0.0; 2] {
        (N_ITERATIONS, HOPELESS_AFTER)
    } else {
        (N_ITERATIONS_OF_STREAK, HOPELESS_AFTER_OF_STREAK)
    };
    for iteration in 0..n_iterations {
        let sums = model.sums(simd, window.pixels());
        // The lower triangle is all that is read.
        let mut matrix = SMatrix::<f64, N, N>::zeros();
        let mut right = SVector::<f64, N>::zeros();
        for i in 0..N {
            let (value, strength) = model.prior[i];
            right[i] = f64::from(weight * sums.gradient[i] + strength * (value - model.at[i]));
            for j in 0..=i {
                matrix[(i, j)] = f64::from(weight * sums.normal[i][j]);
            }
            matrix[(i, i)] += f64::from(strength);
        }
        let root = Cholesky::new(matrix)?;
        let step = root.solve(&right);
        let longest = model.step(step.as_slice(), step_max);
        let explained = explained_by(sums.residual2);
        last = Some((root, sums.residual2));
        // What looks nothing like a ball by now will not: a limb, a branch.
        if iteration == hopeless_after && explained < HOPELESS {
            return None;
        }
        if longest < 0.03 {
            break;
        }
    }
    let (root, residual2) = last?;
    let misfit = (residual2 * weight / (window.n_px - N as f32).max(1.0)).max(1.0);
    let [x, y, radius_px, shadow, b, c, f, mx, my] = model.at;
    let contrast = light::grey_from(shadow + f.max(0.0)) - start.background;
    let off = ((x - start.center_px[0]).powi(2) + (y - start.center_px[1]).powi(2)).sqrt();
    let longer = 0.5 * start.motion_px[0].hypot(start.motion_px[1]);
    let is_near = off < start.radius_px + longer + 1.0 && contrast * start.contrast > 0.0;
    let column = |k: usize| root.solve(&SVector::from_fn(|i, _| f64::from(u8::from(i == k))));
    let (of_x, of_y) = (column(0), column(1));
    let covariance_px2 = [of_x[0], of_x[1], of_y[1]].map(|value| value as f32 * misfit);
    is_near.then_some(Disc {
        center_px: [x, y],
        covariance_px2,
        radius_px,
        motion_px: [mx, my],
        contrast,
        explained: explained_by(residual2),
        cost: residual2 * weight + model.pulls(),
        light: [shadow, b, c, f],
    })
}

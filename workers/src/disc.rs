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
//! Gauss-Newton, seven unknowns or nine, on the sum of squares over the noise, as long as the next
//! step promises to explain enough of it. Priors stand for what a small ball cannot tell: light
//! comes from above, more or less, and the radius is within 20 % of what the spot looks like. The
//! inverse of the normal matrix is the covariance, so a far ball that might be lit from one side
//! says so in its variance; where the model does not fit, the variance grows by χ² per pixel.
//!
//! Cost: some 60 operations per pixel and iteration, for a streak for each of its instants as well.
//! Of 75 fits to noise in a frame (`cargo bench -p workers`) each takes 1.3 µs: most end after one
//! or two steps.

mod model;
mod window;

use crate::dispatch::Simd;
use crate::light;
use model::{Model, N, N_STILL, Sums};
use nalgebra::{Cholesky, Const, SMatrix, SVector};
use std::ops::Range;
use window::Window;

/// No ball is seen smaller than this: the pixels' own width.
pub const RADIUS_MIN_PX: f32 = 1.2;

/// Farthest that a ball moves during an exposure, in diameters.
pub const MOTION_MAX: f32 = 3.0;

/// A fit is done when neither place nor radius moves by more.
const STEP_MIN_PX: f64 = 0.03;

const N_ITERATIONS: usize = 8;
/// A streak that is twice as long as it seemed takes so many.
const N_ITERATIONS_OF_STREAK: usize = 14;

/// A fit is given up when, after so many iterations, its next step promises to explain less: a
/// limb, a branch, noise.
const PROMISED_MIN: [f32; 4] = [0.3, 0.4, 0.5, 0.6];
const PROMISED_MIN_OF_STREAK: [f32; 5] = [0.45, 0.55, 0.65, 0.7, 0.8];

/// What balls are fitted to.
pub trait Picture {
    /// The instructions to use.
    fn simd(&self) -> Simd;

    /// The columns and rows whose pixels are known.
    fn known(&self) -> (Range<u32>, Range<u32>);

    /// How much pixels of a known row differ from their background, and that, grey levels.
    fn row(&self, y: u32, columns: Range<u32>) -> impl Iterator<Item = (f32, f32)>;

    /// How much larger σ² of a sum of nine pixels is than nine σ² of one.
    fn likeness(&self) -> f32;
}

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
    /// The same of the pixels that it covers, whatever is around it.
    pub explained_within: f32,
    /// Twice the negative logarithm of how likely this is: the fit with the least is the best.
    pub cost: f32,
    /// Light of the shadow side, and of the sun: right, down, towards the camera.
    pub light: [f32; 4],
}

/// Pixels that are worked on at once: arithmetic on arrays, which the compiler vectorises.
const LANES: usize = 16;
type Lanes = [f32; LANES];

/// Fits a ball to the pixels around a start; `None` when there is no such ball near.
#[must_use]
pub fn fit(picture: &impl Picture, start: Start) -> Option<Disc> {
    let window = Window::around(&start, picture);
    let simd = picture.simd();
    let mut model = Model::from_start(&start);
    let is_still = start.motion_px == [0.0; 2];
    let (sums, of_center) = if is_still {
        settle::<N_STILL>(simd, &mut model, &window, &start, N_ITERATIONS, &PROMISED_MIN)
    } else {
        let (most, promised_min) = (N_ITERATIONS_OF_STREAK, &PROMISED_MIN_OF_STREAK);
        settle::<N>(simd, &mut model, &window, &start, most, promised_min)
    }?;
    let n_unknowns = if is_still { N_STILL } else { N };
    let weight = window.weight(&start);
    let misfit = (sums.residual2 * weight / (window.n_px - n_unknowns as f32).max(1.0)).max(1.0);
    let [x, y, radius_px, shadow, b, c, f, mx, my] = model.at;
    let contrast = light::grey_from(shadow + f.max(0.0)) - start.background;
    let off = ((x - start.center_px[0]).powi(2) + (y - start.center_px[1]).powi(2)).sqrt();
    let longer = 0.5 * start.motion_px[0].hypot(start.motion_px[1]);
    let is_near = off < start.radius_px + longer + 1.0 && contrast * start.contrast > 0.0;
    is_near.then_some(Disc {
        center_px: [x, y],
        covariance_px2: of_center.map(|value| value as f32 * misfit),
        radius_px,
        motion_px: [mx, my],
        contrast,
        explained_within: window.explained_of(sums.covered, &start),
        explained: window.explained(sums.residual2, &start),
        cost: sums.residual2 * weight + model.pulls(),
        light: [shadow, b, c, f],
    })
}

/// Which part of the squares beyond the noise the first step of a moving ball's fit promises to
/// explain.
#[must_use]
pub fn promise(picture: &impl Picture, start: &Start) -> f32 {
    let window = Window::around(start, picture);
    let model = Model::from_start(start);
    let step = Step::<N>::of(&model, &window, start, picture.simd());
    step.map_or(f32::NEG_INFINITY, |step| window.explained(step.promised2, start))
}

/// A step of Gauss-Newton with the first M unknowns.
struct Step<const M: usize> {
    root: Cholesky<f64, Const<M>>,
    step: SVector<f64, M>,
    /// Before it.
    sums: Sums,
    /// Squares left after it, as much as the linear model says.
    promised2: f32,
}

impl<const M: usize> Step<M> {
    fn of(model: &Model, window: &Window, start: &Start, simd: Simd) -> Option<Self> {
        let weight = window.weight(start);
        let sums = model.sums(simd, window.pixels());
        // The lower triangle is all that is read.
        let mut matrix = SMatrix::<f64, M, M>::zeros();
        let mut right = SVector::<f64, M>::zeros();
        for i in 0..M {
            let (value, strength) = model.prior[i];
            right[i] = f64::from(weight * sums.gradient[i] + strength * (value - model.at[i]));
            for j in 0..=i {
                matrix[(i, j)] = f64::from(weight * sums.normal[i][j]);
            }
            matrix[(i, i)] += f64::from(strength);
        }
        let root = Cholesky::new(matrix)?;
        let step = root.solve(&right);
        let promised2 = sums.residual2 - step.dot(&right) as f32 / weight;
        Some(Self { root, step, sums, promised2 })
    }
}

/// Gauss-Newton with the first M unknowns: the sums at its end, and the middle's variances xx,
/// xy, yy if the model fits.
fn settle<const M: usize>(
    simd: Simd,
    model: &mut Model,
    window: &Window,
    start: &Start,
    n_iterations: usize,
    promised_min: &[f32],
) -> Option<(Sums, [f64; 3])> {
    let step_max = f64::from(0.5 * start.radius_px).max(0.5);
    let mut last = None;
    for iteration in 0..n_iterations {
        let next = Step::<M>::of(model, window, start, simd)?;
        let least = promised_min[iteration.min(promised_min.len() - 1)];
        if window.explained(next.promised2, start) < least {
            return None;
        }
        let longest = model.step(next.step.as_slice(), step_max);
        last = Some(next);
        if longest < STEP_MIN_PX {
            break;
        }
    }
    let Step { root, sums, .. } = last?;
    let column = |k: usize| root.solve(&SVector::from_fn(|i, _| f64::from(u8::from(i == k))));
    let (of_x, of_y) = (column(0), column(1));
    Some((sums, [of_x[0], of_x[1], of_y[1]]))
}

//! Unknowns → the light that a ball adds to each pixel, with its derivatives.

use super::window::Pixels;
use super::{LANES, Lanes, MOTION_MAX, RADIUS_MIN_PX, Start};
use crate::dispatch::Task;
use crate::light;

/// Unknowns of a ball at rest: centre, radius, the shadow side's light, the sun (right, down,
/// towards the camera); of one that moves also how far it does during the exposure.
pub const N_STILL: usize = 7;
pub const N: usize = 9;
/// The shadow side's: its derivative is how much of a pixel the ball covers.
const COVER: usize = 3;

/// Blur of the outline, pixel and lens: a pixel that looks one pixel around itself sees an edge as
/// a smoothstep of this width, √(20/6), less so much over the radius squared: the outline of a far
/// ball is bent within a pixel. Of 0, 0.7 and 1 the one with the smallest RMS below 4 px.
const EDGE_WIDTH_PX: f32 = 1.83;
const EDGE_BENT_PX3: f32 = 1.0;
const EDGE_WIDTH_MIN_PX: f32 = 1.0;

/// A streak is looked at in an instant for every so many pixels, and
const INSTANT_PX: f32 = 1.5;
/// in so many at the most.
const INSTANTS_MAX: f32 = 8.0;

/// 1-sigma of the light towards the camera and of the shadow side's, as a part of the spot's. Of
/// 0.6 and 1 the better one below 3 px.
const LIGHT_SIGMA: f32 = 0.6;
/// What the fit begins with, as parts of the spot's contrast.
const SUN_FIRST: f32 = 0.5;
const SHADOW_FIRST: f32 = 0.4;
/// Light comes from above: the sun's upward part, and its 1-sigma (and that of the sideward part).
const SUN_UP: f32 = 0.4;
const SUN_SIGMA: f32 = 1.0;

/// 1-sigma of the radius: a part of it, and a constant.
const RADIUS_SIGMA: (f32, f32) = (0.2, 0.2);

/// 1-sigma of the motion: a part of it, and a constant.
const MOTION_SIGMA: (f32, f32) = (0.5, 1.0);

/// Near the outline the normal turns beyond all bounds; it is taken to turn no faster than here.
const NORMAL_MIN: f32 = 0.3;

/// A ball of light.
#[derive(Debug, Clone, Copy)]
pub struct Model {
    /// The unknowns.
    pub at: [f32; N],
    /// Value and inverse variance of what is known beforehand; 0 where nothing is.
    pub prior: [(f32, f32); N],
    moves: bool,
}

impl Model {
    /// The spot's contrast, in light.
    pub fn contrast_of(start: &Start) -> f32 {
        light::from_grey(start.background + start.contrast) - light::from_grey(start.background)
    }

    /// What the fit begins with.
    pub fn from_start(start: &Start) -> Self {
        let Start { center_px: [x, y], radius_px, motion_px: [mx, my], .. } = *start;
        let (behind, contrast) = (light::from_grey(start.background), Self::contrast_of(start));
        let moves = mx != 0.0 || my != 0.0;
        let [level, b, c, f] = start.light.unwrap_or_else(|| {
            let sun = SUN_FIRST * contrast.abs();
            [behind + contrast - sun, 0.0, 0.0, sun]
        });
        let known = |value: f32, sigma: f32| (value, 1.0 / (sigma * sigma));
        let none = (0.0, 0.0);
        let light_sigma = LIGHT_SIGMA * contrast.abs();
        let sun_sigma = SUN_SIGMA * contrast.abs();
        let motion_sigma = MOTION_SIGMA.0 * mx.hypot(my) + MOTION_SIGMA.1;
        let moved = |value: f32| if moves { known(value, motion_sigma) } else { (0.0, 1.0) };
        let prior = [
            none,
            none,
            known(radius_px, RADIUS_SIGMA.0 * radius_px + RADIUS_SIGMA.1),
            known(behind + SHADOW_FIRST * contrast, light_sigma),
            known(0.0, sun_sigma),
            known(-SUN_UP * contrast.abs(), sun_sigma),
            known(0.0, light_sigma),
            moved(mx),
            moved(my),
        ];
        Self { at: [x, y, radius_px, level, b, c, f, mx, my], prior, moves }
    }

    /// Goes a step, at most so far in place and radius; how far the step would have been.
    pub fn step(&mut self, step: &[f64], step_max: f64) -> f64 {
        let longest = step[..3].iter().fold(0.0_f64, |most, s| most.max(s.abs()));
        let scale = if longest > step_max { step_max / longest } else { 1.0 };
        for (at, step) in self.at.iter_mut().zip(step) {
            *at += (scale * step) as f32;
        }
        self.at[2] = self.at[2].max(RADIUS_MIN_PX);
        let length = self.at[7].hypot(self.at[8]);
        let most = MOTION_MAX * 2.0 * self.at[2];
        if length > most {
            self.at[7] *= most / length;
            self.at[8] *= most / length;
        }
        longest
    }

    /// Twice the negative logarithm of how likely this is beforehand.
    pub fn pulls(&self) -> f32 {
        let pull = |((value, strength), at): (&(f32, f32), f32)| strength * (at - value).powi(2);
        self.prior.iter().zip(self.at).map(pull).sum()
    }

    /// The sums over all pixels, in the machine's best instructions.
    pub fn sums(&self, simd: crate::dispatch::Simd, pixels: &[Pixels]) -> Sums {
        let mut sums = Sums::ZERO;
        simd.run(Summing { model: self, pixels, sums: &mut sums });
        sums
    }

    fn n_instants(&self) -> usize {
        let length = self.at[7].hypot(self.at[8]);
        if self.moves { (2.0 + length / INSTANT_PX).min(INSTANTS_MAX) as usize } else { 1 }
    }

    /// The light that a ball at a place adds, and its derivatives by the first unknowns.
    #[inline(always)]
    fn values_at(&self, [cx, cy]: [f32; 2], pixels: &Pixels) -> (Lanes, [Lanes; N_STILL]) {
        let [_, _, radius, shadow, b, c, f, ..] = self.at;
        let edge_px = (EDGE_WIDTH_PX - EDGE_BENT_PX3 / (radius * radius)).max(EDGE_WIDTH_MIN_PX);
        let (by_radius, by_edge) = (1.0 / radius, 1.0 / edge_px);
        let mut values = [0.0; LANES];
        let mut by = [[0.0; LANES]; N_STILL];
        for i in 0..LANES {
            let (dx, dy) = (pixels.x[i] - cx, pixels.y[i] - cy);
            let r2 = (dx * dx + dy * dy).max(1e-6);
            let r = r2.sqrt();
            let by_r = 1.0 / r;
            let t = ((radius - r) * by_edge + 0.5).clamp(0.0, 1.0);
            let cover = t * t * (3.0 - 2.0 * t);
            let slope = 6.0 * t * (1.0 - t) * by_edge;
            // The sphere's normal; beyond the outline, where blur shows it, that of the outline.
            let scale = by_r.min(by_radius);
            let (u, v) = (dx * scale, dy * scale);
            let w = (1.0 - u * u - v * v).max(0.0).sqrt();
            let sunlight = b * u + c * v + f * w;
            let is_lit = if sunlight > 0.0 { 1.0 } else { 0.0 };
            let light = shadow + is_lit * sunlight - pixels.background[i];
            let inner = is_lit * cover * scale;
            let turning = if r < radius { f / w.max(NORMAL_MIN) } else { 0.0 };
            let edge = slope * light * by_r;
            values[i] = cover * light;
            by[0][i] = edge * dx - inner * (b - turning * u);
            by[1][i] = edge * dy - inner * (c - turning * v);
            by[2][i] = slope * light - inner * (b * u + c * v - turning * (u * u + v * v));
            by[COVER][i] = cover;
            by[4][i] = is_lit * cover * u;
            by[5][i] = is_lit * cover * v;
            by[6][i] = is_lit * cover * w;
        }
        (values, by)
    }
}

/// Sums over all pixels: the lower triangle of the normal matrix, the gradient, the squares left.
#[derive(Debug)]
pub struct Sums {
    pub normal: [[f32; N]; N],
    pub gradient: [f32; N],
    pub residual2: f32,
    /// Of the pixels that the ball covers, at least in part: their number, their squares, and what
    /// is left of those.
    pub covered: [f32; 3],
}

struct Summing<'a> {
    model: &'a Model,
    pixels: &'a [Pixels],
    sums: &'a mut Sums,
}

impl Task for Summing<'_> {
    #[inline(always)]
    fn run(self) {
        if self.model.moves {
            self.sums.of_moving(self.model, self.pixels);
        } else {
            self.sums.of_still(self.model, self.pixels);
        }
    }
}

/// Sums lane by lane.
struct Sum<const M: usize> {
    normal: [[Lanes; M]; M],
    gradient: [Lanes; M],
    residual2: Lanes,
    covered: [Lanes; 3],
}

impl<const M: usize> Sum<M> {
    const ZERO: Self = Self {
        normal: [[[0.0; LANES]; M]; M],
        gradient: [[0.0; LANES]; M],
        residual2: [0.0; LANES],
        covered: [[0.0; LANES]; 3],
    };

    #[inline(always)]
    fn add(&mut self, pixels: &Pixels, values: &Lanes, by: &[Lanes; M]) {
        for i in 0..LANES {
            let residual = pixels.weight[i] * (pixels.seen[i] - values[i]);
            self.residual2[i] += residual * residual;
            let is_covered = if by[COVER][i] * pixels.weight[i] > 0.0 { 1.0 } else { 0.0 };
            let seen = pixels.weight[i] * pixels.seen[i];
            self.covered[0][i] += is_covered;
            self.covered[1][i] += is_covered * (seen * seen);
            self.covered[2][i] += is_covered * (residual * residual);
            for row in 0..M {
                let here = pixels.weight[i] * by[row][i];
                self.gradient[row][i] += here * residual;
                for (sum, by) in self.normal[row][..=row].iter_mut().zip(by) {
                    sum[i] += here * (pixels.weight[i] * by[i]);
                }
            }
        }
    }

    #[inline(always)]
    fn end(&self, into: &mut Sums) {
        for row in 0..M {
            into.gradient[row] = sum_of(self.gradient[row]);
            for column in 0..=row {
                into.normal[row][column] = sum_of(self.normal[row][column]);
            }
        }
        into.residual2 = sum_of(self.residual2);
        into.covered = self.covered.map(sum_of);
    }
}

/// Half to half: one order for every machine, and a few steps in place of fifteen.
#[inline(always)]
pub fn sum_of(mut lanes: Lanes) -> f32 {
    let mut n = LANES;
    while n > 1 {
        n /= 2;
        for i in 0..n {
            lanes[i] += lanes[i + n];
        }
    }
    lanes[0]
}

impl Sums {
    const ZERO: Self =
        Self { normal: [[0.0; N]; N], gradient: [0.0; N], residual2: 0.0, covered: [0.0; 3] };

    #[inline(always)]
    fn of_still(&mut self, model: &Model, all: &[Pixels]) {
        let mut sum = Sum::<N_STILL>::ZERO;
        let center_px = [model.at[0], model.at[1]];
        for pixels in all {
            let (values, by) = model.values_at(center_px, pixels);
            sum.add(pixels, &values, &by);
        }
        sum.end(self);
    }

    /// The exposure is looked at in some instants, evenly spread around its middle.
    #[inline(always)]
    fn of_moving(&mut self, model: &Model, all: &[Pixels]) {
        let mut sum = Sum::<N>::ZERO;
        let n = model.n_instants();
        let share = 1.0 / n as f32;
        let [x, y, .., mx, my] = model.at;
        for pixels in all {
            let mut values = [0.0; LANES];
            let mut by = [[0.0; LANES]; N];
            for k in 0..n {
                let at = (k as f32 + 0.5) * share - 0.5;
                let (value, of) = model.values_at([x + at * mx, y + at * my], pixels);
                for i in 0..LANES {
                    values[i] += share * value[i];
                    for unknown in 0..N_STILL {
                        by[unknown][i] += share * of[unknown][i];
                    }
                    by[7][i] += share * at * of[0][i];
                    by[8][i] += share * at * of[1][i];
                }
            }
            sum.add(pixels, &values, &by);
        }
        sum.end(self);
    }
}

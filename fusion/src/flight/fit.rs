//! Sightings -> the most likely unknowns, with covariance.
//!
//! Maximum likelihood on raw pixels. Every sighting of either camera is compared at its own time
//! (stamp of its row, less the clocks' difference for the right camera) with the projection of the
//! ball at that time; nothing is triangulated and nothing is paired. Levenberg-Marquardt with exact
//! derivatives; the 17 normal equations are solved by faer's Cholesky.
//!
//! **Robust**: noise is Student's t ([`noise`]), so that a sighting pulls the less the farther off
//! it is. What is farther off than a gate was never handed in ([`crate::path`]).
//!
//! **What no residual shows**: light pulls the centres of a ball in all frames and both cameras
//! alike, and differently far away than near. Such biases are considered, not estimated (Schmidt):
//! the answer's response to each of [`BIASES`] at 1 sigma is added to the covariance. So is its
//! response to the rig's own doubt, where the rig has one.

use crate::flight::fitted::{Fitted, Scene, slope_and_off, time_s};
use crate::flight::model::{Model, Span};
use crate::flight::noise::{self, AXES, N_NOISE_MIN, Scatter};
use crate::flight::unknowns::{Column, Covariance, GROUND, N, Prior, Unknowns};
use crate::motion::seconds_between;
use crate::rectified::Sighting;
use crate::solved::{self, solved};
use crate::world::adjustment::{CAMERA, RIG, first_of};
use nalgebra::{Matrix2, SMatrix, Vector2};
use shm_layout::StampNs;

/// Most steps of one fit; five to eight are usual.
const N_STEPS_MAX: usize = 25;

/// A step this small, in sigmas, ends a fit, and a rough one.
const STEP_MIN: f64 = 0.01;
const ROUGH_STEP_MIN: f64 = 0.2;

/// Damping to begin with, its factors after a good and a bad step, and where to give up.
const DAMPING: [f64; 4] = [1e-10, 0.1, 100.0, 1e6];

/// Least part of the residuals that is taken to be free.
pub(super) const FREE_MIN: f64 = 0.3;

/// How far on either side of the sightings a flight is followed.
const MARGIN_S: f64 = 0.05;

/// 1 sigma of where the machine lets go of the ball: "known to a few centimetres".
pub const LAUNCHER_SIGMA_M: f64 = 0.025;

/// Ways in which all centres may be off together: x and y alike, x and y from one way near to
/// the other way far, and y one way at both ends and the other way between.
pub const BIASES: [fn(f64) -> [f64; 2]; 5] = [
    |_| [1.0, 0.0],
    |_| [0.0, 1.0],
    |far| [far, 0.0],
    |far| [0.0, far],
    |far| [0.0, 2.0 * far * far - 1.0],
];

/// Fits a flight to sightings in order of time; None if the equations have no solution.
#[must_use]
pub fn from_sightings(
    sightings: &[Sighting],
    reference_ns: StampNs,
    start: (&Unknowns, [f64; 2]),
    prior: &Prior,
    scene: &Scene,
) -> Option<Fitted> {
    let (start, noise) = start;
    let mut fit = Fit { sightings, reference_ns, prior, scene, noise, spread: 1.0 };
    let mut unknowns = fit.minimised(*start, ROUGH_STEP_MIN)?;
    if sightings.len() >= N_NOISE_MIN {
        (fit.noise, fit.spread) = fit.noise_and_spread(&unknowns)?;
        unknowns = fit.minimised(unknowns, STEP_MIN)?;
    }
    fit.fitted(unknowns)
}

/// The same for finding more sightings: the noise is taken as it was found before.
#[must_use]
pub fn roughly(
    sightings: &[Sighting],
    reference_ns: StampNs,
    (start, noise): (&Unknowns, [f64; 2]),
    prior: &Prior,
    scene: &Scene,
) -> Option<Fitted> {
    let fit = Fit { sightings, reference_ns, prior, scene, noise, spread: 1.0 };
    let unknowns = fit.minimised(*start, ROUGH_STEP_MIN)?;
    fit.fitted(unknowns)
}

/// The covariance no unbiased estimator is better than (Cramér-Rao, with what is known
/// beforehand): that of the fit if `truth` is what happened and the sightings' sigmas are right.
#[must_use]
pub fn bound(
    sightings: &[Sighting],
    reference_ns: StampNs,
    truth: &Unknowns,
    prior: &Prior,
    scene: &Scene,
) -> Option<Fitted> {
    let noise = [1.0; 2];
    let fit = Fit { sightings, reference_ns, prior, scene, noise, spread: 1.0 };
    let mut normal = prior.information;
    let model = fit.model(truth, scene.reach_s);
    for sighting in sightings {
        let time_s = time_s(sighting, reference_ns, truth);
        if let Some((slope, _)) = slope_and_off(sighting, time_s, &model, scene.rig) {
            normal += slope.transpose() * sighting.total_px2(1.0).try_inverse()? * slope;
        }
    }
    if let Some((slope, _)) = fit.launcher(&model) {
        normal += slope.transpose() * slope;
    }
    let covariance = inverse(&normal)?;
    Some(Fitted { reference_ns, unknowns: *truth, covariance, model, noise: [1.0; 2] })
}

pub(super) struct Fit<'a> {
    pub(super) sightings: &'a [Sighting],
    pub(super) reference_ns: StampNs,
    pub(super) prior: &'a Prior,
    pub(super) scene: &'a Scene<'a>,
    pub(super) noise: [f64; 2],
    /// Variance of what the sightings say, as a multiple of that of independent Gaussian noise.
    pub(super) spread: f64,
}

/// Normal equations at some unknowns.
pub(super) struct System {
    pub(super) normal: Covariance,
    gradient: Column,
    pub(super) cost: f64,
}

/// How sure unknowns are that were found, as sums over the sightings.
struct Surety {
    /// What is known without sightings.
    known: Covariance,
    /// What they say if all are trusted alike.
    pixels: Covariance,
    /// How much wider than that the answer scatters.
    spread: f64,
    /// What each of [`BIASES`] adds to the gradient.
    pulls: [Column; BIASES.len()],
    /// What each of the rig's numbers adds to it; None if the rig is beyond doubt.
    rig_pull: Option<SMatrix<f64, N, RIG>>,
}

impl Fit<'_> {
    /// With the covariance there, and followed as far as the scene wants.
    fn fitted(self, unknowns: Unknowns) -> Option<Fitted> {
        let model = self.model(&unknowns, self.scene.reach_s);
        let Surety { known, pixels, spread, pulls, rig_pull } = self.surety(&unknowns, &model)?;
        let pixels = pixels / spread;
        let covariance_of_fit = inverse(&(known + pixels))?;
        // What the unknowns took up is missing from the residuals that told the spread.
        let n_taken = (covariance_of_fit * pixels).trace();
        let n_residuals = AXES * self.sightings.len() as f64;
        let free = (1.0 - n_taken / n_residuals).max(FREE_MIN);
        let mut covariance = inverse(&(known + pixels * free))?;
        for pull in pulls {
            let off = covariance_of_fit * pull;
            covariance += off * off.transpose();
        }
        if let (Some(pull), Some(doubt)) = (rig_pull, self.scene.rig.covariance()) {
            // The calibration's own doubt is considered as the biases are.
            let response = covariance_of_fit * pull;
            covariance += response * doubt * response.transpose();
        }
        let Fit { reference_ns, noise, .. } = self;
        Some(Fitted { reference_ns, unknowns, covariance, model, noise })
    }

    fn surety(&self, unknowns: &Unknowns, model: &Model) -> Option<Surety> {
        let rig = self.scene.rig;
        let mut known = self.prior.information;
        if let Some((slope, _)) = self.launcher(model) {
            known += slope.transpose() * slope;
        }
        let mut pixels = Covariance::zeros();
        let mut scatter = Scatter::default();
        let mut pulls = [Column::zeros(); BIASES.len()];
        let mut rig_pull = rig.covariance().map(|_| SMatrix::<f64, N, RIG>::zeros());
        let last = self.sightings.len() as f64 - 1.0;
        for (i, sighting) in self.sightings.iter().enumerate() {
            let time_s = time_s(sighting, self.reference_ns, unknowns);
            let (slope, off) = slope_and_off(sighting, time_s, model, rig)?;
            let white = self.whitening(sighting)?;
            let (slope, off) = (white * slope, white * off);
            add_outer(&mut pixels, &slope, 1.0, n_columns(model, time_s));
            if sighting.hidden_px2 == 0.0 {
                scatter.update(sighting.camera, &off, noise::weight(off.norm_squared()));
            }
            let far = 2.0 * i as f64 / last - 1.0;
            if self.scene.bias_sigma_px > 0.0 {
                for (pull, bias) in pulls.iter_mut().zip(BIASES) {
                    let off = white * Vector2::from(bias(far)) * self.scene.bias_sigma_px;
                    *pull += slope.transpose() * off;
                }
            }
            if let Some(pull) = &mut rig_pull {
                let (camera, position_m) = (sighting.camera, model.place_at(time_s).position_m);
                let (_, by_rig) = rig.raw_and_slope_by_camera(camera, &position_m)?;
                let mut part = pull.fixed_columns_mut::<CAMERA>(first_of(camera));
                part += slope.transpose() * (white * by_rig);
            }
        }
        pixels.fill_lower_triangle_with_upper_triangle();
        let spread = scatter.spread();
        let pulls = pulls.map(|pull| pull / spread);
        let rig_pull = rig_pull.map(|pull| pull / spread);
        Some(Surety { known, pixels, spread, pulls, rig_pull })
    }

    pub(super) fn minimised(&self, start: Unknowns, step_min: f64) -> Option<Unknowns> {
        let [mut damping, better, worse, damping_max] = DAMPING;
        let mut unknowns = start;
        let mut system = self.system(&unknowns)?;
        for _ in 0..N_STEPS_MAX {
            let mut damped = system.normal;
            for i in 0..N {
                damped[(i, i)] *= 1.0 + damping;
            }
            let step = -Column::from_vec(solved(&damped, system.gradient.as_slice())?);
            let next = unknowns.plus(&step);
            match self.system(&next).filter(|next| next.cost <= system.cost) {
                Some(next_system) => {
                    let size = step.dot(&(system.normal * step)).max(0.0).sqrt();
                    (unknowns, system) = (next, next_system);
                    damping *= better;
                    if size < step_min {
                        break;
                    }
                }
                None => damping *= worse,
            }
            if damping > damping_max {
                break;
            }
        }
        Some(unknowns)
    }

    /// None if the ball is behind a camera that saw it, or a number is not finite.
    pub(super) fn system(&self, unknowns: &Unknowns) -> Option<System> {
        let model = self.model_to_launcher(unknowns);
        let off_mean = unknowns.less(&self.prior.mean);
        let mut known = self.prior.information;
        let mut gradient = self.prior.information * off_mean;
        let mut cost = self.prior.cost(unknowns);
        if let Some((slope, off)) = self.launcher(&model) {
            known += slope.transpose() * slope;
            gradient += slope.transpose() * off;
            cost += 0.5 * off.norm_squared();
        }
        let mut trusted = Covariance::zeros();
        let mut scatter = Scatter::default();
        for sighting in self.sightings {
            let time_s = time_s(sighting, self.reference_ns, unknowns);
            let (slope, off) = slope_and_off(sighting, time_s, &model, self.scene.rig)?;
            let white = self.whitening(sighting)?;
            let (slope, off) = (white * slope, white * off);
            let square = off.norm_squared();
            let weight = noise::weight(square);
            let trust = 1.0 / self.spread;
            cost += trust * noise::cost(square);
            add_outer(&mut trusted, &slope, weight * trust, n_columns(&model, time_s));
            gradient += slope.transpose() * off * (weight * trust);
            if sighting.hidden_px2 == 0.0 {
                scatter.update(sighting.camera, &off, weight);
            }
        }
        // Weights that fall with distance make the true curvature less: without this each step
        // leaves a third of the way, with it a tenth.
        trusted.fill_lower_triangle_with_upper_triangle();
        let normal = known + trusted * scatter.curvature();
        cost.is_finite().then_some(System { normal, gradient, cost })
    }

    /// Followed back to the launcher if it is known to come from there.
    pub(super) fn model_to_launcher(&self, unknowns: &Unknowns) -> Model {
        let before_s = if self.scene.launcher_m.is_some() { self.scene.reach_s[0] } else { 0.0 };
        self.model(unknowns, [before_s, 0.0])
    }

    fn model(&self, unknowns: &Unknowns, [before_s, after_s]: [f64; 2]) -> Model {
        let time_of = |sighting: Option<&Sighting>| {
            sighting.map_or(0.0, |s| seconds_between(self.reference_ns, s.t_ns))
        };
        let span = Span {
            from_s: (time_of(self.sightings.first()) - MARGIN_S - before_s).min(0.0),
            to_s: (time_of(self.sightings.last()) + MARGIN_S + after_s).max(0.0),
            has_bounce: self.scene.has_bounce,
        };
        Model::new(unknowns, self.scene.physics, &span)
    }

    /// How far from the launcher the ball passes its plane, x and z, in sigmas.
    pub(super) fn launcher(&self, model: &Model) -> Option<(SMatrix<f64, 2, N>, Vector2<f64>)> {
        let launcher = self.scene.launcher_m?;
        let first_s = seconds_between(self.reference_ns, self.sightings.first()?.t_ns);
        let there = model.passing(1, launcher.y, first_s - self.scene.reach_s[0])?;
        let off = there.position_m - launcher;
        let rows = [there.d_position.row(0).into_owned(), there.d_position.row(2).into_owned()];
        let slope = SMatrix::<f64, 2, N>::from_rows(&rows);
        Some((slope / LAUNCHER_SIGMA_M, Vector2::new(off.x, off.z) / LAUNCHER_SIGMA_M))
    }

    /// Turns pixels into sigmas.
    pub(super) fn whitening(&self, sighting: &Sighting) -> Option<Matrix2<f64>> {
        // The inverse of the Cholesky factor, written out.
        let c = sighting.total_px2(self.noise[sighting.camera.idx()]);
        let a = c[(0, 0)].sqrt();
        let b = c[(0, 1)] / a;
        let d = (c[(1, 1)] - b * b).sqrt();
        let white = Matrix2::new(1.0 / a, 0.0, -b / (a * d), 1.0 / d);
        white.iter().all(|v| v.is_finite()).then_some(white)
    }

    /// Noise of each camera, as a multiple of what its sightings say of themselves: the scale of
    /// Student's t that its residuals are likeliest under. And the spread of an answer under it.
    fn noise_and_spread(&self, unknowns: &Unknowns) -> Option<([f64; 2], f64)> {
        let model = self.model(unknowns, [0.0; 2]);
        let mut offs_px = Vec::with_capacity(self.sightings.len());
        let mut squares: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
        // What is wide by other reasons says nothing of the noise.
        for sighting in self.sightings.iter().filter(|s| s.hidden_px2 == 0.0) {
            let time_s = time_s(sighting, self.reference_ns, unknowns);
            let (_, off_px) = slope_and_off(sighting, time_s, &model, self.scene.rig)?;
            let off = self.whitening(sighting)? * off_px;
            squares[sighting.camera.idx()].push(off.norm_squared());
            offs_px.push((sighting, off_px));
        }
        let noise = [0, 1].map(|i| noise::scaled(self.noise[i], &squares[i]));
        let scaled = Fit { noise, ..*self };
        let mut scatter = Scatter::default();
        for (sighting, off_px) in offs_px {
            let off = scaled.whitening(sighting)? * off_px;
            scatter.update(sighting.camera, &off, noise::weight(off.norm_squared()));
        }
        noise.iter().all(|scale| scale.is_finite()).then_some((noise, scatter.spread()))
    }
}

/// Columns that may not be zero: before the bounce neither ground nor velocity after it matter.
fn n_columns(model: &Model, time_s: f64) -> usize {
    if model.is_after(time_s) { N } else { GROUND }
}

/// None if the matrix is not positive definite.
pub(super) fn inverse(matrix: &Covariance) -> Option<Covariance> {
    let inverse = solved::inverse(N, matrix)?;
    Some(Covariance::from_fn(|i, j| inverse[(i, j)]))
}

/// Adds `w sᵀ s` to the upper triangle, of the first columns.
fn add_outer(matrix: &mut Covariance, slope: &SMatrix<f64, 2, N>, weight: f64, n: usize) {
    for column in 0..n {
        let [x, y] = [slope[(0, column)] * weight, slope[(1, column)] * weight];
        for row in 0..=column {
            matrix[(row, column)] += x * slope[(0, row)] + y * slope[(1, row)];
        }
    }
}

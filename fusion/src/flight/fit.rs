//! Sightings -> the most likely unknowns, with covariance.
//!
//! Maximum likelihood on raw pixels. Every sighting of either camera is compared at its own time
//! (stamp of its row, less the clocks' difference for the right camera) with the projection of the
//! ball at that time; nothing is triangulated and nothing is paired. Levenberg-Marquardt with exact
//! derivatives; the 17 normal equations are solved by faer's Cholesky.
//!
//! **Robust**: noise is Student's t with [`FREEDOM`] degrees of freedom, so that a sighting pulls
//! the less the farther off it is: a ball half behind the net's tape is off by ten times the noise.
//! Gaussian noise costs 2 % of precision by it. What is farther off than a gate was never handed in
//! ([`crate::path`]).
//!
//! **Noise**: a detector's own sigmas may be all too small or too large. Once fitted, each camera's
//! are scaled to its residuals (maximum likelihood), and the fit is repeated. The covariance is the
//! sandwich of M-estimation, `E ψ² / (E ψ′)²`, and is widened where residuals that follow each other
//! are alike, `(1 + ρ)/(1 − ρ)`: a bias that lasts for some frames is not so many observations. So it
//! means what it says whatever the pixels are worth.
//!
//! **What no residual shows**: light pulls the centres of a ball in all frames and both cameras
//! alike, and differently far away than near. Such biases are considered, not estimated (Schmidt):
//! the answer's response to each of [`BIASES`] at 1 sigma is added to the covariance.

use crate::flight::model::{Model, Row, Span};
use crate::flight::unknowns::{CLOCK, Column, Covariance, N, Prior, Unknowns};
use crate::motion::seconds_between;
use crate::rectified::Sighting;
use crate::world::ball::Physics;
use crate::world::rig::Rig;
use faer::linalg::solvers::{DenseSolveCore as _, Solve as _};
use nalgebra::{Matrix2, Matrix2x3, Point3, SMatrix, Vector2};
use shm_layout::{Camera, StampNs};

/// Degrees of freedom of the noise; fewer trust far sightings less.
const FREEDOM: f64 = 5.0;

/// Axes of an image.
const AXES: f64 = 2.0;

/// Most steps of one fit; five to eight are usual.
const N_STEPS_MAX: usize = 25;

/// A step this small, in sigmas, ends a fit, and a rough one.
const STEP_MIN: f64 = 0.01;
const ROUGH_STEP_MIN: f64 = 0.2;

/// Least curvature of the cost, of what the weights say.
const CURVATURE_MIN: f64 = 0.6;

/// Rounds in which the noise is found.
const N_NOISE_ROUNDS: usize = 6;

/// Likeness of residuals that follow each other which is believed, in sigmas of what chance does.
const LIKENESS_SIGMAS: f64 = 2.5;
const LIKENESS_MAX: f64 = 0.9;

/// Damping to begin with, its factors after a good and a bad step, and where to give up.
const DAMPING: [f64; 4] = [1e-10, 0.1, 100.0, 1e6];

/// Fewest sightings that tell their own noise.
const N_NOISE_MIN: usize = 12;

/// How far the noise may be from what the detector says.
const NOISE_RANGE: [f64; 2] = [0.2, 10.0];

/// Least part of the residuals that is taken to be free.
const FREE_MIN: f64 = 0.3;

/// How far on either side of the sightings a flight is followed.
const MARGIN_S: f64 = 0.05;

/// 1 sigma of where the machine lets go of the ball: "known to a few centimetres".
pub const LAUNCHER_SIGMA_M: f64 = 0.025;

/// Ways in which all centres may be off together: x and y alike, and x and y from one way near to
/// the other way far.
const BIASES: [fn(f64) -> [f64; 2]; 4] =
    [|_| [1.0, 0.0], |_| [0.0, 1.0], |far| [far, 0.0], |far| [0.0, far]];

/// What is not fitted.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// The cameras.
    pub rig: &'a Rig,
    /// Gravity, air, the ball.
    pub physics: &'a Physics,
    /// Where the flight begins, if it is known to begin at the launcher.
    pub launcher_m: Option<Point3<f64>>,
    /// Whether the sightings go on after a bounce.
    pub has_bounce: bool,
    /// How far before the first and after the last sighting the flight is followed.
    pub reach_s: [f64; 2],
    /// 1 sigma of each of the ways in which all centres may be off together.
    pub bias_sigma_px: f64,
}

/// A fitted flight.
#[derive(Clone)]
pub struct Fitted {
    /// Time 0 of the model, left clock.
    pub reference_ns: StampNs,
    /// The most likely values.
    pub unknowns: Unknowns,
    /// Their covariance.
    pub covariance: Covariance,
    /// The flight.
    pub model: Model,
    /// Each camera's noise as a multiple of its own sigmas.
    pub noise: [f64; 2],
}

impl Fitted {
    /// Time of a sighting on the model's clock.
    #[must_use]
    pub fn time_s(&self, sighting: &Sighting) -> f64 {
        time_s(sighting, self.reference_ns, &self.unknowns)
    }

    /// Where a sighting's camera should have seen the ball at its time, the derivative of that by
    /// all unknowns, and how far off the sighting is; None if the ball is behind the camera.
    #[must_use]
    pub fn seen(&self, sighting: &Sighting, rig: &Rig) -> Option<(SMatrix<f64, 2, N>, Vector2<f64>)> {
        slope_and_off(sighting, self.time_s(sighting), &self.model, rig)
    }

    /// How fast the ball crosses a camera's image at a sighting's time.
    #[must_use]
    pub fn speed_px_s(&self, sighting: &Sighting, rig: &Rig) -> Option<f64> {
        let ball = self.model.place_at(self.time_s(sighting));
        let (_, by_point) = rig.raw_and_slope(sighting.camera, &ball.position_m)?;
        Some((by_point * ball.velocity_m_s).norm())
    }

    /// Mahalanobis distance of a sighting, in sigmas of its own noise and of the fit together, or
    /// of its own alone.
    #[must_use]
    pub fn distance(&self, sighting: &Sighting, rig: &Rig, has_doubt: bool) -> Option<f64> {
        let (slope, off) = self.seen(sighting, rig)?;
        let mut covariance = sighting.total_px2(self.noise[sighting.camera.idx()]);
        if has_doubt {
            covariance += slope * self.covariance * slope.transpose();
        }
        Some(off.dot(&(covariance.try_inverse()? * off)).sqrt())
    }
}

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
        fit.noise = fit.noise_of(&unknowns)?;
        fit.spread = fit.system(&unknowns)?.spread;
        unknowns = fit.minimised(unknowns, STEP_MIN)?;
        fit.spread = fit.system(&unknowns)?.spread;
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
    let mut fit = Fit { sightings, reference_ns, prior, scene, noise, spread: 1.0 };
    let unknowns = fit.minimised(*start, ROUGH_STEP_MIN)?;
    fit.spread = fit.system(&unknowns)?.spread;
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

struct Fit<'a> {
    sightings: &'a [Sighting],
    reference_ns: StampNs,
    prior: &'a Prior,
    scene: &'a Scene<'a>,
    noise: [f64; 2],
    /// Variance of what the sightings say, as a multiple of that of independent Gaussian noise.
    spread: f64,
}

/// Normal equations at some unknowns.
struct System {
    normal: Covariance,
    /// What is known without them.
    known: Covariance,
    /// What the sightings would say if all were trusted alike.
    pixels: Covariance,
    /// How much wider than that the answer scatters.
    spread: f64,
    gradient: Column,
    cost: f64,
}

impl Fit<'_> {
    /// With covariance, and followed as far as the scene wants.
    fn fitted(&self, unknowns: Unknowns) -> Option<Fitted> {
        let system = self.system(&unknowns)?;
        let pixels = system.pixels / self.spread;
        let covariance_of_fit = inverse(&(system.known + pixels))?;
        // What the unknowns took up is missing from the residuals that told the spread.
        let n_taken = (covariance_of_fit * pixels).trace();
        let n_residuals = AXES * self.sightings.len() as f64;
        let free = (1.0 - n_taken / n_residuals).max(FREE_MIN);
        let mut covariance = inverse(&(system.known + pixels * free))?;
        for pull in self.pulls(&unknowns)? {
            let off = covariance_of_fit * pull;
            covariance += off * off.transpose();
        }
        let model = self.model(&unknowns, self.scene.reach_s);
        let Fit { reference_ns, noise, .. } = *self;
        Some(Fitted { reference_ns, unknowns, covariance, model, noise })
    }

    /// What each of [`BIASES`] adds to the gradient.
    fn pulls(&self, unknowns: &Unknowns) -> Option<[Column; BIASES.len()]> {
        let mut pulls = [Column::zeros(); BIASES.len()];
        if self.scene.bias_sigma_px == 0.0 {
            return Some(pulls);
        }
        let model = self.model(unknowns, [0.0; 2]);
        let last = self.sightings.len() as f64 - 1.0;
        for (i, sighting) in self.sightings.iter().enumerate() {
            let time_s = time_s(sighting, self.reference_ns, unknowns);
            let (slope, _) = slope_and_off(sighting, time_s, &model, self.scene.rig)?;
            let white = self.whitening(sighting)?;
            let slope = white * slope;
            let far = 2.0 * i as f64 / last - 1.0;
            for (pull, bias) in pulls.iter_mut().zip(BIASES) {
                let off = white * Vector2::from(bias(far)) * self.scene.bias_sigma_px;
                *pull += slope.transpose() * off / self.spread;
            }
        }
        Some(pulls)
    }

    fn minimised(&self, start: Unknowns, step_min: f64) -> Option<Unknowns> {
        let [mut damping, better, worse, damping_max] = DAMPING;
        let mut unknowns = start;
        let mut system = self.system(&unknowns)?;
        for _ in 0..N_STEPS_MAX {
            let mut damped = system.normal;
            for i in 0..N {
                damped[(i, i)] *= 1.0 + damping;
            }
            let step = -solved(&damped, &system.gradient)?;
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
    fn system(&self, unknowns: &Unknowns) -> Option<System> {
        let reach_s = [if self.scene.launcher_m.is_some() { self.scene.reach_s[0] } else { 0.0 }, 0.0];
        let model = self.model(unknowns, reach_s);
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
        let mut pixels = Covariance::zeros();
        let mut scatter = Scatter::default();
        for sighting in self.sightings {
            let time_s = time_s(sighting, self.reference_ns, unknowns);
            let (slope, off) = slope_and_off(sighting, time_s, &model, self.scene.rig)?;
            let white = self.whitening(sighting)?;
            let (slope, off) = (white * slope, white * off);
            let square = off.norm_squared();
            let weight = weight(square);
            let trust = 1.0 / self.spread;
            cost += 0.5 * trust * (FREEDOM + AXES) * (square / FREEDOM).ln_1p();
            add_outer(&mut trusted, &slope, weight * trust);
            add_outer(&mut pixels, &slope, 1.0);
            gradient += slope.transpose() * off * (weight * trust);
            scatter.update(sighting.camera, &off, weight);
        }
        let spread = scatter.spread();
        // Weights that fall with distance make the true curvature less: without this each step
        // leaves a third of the way, with it a tenth.
        trusted.fill_lower_triangle_with_upper_triangle();
        pixels.fill_lower_triangle_with_upper_triangle();
        let normal = known + trusted * scatter.curvature();
        cost.is_finite().then_some(System { normal, known, pixels, spread, gradient, cost })
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
    fn launcher(&self, model: &Model) -> Option<(SMatrix<f64, 2, N>, Vector2<f64>)> {
        let launcher = self.scene.launcher_m?;
        let first_s = seconds_between(self.reference_ns, self.sightings.first()?.t_ns);
        let there = model.passing(1, launcher.y, first_s - self.scene.reach_s[0])?;
        let off = there.position_m - launcher;
        let rows = [there.d_position.row(0).into_owned(), there.d_position.row(2).into_owned()];
        let slope = SMatrix::<f64, 2, N>::from_rows(&rows);
        Some((slope / LAUNCHER_SIGMA_M, Vector2::new(off.x, off.z) / LAUNCHER_SIGMA_M))
    }

    /// Turns pixels into sigmas.
    fn whitening(&self, sighting: &Sighting) -> Option<Matrix2<f64>> {
        // The inverse of the Cholesky factor, written out.
        let c = sighting.total_px2(self.noise[sighting.camera.idx()]);
        let a = c[(0, 0)].sqrt();
        let b = c[(0, 1)] / a;
        let d = (c[(1, 1)] - b * b).sqrt();
        let white = Matrix2::new(1.0 / a, 0.0, -b / (a * d), 1.0 / d);
        white.iter().all(|v| v.is_finite()).then_some(white)
    }

    /// Noise of each camera, as a multiple of what its sightings say of themselves: the scale of
    /// Student's t that its residuals are likeliest under.
    fn noise_of(&self, unknowns: &Unknowns) -> Option<[f64; 2]> {
        let model = self.model(unknowns, [0.0; 2]);
        let mut squares: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
        for sighting in self.sightings {
            let time_s = time_s(sighting, self.reference_ns, unknowns);
            let (_, off) = slope_and_off(sighting, time_s, &model, self.scene.rig)?;
            let white = self.whitening(sighting)?;
            squares[sighting.camera.idx()].push((white * off).norm_squared());
        }
        let [smallest, largest] = NOISE_RANGE;
        let noise = [0, 1].map(|i| {
            if squares[i].len() < N_NOISE_MIN / 2 {
                return self.noise[i];
            }
            let mut scale2 = 1.0;
            for _ in 0..N_NOISE_ROUNDS {
                let sum: f64 = squares[i].iter().map(|s| weight(s / scale2) * s).sum();
                scale2 = sum / (AXES * squares[i].len() as f64);
            }
            (self.noise[i] * scale2.sqrt()).clamp(smallest, largest)
        });
        noise.iter().all(|scale| scale.is_finite()).then_some(noise)
    }
}

/// Adds `w sᵀ s` to the upper triangle.
fn add_outer(matrix: &mut Covariance, slope: &SMatrix<f64, 2, N>, weight: f64) {
    for column in 0..N {
        let [x, y] = [slope[(0, column)] * weight, slope[(1, column)] * weight];
        for row in 0..=column {
            matrix[(row, column)] += x * slope[(0, row)] + y * slope[(1, row)];
        }
    }
}

/// How hard a sighting pulls at this squared distance, of what it would under Gaussian noise.
fn weight(square: f64) -> f64 {
    (FREEDOM + AXES) / (FREEDOM + square)
}

/// What residuals tell of how an estimate scatters.
#[derive(Default)]
struct Scatter {
    n: f64,
    psi2: f64,
    psi_slope: f64,
    weight: f64,
    last: [Option<Vector2<f64>>; 2],
    n_following: f64,
    product: f64,
    square: f64,
}

impl Scatter {
    fn update(&mut self, camera: Camera, off: &Vector2<f64>, weight: f64) {
        let square = off.norm_squared();
        let pull = off * weight;
        self.n += 1.0;
        self.psi2 += pull.norm_squared() / AXES;
        // Mean of the derivative of the pull by both axes.
        self.psi_slope += weight - square * weight / (FREEDOM + square);
        self.weight += weight;
        self.square += pull.norm_squared();
        if let Some(last) = self.last[camera.idx()].replace(pull) {
            self.product += last.dot(&pull);
            self.n_following += AXES;
        }
    }

    /// Curvature of the cost as a part of what the weights alone say.
    fn curvature(&self) -> f64 {
        if self.n > 0.0 { (self.psi_slope / self.weight).clamp(CURVATURE_MIN, 1.0) } else { 1.0 }
    }

    /// Variance of the estimate as a multiple of that of equal trust.
    fn spread(&self) -> f64 {
        if self.n < N_NOISE_MIN as f64 {
            return 1.0;
        }
        let sandwich = (self.psi2 / self.n) / (self.psi_slope / self.n).powi(2);
        let likeness = self.product / self.square;
        let by_chance = LIKENESS_SIGMAS / self.n_following.sqrt();
        let rho = if likeness > by_chance { likeness.min(LIKENESS_MAX) } else { 0.0 };
        sandwich * (1.0 + rho) / (1.0 - rho)
    }
}

fn time_s(sighting: &Sighting, reference_ns: StampNs, unknowns: &Unknowns) -> f64 {
    let on_its_clock_s = seconds_between(reference_ns, sighting.t_ns);
    match sighting.camera {
        Camera::Left => on_its_clock_s,
        Camera::Right => on_its_clock_s - unknowns.clock_s,
    }
}

/// Derivative of the ball's pixel by all unknowns, and pixel expected less pixel seen.
fn slope_and_off(
    sighting: &Sighting,
    time_s: f64,
    model: &Model,
    rig: &Rig,
) -> Option<(SMatrix<f64, 2, N>, Vector2<f64>)> {
    let ball = model.place_at(time_s);
    let (raw, by_point): (_, Matrix2x3<f64>) = rig.raw_and_slope(sighting.camera, &ball.position_m)?;
    let mut slope = by_point * ball.d_position;
    if sighting.camera == Camera::Right {
        let mut by_clock = slope.fixed_columns_mut::<1>(CLOCK);
        by_clock -= by_point * ball.velocity_m_s;
    }
    let off = Vector2::new(raw.x_px - sighting.raw.x_px, raw.y_px - sighting.raw.y_px);
    Some((slope, off))
}

fn faer_from(matrix: &Covariance, scale: &Column) -> faer::Mat<f64> {
    faer::Mat::from_fn(N, N, |i, j| matrix[(i, j)] * scale[i] * scale[j])
}

/// Scales that make the diagonal one: metres, radians and seconds side by side lose digits.
fn scale_of(matrix: &Covariance) -> Option<Column> {
    let scale = Column::from_fn(|i, _| matrix[(i, i)].sqrt().recip());
    scale.iter().all(|s| s.is_finite()).then_some(scale)
}

fn solved(matrix: &Covariance, right: &Column) -> Option<Column> {
    let scale = scale_of(matrix)?;
    let cholesky = faer_from(matrix, &scale).llt(faer::Side::Lower).ok()?;
    let column = faer::Mat::from_fn(N, 1, |i, _| right[i] * scale[i]);
    let solution = cholesky.solve(&column);
    Some(Column::from_fn(|i, _| solution[(i, 0)] * scale[i]))
}

fn inverse(matrix: &Covariance) -> Option<Covariance> {
    let scale = scale_of(matrix)?;
    let cholesky = faer_from(matrix, &scale).llt(faer::Side::Lower).ok()?;
    let inverse = cholesky.inverse();
    Some(Covariance::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// One row of derivatives, as a number's 1 sigma.
#[must_use]
pub fn sigma_of(row: &Row, covariance: &Covariance) -> f64 {
    (row * covariance * row.transpose())[(0, 0)].max(0.0).sqrt()
}

//! A fitted flight -> what it says of the rig.
//!
//! A flight that does not fit may be a flight through other cameras than the rig says. Its
//! residuals are differentiated by the rig's thirty numbers too, and its own 17 unknowns are taken
//! out (Schur complement): what is left is how its least cost rises with a change of the rig, `½ δᵀ
//! information δ + gradientᵀ δ`. Such sums of many flights are what calibration from balls and the
//! watch over a rig are made of.
//!
//! Beside the rig there is more that the flights of a session share and that pulls all of them one
//! way: light on the ball ([`fit::BIASES`]), the drag of its balls and the wind. Added up without
//! them, a hundred flights in the same wind would be sure of a rig that is not there. So these have
//! columns of their own, in their own sigmas, with one common prior: [`AFTER_RIG`].
//!
//! **Honest, and linear**: what a turned camera does to a flight gathers in the few sightings
//! around the bounce, which Student's t takes for odd ones: of 0.05° of toe-in it would tell 0.01.
//! Here a residual pulls in proportion up to `PULL_MAX`, from where the flight was fitted (one step
//! of Newton). Residuals count as their own scatter has it, so that the inverse of the information
//! is the covariance of what it tells.

use crate::flight::fit::{self, BIASES, FREE_MIN, Fit};
use crate::flight::fitted::{Fitted, Scene, slope_and_off};
use crate::flight::noise::{AXES, Scatter};
use crate::flight::unknowns::{Covariance, DRAG, N, Prior, WIND, WIND_SIGMA_M_S};
use crate::rectified::Sighting;
use crate::world::adjustment::{CAMERA, RIG, first_of};
use crate::world::ball::DRAG_SIGMA;
use nalgebra::{SMatrix, SVector, Vector2};

/// Numbers that are shared and are not the rig's: biases, then drag and wind.
pub const AFTER_RIG: usize = BIASES.len() + 3;

/// Numbers that all flights of a session share: the rig's first.
pub const SHARED: usize = RIG + AFTER_RIG;

/// One number per shared one.
pub type SharedColumn = SVector<f64, SHARED>;

/// Information on, or covariance of, the shared numbers.
pub type SharedMatrix = SMatrix<f64, SHARED, SHARED>;

/// A residual farther off than this, in sigmas of the fit's noise, pulls no harder.
const PULL_MAX: f64 = 8.0;

/// What flights say of the numbers they share, at the rig they were fitted with.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Inverse covariance of what they tell.
    pub information: SharedMatrix,
    /// How the least cost rises with each number.
    pub gradient: SharedColumn,
}

impl Default for Evidence {
    fn default() -> Self {
        Self { information: SharedMatrix::zeros(), gradient: SharedColumn::zeros() }
    }
}

impl Evidence {
    /// Takes another flight's in.
    pub fn add(&mut self, other: &Self) {
        self.information += other.information;
        self.gradient += other.gradient;
    }

    /// What it is worth if it is trusted this much.
    #[must_use]
    pub fn scaled(&self, trust: f64) -> Self {
        Self { information: self.information * trust, gradient: self.gradient * trust }
    }
}

/// What a flight says that was fitted to these sightings; None without a solution.
#[must_use]
pub fn of_flight(
    sightings: &[Sighting],
    fitted: &Fitted,
    prior: &Prior,
    scene: &Scene,
) -> Option<Evidence> {
    let sums = Sums::of(sightings, fitted, prior, scene)?;
    sums.reduced(sums.honest(sightings.len())?)
}

/// How a flight's own unknowns answer a change of the shared numbers, the sightings being as exact
/// as they say.
#[must_use]
pub fn response(
    sightings: &[Sighting],
    fitted: &Fitted,
    prior: &Prior,
    scene: &Scene,
) -> Option<SMatrix<f64, N, SHARED>> {
    let sums = Sums::of(sightings, fitted, prior, scene)?;
    Some(-fit::inverse(&(sums.known + sums.own))? * (sums.prior_cross + sums.cross))
}

/// Residuals by the flight's own unknowns and by the shared numbers, not yet weighed.
struct Sums {
    known: Covariance,
    known_gradient: SVector<f64, N>,
    own: Covariance,
    cross: SMatrix<f64, N, SHARED>,
    shared: SharedMatrix,
    own_pull: SVector<f64, N>,
    shared_pull: SharedColumn,
    scatter: Scatter,
    prior_cross: SMatrix<f64, N, SHARED>,
    prior_shared: SharedMatrix,
    prior_pull: SharedColumn,
}

impl Sums {
    fn of(sightings: &[Sighting], fitted: &Fitted, prior: &Prior, scene: &Scene) -> Option<Self> {
        let Fitted { reference_ns, unknowns, noise, .. } = *fitted;
        let fit = Fit { sightings, reference_ns, prior, scene, noise, spread: 1.0 };
        let model = fit.model_to_launcher(&unknowns);
        let off_mean = unknowns.less(&prior.mean);
        let mut known = prior.information;
        let mut known_gradient = prior.information * off_mean;
        if let Some((slope, off)) = fit.launcher(&model) {
            known += slope.transpose() * slope;
            known_gradient += slope.transpose() * off;
        }
        let mut sums = Self {
            known,
            known_gradient,
            own: Covariance::zeros(),
            cross: SMatrix::zeros(),
            shared: SharedMatrix::zeros(),
            own_pull: SVector::zeros(),
            shared_pull: SharedColumn::zeros(),
            scatter: Scatter::default(),
            prior_cross: SMatrix::zeros(),
            prior_shared: SharedMatrix::zeros(),
            prior_pull: SharedColumn::zeros(),
        };
        sums.add_air(prior, &off_mean);
        let last = sightings.len() as f64 - 1.0;
        for (i, sighting) in sightings.iter().enumerate() {
            let camera = sighting.camera;
            let time_s = fitted.time_s(sighting);
            let (slope, off) = slope_and_off(sighting, time_s, &model, scene.rig)?;
            let position_m = model.place_at(time_s).position_m;
            let (_, by_camera) = scene.rig.raw_and_slope_by_camera(camera, &position_m)?;
            let white = fit.whitening(sighting)?;
            let mut by_shared = SMatrix::<f64, 2, SHARED>::zeros();
            by_shared.fixed_columns_mut::<CAMERA>(first_of(camera)).copy_from(&by_camera);
            let far = 2.0 * i as f64 / last - 1.0;
            for (k, bias) in BIASES.iter().enumerate() {
                let off = Vector2::from(bias(far)) * scene.bias_sigma_px;
                by_shared.set_column(RIG + k, &off);
            }
            sums.add(sighting, &(white * slope), &(white * by_shared), &(white * off));
        }
        Some(sums)
    }

    /// Drag and wind that all flights have more than expected.
    fn add_air(&mut self, prior: &Prior, off_mean: &SVector<f64, N>) {
        let mut lift = SMatrix::<f64, N, SHARED>::zeros();
        let first = RIG + BIASES.len();
        lift[(DRAG, first)] = -DRAG_SIGMA;
        lift[(WIND, first + 1)] = -WIND_SIGMA_M_S;
        lift[(WIND + 1, first + 2)] = -WIND_SIGMA_M_S;
        self.prior_cross = prior.information * lift;
        self.prior_shared = lift.transpose() * self.prior_cross;
        self.prior_pull = self.prior_cross.transpose() * off_mean;
    }

    fn add(
        &mut self,
        sighting: &Sighting,
        own: &SMatrix<f64, 2, N>,
        shared: &SMatrix<f64, 2, SHARED>,
        off: &Vector2<f64>,
    ) {
        let weight = (PULL_MAX / off.norm()).min(1.0);
        self.own += own.transpose() * own;
        self.cross += own.transpose() * shared;
        self.shared += shared.transpose() * shared;
        self.own_pull += own.transpose() * off * weight;
        self.shared_pull += shared.transpose() * off * weight;
        if sighting.hidden_px2 == 0.0 {
            self.scatter.update(sighting.camera, off, weight);
        }
    }

    /// What a residual's square must count so that the information is the inverse covariance of
    /// what comes out.
    fn honest(&self, n_sightings: usize) -> Option<f64> {
        let spread = self.scatter.spread_of_pulls();
        let covariance = fit::inverse(&(self.known + self.own / spread))?;
        // What the unknowns took up is missing from the residuals that told the spread.
        let n_taken = (covariance * self.own / spread).trace();
        let free = (1.0 - n_taken / (AXES * n_sightings as f64)).max(FREE_MIN);
        Some(free / spread)
    }

    /// Without the flight's own unknowns.
    fn reduced(&self, square: f64) -> Option<Evidence> {
        let covariance = fit::inverse(&(self.known + self.own * square))?;
        let cross = self.prior_cross + self.cross * square;
        let response = covariance * cross;
        let information = self.prior_shared + self.shared * square - cross.transpose() * response;
        let own_gradient = self.known_gradient + self.own_pull * square;
        let gradient =
            self.prior_pull + self.shared_pull * square - response.transpose() * own_gradient;
        let is_finite = information.iter().chain(gradient.iter()).all(|v| v.is_finite());
        let information = (information + information.transpose()) * 0.5;
        is_finite.then_some(Evidence { information, gradient })
    }
}

#[cfg(test)]
mod tests;

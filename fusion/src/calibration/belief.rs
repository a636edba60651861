//! What is known of the numbers flights share, and evidence -> what is known then.
//!
//! Gaussian: a mean and a covariance of the changes of the rig's numbers (and of light's biases, of
//! drag and wind), relative to the rig that flights are fitted with. A number without variance is
//! taken as given. With `Σ = L Lᵀ` nothing but `I + Lᵀ W L` is inverted, which is never singular,
//! whatever the flights (`W`) do not tell and whatever is taken as given.

use crate::flight::evidence::{Evidence, SHARED, SharedColumn, SharedMatrix};
use crate::world::adjustment::{CAMERA, OPTICS, POSE, RIG, RigCovariance, RigStep, first_of};
use crate::world::rig::Rig;
use nalgebra::{Cholesky, SMatrix, SymmetricEigen};
use shm_layout::Camera;

/// Mean and covariance of the shared numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Belief {
    mean: SharedColumn,
    /// L of Σ.
    root: SharedMatrix,
}

/// 1 sigma of a good calibration, for a rig that does not say: a turn (0.02°), a place, a focal
/// length (as a part of it) and a principal point. It is what court lines give (algorithms, 4).
const TURN_SIGMA_RAD: f64 = 1.75e-4;
const CENTRE_SIGMA_M: f64 = 0.005;
const FOCAL_SIGMA: f64 = 3e-4;
const PRINCIPAL_SIGMA_PX: f64 = 0.0;

impl Belief {
    /// Before any flight: a rig so sure of itself.
    #[must_use]
    pub fn from_covariance(rig: &RigCovariance) -> Self {
        let mut covariance = SharedMatrix::identity();
        covariance.fixed_view_mut::<RIG, RIG>(0, 0).copy_from(rig);
        Self { mean: SharedColumn::zeros(), root: root_of(&covariance) }
    }

    /// Before any flight: what the rig says of itself, or else what a good calibration would.
    #[must_use]
    pub fn of_rig(rig: &Rig) -> Self {
        Self::from_covariance(&rig.covariance().copied().unwrap_or_else(|| usual(rig)))
    }

    /// After some flights, the evidence of which is of the rig at which the mean is zero.
    #[must_use]
    pub fn updated(&self, evidence: &Evidence) -> Option<Self> {
        let Evidence { information, gradient } = evidence;
        let inner = SharedMatrix::identity() + self.root.transpose() * information * self.root;
        let inner = Cholesky::new((inner + inner.transpose()) * 0.5)?;
        let root = inner.l_dirty().solve_lower_triangular(&self.root.transpose())?.transpose();
        let pull = gradient + information * self.mean;
        Some(Self { mean: self.mean - root * (root.transpose() * pull), root })
    }

    /// The same of a rig that was changed by a step meanwhile.
    #[must_use]
    pub fn about(&self, step: &RigStep) -> Self {
        let mut moved = self.clone();
        let mut rig = moved.mean.fixed_rows_mut::<RIG>(0);
        rig -= step;
        moved
    }

    /// The most likely change of the shared numbers.
    #[must_use]
    pub fn mean(&self) -> &SharedColumn {
        &self.mean
    }

    /// Its covariance.
    #[must_use]
    pub fn covariance(&self) -> SharedMatrix {
        self.root * self.root.transpose()
    }

    /// The change of the rig alone.
    #[must_use]
    pub fn step(&self) -> RigStep {
        self.mean.fixed_rows::<RIG>(0).into_owned()
    }

    /// Covariance of the rig's numbers alone.
    #[must_use]
    pub fn rig_covariance(&self) -> RigCovariance {
        let root = self.root.fixed_rows::<RIG>(0);
        root * root.transpose()
    }
}

/// Covariance of a rig that does not say how sure it is.
#[must_use]
pub fn usual(rig: &Rig) -> RigCovariance {
    let mut sigmas = RigStep::zeros();
    for camera in Camera::BOTH {
        let first = first_of(camera);
        let [fx, fy] = rig.eye(camera).lens.focal_px();
        sigmas[first] = fx * FOCAL_SIGMA;
        sigmas[first + 1] = fy * FOCAL_SIGMA;
        sigmas.fixed_rows_mut::<2>(first + 2).fill(PRINCIPAL_SIGMA_PX);
        let pose = first + OPTICS;
        sigmas.fixed_rows_mut::<3>(pose).fill(TURN_SIGMA_RAD);
        sigmas.fixed_rows_mut::<3>(pose + 3).fill(CENTRE_SIGMA_M);
    }
    const { assert!(CAMERA == OPTICS + POSE) };
    RigCovariance::from_diagonal(&sigmas.map(|sigma| sigma * sigma))
}

/// L of `Σ = L Lᵀ`, also of a covariance with zeros. Scaled to correlations first: radians and
/// pixels side by side lose digits.
fn root_of(covariance: &SharedMatrix) -> SharedMatrix {
    let sigmas = covariance.diagonal().map(|v| v.max(0.0).sqrt());
    let scale = sigmas.map(|sigma| if sigma > 0.0 { sigma.recip() } else { 0.0 });
    let correlation = SharedMatrix::from_fn(|i, j| covariance[(i, j)] * scale[i] * scale[j]);
    let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(correlation);
    let mut root: SMatrix<f64, SHARED, SHARED> = eigenvectors;
    for (mut column, value) in root.column_iter_mut().zip(&eigenvalues) {
        column *= value.max(0.0).sqrt();
    }
    SharedMatrix::from_fn(|i, j| root[(i, j)] * sigmas[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;

    /// Says that the turn of the left camera about its x is this, to 1e-5 rad.
    fn told(turn_rad: f64) -> Evidence {
        let mut evidence = Evidence::default();
        evidence.information[(OPTICS, OPTICS)] = 1e10;
        evidence.gradient[OPTICS] = -1e10 * turn_rad;
        evidence
    }

    #[test]
    fn what_is_told_precisely_is_believed_and_the_rest_stays() {
        let before = Belief::of_rig(&pretend::reference_rig());
        let after = before.updated(&told(2e-4)).unwrap();
        assert!((after.mean[OPTICS] - 2e-4).abs() < 1e-6);
        assert!((after.covariance()[(OPTICS, OPTICS)].sqrt() - 1e-5).abs() < 1e-7);
        let other = OPTICS + 1;
        assert!((after.covariance()[(other, other)].sqrt() - TURN_SIGMA_RAD).abs() < 1e-12);
        assert!(after.mean[other].abs() < 1e-12);
    }

    #[test]
    fn evidence_one_by_one_is_evidence_at_once() {
        let before = Belief::of_rig(&pretend::reference_rig());
        let apart = before.updated(&told(2e-4)).and_then(|b| b.updated(&told(1e-4))).unwrap();
        let mut both = told(2e-4);
        both.add(&told(1e-4));
        let at_once = before.updated(&both).unwrap();
        assert!((apart.mean - at_once.mean).amax() < 1e-12);
        assert!((apart.covariance() - at_once.covariance()).amax() < 1e-12);
    }

    #[test]
    fn a_number_that_is_taken_as_given_stays_whatever_is_told() {
        let before = Belief::from_covariance(&RigCovariance::zeros());
        let after = before.updated(&told(2e-4)).unwrap();
        assert_eq!(after.step(), RigStep::zeros());
        assert_eq!(after.rig_covariance(), RigCovariance::zeros());
    }
}

//! What is known of a rig before a calibration: how sure its lenses and its cameras' relation are.
//!
//! A chessboard tells lenses and how the cameras stand to each other, not where the court is. So
//! what is known are 24 numbers: nine of each lens, and the step of the right camera's pose in the
//! left one's frame. Where the cameras' relation is not known, 18.

use crate::calibration::least_squares::Normal;
use crate::solved;
use crate::world::adjustment::{
    self, OPTICS, POSE, RIG, RigCovariance, first_of, relation, relation_by_rig,
};
use crate::world::rig::Rig;
use nalgebra::{DMatrix, DVector, SMatrix};
use shm_layout::Camera;

/// Numbers of two lenses.
const LENSES: usize = 2 * OPTICS;

/// 1 sigma of a number that is taken as given: nothing to a picture, and still a number.
const GIVEN: [f64; OPTICS + POSE] =
    [1e-4, 1e-4, 1e-4, 1e-4, 1e-7, 1e-7, 1e-7, 1e-7, 1e-7, 1e-8, 1e-8, 1e-8, 1e-7, 1e-7, 1e-7];

/// How sure a lens is, 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensSigma {
    /// Of the focal length, as a part of it.
    pub focal: f64,
    /// Of fy less fx, as a part of the focal length.
    pub aspect: f64,
    /// Of the principal point.
    pub center_px: f64,
    /// Of k1.
    pub k1: f64,
}

impl LensSigma {
    /// A lens that is what the rig says.
    pub const EXACT: Self = Self { focal: 0.0, aspect: 0.0, center_px: 0.0, k1: 0.0 };
    /// Calibrated once, by a chessboard of the same kind of camera.
    pub const ROUGH: Self = Self { focal: 3e-3, aspect: 2e-4, center_px: 2.0, k1: 5e-3 };
    /// From a data sheet.
    pub const NOMINAL: Self = Self { focal: 0.03, aspect: 5e-4, center_px: 8.0, k1: 0.05 };

    /// Of both lenses' numbers, left then right, as the rig itself says if it does.
    #[must_use]
    pub fn covariance_of(&self, rig: &Rig) -> DMatrix<f64> {
        let Some(known) = rig.covariance() else { return self.covariance(rig) };
        let place = |i: usize| first_of(Camera::BOTH[i / OPTICS]) + i % OPTICS;
        DMatrix::from_fn(LENSES, LENSES, |i, j| known[(place(i), place(j))])
    }

    fn covariance(&self, rig: &Rig) -> DMatrix<f64> {
        let mut covariance = DMatrix::zeros(LENSES, LENSES);
        for camera in Camera::BOTH {
            let [fx, fy] = rig.eye(camera).lens.focal_px();
            let first = camera.idx() * OPTICS;
            let (common, own) = (self.focal.powi(2), 0.5 * self.aspect.powi(2));
            covariance[(first, first)] = fx * fx * (common + own);
            covariance[(first + 1, first + 1)] = fy * fy * (common + own);
            covariance[(first, first + 1)] = fx * fy * (common - own);
            covariance[(first + 1, first)] = fx * fy * (common - own);
            covariance[(first + 2, first + 2)] = self.center_px.powi(2);
            covariance[(first + 3, first + 3)] = self.center_px.powi(2);
            covariance[(first + 4, first + 4)] = self.k1.powi(2);
        }
        covariance
    }
}

/// What is known, with its information matrix.
#[derive(Debug, Clone)]
pub struct Prior {
    rig: Rig,
    information: DMatrix<f64>,
}

impl Prior {
    /// Of a rig that says how sure it is: its lenses, and the cameras' relation if that is one of
    /// the things it is sure of.
    #[must_use]
    pub fn of_rig(rig: &Rig, covariance: &RigCovariance) -> Option<Self> {
        // From 30 numbers to 24: a step of both poses changes their relation.
        let mut change = SMatrix::<f64, { LENSES + POSE }, RIG>::zeros();
        for camera in Camera::BOTH {
            for i in 0..OPTICS {
                change[(camera.idx() * OPTICS + i, first_of(camera) + i)] = 1.0;
            }
        }
        change.fixed_rows_mut::<POSE>(LENSES).copy_from(&relation_by_rig(rig));
        let known = change * covariance * change.transpose();
        let is_relation_known = (LENSES..LENSES + POSE).all(|i| known[(i, i)] > 0.0);
        let n = if is_relation_known { LENSES + POSE } else { LENSES };
        Self::with_covariance(rig, DMatrix::from_fn(n, n, |i, j| known[(i, j)]))
    }

    /// Of lenses that are this sure, and cameras that stand anywhere.
    #[must_use]
    pub fn of_lenses(rig: &Rig, sigma: &LensSigma) -> Option<Self> {
        Self::with_covariance(rig, sigma.covariance(rig))
    }

    fn with_covariance(rig: &Rig, mut covariance: DMatrix<f64>) -> Option<Self> {
        let n = covariance.nrows();
        for i in 0..n {
            let given = GIVEN[if i < LENSES { i % OPTICS } else { OPTICS + i - LENSES }];
            covariance[(i, i)] += given * given;
        }
        let inverse = solved::inverse(n, &covariance)?;
        let information = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)]);
        Some(Self { rig: rig.clone(), information })
    }

    /// Whether the cameras' relation is known.
    #[must_use]
    pub fn has_relation(&self) -> bool {
        self.information.nrows() > LENSES
    }

    /// The same of the lenses alone.
    #[must_use]
    pub fn of_its_lenses(&self) -> Option<Self> {
        let covariance = solved::inverse(self.information.nrows(), &self.information)?;
        let covariance = DMatrix::from_fn(LENSES, LENSES, |i, j| covariance[(i, j)]);
        Self::with_covariance(&self.rig, covariance)
    }

    /// Adds what this knows to a problem whose first unknowns are a step of a rig.
    pub fn add(&self, rig: &Rig, normal: &mut Normal) {
        let n = self.information.nrows();
        let mut off = DVector::zeros(n);
        let mut slope = DMatrix::zeros(n, RIG);
        for camera in Camera::BOTH {
            let known = self.rig.eye(camera).lens.optics();
            for (i, (now, known)) in rig.eye(camera).lens.optics().iter().zip(known).enumerate() {
                off[camera.idx() * OPTICS + i] = now - known;
                slope[(camera.idx() * OPTICS + i, first_of(camera) + i)] = 1.0;
            }
        }
        if self.has_relation() {
            let step = adjustment::step_between(&relation(&self.rig), &relation(rig));
            off.rows_mut(LENSES, POSE).copy_from_slice(&step);
            slope.view_mut((LENSES, 0), (POSE, RIG)).copy_from(&relation_by_rig(rig));
        }
        let pull = &self.information * &off;
        normal.cost += 0.5 * off.dot(&pull);
        let gradient = slope.transpose() * pull;
        let curvature = slope.transpose() * &self.information * &slope;
        for i in 0..RIG {
            normal.gradient[i] += gradient[i];
            for j in i..RIG {
                normal.curvature[(i, j)] += curvature[(i, j)];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;
    use crate::world::adjustment::RigStep;

    #[test]
    fn a_lens_costs_what_it_is_off_in_sigmas() {
        let rig = pretend::reference_rig();
        let prior = Prior::of_lenses(&rig, &LensSigma::ROUGH).unwrap();
        let mut step = RigStep::zeros();
        step[0] = 1240.0 * 3e-3;
        step[1] = step[0];
        let mut normal = Normal::new(RIG);
        prior.add(&rig.adjusted(&step).unwrap(), &mut normal);
        assert!((normal.cost - 0.5).abs() < 1e-3, "{}", normal.cost);
        let mut normal = Normal::new(RIG);
        prior.add(&rig, &mut normal);
        assert_eq!(normal.cost, 0.0);
    }

    #[test]
    fn a_rig_that_is_sure_of_its_relation_holds_it_and_leaves_the_court_open() {
        let stereo = pretend::courtless_rig();
        let right = first_of(Camera::Right) + OPTICS;
        let covariance =
            RigCovariance::from_fn(|i, j| if i == j && i >= right { 1e-6 } else { 0.0 });
        let prior = Prior::of_rig(&stereo, &covariance).unwrap();
        assert!(prior.has_relation());
        // Both cameras moved and turned together: the relation is the same.
        let court = pretend::reference_rig();
        let mut normal = Normal::new(RIG);
        prior.add(&court, &mut normal);
        assert!(normal.cost < 1e-6, "{}", normal.cost);
        let mut step = RigStep::zeros();
        step[right + 1] = 2e-3;
        let mut normal = Normal::new(RIG);
        prior.add(&court.adjusted(&step).unwrap(), &mut normal);
        assert!((normal.cost - 2.0).abs() < 0.01, "two sigmas: {}", normal.cost);
    }
}

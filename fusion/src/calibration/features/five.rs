//! Rays of matched points and a pose -> the most likely pose up to scale, with its covariance.
//!
//! Five unknowns: a turn of the right camera about its own axes (as in
//! [`adjustment`](crate::world::adjustment)) and the direction of the baseline. Residuals are
//! Sampson's distances in pixels: the first-order distance of a match from the nearest pair of
//! points the pose allows (Sampson 1982; Hartley and Zisserman 2004, 11.9). Huber's loss.

use crate::calibration::features::essential::Rays;
use crate::calibration::least_squares::{self, Normal, Patience, Problem};
use nalgebra::{
    IsometryMatrix3, Matrix3, Rotation3, SMatrix, SVector, Translation3, Unit, Vector3,
};

/// Unknowns of a pose up to scale.
pub const UNKNOWNS: usize = 5;

/// Beyond this many sigmas a match pulls no harder.
const HUBER_AT: f64 = 2.0;

/// Median of a normal distribution's absolute value to its sigma.
const SIGMA_PER_MEDIAN: f64 = 1.4826;

/// No match is better than this, whatever the residuals say.
const SIGMA_MIN_PX: f64 = 0.01;

/// What a match of a sample is taken for: no loss is wanted among tens of pixels.
const SAMPLE_SIGMA_PX: f64 = 30.0;

/// Rounds of residuals to sigma and sigma to residuals.
const ROUNDS: usize = 3;

/// A direction and two more across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Across {
    /// The first.
    pub first: Vector3<f64>,
    /// The second.
    pub second: Vector3<f64>,
}

impl Across {
    /// Of a direction.
    #[must_use]
    pub fn of(along: &Vector3<f64>) -> Self {
        // The axis that is least along it is never parallel to it.
        let least = along.iamin();
        let first = along.cross(&Vector3::ith(least, 1.0)).normalize();
        Self { first, second: along.normalize().cross(&first) }
    }
}

/// The pose of the right camera in the left one's frame, its centre at distance 1.
pub type UnitPose = IsometryMatrix3<f64>;

/// The fit.
#[derive(Debug, Clone)]
pub struct Five {
    /// The right camera in the left one's frame, at distance 1.
    pub left_from_right: UnitPose,
    /// Of three turns (rad) and of the centre's shift along [`Across`] of it (rad).
    pub covariance: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// Of a match's Sampson distance, by the residuals.
    pub sigma_px: f64,
}

/// Matches, and the focal length that makes pixels of both cameras' rays.
#[derive(Debug, Clone, Copy)]
pub struct Matched<'a> {
    /// Both rays of each match.
    pub rays: &'a [Rays],
    /// Of the left and the right camera.
    pub focal_px: [f64; 2],
}

impl Matched<'_> {
    /// Signed distance of every match from what a pose allows.
    #[must_use]
    pub fn distances_px(&self, left_from_right: &UnitPose) -> Vec<f64> {
        let bilinear = bilinear_of(left_from_right);
        self.rays.iter().map(|rays| self.distance_px(&bilinear, rays)).collect()
    }

    /// Of one match; `bilinear` is `lᵀ M r = 0`, the essential matrix' transpose.
    #[must_use]
    pub fn distance_px(&self, bilinear: &Matrix3<f64>, Rays { left, right }: &Rays) -> f64 {
        let [f_l, f_r] = self.focal_px;
        let (by_left, by_right) = (bilinear * right, bilinear.transpose() * left);
        let square =
            by_left.xy().norm_squared() / (f_l * f_l) + by_right.xy().norm_squared() / (f_r * f_r);
        left.dot(&by_left) / square.sqrt().max(f64::MIN_POSITIVE)
    }

    /// The same with its derivative by the five unknowns.
    fn distance_and_slope(
        &self,
        bilinear: &Matrix3<f64>,
        slopes: &[Matrix3<f64>; UNKNOWNS],
        Rays { left, right }: &Rays,
    ) -> (f64, [f64; UNKNOWNS]) {
        let [f_l, f_r] = self.focal_px;
        let (by_left, by_right) = (bilinear * right, bilinear.transpose() * left);
        let square = (by_left.xy().norm_squared() / (f_l * f_l)
            + by_right.xy().norm_squared() / (f_r * f_r))
            .max(f64::MIN_POSITIVE);
        let root = square.sqrt();
        let distance = left.dot(&by_left) / root;
        let slope = slopes.map(|slope| {
            let (d_left, d_right) = (slope * right, slope.transpose() * left);
            let half = by_left.xy().dot(&d_left.xy()) / (f_l * f_l)
                + by_right.xy().dot(&d_right.xy()) / (f_r * f_r);
            left.dot(&d_left) / root - distance * half / square
        });
        (distance, slope)
    }

    /// Gauss-Newton's pull on the five unknowns for residuals that change by `changes_px`: what
    /// the fit answers to an error of the lenses. Weights as in the fit.
    #[must_use]
    pub fn pull(&self, five: &Five, changes_px: &[f64]) -> SVector<f64, UNKNOWNS> {
        let bilinear = bilinear_of(&five.left_from_right);
        let slopes = slopes_of(&five.left_from_right);
        let mut pull = SVector::zeros();
        for (rays, change_px) in self.rays.iter().zip(changes_px) {
            let (distance, slope) = self.distance_and_slope(&bilinear, &slopes, rays);
            let sigmas = distance / five.sigma_px;
            let [_, weight] = least_squares::huber(sigmas * sigmas, HUBER_AT);
            let factor = weight * change_px / five.sigma_px.powi(2);
            pull += SVector::from(slope) * factor;
        }
        pull
    }
}

/// `lᵀ M r = 0`: `M = [C]× R` of the right camera's pose in the left one's frame.
#[must_use]
pub fn bilinear_of(left_from_right: &UnitPose) -> Matrix3<f64> {
    left_from_right.translation.vector.cross_matrix() * left_from_right.rotation.matrix()
}

fn slopes_of(left_from_right: &UnitPose) -> [Matrix3<f64>; UNKNOWNS] {
    let bilinear = bilinear_of(left_from_right);
    let rotation = left_from_right.rotation.matrix();
    let across = Across::of(&left_from_right.translation.vector);
    let turned = |axis: usize| bilinear * Vector3::ith(axis, 1.0).cross_matrix();
    let shifted = |along: Vector3<f64>| along.cross_matrix() * rotation;
    [turned(0), turned(1), turned(2), shifted(across.first), shifted(across.second)]
}

struct Fit<'a> {
    matched: Matched<'a>,
    sigma_px: f64,
}

impl Problem for Fit<'_> {
    type State = UnitPose;

    fn n_unknowns(&self) -> usize {
        UNKNOWNS
    }

    fn system(&self, state: &UnitPose) -> Option<Normal> {
        let (bilinear, slopes) = (bilinear_of(state), slopes_of(state));
        let mut normal = Normal::new(UNKNOWNS);
        for rays in self.matched.rays {
            let (distance, slope) = self.matched.distance_and_slope(&bilinear, &slopes, rays);
            let by: [(usize, f64); UNKNOWNS] =
                std::array::from_fn(|i| (i, slope[i] / self.sigma_px));
            normal.add_robust([distance / self.sigma_px], [&by], HUBER_AT);
        }
        normal.cost.is_finite().then_some(normal)
    }

    fn moved(&self, state: &UnitPose, step: &[f64]) -> UnitPose {
        moved(state, &SVector::from_column_slice(step))
    }
}

/// A pose after a step of the five unknowns.
#[must_use]
pub fn moved(pose: &UnitPose, step: &SVector<f64, UNKNOWNS>) -> UnitPose {
    let mut rotation = pose.rotation * Rotation3::new(step.fixed_rows::<3>(0).into_owned());
    rotation.renormalize();
    let centre = pose.translation.vector;
    let across = Across::of(&centre);
    let centre = centre + across.first * step[3] + across.second * step[4];
    let centre = Unit::new_normalize(centre).into_inner();
    IsometryMatrix3::from_parts(Translation3::from(centre), rotation)
}

/// The most likely pose from a guess; None if the matches leave it open.
#[must_use]
pub fn fitted(matched: Matched<'_>, guess: &UnitPose, sigma_px: f64) -> Option<Five> {
    let mut sigma_px = sigma_px.max(SIGMA_MIN_PX);
    let mut pose = *guess;
    let mut covariance = None;
    for _ in 0..ROUNDS {
        let fit = Fit { matched, sigma_px };
        let solution = least_squares::solution(&fit, pose, Patience::default())?;
        pose = solution.state;
        covariance = Some(solution.covariance);
        let next_px = sigma_of(&matched.distances_px(&pose));
        if (next_px / sigma_px - 1.0).abs() < 1e-3 {
            break;
        }
        let ratio = (next_px / sigma_px).powi(2);
        covariance = covariance.map(|covariance| covariance * ratio);
        sigma_px = next_px;
    }
    let covariance = covariance?;
    let covariance = SMatrix::from_fn(|i, j| covariance[(i, j)]);
    Some(Five { left_from_right: pose, covariance, sigma_px })
}

/// The pose on which a few matches agree best, by a few steps from a guess. Unlike eight points' it
/// does not mind a plane: of the two poses of a plane it is the one nearer to the guess.
#[must_use]
pub fn of_sample(matched: Matched<'_>, guess: &UnitPose) -> Option<UnitPose> {
    let fit = Fit { matched, sigma_px: SAMPLE_SIGMA_PX };
    let patience = Patience { n_steps_max: 12, step_min: 0.1 };
    least_squares::solution(&fit, *guess, patience).map(|solution| solution.state)
}

/// A robust sigma of distances: by their median.
#[must_use]
pub fn sigma_of(distances_px: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = distances_px.iter().map(|d| d.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    (SIGMA_PER_MEDIAN * median).max(SIGMA_MIN_PX)
}

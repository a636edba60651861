//! What both cameras saw of the board -> the rig, with the covariance of its numbers.
//!
//! Each lens [`alone`], the cameras' [relation](super::views), then everything at once:
//! both lenses, the relation, every board. Views that fit together much worse than the others are
//! refused, the worst first: mis-paired if each picture by itself fits well, an outlier if not.

use super::alone::{Alone, outlier, refitted};
use super::bundle::{Bundle, State, Terms};
use super::views::{PairView, Relation, relation};
use super::{Board, Error, MAX_VIEWS, MIN_VIEWS, alone};
use crate::calibration::report;
use crate::world::adjustment::{OPTICS, POSE, RigCovariance, first_of};
use crate::world::ball::Ball;
use crate::world::camera::RawPixel;
use crate::world::rig::{Eye, Mounting, Rig};
use nalgebra::DMatrix;
use shm_layout::Camera;
use std::fmt;

/// A view's pictures do not belong together if alone each fits this much better.
const MIS_PAIRED_MIN: f64 = 2.0;

/// Why a view is not used although its pictures show the board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    /// Each picture fits, but not with the other.
    MisPaired {
        /// RMS of the worse picture by itself.
        alone_px: f64,
        /// RMS of both together.
        together_px: f64,
    },
    /// A picture does not fit by itself.
    Outlier {
        /// Its RMS.
        rms_px: f64,
        /// The median view's.
        median_px: f64,
    },
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MisPaired { alone_px, together_px } => write!(
                f,
                "mis-paired: each picture fits alone ({alone_px:.2} px) but not with the other \
                 ({together_px:.2} px)"
            ),
            Self::Outlier { rms_px, median_px } => {
                write!(f, "outlier: {rms_px:.2} px where the median view has {median_px:.2} px")
            }
        }
    }
}

/// A rig and what it rests upon. Views are counted as they were given.
#[derive(Debug, Clone)]
pub struct Together {
    /// In the left frame, with covariance.
    pub rig: Rig,
    /// Views seen by both cameras that count.
    pub used: Vec<usize>,
    /// Views that do not, and why; of one camera if the other's picture is not to blame.
    pub refused: Vec<(usize, Option<Camera>, Reason)>,
    /// Views whose corners the right camera now counts from the other end.
    pub turned: Vec<usize>,
    /// Distortion terms of each lens.
    pub terms: [Terms; 2],
    /// RMS distance of all corners.
    pub rms_px: f64,
    /// The same for each camera.
    pub camera_rms_px: [f64; 2],
    /// RMS difference of rows after rectification.
    pub row_error_rms_px: f64,
    /// Sigma of a corner's place along x and along y, by the residuals.
    pub corner_sigma_px: f64,
    /// Distance of the optical centres.
    pub baseline_m: f64,
    /// Its 1 sigma.
    pub baseline_sigma_m: f64,
}

/// The rig by what each camera saw in every view, in the board's order.
///
/// # Errors
/// [`Error`] says which camera and what is missing.
pub fn fitted(
    board: &Board,
    image_px: [[u32; 2]; 2],
    views: &[[Option<Vec<RawPixel>>; 2]],
    terms: Option<Terms>,
) -> Result<Together, Error> {
    if views.len() > MAX_VIEWS {
        return Err(Error::TooManyViews { n: views.len() });
    }
    let points_m = board.points_m();
    let seen_by = |camera: Camera| -> Vec<Option<&[RawPixel]>> {
        views.iter().map(|view| view[camera.idx()].as_deref()).collect()
    };
    let lens_of = |camera: Camera| {
        alone::fitted(camera, image_px[camera.idx()], &points_m, &seen_by(camera), terms)
    };
    let alone = [lens_of(Camera::Left)?, lens_of(Camera::Right)?];
    let mut refused = outliers_of(&alone);
    let pairs: Vec<usize> = (0..views.len()).filter(|&v| is_pair(&alone, v)).collect();
    if pairs.len() < MIN_VIEWS {
        return Err(Error::too_few(None, pairs.len()));
    }
    let found = relation_of(board, &alone, &pairs, views).ok_or(Error::open(None))?;
    let turned: Vec<usize> = pairs
        .iter()
        .zip(&found.is_turned)
        .filter(|(_, turned)| **turned)
        .map(|(&v, _)| v)
        .collect();
    let mut views = views.to_vec();
    for &view in &turned {
        if let Some(seen) = &mut views[view][1] {
            seen.reverse();
        }
    }
    let (used, bundle, fit) = without_outliers(&points_m, &views, &alone, &found, &mut refused)?;
    let rig = rig_from(&fit.state)?.with_covariance(covariance_from(&bundle, &fit.covariance))?;
    let [baseline_m, baseline_sigma_m] = report::baseline_m(&rig);
    let camera_rms_px = Camera::BOTH.map(|camera| bundle.rms_of_all_px(&fit.state, Some(camera)));
    let used: Vec<usize> = used.into_iter().filter(|&view| is_pair(&alone, view)).collect();
    let corners = used.iter().flat_map(|&view| {
        let [left, right] = &views[view];
        let pairs = left.iter().flatten().zip(right.iter().flatten());
        pairs.map(|(left, right)| [*left, *right])
    });
    Ok(Together {
        row_error_rms_px: report::row_error_rms_px(&rig, corners),
        used,
        refused,
        turned,
        terms: bundle.terms,
        rms_px: bundle.rms_of_all_px(&fit.state, None),
        camera_rms_px,
        corner_sigma_px: bundle.sigma_px,
        baseline_m,
        baseline_sigma_m,
        rig,
    })
}

fn is_pair(alone: &[Alone; 2], view: usize) -> bool {
    alone.iter().all(|alone| alone.camera_from_board[view].is_some())
}

/// What each camera refused by itself.
fn outliers_of(alone: &[Alone; 2]) -> Vec<(usize, Option<Camera>, Reason)> {
    let of = |camera: Camera| {
        let alone = &alone[camera.idx()];
        alone.refused.iter().map(move |&(view, median_px)| {
            let rms_px = alone.view_rms_px[view].unwrap_or(f64::NAN);
            (view, Some(camera), Reason::Outlier { rms_px, median_px })
        })
    };
    Camera::BOTH.into_iter().flat_map(of).collect()
}

fn relation_of(
    board: &Board,
    alone: &[Alone; 2],
    pairs: &[usize],
    views: &[[Option<Vec<RawPixel>>; 2]],
) -> Option<Relation> {
    let view = |&view: &usize| {
        Some(PairView {
            left_from_board: alone[0].camera_from_board[view]?,
            right_from_board: alone[1].camera_from_board[view]?,
            seen_by_right: views[view][1].as_deref()?,
        })
    };
    let pair_views: Vec<PairView<'_>> = pairs.iter().filter_map(view).collect();
    relation(board, &alone[1].lens, &pair_views)
}

/// Views that are used, the problem they pose and its answer.
type Fit<'a> = (Vec<usize>, Bundle<'a>, super::super::least_squares::Solution<State>);

/// Fits all views, and again without the worst one while that is an outlier.
fn without_outliers<'a>(
    points_m: &[nalgebra::Point3<f64>],
    views: &'a [[Option<Vec<RawPixel>>; 2]],
    alone: &[Alone; 2],
    found: &Relation,
    refused: &mut Vec<(usize, Option<Camera>, Reason)>,
) -> Result<Fit<'a>, Error> {
    let seen = |view: usize| {
        let has = |camera: usize| alone[camera].camera_from_board[view].is_some();
        [0, 1].map(|camera| views[view][camera].as_deref().filter(|_| has(camera)))
    };
    let mut used = Vec::new();
    let mut left_from_board = Vec::new();
    for view in 0..views.len() {
        let [left, right] = [0, 1].map(|camera| alone[camera].camera_from_board[view]);
        if let Some(pose) = left.or(right.map(|right| found.left_from_right * right)) {
            used.push(view);
            left_from_board.push(pose);
        }
    }
    let lenses = [alone[0].lens, alone[1].lens];
    let mut state = State { lenses, left_from_right: found.left_from_right, left_from_board };
    loop {
        let mut bundle = Bundle {
            points_m: points_m.to_vec(),
            views: used.iter().map(|&view| seen(view)).collect(),
            terms: [alone[0].terms, alone[1].terms],
            is_pair: true,
            sigma_px: 1.0,
        };
        let fit = refitted(&mut bundle, state).ok_or(Error::open(None))?;
        let Some((worst, median_px)) = outlier(&bundle, &fit.state) else {
            return Ok((used, bundle, fit));
        };
        let together_px = bundle.rms_px(&fit.state, worst, None).unwrap_or(f64::NAN);
        let view = used.remove(worst);
        let alone_px = alone.iter().filter_map(|alone| alone.view_rms_px[view]).fold(0.0, f64::max);
        let reason = if together_px > MIS_PAIRED_MIN * alone_px {
            Reason::MisPaired { alone_px, together_px }
        } else {
            Reason::Outlier { rms_px: together_px, median_px }
        };
        refused.push((view, None, reason));
        let n_pairs = used.iter().filter(|&&view| is_pair(alone, view)).count();
        if n_pairs < MIN_VIEWS {
            return Err(Error::too_few(None, n_pairs));
        }
        state = fit.state;
        state.left_from_board.remove(worst);
    }
}

fn rig_from(state: &State) -> Result<Rig, crate::Error> {
    let eye = |lens| Eye { lens, row_time_us: 0.0, exposure_us: 0.0 };
    let right_from_left = state.left_from_right.inverse();
    Rig::new(state.lenses.map(eye), Mounting::Stereo { right_from_left }, Ball::default(), None)
}

/// The rig's part of the whole covariance; what was not fitted is taken as given.
fn covariance_from(bundle: &Bundle<'_>, covariance: &DMatrix<f64>) -> RigCovariance {
    let mut places: Vec<(usize, usize)> = Vec::new();
    for camera in Camera::BOTH {
        let n_free = bundle.terms[camera.idx()].n_free();
        places.extend((0..n_free).map(|i| (first_of(camera) + i, bundle.first_optics(camera) + i)));
    }
    let pose = first_of(Camera::Right) + OPTICS;
    places.extend((0..POSE).map(|i| (pose + i, bundle.first_pose() + i)));
    let mut of_rig = RigCovariance::zeros();
    for &(row, from_row) in &places {
        for &(column, from_column) in &places {
            of_rig[(row, column)] = covariance[(from_row, from_column)];
        }
    }
    of_rig
}

#[cfg(test)]
mod tests;

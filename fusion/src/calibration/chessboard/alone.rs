//! What one camera saw of the board -> its lens, and the board's pose in every view.
//!
//! Zhang's start, then the most likely lens and poses. Views that fit [`OUTLIER_MIN`] times worse
//! than the median one are refused, the worst first. How many distortion terms are fitted is
//! decided by the data unless told: those for which Schwarz' criterion is least, so a term stays if
//! it makes χ² smaller by more than the logarithm of the number of measurements, about three sigma.
//! A narrow lens does not show p1, p2, k2, k3 and they would only blur the rest.

use super::super::least_squares::{Patience, Solution, solution};
use super::bundle::{Bundle, State, Terms};
use super::homography::seen_from_plane;
use super::{Error, MIN_VIEWS, start};
use crate::world::camera::{Lens, RawPixel};
use nalgebra::{IsometryMatrix3, Point2, Point3};
use shm_layout::Camera;

/// A view is an outlier if its RMS is this many medians.
pub const OUTLIER_MIN: f64 = 3.0;

/// Below this RMS no view is an outlier, px.
pub const OUTLIER_MIN_PX: f64 = 0.3;

/// Focal lengths tried where the views do not tell one, in image widths.
const FOCAL_GUESSES: [f64; 5] = [0.6, 1.0, 2.0, 4.0, 8.0];

/// Least sigma of a corner: perfect corners of a simulation are not infinitely sure.
const SIGMA_MIN_PX: f64 = 1e-4;

/// A lens by itself.
#[derive(Debug, Clone)]
pub struct Alone {
    /// The most likely one.
    pub lens: Lens,
    /// Distortion terms that were fitted.
    pub terms: Terms,
    /// The board's pose in each view; None if it was not seen or is refused.
    pub camera_from_board: Vec<Option<IsometryMatrix3<f64>>>,
    /// RMS distance of each view's corners; None if not seen. Of a refused view, when it was.
    pub view_rms_px: Vec<Option<f64>>,
    /// Views refused as outliers, with the median RMS of the others.
    pub refused: Vec<(usize, f64)>,
    /// RMS distance of all corners.
    pub rms_px: f64,
    /// 1 sigma of the lens' nine numbers, zero of those that were not fitted.
    pub sigma: [f64; 9],
}

/// The lens of a camera by its views of the board; `terms` none lets the data decide.
///
/// # Errors
/// [`Error::TooFewViews`], [`Error::Open`].
pub fn fitted(
    camera: Camera,
    image_px: [u32; 2],
    points_m: &[Point3<f64>],
    seen: &[Option<&[RawPixel]>],
    terms: Option<Terms>,
) -> Result<Alone, Error> {
    let mut used: Vec<usize> = (0..seen.len()).filter(|&view| seen[view].is_some()).collect();
    let mut view_rms_px = vec![None; seen.len()];
    let mut refused = Vec::new();
    if used.len() < MIN_VIEWS {
        return Err(Error::too_few(Some(camera), used.len()));
    }
    let bundle_of = |used: &[usize], terms| Bundle {
        points_m: points_m.to_vec(),
        views: used.iter().map(|&view| [seen[view], None]).collect(),
        terms: [terms; 2],
        is_pair: false,
        sigma_px: 1.0,
    };
    let most = terms.unwrap_or(Terms::All);
    let mut bundle = bundle_of(&used, most);
    let mut state = first_state(&bundle, camera, image_px).ok_or(Error::open(Some(camera)))?;
    loop {
        state = refitted(&mut bundle, state).ok_or(Error::open(Some(camera)))?.state;
        for (i, view) in used.iter().enumerate() {
            view_rms_px[*view] = bundle.rms_px(&state, i, None);
        }
        let Some((worst, median_px)) = outlier(&bundle, &state) else { break };
        refused.push((used.remove(worst), median_px));
        state.left_from_board.remove(worst);
        if used.len() < MIN_VIEWS {
            return Err(Error::too_few(Some(camera), used.len()));
        }
        bundle = bundle_of(&used, most);
    }
    if terms.is_none() {
        bundle.terms = [decided(&bundle, &state); 2];
        state.lenses[0] = without_the_rest(&state.lenses[0], bundle.terms[0])?;
    }
    let fit = refitted(&mut bundle, state).ok_or(Error::open(Some(camera)))?;
    let mut camera_from_board = vec![None; seen.len()];
    for (view, pose) in used.iter().zip(&fit.state.left_from_board) {
        camera_from_board[*view] = Some(*pose);
    }
    let n_free = bundle.terms[0].n_free();
    let sigma = |i: usize| if i < n_free { fit.covariance[(i, i)].sqrt() } else { 0.0 };
    Ok(Alone {
        lens: fit.state.lenses[0],
        terms: bundle.terms[0],
        camera_from_board,
        view_rms_px,
        refused,
        rms_px: bundle.rms_of_all_px(&fit.state, None),
        sigma: std::array::from_fn(sigma),
    })
}

/// The lens with the distortion terms that are not fitted at zero.
fn without_the_rest(lens: &Lens, terms: Terms) -> Result<Lens, Error> {
    let mut optics = lens.optics();
    optics[terms.n_free()..].fill(0.0);
    Ok(lens.with_optics("lens", optics)?)
}

/// A lens and poses near the answer: of the focal lengths that may be, the one that fits best.
fn first_state(bundle: &Bundle<'_>, camera: Camera, image_px: [u32; 2]) -> Option<State> {
    let plane: Vec<_> = bundle.points_m.iter().map(Point3::xy).collect();
    let seen = || bundle.views.iter().filter_map(|seen| seen[0]);
    let homographies: Vec<_> = seen()
        .filter_map(|seen| {
            let seen: Vec<_> = seen.iter().map(|p| Point2::new(p.x_px, p.y_px)).collect();
            seen_from_plane(&plane, &seen)
        })
        .collect();
    let width = f64::from(image_px[0]);
    let focals = start::focal_px(image_px, &homographies)
        .map_or_else(|| FOCAL_GUESSES.map(|f| [f * width; 2]).to_vec(), |focal| vec![focal]);
    let start = |focal| {
        let center = start::center_px(image_px);
        let lens = Lens::new(camera.name(), image_px, focal, center, [0.0; 5]).ok()?;
        let pose = |seen| start::camera_from_board(&lens, &bundle.points_m, seen);
        let left_from_board = seen().map(pose).collect::<Option<Vec<_>>>()?;
        let left_from_right = IsometryMatrix3::identity();
        let state = State { lenses: [lens; 2], left_from_right, left_from_board };
        let terms = [Terms::Radial1.min(bundle.terms[0]); 2];
        solution(&Bundle { terms, ..bundle.clone() }, state, Patience::default())
    };
    let fits = focals.into_iter().filter_map(start);
    fits.min_by(|a, b| a.cost.total_cmp(&b.cost)).map(|fit| fit.state)
}

/// The most likely state, with the sigma that its residuals show: fitted with a first guess of
/// sigma, then with their own.
pub fn refitted(bundle: &mut Bundle<'_>, state: State) -> Option<Solution<State>> {
    use super::super::least_squares::Problem as _;
    let mut fit = solution(bundle, state, Patience::default())?;
    for _ in 0..2 {
        let mut off: Vec<f64> = (0..bundle.views.len())
            .flat_map(|view| Camera::BOTH.map(|camera| bundle.off_px(&fit.state, view, camera)))
            .flatten()
            .flatten()
            .flatten()
            .map(f64::abs)
            .collect();
        off.sort_by(f64::total_cmp);
        // Wild corners must not count, and fitted unknowns make residuals small.
        let limit_px = 3.0 * off[off.len() / 2] / 0.6745;
        let n_open = off.len().saturating_sub(bundle.n_unknowns()).max(1);
        let squares: f64 = off.iter().map(|v| v.min(limit_px).powi(2)).sum();
        bundle.sigma_px = (squares / n_open as f64).sqrt().max(SIGMA_MIN_PX);
        fit = solution(bundle, fit.state, Patience::default())?;
    }
    Some(fit)
}

/// The view that fits worst, if it is an outlier, and the median RMS.
#[must_use]
pub fn outlier(bundle: &Bundle<'_>, state: &State) -> Option<(usize, f64)> {
    let rms_px = |view| bundle.rms_px(state, view, None).unwrap_or(0.0);
    let all: Vec<f64> = (0..bundle.views.len()).map(rms_px).collect();
    let mut sorted = all.clone();
    sorted.sort_by(f64::total_cmp);
    let median_px = sorted[sorted.len() / 2];
    let worst = (0..all.len()).max_by(|&a, &b| all[a].total_cmp(&all[b]))?;
    let is_outlier = all[worst] > (OUTLIER_MIN * median_px).max(OUTLIER_MIN_PX);
    is_outlier.then_some((worst, median_px))
}

/// The distortion terms that the views show.
fn decided(bundle: &Bundle<'_>, state: &State) -> Terms {
    let criterion = |terms: Terms| {
        let mut start = state.clone();
        start.lenses[0] = without_the_rest(&state.lenses[0], terms).ok()?;
        let bundle = Bundle { terms: [terms; 2], ..bundle.clone() };
        let fit = solution(&bundle, start, Patience::default())?;
        let n_numbers = 2.0 * bundle.n_corners() as f64;
        Some((terms, 2.0 * fit.cost + terms.n_free() as f64 * n_numbers.ln()))
    };
    let all = Terms::ALL.into_iter().filter_map(criterion);
    all.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(Terms::All, |(terms, _)| terms)
}

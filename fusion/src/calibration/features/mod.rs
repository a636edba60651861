//! Averaged pictures of both cameras -> how the cameras stand to each other, up to scale.
//!
//! [`corners`] (salient points), [`patch`] (what they look like) and [`mod@matches`] (the same in
//! both pictures), [`essential`] (eight points to a pose), [`consensus`] (which matches are right),
//! [`five`] (the most likely pose), [`flat`] (whether it is determined at all) and [`doubt`] (how
//! sure all of it is). Twice more with what was found: a better guess finds more matches.
//!
//! The length of the baseline is taken as given, for pictures tell no scale, and the result knows
//! no court: lines or balls tell these. Most of what is seen from a tennis court's end is far away,
//! and the rest is on the ground: the direction of the baseline comes out poorly, and turns that
//! look like it.

pub mod consensus;
pub mod corners;
pub mod doubt;
pub mod essential;
pub mod five;
pub mod flat;
pub mod matches;
pub mod patch;

#[cfg(test)]
mod tests;

use crate::calibration::court;
use crate::calibration::picture::Picture;
use crate::calibration::prior::LensSigma;
use crate::calibration::report;
use crate::world::rig::{Mounting, Rig};
use consensus::{Consensus, Search};
use five::{Five, Matched, UnitPose};
use flat::Flat;
use matches::{Guess, Match};
use nalgebra::{IsometryMatrix3, Translation3, Vector2};
use shm_layout::Camera;

/// What is believed beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How sure the lenses are, if the rig does not say so itself.
    pub lens: LensSigma,
    /// Distance of the optical centres; the rig's if it is not given.
    pub baseline_m: Option<f64>,
    /// How sure it is; 1 % if it is not given.
    pub baseline_sigma_m: Option<f64>,
    /// How far the cameras may be turned against each other from what the rig says.
    pub turn_rad: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { lens: LensSigma::ROUGH, baseline_m: None, baseline_sigma_m: None, turn_rad: 0.07 }
    }
}

/// Part of the baseline that is 1 sigma of it if nobody says better: tape between two masts.
const BASELINE_SIGMA: f64 = 0.01;

/// How far the right camera may stand from where the rig has it, as seen from the left one.
const DIRECTION_MAX_RAD: f64 = 0.35;

/// Fewest matches that are looked at, and that must be explained.
const MATCHES_MIN: usize = 30;
const EXPLAINED_MIN: usize = 25;

/// Least part of the matches.
const SHARE_MIN: f64 = 0.3;

/// How far from what the last round found a match may be, and how near it must be to be explained,
/// round by round.
const ROUNDS: [(Option<f64>, f64); 3] = [(None, 2.0), (Some(8.0), 1.0), (Some(3.0), 0.5)];

/// Grey levels by which pictures differ on average if two cameras took them.
const DIFFERENCE_MIN: f32 = 0.2;

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refused {
    /// The picture is not of the camera the rig describes.
    #[error("the {camera} picture is {got:?}, the rig's camera has {expected:?}")]
    Size {
        /// Whose.
        camera: Camera,
        /// Width and height.
        got: [usize; 2],
        /// Width and height.
        expected: [u32; 2],
    },
    /// One file, given twice.
    #[error("both pictures are the same one: expected one of each camera")]
    Same,
    /// Nothing to be matched.
    #[error(
        "{n} salient points look the same in both pictures ({left} in the left one, {right} in \
             the right one), expected {MATCHES_MIN}: too little to be seen, or cameras that stand \
             otherwise than the rig says"
    )]
    Few {
        /// Matches.
        n: usize,
        /// Salient points of the left picture.
        left: usize,
        /// Salient points of the right picture.
        right: usize,
    },
    /// Matches that do not agree.
    #[error(
        "{explained} of {n} matches agree on how the cameras stand, expected {EXPLAINED_MIN} and \
             30 %: cameras that stand otherwise than the rig says, or another lens"
    )]
    Disagree {
        /// Matches one pose explains.
        explained: usize,
        /// Matches.
        n: usize,
    },
    /// One plane explains the matches as well.
    #[error(
        "all {n} points lie on one plane: the relative pose is not determined; expected things at \
             several distances, as trees and the court"
    )]
    Plane {
        /// Matches explained.
        n: usize,
    },
    /// One turn explains the matches as well.
    #[error(
        "all {n} points are too far away, or the cameras stand at one place: the direction of the \
             baseline is not determined; expected things nearer than some ten baselines"
    )]
    Far {
        /// Matches explained.
        n: usize,
    },
    /// The baseline is none.
    #[error("a baseline of {baseline_m} m (1 sigma {sigma_m} m), expected more than 0.01 m")]
    Baseline {
        /// Its length.
        baseline_m: f64,
        /// How sure it is.
        sigma_m: f64,
    },
    /// The equations have no solution, or not one a rig can have.
    #[error("the matches do not tell how the cameras stand")]
    Open,
}

/// A rig without a court, and how it was found.
#[derive(Debug, Clone)]
pub struct FeatureCalibration {
    /// With the covariance of its lenses and of the right camera's pose.
    pub rig: Rig,
    /// The fit.
    pub five: Five,
    /// Salient points of each picture.
    pub n_corners: [usize; 2],
    /// Pairs that look the same, last round.
    pub n_matches: usize,
    /// Those that agree.
    pub explained: Vec<Match>,
    /// RMS distance of a match from what the rig allows (Sampson).
    pub rms_px: f64,
    /// RMS difference of rows after rectification.
    pub row_error_rms_px: f64,
    /// The length that was taken as given, and its 1 sigma.
    pub baseline_m: [f64; 2],
}

/// How the cameras stand to each other, by what both pictures show.
///
/// # Errors
/// [`Refused`] says why.
pub fn from_pictures(
    pictures: [&Picture; 2],
    start: &Rig,
    settings: &Settings,
) -> Result<FeatureCalibration, Refused> {
    check_pictures(pictures, start)?;
    let baseline_m = baseline_of(start, settings)?;
    let blurred = pictures.map(corners::blurred);
    let points = blurred.each_ref().map(|picture| {
        let mut points = corners::of_blurred(picture);
        points.retain(|p| patch::is_distinct(picture, &Vector2::new(p.x as f64, p.y as f64)));
        points
    });
    let n_corners = points.each_ref().map(Vec::len);
    let focal_px = doubt::focal_px(start);
    let search = Search {
        within_px: 0.0,
        roughly: unit_pose(start),
        turn_max_rad: 2.0 * settings.turn_rad,
        direction_max_rad: DIRECTION_MAX_RAD,
    };
    let [court_from_left, _] = court::rough_poses(start).ok_or(Refused::Open)?;
    let mut rig = start.clone();
    let mut found: Option<(Vec<Match>, Consensus)> = None;
    for (beside_px, within_px) in ROUNDS {
        let reach_px = settings.turn_rad * focal_px[1];
        let beside_px = beside_px.unwrap_or(reach_px);
        let guess = Guess { rig: &rig, court_from_left, beside_px, along_px: reach_px };
        let pictures = [&blurred[0], &blurred[1]];
        let matches = matches::between(pictures, [&points[0], &points[1]], &guess);
        let consensus = agreed(start, &matches, &Search { within_px, ..search }, n_corners)?;
        rig = with_pose(start, &consensus.five.left_from_right, baseline_m[0])?;
        found = Some((matches, consensus));
    }
    let (matches, Consensus { five, explained }) = found.ok_or(Refused::Open)?;
    let explained: Vec<Match> = explained.iter().map(|&i| matches[i]).collect();
    let rays = rays_of(start, &explained)?;
    let matched = Matched { rays: &rays, focal_px };
    let n = explained.len();
    match flat::instead_of(&five, &matched, matches.len() - n) {
        Some(Flat::Plane) => return Err(Refused::Plane { n }),
        Some(Flat::Far) => return Err(Refused::Far { n }),
        None => {}
    }
    let lenses = settings.lens.covariance_of(start);
    let covariance = doubt::covariance_of(&rig, (&five, &explained), &lenses, baseline_m[1]);
    let rig = rig.with_covariance(covariance.ok_or(Refused::Open)?).map_err(|_| Refused::Open)?;
    let distances = matched.distances_px(&five.left_from_right);
    Ok(FeatureCalibration {
        rms_px: rms(&distances),
        row_error_rms_px: report::row_error_rms_px(
            &rig,
            explained.iter().map(|m| [m.left, m.right]),
        ),
        n_matches: matches.len(),
        rig,
        five,
        n_corners,
        explained,
        baseline_m,
    })
}

fn check_pictures(pictures: [&Picture; 2], start: &Rig) -> Result<(), Refused> {
    for camera in Camera::BOTH {
        let picture = pictures[camera.idx()];
        let (got, expected) =
            ([picture.width_px(), picture.height_px()], start.eye(camera).lens.image_px());
        if got != expected.map(|side| side as usize) {
            return Err(Refused::Size { camera, got, expected });
        }
    }
    let [left, right] = pictures.map(Picture::luma);
    let difference: f32 = left.iter().zip(right).map(|(l, r)| (l - r).abs()).sum();
    let is_same = left.len() == right.len() && difference < DIFFERENCE_MIN * left.len() as f32;
    if is_same { Err(Refused::Same) } else { Ok(()) }
}

fn baseline_of(start: &Rig, settings: &Settings) -> Result<[f64; 2], Refused> {
    let of_rig_m = start.right_from_left().translation.vector.norm();
    let baseline_m = settings.baseline_m.unwrap_or(of_rig_m);
    let sigma_m = settings.baseline_sigma_m.unwrap_or(BASELINE_SIGMA * baseline_m);
    let is_sane = baseline_m.is_finite() && baseline_m > 0.01 && sigma_m.is_finite();
    if is_sane && sigma_m >= 0.0 {
        return Ok([baseline_m, sigma_m]);
    }
    Err(Refused::Baseline { baseline_m, sigma_m })
}

/// The right camera in the left one's frame, at distance 1.
fn unit_pose(rig: &Rig) -> UnitPose {
    let pose = rig.right_from_left().inverse();
    let along = pose.translation.vector.normalize();
    IsometryMatrix3::from_parts(Translation3::from(along), pose.rotation)
}

fn with_pose(start: &Rig, pose: &UnitPose, baseline_m: f64) -> Result<Rig, Refused> {
    let centre = Translation3::from(pose.translation.vector * baseline_m);
    let left_from_right = IsometryMatrix3::from_parts(centre, pose.rotation);
    let mounting = Mounting::Stereo { right_from_left: left_from_right.inverse() };
    start.with_mounting(mounting).map_err(|_| Refused::Open)
}

fn rays_of(rig: &Rig, matches: &[Match]) -> Result<Vec<essential::Rays>, Refused> {
    let [left, right] = Camera::BOTH.map(|camera| &rig.eye(camera).lens);
    doubt::rays_of([left, right], matches).ok_or(Refused::Open)
}

fn agreed(
    start: &Rig,
    matches: &[Match],
    search: &Search,
    [left, right]: [usize; 2],
) -> Result<Consensus, Refused> {
    let n = matches.len();
    if n < MATCHES_MIN {
        return Err(Refused::Few { n, left, right });
    }
    let rays = rays_of(start, matches)?;
    let matched = Matched { rays: &rays, focal_px: doubt::focal_px(start) };
    let consensus = consensus::of_matches(matched, search);
    let explained = consensus.as_ref().map_or(0, |consensus| consensus.explained.len());
    let is_enough = explained >= EXPLAINED_MIN && explained as f64 >= SHARE_MIN * n as f64;
    consensus.filter(|_| is_enough).ok_or(Refused::Disagree { explained, n })
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

//! Averaged pictures of the empty court -> the rig, from its white lines.
//!
//! [`paint`] (what lines a court has), then for each picture [`ridges`], [`segments`] and
//! [`guess`]: where the camera stands to a pixel; [`profiles`]: where each piece of each line lies,
//! to a twentieth of one; and for both together [`fitted`].
//!
//! The pictures should be averages of some dozen frames, so that noise is small and people are gone
//! (`capture --background`). Grey levels are turned into light by the sRGB curve first.
//! Net cord and posts are not used: their height is that of whoever set them up.

#[cfg(test)]
mod drawn;
pub mod fitted;
pub mod guess;
pub mod paint;
pub mod perspective;
pub mod profiles;
pub mod ridge_map;
pub mod ridges;
pub mod segments;

use crate::calibration::picture::Picture;
use crate::calibration::prior::{LensSigma, Prior};
use crate::calibration::siting::Site;
use crate::world::adjustment::{self, POSE, relation, relation_by_rig};
use crate::world::camera::Lens;
use crate::world::rig::{Mounting, Rig};
use fitted::Fitted;
use guess::{Guess, Range};
use nalgebra::{IsometryMatrix3, SVector};
use paint::{LINES, Line};
use profiles::{Piece, View};
use shm_layout::Camera;

/// How lines are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How far the cameras may be from where they are said to stand.
    pub range: Range,
    /// How sure the lenses are, if the rig does not say so itself.
    pub lens: LensSigma,
    /// Width of the baselines, and of all other lines.
    pub baseline_m: f64,
    /// The other lines.
    pub others_m: f64,
    /// 1 sigma of how far a line lies from where the rules put it, at each of its ends.
    pub paint_sigma_m: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            range: Range::default(),
            lens: LensSigma::ROUGH,
            baseline_m: 0.1,
            others_m: 0.05,
            paint_sigma_m: 0.005,
        }
    }
}

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refused {
    /// The picture is not of the camera the rig describes.
    #[error(
        "the {camera} picture is {}x{}, the rig's camera has {}x{}",
        got[0], got[1], expected[0], expected[1]
    )]
    Size {
        /// Whose.
        camera: Camera,
        /// Width and height.
        got: [usize; 2],
        /// Width and height.
        expected: [u32; 2],
    },
    /// No lines, or none that a court's could be.
    #[error(
        "the {camera} picture shows no tennis court within reach of where the camera is said to \
             stand: {n_segments} straight bright lines, none of which fit"
    )]
    NoCourt {
        /// Whose.
        camera: Camera,
        /// Straight bright lines found.
        n_segments: usize,
    },
    /// Some lines fit, and too many do not.
    #[error(
        "the {camera} picture's lines are not those of a tennis court: {n_hit} of {n_visible} \
             points of it lie on a line, {across} lines across and {along} along were recognised; \
             expected half of the points, two lines across and two along"
    )]
    WrongCourt {
        /// Whose.
        camera: Camera,
        /// Points on a line.
        n_hit: usize,
        /// Points in the picture.
        n_visible: usize,
        /// Lines across that were recognised.
        across: usize,
        /// Lines along that were recognised.
        along: usize,
    },
    /// The lines that fit lie too far from the rules' lines.
    #[error(
        "the {camera} picture's lines lie {rms_px:.2} px (RMS) from those of a tennis court; \
             expected less than {max_px} px: another sport's lines, or another lens"
    )]
    Unlike {
        /// Whose.
        camera: Camera,
        /// RMS distance.
        rms_px: f64,
        /// What would be accepted.
        max_px: f64,
    },
    /// What the rig was sure of does not fit the lines.
    #[error(
        "the lines do not fit what the rig is sure of, how its cameras stand to each other: \
             {sigmas:.0} sigmas off; calibrate that again, or leave [calibration] out of it"
    )]
    Contradicted {
        /// How far off, in sigmas.
        sigmas: f64,
    },
    /// The equations have no solution.
    #[error("the lines seen do not tell where the cameras stand")]
    Open,
}

/// A rig, and how it was found.
#[derive(Debug, Clone)]
pub struct CourtCalibration {
    /// Rig, paint and residuals.
    pub fitted: Fitted,
    /// Each camera's pieces of lines.
    pub pieces: [Vec<Piece>; 2],
    /// The lines looked for.
    pub lines: [Line; LINES],
}

/// Least part of what should be seen that must be.
const SHARE_MIN: f64 = 0.5;

/// Lines are this near in the end, px RMS.
const RMS_MAX_PX: f64 = 0.5;

/// Cameras whose relation the lines see otherwise by so many sigmas were moved since: of six
/// numbers, one in a million by chance.
const CONTRADICTED_SIGMAS: f64 = 6.2;

/// How far from its last pose a line is looked for, round by round.
const WITHIN_PX: [f64; 3] = [3.0, 2.0, 2.0];

/// The rig under which both pictures show a court.
///
/// `start` says roughly where the cameras stand: within `Settings::range`. What it says of how sure
/// its lenses are, or how its cameras stand to each other, is believed. A rig without a court keeps
/// its lenses and relation; its cameras are taken to stand like those of the thesis.
///
/// # Errors
/// [`Refused`] says why.
pub fn from_pictures(
    pictures: [&Picture; 2],
    start: &Rig,
    settings: &Settings,
) -> Result<CourtCalibration, Refused> {
    let lines = paint::lines(settings.baseline_m, settings.others_m);
    let roughly = rough_poses(start).ok_or(Refused::Open)?;
    let prior = match start.covariance() {
        Some(covariance) => Prior::of_rig(start, covariance),
        None => Prior::of_lenses(start, &settings.lens),
    };
    let prior = prior.ok_or(Refused::Open)?;
    let mut poses = roughly;
    for camera in Camera::BOTH {
        let pose = &mut poses[camera.idx()];
        let picture = pictures[camera.idx()];
        *pose = guess_of(camera, picture, start, pose, settings, &lines)?.court_from_camera;
    }
    let [court_from_left, court_from_right] = poses;
    let mounting = Mounting::Court { court_from_left, court_from_right };
    let mut rig = start.with_mounting(mounting).map_err(|_| Refused::Open)?;
    let light = pictures.map(Picture::linear);
    let eyes = Camera::BOTH.map(|camera| rig.eye(camera).lens);
    let blur_px = [0, 1].map(|i| blur_of(&light[i], &eyes[i], &poses[i], &lines));
    let mut found = None;
    for within_px in WITHIN_PX {
        let pieces = Camera::BOTH.map(|camera| {
            let view = View {
                picture: &light[camera.idx()],
                lens: &rig.eye(camera).lens,
                court_from_camera: &rig.tracking_from(camera),
                within_px,
                blur_px: blur_px[camera.idx()],
                every: 1,
            };
            profiles::from_view(&view, &lines)
        });
        let seen = pieces.each_ref().map(Vec::as_slice);
        let fitted = fitted::from_pieces(seen, &lines, &rig, &prior, settings.paint_sigma_m)
            .ok_or(Refused::Open)?;
        rig = fitted.rig.clone();
        found = Some((fitted, pieces));
    }
    let (fitted, pieces) = found.ok_or(Refused::Open)?;
    if prior.has_relation() {
        // The lines by themselves: together with a wrong relation they would only look noisy.
        let lenses = prior.of_its_lenses().ok_or(Refused::Open)?;
        let seen = pieces.each_ref().map(Vec::as_slice);
        let alone = fitted::from_pieces(seen, &lines, &rig, &lenses, settings.paint_sigma_m);
        let alone = alone.ok_or(Refused::Open)?;
        let sigmas = apart_in_sigmas(start, &alone.rig).ok_or(Refused::Open)?;
        if sigmas > CONTRADICTED_SIGMAS {
            return Err(Refused::Contradicted { sigmas });
        }
    }
    for camera in Camera::BOTH {
        let rms_px = fitted.rms_px[camera.idx()];
        if rms_px > RMS_MAX_PX {
            return Err(Refused::Unlike { camera, rms_px, max_px: RMS_MAX_PX });
        }
    }
    Ok(CourtCalibration { fitted, pieces, lines })
}

/// How far the cameras' relation in one rig is from that in another, in sigmas of both.
fn apart_in_sigmas(a: &Rig, b: &Rig) -> Option<f64> {
    let off = adjustment::step_between(&relation(a), &relation(b));
    let of = |rig: &Rig| {
        let by_rig = relation_by_rig(rig);
        Some(by_rig * rig.covariance()? * by_rig.transpose())
    };
    let off = SVector::<f64, POSE>::from(off);
    Some(off.dot(&(of(a)? + of(b)?).cholesky()?.solve(&off)).sqrt())
}

/// Where the cameras are said to stand in the court; of a rig without one, as those of the thesis.
#[must_use]
pub fn rough_poses(start: &Rig) -> Option<[IsometryMatrix3<f64>; 2]> {
    match start.mounting() {
        Mounting::Court { court_from_left, court_from_right } => {
            Some([*court_from_left, *court_from_right])
        }
        Mounting::Stereo { right_from_left } => thesis_poses(right_from_left),
    }
}

/// A rig's cameras on the masts of the thesis, as far apart as they are and turned in alike.
fn thesis_poses(right_from_left: &IsometryMatrix3<f64>) -> Option<[IsometryMatrix3<f64>; 2]> {
    let left_from_right = right_from_left.inverse();
    let baseline_m = left_from_right.translation.vector.norm();
    // Turned in, each by half of what the cameras are turned against each other.
    let toe_in_rad = -0.5 * left_from_right.rotation.scaled_axis().y;
    let court_from_left =
        Site { baseline_m, toe_in_rad, ..Site::THESIS }.rig().ok()?.court_from_left()?;
    Some([court_from_left, court_from_left * left_from_right])
}

fn guess_of(
    camera: Camera,
    picture: &Picture,
    start: &Rig,
    roughly: &IsometryMatrix3<f64>,
    settings: &Settings,
    lines: &[Line; LINES],
) -> Result<Guess, Refused> {
    let lens = &start.eye(camera).lens;
    let got = [picture.width_px(), picture.height_px()];
    let expected = lens.image_px();
    if got != expected.map(|side| side as usize) {
        return Err(Refused::Size { camera, got, expected });
    }
    let ridges = ridges::from_picture(picture);
    let segments = segments::from_ridges(&ridges, got[0], got[1]);
    let found = guess::from_segments(&segments, &ridges, (lens, roughly), &settings.range, lines);
    let guess = found.ok_or(Refused::NoCourt { camera, n_segments: segments.len() })?;
    let [across, along] = guess.n_lines;
    if guess.share() < SHARE_MIN || across < 2 || along < 2 {
        let Guess { n_hit, n_visible, .. } = guess;
        return Err(Refused::WrongCourt { camera, n_hit, n_visible, across, along });
    }
    Ok(guess)
}

/// The blur that explains the pixels of some pieces best, by golden section.
fn blur_of(
    light: &Picture,
    lens: &Lens,
    court_from_camera: &IsometryMatrix3<f64>,
    lines: &[Line; LINES],
) -> f64 {
    const GOLDEN: f64 = 0.618_034;
    const EVERY: usize = 4;
    let cost = |blur_px: f64| {
        let within_px = WITHIN_PX[0];
        let view =
            View { picture: light, lens, court_from_camera, within_px, blur_px, every: EVERY };
        let pieces = profiles::from_view(&view, lines);
        let noise = |piece: &Piece| (piece.residual[0] / piece.residual[1]).sqrt() / piece.contrast;
        let mut noises: Vec<f64> = pieces.iter().map(noise).collect();
        if noises.is_empty() {
            return f64::INFINITY;
        }
        let middle = noises.len() / 2;
        *noises.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    let [mut low, mut high] = profiles::BLUR_PX.map(f64::ln);
    let [mut a, mut b] = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let (mut cost_a, mut cost_b) = (cost(a.exp()), cost(b.exp()));
    for _ in 0..6 {
        if cost_a <= cost_b {
            (high, b, cost_b) = (b, a, cost_a);
            a = high - GOLDEN * (high - low);
            cost_a = cost(a.exp());
        } else {
            (low, a, cost_a) = (a, b, cost_b);
            b = low + GOLDEN * (high - low);
            cost_b = cost(b.exp());
        }
    }
    (0.5 * (low + high)).exp()
}

#[cfg(test)]
mod tests;

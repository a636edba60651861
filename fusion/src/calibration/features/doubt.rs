//! A fit, its matches and how sure lenses and baseline are -> covariance of a rig's numbers.
//!
//! What the matches leave open, what the fit answers to an error of a lens (with the covariance
//! between the two, so that a later calibration that moves the lens moves the pose with it), and
//! along the baseline how sure its length is.

use crate::calibration::features::essential::Rays;
use crate::calibration::features::five::{self, Across, Five, Matched, UNKNOWNS};
use crate::calibration::features::matches::Match;
use crate::world::adjustment::{self, OPTICS, POSE, RigCovariance, first_of};
use crate::world::camera::Lens;
use crate::world::rig::Rig;
use nalgebra::{DMatrix, SMatrix, SVector, Vector3};
use shm_layout::Camera;
use std::collections::BTreeSet;

/// Numbers of two lenses.
const LENSES: usize = 2 * OPTICS;

/// Steps of the derivatives by a lens' numbers.
const STEPS: [f64; OPTICS] = [0.1, 0.1, 0.1, 0.1, 1e-4, 1e-4, 1e-5, 1e-5, 1e-4];

/// Side of the parts of the picture that are left out one by one: things seen in one part, a trunk
/// or a corner of the court, are wrong together.
const PART_PX: f64 = 40.0;

/// Matches are wrong together in more ways than these: with this, the middle one of 17 simulated
/// rigs is as far off as it says (chi-squared of five numbers 4.3; without it 8.5).
const TOGETHER: f64 = 2.0;

/// Rays of matches; None where a lens has no inverse.
#[must_use]
pub fn rays_of(lenses: [&Lens; 2], matches: &[Match]) -> Option<Vec<Rays>> {
    let rays = |found: &Match| {
        let [left, right] = lenses;
        Some(Rays { left: left.ray_from_raw(found.left)?, right: right.ray_from_raw(found.right)? })
    };
    matches.iter().map(rays).collect()
}

/// Covariance of the five unknowns by what becomes of them when a part of the picture is left out
/// (the jackknife; Tukey 1958). Few matches are near and hold the baseline's direction, many far
/// ones tell how good a match is: residuals alone would be much too sure.
#[must_use]
pub fn by_parts(
    five: &Five,
    matched: &Matched<'_>,
    matches: &[Match],
) -> Option<SMatrix<f64, UNKNOWNS, UNKNOWNS>> {
    let part = |m: &Match| [m.left.x_px, m.left.y_px].map(|v| (v / PART_PX) as i64);
    let parts: BTreeSet<[i64; 2]> = matches.iter().map(part).collect();
    let across = Across::of(&five.left_from_right.translation.vector);
    let mut sum = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
    for left_out in &parts {
        let kept = matched.rays.iter().zip(matches).filter(|(_, m)| part(m) != *left_out);
        let rays: Vec<Rays> = kept.map(|(rays, _)| *rays).collect();
        let others = Matched { rays: &rays, ..*matched };
        let without = five::fitted(others, &five.left_from_right, five.sigma_px)?.left_from_right;
        let [a, b, c, shift @ ..] = adjustment::step_between(&five.left_from_right, &without);
        let shift = Vector3::from(shift);
        let change = SVector::from([a, b, c, shift.dot(&across.first), shift.dot(&across.second)]);
        sum += change * change.transpose();
    }
    let n = parts.len() as f64;
    Some(sum * ((n - 1.0) / n))
}

/// Of a rig without a court, whose right camera stands as the fit says at the rig's distance.
#[must_use]
pub fn covariance_of(
    rig: &Rig,
    (five, matches): (&Five, &[Match]),
    lenses: &DMatrix<f64>,
    baseline_sigma_m: f64,
) -> Option<RigCovariance> {
    let response = response_to_lenses(rig, five, matches)?;
    let lens = |camera| &rig.eye(camera).lens;
    let rays = rays_of([lens(Camera::Left), lens(Camera::Right)], matches)?;
    let matched = Matched { rays: &rays, focal_px: focal_px(rig) };
    let by_lenses = response * lenses;
    let by_matches = (five.covariance + by_parts(five, &matched, matches)?) * TOGETHER;
    let of_five = by_matches + &by_lenses * response.transpose();
    let along = five.left_from_right.translation.vector;
    let across = Across::of(&along);
    let baseline_m = rig.right_from_left().translation.vector.norm();
    let mut pose_by_five = SMatrix::<f64, POSE, UNKNOWNS>::zeros();
    pose_by_five.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    pose_by_five.fixed_view_mut::<3, 1>(3, 3).copy_from(&(across.first * baseline_m));
    pose_by_five.fixed_view_mut::<3, 1>(3, 4).copy_from(&(across.second * baseline_m));
    let mut of_pose = pose_by_five * of_five * pose_by_five.transpose();
    let mut shift = of_pose.fixed_view_mut::<3, 3>(3, 3);
    shift += along * along.transpose() * baseline_sigma_m.powi(2);
    let pose_and_lenses = pose_by_five * by_lenses;
    let mut covariance = RigCovariance::zeros();
    let pose = first_of(Camera::Right) + OPTICS;
    covariance.fixed_view_mut::<POSE, POSE>(pose, pose).copy_from(&of_pose);
    let place = |i: usize| first_of(Camera::BOTH[i / OPTICS]) + i % OPTICS;
    for i in 0..LENSES {
        for j in 0..LENSES {
            covariance[(place(i), place(j))] = lenses[(i, j)];
        }
        for k in 0..POSE {
            covariance[(pose + k, place(i))] = pose_and_lenses[(k, i)];
            covariance[(place(i), pose + k)] = pose_and_lenses[(k, i)];
        }
    }
    Some(covariance)
}

/// How the five unknowns move when a lens' number is wrong by one.
fn response_to_lenses(
    rig: &Rig,
    five: &Five,
    matches: &[Match],
) -> Option<SMatrix<f64, UNKNOWNS, LENSES>> {
    let lenses = Camera::BOTH.map(|camera| rig.eye(camera).lens);
    let rays = rays_of([&lenses[0], &lenses[1]], matches)?;
    let focal_px = focal_px(rig);
    let matched = Matched { rays: &rays, focal_px };
    let mut response = SMatrix::<f64, UNKNOWNS, LENSES>::zeros();
    for i in 0..LENSES {
        let camera = Camera::BOTH[i / OPTICS];
        let step = STEPS[i % OPTICS];
        let distances = |sign: f64| {
            let mut lenses = lenses;
            let mut optics = lenses[camera.idx()].optics();
            optics[i % OPTICS] += sign * step;
            lenses[camera.idx()] = lenses[camera.idx()].with_optics(camera.name(), optics).ok()?;
            let rays = rays_of([&lenses[0], &lenses[1]], matches)?;
            Some(Matched { rays: &rays, focal_px }.distances_px(&five.left_from_right))
        };
        let (plus, minus) = (distances(1.0)?, distances(-1.0)?);
        let changes: Vec<f64> =
            plus.iter().zip(&minus).map(|(plus, minus)| (plus - minus) / (2.0 * step)).collect();
        response.set_column(i, &(-five.covariance * matched.pull(five, &changes)));
    }
    Some(response)
}

/// Mean focal length of each camera.
#[must_use]
pub fn focal_px(rig: &Rig) -> [f64; 2] {
    Camera::BOTH.map(|camera| {
        let [fx, fy] = rig.eye(camera).lens.focal_px();
        0.5 * (fx + fy)
    })
}

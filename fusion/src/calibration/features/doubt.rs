//! A fit, its matches and how sure lenses and baseline are -> covariance of a rig's numbers.
//!
//! What the matches leave open, what the fit answers to an error of a lens (with the covariance
//! between the two, so that a later calibration that moves the lens moves the pose with it), and
//! along the baseline how sure its length is. Matches whose patches overlap share their pixels and
//! their errors: they count as one.

use crate::calibration::features::essential::Rays;
use crate::calibration::features::five::{Across, Five, Matched, UNKNOWNS};
use crate::calibration::features::matches::Match;
use crate::world::adjustment::{OPTICS, POSE, RIG, RigCovariance, first_of};
use crate::world::camera::Lens;
use crate::world::rig::Rig;
use nalgebra::{DMatrix, SMatrix};
use shm_layout::Camera;
use std::collections::BTreeSet;

/// Numbers of two lenses.
const LENSES: usize = 2 * OPTICS;

/// Side of a patch.
const PATCH_PX: f64 = 15.0;

/// Steps of the derivatives by a lens' numbers.
const STEPS: [f64; OPTICS] = [0.1, 0.1, 0.1, 0.1, 1e-4, 1e-4, 1e-5, 1e-5, 1e-4];

/// Rays of matches; None where a lens has no inverse.
#[must_use]
pub fn rays_of(lenses: [&Lens; 2], matches: &[Match]) -> Option<Vec<Rays>> {
    let rays = |found: &Match| {
        let [left, right] = lenses;
        Some(Rays { left: left.ray_from_raw(found.left)?, right: right.ray_from_raw(found.right)? })
    };
    matches.iter().map(rays).collect()
}

/// How many patches of the left picture do not overlap.
#[must_use]
pub fn n_independent(matches: &[Match]) -> usize {
    let cell = |v: f64| (v / PATCH_PX) as i64;
    let cells: BTreeSet<[i64; 2]> =
        matches.iter().map(|m| [cell(m.left.x_px), cell(m.left.y_px)]).collect();
    cells.len()
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
    let shared = matches.len() as f64 / n_independent(matches).max(1) as f64;
    let by_lenses = &response * lenses;
    let of_five = five.covariance * shared + &by_lenses * response.transpose();
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
    debug_assert_eq!(covariance.nrows(), RIG);
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

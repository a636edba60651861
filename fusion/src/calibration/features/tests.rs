//! Points of a pretended scene, their rays through both cameras, and the pose found from them.

use super::consensus::{self, Search};
use super::doubt;
use super::essential::{self, Rays};
use super::five::{self, Across, Matched, UnitPose};
use super::flat::{self, Flat};
use super::matches::Match;
use crate::calibration::picture::Picture;
use crate::pretend;
use crate::world::adjustment::{self, OPTICS, first_of};
use nalgebra::{DMatrix, IsometryMatrix3, Point3, Rotation3, Translation3, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use shm_layout::Camera;

const FOCAL_PX: f64 = 1240.0;

/// The thesis' rig: 4 m apart, 6° toe-in each, and not quite level.
fn truth() -> UnitPose {
    let rotation = Rotation3::new(Vector3::new(0.02, -0.21, -0.03));
    let centre = Vector3::new(3.97, -0.1, 0.45).normalize();
    IsometryMatrix3::from_parts(Translation3::from(centre), rotation)
}

/// What is believed beforehand: 2° off.
fn search(within_px: f64) -> Search {
    let roughly = five::moved(&truth(), &[0.02, 0.02, -0.02, 0.03, -0.03].into());
    Search { within_px, roughly, turn_max_rad: 0.14, direction_max_rad: 0.35 }
}

/// A scene: depth in baselines of a point seen at x and y, both -1 to 1.
fn rays(
    n: usize,
    sigma_px: f64,
    random: &mut impl Rng,
    depth: impl Fn(f64, f64, f64) -> f64,
) -> Vec<Rays> {
    let noise = Normal::new(0.0, sigma_px / FOCAL_PX).unwrap();
    let mut seen = |ray: Vector3<f64>| {
        Vector3::new(
            ray.x / ray.z + noise.sample(random),
            ray.y / ray.z + noise.sample(random),
            1.0,
        )
    };
    let mut draws = ChaCha8Rng::seed_from_u64(5);
    (0..n)
        .map(|_| {
            let [x, y, chance] = [0, 1, 2].map(|_| draws.random_range(-1.0..1.0));
            let left = Vector3::new(0.25 * x, 0.18 * y, 1.0);
            let point = Point3::from(left * depth(x, y, chance));
            Rays { left: seen(left), right: seen((truth().inverse() * point).coords) }
        })
        .collect()
}

/// Trees behind, the court in front.
fn several_depths(_: f64, y: f64, chance: f64) -> f64 {
    if y < 0.0 { 9.0 + 2.0 * chance } else { 8.0 - 5.0 * y + 0.5 * chance }
}

/// Turn and direction between a pose and the truth, rad.
fn errors(pose: &UnitPose) -> [f64; 2] {
    let [x, y, z, ..] = adjustment::step_between(&truth(), pose);
    let turn = Vector3::new(x, y, z).norm();
    let direction = pose.translation.vector.cross(&truth().translation.vector).norm().asin();
    [turn, direction]
}

#[test]
fn eight_exact_points_give_the_pose_exactly() {
    let rays = rays(8, 0.0, &mut ChaCha8Rng::seed_from_u64(1), several_depths);
    let essential = essential::from_rays(&rays).unwrap();
    for Rays { left, right } in &rays {
        assert!((right.transpose() * essential * left)[0].abs() < 1e-9);
    }
    let (right_from_left, n_ahead) = essential::pose_of(&essential, &rays).unwrap();
    assert_eq!(n_ahead, 8);
    let [turn, direction] = errors(&right_from_left.inverse());
    assert!(turn < 1e-6 && direction < 1e-6, "{turn} {direction}");
    let [left, right] = essential::depths(&right_from_left, &rays[0]).unwrap();
    let again = right_from_left * Point3::from(rays[0].left * left);
    assert!((again.coords - rays[0].right * right).norm() < 1e-6);
    assert_eq!(essential::from_rays(&rays[..7]), None);
}

#[test]
fn the_essential_matrix_of_a_pose_has_that_pose() {
    let rays = rays(8, 0.0, &mut ChaCha8Rng::seed_from_u64(1), several_depths);
    let essential = essential::from_pose(&truth().inverse());
    let (right_from_left, _) = essential::pose_of(&essential, &rays).unwrap();
    let [turn, direction] = errors(&right_from_left.inverse());
    assert!(turn < 1e-6 && direction < 1e-6, "{turn} {direction}");
}

#[test]
fn points_of_a_plane_leave_eight_points_open() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    // The far end of a fence: depth 1 / (a + b x + c y) is a plane.
    let rays = rays(40, 0.0, &mut random, |x, y, _| 8.0 / (1.0 + 0.1 * x + 0.05 * y));
    assert_eq!(essential::from_rays(&rays), None);
}

#[test]
fn noise_comes_out_as_large_as_the_covariance_says() {
    // Squares of the errors in sigmas, 5 numbers, 40 draws: mean 5, and 5 % of it is a third of
    // the sigma of such a mean, √(2·5/40) = 0.5.
    let mut sum = 0.0;
    for seed in 0..40 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let rays = rays(300, 0.2, &mut random, several_depths);
        let matched = Matched { rays: &rays, focal_px: [FOCAL_PX; 2] };
        let five = five::fitted(matched, &search(1.0).roughly, 1.0).unwrap();
        assert!((five.sigma_px / 0.2 - 1.0).abs() < 0.25, "{}", five.sigma_px);
        let [x, y, z, ..] = adjustment::step_between(&five.left_from_right, &truth());
        let off = truth().translation.vector - five.left_from_right.translation.vector;
        let across = Across::of(&five.left_from_right.translation.vector);
        let off = [x, y, z, off.dot(&across.first), off.dot(&across.second)];
        let off = nalgebra::SVector::<f64, 5>::from(off);
        sum += off.dot(&(five.covariance.try_inverse().unwrap() * off));
    }
    let mean = sum / 40.0;
    assert!((3.5..7.0).contains(&mean), "{mean}");
}

#[test]
fn the_pose_is_found_among_as_many_false_matches() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut rays = rays(120, 0.1, &mut random, several_depths);
    for _ in 0..120 {
        let mut somewhere = || {
            let [x, y] = [0.25, 0.18].map(|half| random.random_range(-half..half));
            Vector3::new(x, y, 1.0)
        };
        rays.push(Rays { left: somewhere(), right: somewhere() });
    }
    let matched = Matched { rays: &rays, focal_px: [FOCAL_PX; 2] };
    let found = consensus::of_matches(matched, &search(0.5)).unwrap();
    let n_right = found.explained.iter().filter(|i| **i < 120).count();
    assert!(n_right > 110 && found.explained.len() - n_right < 5, "{n_right}");
    let [turn, direction] = errors(&found.five.left_from_right);
    assert!(turn < 3e-3 && direction < 8e-3, "{turn} {direction}");
    let kept: Vec<Rays> = found.explained.iter().map(|&i| rays[i]).collect();
    let matched = Matched { rays: &kept, ..matched };
    assert_eq!(flat::instead_of(&found.five, &matched, rays.len() - kept.len()), None);
}

#[test]
fn false_matches_alone_agree_on_little() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut somewhere = || {
        let [x, y] = [0.25, 0.18].map(|half| random.random_range(-half..half));
        Vector3::new(x, y, 1.0)
    };
    let rays: Vec<Rays> =
        (0..100).map(|_| Rays { left: somewhere(), right: somewhere() }).collect();
    let matched = Matched { rays: &rays, focal_px: [FOCAL_PX; 2] };
    let n = consensus::of_matches(matched, &search(1.0)).map_or(0, |found| found.explained.len());
    assert!(n < super::EXPLAINED_MIN, "{n}");
}

/// What is said of a scene of which every match is right.
fn flat_of(depth: impl Fn(f64, f64, f64) -> f64) -> Option<Flat> {
    let rays = rays(150, 0.1, &mut ChaCha8Rng::seed_from_u64(2), depth);
    let matched = Matched { rays: &rays, focal_px: [FOCAL_PX; 2] };
    let five = five::fitted(matched, &truth(), 0.1).unwrap();
    flat::instead_of(&five, &matched, 0)
}

#[test]
fn a_plane_is_told_from_a_scene_and_a_far_one_from_a_near_one() {
    assert_eq!(flat_of(|x, y, _| 8.0 / (1.0 + 0.1 * x + 0.05 * y)), Some(Flat::Plane));
    assert_eq!(flat_of(|_, _, chance| 1e6 * (2.0 + chance)), Some(Flat::Far));
    assert_eq!(flat_of(several_depths), None);
}

#[test]
fn pictures_that_cannot_be_of_two_cameras_are_refused() {
    let rig = pretend::reference_rig();
    let grain = |seed: u64| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let luma = (0..640 * 480).map(|_| random.random_range(20.0..200.0)).collect();
        Picture::new(640, 480, luma)
    };
    let of = |left: &Picture, right: &Picture| {
        super::from_pictures([left, right], &rig, &super::Settings::default()).unwrap_err()
    };
    assert_eq!(of(&grain(1), &grain(1)), super::Refused::Same);
    let small = Picture::new(4, 2, vec![0.0; 8]);
    assert!(matches!(of(&grain(1), &small), super::Refused::Size { .. }));
    assert!(matches!(of(&grain(1), &grain(2)), super::Refused::Few { .. }));
    let empty = |luma| Picture::new(640, 480, vec![luma; 640 * 480]);
    assert!(matches!(of(&empty(20.0), &empty(90.0)), super::Refused::Few { n: 0, .. }));
    let settings = super::Settings { baseline_m: Some(f64::NAN), ..super::Settings::default() };
    let refused = super::from_pictures([&grain(1), &grain(2)], &rig, &settings).unwrap_err();
    assert!(matches!(refused, super::Refused::Baseline { .. }));
}

#[test]
fn the_pose_answers_to_a_lens_as_the_covariance_says() {
    let rig = pretend::courtless_rig();
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let seen = |point: Point3<f64>| {
        let pixel = |camera| rig.raw_from_tracking(camera, &point);
        Some(Match { left: pixel(Camera::Left)?, right: pixel(Camera::Right)?, is_ground: false })
    };
    let matches: Vec<Match> = (0..200)
        .filter_map(|_| {
            let [x, y, z] = [0.2, 0.15, 8.0].map(|half| random.random_range(-half..half));
            seen(Point3::from(Vector3::new(x, y, 1.0) * (24.0 + z)))
        })
        .collect();
    let fitted_through = |lenses: [&crate::world::camera::Lens; 2]| {
        let rays = doubt::rays_of(lenses, &matches).unwrap();
        let matched = Matched { rays: &rays, focal_px: doubt::focal_px(&rig) };
        five::fitted(matched, &super::unit_pose(&rig), 0.1).unwrap()
    };
    let [left, right] = Camera::BOTH.map(|camera| rig.eye(camera).lens);
    let five = fitted_through([&left, &right]);
    // Of all lenses' numbers the right centre's column and row alone are in doubt, by 0.1 px.
    for number in [2, 3] {
        let mut lenses = DMatrix::zeros(2 * OPTICS, 2 * OPTICS);
        lenses[(OPTICS + number, OPTICS + number)] = 0.01;
        let covariance = doubt::covariance_of(&rig, (&five, &matches), &lenses, 0.02).unwrap();
        let mut optics = right.optics();
        optics[number] += 0.1;
        let other = fitted_through([&left, &right.with_optics("right", optics).unwrap()]);
        let step = adjustment::step_between(&five.left_from_right, &other.left_from_right);
        let first = first_of(Camera::Right);
        for (k, step) in step.iter().enumerate() {
            let unit = if k < 3 { 1.0 } else { 4.0 };
            let expected = covariance[(first + OPTICS + k, first + number)] / 0.1;
            assert!((unit * step - expected).abs() < 2e-6, "{k} by {number}: {step} {expected}");
        }
        let along = super::unit_pose(&rig).translation.vector;
        let shift = covariance.fixed_view::<3, 3>(first + OPTICS + 3, first + OPTICS + 3);
        let baseline_sigma_m = (along.transpose() * shift * along)[0].sqrt();
        assert!((baseline_sigma_m - 0.02).abs() < 1e-6, "{baseline_sigma_m}");
    }
}

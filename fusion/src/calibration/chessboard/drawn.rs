//! Boards that are not there: their pictures, and where a camera would see their corners.

use super::super::picture::Picture;
use super::Board;
use super::bundle::State;
use super::saddles::smoothed;
use crate::world::camera::{Lens, RawPixel};
use nalgebra::{IsometryMatrix3, Point2, Point3, Rotation3, Translation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use shm_layout::Camera;

/// Sigma of a good lens.
const LENS_BLUR_PX: f64 = 0.5;

pub const IMAGE_PX: [u32; 2] = [640, 480];

pub fn lens(distortion: [f64; 5]) -> Lens {
    Lens::new("left", IMAGE_PX, [1240.0, 1235.0], [325.0, 236.0], distortion).unwrap()
}

/// Turned about the camera's axes, its middle at a place in the camera's frame.
pub fn board_at(board: &Board, turn_rad: [f64; 3], middle_m: [f64; 3]) -> IsometryMatrix3<f64> {
    let [roll, pitch, yaw] = turn_rad;
    let turn = Rotation3::from_euler_angles(pitch, yaw, roll);
    let points_m = board.points_m();
    let middle = points_m.last().unwrap().coords / 2.0;
    IsometryMatrix3::from_parts(Translation3::from(Vector3::from(middle_m) - turn * middle), turn)
}

/// A board of white and black squares with a white margin before something grey, as sharp as a
/// lens makes it.
pub fn picture(
    board: &Board,
    lens: &Lens,
    camera_from_board: &IsometryMatrix3<f64>,
    noise: f32,
    rng: &mut ChaCha8Rng,
) -> Picture {
    const N_SUB: u32 = 16;
    const MARGIN: f64 = 0.6;
    let [width, height] = lens.image_px().map(|side| side as usize);
    let (fx, cx) = (lens.focal_px(), lens.center_px());
    let board_from_camera = camera_from_board.inverse();
    let centre = board_from_camera * Point3::origin();
    let last = board.points_m().last().unwrap().xy() / board.square_m;
    let brightness = |x_px: f64, y_px: f64| {
        let ray = Vector3::new((x_px - cx[0]) / fx[0], (y_px - cx[1]) / fx[1], 1.0);
        let ray = board_from_camera * ray;
        let at = centre - ray * (centre.z / ray.z);
        let at = Point2::new(at.x, at.y) / board.square_m;
        let is_within = |v: f64, last: f64, more: f64| v > -1.0 - more && v < last + 1.0 + more;
        let is_on = |more| is_within(at.x, last.x, more) && is_within(at.y, last.y, more);
        match (is_on(0.0), is_on(MARGIN)) {
            (true, _) if (at.x.floor() + at.y.floor()).rem_euclid(2.0) < 0.5 => 40.0,
            (_, true) => 200.0,
            _ => 100.0,
        }
    };
    // No two in a row or column, or edges along those would jump by a quarter pixel.
    let mixed = |i: u32| i.reverse_bits() >> (32 - N_SUB.ilog2());
    let sub = |i: u32| (f64::from(i) + 0.5) / f64::from(N_SUB) - 0.5;
    let luma = (0..width * height).map(|i| {
        let (x, y) = ((i % width) as f64, (i / width) as f64);
        let subs = (0..N_SUB).map(|i| (sub(i), sub(mixed(i))));
        let sum: f64 = subs.map(|(u, v)| brightness(x + u, y + v)).sum();
        (sum / f64::from(N_SUB)) as f32
    });
    let sharp = Picture::new(width, height, luma.collect());
    let noise = Normal::new(0.0, noise).unwrap();
    let grain = |luma: &f32| (luma + noise.sample(rng)).round().clamp(0.0, 255.0);
    Picture::new(width, height, smoothed(&sharp, LENS_BLUR_PX).luma().iter().map(grain).collect())
}

/// Two cameras 4 m apart that look at the same place, boards before them, and where each camera
/// sees the corners, with noise.
pub fn pair(
    board: &Board,
    lenses: [Lens; 2],
    n_views: usize,
    sigma_px: f64,
    rng: &mut ChaCha8Rng,
) -> (State, Vec<[Option<Vec<RawPixel>>; 2]>) {
    let turn = Rotation3::from_euler_angles(0.01, -0.2, 0.02);
    let left_from_right = IsometryMatrix3::from_parts(Translation3::new(3.98, 0.05, 0.4), turn);
    let mut state = State { lenses, left_from_right, left_from_board: Vec::new() };
    let mut views = Vec::new();
    let noise = Normal::new(0.0, sigma_px).unwrap();
    while views.len() < n_views {
        let z = rng.random_range(8.0..22.0);
        let mut within = |size: f64| rng.random_range(-size..size);
        let turn = [within(0.4), within(0.6), within(0.6)];
        let middle = [2.0 + within(0.2) * z, within(0.15) * z, z];
        state.left_from_board.push(board_at(board, turn, middle));
        let view = state.left_from_board.len() - 1;
        let seen = Camera::BOTH.map(|camera| {
            let lens = &lenses[camera.idx()];
            let camera_from_board = state.camera_from_board(camera, view);
            let mut off = || noise.sample(rng);
            let seen = board.points_m().into_iter().map(|point| {
                let told = lens.raw_from_point(&(camera_from_board * point))?;
                let seen = RawPixel { x_px: told.x_px + off(), y_px: told.y_px + off() };
                lens.contains(seen).then_some(seen)
            });
            seen.collect::<Option<Vec<_>>>()
        });
        if seen.iter().all(Option::is_some) {
            views.push(seen);
        } else {
            state.left_from_board.pop();
        }
    }
    (state, views)
}

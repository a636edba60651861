//! Salient points of both pictures -> pairs that show the same thing, to a fraction of a pixel.
//!
//! Where a rig roughly is what it is said to be, a point of the left picture is seen near a segment
//! in the right one: from where it would be if it were near to where it would be if it were far
//! away. Of the right picture's salient points there, the one that looks most alike; kept if it is
//! by much the best, and if from the right picture the left point is the best, too. A patch is
//! compared as if it faced the cameras, and as if it lay on the ground: four metres aside the
//! ground is sheared by more than a pixel per row.

use crate::calibration::features::corners::Corner;
use crate::calibration::features::patch::{self, Patch, Place};
use crate::calibration::picture::Picture;
use crate::world::camera::RawPixel;
use crate::world::rig::Rig;
use nalgebra::{IsometryMatrix3, Matrix2, Point3, Vector2, Vector3};
use shm_layout::Camera;

/// How the cameras are thought to stand.
#[derive(Debug, Clone)]
pub struct Guess<'a> {
    /// Lenses, and how the cameras stand to each other.
    pub rig: &'a Rig,
    /// Where the left camera stands on the ground: z up, ground at 0.
    pub court_from_left: IsometryMatrix3<f64>,
    /// How far from its segment a point may be seen.
    pub beside_px: f64,
    /// How far along the segment a point of the ground may be from where the guess has it.
    pub along_px: f64,
}

/// The same point in both pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// In the left picture.
    pub left: RawPixel,
    /// In the right picture.
    pub right: RawPixel,
    /// Whether it was found as a patch of the ground.
    pub is_ground: bool,
}

/// Nothing nearer than this is looked for.
const NEAR_M: f64 = 5.0;

/// As good as at infinity: a hundredth of a pixel of disparity is 0.25 m at this distance.
const FAR_M: f64 = 1e5;

/// Where shears are taken: a patch that faces the cameras, and how far the ground is looked at.
const FACING_M: f64 = 25.0;
const GROUND_MAX_M: f64 = 60.0;

/// Least correlation, and how much farther than the best the next one must be.
const ALIKE_MIN: f32 = 0.6;
const RATIO: f32 = 0.9;

/// Salient points this near to each other are the same.
const SAME_PX: f64 = 4.0;

/// A salient point, its ray in pixels of an ideal camera, and its surroundings.
struct Spot {
    at: Vector2<f64>,
    ideal: Vector2<f64>,
}

/// How a left spot may be seen in the right picture.
struct Sight {
    is_ground: bool,
    shear: Matrix2<f64>,
    patch: Patch,
    /// Ideal pixels of the right camera: near and far end.
    segment: [Vector2<f64>; 2],
    /// Where the ground would be.
    ground: Option<Vector2<f64>>,
}

/// The best of many, and the next one that is not beside it.
#[derive(Clone, Copy)]
struct Best {
    likeness: f32,
    next: f32,
    idx: usize,
    sight_idx: usize,
}

/// Pairs of salient points of two blurred pictures.
#[must_use]
pub fn between(pictures: [&Picture; 2], corners: [&[Corner]; 2], guess: &Guess<'_>) -> Vec<Match> {
    let [lefts, rights] = Camera::BOTH.map(|camera| spots(guess, camera, corners[camera.idx()]));
    let identity = Matrix2::identity();
    let patches: Vec<Option<Patch>> =
        rights.iter().map(|spot| patch::around(pictures[1], &spot.at, &identity)).collect();
    let sights: Vec<Vec<Sight>> =
        lefts.iter().map(|spot| sights_of(pictures[0], spot, guess)).collect();
    let mut of_left: Vec<Option<Best>> = vec![None; lefts.len()];
    let mut of_right: Vec<Option<Best>> = vec![None; rights.len()];
    for (i, sights) in sights.iter().enumerate() {
        for (sight_idx, sight) in sights.iter().enumerate() {
            for (j, patch) in patches.iter().enumerate() {
                let Some(patch) = patch else { continue };
                if !sight.may_be(&rights[j].ideal, guess) {
                    continue;
                }
                let likeness = patch::likeness(&sight.patch, patch);
                if likeness < 0.5 {
                    continue;
                }
                let new = |idx| Best { likeness, next: 0.0, idx, sight_idx };
                let is_same =
                    |a: usize, b: usize, of: &[Spot]| (of[a].at - of[b].at).norm() < SAME_PX;
                better(&mut of_left[i], new(j), |a, b| is_same(a, b, &rights));
                better(&mut of_right[j], new(i), |a, b| is_same(a, b, &lefts));
            }
        }
    }
    let mut found = Vec::new();
    for (i, best) in of_left.iter().enumerate() {
        let Some(best) = best else { continue };
        let is_mutual = of_right[best.idx].is_some_and(|back| back.idx == i && back.is_clear());
        if !(is_mutual && best.is_clear()) {
            continue;
        }
        let sight = &sights[i][best.sight_idx];
        let guess = Place { at: rights[best.idx].at, shear: sight.shear };
        if let Some(place) = patch::finely(pictures, &lefts[i].at, &guess, !sight.is_ground) {
            let pixel = |at: Vector2<f64>| RawPixel { x_px: at.x, y_px: at.y };
            found.push(Match {
                left: pixel(lefts[i].at),
                right: pixel(place.at),
                is_ground: sight.is_ground,
            });
        }
    }
    found
}

impl Best {
    /// By correlation c, two patches are √(2 − 2c) apart.
    fn is_clear(&self) -> bool {
        let apart = |likeness: f32| (1.0 - likeness).max(0.0).sqrt();
        self.likeness > ALIKE_MIN && apart(self.likeness) < RATIO * apart(self.next)
    }
}

fn better(best: &mut Option<Best>, new: Best, is_same: impl Fn(usize, usize) -> bool) {
    match best {
        None => *best = Some(new),
        Some(old) if new.likeness > old.likeness => {
            let next = if is_same(old.idx, new.idx) { old.next } else { old.likeness };
            *best = Some(Best { next, ..new });
        }
        Some(old) if !is_same(old.idx, new.idx) => old.next = old.next.max(new.likeness),
        Some(_) => {}
    }
}

fn spots(guess: &Guess<'_>, camera: Camera, corners: &[Corner]) -> Vec<Spot> {
    let lens = &guess.rig.eye(camera).lens;
    let spot = |corner: &Corner| {
        let (x_px, y_px) = (corner.x as f64, corner.y as f64);
        let ideal = ideal(guess, camera, &lens.ray_from_raw(RawPixel { x_px, y_px })?)?;
        Some(Spot { at: Vector2::new(x_px, y_px), ideal })
    };
    corners.iter().filter_map(spot).collect()
}

/// Where a camera without distortion would see a direction, from the middle of its picture.
fn ideal(guess: &Guess<'_>, camera: Camera, ray: &Vector3<f64>) -> Option<Vector2<f64>> {
    let [fx, fy] = guess.rig.eye(camera).lens.focal_px();
    (ray.z > 1e-3 * ray.norm()).then(|| Vector2::new(fx * ray.x / ray.z, fy * ray.y / ray.z))
}

/// A plane n·x = d of the left camera's frame.
struct Plane {
    normal: Vector3<f64>,
    offset_m: f64,
}

impl Plane {
    fn met_by(&self, ray: &Vector3<f64>) -> Option<Point3<f64>> {
        let depth = self.offset_m / self.normal.dot(ray);
        (depth.is_finite() && depth > 0.0).then(|| Point3::from(ray * depth))
    }
}

fn sights_of(picture: &Picture, spot: &Spot, guess: &Guess<'_>) -> Vec<Sight> {
    let lens = &guess.rig.eye(Camera::Left).lens;
    let right_from_left = guess.rig.right_from_left();
    let pixel = |at: &Vector2<f64>| lens.ray_from_raw(RawPixel { x_px: at.x, y_px: at.y });
    let Some(ray) = pixel(&spot.at) else { return Vec::new() };
    let seen_at = |depth_m: f64| {
        ideal(guess, Camera::Right, &(right_from_left * Point3::from(ray * depth_m)).coords)
    };
    let (Some(near), Some(far)) = (seen_at(NEAR_M), seen_at(FAR_M)) else { return Vec::new() };
    let ahead = (Vector3::z() + right_from_left.inverse() * Vector3::z()).normalize();
    let facing = Plane { normal: ahead, offset_m: FACING_M };
    let left_from_court = guess.court_from_left.inverse();
    let up = left_from_court * Vector3::z();
    let ground = Plane { normal: up, offset_m: up.dot(&left_from_court.translation.vector) };
    let mut sights = Vec::new();
    for (is_ground, plane) in [(false, &facing), (true, &ground)] {
        let Some(point) = plane.met_by(&ray) else { continue };
        if is_ground && !(NEAR_M..GROUND_MAX_M).contains(&point.z) {
            continue;
        }
        let Some(shear) = shear_of(guess, plane, &spot.at) else { continue };
        let Some(back) = shear.try_inverse() else { continue };
        let Some(patch) = patch::around(picture, &spot.at, &back) else { continue };
        let at = right_from_left * point;
        let ground = if is_ground { ideal(guess, Camera::Right, &at.coords) } else { None };
        sights.push(Sight { is_ground, shear, patch, segment: [near, far], ground });
    }
    sights
}

/// How a plane's surroundings of a left pixel are sheared in the right picture.
fn shear_of(guess: &Guess<'_>, plane: &Plane, at: &Vector2<f64>) -> Option<Matrix2<f64>> {
    let seen = |offset: Vector2<f64>| {
        let at = at + offset;
        let lens = &guess.rig.eye(Camera::Left).lens;
        let ray = lens.ray_from_raw(RawPixel { x_px: at.x, y_px: at.y })?;
        let point = guess.rig.right_from_left() * plane.met_by(&ray)?;
        let raw = guess.rig.eye(Camera::Right).lens.raw_from_point(&point)?;
        Some(Vector2::new(raw.x_px, raw.y_px))
    };
    let (x, y) = (Vector2::x(), Vector2::y());
    let shear =
        Matrix2::from_columns(&[(seen(x)? - seen(-x)?) / 2.0, (seen(y)? - seen(-y)?) / 2.0]);
    // A plane seen almost from its edge tells nothing.
    let is_sane = (0.3..3.0).contains(&shear.determinant()) && shear.amax() < 5.0;
    is_sane.then_some(shear)
}

impl Sight {
    /// Whether a place of the right picture is within reach of the guess.
    fn may_be(&self, ideal: &Vector2<f64>, guess: &Guess<'_>) -> bool {
        let [near, far] = self.segment;
        let along = far - near;
        let part = ((ideal - near).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        let nearest = near + along * part;
        let off = ideal - nearest;
        // Beyond the far end lies what a guess that is turned has there.
        let is_beside = off.norm() <= guess.beside_px
            || (part == 1.0
                && off.dot(&along) <= guess.along_px * along.norm()
                && off.perp(&along).abs() <= guess.beside_px * along.norm());
        is_beside && self.ground.is_none_or(|ground| (ideal - ground).norm() <= guess.along_px)
    }
}

//! A rig -> what its cameras see of a level plane: polygons, and parts of the far half.
//!
//! The border of an image is a polygon of rays. A ray d from C meets the plane z = h at
//! `C + d (C_z - h)/(-d_z)`, so "in front", and "within these x and y", are half-spaces of d
//! (`(C_z - h) d_y + (y_max - C_y) d_z <= 0`): the polygon of rays is clipped by these (Sutherland
//! and Hodgman 1974), and no ray above the horizon is ever divided by. What both see is one polygon
//! clipped by the other, taken for convex, which a pinhole's is and a distorted one's nearly; the
//! parts are counted on a grid instead, with the lens itself.

use super::{Refused, seen};
use crate::world::camera::RawPixel;
use crate::world::court::{DOUBLES_HALF_WIDTH_M, LENGTH_M, NET_Y_M, SINGLES_HALF_WIDTH_M};
use crate::world::rig::Rig;
use nalgebra::{Point3, Vector3};
use shm_layout::Camera;

/// A polygon on a level plane: x and y.
pub type Polygon = Vec<[f64; 2]>;

/// What is looked at: x from, x to, y from, y to.
pub const SURROUNDINGS_M: [f64; 4] = [-14.0, 14.0, -3.0, 40.0];

/// Points on each side of an image.
const N_ON_SIDE: u32 = 24;

/// Distance of the grid that is counted.
const GRID_M: f64 = 0.1;

/// What is seen of a level plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Of the plane.
    pub height_m: f64,
    /// What the left camera sees.
    pub left: Polygon,
    /// What the right camera sees.
    pub right: Polygon,
    /// What both see.
    pub both: Polygon,
    /// Part of the far half, doubles: seen by left, right, both.
    pub of_doubles: [f64; 3],
    /// The same of singles.
    pub of_singles: [f64; 3],
}

/// Of a plane at a height.
///
/// # Errors
/// [`Refused::Distortion`].
pub fn of_plane(rig: &Rig, height_m: f64) -> Result<Coverage, Refused> {
    let [left, right] =
        [polygon(rig, Camera::Left, height_m)?, polygon(rig, Camera::Right, height_m)?];
    let both = clipped_by(&left, &right);
    let [of_doubles, of_singles] =
        [DOUBLES_HALF_WIDTH_M, SINGLES_HALF_WIDTH_M].map(|half_m| parts(rig, height_m, half_m));
    Ok(Coverage { height_m, left, right, both, of_doubles, of_singles })
}

fn polygon(rig: &Rig, camera: Camera, height_m: f64) -> Result<Polygon, Refused> {
    let pose = rig.tracking_from(camera);
    let lens = &rig.eye(camera).lens;
    let mut rays: Vec<Vector3<f64>> = Vec::new();
    for raw in border(lens.image_px()) {
        let ray = lens.ray_from_raw(raw).ok_or(Refused::Distortion { camera })?;
        rays.push(pose.rotation * ray);
    }
    let centre = pose.translation.vector;
    let above_m = centre.z - height_m;
    if above_m <= 0.0 {
        return Ok(Vec::new());
    }
    let [x_min, x_max, y_min, y_max] = SURROUNDINGS_M;
    let half_spaces = [
        Vector3::new(above_m, 0.0, x_max - centre.x),
        Vector3::new(-above_m, 0.0, centre.x - x_min),
        Vector3::new(0.0, above_m, y_max - centre.y),
        Vector3::new(0.0, -above_m, centre.y - y_min),
    ];
    for normal in half_spaces {
        rays = clipped(&rays, |ray| -normal.dot(ray), |a, b, part| a + (b - a) * part);
    }
    // All that is left looks down: of a ray and its opposite only one is within all four.
    rays.retain(|ray| ray.z < 0.0);
    let on_plane = |ray: &Vector3<f64>| {
        let met = centre - ray * (above_m / ray.z);
        [met.x, met.y]
    };
    Ok(rays.iter().map(on_plane).collect())
}

/// Around an image, along the edge of its outermost pixels.
fn border([width, height]: [u32; 2]) -> impl Iterator<Item = RawPixel> {
    let corners = [[0, 0], [width, 0], [width, height], [0, height]].map(|c| c.map(f64::from));
    (0..4).flat_map(move |side| {
        let ([x0, y0], [x1, y1]) = (corners[side], corners[(side + 1) % 4]);
        (0..N_ON_SIDE).map(move |i| {
            let part = f64::from(i) / f64::from(N_ON_SIDE);
            RawPixel { x_px: x0 + (x1 - x0) * part - 0.5, y_px: y0 + (y1 - y0) * part - 0.5 }
        })
    })
}

/// The part of a polygon where `inside` is not negative; `between` is linear in its last argument.
fn clipped<P: Copy>(
    polygon: &[P],
    inside: impl Fn(&P) -> f64,
    between: impl Fn(P, P, f64) -> P,
) -> Vec<P> {
    let mut kept = Vec::new();
    for (i, &here) in polygon.iter().enumerate() {
        let last = polygon[(i + polygon.len() - 1) % polygon.len()];
        let [before, now] = [inside(&last), inside(&here)];
        if (before < 0.0) != (now < 0.0) {
            kept.push(between(last, here, before / (before - now)));
        }
        if now >= 0.0 {
            kept.push(here);
        }
    }
    kept
}

fn clipped_by(polygon: &Polygon, window: &Polygon) -> Polygon {
    let turn = area_m2(window).signum();
    let mut kept = polygon.clone();
    for (i, &[x0, y0]) in window.iter().enumerate() {
        let [x1, y1] = window[(i + 1) % window.len()];
        let inside = |[x, y]: &[f64; 2]| turn * ((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0));
        let between = |a: [f64; 2], b: [f64; 2], part: f64| {
            [a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part]
        };
        kept = clipped(&kept, inside, between);
    }
    if window.is_empty() { Vec::new() } else { kept }
}

/// Positive if it turns to the left.
#[must_use]
pub fn area_m2(polygon: &Polygon) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|([x0, y0], [x1, y1])| (x0 * y1 - x1 * y0) / 2.0).sum()
}

/// Parts of the far half that left, right and both see.
fn parts(rig: &Rig, height_m: f64, half_width_m: f64) -> [f64; 3] {
    let n_of = |length_m: f64| (length_m / GRID_M).round().max(1.0) as usize;
    let (n_x, n_y) = (n_of(2.0 * half_width_m), n_of(LENGTH_M - NET_Y_M));
    let mut counts = [0.0; 3];
    for i in 0..n_x {
        let x_m = ((i as f64 + 0.5) / n_x as f64 * 2.0 - 1.0) * half_width_m;
        for j in 0..n_y {
            let y_m = NET_Y_M + (j as f64 + 0.5) / n_y as f64 * (LENGTH_M - NET_Y_M);
            let point = Point3::new(x_m, y_m, height_m);
            let [left, right] = Camera::BOTH.map(|camera| seen(rig, camera, &point).is_some());
            for (count, is_seen) in counts.iter_mut().zip([left, right, left && right]) {
                *count += f64::from(u8::from(is_seen));
            }
        }
    }
    counts.map(|count| count / (n_x * n_y) as f64)
}

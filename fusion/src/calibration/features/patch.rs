//! A point's surroundings -> what they look like, and where the other picture shows the same.
//!
//! Patches of 15 by 15 pixels, less their mean, divided by their contrast: the product of two is
//! their correlation, whatever the cameras' exposures. The surroundings of a point look different
//! from four metres aside: a patch is sheared first as its plane says. Then to a fraction of a
//! pixel by least squares on the grey levels (Lucas and Kanade 1981), with brightness and contrast,
//! and, where the plane is doubtful, the shear as unknowns.

use crate::calibration::picture::Picture;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Half a side of a patch.
const HALF_PX: i32 = 7;

/// Pixels of a patch.
pub const AREA: usize = ((2 * HALF_PX + 1) * (2 * HALF_PX + 1)) as usize;

/// Fainter surroundings are noise: standard deviation of grey levels.
const CONTRAST_MIN: f64 = 1.0;

/// Unknowns of the fine match: shift, gain, level, and four of the shear.
const UNKNOWNS: usize = 8;

/// Sigma of the weight a pixel has, by its distance from the middle.
const WEIGHT_SIGMA_PX: f64 = 4.0;

/// Steps of the fine match, and the last one's size.
const STEPS_MAX: usize = 20;
const STEP_MIN_PX: f64 = 5e-3;

/// How far a fine match may move, and how alike it must be in the end.
const MOVED_MAX_PX: f64 = 4.0;
const ALIKE_MIN: f64 = 0.85;

/// How far beside it a point may not look the same, and what is the same.
const BESIDE_PX: std::ops::RangeInclusive<i32> = 4..=20;
const BESIDE_MAX: f32 = 0.8;

/// Mean 0, length 1.
pub type Patch = [f32; AREA];

fn offsets() -> impl Iterator<Item = Vector2<f64>> {
    (-HALF_PX..=HALF_PX)
        .flat_map(|y| (-HALF_PX..=HALF_PX).map(move |x| Vector2::new(f64::from(x), f64::from(y))))
}

/// What surrounds a point, seen through a shear; None at the picture's edge or where there is
/// nothing.
#[must_use]
pub fn around(picture: &Picture, at: &Vector2<f64>, shear: &Matrix2<f64>) -> Option<Patch> {
    let mut patch = [0.0; AREA];
    for (value, offset) in patch.iter_mut().zip(offsets()) {
        let place = at + shear * offset;
        *value = picture.between(place.x, place.y)? as f32;
    }
    normalised(patch)
}

fn normalised(mut patch: Patch) -> Option<Patch> {
    let mean = patch.iter().sum::<f32>() / AREA as f32;
    patch.iter_mut().for_each(|v| *v -= mean);
    let length = patch.iter().map(|v| v * v).sum::<f32>().sqrt();
    let is_seen = f64::from(length) > CONTRAST_MIN * (AREA as f64).sqrt();
    is_seen.then(|| patch.map(|v| v / length))
}

/// Correlation, −1 to 1.
#[must_use]
pub fn likeness(one: &Patch, other: &Patch) -> f32 {
    one.iter().zip(other).map(|(a, b)| a * b).sum()
}

/// Whether the surroundings of a pixel look different from what is some pixels beside them: a net's
/// meshes look like the next ones, and a line like itself farther on.
#[must_use]
pub fn is_distinct(picture: &Picture, at: &Vector2<f64>) -> bool {
    let at_offset = |x: i32, y: i32| {
        let at = at + Vector2::new(f64::from(x), f64::from(y));
        around(picture, &at, &Matrix2::identity())
    };
    let Some(own) = at_offset(0, 0) else { return false };
    let row = BESIDE_PX.flat_map(|x| [-x, x]).flat_map(|x| [-1, 0, 1].map(|y| [x, y]));
    let (near, far) = (4.5, 8.0);
    let ring = (0..16).map(|k| f64::from(k) * std::f64::consts::PI / 8.0);
    let ring = ring.flat_map(|angle| [near, far].map(|r| [r * angle.cos(), r * angle.sin()]));
    row.chain(ring.map(|at| at.map(|v| v.round() as i32)))
        .filter_map(|[x, y]| at_offset(x, y))
        .all(|other| likeness(&own, &other) < BESIDE_MAX)
}

/// A place in the right picture that shows what the left one shows at a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Where.
    pub at: Vector2<f64>,
    /// Right offsets from left ones.
    pub shear: Matrix2<f64>,
}

/// The place to a fraction of a pixel; None if it runs away or does not look the same.
#[must_use]
pub fn finely(
    [left, right]: [&Picture; 2],
    at: &Vector2<f64>,
    guess: &Place,
    is_shear_known: bool,
) -> Option<Place> {
    let n = if is_shear_known { 4 } else { UNKNOWNS };
    let mut place = *guess;
    let (mut gain, mut level) = (1.0, 0.0);
    for step_idx in 0..STEPS_MAX {
        let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::identity() * 1e-9;
        let mut pull = SVector::<f64, UNKNOWNS>::zeros();
        for offset in offsets() {
            let to = place.at + place.shear * offset;
            let value = right.between(to.x, to.y)?;
            let slope = Vector2::new(
                right.between(to.x + 0.5, to.y)? - right.between(to.x - 0.5, to.y)?,
                right.between(to.x, to.y + 0.5)? - right.between(to.x, to.y - 0.5)?,
            ) * gain;
            let wanted = left.between(at.x + offset.x, at.y + offset.y)?;
            let weight = (-0.5 * offset.norm_squared() / WEIGHT_SIGMA_PX.powi(2)).exp();
            let mut row = SVector::<f64, UNKNOWNS>::zeros();
            row.copy_from_slice(&[
                slope.x,
                slope.y,
                value,
                1.0,
                slope.x * offset.x,
                slope.x * offset.y,
                slope.y * offset.x,
                slope.y * offset.y,
            ]);
            row.rows_mut(n, UNKNOWNS - n).fill(0.0);
            normal += row * row.transpose() * weight;
            pull += row * (weight * (wanted - gain * value - level));
        }
        let step = normal.cholesky()?.solve(&pull);
        place.at += step.fixed_rows::<2>(0);
        gain += step[2];
        level += step[3];
        place.shear += Matrix2::new(step[4], step[5], step[6], step[7]);
        // A contrast turned round, or one that left the picture.
        let is_lost = gain.is_nan() || gain < 0.2 || (place.at - guess.at).norm() > MOVED_MAX_PX;
        if is_lost {
            return None;
        }
        if step_idx > 0 && step.fixed_rows::<2>(0).norm() < STEP_MIN_PX {
            break;
        }
    }
    let one = around(left, at, &Matrix2::identity())?;
    let other = around(right, &place.at, &place.shear)?;
    (f64::from(likeness(&one, &other)) > ALIKE_MIN).then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Leaves: a sum of waves, brighter and of less contrast in the second picture.
    fn pictures(place: &Place, at: &Vector2<f64>) -> [Picture; 2] {
        let leaves = |p: Vector2<f64>| {
            90.0 + 20.0 * (0.9 * p.x + 0.3 * p.y).sin() + 25.0 * (0.7 * p.y - 0.4 * p.x).cos()
        };
        let back = place.shear.try_inverse().unwrap();
        let picture = |value: &dyn Fn(Vector2<f64>) -> f64| {
            let one = |i: usize| value(Vector2::new((i % 64) as f64, (i / 64) as f64)) as f32;
            Picture::new(64, 64, (0..64 * 64).map(one).collect())
        };
        [picture(&|p| leaves(p - at)), picture(&|p| 30.0 + 0.7 * leaves(back * (p - place.at)))]
    }

    #[test]
    fn a_sheared_patch_is_found_to_a_hundredth_of_a_pixel() {
        let truth =
            Place { at: Vector2::new(33.37, 29.81), shear: Matrix2::new(1.02, 0.4, -0.01, 0.97) };
        let at = Vector2::new(31.0, 31.0);
        let [left, right] = pictures(&truth, &at);
        let shear = Matrix2::new(1.0, 0.33, 0.0, 1.0);
        let guess = Place { at: Vector2::new(32.6, 30.2), shear };
        let found = finely([&left, &right], &at, &guess, false).unwrap();
        assert!((found.at - truth.at).norm() < 0.02, "{found:?}");
        assert!((found.shear - truth.shear).amax() < 0.01, "{found:?}");
        let other = around(&right, &truth.at, &truth.shear).unwrap();
        let one = around(&left, &at, &Matrix2::identity()).unwrap();
        assert!(likeness(&one, &other) > 0.99);
    }

    #[test]
    fn what_looks_different_has_no_place() {
        let truth = Place { at: Vector2::new(31.0, 31.0), shear: Matrix2::identity() };
        let [left, right] = pictures(&truth, &truth.at);
        let elsewhere = Place { at: Vector2::new(27.0, 33.0), ..truth };
        assert!(finely([&left, &right], &truth.at, &elsewhere, true).is_none());
        let flat = Picture::new(64, 64, vec![80.0; 64 * 64]);
        assert!(finely([&left, &flat], &truth.at, &truth, true).is_none());
    }
}

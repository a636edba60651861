//! Direction beyond the court -> how bright it is: fence, wind screen, trees, sky.
//!
//! Everything beyond the far baseline is flat: the fence stands at its own y, the trees are a
//! painted curtain some metres behind it, the sky is a gradient. Returned is light, not
//! reflectance: these surfaces do not take part in the court's lighting. What may sway is kept
//! apart from what stands before it.

use nalgebra::{Point3, Vector3};

use crate::texture::{fractal_noise, value_noise};

/// The curtain of trees stands this far behind the fence.
const TREES_BEHIND_FENCE_M: f64 = 8.0;
const FENCE_HEIGHT_M: f64 = 3.65;
const SCREEN_HEIGHT_M: f64 = 1.92;
const FENCE_POST_PERIOD_M: f64 = 3.05;
const FENCE_POST_M: f64 = 0.06;
const RAIL_M: f64 = 0.05;
/// Wires of the chain-link fence cover this share; at 30 m it is a faint veil.
const WIRE_COVERAGE: f64 = 0.10;

const SCREEN_LIGHT: f64 = 0.024;
const POST_LIGHT: f64 = 0.045;
const WIRE_LIGHT: f64 = 0.05;
/// A blue sky at the horizon.
pub const SKY_LIGHT: f64 = 0.55;
const LEAVES_LIGHT: f64 = 0.013;

/// What a ray sees beyond the court: light = front + trees_open * trees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beyond {
    /// Light of everything that stands still.
    pub front: f64,
    /// Share of the view that is open to what may sway.
    pub trees_open: f64,
    /// Light of trees, and of the sky between their leaves.
    pub trees: f64,
}

/// What comes from beyond the court, if the ray does not meet the ground before the fence.
pub fn seen(
    seed: u64,
    fence_y_m: f64,
    sky_light: f64,
    eye: &Point3<f64>,
    ray: &Vector3<f64>,
) -> Option<Beyond> {
    if ray.y <= 0.0 {
        return Some(Beyond { front: sky(sky_light, ray), ..Beyond::default() });
    }
    let fence = eye + ray * ((fence_y_m - eye.y) / ray.y);
    if fence.z < 0.0 {
        return None;
    }
    // Trees are worked out behind posts, too: what sways appears from behind them.
    let trees = trees(seed, fence_y_m, sky_light, eye, ray);
    let (front, trees_open) = if fence.z > FENCE_HEIGHT_M {
        (0.0, 1.0)
    } else if is_frame(&fence) {
        (POST_LIGHT, 0.0)
    } else if fence.z < SCREEN_HEIGHT_M {
        let weave = fractal_noise(seed ^ 0x5c, fence.x * 1.5, fence.z * 3.0, 2);
        (SCREEN_LIGHT * (1.0 + 0.15 * weave), 0.0)
    } else {
        (WIRE_LIGHT * WIRE_COVERAGE, 1.0 - WIRE_COVERAGE)
    };
    Some(Beyond { front, trees_open, trees })
}

/// Posts and rails.
fn is_frame(fence: &Point3<f64>) -> bool {
    let from_post_m = fence.x - (fence.x / FENCE_POST_PERIOD_M).round() * FENCE_POST_PERIOD_M;
    from_post_m.abs() < 0.5 * FENCE_POST_M
        || (FENCE_HEIGHT_M - fence.z) < RAIL_M
        || (fence.z - SCREEN_HEIGHT_M).abs() < 0.5 * RAIL_M
}

/// Leaves, and the sky between and above them.
fn trees(seed: u64, fence_y_m: f64, sky_light: f64, eye: &Point3<f64>, ray: &Vector3<f64>) -> f64 {
    let p = eye + ray * ((fence_y_m + TREES_BEHIND_FENCE_M - eye.y) / ray.y);
    let crown_m = 7.0 + 2.5 * value_noise(seed ^ 0x77, p.x * 0.25, 0.0);
    let leaves = fractal_noise(seed ^ 0x7e, p.x * 5.0, p.z * 5.0, 2);
    let mass = fractal_noise(seed ^ 0x7f, p.x * 0.6, p.z * 0.6, 2);
    let gap = leaves + 1.1 * mass + 0.10 * (p.z - crown_m);
    if gap > 0.35 {
        return sky(sky_light, ray);
    }
    // Lit leaves are few and bright among many dark ones.
    let lit = (0.8 + 1.1 * leaves + 0.7 * mass).max(0.2);
    LEAVES_LIGHT * lit * lit
}

fn sky(sky_light: f64, ray: &Vector3<f64>) -> f64 {
    // Brightest at the horizon.
    sky_light * (1.0 - 0.3 * (ray.z / ray.norm()).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const EYE: Point3<f64> = Point3::new(0.0, 0.0, 3.5);

    #[test]
    fn the_ground_before_the_fence_is_none_of_its_business() {
        assert_eq!(seen(1, 30.0, SKY_LIGHT, &EYE, &Vector3::new(0.0, 1.0, -0.2)), None);
    }

    #[test]
    fn the_screen_is_dark_and_the_sky_is_bright() {
        let screen =
            seen(1, 30.0, SKY_LIGHT, &EYE, &Vector3::new(0.04, 1.0, -0.09)).expect("the screen");
        let sky = seen(1, 30.0, SKY_LIGHT, &EYE, &Vector3::new(0.0, 1.0, 1.0)).expect("the sky");
        assert!(screen.front < 0.04 && screen.trees_open == 0.0, "{screen:?}");
        assert!(sky.trees > 0.3 && sky.trees_open == 1.0, "{sky:?}");
    }
}

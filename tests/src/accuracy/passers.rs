//! Time -> the places on a person's body that a detector takes for balls.
//!
//! Somebody walks across the far half of the court and back. Head, hands and shoes give spots in
//! both cameras, at places in the court that belong together: a cluster that moves, and that pairs
//! as a ball does. The body turns and swings, which is noise of a few centimetres.

use nalgebra::{Point3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Places above the ground: shoes, knees, hands, elbows, shoulder, head.
const HEIGHTS_M: [f64; 6] = [0.1, 0.5, 0.9, 1.1, 1.45, 1.75];
/// The turning points.
const ALLEY_X_M: f64 = 5.0;
/// What swings, 1 sigma, each axis.
const SWING_M: f64 = 0.06;
/// A limb is seen as something ball-like in this part of the frames.
pub const SEEN_SHARE: f64 = 0.7;

/// Somebody who walks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passer {
    y_m: f64,
    speed_m_s: f64,
    phase_m: f64,
}

impl Passer {
    /// Draws who it is.
    pub fn drawn(rng: &mut impl Rng) -> Self {
        Self {
            y_m: rng.random_range(14.0..26.0),
            speed_m_s: rng.random_range(1.1..1.6),
            phase_m: rng.random_range(0.0..4.0 * ALLEY_X_M),
        }
    }

    /// Where the parts of the body are, exact but for what swings.
    pub fn places_m(&self, at_s: f64, rng: &mut impl Rng) -> [Point3<f64>; 6] {
        // There and back: a triangle.
        let way_m = (self.phase_m + self.speed_m_s * at_s).rem_euclid(4.0 * ALLEY_X_M);
        let x_m = (way_m - 2.0 * ALLEY_X_M).abs() - ALLEY_X_M;
        HEIGHTS_M.map(|z_m| {
            let swing = Vector3::from_fn(|_, _| SWING_M * rng.sample::<f64, _>(StandardNormal));
            Point3::new(x_m, self.y_m, z_m) + swing
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn somebody_walks_at_walking_pace_and_stays_on_court() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let passer = Passer::drawn(&mut rng);
        let mut mean_x_m = |at_s: f64| {
            let places = passer.places_m(at_s, &mut rng);
            places.iter().map(|p| p.x).sum::<f64>() / 6.0
        };
        for k in 0..100 {
            let (a, b) = (mean_x_m(f64::from(k)), mean_x_m(f64::from(k) + 1.0));
            assert!((b - a).abs() < 2.0 && a.abs() < ALLEY_X_M + 0.3, "{a} {b}");
        }
    }
}

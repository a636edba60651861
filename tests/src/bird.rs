//! Flight of a bird, time -> its limbs: a body and two wings that flap.
//!
//! A pigeon is 0.33 m long with a span of 0.68 m and flaps 5 times a second; a swallow has half of
//! both. The tips lag behind the wrists. Absent before and after its flight.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};

use crate::figure::{LIMBS_MAX, Limb, Limbs};

/// How far wings go up and down.
const FLAP_RAD: f64 = 0.8;

/// A bird flies along a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BirdFlight {
    /// Where it begins.
    pub from_in_court_m: Point3<f64>,
    /// How it flies.
    pub velocity_m_s: Vector3<f64>,
    /// When it begins.
    pub starts_at_s: f64,
    /// When it is gone.
    pub ends_at_s: f64,
    /// From tip to tip.
    pub span_m: f64,
    /// Beats a second.
    pub flap_hz: f64,
    /// 0.03 is a swallow or a crow, 0.2 a pigeon.
    pub reflectance: f64,
}

impl BirdFlight {
    /// The limbs at a time; `None` when it is not there.
    pub fn limbs(&self, at_s: f64) -> Option<Limbs> {
        if !(self.starts_at_s..self.ends_at_s).contains(&at_s) {
            return None;
        }
        let since_s = at_s - self.starts_at_s;
        let beat_rad = TAU * self.flap_hz * since_s;
        // The body goes up when the wings go down.
        let lift = Vector3::z() * (-0.04 * self.span_m * beat_rad.sin());
        let middle = self.from_in_court_m + self.velocity_m_s * since_s + lift;
        let ahead = self.velocity_m_s.normalize();
        let right = ahead.cross(&Vector3::z()).normalize();
        let limb = |from: Point3<f64>, to: Point3<f64>, radii: [f64; 2]| {
            let radii_m = radii.map(|radius| radius * self.span_m);
            Some(Limb {
                ends_in_court_m: [from, to],
                radii_m,
                reflectance: self.reflectance,
                pattern: 0.3,
            })
        };
        let at = |ahead_share: f64| middle + ahead * (ahead_share * self.span_m);
        let mut limbs: Limbs = [None; LIMBS_MAX];
        limbs[0] = limb(at(-0.14), at(0.14), [0.055, 0.07]);
        limbs[1] = limb(at(0.17), at(0.22), [0.045, 0.03]);
        limbs[2] = limb(at(-0.16), at(-0.27), [0.03, 0.05]);
        for (idx, side) in [-1.0, 1.0].into_iter().enumerate() {
            let wing = |lag_rad: f64| {
                let (sin, cos) = (FLAP_RAD * (beat_rad - lag_rad).sin()).sin_cos();
                right * (side * cos) + Vector3::z() * sin
            };
            let shoulder = middle + ahead * (0.04 * self.span_m);
            let wrist = shoulder + (wing(0.0) + ahead * 0.15) * (0.25 * self.span_m);
            let tip = wrist + (wing(0.7) - ahead * 0.35) * (0.25 * self.span_m);
            limbs[3 + 2 * idx] = limb(shoulder, wrist, [0.06, 0.05]);
            limbs[4 + 2 * idx] = limb(wrist, tip, [0.05, 0.012]);
        }
        Some(limbs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wings_flap_and_span_no_more_than_stated() {
        let bird = BirdFlight {
            from_in_court_m: Point3::new(-8.0, 35.0, 4.0),
            velocity_m_s: Vector3::new(10.0, 0.0, 0.0),
            starts_at_s: 1.0,
            ends_at_s: 3.0,
            span_m: 0.68,
            flap_hz: 5.0,
            reflectance: 0.2,
        };
        let tips = |at_s: f64| {
            let limbs = bird.limbs(at_s).expect("flies");
            [4, 6].map(|idx| limbs[idx].expect("a wing").ends_in_court_m[1])
        };
        let spans = (0..50).map(|k| tips(1.0 + 0.01 * f64::from(k)));
        let spans: Vec<f64> = spans.map(|[a, b]| (a - b).norm()).collect();
        assert!(spans.iter().all(|span_m| *span_m < 0.70), "{spans:?}");
        assert!(spans.iter().any(|span_m| *span_m < 0.55), "{spans:?}");
        assert!(bird.limbs(0.99).is_none() && bird.limbs(3.0).is_none());
    }
}

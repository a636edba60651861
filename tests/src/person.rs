//! Walk, time -> the limbs of somebody who walks by.
//!
//! Proportions are those of an adult (Drillis and Contini: hip at 0.53 of the height, knee 0.285,
//! shoulder 0.82). Legs swing like pendulums and bend at the knee while they come forward, arms
//! swing against them; a stride is 0.8 of the height. Shirt and shorts have a print and folds.
//! Absent before the walk begins and after it ends.

use nalgebra::{Point2, Point3, Vector3};

use crate::figure::{LIMBS_MAX, Limb, Limbs};

/// Two steps, as a share of the height.
const STRIDE: f64 = 0.8;
const SHIRT_REFLECTANCE: f64 = 0.32;
const SHORTS_REFLECTANCE: f64 = 0.05;
const SKIN_REFLECTANCE: f64 = 0.24;
const HAIR_REFLECTANCE: f64 = 0.03;
const SHOE_REFLECTANCE: f64 = 0.55;

/// Somebody walks along a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Where it begins, on the ground of `court`.
    pub from_in_court_m: Point2<f64>,
    /// Where it ends.
    pub to_in_court_m: Point2<f64>,
    /// When it begins.
    pub starts_at_s: f64,
    /// How fast; a stroll is 1.2, a run 3.
    pub speed_m_s: f64,
    /// How tall.
    pub height_m: f64,
}

/// Directions of one who walks, and where the hips are.
struct Gait {
    ground: Point3<f64>,
    ahead: Vector3<f64>,
    right: Vector3<f64>,
    height_m: f64,
}

impl Gait {
    /// A place of the body: ahead, to the right and up, as shares of the height.
    fn at(&self, ahead: f64, right: f64, up: f64) -> Point3<f64> {
        let place = self.ahead * ahead + self.right * right + Vector3::z() * up;
        self.ground + place * self.height_m
    }

    fn limb(&self, ends: [Point3<f64>; 2], radii: [f64; 2], reflectance: f64) -> Option<Limb> {
        let pattern = if reflectance == SHIRT_REFLECTANCE { 0.5 } else { 0.2 };
        let radii_m = radii.map(|radius| radius * self.height_m);
        Some(Limb { ends_in_court_m: ends, radii_m, reflectance, pattern })
    }
}

impl Walk {
    /// The limbs at a time; `None` before and after the walk.
    pub fn limbs(&self, at_s: f64) -> Option<Limbs> {
        let way = self.to_in_court_m - self.from_in_court_m;
        let way_m = (at_s - self.starts_at_s) * self.speed_m_s;
        if !(0.0..way.norm()).contains(&way_m) {
            return None;
        }
        let ahead = Vector3::new(way.x, way.y, 0.0).normalize();
        let feet = self.from_in_court_m + way.normalize() * way_m;
        let phase_rad = std::f64::consts::TAU * way_m / (STRIDE * self.height_m);
        let gait = Gait {
            // Highest when a leg is upright, twice a stride.
            ground: Point3::new(feet.x, feet.y, 0.012 * self.height_m * (2.0 * phase_rad).cos()),
            ahead,
            right: ahead.cross(&Vector3::z()),
            height_m: self.height_m,
        };
        let mut limbs: Limbs = [None; LIMBS_MAX];
        let (body, rest) = limbs.split_at_mut(6);
        body.copy_from_slice(&trunk(&gait));
        for (idx, side) in [-1.0, 1.0].into_iter().enumerate() {
            // The left leg leads by half a stride.
            let phase_rad = phase_rad + idx as f64 * std::f64::consts::PI;
            rest[idx * 7..idx * 7 + 4].copy_from_slice(&leg(&gait, side, phase_rad));
            rest[idx * 7 + 4..idx * 7 + 7].copy_from_slice(&arm(&gait, side, -phase_rad.sin()));
        }
        Some(limbs)
    }
}

fn trunk(gait: &Gait) -> [Option<Limb>; 6] {
    let at = |ahead, right, up| gait.at(ahead, right, up);
    [
        // Two side by side are as wide as a chest and as deep.
        gait.limb(
            [at(0.0, -0.045, 0.56), at(0.0, -0.055, 0.76)],
            [0.062, 0.068],
            SHIRT_REFLECTANCE,
        ),
        gait.limb([at(0.0, 0.045, 0.56), at(0.0, 0.055, 0.76)], [0.062, 0.068], SHIRT_REFLECTANCE),
        gait.limb([at(0.0, -0.10, 0.80), at(0.0, 0.10, 0.80)], [0.038; 2], SHIRT_REFLECTANCE),
        gait.limb([at(0.0, 0.0, 0.82), at(0.01, 0.0, 0.88)], [0.03; 2], SKIN_REFLECTANCE),
        gait.limb([at(0.02, 0.0, 0.91), at(0.015, 0.0, 0.95)], [0.042, 0.044], SKIN_REFLECTANCE),
        gait.limb([at(-0.008, 0.0, 0.945), at(0.0, 0.0, 0.968)], [0.044, 0.046], HAIR_REFLECTANCE),
    ]
}

fn leg(gait: &Gait, side: f64, phase_rad: f64) -> [Option<Limb>; 4] {
    let right = 0.05 * side;
    let thigh_rad = 0.42 * phase_rad.sin();
    // Bent while it comes forward, else nearly straight.
    let bend_rad = 0.08 + 0.9 * phase_rad.cos().max(0.0).powi(2);
    let shin_rad = thigh_rad - bend_rad;
    let below = |from: [f64; 2], angle_rad: f64, length: f64| {
        [from[0] + length * angle_rad.sin(), from[1] - length * angle_rad.cos()]
    };
    let hip = [0.0, 0.53];
    let hem = below(hip, thigh_rad, 0.17);
    let knee = below(hip, thigh_rad, 0.245);
    let ankle = below(knee, shin_rad, 0.246);
    let toe = below(ankle, shin_rad + 1.35, 0.085);
    let at = |place: [f64; 2]| gait.at(place[0], right, place[1]);
    [
        gait.limb([at(hip), at(hem)], [0.062, 0.058], SHORTS_REFLECTANCE),
        gait.limb([at(hem), at(knee)], [0.043, 0.034], SKIN_REFLECTANCE),
        gait.limb([at(knee), at(ankle)], [0.034, 0.022], SKIN_REFLECTANCE),
        gait.limb([at(ankle), at(toe)], [0.026, 0.020], SHOE_REFLECTANCE),
    ]
}

fn arm(gait: &Gait, side: f64, swing: f64) -> [Option<Limb>; 3] {
    let shoulder = gait.at(0.0, 0.12 * side, 0.80);
    let (upper_rad, lower_rad) = (0.5 * swing, 0.5 * swing + 0.35);
    let down = |angle_rad: f64| {
        gait.ahead * angle_rad.sin() - Vector3::z() * angle_rad.cos() + gait.right * (0.12 * side)
    };
    let sleeve = shoulder + down(upper_rad) * (0.10 * gait.height_m);
    let elbow = shoulder + down(upper_rad) * (0.18 * gait.height_m);
    let hand = elbow + down(lower_rad) * (0.19 * gait.height_m);
    [
        gait.limb([shoulder, sleeve], [0.034, 0.032], SHIRT_REFLECTANCE),
        gait.limb([sleeve, elbow], [0.024, 0.021], SKIN_REFLECTANCE),
        gait.limb([elbow, hand], [0.021, 0.019], SKIN_REFLECTANCE),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk() -> Walk {
        Walk {
            from_in_court_m: Point2::new(-4.0, 26.0),
            to_in_court_m: Point2::new(4.0, 26.0),
            starts_at_s: 2.0,
            speed_m_s: 1.4,
            height_m: 1.8,
        }
    }

    #[test]
    fn a_person_is_as_tall_as_stated_and_stands_on_the_ground() {
        for step in 0..100 {
            let limbs = walk().limbs(2.0 + 0.05 * f64::from(step)).expect("walks");
            let ends = limbs.iter().flatten().flat_map(|limb| {
                [0, 1].map(|end| (limb.ends_in_court_m[end].z, limb.radii_m[end]))
            });
            let (mut low_m, mut high_m) = (f64::MAX, f64::MIN);
            for (z_m, radius_m) in ends {
                low_m = low_m.min(z_m - radius_m);
                high_m = high_m.max(z_m + radius_m);
            }
            assert!((1.72..1.86).contains(&high_m), "{high_m}");
            assert!((-0.06..0.10).contains(&low_m), "{low_m}");
        }
    }

    #[test]
    fn a_walk_takes_its_time() {
        assert!(walk().limbs(1.99).is_none());
        assert!(walk().limbs(2.0 + 8.0 / 1.4 + 0.01).is_none());
        let middle = walk().limbs(2.0 + 4.0 / 1.4).expect("walks")[0].expect("a trunk");
        assert!(middle.ends_in_court_m[0].x.abs() < 0.1);
    }
}

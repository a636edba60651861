//! Time -> how far the whole picture is shifted: a camera that is bumped, and one that vibrates.
//!
//! A small turn of the camera shifts the picture as a whole, to a hundredth of a pixel for the few
//! pixels meant here. A mast in the wind swings at some 10 Hz and, less, at some 30 Hz.
//! Conventions: pixels, x to the right, y downwards: a thing seen at p is then seen at p + shift.

use std::f64::consts::TAU;

use crate::camera::Camera;

/// Swings a second, share of the motion and phase, for x and for y.
const SWINGS: [[(f64, f64, f64); 2]; 2] =
    [[(11.3, 0.7, 0.0), (27.1, 0.3, 1.0)], [(9.7, 0.7, 2.0), (31.7, 0.3, 4.0)]];

/// Somebody walks into the tripod.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bump {
    /// When.
    pub at_s: f64,
    /// Where everything is seen from then on.
    pub shift_px: [f64; 2],
}

/// A camera that does not stand still.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shake {
    /// At most one.
    pub bump: Option<Bump>,
    /// Most that it vibrates along each axis, to either side.
    pub vibration_px: f64,
}

impl Shake {
    /// Where everything is seen at a time, relative to a camera that stands still.
    pub fn shift_px(&self, at_s: f64) -> [f64; 2] {
        let bump = self.bump.filter(|bump| at_s >= bump.at_s);
        let bump_px = bump.map_or([0.0; 2], |bump| bump.shift_px);
        let swing =
            |(rate_hz, share, phase): (f64, f64, f64)| share * (TAU * rate_hz * at_s + phase).sin();
        let vibration = SWINGS.map(|swings| swings.map(swing).iter().sum::<f64>());
        [0, 1].map(|axis| bump_px[axis] + self.vibration_px * vibration[axis])
    }

    /// The camera as it looks at a time.
    pub fn camera(&self, camera: &Camera, at_s: f64) -> Camera {
        let [dx, dy] = self.shift_px(at_s);
        let [x, y] = camera.center_px;
        Camera { center_px: [x + dx, y + dy], ..camera.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bump_stays_and_a_vibration_keeps_its_size() {
        let bump = Bump { at_s: 2.0, shift_px: [2.5, -1.5] };
        let shake = Shake { bump: Some(bump), vibration_px: 0.0 };
        assert_eq!(shake.shift_px(1.999), [0.0, 0.0]);
        assert_eq!(shake.shift_px(9.0), [2.5, -1.5]);
        let shake = Shake { bump: None, vibration_px: 0.3 };
        let shifts = (0..1000).map(|k| shake.shift_px(f64::from(k) / 90.0));
        let most = shifts.flatten().map(f64::abs).fold(0.0, f64::max);
        assert!((0.25..=0.3).contains(&most), "{most}");
    }
}

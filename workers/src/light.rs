//! Grey level ↔ light: the curve by which cameras encode.
//!
//! A pixel that a ball covers half is the mean of ball and background in light, not in grey levels,
//! and a sphere's shading is a cosine in light alone. Fitted in grey levels, the bright side's edge
//! seems farther out than the dark side's, and the middle is drawn to the sun.
//!
//! Light is in units in which white is 255 as in grey levels. Polynomials in place of the sRGB
//! curve (IEC 61966-2-1): within 0.7 of 255 of it, and the same bits on every machine.

const WHITE: f32 = 255.0;

/// light = x (A + x (B + x C)) of a grey level x from 0 to 1.
const A: f32 = 0.012_522_878;
const B: f32 = 0.682_171_1;
const C: f32 = 0.305_306_01;

/// The curve is steep in the dark beyond all use: there noise is larger, too.
const SLOPE_MIN: f32 = 0.15;

/// Light of a grey level.
#[must_use]
#[inline(always)]
pub fn from_grey(level: f32) -> f32 {
    let x = level.max(0.0) / WHITE;
    WHITE * (x * (A + x * (B + x * C)))
}

/// By how much light grows with the grey level.
#[must_use]
#[inline(always)]
pub fn slope(level: f32) -> f32 {
    steepness(level).max(SLOPE_MIN)
}

#[inline(always)]
fn steepness(level: f32) -> f32 {
    let x = level.max(0.0) / WHITE;
    A + x * (2.0 * B + x * (3.0 * C))
}

/// Grey level of a light, by four steps of Newton's from above, where the curve is bent one way.
#[must_use]
pub fn grey_from(light: f32) -> f32 {
    let light = light.max(0.0);
    let mut level = WHITE * (light / WHITE).sqrt() + 1.0;
    for _ in 0..4 {
        level = (level - (from_grey(level) - light) / steepness(level).max(1e-3)).max(0.0);
    }
    level
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_that_of_cameras_and_back() {
        for level in 0..=255_u8 {
            let x = f32::from(level) / WHITE;
            let exact = if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) };
            let light = from_grey(f32::from(level));
            assert!((light - WHITE * exact).abs() < 0.7, "{level}: {light}");
            assert!((grey_from(light) - f32::from(level)).abs() < 0.05, "{level}");
        }
    }
}

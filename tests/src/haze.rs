//! Light -> mean and noise of a pixel, through a veil of haze or flare.
//!
//! Light scattered into the lens is added everywhere: with an exposure that keeps the mean, grey
//! levels move towards it, `mean + (grey - mean) (1 - loss)`. The sensor's noise is that of the
//! brightness it really gets. Since light changes from frame to frame under most conditions, the
//! answer is looked up by the leading bits of the number that light is: 1024 entries for each
//! doubling, a tenth of a grey level apart at most. That takes no root and no branch.

use crate::noise::{self, Level, Noise};

/// Bits of a number that are left out: 10 of the 23 of its fraction are looked at.
const LEFT_OUT: u32 = 13;
/// Darker than this is as dark; 0.4 grey levels. A power of two.
const DARKEST: f32 = 1.0 / 8192.0;
/// The table ends at white.
const N_LEVELS: usize = ((1f32.to_bits() - DARKEST.to_bits()) >> LEFT_OUT) as usize + 1;

/// A veil over the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Haze {
    /// Share of the contrast that is lost.
    pub loss: f64,
}

/// What the sensor shows for any light.
#[derive(Clone, Debug)]
pub struct Tones {
    levels: Vec<Level>,
}

impl Tones {
    /// A sensor behind haze; `mean_grey` is that of the picture.
    pub fn new(noise: &Noise, haze: Haze, mean_grey: f64) -> Self {
        let level = |idx: usize| {
            // The middle of what has the same leading bits; all that is dark begins at none.
            let bits = DARKEST.to_bits() + ((idx as u32) << LEFT_OUT) + (1 << (LEFT_OUT - 1));
            let light = if idx == 0 { 0.0 } else { f32::from_bits(bits).min(1.0) };
            let grey = noise::grey_from_light(f64::from(light));
            let veiled = mean_grey + (grey - mean_grey) * (1.0 - haze.loss);
            noise.level_from_light(noise::light_from_grey(veiled) as f32)
        };
        Self { levels: (0..N_LEVELS).map(level).collect() }
    }

    /// Mean and noise for this light, which is not negative.
    #[inline(always)]
    pub fn level(&self, light: f32) -> Level {
        // Numbers that are not negative are in the order of their bits.
        let bits = light.to_bits().clamp(DARKEST.to_bits(), 1f32.to_bits());
        self.levels[((bits - DARKEST.to_bits()) >> LEFT_OUT) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_haze_tones_are_those_of_the_sensor() {
        let noise = Noise::new(1, 1.0);
        let tones = Tones::new(&noise, Haze::default(), 90.0);
        for step in 0..=500 {
            let light = step as f32 / 500.0;
            let (table, exact) = (tones.level(light), noise.level_from_light(light));
            assert!((table.mean_q6 - exact.mean_q6).abs() <= 6, "{table:?} {exact:?}");
        }
        assert_eq!(tones.level(7.0), tones.level(1.0));
    }

    #[test]
    fn haze_brings_everything_nearer_to_the_mean() {
        let noise = Noise::new(1, 0.0);
        let tones = Tones::new(&noise, Haze { loss: 0.25 }, 100.0);
        for (grey, expected) in [(100.0, 100.0), (20.0, 40.0), (220.0, 190.0)] {
            let shown = tones.level(noise::light_from_grey(grey) as f32).mean_q6;
            assert!((f64::from(shown) / 64.0 - expected).abs() < 0.2, "{grey}: {shown}");
        }
    }
}

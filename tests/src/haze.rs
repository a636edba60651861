//! Light -> mean and noise of a pixel, through a veil of haze or flare.
//!
//! Light scattered into the lens is added everywhere: with an exposure that keeps the mean, grey
//! levels move towards it, `mean + (grey - mean) (1 - loss)`. The sensor's noise is that of the
//! brightness it really gets. Since light changes from frame to frame under most conditions, the
//! answer is looked up: 4096 entries over the root of light, 0.08 grey level apart at most.

use crate::noise::{self, Level, Noise};

/// Last entry of the table.
const LAST: usize = 4095;

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
            let grey = noise::grey_from_light((idx as f64 / LAST as f64).powi(2));
            let veiled = mean_grey + (grey - mean_grey) * (1.0 - haze.loss);
            noise.level_from_light(noise::light_from_grey(veiled) as f32)
        };
        Self { levels: (0..=LAST).map(level).collect() }
    }

    /// Mean and noise for this light.
    #[inline(always)]
    pub fn level(&self, light: f32) -> Level {
        // `as` saturates: light is never negative, and more than 1 is white.
        let idx = (light.sqrt() * LAST as f32 + 0.5) as usize;
        self.levels[idx.min(LAST)]
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

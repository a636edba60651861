//! Overcast sky -> its own light, and what a surface gets of it.
//!
//! A sheet of white paper under an even sky is as bright as that sky: in the simulator's units,
//! where white on the ground is 1, the sky is then about 1. A surface gets half of the sky for each
//! way it leans upwards, and the light of the ground for the rest: with n_z the upward part of its
//! normal and A the ground's reflectance, (1 + n_z)/2 + A (1 - n_z)/2. So the underside of a ball,
//! seen against the sky, is much darker than what is behind it.
//! Limit: only balls are lit so; people are drawn as on a sunny day's shade.

/// What the ground reflects on average: court, apron, lines.
const GROUND_REFLECTANCE: f64 = 0.13;

/// A sky without a sun; off by default, which leaves the pale blue one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overcast {
    /// Light of the sky at the horizon; 0 is no overcast sky.
    pub sky_light: f64,
}

/// What a surface gets: `mean + upward n_z`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyIrradiance {
    /// What an upright surface gets.
    pub mean: f64,
    /// How much more one gets that faces up.
    pub upward: f64,
}

impl Overcast {
    /// What surfaces get of the sky; the same all round on a day that is not overcast.
    pub fn irradiance(&self) -> SkyIrradiance {
        if self.sky_light == 0.0 {
            return SkyIrradiance { mean: 1.0, upward: 0.0 };
        }
        SkyIrradiance {
            mean: 0.5 * (1.0 + GROUND_REFLECTANCE),
            upward: 0.5 * (1.0 - GROUND_REFLECTANCE),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_gets_all_of_the_sky_and_the_underside_only_the_ground() {
        let SkyIrradiance { mean, upward } = Overcast { sky_light: 1.0 }.irradiance();
        assert!((mean + upward - 1.0).abs() < 1e-12);
        assert!((mean - upward - GROUND_REFLECTANCE).abs() < 1e-12);
    }
}

//! Time -> how bright the whole picture is: clouds that pass, and an exposure that is set anew.
//!
//! A cloud takes its share of the light over a ramp, stays, and gives it back over another. An
//! automatic exposure changes everything from one frame to the next. Both act on light, before the
//! sensor; the noise is that of the brightness that results.

/// A cloud before the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cloud {
    /// When it begins to take light.
    pub from_s: f64,
    /// How long it takes to do so, and to stop.
    pub ramp_s: f64,
    /// How long it stays in between.
    pub stay_s: f64,
    /// Share of the light that it takes.
    pub depth: f64,
}

/// The camera corrects its exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureStep {
    /// When.
    pub at_s: f64,
    /// What the light is multiplied by from then on.
    pub factor: f64,
}

/// What changes the brightness of the whole picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Daylight {
    /// Any number of clouds; they may overlap.
    pub clouds: Vec<Cloud>,
    /// Any number of steps; their factors multiply.
    pub exposure_steps: Vec<ExposureStep>,
}

impl Daylight {
    /// Light at a time, where a clear sky gives 1.
    pub fn factor(&self, at_s: f64) -> f64 {
        let sun: f64 =
            self.clouds.iter().map(|cloud| 1.0 - cloud.depth * cloud.cover(at_s)).product();
        let steps = self.exposure_steps.iter().filter(|step| at_s >= step.at_s);
        sun * steps.map(|step| step.factor).product::<f64>()
    }
}

impl Cloud {
    /// How much of it is before the sun: 0..1.
    fn cover(&self, at_s: f64) -> f64 {
        let in_s = at_s - self.from_s;
        let out_s = self.from_s + 2.0 * self.ramp_s + self.stay_s - at_s;
        let share = (in_s.min(out_s) / self.ramp_s).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_comes_stays_and_goes() {
        let cloud = Cloud { from_s: 2.0, ramp_s: 1.0, stay_s: 0.5, depth: 0.1 };
        let daylight = Daylight { clouds: vec![cloud], exposure_steps: Vec::new() };
        for (at_s, expected) in [(1.9, 1.0), (2.5, 0.95), (3.2, 0.9), (4.0, 0.95), (4.6, 1.0)] {
            assert!((daylight.factor(at_s) - expected).abs() < 1e-9, "at {at_s} s");
        }
    }

    #[test]
    fn exposure_steps_are_sudden_and_multiply() {
        let step = |at_s, factor| ExposureStep { at_s, factor };
        let steps = vec![step(1.0, 0.9), step(2.0, 1.1)];
        let daylight = Daylight { clouds: Vec::new(), exposure_steps: steps };
        assert_eq!([0.99, 1.0].map(|at_s| daylight.factor(at_s)), [1.0, 0.9]);
        assert!((daylight.factor(3.0) - 0.99).abs() < 1e-12);
    }
}

//! Scenes in which the light is what is hard.

use nalgebra::Point3;

use super::{Scene, left, plain, shots};
use crate::camera::Camera;
use crate::daylight::{Cloud, ExposureStep};
use crate::lamps::Lamps;
use crate::overcast::Overcast;
use crate::scenario::{Rig, Scenario, ScenarioOptions};

/// Light that changes slowly.
pub(super) fn cloud() -> Scene {
    let clouds = |seed| {
        let mut scenario = plain(seed, 2);
        let depths = [0.06, 0.10];
        let cloud = |(idx, depth): (usize, f64)| {
            let from_s = 1.6 + 1.6 * idx as f64;
            Cloud { from_s, ramp_s: 1.0, stay_s: 0.2, depth }
        };
        scenario.conditions.daylight.clouds = depths.into_iter().enumerate().map(cloud).collect();
        scenario
    };
    Scene {
        name: "cloud",
        contains: "clouds take 6 to 10 % of the light over ramps of 1 s",
        target: None,
        takes: left(clouds),
    }
}

/// Light that changes at once.
pub(super) fn auto_exposure() -> Scene {
    let steps = |seed| {
        let mut scenario = plain(seed, 2);
        let step = |(idx, factor): (usize, f64)| ExposureStep { at_s: 2.0 + idx as f64, factor };
        let factors = [1.1, 1.0 / 1.1, 0.9, 1.0 / 0.9];
        scenario.conditions.daylight.exposure_steps =
            factors.into_iter().enumerate().map(step).collect();
        scenario
    };
    Scene {
        name: "auto-exposure",
        contains: "four times the exposure changes by 10 % from one frame to the next",
        target: None,
        takes: left(steps),
    }
}

/// Light that changes from row to row.
pub(super) fn banding() -> Scene {
    let lamps = |seed| {
        let mut scenario = plain(seed, 2);
        scenario.light.contrast = 0.2;
        scenario.rig.left.row_time_s = 20e-6;
        scenario.conditions.lamps = Lamps { depth: 0.1, flicker_hz: 100.0 };
        scenario
    };
    Scene {
        name: "banding",
        contains: "lamps on 50 Hz mains, 10 % of flicker seen through a rolling shutter of 20 us \
                   a row: one wandering band a picture",
        target: None,
        takes: left(lamps),
    }
}

/// Balls darker than what is behind them.
pub(super) fn overcast() -> Scene {
    Scene {
        name: "overcast",
        contains: "no sun and a white sky; cameras low, looking up 5 degrees: high balls are \
                   darker than the sky, low ones brighter than the ground",
        target: None,
        takes: left(|seed| {
            let options = ScenarioOptions { speed_m_s: (15.0, 18.0), ..shots(2) };
            let mut scenario = Scenario::from_seed(seed, &options);
            scenario.light.contrast = 0.0;
            scenario.conditions.overcast = Overcast { sky_light: 0.9 };
            let camera = Camera::reference(Point3::new(-1.0, -1.0, 1.2), 0.0, -5f64.to_radians());
            scenario.rig = Rig { left: camera.clone(), right: camera };
            scenario
        }),
    }
}

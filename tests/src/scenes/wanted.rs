//! Scenes that say how well balls should be found.

use nalgebra::Point3;

use super::{Scene, Target, add_distractors, both, noisy_day, shots, sunny};
use crate::camera::Camera;
use crate::grain::Grain;
use crate::scenario::{Light, Rig, Scenario, ScenarioOptions};

/// Nothing is hard.
pub(super) fn easy() -> Scene {
    Scene {
        name: "easy",
        contains: "a calm sunny day, sensor noise of 2 grey levels; shots like the thesis' \
                   (90 to 108 km/h)",
        target: Some(Target { rms_max_px: Some(0.12), ..Target::default() }),
        takes: both(|seed| {
            let speed_m_s = (90.0 / 3.6, 108.0 / 3.6);
            let options = ScenarioOptions { speed_m_s, ..shots(2) };
            Scenario { light: sunny(), ..Scenario::from_seed(seed, &options) }
        }),
    }
}

/// A windy day through a cheap encoder.
pub(super) fn noisy() -> Scene {
    Scene {
        name: "noisy",
        contains: "correlated noise of 5 grey levels over the sensor's 2, trees sway 2 px, shade \
                   of 10 % drifts at 0.6 m/s, contrast 0.75",
        target: Some(Target {
            tpr_min: Some(0.99),
            false_per_frame_max: Some(0.3),
            rms_max_px: Some(0.25),
            ..Target::default()
        }),
        takes: both(noisy_day),
    }
}

/// Others are there, too.
pub(super) fn distractors() -> Scene {
    let busy = |seed| {
        let mut scenario = noisy_day(seed);
        add_distractors(&mut scenario.conditions);
        scenario
    };
    Scene {
        name: "distractors",
        contains: "as noisy; two people walk, two birds pass, four balls lie about and two roll",
        target: Some(Target {
            tpr_min: Some(0.97),
            false_per_frame_max: Some(2.0),
            ..Target::default()
        }),
        takes: both(busy),
    }
}

/// Late in the evening.
pub(super) fn dim() -> Scene {
    Scene {
        name: "dim",
        contains: "no sun; a ball is 25 grey levels brighter than what it hides; noise of 6 grey \
                   levels RMS over the picture, half of its variance correlated",
        target: Some(Target {
            tpr_min: Some(0.9),
            false_per_frame_max: Some(1.0),
            ..Target::default()
        }),
        takes: both(|seed| {
            let mut scenario = Scenario::from_seed(seed, &shots(2));
            scenario.light.contrast = 0.0;
            scenario.noise_level = 2.0;
            scenario.conditions.ball_contrast_grey = Some(25.0);
            scenario.conditions.grain = Grain { sigma_grey: 3.75 };
            scenario
        }),
    }
}

/// One side of every ball is bright.
pub(super) fn side_lit() -> Scene {
    Scene {
        name: "side-lit",
        contains: "the sun 25 degrees up on the right, contrast 0.75; cameras 2.4 m apart and 2.5 \
                   m up, slow shots: balls of 4 to 20 px",
        target: Some(Target { bias_max_px: Some(0.1), ..Target::default() }),
        takes: both(|seed| {
            let speed_m_s = (12.0, 17.0);
            let landing_y_m = (12.6, 18.0);
            let options = ScenarioOptions { speed_m_s, landing_y_m, ..shots(2) };
            let mut scenario = Scenario::from_seed(seed, &options);
            scenario.light = Light::from_sun(25f64.to_radians(), 90f64.to_radians(), 0.75);
            let at = |x_m, yaw_deg: f64| {
                let place = Point3::new(x_m, 0.0, 2.5);
                Camera::reference(place, yaw_deg.to_radians(), 6f64.to_radians())
            };
            scenario.rig = Rig { left: at(-1.2, 5.0), right: at(1.2, -5.0) };
            scenario
        }),
    }
}

//! Scenes in which it is hard where the camera stands and where the balls are.

use nalgebra::Point3;

use super::{
    FIRST_LAUNCH_S, Scene, add_distractors, left, left_as_is, noisy_day, plain, shots, sunny,
};
use crate::camera::Camera;
use crate::daylight::{Cloud, ExposureStep};
use crate::lamps::Lamps;
use crate::scenario::{Launch, Rig, Scenario, ScenarioOptions};
use crate::shake::{Bump, Shake};

/// A picture that is no longer where it was.
pub(super) fn bump() -> Scene {
    let bumped = |seed| {
        let mut scenario = plain(seed, 2);
        let bump = Bump { at_s: 2.2, shift_px: [2.6, -1.7] };
        scenario.conditions.shake.bump = Some(bump);
        scenario
    };
    Scene {
        name: "bump",
        contains: "at 2.2 s the camera turns by 3 px, and stays so",
        target: None,
        takes: left(bumped),
    }
}

/// A picture that is never still.
pub(super) fn vibration() -> Scene {
    let shaken = |seed| {
        let mut scenario = plain(seed, 2);
        scenario.sway_px = 2.0;
        scenario.conditions.shake = Shake { bump: None, vibration_px: 0.3 };
        scenario
    };
    Scene {
        name: "vibration",
        contains: "a mast in the wind: the camera moves by 0.3 px at 10 and 30 Hz, trees sway 2 px",
        target: None,
        takes: left(shaken),
    }
}

/// Large balls.
pub(super) fn near() -> Scene {
    Scene {
        name: "near",
        contains: "balls tossed up 1.4 to 2.1 m before a camera, one every 0.75 s: 40 to 60 px \
                   wide",
        target: None,
        takes: left_as_is(|seed| {
            let mut scenario = plain(seed, 0);
            let camera = Camera::reference(Point3::new(0.0, 0.0, 1.3), 0.0, 0.0);
            scenario.rig = Rig { left: camera.clone(), right: camera };
            for idx in 0..7 {
                // What falls out of the picture does not bounce back into it.
                let share = f64::from(idx) / 6.0;
                let place = Point3::new(0.2 - 0.4 * share, 1.45 + 0.65 * share, 1.1);
                let azimuth_rad = (160.0 * share - 80.0).to_radians();
                let launch = toss(place, 2.6, 80f64.to_radians(), azimuth_rad);
                let launched_at_s = FIRST_LAUNCH_S + 0.75 * f64::from(idx);
                scenario.launches.push(Launch { launched_at_s, ..launch });
            }
            scenario
        }),
    }
}

/// Balls that are still where they were.
pub(super) fn slow() -> Scene {
    Scene {
        name: "slow",
        contains: "balls tossed up 22 to 25 m away, against the fence: 3 to 4 px wide, and slower \
                   than their width per frame near the top",
        target: None,
        takes: left(|seed| {
            let mut scenario = plain(seed, 0);
            for (idx, y_m) in [22.0, 25.0].into_iter().enumerate() {
                let place = Point3::new(2.0 * idx as f64 - 1.5, y_m, 1.0);
                let azimuth_rad = (15.0 * idx as f64 - 10.0).to_radians();
                scenario.launches.push(toss(place, 6.5, 68f64.to_radians(), azimuth_rad));
            }
            scenario
        }),
    }
}

/// Balls before and behind what is bright.
pub(super) fn lines_and_net() -> Scene {
    Scene {
        name: "lines-and-net",
        contains: "low shots down the middle: before white lines and behind the net's mesh",
        target: None,
        takes: left(|seed| {
            let options = ScenarioOptions {
                speed_m_s: (12.0, 18.0),
                landing_y_m: (12.8, 17.5),
                azimuth_max_rad: 2f64.to_radians(),
                ..shots(2)
            };
            Scenario { light: sunny(), ..Scenario::from_seed(seed, &options) }
        }),
    }
}

/// Everything at once.
pub(super) fn bad_weather() -> Scene {
    let all_at_once = |seed| {
        let mut scenario = noisy_day(seed);
        scenario.rig.left.row_time_s = 20e-6;
        let conditions = &mut scenario.conditions;
        add_distractors(conditions);
        let cloud = Cloud { from_s: 1.6, ramp_s: 1.0, stay_s: 0.3, depth: 0.1 };
        conditions.daylight.clouds.push(cloud);
        conditions.daylight.exposure_steps.push(ExposureStep { at_s: 3.8, factor: 1.1 });
        conditions.lamps = Lamps { depth: 0.05, flicker_hz: 100.0 };
        let bump = Bump { at_s: 4.6, shift_px: [-1.8, 1.2] };
        conditions.shake = Shake { bump: Some(bump), vibration_px: 0.3 };
        scenario
    };
    Scene {
        name: "bad-weather",
        contains: "distractors, a cloud, a step of exposure, half the banding, vibration and a \
                   bump, all at once",
        target: None,
        takes: left(all_at_once),
    }
}

/// A ball thrown by hand.
fn toss(
    position_in_court_m: Point3<f64>,
    speed_m_s: f64,
    elevation_rad: f64,
    azimuth_rad: f64,
) -> Launch {
    Launch {
        launched_at_s: FIRST_LAUNCH_S,
        position_in_court_m,
        speed_m_s,
        elevation_rad,
        azimuth_rad,
        backspin_rad_s: 0.0,
        drag_coefficient: 0.53,
        lift_scale: 1.0,
    }
}

//! News of a rig -> a sentence for a coach, and a line of JSON.
//!
//! Degrees and centimetres here, and only here.

use crate::watch::Alarm;
use crate::watch::turn::Who;
use crate::world::adjustment::{OPTICS, first_of};
use nalgebra::Vector3;
use serde_json::{Value, json};
use shm_layout::Camera;

/// `the left camera has turned 0.06° to the right; expect 13 cm at the far baseline; recalibrate`.
#[must_use]
pub fn sentence(alarm: &Alarm) -> String {
    let turns = Camera::BOTH.map(|camera| turn_of(alarm, camera));
    let turned = match alarm.who {
        Some(Who::One(camera)) => {
            format!("the {camera} camera has turned {}", described(&turns[camera.idx()]))
        }
        Some(Who::Both) => format!(
            "both cameras have turned, the left one {}, the right one {}",
            described(&turns[0]),
            described(&turns[1])
        ),
        None => format!(
            "the cameras have turned against each other by {:.2}°; it can not be told which",
            (turns[1] - turns[0]).norm().to_degrees()
        ),
    };
    let expected = match alarm.shift_m {
        Some(shift) => format!("expect {:.0} cm at the far baseline", 100.0 * shift.norm()),
        None => "bounces are off".to_owned(),
    };
    format!("{turned}; {expected}; recalibrate")
}

/// One object, schema `watch/1`.
#[must_use]
pub fn json_from(alarm: &Alarm, refines_rig: bool) -> Value {
    let degrees = |turn: Vector3<f64>| -> [f64; 3] { turn.map(f64::to_degrees).into() };
    let camera = match alarm.who {
        Some(Who::One(camera)) => camera.name(),
        Some(Who::Both) => "both",
        None => "either",
    };
    let sigma = |camera: Camera| -> [f64; 3] {
        let first = first_of(camera) + OPTICS;
        [0, 1, 2].map(|i| alarm.turn.covariance[(first + i, first + i)].sqrt().to_degrees())
    };
    json!({
        "schema": "watch/1",
        "sentence": sentence(alarm),
        "camera": camera,
        "turn_deg": {
            "left": degrees(turn_of(alarm, Camera::Left)),
            "right": degrees(turn_of(alarm, Camera::Right)),
        },
        "sigma_deg": { "left": sigma(Camera::Left), "right": sigma(Camera::Right) },
        "far_baseline_m": alarm.shift_m.map(|shift| [shift.x, shift.y]),
        "shots": alarm.n_shots,
        "applied": refines_rig && alarm.refined.is_some(),
        "rig_toml": alarm.refined.as_ref().map(ToString::to_string),
    })
}

fn turn_of(alarm: &Alarm, camera: Camera) -> Vector3<f64> {
    alarm.turn.step.fixed_rows::<3>(first_of(camera) + OPTICS).into_owned()
}

/// `0.06° to the right`: where most of it goes.
fn described(turn: &Vector3<f64>) -> String {
    let ways =
        [["down", "up"], ["to the left", "to the right"], ["against the clock", "clockwise"]];
    let axis = turn.iamax();
    let way = ways[axis][usize::from(turn[axis] > 0.0)];
    format!("{:.2}° {way}", turn.norm().to_degrees())
}

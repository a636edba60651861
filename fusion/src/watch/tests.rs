//! Laws of [`super`].

use super::*;
use crate::calibration::belief;
use crate::pretend::{self, GOOD_SIGHT, Serve};
use crate::world::adjustment::{OPTICS, RigStep, first_of};
use crate::{Fusion, Settings};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use shm_layout::Camera;

const TURN_RAD: f64 = 0.05 * std::f64::consts::PI / 180.0;

fn calibrated() -> Rig {
    let rig = pretend::reference_rig();
    let usual = belief::usual(&rig);
    rig.with_covariance(usual).unwrap()
}

fn turned(axis: usize, camera: Camera) -> Rig {
    let mut step = RigStep::zeros();
    step[first_of(camera) + OPTICS + axis] = TURN_RAD;
    pretend::reference_rig().adjusted(&step).unwrap()
}

/// Some shots of a session as cameras see it that stand like this; the alarms, and after which.
fn played(fusion: &mut Fusion, standing: &Rig, shots: std::ops::Range<u64>) -> Vec<(u64, Alarm)> {
    let mut alarms = Vec::new();
    for shot in shots {
        let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(shot), 100_000_000);
        let serve = Serve { lift_coefficient: 0.0, ..serve };
        let (frames, _) = pretend::seen_by(standing, &[serve], 150, &GOOD_SIGHT, shot);
        for (camera, mut frame) in frames {
            frame.recording_id = shot + 1;
            fusion.update(camera, &frame);
        }
        fusion.finish();
        alarms.extend(fusion.take_alarms().into_iter().map(|alarm| (shot, alarm)));
    }
    alarms
}

fn watched(refines_rig: bool) -> Fusion {
    let settings = Settings { sigma_px: 0.1, refines_rig, ..Settings::default() };
    let mut fusion = Fusion::new(calibrated(), settings);
    let false_alarms = played(&mut fusion, &pretend::reference_rig(), 0..12);
    assert_eq!(false_alarms, []);
    fusion
}

#[test]
fn a_camera_that_turns_is_told_of_within_five_shots_and_how_far_off_bounces_are() {
    for (axis, camera) in [(0, Camera::Left), (1, Camera::Right)] {
        let alarms = played(&mut watched(false), &turned(axis, camera), 12..18);
        let (shot, alarm) = &alarms[0];
        println!("shot {shot}: {}", words::sentence(alarm));
        assert!(*shot < 17, "{shot}");
        let step = &alarm.turn.step;
        let turn = |camera| step[first_of(camera) + OPTICS + axis];
        let other = Camera::BOTH[1 - camera.idx()];
        let apart = (turn(camera) - turn(other)) / TURN_RAD;
        assert!((0.5..1.4).contains(&apart), "{apart}");
        let shift_m = alarm.shift_m.unwrap().norm();
        assert!((0.01..0.2).contains(&shift_m), "{shift_m}");
    }
}

#[test]
fn a_refined_rig_is_used_only_if_somebody_agreed() {
    let standing = turned(1, Camera::Right);
    for refines_rig in [false, true] {
        let mut fusion = watched(refines_rig);
        let before = fusion.rig().clone();
        let alarms = played(&mut fusion, &standing, 12..24);
        assert!(alarms.iter().any(|(_, alarm)| alarm.refined.is_some()));
        assert_eq!(*fusion.rig() != before, refines_rig);
        let off_rad = |rig: &Rig| {
            let [left, right] = Camera::BOTH.map(|camera| {
                let (is, told) = (standing.tracking_from(camera), rig.tracking_from(camera));
                (told.rotation.inverse() * is.rotation).scaled_axis().y
            });
            (right - left).abs()
        };
        let ratio = off_rad(fusion.rig()) / off_rad(&before);
        assert!(if refines_rig { ratio < 0.5 } else { ratio == 1.0 }, "{ratio}");
    }
}

#[test]
fn one_odd_shot_is_no_alarm() {
    let mut fusion = watched(false);
    let odd = played(&mut fusion, &turned(0, Camera::Left), 12..13);
    assert_eq!(odd, []);
    assert_eq!(played(&mut fusion, &pretend::reference_rig(), 13..18), []);
}

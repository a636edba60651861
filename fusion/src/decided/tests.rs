//! Laws of judging.

use super::*;
use crate::pretend::{self, Frames, GOOD_SIGHT, POOR_SIGHT, Serve, THESIS_SERVE};
use crate::{Dropped, FrameCandidates, Outcome, Rig, Settings};
use nalgebra::Point3;
use shm_layout::{Camera, Candidate};

const SERVE: Serve = Serve { launch_ns: 100_000_000, ..THESIS_SERVE };

/// That of pretend, 16 m farther back, so that a ball is seen from the launcher on.
fn rig_behind() -> Rig {
    pretend::REFERENCE_RIG.replace("0.0, 3.5]", "-16.0, 3.5]").parse().unwrap()
}

/// Both cameras' frames of some frame numbers.
fn part(frames: &Frames, range: std::ops::Range<u64>) -> Frames {
    frames.iter().filter(|(_, frame)| range.contains(&frame.frame_idx)).cloned().collect()
}

/// A stream that has one ball in it, and no shot, for one reason.
fn check(rig: Rig, frames: &Frames, expected: Rejection) {
    let (fusion, shots) = pretend::told(rig, Settings::default(), frames);
    assert_eq!(shots.len(), 0, "{expected:?}: {shots:?}");
    let mut once = Rejected::default();
    once.count(expected);
    let mut rejected = fusion.rejected();
    if expected != Rejection::Unlikely {
        // What was seen of it before or after may have been followed by itself.
        rejected.n_unlikely = 0;
    }
    assert_eq!(rejected, once, "{expected:?}");
}

#[test]
fn a_ball_that_is_no_shot_is_counted_once_by_its_reason() {
    let (frames, _) = pretend::seen(&[SERVE], 180, &GOOD_SIGHT, 1);
    check(pretend::reference_rig(), &part(&frames, 50..54), Rejection::TooShort);
    let mut hardly = frames.clone();
    for (_, frame) in hardly.iter_mut().filter(|(_, f)| !(50..56).contains(&f.frame_idx)) {
        frame.spots.clear();
    }
    check(pretend::reference_rig(), &hardly, Rejection::Unlikely);
    let elsewhere = pretend::REFERENCE_RIG.replace("[0.0, 0.0, 1.0]", "[2.0, 0.0, 1.0]");
    check(elsewhere.parse().unwrap(), &frames, Rejection::NotFromLauncher);
    let slow = Serve { speed_m_s: 7.5, elevation_rad: 0.7, ..SERVE };
    let aside = Serve { speed_m_s: 12.0, azimuth_rad: 1.1, ..SERVE };
    for (serve, expected) in [(slow, Rejection::TooSlow), (aside, Rejection::AwayFromNet)] {
        let rig = rig_behind();
        let (frames, truths) = pretend::seen_by(&rig, &[serve], 180, &GOOD_SIGHT, 1);
        // What it does after its bounce is another question.
        let n = (truths[0].bounce.t_ns / pretend::PERIOD_NS) as u64;
        check(rig, &part(&frames, 0..n), expected);
    }
}

#[test]
fn the_shadow_of_a_shot_is_on_the_ground_and_no_shot() {
    // With a launcher in the rig it is not from there, which is looked at first.
    let no_launcher = pretend::REFERENCE_RIG.split("[launcher]").next();
    let rig: Rig = no_launcher.unwrap().parse().unwrap();
    let times: Vec<StampNs> = (0..150).map(|i| i * pretend::PERIOD_NS).collect();
    let places = pretend::flown(&SERVE, &times).positions_m;
    let mut frames = Frames::new();
    for (i, (&t_ns, place)) in times.iter().zip(&places).enumerate() {
        for camera in Camera::BOTH {
            let spot = place.and_then(|place| {
                let shadow = Point3::new(place.x, place.y, 0.05);
                let raw = rig.raw_from_tracking(camera, &shadow)?;
                let is_inside = rig.eye(camera).lens.contains(raw);
                is_inside.then(|| Candidate::at(raw.x_px as f32, raw.y_px as f32))
            });
            frames.push((camera, pretend::frame(i as u64, t_ns, spot.into_iter().collect())));
        }
    }
    let (fusion, shots) = pretend::told(rig, Settings::default(), &frames);
    assert_eq!(shots, []);
    assert!(fusion.rejected().n_on_ground > 0, "{:?}", fusion.rejected());
}

#[test]
fn a_shot_is_told_once_even_if_its_ball_is_found_twice() {
    let (frames, _) = pretend::seen(&[SERVE], 400, &GOOD_SIGHT, 2);
    let (mut fusion, shots) =
        pretend::fed(pretend::reference_rig(), Settings::default(), &part(&frames, 0..115));
    assert_eq!(shots.len(), 1);
    let mut again = fusion.tracklets.all[0].clone();
    again.is_told = false;
    fusion.tracklets.all.push(again);
    let rest = part(&frames, 115..400);
    let more: Vec<Shot> =
        rest.iter().flat_map(|(camera, frame)| fusion.update(*camera, frame)).collect();
    assert_eq!((more, fusion.finish()), (vec![], vec![]));
    assert_eq!(fusion.rejected().n_same_ball, 1, "{:?}", fusion.rejected());
    assert_eq!(fusion.tracklets.all, []);
}

/// Three serves 3 s apart; the frames 0-40, 270-310 and 540-580 have no ball.
fn three() -> Frames {
    let serves = [0, 1, 2].map(|i| Serve { launch_ns: 500_000_000 + i * 3_000_000_000, ..SERVE });
    pretend::seen(&serves, 900, &POOR_SIGHT, 3).0
}

fn is_between(frame: &FrameCandidates) -> bool {
    [5..40, 270..310, 540..580].iter().any(|part| part.contains(&frame.frame_idx))
}

/// Spoils a stream of three shots; gives out what was left out of it.
fn spoilt(spoil: impl Fn(usize, &mut FrameCandidates)) -> Dropped {
    let mut frames = three();
    for (i, (_, frame)) in frames.iter_mut().enumerate() {
        spoil(i, frame);
    }
    measured(&frames)
}

/// Asserts that three shots are measured.
fn measured(frames: &Frames) -> Dropped {
    let (fusion, shots) = pretend::told(pretend::reference_rig(), Settings::default(), frames);
    let outcomes: Vec<Outcome> = shots.iter().map(|shot| shot.outcome).collect();
    assert_eq!(outcomes, [Outcome::Measured; 3], "{:?}", fusion.rejected());
    for shot in &shots {
        let truth = pretend::flown(&SERVE, &[]).bounce;
        let off_m = (shot.bounce.as_ref().unwrap().position_m - truth.position_m).norm();
        assert!(off_m < 0.05, "{off_m} m: three sigmas at 0.3 px");
    }
    fusion.dropped()
}

#[test]
fn candidates_that_cannot_be_are_counted_and_the_shots_are_measured() {
    let wild = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -5.0, 700.0, f32::MAX];
    let dropped = spoilt(|_, frame| {
        for value in wild {
            frame.spots.push(Candidate::at(value, 100.0));
            frame.spots.push(Candidate::at(100.0, value));
        }
    });
    // In each of the 900 frames of two cameras, on both axes.
    assert_eq!(dropped.n_not_finite, 2 * 1800 * 3);
    assert_eq!(dropped.n_outside_image, 2 * 1800 * 3);
}

#[test]
fn sizes_and_covariances_that_cannot_be_are_no_reason_to_miss_a_shot() {
    for value in [f32::NAN, f32::INFINITY, -1.0, 1e4, 1e12, f32::MAX] {
        spoilt(|i, frame| {
            for spot in frame.spots.iter_mut().filter(|_| i % 3 == 0) {
                [spot.width_px, spot.area_px] = [value; 2];
                [spot.xx_px2, spot.xy_px2, spot.yy_px2] = [value, 0.0, value];
            }
        });
    }
}

#[test]
fn sixty_four_candidates_at_one_pixel_before_and_between_shots_hide_none() {
    let dropped = spoilt(|_, frame| {
        if is_between(frame) {
            frame.spots = vec![Candidate::at(320.0, 240.0); shm_layout::MAX_CANDIDATES];
        }
    });
    assert!(dropped.n_pairs_beyond_max > 0, "{dropped:?}");
}

#[test]
fn stamps_that_stand_still_or_jump_are_counted_and_the_shots_are_measured() {
    let twice: Frames = three().into_iter().flat_map(|frame| [frame.clone(), frame]).collect();
    assert_eq!(measured(&twice).n_backward_frames, 1800);
    // Ten frames of each camera between two shots, an hour back.
    let between = |frame: &FrameCandidates| (280..290).contains(&frame.frame_idx);
    let back = |_, frame: &mut FrameCandidates| {
        frame.exposed_ns -= if between(frame) { 3_600_000_000_000 } else { 0 };
    };
    assert_eq!(spoilt(back).n_backward_frames, 20);
    // One hour forward and back for good, between two shots: what came before is over.
    for jump_ns in [3_600_000_000_000, -3_600_000_000_000, i64::MAX / 2] {
        spoilt(|_, frame| frame.exposed_ns += if frame.frame_idx >= 280 { jump_ns } else { 0 });
    }
}

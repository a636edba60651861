//! Laws of following balls.

use super::*;
use crate::pretend::{self, Frames, GOOD_SIGHT, Serve, THESIS_SERVE};
use crate::{Fusion, Settings};

const SERVE: Serve = Serve { launch_ns: 100_000_000, ..THESIS_SERVE };

/// What grew on some frames that go on; from 0.13 s after the launch the ball is seen.
fn followed(frames: &Frames) -> Fusion {
    pretend::fed(pretend::reference_rig(), Settings::default(), frames).0
}

#[test]
fn a_ball_is_followed_through_its_bounce() {
    let (frames, truths) = pretend::seen(&[SERVE], 120, &GOOD_SIGHT, 1);
    let fusion = followed(&frames);
    let [tracklet] = &fusion.tracklets.all[..] else { panic!("one ball") };
    let n_spots: usize = frames.iter().map(|(_, frame)| frame.spots.len()).sum();
    // All but what is claimed before the seed, which looks WINDOW_S back.
    assert!(tracklet.tokens.len() + 8 >= n_spots, "{} {n_spots}", tracklet.tokens.len());
    for token in &tracklet.tokens {
        let is_after = token.t_ns > truths[0].bounce.t_ns;
        assert_eq!(token.n_bounces, u32::from(is_after), "{token:?}");
    }
    assert!(tracklet.has_bounced());
    assert!(tracklet.falling.as_ref().is_some_and(|m| m.t_ns < truths[0].bounce.t_ns));
}

#[test]
fn ten_frames_without_the_ball_in_both_cameras_are_bridged() {
    for gap in [50..60, 60..70, 90..100] {
        let (mut frames, _) = pretend::seen(&[SERVE], 115, &GOOD_SIGHT, 2);
        let n_spots: usize = frames.iter().map(|(_, frame)| frame.spots.len()).sum();
        for (_, frame) in frames.iter_mut().filter(|(_, f)| gap.contains(&f.frame_idx)) {
            frame.spots.clear();
        }
        let fusion = followed(&frames);
        let [tracklet] = &fusion.tracklets.all[..] else { panic!("one ball, {gap:?}") };
        // Twenty are hidden, and a few go with the doubt of the gap.
        let n = tracklet.tokens.len();
        assert!(n + 20 + 8 >= n_spots, "{n} of {n_spots}, {gap:?}");
    }
}

#[test]
fn two_balls_at_once_are_two_tracklets_of_one_ball_each() {
    let later = Serve { launch_ns: 220_000_000, azimuth_rad: 0.06, ..SERVE };
    let serves = [Serve { azimuth_rad: -0.06, ..SERVE }, later];
    let (frames, _) = pretend::seen(&serves, 100, &GOOD_SIGHT, 3);
    let fusion = followed(&frames);
    assert_eq!(fusion.tracklets.all.len(), 2);
    let sides = fusion.tracklets.all.iter().map(|tracklet| {
        let x_m = tracklet.motion.state.position_m.x;
        let y_m = tracklet.motion.state.position_m.y;
        assert!((x_m.abs() - 0.06 * y_m).abs() < 0.1, "at {x_m}, {y_m} m");
        x_m > 0.0
    });
    let sides: Vec<bool> = sides.collect();
    assert_ne!(sides[0], sides[1]);
    let ids = |i: usize| fusion.tracklets.all[i].tokens.iter().map(|token| token.id);
    assert!(ids(0).all(|id| ids(1).all(|other| id != other)), "no spot is of both");
}

#[test]
fn a_tracklet_that_finds_nothing_ends_and_is_forgotten_when_its_ball_is_down() {
    let (mut frames, _) = pretend::seen(&[SERVE], 250, &GOOD_SIGHT, 4);
    for (_, frame) in frames.iter_mut().filter(|(_, frame)| frame.frame_idx > 60) {
        frame.spots.clear();
    }
    let shown: Frames = frames.iter().filter(|(_, f)| f.frame_idx < 80).cloned().collect();
    let fusion = followed(&shown);
    let [tracklet] = &fusion.tracklets.all[..] else { panic!("one ball") };
    let last_ns = tracklet.last_ns;
    assert_eq!(last_ns, 60 * pretend::PERIOD_NS);
    assert!(!tracklet.has_ended(later_ns(last_ns, SILENCE_S - 1e-3)));
    let ended_ns = later_ns(last_ns, SILENCE_S + 1e-3);
    assert!(tracklet.has_ended(ended_ns) && !tracklet.is_due(ended_ns), "it is in the air");
    assert!(tracklet.is_due(later_ns(last_ns, DUE_MAX_S + SILENCE_S)));
    assert_eq!(followed(&frames).tracklets.all, []);
}

#[test]
fn there_are_never_more_than_the_maximum_and_the_least_worthy_goes() {
    let (frames, _) = pretend::seen(&[SERVE], 60, &GOOD_SIGHT, 5);
    let Fusion { mut tracklets, mut history, rig, physics, .. } = followed(&frames);
    let world = World { rig: &rig, physics: &physics, clock_s: [0.0, 1e-3] };
    let one = tracklets.all.remove(0);
    let n = MAX_TRACKLETS + 5;
    tracklets.all = (0..n).map(|i| Tracklet { worth: i as f64, ..one.clone() }).collect();
    let mut dropped = Dropped::default();
    tracklets.sow(&[], &mut history, &world, &mut dropped);
    let worths: Vec<f64> = tracklets.all.iter().map(|tracklet| tracklet.worth).collect();
    assert_eq!(worths, (5..n).rev().map(|i| i as f64).collect::<Vec<_>>());
    assert_eq!(dropped.n_tracklets_beyond_max, 5);
}

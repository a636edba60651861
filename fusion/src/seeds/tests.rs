//! Laws of [`super`].

use super::*;
use crate::matched::{self, Period};
use crate::pretend::{self, Frames, GOOD_SIGHT, PERIOD_NS, POOR_SIGHT, Serve, Sight};
use crate::world::rectification::Rectification;
use crate::{Settings, points, rectified};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shm_layout::Candidate;

/// The best seed of every frame of a stream in which nothing is ever claimed.
fn seeds_of(frames: &Frames) -> Vec<Seed> {
    let (rig, settings) = (pretend::reference_rig(), Settings::default());
    let rectification = Rectification::from_rig(&rig);
    let world = World { rig: &rig, physics: &rig.physics(), clock_s: [0.0, 6.4e-3] };
    let (mut history, mut seeds) = (History::default(), Seeds::default());
    let (mut found, mut dropped) = (Vec::new(), Dropped::default());
    let rectify = rectified::from_candidates;
    for (camera, frame) in frames {
        history.push(rectify(*camera, frame, &rig, &rectification, &settings, &mut dropped));
        history.count_clutter(*camera);
        let [left, right] = Camera::BOTH.map(|camera| history.newest(camera));
        let (Some(left), Some(right)) = (left, right) else { continue };
        if *camera == Camera::Left || !matched::is_same_instant(left, right, Period::default().ns())
        {
            continue;
        }
        let pairs =
            matched::from_frames(left, right, &rectification, &world, &settings, &mut dropped);
        let t_ns = frame.exposed_ns;
        let frame = points::from_matched(&pairs, t_ns, &rectification, &world, &mut dropped);
        found.extend(seeds.update(frame, &history, &world, &mut dropped).into_iter().next());
    }
    found
}

#[test]
fn a_flight_is_found_among_twenty_false_spots() {
    let sight = Sight { n_false: 20, ..POOR_SIGHT };
    for seed in 0..5 {
        let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 100_000_000);
        let (frames, truths) = pretend::seen(&[serve], 100, &sight, seed);
        let found = seeds_of(&frames);
        assert!(!found.is_empty(), "seed {seed}");
        let times: Vec<StampNs> = found.iter().map(|seed| seed.t_ns).collect();
        let mut sorted = times.clone();
        sorted.sort_unstable();
        let places = pretend::flown(&serve, &sorted).positions_m;
        let n_true = found.iter().filter(|seed| {
            let place = places[sorted.binary_search(&seed.t_ns).unwrap()];
            // Two points 0.3 px off at 25 m are 4 cm off, 0.5 m with 3.5 px between unpaired
            // frames; a false flight is anywhere in 20 m.
            place.is_some_and(|place| (place - seed.state.position_m).norm() < 0.5)
        });
        let (n_true, first_ns) = (n_true.count(), sorted[0]);
        println!("seed {seed}: {n_true} of {} true, first {first_ns}", found.len());
        assert!(n_true * 10 >= found.len() * 9, "seed {seed}: {n_true} of {}", found.len());
        // It is seen 5.5 m out, after 0.22 s; then the window twice over.
        let late_s = seconds_between(serve.launch_ns, first_ns);
        assert!(late_s < 0.22 + 2.0 * WINDOW_S, "seed {seed}: {late_s} s");
        assert!(first_ns < truths[0].bounce.t_ns);
    }
}

#[test]
fn a_ball_in_one_camera_and_false_spots_in_the_other_are_no_seed() {
    // By chance two of five spots are nowhere near the curve of the other camera's ball in more
    // than one of 10^4 hypotheses.
    let sight = Sight { n_false: 5, ..GOOD_SIGHT };
    for seed in 0..10 {
        let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 0);
        let (mut frames, _) = pretend::seen(&[serve], 80, &sight, seed);
        for (camera, frame) in &mut frames {
            // The ball comes last.
            let n = if *camera == Camera::Right { 5 } else { 6 };
            frame.spots.truncate(n);
        }
        let found = seeds_of(&frames);
        assert!(found.is_empty(), "seed {seed}: {found:?}");
    }
}

#[test]
fn what_stands_still_is_no_seed() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut frames = Frames::new();
    for i in 0..300 {
        for (camera, x_px) in [(Camera::Left, 380.0), (Camera::Right, 250.0)] {
            let mut wobble = || rng.random_range(-0.5..0.5_f32);
            // Not in equal steps: those are what a ball leaves that passes one in each frame.
            let things = [100.0, 150.0, 280.0, 420.0];
            let spots = things.map(|y_px| Candidate::at(x_px + wobble(), y_px + wobble()));
            frames.push((camera, pretend::frame(i as u64, i * PERIOD_NS, spots.to_vec())));
        }
    }
    assert_eq!(seeds_of(&frames), []);
}

#[test]
fn pairs_and_points_beyond_the_maximum_are_dropped_and_counted() {
    let rig = pretend::reference_rig();
    let world = World { rig: &rig, physics: &rig.physics(), clock_s: [0.0, 6.4e-3] };
    let point = pretend::exact_points(30)[29];
    let crowd = |i: i64, n: usize| {
        let t_ns = point.t_ns + i * 50_000_000;
        // 1 m apart in 50 ms: 20 m/s from each of the one to each of the next.
        let at = |k: usize| Point {
            t_ns,
            position_m: point.position_m + Vector3::new(0.01 * k as f64, i as f64, 0.0),
            ..point
        };
        PointFrame { t_ns, points: (0..n).map(at).collect() }
    };
    let (mut seeds, mut dropped) = (Seeds::default(), Dropped::default());
    let history = History::default();
    assert_eq!(seeds.update(crowd(0, 20), &history, &world, &mut dropped), []);
    assert_eq!(dropped, Dropped::default());
    seeds.update(crowd(1, 20), &history, &world, &mut dropped);
    assert_eq!(dropped.n_pairs_beyond_max, 400 - MAX_PAIRS as u64);
    seeds.update(crowd(9, MAX_POINTS + 8), &history, &world, &mut dropped);
    assert_eq!(dropped.n_points_beyond_max, 8);
    assert_eq!(dropped.n_pairs_beyond_max, 400 - MAX_PAIRS as u64, "the others are old");
    for i in 0..1000 {
        let frame = PointFrame { t_ns: point.t_ns + 500_000_000 + i, points: Vec::new() };
        seeds.update(frame, &history, &world, &mut dropped);
        assert!(seeds.instants.len() <= MAX_INSTANTS);
    }
}

//! Laws of the whole chain.

use super::*;
use nalgebra::{Point3, Vector3};
use pretend::{POOR_SIGHT, Serve, Sight};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::Distribution as _;
use shm_layout::Candidate;

/// Runs what both cameras see through the whole chain.
fn shots_of(serves: &[Serve], n_frames: usize, sight: &Sight, seed: u64) -> (Vec<Shot>, Fusion) {
    let (frames, _) = pretend::seen(serves, n_frames, sight, seed);
    let (fusion, shots) = pretend::told(pretend::reference_rig(), Settings::default(), &frames);
    (shots, fusion)
}

#[test]
fn twenty_seeded_shots_land_within_5_cm() {
    // 0.3 px and half the pairs: 1.5-2 cm along, 3 mm across; 5 cm is three sigma.
    for seed in 0..20 {
        let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 200_000_000);
        let truth = pretend::flown(&serve, &[]).bounce;
        let (shots, fusion) = shots_of(&[serve], 180, &POOR_SIGHT, seed);
        assert_eq!(shots.len(), 1, "seed {seed}: {:?}", fusion.rejected());
        assert_eq!(shots[0].outcome, Outcome::Measured, "seed {seed}");
        let bounce = shots[0].bounce.as_ref().unwrap();
        let launch = shots[0].launch.as_ref().unwrap();
        let direction = launch.direction.unwrap();
        let off = bounce.position_m - truth.position_m;
        let [[xx, _], [_, yy]] = bounce.covariance_m2;
        let in_off = bounce.velocity_in_m_s.norm() - truth.velocity_in_m_s.norm();
        let launch_off = launch.velocity_m_s.norm() - serve.speed_m_s;
        let elevation_off = (direction.elevation_rad - serve.elevation_rad).to_degrees();
        println!(
            "seed {seed:2}: bounce {:+.3} {:+.3} m (sigma {:.3} {:.3}), speed in {in_off:+.2} \
             m/s, launch {launch_off:+.2} m/s (sigma {:.2}) {elevation_off:+.2} deg",
            off.x,
            off.y,
            xx.sqrt(),
            yy.sqrt(),
            launch.speed_sigma_m_s,
        );
        assert!(off.norm() < 0.05, "seed {seed}: {off}");
        assert!(in_off.abs() < 0.5, "seed {seed}");
        assert!(launch_off.abs() < 5.0 * launch.speed_sigma_m_s, "seed {seed}");
    }
}

#[test]
fn cameras_half_a_frame_apart_measure_nearly_as_well() {
    let sight = Sight { right_offset_ns: 5_500_000, ..POOR_SIGHT };
    for seed in 0..10 {
        let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 200_000_000);
        let truth = pretend::flown(&serve, &[]).bounce;
        let (shots, _) = shots_of(&[serve], 180, &sight, seed);
        let off = shots[0].bounce.as_ref().unwrap().position_m - truth.position_m;
        println!("seed {seed}: bounce {:+.3} {:+.3} m", off.x, off.y);
        assert!(off.norm() < 0.07, "seed {seed}: {off}");
    }
}

#[test]
fn three_shots_three_seconds_apart_are_three() {
    for seed in 100..110 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let at = |i: i64| 500_000_000 + i * 3_000_000_000;
        let serves: Vec<Serve> = (0..3).map(|i| Serve::random(&mut rng, at(i))).collect();
        let (shots, fusion) = shots_of(&serves, 10 * 90, &POOR_SIGHT, seed);
        let outcomes: Vec<Outcome> = shots.iter().map(|shot| shot.outcome).collect();
        println!("seed {seed}: {outcomes:?} {:?}", fusion.rejected());
        assert_eq!(outcomes, [Outcome::Measured; 3]);
    }
}

#[test]
fn noise_alone_is_no_shot() {
    for n_false in [2, 5, 20] {
        let sight = Sight { n_false, ..POOR_SIGHT };
        let (shots, fusion) = shots_of(&[], 20 * 90, &sight, 7);
        println!("{n_false} false spots: {:?} {:?}", fusion.rejected(), fusion.dropped());
        assert!(shots.is_empty());
    }
}

#[test]
fn a_shot_is_told_when_it_is_decided_and_not_at_the_end() {
    let serve = Serve { launch_ns: 200_000_000, ..pretend::THESIS_SERVE };
    let (frames, truths) = pretend::seen(&[serve], 400, &POOR_SIGHT, 3);
    let mut fusion = Fusion::new(pretend::reference_rig(), Settings::default());
    let told = frames.iter().find(|(camera, frame)| !fusion.update(*camera, frame).is_empty());
    let late_s = seconds_between(truths[0].bounce.t_ns, told.unwrap().1.exposed_ns);
    assert!(late_s < 0.8, "{late_s} s after the bounce");
}

/// When a shot is told, after its bounce, and how far its bounce is off.
fn told_after(serve: &Serve, seed: u64, tells_early: bool) -> [f64; 2] {
    let (frames, truths) = pretend::seen(&[*serve], 400, &POOR_SIGHT, seed);
    let settings = Settings { tells_early, ..Settings::default() };
    let mut fusion = Fusion::new(pretend::reference_rig(), settings);
    let (shots, frame) = frames
        .iter()
        .map(|(camera, frame)| (fusion.update(*camera, frame), frame))
        .find(|(shots, _)| !shots.is_empty())
        .expect("a shot is told");
    assert_eq!((shots.len(), shots[0].outcome), (1, Outcome::Measured), "seed {seed}");
    let off = shots[0].bounce.as_ref().unwrap().position_m - truths[0].bounce.position_m;
    [seconds_between(truths[0].bounce.t_ns, frame.exposed_ns), off.norm()]
}

#[test]
fn a_shot_that_is_told_early_is_whole_and_its_bounce_as_good() {
    let (mut sooner_s, mut off_m) = (Vec::new(), [0.0; 2]);
    for seed in 0..20 {
        let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(seed), 200_000_000);
        let [usual, early] = [false, true].map(|is_early| told_after(&serve, seed, is_early));
        sooner_s.push(usual[0] - early[0]);
        off_m = [off_m[0] + usual[1].powi(2), off_m[1] + early[1].powi(2)];
    }
    sooner_s.sort_by(f64::total_cmp);
    println!("sooner by {sooner_s:.3?} s, bounces off by {off_m:.5?} m2");
    // One frame in place of four; where half the sightings are missed it may gain nothing.
    assert!(sooner_s[0] >= 0.0 && sooner_s[10] > 0.025, "{sooner_s:?}");
    // RMS of twenty, which is known to a sixth of itself.
    assert!(off_m[1].sqrt() < 1.3 * off_m[0].sqrt(), "{off_m:?}");
}

#[test]
fn a_rig_without_a_court_measures_speed_and_says_so() {
    let serve = Serve { launch_ns: 200_000_000, ..pretend::THESIS_SERVE };
    let (frames, _) = pretend::seen(&[serve], 180, &POOR_SIGHT, 3);
    let mut fusion = Fusion::new(pretend::courtless_rig(), Settings::default());
    let mut shots: Vec<Shot> =
        frames.iter().flat_map(|(camera, frame)| fusion.update(*camera, frame)).collect();
    shots.extend(fusion.finish());
    assert_eq!(shots[0].outcome, Outcome::NoCourt);
    let launch = shots[0].launch.as_ref().unwrap();
    assert!((20.0..27.8).contains(&launch.velocity_m_s.norm()), "{launch:?}");
    assert_eq!((launch.direction, &shots[0].bounce), (None, &None));
}

/// What both cameras see of a toss by hand over the model, 90 frames/s, and where it bounces.
fn desk_toss(rig: &Rig, elevation_deg: f64) -> (pretend::Frames, Point3<f64>) {
    const STEP_S: f64 = 1e-5;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let noise_px = rand_distr::Normal::new(0.0, 0.15).unwrap();
    // A toss of 4.5 m/s; the clay of the file, a drag coefficient of 0.55, ten times gravity.
    let drag_per_m = 0.5 * 1.2 * std::f64::consts::PI * 0.033_f64.powi(2) / 0.25 * 0.55;
    let (sin, cos) = elevation_deg.to_radians().sin_cos();
    let (mut p, mut v) = (Point3::new(0.0, 0.0, 1.0), Vector3::new(0.01, cos, sin) * 45.0);
    let (mut bounce, mut frames, mut flown_s) = (None, Vec::new(), 0.0);
    for frame_idx in 0..120 {
        let t_s = frame_idx as f64 / 90.0 - 0.5;
        while flown_s < t_s {
            v -= (v * v.norm() * drag_per_m + Vector3::z() * 98.1) * STEP_S;
            p += v * STEP_S;
            flown_s += STEP_S;
            if p.z < 0.033 && v.z < 0.0 {
                bounce.get_or_insert(p);
                v = Vector3::new(v.x, 0.7 * v.y, -0.7 * v.z);
            }
        }
        for camera in Camera::BOTH {
            let raw = rig.raw_from_tracking(camera, &p).filter(|_| t_s >= 0.0);
            let spot = raw.filter(|raw| rig.eye(camera).lens.contains(*raw)).map(|raw| {
                let mut off = || noise_px.sample(&mut rng);
                Candidate::at((raw.x_px + off()) as f32, (raw.y_px + off()) as f32)
            });
            let exposed_ns = frame_idx * 1_000_000_000 / 90;
            let spots = spot.into_iter().collect();
            frames.push((camera, pretend::frame(frame_idx as u64, exposed_ns, spots)));
        }
    }
    (frames, bounce.unwrap())
}

#[test]
fn a_toss_over_the_model_on_a_desk_is_measured_as_if_it_were_a_court() {
    let rig: Rig = include_str!("../rigs/desk.toml").parse().unwrap();
    assert_eq!((rig.scale(), rig.physics().gravity_m_s2.z), (0.1, -98.1));
    for elevation_deg in [20.0, 24.0, 28.0] {
        let (frames, bounce_m) = desk_toss(&rig, elevation_deg);
        let (fusion, shots) = pretend::told(rig.clone(), Settings::default(), &frames);
        assert_eq!(shots.len(), 1, "{elevation_deg}: {:?}", fusion.rejected());
        assert_eq!(shots[0].outcome, Outcome::Measured);
        let off_m = shots[0].bounce.as_ref().unwrap().position_m - bounce_m;
        println!("{elevation_deg} deg: {bounce_m}, {:.2} mm off on the desk", 100.0 * off_m.norm());
        assert!(off_m.xy().norm() < 0.05, "{off_m}");
    }
}

#[test]
fn one_stamp_from_the_future_does_not_blind_a_camera() {
    let serve = Serve { launch_ns: 700_000_000, ..pretend::THESIS_SERVE };
    let (mut frames, _) = pretend::seen(&[serve], 220, &POOR_SIGHT, 3);
    frames[4].1.exposed_ns = i64::MAX;
    frames[9].1.exposed_ns = i64::MAX - 1;
    let mut fusion = Fusion::new(pretend::reference_rig(), Settings::default());
    let mut shots: Vec<Shot> =
        frames.iter().flat_map(|(camera, frame)| fusion.update(*camera, frame)).collect();
    shots.extend(fusion.finish());
    assert_eq!(shots.iter().map(|s| s.outcome).collect::<Vec<_>>(), [Outcome::Measured]);
}

#[test]
fn what_cannot_be_is_dropped_and_never_a_panic() {
    let serve = Serve { launch_ns: 200_000_000, ..pretend::THESIS_SERVE };
    let (mut frames, _) = pretend::seen(&[serve], 180, &POOR_SIGHT, 3);
    for (i, (_, frame)) in frames.iter_mut().enumerate() {
        match i % 5 {
            0 => frame.spots.push(Candidate { x_px: f32::NAN, ..Candidate::default() }),
            1 => frame.spots.push(Candidate { x_px: -1e30, ..Candidate::default() }),
            2 if i % 50 == 2 => frame.exposed_ns = i64::MIN,
            _ => {}
        }
    }
    let mut fusion = Fusion::new(pretend::reference_rig(), Settings::default());
    let mut shots: Vec<Shot> =
        frames.iter().flat_map(|(camera, frame)| fusion.update(*camera, frame)).collect();
    shots.extend(fusion.finish());
    assert_eq!(shots.len(), 1);
    let dropped = fusion.dropped();
    assert!(dropped.n_not_finite == 72 && dropped.n_outside_image == 72, "{dropped:?}");
    assert!(dropped.n_backward_frames > 0);
}

/// How long both cameras' stamps are said to be off at most, and what they really are.
fn stamped(frames: &mut pretend::Frames, sigma_ns: u32, right_ahead_ns: StampNs) {
    pretend::set_right_clock(frames, right_ahead_ns);
    frames.iter_mut().for_each(|(_, frame)| frame.clock_sigma_ns = sigma_ns);
}

#[test]
fn stamps_on_one_clock_tell_what_a_shot_alone_does_not() {
    let serve = Serve { launch_ns: 200_000_000, ..pretend::THESIS_SERVE };
    let (frames, _) = pretend::seen(&[serve], 180, &POOR_SIGHT, 3);
    let clock_of = |sigma_ns| {
        let mut frames = frames.clone();
        stamped(&mut frames, sigma_ns, 0);
        let (fusion, shots) = pretend::told(pretend::reference_rig(), Settings::default(), &frames);
        assert_eq!(shots.len(), 1);
        assert_eq!(fusion.dropped().n_stamps_contradicted, 0);
        shots[0].clock.unwrap()
    };
    let (alone, known) = (clock_of(shm_layout::stamp::OWN_CLOCK), clock_of(30_000));
    println!("alone {alone:?}, with stamps on one clock {known:?}");
    // 30 µs of each camera are 42 of both.
    assert!(alone.sigma_s > 60e-6 && known.sigma_s < 42.5e-6);
    assert!(known.right_minus_left_s.abs() < alone.right_minus_left_s.abs());
}

#[test]
fn stamps_that_are_not_as_good_as_they_say_spoil_no_shot() {
    let at = |launch_ns| Serve { launch_ns, ..pretend::THESIS_SERVE };
    let serves = [at(200_000_000), at(3_200_000_000)];
    let truth = pretend::flown(&serves[0], &[]).bounce;
    for ahead_ns in [-3_000_000, 1_500_000, 3_000_000] {
        let (mut frames, _) = pretend::seen(&serves, 460, &POOR_SIGHT, 3);
        stamped(&mut frames, 20_000, ahead_ns);
        let (fusion, shots) = pretend::told(pretend::reference_rig(), Settings::default(), &frames);
        assert_eq!(shots.len(), 2, "{:?}", fusion.rejected());
        for shot in &shots {
            let off = shot.bounce.as_ref().unwrap().position_m - truth.position_m;
            let clock = shot.clock.unwrap();
            println!("{ahead_ns} ns: bounce {:+.3} {:+.3} m, {clock:?}", off.x, off.y);
            assert!(off.norm() < 0.05, "{ahead_ns} ns: {off}");
            let clock_off_s = clock.right_minus_left_s - ahead_ns as f64 * 1e-9;
            assert!(clock_off_s.abs() < 4.0 * clock.sigma_s, "{ahead_ns} ns: {clock:?}");
        }
        assert_eq!(fusion.dropped().n_stamps_contradicted, 1, "the second knows better");
    }
}

/// The right camera's frames of some time come when its link is back, all at once.
fn cut(frames: &pretend::Frames, off_s: std::ops::Range<f64>) -> pretend::Frames {
    let [from_ns, to_ns] = [off_s.start, off_s.end].map(|s| (s * 1e9) as StampNs);
    let is_cut = |(camera, frame): &(Camera, FrameCandidates)| {
        *camera == Camera::Right && (from_ns..to_ns).contains(&frame.exposed_ns)
    };
    let (late, mut out): (Vec<_>, Vec<_>) = frames.iter().cloned().partition(is_cut);
    let back = out.partition_point(|(_, frame)| frame.exposed_ns < to_ns);
    out.splice(back..back, late);
    out
}

#[test]
fn a_shot_that_fell_into_an_outage_of_three_seconds_is_the_same_to_the_last_bit() {
    let at = |launch_ns| Serve { launch_ns, ..pretend::THESIS_SERVE };
    let serves = [at(1_000_000_000), at(4_000_000_000), at(11_500_000_000)];
    for (sigma_ns, off_s) in [(shm_layout::stamp::OWN_CLOCK, 3.5..6.5), (200_000, 2.0..11.9)] {
        let (mut frames, _) = pretend::seen(&serves, 1300, &POOR_SIGHT, 3);
        stamped(&mut frames, sigma_ns, 0);
        let told = |frames| pretend::told(pretend::reference_rig(), Settings::default(), frames);
        let (prompt_fusion, prompt) = told(&frames);
        let (late_fusion, late) = told(&cut(&frames, off_s));
        assert_eq!(prompt.len(), 3, "{:?}", prompt_fusion.rejected());
        assert_eq!(late, prompt);
        assert_eq!(late_fusion.clock(), prompt_fusion.clock());
        assert_eq!(late_fusion.dropped(), prompt_fusion.dropped());
        assert_eq!(late_fusion.rejected(), prompt_fusion.rejected());
    }
}

#[test]
fn a_shot_in_an_outage_is_told_when_the_link_is_back_and_not_without_it() {
    let serve = Serve { launch_ns: 2_000_000_000, ..pretend::THESIS_SERVE };
    let (frames, _) = pretend::seen(&[serve], 720, &POOR_SIGHT, 3);
    let mut fusion = Fusion::new(pretend::reference_rig(), Settings::default());
    let frames = cut(&frames, 1.5..4.5);
    let told = frames.iter().position(|(camera, frame)| !fusion.update(*camera, frame).is_empty());
    let (camera, frame) = &frames[told.unwrap()];
    assert_eq!(*camera, Camera::Right);
    // The burst gives all that left waits for, up to what decides the shot: 0.8 s after it.
    let since_s = seconds_between(serve.launch_ns, frame.exposed_ns);
    assert!((1.0..2.0).contains(&since_s), "{since_s} s");
}

/// Lost frames of each camera of the only shot, some of the right camera's frames having been lost.
fn lost_of(n_frames: usize, is_lost: impl Fn(u64) -> bool) -> [Option<u64>; 2] {
    let serve = Serve { launch_ns: 1_000_000_000, ..pretend::THESIS_SERVE };
    let (mut frames, _) = pretend::seen(&[serve], n_frames, &POOR_SIGHT, 3);
    frames.retain(|(camera, frame)| *camera == Camera::Left || !is_lost(frame.frame_idx));
    let (fusion, shots) = pretend::told(pretend::reference_rig(), Settings::default(), &frames);
    assert_eq!(shots.len(), 1, "{:?}", fusion.rejected());
    shots[0].frames_lost
}

#[test]
fn a_shot_says_how_many_frames_of_each_camera_never_came() {
    assert_eq!(lost_of(280, |_| false), [Some(0), Some(0)]);
    assert_eq!(lost_of(280, |idx| (120..128).contains(&idx) || idx == 140), [Some(0), Some(9)]);
    assert_eq!(lost_of(280, |idx| idx < 60 && idx > 50), [Some(0), Some(0)], "before the launch");
    assert_eq!(lost_of(280, |_| true), [Some(0), None], "no such camera");
    // Died half a second after the launch; the bounce is a second and a bit after it.
    let [_, died] = lost_of(1300, |idx| idx >= 135);
    assert!((40..90).contains(&died.unwrap()), "{died:?}");
    // Died ten seconds before it.
    let serve = Serve { launch_ns: 11_000_000_000, ..pretend::THESIS_SERVE };
    let (mut frames, _) = pretend::seen(&[serve], 1300, &POOR_SIGHT, 3);
    frames.retain(|(camera, frame)| *camera == Camera::Left || frame.frame_idx < 20);
    let (_, shots) = pretend::told(pretend::reference_rig(), Settings::default(), &frames);
    assert_eq!(shots[0].frames_lost, [Some(0), None]);
}

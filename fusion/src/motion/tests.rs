use super::*;
use crate::pretend::{self, PERIOD_NS, Serve, THESIS_SERVE, flown};
use crate::world::camera::RawPixel;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

fn sighting(camera: Camera, t_ns: StampNs, raw: RawPixel) -> Sighting {
    Sighting { camera, t_ns, raw, covariance_px2: Matrix2::identity() * 0.01, hidden_px2: 0.0 }
}

fn start(state: State, world: &World) -> Motion {
    Motion::new(400_000_000, state, world)
}

/// 1 m off the shot of the thesis, 0.4 s on its way.
fn near_the_shot() -> State {
    let position_m = Point3::new(0.5, 10.5, 1.6);
    State { position_m, velocity_m_s: Vector3::new(1.0, 26.0, 0.0) }
}

#[test]
fn exact_sightings_of_both_cameras_tell_place_and_clock() {
    let (rig, ahead_ns) = (pretend::reference_rig(), 3_000_000);
    let world = World { rig: &rig, physics: &rig.physics(), clock_s: [0.0, 6.4e-3] };
    let times: Vec<StampNs> = (0..45).map(|i| 400_000_000 + i * PERIOD_NS).collect();
    let truth = flown(&THESIS_SERVE, &times).positions_m;
    let mut motion = start(near_the_shot(), &world);
    for (&t_ns, place) in times.iter().zip(&truth) {
        for camera in Camera::BOTH {
            let raw = rig.raw_from_tracking(camera, &place.unwrap()).unwrap();
            let stamp_ns = if camera == Camera::Left { t_ns } else { t_ns + ahead_ns };
            let seen = sighting(camera, stamp_ns, raw);
            let (there, expected) = motion.expected_at(&seen, &world).unwrap();
            motion = there;
            motion.update(&expected, &seen);
        }
    }
    let there = motion.advanced(times[44], &world).unwrap();
    let off_m = (there.state.position_m - truth[44].unwrap()).norm();
    // 1 px is 16 mm across and 8 cm along at 20 m; half of SIGMA_MIN_PX over ten sightings.
    let sigma_m = there.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
    assert!(off_m < 0.05 && off_m < 3.0 * sigma_m, "{off_m} m");
    let (off_s, sigma_s) = (there.clock_s - 3e-3, there.covariance[(CLOCK, CLOCK)].sqrt());
    assert!(off_s.abs() < 3.0 * sigma_s && sigma_s < 1e-3, "{off_s} s, sigma {sigma_s} s");
}

#[test]
fn a_bounce_is_continuous_upwards_and_leaves_a_proper_covariance() {
    let rig = pretend::reference_rig();
    let world = World { rig: &rig, physics: &rig.physics(), clock_s: [0.0, 6.4e-3] };
    for (i, down_m_s) in [0.4, 1.0, 4.0, 9.0, 20.0].into_iter().enumerate() {
        let velocity_m_s = Vector3::new(1.0, 3.0 + 10.0 * i as f64, -down_m_s);
        let high = start(State { velocity_m_s, ..near_the_shot() }, &world);
        let touch_ns = high.touches_before_ns(StampNs::MAX, &world).unwrap();
        let [before, after] =
            [high.advanced(touch_ns, &world), high.bounced(touch_ns, &world)].map(Option::unwrap);
        let moved_m = after.state.position_m - before.state.position_m;
        // The time is that of a parabola, without the change of drag on the way: 1 % of 1.6 m.
        assert!(moved_m.xy().norm() < 1e-12 && moved_m.z.abs() < 0.05, "{moved_m}");
        assert_eq!(after.state.position_m.z, 0.033);
        assert!(after.state.velocity_m_s.z > 0.0);
        assert!(after.state.velocity_m_s.norm() < before.state.velocity_m_s.norm());
        assert!(after.covariance.cholesky().is_some(), "{down_m_s} m/s");
        assert!(after.bounced(after.t_ns, &world).is_none(), "it goes up");
    }
}

#[test]
fn errors_of_a_prediction_are_as_large_as_its_covariance_says() {
    let rig = pretend::reference_rig();
    let world = World { rig: &rig, physics: &rig.physics(), clock_s: [0.0, 1e-5] };
    let times: Vec<StampNs> = (0..30).map(|i| 400_000_000 + i * PERIOD_NS).collect();
    let (mut rng, n_shots) = (ChaCha8Rng::seed_from_u64(5), 60);
    let mut sums = [0.0; 2];
    for _ in 0..n_shots {
        let serve = Serve::random(&mut rng, 0);
        let truth = flown(&serve, &times).positions_m;
        // As far off as a seed is: two points 0.1 s apart, 0.1 m each along the line of sight.
        let off_m = Vector3::new(0.02, 0.1, 0.02);
        let velocity_m_s = (truth[1].unwrap() - truth[0].unwrap()) / (PERIOD_NS as f64 * 1e-9);
        let state = State {
            position_m: truth[0].unwrap() + off_m,
            velocity_m_s: velocity_m_s + off_m * 15.0,
        };
        let mut motion = start(state, &world);
        for (i, (&t_ns, place)) in times.iter().zip(&truth).enumerate() {
            for camera in Camera::BOTH {
                let there = motion.advanced(t_ns, &world).unwrap();
                let off_m = there.state.position_m - place.unwrap();
                let inverse = there.covariance.fixed_view::<3, 3>(0, 0).into_owned().try_inverse();
                let square = off_m.dot(&(inverse.unwrap() * off_m));
                // Of the place now, and of that 10 frames ahead; all are still in the air then.
                if i == 18 || i == 28 {
                    sums[(i - 18) / 10] += 0.5 * square / f64::from(n_shots);
                }
                if i < 18 {
                    let noise = Normal::new(0.0, 0.3).unwrap();
                    let mut raw = rig.raw_from_tracking(camera, &place.unwrap()).unwrap();
                    raw.x_px += noise.sample(&mut rng);
                    raw.y_px += noise.sample(&mut rng);
                    let seen = Sighting {
                        covariance_px2: Matrix2::identity() * 0.09,
                        ..sighting(camera, t_ns, raw)
                    };
                    let (there, expected) = motion.expected_at(&seen, &world).unwrap();
                    motion = there;
                    motion.update(&expected, &seen);
                }
            }
        }
    }
    // Three axes: 3 if the covariance is right; noise is taken 1.3 times too large and lift may
    // wander more than it does, so less. Not a third of that, or the gates would let in anything.
    println!("mean square of errors, in covariances: {sums:?}");
    assert!(sums.iter().all(|sum| (0.3..3.5).contains(sum)), "{sums:?}");
}

#[test]
fn a_ball_that_hardly_rises_rolls_on_the_ground_and_slows() {
    let rig = pretend::reference_rig();
    let world = World { rig: &rig, physics: &rig.physics(), clock_s: [0.0, 6.4e-3] };
    let position_m = Point3::new(0.0, 15.0, 0.034);
    let low = start(State { position_m, velocity_m_s: Vector3::new(0.0, 9.0, -0.4) }, &world);
    let touch_ns = low.touches_before_ns(StampNs::MAX, &world).unwrap();
    let rolling = low.bounced(touch_ns, &world).unwrap();
    let first_m_s = rolling.state.velocity_m_s.xy().norm();
    for tenth in 1..=30 {
        let dt_s = 0.1 * f64::from(tenth);
        let there = rolling.advanced(later_ns(touch_ns, dt_s), &world).unwrap();
        assert!((there.state.position_m.z - 0.033).abs() < 1e-12, "{:?}", there.state);
        assert!(there.state.position_m.y > 15.0, "{:?}", there.state);
        let lost_m_s = first_m_s - there.state.velocity_m_s.xy().norm();
        assert!((lost_m_s - ROLLING_M_S2 * dt_s).abs() < 1e-6, "{lost_m_s} m/s after {dt_s} s");
        assert!(there.touches_before_ns(StampNs::MAX, &world).is_none(), "it stays there");
    }
}

#[test]
fn under_a_rolling_shutter_a_ball_is_expected_at_the_time_of_its_own_row() {
    let text = pretend::REFERENCE_RIG.replace("row_time_us         = 0.0", "row_time_us = 20.0");
    let (rig, flat) = (text.parse::<Rig>().unwrap(), pretend::reference_rig());
    let world = World { rig: &rig, physics: &rig.physics(), clock_s: [0.0, 6.4e-3] };
    for camera in Camera::BOTH {
        for frame_ns in [400_000_000, 600_000_000, 800_000_000] {
            let motion = start(near_the_shot(), &world);
            let (there, expected) = motion.expected(camera, frame_ns, &world).unwrap();
            // The ball crosses less than 1000 px/s and all rows take 9.6 ms. The middle row is at
            // most 240 rows off, the first guess 4.8 px, the second 0.1 px: 2 µs.
            let row_ns = frame_ns + (expected.pixel_px.y * 20e3) as StampNs;
            assert!(row_ns.abs_diff(there.t_ns) < 2_000, "{row_ns} {}", there.t_ns);
            let then = motion.advanced(there.t_ns, &world).unwrap();
            let raw = flat.raw_from_tracking(camera, &then.state.position_m).unwrap();
            let off_px = expected.pixel_px - Vector2::new(raw.x_px, raw.y_px);
            assert!(off_px.norm() < 1e-9, "{off_px}");
        }
    }
}

//! A machine's promises: the scatter that was measured, and the same chances for everybody.

use super::actuators::Build;
use super::*;
use crate::sessions::targets;

const TOLD: Told =
    Told { speed_m_s: 24.0, elevation_rad: 0.17, azimuth_rad: 0.03, backspin_rad_s: -40.0 };

fn machine(build: Build) -> Machine {
    Machine::with(Actuators::exact(build), 7)
}

#[test]
fn two_who_tell_it_other_things_meet_the_same_chances() {
    let machine = machine(Build::REAL);
    let faster = Told { speed_m_s: 26.0, ..TOLD };
    for ball_idx in [0, 1, 17] {
        let fired = |told| machine.fired(told, ball_idx, 1.0).unwrap().remove(0);
        let (a, b) = (fired(&TOLD), fired(&faster));
        assert_eq!(a, fired(&TOLD));
        assert_eq!(a.wind_m_s, b.wind_m_s);
        assert_eq!(a.launch.drag_coefficient, b.launch.drag_coefficient);
        // Motors move in steps: 24 m/s is 86.4 km/h, 26 m/s is 93.6 km/h.
        assert!((a.launch.speed_m_s / 24.0 - b.launch.speed_m_s / 26.0).abs() < 1e-9);
    }
    let [a, b] = [0, 1].map(|idx| machine.fired(&TOLD, idx, 1.0).unwrap().remove(0));
    assert_ne!(a.launch.speed_m_s, b.launch.speed_m_s);
}

#[test]
fn a_stopped_machine_fires_nothing_and_a_jam_lets_nothing_out() {
    let mut machine = machine(Build::REAL);
    machine.faults = vec![Some(Fault::Jam), Some(Fault::Two), Some(Fault::Dead), None];
    let n = |machine: &Machine, idx| machine.fired(&TOLD, idx, 1.0).unwrap().len();
    assert_eq!([0, 1, 2, 3].map(|idx| n(&machine, idx)), [0, 2, 1, 1]);
    let dead = machine.fired(&TOLD, 2, 1.0).unwrap()[0].launch.speed_m_s;
    assert!((dead / 24.0 - 0.85).abs() < 0.07, "{dead}");
    machine.is_stopped = true;
    assert_eq!(machine.fired(&TOLD, 3, 1.0), Err(Refusal::Stopped));
}

#[test]
fn a_ball_that_would_fly_over_the_fence_lands_behind_it() {
    let world = World::default();
    let launch = Launch {
        launched_at_s: 0.0,
        position_in_court_m: Point3::new(0.0, 0.0, 1.0),
        speed_m_s: 40.0,
        elevation_rad: 0.5,
        azimuth_rad: 0.0,
        backspin_rad_s: 0.0,
        drag_coefficient: world.drag_coefficient,
        lift_scale: 1.0,
    };
    assert!(landing_m(&world, &launch).y > world.fence_y_m);
}

/// Along and across, of all targets together, in still air: each target around its own mean.
fn scatter_m(build: Build) -> [f64; 2] {
    let mut machine = machine(build);
    machine.breeze.gust_sigma_m_s = 0.0;
    let world = World::default();
    let n_balls = 200;
    let mut sums = [0.0; 2];
    let targets = targets::six();
    for (target_idx, target) in targets.iter().enumerate() {
        let told = targets::nominal(target);
        let landings_m: Vec<Vector2<f64>> = (0..n_balls)
            .map(|k| {
                let fired = machine.fired(&told, target_idx * n_balls + k, 0.0).unwrap();
                let flight = Flight::first_bounce_ignoring_net(&world, &fired[0].launch);
                flight.unwrap().position_in_court_m.coords.xy()
            })
            .collect();
        let mean_m = landings_m.iter().sum::<Vector2<f64>>() / n_balls as f64;
        for landing_m in &landings_m {
            let off_m = landing_m - mean_m;
            sums[0] += off_m.y * off_m.y;
            sums[1] += off_m.x * off_m.x;
        }
        println!("{}: {:?} lands at {mean_m:?}", target.name, told);
    }
    sums.map(|sum| (sum / (targets.len() * n_balls) as f64).sqrt())
}

#[test]
fn landings_scatter_as_those_of_a_real_machine() {
    let [along_m, across_m] = scatter_m(Build::REAL);
    println!("real: {along_m:.3} m along, {across_m:.3} m across");
    assert!((along_m / 0.52 - 1.0).abs() < 0.06, "{along_m} m along");
    assert!((across_m / 0.26 - 1.0).abs() < 0.06, "{across_m} m across");
}

#[test]
fn a_precise_machine_scatters_far_less() {
    let [along_m, across_m] = scatter_m(Build::PRECISE);
    println!("precise: {along_m:.3} m along, {across_m:.3} m across");
    assert!(along_m < 0.26 && across_m < 0.06, "{along_m} {across_m}");
}

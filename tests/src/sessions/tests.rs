//! What a session promises whoever controls it.

use super::controllers::from_name;
use super::figures::{Row, scatter_m};
use super::*;
use crate::machine::Fired;
use fusion::causes::{CauseColumn, N_CAUSES};

fn played(scene: Scene, controller: &'static str, n_sessions: usize) -> (Variant, Vec<Session>) {
    let variant = Variant { scene, build: Build::PRECISE, controller, is_rendered: false };
    let amount = Amount { n_sessions, n_balls: 13, first_seed: 1 };
    (variant, all(&[variant], &amount, |_| ()).remove(0))
}

#[test]
fn a_session_is_the_same_each_time_and_almost_every_ball_is_measured() {
    let [a, b] = [(); 2].map(|()| played(Scene::Bias, "integrator", 2).1);
    let (mut n_measured, mut n) = (0, 0);
    for (a, b) in a.iter().zip(&b) {
        for (a, b) in a.balls.iter().zip(&b.balls) {
            assert_eq!((a.told, a.measured_off_m), (b.told, b.measured_off_m));
            n_measured += usize::from(a.measured_off_m.is_some_and(|off_m| off_m < 0.1));
            n += usize::from(!a.is_in_net);
        }
    }
    println!("{n_measured} of {n} measured");
    assert!(n_measured * 20 >= n * 19, "{n_measured} of {n}");
}

#[test]
fn what_nobody_corrects_stays_off_and_a_right_machine_is_right() {
    let (_, biased) = played(Scene::Bias, "none", 4);
    for session in &biased {
        let [before_m, after_m] = [0, 13].map(|n| session.systematic_m(n).unwrap());
        assert!(before_m > 0.4 && (before_m - after_m).abs() < 1e-9, "{before_m} {after_m}");
    }
    let (_, right) = played(Scene::Right, "none", 1);
    // Steps of the motors, and 1.21 kg/m3 of air where 1.20 are assumed.
    assert!(right[0].systematic_m(0).unwrap() < 0.15, "{:?}", right[0].systematic_m(0));
}

#[test]
fn an_integrator_takes_back_what_it_sees() {
    let (variant, none) = played(Scene::Bias, "none", 3);
    let (_, sessions) = played(Scene::Bias, "integrator", 3);
    let scatter_m = scatter_m(variant.build, variant.scene);
    let row = Row::from_sessions(variant, &sessions, Some(&none), scatter_m);
    let [before, after] = [0, 5].map(|idx| row.systematic[idx].unwrap().rms_m);
    println!("{before:.2} m, after ten balls {after:.2} m; scatter {scatter_m:.2} m");
    assert!(after < 0.75 * before, "{before} {after}");
}

/// Mean square of what shots say of their causes less the truth, in units of what they say to
/// know; looked at from the truth.
#[test]
fn what_shots_say_of_their_causes_is_true_in_any_wind() {
    let physics = targets::Nominal::default().physics;
    let (mut squares, mut n_told) = (0.0, 0.0);
    // The second one's wind blows at 2.5 to 3.5 m/s across and along.
    for seed in 1..=4 {
        let plan = Plan::drawn(seed, Scene::Bias, Build::REAL, 12);
        let mut blind = from_name("none", &Build::REAL).unwrap();
        let mut watched = watched::Watched::new(seed, Eyes::Drawn);
        let world = watched.scenario().world.clone();
        // What counts is density times drag, and times lift.
        let density = physics.air_density_kg_m3 / world.air_density_kg_m3;
        for (ball_idx, &target_idx) in plan.order.iter().enumerate() {
            let at_s = played::FIRST_LAUNCH_S + ball_idx as f64 * played::PERIOD_S;
            let fired = plan.machine.fired(&blind.told(target_idx), ball_idx, at_s).unwrap();
            let Fired { launch, wind_m_s } = &fired[0];
            let flights = vec![fired[0].flight(&world)];
            let until_s = at_s + played::PERIOD_S - played::MARGIN_S;
            let shots = watched.shots(ball_idx, flights, until_s, None);
            let Some(causes) = shots.first().and_then(|shot| shot.causes) else { continue };
            // A lift that is larger by some part is that of more spin: C_L = S / (2 S + 1).
            let air_speed_m_s = launch.speed_m_s - wind_m_s.y;
            let spin = launch.backspin_rad_s.abs() * world.ball_radius_m / air_speed_m_s;
            let lift = launch.lift_scale * spin / (2.0 * spin + 1.0) / density;
            let lifting_rad_s = lift / (1.0 - 2.0 * lift) * air_speed_m_s / world.ball_radius_m;
            let place_m = launch.position_in_court_m;
            let truth = CauseColumn::from([
                launch.speed_m_s,
                launch.elevation_rad,
                launch.azimuth_rad,
                lifting_rad_s * launch.backspin_rad_s.signum(),
                0.0,
                0.0,
                launch.drag_coefficient / density,
                wind_m_s.x,
                wind_m_s.y,
                place_m.x,
                place_m.z,
            ]);
            let passage = causes.passage(place_m.y, &physics).unwrap();
            let (seen, _) = passage.seen_from(&truth).unwrap();
            let off = seen.likely - truth;
            squares += off.dot(&(seen.information * off));
            n_told += N_CAUSES as f64;
        }
    }
    let mean = squares / n_told;
    println!("mean square {mean:.2} of {n_told} numbers");
    assert!(n_told > 400.0 && (0.6..1.5).contains(&mean), "{mean}");
}

#[test]
fn an_unknown_controller_is_refused_with_those_there_are() {
    assert!(from_name("pid", &Build::REAL).err().unwrap().contains("none, integrator"));
}

#[test]
fn every_line_of_a_table_has_as_many_columns_as_its_head() {
    let (variant, sessions) = played(Scene::WindStep, "none", 1);
    let row = Row::from_sessions(variant, &sessions, None, 0.5);
    let text = table::text_from(&[row]);
    for table in text.split("\n\n") {
        let n_columns = |line: &str| line.matches('|').count();
        let first = table.lines().next().map(n_columns);
        assert!(table.lines().all(|line| Some(n_columns(line)) == first), "{table}");
    }
    let line = table::line_from(&variant, &sessions[0]);
    assert_eq!(line.matches(',').count(), table::LINES_HEAD.matches(',').count());
}

//! What a session promises whoever controls it.

use super::controllers::from_name;
use super::figures::{Row, scatter_m};
use super::*;

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
    let scatter_m = scatter_m(variant.build);
    let row = Row::from_sessions(variant, &sessions, Some(&none), scatter_m);
    let [before, after] = [0, 5].map(|idx| row.systematic[idx].unwrap().rms_m);
    println!("{before:.2} m, after ten balls {after:.2} m; scatter {scatter_m:.2} m");
    assert!(after < 0.75 * before, "{before} {after}");
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

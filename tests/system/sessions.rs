//! The sessions' promises, at candidate level: a machine that is off hits its targets within a few
//! balls. A small part is played again and held against what stands in tests/results/sessions.csv;
//! all of it is `sessions --rendered 10 --write`, tests/results/sessions.md.

use std::process::Stdio;
use std::sync::Arc;

use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use tests::machine::actuators::Build;
use tests::processes::{Household, Until, own_court};
use tests::sessions::figures::{AFTER, Row, scatter_m};
use tests::sessions::scene::{Plan, Scene};
use tests::sessions::served::{self, Served};
use tests::sessions::sighted::{Eyes, Sighted};
use tests::sessions::{self, Amount, Variant, table, targets};
use tests::shot_folder;

/// Another processor rounds otherwise, and a closed loop passes that on.
const SAME_M: f64 = 0.01;
const N_BALLS: usize = 25;

fn variant(scene: Scene, build: Build, controller: &'static str) -> Variant {
    Variant { scene, build, controller, is_rendered: false }
}

/// The first numbers of a line that stands in the repository.
fn kept_m(text: &str, variant: &Variant, seed: u64) -> Vec<f64> {
    let Variant { scene, build, controller, is_rendered } = variant;
    let head = format!("{},{},{controller},{is_rendered},{seed},", scene.name(), build.name);
    let line = text.lines().find_map(|line| line.strip_prefix(&head));
    let line = line.unwrap_or_else(|| panic!("no line begins with {head}"));
    line.split(',').skip(1).map(|number| number.parse().unwrap()).collect()
}

#[test]
fn sessions_end_as_they_are_kept() {
    let text = std::fs::read_to_string(table::lines_path()).unwrap();
    assert_eq!(text.lines().next(), Some(table::LINES_HEAD));
    for (variant, seed) in [
        (variant(Scene::Bias, Build::REAL, "integrator"), 1),
        (variant(Scene::WindStep, Build::REAL, "control"), 2),
        (variant(Scene::Faults, Build::PRECISE, "control"), 3),
        (variant(Scene::Gusts, Build::REAL, "control"), 4),
        (variant(Scene::Wear, Build::PRECISE, "none"), 5),
    ] {
        let session = sessions::one(&variant, seed, N_BALLS, &Arc::default());
        let kept_m = kept_m(&text, &variant, seed);
        for (n_balls, kept_m) in AFTER[1..].iter().zip(kept_m) {
            let off_m = session.systematic_m(*n_balls).unwrap();
            let what = format!("{variant:?}, seed {seed}, after {n_balls}");
            assert!((off_m - kept_m).abs() < SAME_M, "{what}: {off_m} m, was {kept_m} m");
        }
    }
}

#[test]
fn a_machine_that_is_off_hits_its_targets_within_a_few_balls() {
    let amount = Amount { n_sessions: 8, n_balls: N_BALLS, first_seed: 1 };
    let variants = [Build::REAL, Build::PRECISE].map(|b| variant(Scene::Bias, b, "control"));
    let all = sessions::all(&variants, &amount, |_| ());
    for (variant, sessions) in variants.into_iter().zip(&all) {
        let row =
            Row::from_sessions(variant, sessions, None, scatter_m(variant.build, variant.scene));
        let offs_m = row.systematic.map(|systematic| systematic.unwrap().rms_m);
        println!("{}: {offs_m:.3?} m after {AFTER:?} balls", variant.build.name);
        // Eight sessions are few: what 200 give is in the table.
        assert!(offs_m[3] < offs_m[0] / 4.0 && offs_m[6] < offs_m[0] / 6.0, "{offs_m:?}");
        assert!(row.measured_percent.unwrap() > 95.0, "{:?}", row.measured_percent);
        assert!(row.unexplained_worst_m.unwrap() < 1e-6, "{:?}", row.unexplained_worst_m);
    }
}

/// Pixels, workers, fusion, control: what the machine is told comes out of pictures.
#[test]
fn a_session_of_rendered_frames_comes_to_the_same() {
    let drawn = variant(Scene::Bias, Build::PRECISE, "control");
    let [seen, rendered] = [false, true]
        .map(|is_rendered| sessions::one(&Variant { is_rendered, ..drawn }, 1, 8, &Arc::default()));
    for (seen, rendered) in seen.balls.iter().zip(&rendered.balls) {
        assert!(rendered.measured_off_m.is_some_and(|off_m| off_m < 0.03), "{rendered:?}");
        // Each aims by its own measurements: a few centimetres.
        let apart_m = (seen.miss_m.unwrap() - rendered.miss_m.unwrap()).norm();
        assert!(apart_m < 0.5, "{apart_m} m: {rendered:?}");
    }
    let [seen_m, rendered_m] = [&seen, &rendered].map(|s| s.systematic_m(8).unwrap());
    println!("after 8 balls {seen_m:.3} m at candidate level, {rendered_m:.3} m rendered");
    assert!(rendered_m < 0.4, "{rendered_m}");
}

/// The way a machine's balls come to a `fusion` that is a process: as its bridge writes them.
#[test]
fn a_fusion_process_measures_the_balls_of_a_machine_that_is_not_there() {
    let _turn = crate::run::turn();
    let court = own_court("machine").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let plan = Plan::drawn(1, Scene::Bias, Build::PRECISE, 5);
    let mut sighted = Sighted::new(plan.seed, Eyes::Drawn, 0.0);
    let rig = folder.path().join("rig.toml");
    std::fs::write(&rig, shot_folder::rig_toml(sighted.scenario())).unwrap();
    let stop = Stop::on_signals(false).unwrap();
    let mut house = Household::new(&court).unwrap();
    let member = Domain::new(&court, Place::Fusion).unwrap().join("machine").unwrap();
    let shots = member.shots().unwrap().reader().unwrap();
    let arguments = ["--rig", rig.to_str().unwrap()];
    house.start("fusion", "fusion", &arguments, Until::Stopped, Stdio::null()).unwrap();
    let sizes_px = served::sizes_px(sighted.scenario());
    let mut served = Served::open(&member, now_ns(), sizes_px, &stop).unwrap();
    let world = sighted.scenario().world.clone();
    let mut landed_m = Vec::new();
    for (ball_idx, target_idx) in plan.order.iter().enumerate() {
        let told = targets::nominal(&targets::six()[*target_idx]);
        let at_s = 1.0 + 3.5 * ball_idx as f64;
        let fired = plan.machine.fired(&told, ball_idx, at_s).unwrap();
        let flights: Vec<_> = fired.iter().map(|fired| fired.flight(&world)).collect();
        landed_m.extend(flights[0].bounces.first().map(|b| b.position_in_court_m));
        for seen in sighted.frames(ball_idx, flights, at_s + 3.4, None) {
            served.send(&seen).unwrap();
        }
    }
    served.settle().unwrap();
    let mut measured_m = Vec::new();
    while let Some(shot) = shots.receive().unwrap() {
        if shot.is_measured != 0 {
            measured_m.push(shot.bounce_in_court_m);
        }
    }
    println!("landed {landed_m:?}, measured {measured_m:?}");
    assert!(landed_m.len() >= 4 && measured_m.len() == landed_m.len(), "{measured_m:?}");
    for (landed_m, [x, y, _]) in landed_m.iter().zip(&measured_m) {
        let off_m = (landed_m.x - x).hypot(landed_m.y - y);
        assert!(off_m < 0.05, "{off_m}");
    }
    drop((shots, served, member));
    house.stop().unwrap();
}

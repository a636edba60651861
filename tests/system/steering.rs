//! The real `fusion` steers: it says what to tell the machine for a drill, the Python controller
//! tells it, and when no ball is ever seen it says so and everybody stays with what is safe. The
//! Rust controller, an example of a program with fusion inside, does both by itself.

use crate::run::{Started, binary, turn};
use shm_layout::correction::Reason;
use shm_layout::launcher::{
    CommandKind, LauncherAnswer, LauncherState, Limits, NONE, Settings, Why,
};
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::{Correction, LauncherCommand};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use tests::processes::{Household, Until, own_court};
use tests::scenario::{Scenario, ScenarioOptions};
use tests::shot_folder::rig_toml;

const N_BALLS: usize = 5;

/// The thesis' machine, as it is committed.
const MACHINE: &str = include_str!("../../fusion/rigs/machine.toml");

const DRILL: &str = "\
[[target]]
name = \"deep\"
landing_m = [1.0, 21.0]
speed_km_h = 85.0
[[target]]
name = \"short\"
landing_m = [-1.0, 17.0]
speed_km_h = 70.0
";

fn limits() -> Limits {
    let machine = fusion::aim::Machine::of_thesis();
    let ends = |end: fn(&std::ops::RangeInclusive<f64>) -> f64| {
        Settings::from_array(machine.ranges().map(end))
    };
    Limits { min: ends(|range| *range.start()), max: ends(|range| *range.end()) }
}

fn answer(command_idx: u64, state: LauncherState) -> LauncherAnswer {
    let (state, why, at_ns) = (state.code(), Why::Nothing.code(), now_ns());
    let settings = Settings::UNKNOWN;
    LauncherAnswer { command_idx, at_ns, state, why, settings, limits: limits() }
}

/// The virtual environment's Python; says so if there is none.
fn python() -> Option<PathBuf> {
    let target = binary("fusion").parent().unwrap().parent().unwrap().to_owned();
    let python = target.join("python/bin/python3");
    if !python.exists() {
        eprintln!("skipped: no iceoryx2 for Python here: scripts/setup test brings it");
        return None;
    }
    Some(python)
}

fn controller(python: &Path, court: &str, n_balls: usize) -> Child {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shm-layout/bindings/controller.py");
    Command::new(python)
        .arg("-B")
        .arg(script)
        .args(["--court", court, "--balls", &n_balls.to_string(), "--shot-within-s", "10"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

/// The truth of what was commanded: how far from the nearer target such balls land on average.
fn offs_m(truth: &str) -> Vec<f64> {
    let off_m = |line: &str| {
        let ball: serde_json::Value = serde_json::from_str(line).unwrap();
        let [x, y] = [0, 1].map(|i| ball["mean_landing_m"][i].as_f64().unwrap());
        let targets = [[1.0_f64, 21.0], [-1.0, 17.0]];
        targets.map(|[tx, ty]| (x - tx).hypot(y - ty)).into_iter().fold(f64::MAX, f64::min)
    };
    truth.lines().map(off_m).collect()
}

fn mean_m(offs_m: &[f64]) -> f64 {
    offs_m.iter().sum::<f64>() / offs_m.len() as f64
}

/// A biased machine with a real one's scatter, the real `fusion`, and a controller in Python.
#[test]
fn fifty_balls_of_the_python_controller_close_the_loop() {
    const N_BALLS: usize = 50;
    let Some(python) = python() else { return };
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("machine.toml"), MACHINE).unwrap();
    std::fs::write(path("drill.toml"), DRILL).unwrap();
    let court = own_court("loop").unwrap();
    let write_rig = ["--court", &court, "--write-rig", &path("rig.toml")];
    assert!(Command::new(binary("practice")).args(write_rig).status().unwrap().success());
    let (rig, machine, drill) = (path("rig.toml"), path("machine.toml"), path("drill.toml"));
    let report = path("");
    let flags =
        ["--rig", &rig, "--machine", &machine, "--drill", &drill, "--report", report.as_str()];
    let mut house = Household::new(&court).unwrap();
    house.start("fusion", "fusion", &flags, Until::Stopped, Stdio::null()).unwrap();
    let truth = std::fs::File::create(path("truth")).unwrap();
    let flags = ["--machine", "real", "--scene", "bias", "--seed", "3"];
    house.start("practice", "practice", &flags, Until::Stopped, truth.into()).unwrap();
    let mut controller = controller(&python, &court, N_BALLS);
    while controller.try_wait().unwrap().is_none() {
        house.look().unwrap();
        std::thread::yield_now();
    }
    let out = controller.wait_with_output().unwrap();
    house.stop().unwrap();
    let said = String::from_utf8(out.stdout).unwrap();
    assert!(out.status.success(), "{said}");
    assert_eq!(said.lines().filter(|line| line.starts_with("ball ")).count(), N_BALLS, "{said}");

    let offs_m = offs_m(&std::fs::read_to_string(path("truth")).unwrap());
    assert_eq!(offs_m.len(), N_BALLS);
    let (first_m, last_m) = (offs_m[0], mean_m(&offs_m[30..]));
    println!("the mean is {first_m:.2} m off at first, {last_m:.2} m in the last 20 of 50 balls");
    // 0.63 m of scatter a ball: 0.11 m after 30 balls, if nothing else were unknown.
    assert!(first_m > 0.4 && last_m < 0.25, "{offs_m:.2?}");
    let report: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(path("session.json")).unwrap()).unwrap();
    assert_eq!(report["schema"], "session/1");
    assert!(report["n_measured"].as_u64().unwrap() >= 45, "{report}");
    let speed = report["machine"]["speed_percent"][0].as_f64().unwrap();
    assert!(speed.abs() > 3.0, "5 % fast or slow: {speed}");
    assert!(std::fs::read_to_string(path("session.svg")).unwrap().ends_with("</svg>\n"));
    assert!(std::fs::read_to_string(path("balls.csv")).unwrap().lines().count() > 45);
}

/// The same machine and court, and no process `fusion`: it is within the controller.
#[test]
fn thirty_balls_of_the_rust_controller_close_the_loop() {
    const N_BALLS: usize = 30;
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("machine.toml"), MACHINE).unwrap();
    // As fast as a drill may be: what the machine does between two balls takes no time here.
    std::fs::write(path("drill.toml"), format!("period_s = 1.0\n{DRILL}")).unwrap();
    let court = own_court("inside").unwrap();
    let write_rig = ["--court", &court, "--write-rig", &path("rig.toml")];
    assert!(Command::new(binary("practice")).args(write_rig).status().unwrap().success());
    let member = Domain::new(&court, Place::Fusion).unwrap().join("test").unwrap();
    let commands = member.launcher_commands().unwrap().reader().unwrap();
    let answers = member.launcher_answers().unwrap().reader().unwrap();
    let mut house = Household::new(&court).unwrap();
    let truth = std::fs::File::create(path("truth")).unwrap();
    let flags = ["--machine", "real", "--scene", "bias", "--seed", "3"];
    house.start("practice", "practice", &flags, Until::Stopped, truth.into()).unwrap();
    let example = binary("examples/controller");
    let files = ["rig.toml", "machine.toml", "drill.toml"].map(path);
    let said = std::fs::File::create(path("said")).unwrap();
    let controller = Command::new(&example).arg(&court).args(files).stdout(said).spawn();
    let mut controller = Started(
        controller
            .unwrap_or_else(|why| panic!("{}: {why} (scripts/test builds it)", example.display())),
    );
    let (mut fired, mut stopped, mut refused) = (Vec::new(), 0, 0);
    let mut hear = || {
        while let Some(command) = commands.receive().unwrap() {
            assert_eq!(command.refusal(&limits(), command.sent_ns), None, "{command:?}");
            match command.kind() {
                Some(CommandKind::Fire) => fired.push(*command),
                _ => stopped += 1,
            }
        }
        while let Some(answer) = answers.receive().unwrap() {
            refused += usize::from(answer.state() == Some(LauncherState::Refused));
        }
    };
    let truth = || std::fs::read_to_string(path("truth")).unwrap();
    while truth().lines().count() < N_BALLS {
        hear();
        assert_eq!(controller.try_wait().unwrap(), None, "it goes on until Ctrl-C");
        house.look().unwrap();
        std::thread::yield_now();
    }
    launcher::processes::signal(&controller, rustix::process::Signal::INT);
    assert!(controller.wait().unwrap().success());
    hear();
    // It stops the machine when it goes.
    assert_eq!((stopped, refused), (1, 0));
    assert!(fired.len() >= N_BALLS && fired.iter().all(|fire| fire.correction_idx != NONE));
    let said = std::fs::read_to_string(path("said")).unwrap();
    let offs_m = &offs_m(&truth())[..N_BALLS];
    let (first_m, last_m) = (offs_m[0], mean_m(&offs_m[20..]));
    println!("the mean is {first_m:.2} m off at first, {last_m:.2} m in the last 10 of 30 balls");
    // 0.63 m of scatter a ball: 0.14 m after 20 balls, if nothing else were unknown.
    assert!(first_m > 0.4 && last_m < 0.3, "{offs_m:.2?}");
    // A sentence for each ball that was measured, but for the last, which may be on its way.
    assert!(said.lines().count() >= N_BALLS - 4, "{said}");
    drop((commands, answers, member));
    house.stop().unwrap();
}

#[test]
fn a_drill_is_commanded_by_fusion_and_the_python_controller_even_when_fusion_is_blind() {
    let Some(python) = python() else { return };
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let scenario = Scenario::from_seed(1, &ScenarioOptions::default());
    std::fs::write(path("rig.toml"), rig_toml(&scenario)).unwrap();
    std::fs::write(path("machine.toml"), MACHINE).unwrap();
    std::fs::write(path("drill.toml"), DRILL).unwrap();
    let court = own_court("steering").unwrap();
    let member = Domain::new(&court, Place::Fusion).unwrap().join("test").unwrap();
    let answers = member.launcher_answers().unwrap().writer().unwrap();
    let commands = member.launcher_commands().unwrap().reader().unwrap();
    let corrections = member.corrections().unwrap().reader().unwrap();
    let texts = member.corrections_json().unwrap().reader().unwrap();
    let mut house = Household::new(&court).unwrap();
    let (rig, machine, drill) = (path("rig.toml"), path("machine.toml"), path("drill.toml"));
    let flags = ["--rig", &rig, "--machine", &machine, "--drill", &drill];
    house.start("fusion", "fusion", &flags, Until::Stopped, Stdio::null()).unwrap();
    let mut controller = controller(&python, &court, N_BALLS);
    // A launcher that fires what it is told, whose balls nobody sees.
    let (mut said_ns, mut fired, mut told) = (0, Vec::<LauncherCommand>::new(), Vec::new());
    while controller.try_wait().unwrap().is_none() {
        if now_ns() - said_ns > 500_000_000 {
            said_ns = now_ns();
            answers.send(answer(NONE, LauncherState::Ready)).unwrap();
        }
        while let Some(command) = commands.receive().unwrap() {
            assert_eq!(command.kind(), Some(CommandKind::Fire));
            assert_eq!(command.refusal(&limits(), now_ns()), None);
            answers.send(answer(command.command_idx, LauncherState::Fired)).unwrap();
            fired.push(*command);
        }
        while let Some(correction) = corrections.receive().unwrap() {
            told.push(*correction);
        }
        house.look().unwrap();
        std::thread::yield_now();
    }
    let out = controller.wait_with_output().unwrap();
    assert!(out.status.success());
    let lines = String::from_utf8(out.stdout).unwrap();
    assert_eq!(lines.lines().filter(|line| line.contains("not measured")).count(), 2, "{lines}");
    assert_eq!(fired.len(), N_BALLS);
    // Three balls of the drill, in turn; then the tracking is not trusted and the last one stays.
    let settings: Vec<Settings> = fired.iter().map(|command| command.settings).collect();
    assert_eq!((settings[0], settings[2]), (settings[2], settings[4]));
    assert_ne!(settings[0], settings[1]);
    assert_eq!(settings[3], settings[2]);
    assert!(fired[..3].iter().all(|command| command.correction_idx != NONE));
    assert!(fired[3..].iter().all(|command| command.correction_idx == NONE));
    let unseen = told.iter().filter(|correction: &&Correction| correction.command_idx != NONE);
    let reasons: Vec<Option<Reason>> = unseen.map(Correction::reason).collect();
    assert!(reasons.contains(&Some(Reason::NotMeasured)), "{reasons:?}");
    assert_eq!(reasons.last(), Some(&Some(Reason::Untrusted)));
    let text: serde_json::Value = serde_json::from_str(&texts.receive().unwrap().unwrap()).unwrap();
    assert_eq!(text["schema"], "correction/1");
    drop((answers, commands, corrections, texts, member));
    house.stop().unwrap();
}

//! A board whose processes die, under its launcher: it goes on, counts its losses, leaves nothing.

use crate::run::{Started, binary, simulated, turn};
use rustix::process::{Pid, Signal, kill_process};
use std::fs::File;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use tests::kills::{self, Victim};
use tests::processes::own_court;

const N_KILLS: usize = 100;

/// Frames are back within this after a death; what is asked of a board.
const WITHIN_MS: f64 = 500.0;

#[test]
fn frames_go_on_after_a_hundred_deaths_and_all_count_alike_what_was_lost() {
    let _turn = turn();
    let folder = simulated(&["--seconds", "4"]);
    let court = own_court("kills").unwrap();
    let report = kills::run(&court, folder.path(), N_KILLS).unwrap();
    print!("{report}");
    assert_eq!(report.deaths.len(), N_KILLS);
    for victim in Victim::ALL {
        let silences_ms = report.silences_ms(victim);
        // One in ten may have met the load of the tests that run meanwhile.
        let p90_ms = silences_ms[silences_ms.len() * 9 / 10];
        assert!(p90_ms <= WITHIN_MS, "{victim:?}: {silences_ms:?}");
    }

    // Every number is complete or lost, once, whoever counts: the launcher ...
    assert_eq!(report.truth.n_twice + report.at_fusion.n_twice, 0);
    let expected = report.expected_words();
    assert!(report.words.contains(&expected), "{expected:?} not in\n{}", report.words);
    assert!(report.words.contains("clock ±"), "fusion tells the board: {}", report.words);
    // ... and fusion, which misses besides only what a dead bridge did not carry.
    let counts = report.fusion_counts;
    assert_eq!(counts.captured, report.truth.n_captured());
    assert_eq!(counts.processed, report.at_fusion.n_complete);
    assert_eq!(counts.captured, counts.processed + counts.lost);
    assert_eq!(report.unexplained(), []);

    // What the dead held is given back, and in the end all of it.
    let most = |n_files: &[usize]| n_files.iter().copied().max();
    let (first, last) = (most(&report.n_files[..10]), most(&report.n_files[N_KILLS - 9..]));
    assert!(last <= first, "files: {:?}", report.n_files);
    assert_eq!((report.exit_code, &report.left), (Some(0), &Vec::new()));
    assert_eq!(kills::files_of(&court).unwrap(), Vec::<String>::new());
}

/// A folder with the launcher, and scripts in place of what it starts.
struct Fakes {
    folder: tempfile::TempDir,
    court: String,
}

impl Fakes {
    fn new(what: &str, capture: &str, others: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::copy(binary("board"), folder.path().join("board"))
            .expect("scripts/test builds it");
        for (name, script) in [("capture", capture), ("worker", others), ("bridge", others)] {
            let path = folder.path().join(name);
            std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        }
        Self { folder, court: format!("{what}-{}", std::process::id()) }
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(self.folder.path().join("board"));
        command.args(["--court", &self.court, "--camera", "left"]).args(words);
        command.stdin(Stdio::null());
        command
    }

    fn start(&self) -> Running {
        let words = self.folder.path().join("words");
        let mut command = self.command(&["--workers", "1"]);
        let child = command.stderr(File::create(&words).unwrap()).spawn().unwrap();
        Running { child: Started(child), words }
    }
}

struct Running {
    child: Started,
    words: PathBuf,
}

impl Running {
    /// Waits until it has said something.
    fn says(&mut self, words: &str) -> String {
        loop {
            let said = std::fs::read_to_string(&self.words).unwrap();
            if said.contains(words) {
                return said;
            }
            let ended = self.child.try_wait().unwrap();
            assert!(ended.is_none(), "{words:?} was not said, but\n{said}");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn ask(&self, signal: Signal) {
        kill_process(Pid::from_raw(self.child.id() as i32).unwrap(), signal).unwrap();
    }

    fn end(mut self, signal: Signal) -> (Option<i32>, String) {
        self.ask(signal);
        let code = self.child.wait().unwrap().code();
        (code, std::fs::read_to_string(&self.words).unwrap())
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).trim().to_owned()
}

const SLEEP: &str = "exec sleep 600";

#[test]
fn systemd_hears_that_a_board_runs_and_how_it_is_though_it_has_no_camera() {
    let fakes = Fakes::new("fakes-unit", "exit 69", SLEEP);
    let path = fakes.folder.path().join("notify");
    let systemd = UnixDatagram::bind(&path).unwrap();
    let mut command = fakes.command(&["--workers", "1"]);
    let child = command.env("NOTIFY_SOCKET", &path).stderr(Stdio::null()).spawn().unwrap();
    let mut board = Running { child: Started(child), words: path };
    let heard = || {
        let mut bytes = [0; 1000];
        let n_bytes = systemd.recv(&mut bytes).unwrap();
        String::from_utf8_lossy(&bytes[..n_bytes]).into_owned()
    };
    assert_eq!(heard(), "READY=1\n");
    let status = heard();
    assert!(status.starts_with("WATCHDOG=1\nSTATUS=  0.0 frames/s, "), "{status}");
    assert!(status.contains("capture failed with exit code 69 (no camera)"), "{status}");
    board.ask(Signal::TERM);
    while heard() != "STOPPING=1\n" {}
    // Not killed while it puts away what it had in shared memory.
    assert!(board.child.wait().unwrap().success());
    assert_eq!(kills::files_of(&fakes.court).unwrap(), Vec::<String>::new());
}

#[test]
fn a_camera_that_is_not_there_is_waited_for_with_its_reason() {
    let reason = "capture left: no camera: plug one in";
    let fakes = Fakes::new("fakes-69", &format!("echo {reason:?} >&2; exit 69"), SLEEP);
    let mut board = fakes.start();
    board.says("started again in 0.4 s");
    let (code, words) = board.end(Signal::TERM);
    let died = "board left: capture failed with exit code 69 (no camera); started again";
    let ends = ["at once", "in 0.1 s", "in 0.2 s", "in 0.4 s"];
    let expected: Vec<String> =
        ends.iter().flat_map(|end| [reason.to_owned(), format!("{died} {end}")]).collect();
    let lines: Vec<&str> = words.lines().filter(|line| !line.contains("frames")).collect();
    assert_eq!(lines, expected, "{words}");
    assert_eq!(code, Some(0));
    assert_eq!(kills::files_of(&fakes.court).unwrap(), Vec::<String>::new());
}

#[test]
fn one_that_does_not_end_is_killed_and_ctrl_c_is_success() {
    let deaf = "trap '' TERM; echo deaf >&2; while :; do sleep 1; done";
    let fakes = Fakes::new("fakes-deaf", deaf, SLEEP);
    let mut board = fakes.start();
    board.says("deaf");
    let (code, words) = board.end(Signal::INT);
    assert_eq!(code, Some(0), "{words}");
    assert!(words.contains("1 processes did not end and were killed"), "{words}");
}

#[test]
fn a_recording_that_is_over_is_the_end_and_wrong_flags_are_not_tried_again() {
    let over = Fakes::new("fakes-over", "exit 0", SLEEP).command(&[]).output().unwrap();
    assert_eq!(over.status.code(), Some(0));
    let stopped = "board left: stopped: 0 frames, 0 complete, 0 lost, 0 restarts";
    assert_eq!(said(&over), stopped);
    let misuse = "echo unexpected argument >&2; exit 2";
    let wrong = Fakes::new("fakes-wrong", misuse, SLEEP).command(&[]).output().unwrap();
    assert_eq!(wrong.status.code(), Some(2));
    let expected =
        ["unexpected argument", stopped, "board left: capture was given wrong flags (above)"];
    assert_eq!(said(&wrong).lines().collect::<Vec<&str>>(), expected);
}

#[test]
fn a_second_launcher_is_refused_and_a_killed_one_takes_its_processes_along() {
    let _turn = turn();
    let fakes = Fakes::new("fakes-two", SLEEP, SLEEP);
    for name in ["capture", "worker", "bridge"] {
        std::fs::copy(binary(name), fakes.folder.path().join(name)).unwrap();
    }
    let folder = simulated(&["--seconds", "1"]);
    let recording = folder.path().join("left.y4m");
    let flags = ["--workers", "1", "--", "--repeat", "--recording", recording.to_str().unwrap()];
    let words = folder.path().join("words");
    let start = || {
        let child = fakes.command(&flags).stderr(File::create(&words).unwrap()).spawn().unwrap();
        Running { child: Started(child), words: words.clone() }
    };
    let mut board = start();
    board.says("frames/s");
    let second = fakes.command(&flags).output().unwrap();
    assert_eq!(second.status.code(), Some(1));
    let refusal = format!("another launcher runs the left board of court {}", fakes.court);
    assert_eq!(said(&second), format!("board left: {refusal}"));

    board.child.kill().unwrap();
    board.child.wait().unwrap();
    // The next one waits for what is left of it, and begins.
    let mut next = start();
    next.says("frames/s");
    let (code, words) = next.end(Signal::TERM);
    assert_eq!(code, Some(0), "{words}");
    assert!(!words.contains("started again"), "{words}");
    assert_eq!(kills::files_of(&fakes.court).unwrap(), Vec::<String>::new());
}

#[test]
fn what_is_wrong_at_the_start_is_said_in_a_line() {
    let fakes = Fakes::new("fakes-flags", SLEEP, SLEEP);
    std::fs::remove_file(fakes.folder.path().join("bridge")).unwrap();
    let missing = fakes.command(&[]).output().unwrap();
    let bridge = fakes.folder.path().join("bridge");
    let expected = format!("board left: {}: expected beside this binary", bridge.display());
    assert_eq!((missing.status.code(), said(&missing)), (Some(1), expected));
    let court = Command::new(fakes.folder.path().join("board"))
        .args(["--court", "Rose Garden", "--camera", "left"])
        .output()
        .unwrap();
    assert_eq!(court.status.code(), Some(2));
    assert!(said(&court).contains("expected 1 to 32 of a-z"), "{}", said(&court));
}

#[test]
fn systemd_understands_the_units() {
    if Command::new("systemd-analyze").arg("--version").output().is_err() {
        println!("skipped: systemd-analyze is not installed (apt install systemd)");
        return;
    }
    let units = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/systemd");
    let folder = tempfile::tempdir().unwrap();
    let here = launcher::processes::folder().unwrap();
    let mut verify = Command::new("systemd-analyze");
    verify.arg("verify");
    let mut n_units = 0;
    for entry in std::fs::read_dir(units).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|end| end == "service") {
            let text = std::fs::read_to_string(&path).unwrap();
            let copy = folder.path().join(path.file_name().unwrap());
            std::fs::write(&copy, text.replace("/usr/lib/tennis", here.to_str().unwrap())).unwrap();
            verify.arg(copy);
            n_units += 1;
        }
    }
    let output = verify.output().unwrap();
    assert_eq!((n_units, output.status.code(), said(&output)), (4, Some(0), String::new()));
}

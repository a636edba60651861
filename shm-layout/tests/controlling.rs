//! The Python controller against real services: it commands what is corrected, never anything
//! beyond the limits, goes on with what was safe, and stops everything on Ctrl-C.
//!
//! Python with iceoryx2 of PyPI stands in the target folder's `python` (scripts/setup test).

#![allow(clippy::unwrap_used)] // all of it is test code; the lint only knows #[test] functions

use rustix::process::{Pid, Signal, kill_process};
use shm_layout::correction::{Correction, Reason};
use shm_layout::launcher::{
    CommandKind, LauncherAnswer, LauncherCommand, LauncherState, Limits, NONE, Settings, Why,
};
use shm_layout::ports::{MessageReader, MessageWriter};
use shm_layout::services::{Domain, Member, Place};
use shm_layout::stamp::now_ns;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

const LIMITS: Limits = Limits {
    min: Settings::from_array([10.0, 0.0, -0.2, -300.0]),
    max: Settings::from_array([30.0, 0.8, 0.2, 300.0]),
};
/// A launcher and a fusion that say the same again so often.
const EVERY_NS: i64 = 100_000_000;

fn python() -> Option<PathBuf> {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    let python = target.join("python/bin/python3");
    if !python.exists() {
        eprintln!("skipped: no iceoryx2 for Python here: scripts/setup test brings it");
        return None;
    }
    Some(python)
}

/// A launcher and a fusion, and the controller between them.
struct Court {
    domain: Domain,
    controller: Child,
    ends: Option<Ends>,
    said_ns: i64,
    is_stopped: bool,
}

struct Ends {
    corrections: MessageWriter<Correction>,
    answers: MessageWriter<LauncherAnswer>,
    commands: MessageReader<LauncherCommand>,
    _member: Member,
}

impl Court {
    fn start(what: &str, python: &Path, flags: &[&str]) -> Self {
        let name = format!("py-{what}-{}", std::process::id());
        let domain = Domain::new(&name, Place::Fusion).unwrap();
        let member = domain.join("test").unwrap();
        let ends = Ends {
            corrections: member.corrections().unwrap().writer().unwrap(),
            answers: member.launcher_answers().unwrap().writer().unwrap(),
            commands: member.launcher_commands().unwrap().reader().unwrap(),
            _member: member,
        };
        let controller = Command::new(python)
            .args(["-B", concat!(env!("CARGO_MANIFEST_DIR"), "/bindings/controller.py")])
            .args(["--court", &name])
            .args(flags)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Self { domain, controller, ends: Some(ends), said_ns: 0, is_stopped: false }
    }

    fn ends(&self) -> &Ends {
        self.ends.as_ref().unwrap()
    }

    fn answer(&self, command_idx: u64, state: LauncherState, settings: Settings) {
        let (state, why, at_ns) = (state.code(), Why::Nothing.code(), now_ns());
        let answer = LauncherAnswer { command_idx, at_ns, state, why, settings, limits: LIMITS };
        self.ends().answers.send(answer).unwrap();
    }

    /// What the controller commands next, while both say what they say again and again.
    fn next_command(&mut self, correction: Option<Correction>) -> LauncherCommand {
        loop {
            if now_ns() - self.said_ns > EVERY_NS {
                self.said_ns = now_ns();
                self.answer(NONE, LauncherState::Ready, Settings::UNKNOWN);
                if let Some(correction) = correction {
                    let made_ns = now_ns();
                    self.ends().corrections.send(Correction { made_ns, ..correction }).unwrap();
                }
            }
            if let Some(command) = self.ends().commands.receive().unwrap() {
                return *command;
            }
            let ended = self.controller.try_wait().unwrap();
            assert_eq!(ended, None, "the controller has ended");
            std::thread::yield_now();
        }
    }

    /// Fires what is commanded next, and tells what came of it.
    fn fired(&mut self, correction: Option<Correction>) -> LauncherCommand {
        let command = self.next_command(correction);
        assert_eq!(command.kind(), Some(CommandKind::Fire));
        assert_eq!(command.refusal(&LIMITS, now_ns()), None, "beyond the limits: {command:?}");
        self.answer(command.command_idx, LauncherState::Accepted, command.settings);
        self.answer(command.command_idx, LauncherState::Fired, command.settings);
        command
    }

    fn followed(&self, command: &LauncherCommand, correction: Correction) {
        let (command_idx, made_ns) = (command.command_idx, now_ns());
        let miss_m = [-0.03, 0.12];
        let followed = Correction { command_idx, made_ns, miss_m, ..correction };
        self.ends().corrections.send(followed).unwrap();
    }

    /// Lets go of everything; the controller's exit code, what it printed and what it said.
    fn end(mut self) -> (Option<i32>, Vec<String>, String) {
        let stdout = BufReader::new(self.controller.stdout.take().unwrap());
        let lines = stdout.lines().map(Result::unwrap).collect();
        let out = self.controller.wait_with_output().unwrap();
        self.ends = None;
        assert_eq!(self.domain.close().unwrap(), Vec::<String>::new());
        assert!(!self.is_stopped || out.status.code() == Some(130));
        (out.status.code(), lines, String::from_utf8(out.stderr).unwrap())
    }
}

fn correction(correction_idx: u64, speed_m_s: f64) -> Correction {
    Correction {
        correction_idx,
        wanted_idx: NONE,
        command_idx: NONE,
        shot_idx: NONE,
        made_ns: 0,
        is_trusted: 1,
        reason: Reason::Standing.code(),
        next: Settings::from_array([speed_m_s, 0.2, 0.01, -20.0]),
        wanted_landing_m: [1.0, 20.0],
        expected_landing_m: [1.0, 20.0],
        expected_covariance_m2: [[0.01, 0.0], [0.0, 0.04]],
        miss_m: [f64::NAN; 2],
        parts_m: [[f64::NAN; 2]; 8],
        part_sigmas_m: [[f64::NAN; 2]; 8],
    }
}

#[test]
fn it_commands_what_is_corrected_and_never_beyond_the_limits() {
    let Some(python) = python() else { return };
    let mut court = Court::start("loop", &python, &["--balls", "6", "--shot-within-s", "0.3"]);
    let mut last = None;
    for idx in 0..3 {
        let now = correction(idx, 20.0 + idx as f64);
        let command = court.fired(Some(now));
        assert_eq!((command.correction_idx, command.settings), (idx, now.next));
        assert!(last.is_none_or(|last: LauncherCommand| last.command_idx < command.command_idx));
        court.followed(&command, correction(idx + 1, 21.0 + idx as f64));
        last = Some(command);
    }
    // Beyond the limits, not a number, not trusted: what was safe last is fired again.
    let safe = last.unwrap().settings;
    let untrusted = Correction { is_trusted: 0, ..correction(11, 15.0) };
    for bad in [correction(9, 31.0), correction(10, f64::NAN), untrusted] {
        court.ends().corrections.send(Correction { made_ns: now_ns(), ..bad }).unwrap();
        let command = court.fired(Some(bad));
        assert_eq!((command.correction_idx, command.settings), (NONE, safe));
    }
    let (code, lines, said) = court.end();
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(lines.len(), 6, "{lines:?}");
    assert_eq!(lines[0], "ball 1: 72.0 km/h, 11.46° up, +0.57°, -191 rpm: 12 cm long, 3 cm left");
    assert!(lines[5].contains("(last safe): nothing heard of it"), "{}", lines[5]);
    assert!(said.contains("a correction is refused: speed"), "{said}");
}

#[test]
fn without_fusion_it_goes_on_with_the_last_safe_settings() {
    let Some(python) = python() else { return };
    let mut court = Court::start("alone", &python, &["--balls", "3", "--shot-within-s", "0.2"]);
    let now = correction(0, 20.0);
    let first = court.fired(Some(now));
    assert_eq!(first.correction_idx, 0);
    // Fusion says nothing more: what it said is used for as long as it is fresh, then repeated.
    let second = court.fired(None);
    let third = court.fired(None);
    assert_eq!([second.settings, third.settings], [now.next; 2]);
    let (code, lines, said) = court.end();
    assert_eq!((code, lines.len()), (Some(0), 3), "{said}");
}

#[test]
fn control_c_is_an_emergency_stop() {
    let Some(python) = python() else { return };
    let mut court = Court::start("stop", &python, &["--balls", "100"]);
    let command = court.next_command(Some(correction(0, 20.0)));
    assert_eq!(command.kind(), Some(CommandKind::Fire));
    let pid = Pid::from_child(&court.controller);
    kill_process(pid, Signal::INT).unwrap();
    court.is_stopped = true;
    let stop = court.next_command(None);
    assert_eq!(stop.kind(), Some(CommandKind::EmergencyStop));
    court.answer(stop.command_idx, LauncherState::Stopped, Settings::UNKNOWN);
    let (code, lines, said) = court.end();
    assert_eq!((code, lines.len()), (Some(130), 0));
    assert!(said.contains("the launcher has stopped"), "{said}");
}

//! Processes that are killed, and Ctrl-C: an error that names who died, no hang, nothing left.

use crate::run::{left_in_shm, simulated, track, turn, words};
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// `track` playing a folder slowly enough to be disturbed.
struct Disturbed {
    track: Child,
    court: String,
}

impl Disturbed {
    fn start(folder: &Path) -> Self {
        let track = Command::new(env!("CARGO_BIN_EXE_track"))
            .arg(folder)
            .args(["--json", folder.join("shots.json").to_str().unwrap(), "--real-speed"])
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let court = format!("track-{}", track.id());
        let mut disturbed = Self { track, court };
        disturbed.wait_until_frames_flow();
        disturbed
    }

    /// Frames flow once both captures have made their segments and all workers read them.
    fn wait_until_frames_flow(&mut self) {
        while self.children().len() < 10 || left_in_shm(&self.court).len() < 20 {
            assert!(
                self.track.try_wait().unwrap().is_none(),
                "track ended before it was disturbed"
            );
            std::thread::yield_now();
        }
    }

    /// Process numbers of the children, by binary and arguments.
    fn children(&self) -> Vec<(u32, String)> {
        let mut children = Vec::new();
        for entry in std::fs::read_dir("/proc").unwrap() {
            let name = entry.unwrap().file_name();
            let Some(pid) = name.to_str().and_then(|name| name.parse::<u32>().ok()) else {
                continue;
            };
            let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            let line = String::from_utf8_lossy(&line).replace('\0', " ");
            if line.contains(&format!("--court {} ", self.court)) {
                children.push((pid, line));
            }
        }
        children
    }

    fn child(&self, words: &[&str]) -> u32 {
        let is_it = |line: &String| words.iter().all(|word| line.contains(word));
        let children = self.children();
        children.iter().find(|(_, line)| is_it(line)).unwrap_or_else(|| panic!("{children:?}")).0
    }

    /// Exit code and words; checks that nobody and nothing is left.
    fn end(self) -> (Option<i32>, String) {
        let court = self.court.clone();
        let output = self.track.wait_with_output().unwrap();
        assert_eq!(left_in_shm(&court), Vec::<String>::new());
        (output.status.code(), words(&output))
    }
}

fn signal(pid: u32, signal: Signal) {
    kill_process(Pid::from_raw(pid as i32).unwrap(), signal).unwrap();
}

#[test]
fn whoever_is_killed_is_named_and_the_others_are_stopped() {
    let _turn = turn();
    let folder = simulated(&["--seconds", "4"]);
    for (victim, name) in [
        (vec!["/capture ", "left"], "capture left"),
        (vec!["/worker ", "left", "--strip 0"], "worker left 0"),
        (vec!["/worker ", "right", "--strip 1"], "worker right 1"),
        (vec!["/bridge board", "right"], "bridge right"),
        (vec!["/bridge fusion"], "bridge fusion"),
        (vec!["/fusion "], "fusion"),
    ] {
        let disturbed = Disturbed::start(folder.path());
        signal(disturbed.child(&victim), Signal::KILL);
        let (code, said) = disturbed.end();
        assert_eq!(code, Some(1), "{name}: {said}");
        assert!(said.contains(&format!("{name} was killed by signal 9")), "{name}: {said}");
        assert!(!folder.path().join("shots.json").exists(), "{name}");
        println!("{name}: {}", said.trim());
    }
}

#[test]
fn ctrl_c_stops_everybody_and_leaves_nothing() {
    let _turn = turn();
    let folder = simulated(&["--seconds", "4"]);
    let disturbed = Disturbed::start(folder.path());
    signal(disturbed.track.id(), Signal::INT);
    let children = disturbed.children().len();
    let (code, said) = disturbed.end();
    assert!(children > 0);
    assert_eq!((code, said.trim()), (Some(130), "track: stopped"));
}

#[test]
fn a_killed_track_takes_its_processes_with_it() {
    let _turn = turn();
    let folder = simulated(&["--seconds", "4"]);
    let mut disturbed = Disturbed::start(folder.path());
    disturbed.track.kill().unwrap();
    disturbed.track.wait().unwrap();
    while !disturbed.children().is_empty() {
        std::thread::yield_now();
    }
    // Only the lists of processes are left, which the next `track` removes.
    assert_eq!(left_in_shm(&disturbed.court).len(), 3, "{:?}", left_in_shm(&disturbed.court));
    track(&[folder.path().to_str().unwrap(), "--candidates", folder.path().to_str().unwrap()]);
    assert_eq!(left_in_shm(&disturbed.court), Vec::<String>::new());
}

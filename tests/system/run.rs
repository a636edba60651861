//! Starting `track` and reading what it wrote.

use serde_json::Value;
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Runs of the chain take turns: twelve processes each, on two cores.
pub fn turn() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// `track` with these arguments, to its end.
pub fn track(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_track")).args(arguments).output().unwrap()
}

/// What `track` measured in a folder; panics with its words when it failed.
pub fn shots_of(folder: &Path, flags: &[&str]) -> Value {
    let json = folder.join("shots.json");
    let mut arguments = vec![folder.to_str().unwrap(), "--json", json.to_str().unwrap()];
    arguments.extend(flags);
    let output = track(&arguments);
    assert!(output.status.success(), "{}", words(&output));
    serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap()
}

/// Where one of the rooms' own binaries stands, beside those of the tests.
pub fn binary(name: &str) -> PathBuf {
    launcher::processes::folder().unwrap().join(name)
}

/// A process that ends with its test, however that does.
pub struct Started(pub Child);

impl Deref for Started {
    type Target = Child;

    fn deref(&self) -> &Child {
        &self.0
    }
}

impl DerefMut for Started {
    fn deref_mut(&mut self) -> &mut Child {
        &mut self.0
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// One of the rooms' own binaries, to its end.
pub fn run(name: &str, arguments: &[&str]) -> Output {
    let binary = binary(name);
    let run = Command::new(&binary).args(arguments).output();
    run.unwrap_or_else(|why| panic!("{}: {why} (scripts/test builds it)", binary.display()))
}

/// The independently rendered shot of the thesis, unpacked to a new folder.
pub fn blender_a() -> Option<tempfile::TempDir> {
    let unpack = shared("data/unpack")?;
    let folder = tempfile::tempdir().unwrap();
    let status = Command::new(python_with_numpy()).arg(unpack).arg(folder.path()).status();
    assert!(status.unwrap().success(), "unpack needs zstd: scripts/setup test");
    Some(folder)
}

/// A python3 of one's own need not see Debian's numpy.
fn python_with_numpy() -> &'static str {
    let has_numpy = |python: &&str| {
        let import = Command::new(python).args(["-c", "import numpy"]).output();
        import.is_ok_and(|output| output.status.success())
    };
    ["python3", "/usr/bin/python3"].into_iter().find(has_numpy).expect("scripts/setup test")
}

/// What a process said.
pub fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A simulated shot, written to a new folder.
pub fn simulated(flags: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_simulate"))
        .args(["--write", folder.path().to_str().unwrap()])
        .args(flags)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", words(&output));
    folder
}

/// A folder of `../shared`, which whoever clones the repository does not have.
pub fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared").join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {} is not here", path.display());
    None
}

/// True when a program can be started; says so when not.
pub fn have(program: &str) -> bool {
    let is_there = Command::new(program).arg("-version").output().is_ok();
    if !is_there {
        println!("skipped: {program} is not installed (scripts/setup test)");
    }
    is_there
}

/// What stands in /dev/shm of this process' children: every domain begins with "tennis_track-".
pub fn left_in_shm(court: &str) -> Vec<String> {
    let entries = std::fs::read_dir("/dev/shm").unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with(&format!("tennis_{court}_"))).collect()
}

/// `[x, y]` or longer of a JSON array of numbers.
pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

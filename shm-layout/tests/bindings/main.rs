//! The messages for other languages: `bindings/tennis_messages.h` and `.py` say what the Rust
//! compiler says, byte for byte, and C and Python read them so.

#![allow(clippy::unwrap_used)] // all of it is test code; the lint only knows #[test] functions

mod layout;
mod text_c;
mod text_python;

use layout::{Layout, layouts};
use shm_layout::launcher::{Limits, Settings};
use std::path::{Path, PathBuf};
use std::process::Command;

const BINDINGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/bindings");

#[test]
fn no_field_is_forgotten_and_no_byte_is_padding() {
    for layout in layouts() {
        let mut end = 0;
        for field in &layout.fields {
            assert_eq!(field.offset, end, "{} before {}", layout.name, field.name);
            end = field.offset + field.n_bytes;
        }
        assert_eq!(end, layout.n_bytes, "{} has a field that is not listed", layout.name);
    }
}

#[test]
fn the_files_for_c_and_python_are_what_is_generated() {
    let files =
        [("tennis_messages.h", text_c::text()), ("tennis_messages.py", text_python::text())];
    let is_behind = |(name, text): &&(&str, String)| {
        let committed = std::fs::read_to_string(Path::new(BINDINGS).join(name));
        committed.ok().as_ref() != Some(text)
    };
    let folder = env!("CARGO_TARGET_TMPDIR");
    let behind = files.iter().filter(is_behind).map(|(name, text)| {
        std::fs::write(Path::new(folder).join(name), text).unwrap();
        format!("cp {folder}/{name} {BINDINGS}/")
    });
    assert_eq!(behind.collect::<Vec<_>>(), Vec::<String>::new(), "these bring them up to date");
}

fn run(command: &mut Command) -> String {
    let out = command.output().unwrap();
    let words = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{command:?}: {words}");
    assert!(words.is_empty(), "{command:?}: {words}");
    String::from_utf8(out.stdout).unwrap()
}

fn is_missing(program: &str) -> bool {
    let is_missing = Command::new(program).arg("--version").output().is_err();
    if is_missing {
        eprintln!("skipped: there is no {program} here");
    }
    is_missing
}

fn expected() -> String {
    let line = |layout: &Layout| {
        let fields =
            layout.fields.iter().map(|f| format!(" {}={}+{}", f.name, f.offset, f.n_bytes));
        format!("{} {}{}\n", layout.name, layout.n_bytes, fields.collect::<String>())
    };
    layouts().iter().map(line).collect()
}

/// Settings, and whether limits of 0 to 1 for each allow them.
const WITHIN: [([f64; 4], bool); 5] = [
    ([0.0, 1.0, 0.5, 0.25], true),
    ([1.5, 0.0, 0.0, 0.0], false),
    ([0.0, 0.0, 0.0, -0.5], false),
    ([0.0, f64::NAN, 0.0, 0.0], false),
    ([0.0, 0.0, f64::INFINITY, 0.0], false),
];

fn said_of_limits() -> String {
    let limits =
        Limits { min: Settings::from_array([0.0; 4]), max: Settings::from_array([1.0; 4]) };
    let said = WITHIN.map(|(settings, is_within)| {
        let refusal = limits.refusal(&Settings::from_array(settings));
        assert_eq!(refusal.is_none(), is_within);
        refusal.map_or(0, |why| why.code()).to_string()
    });
    said.join(" ")
}

#[test]
fn python_lays_the_messages_out_alike_and_knows_the_limits() {
    if is_missing("python3") {
        return;
    }
    let script = r#"
import ctypes, sys
sys.path.insert(0, sys.argv[1])
import tennis_messages as m
for t in m.MESSAGES:
    fields = ((f[0], getattr(t, f[0])) for f in t._fields_)
    print(t.__name__, ctypes.sizeof(t), *(f"{n}={f.offset}+{f.size}" for n, f in fields))
limits = m.Limits(m.Settings(0, 0, 0, 0), m.Settings(1, 1, 1, 1))
rows = [[0, 1, 0.5, 0.25], [1.5, 0, 0, 0], [0, 0, 0, -0.5]]
rows += [[0, float("nan"), 0, 0], [0, 0, float("inf"), 0]]
print(*(int(m.refusal(limits, m.Settings(*row))) for row in rows))
"#;
    let mut python = Command::new("python3");
    let said = run(python.args(["-B", "-c", script, BINDINGS]));
    assert_eq!(said, expected() + &said_of_limits() + "\n");
}

#[test]
fn c_lays_the_messages_out_alike_and_knows_the_limits() {
    if is_missing("cc") {
        return;
    }
    // The header's own assertions hold offsets and sizes; here they are said once more.
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let (source, binary) = (folder.join("bindings.c"), folder.join("bindings"));
    std::fs::write(&source, text_c::program(&WITHIN.map(|(settings, _)| settings))).unwrap();
    for standard in ["-std=c11", "-std=c17"] {
        let mut cc = Command::new("cc");
        run(cc
            .args([standard, "-Wall", "-Wextra", "-Werror", "-pedantic", "-I", BINDINGS])
            .arg(&source)
            .arg("-o")
            .arg(&binary));
    }
    let said = run(&mut Command::new(&binary));
    assert_eq!(said, expected() + &said_of_limits() + "\n");
}

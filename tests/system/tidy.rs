//! The house rules that a machine can check.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

fn text_of(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

const ROOMS: [&str; 8] = [
    "shm-layout",
    "capture",
    "workers",
    "bridge",
    "fusion",
    "fusion/page",
    "scripts/launcher",
    "tests",
];

/// What npm fetched and built is not ours.
const NOT_OURS: [&str; 2] = ["node_modules", "dist"];

fn sources() -> Vec<PathBuf> {
    // The page lies within fusion and is found there.
    let rooms = ROOMS.iter().filter(|room| **room != "fusion/page");
    let mut open: Vec<PathBuf> = rooms.map(|room| root().join(room)).collect();
    let mut files = Vec::new();
    while let Some(directory) = open.pop() {
        for entry in std::fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                if !NOT_OURS.iter().any(|name| path.ends_with(name)) {
                    open.push(path);
                }
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    assert!(files.len() > 40, "{} sources: the search is broken", files.len());
    files
}

/// Rooms a room's manifest names in its dependency tables.
fn rooms_needed_by(room: &str) -> Vec<String> {
    let manifest: toml::Table = text_of(&root().join(room).join("Cargo.toml")).parse().unwrap();
    let tables = ["dependencies", "dev-dependencies", "build-dependencies"];
    let names = tables.iter().filter_map(|table| manifest.get(*table)?.as_table());
    let is_room = |name: &&String| ROOMS.iter().any(|room| Path::new(room).ends_with(name));
    names.flat_map(toml::Table::keys).filter(is_room).cloned().collect()
}

#[test]
fn rooms_depend_on_shm_layout_and_never_on_each_other() {
    assert_eq!(rooms_needed_by("shm-layout"), Vec::<String>::new());
    for room in ["capture", "workers", "bridge", "fusion", "scripts/launcher"] {
        assert_eq!(rooms_needed_by(room), ["shm-layout"], "{room}");
    }
    // Fusion's window, in a process of its own; it reads clips as capture does.
    assert_eq!(rooms_needed_by("fusion/page"), ["capture", "fusion", "shm-layout"]);
    assert!(rooms_needed_by("tests").iter().all(|room| room != "tests"));
}

#[test]
fn files_and_lines_keep_their_size() {
    for path in sources() {
        let text = text_of(&path);
        let n_lines = text.lines().count();
        assert!(n_lines <= 400, "{}: {n_lines} lines", path.display());
        for (idx, line) in text.lines().enumerate() {
            let n = line.chars().count();
            assert!(n <= 100, "{}:{}: {n} columns", path.display(), idx + 1);
        }
    }
}

#[test]
fn nothing_is_left_undone_or_nameless() {
    let marks = [["TO", "DO"].concat(), ["FIX", "ME"].concat(), ["#[ign", "ore]"].concat()];
    for path in sources() {
        let text = text_of(&path);
        for mark in &marks {
            assert!(!text.contains(mark), "{}: {mark}", path.display());
        }
        let stem = path.file_stem().unwrap().to_str().unwrap();
        assert!(!["util", "utils", "common", "helpers", "misc"].contains(&stem), "{stem}.rs");
    }
}

/// Where unsafe code is allowed: how a function for instructions the machine may lack is called.
const UNSAFE: [&str; 2] = ["workers/src/dispatch.rs", "workers/benches/step.rs"];

#[test]
fn every_room_forbids_unsafe_code_but_for_two_files() {
    for room in ROOMS {
        let text = text_of(&root().join(room).join("src/lib.rs"));
        let word =
            if room == "workers" { "#![deny(unsafe_code)]" } else { "#![forbid(unsafe_code)]" };
        assert!(text.contains(word), "{room}");
    }
    for path in sources() {
        let is_allowed = UNSAFE.iter().any(|name| path.ends_with(name));
        let allows = text_of(&path).contains(&["allow(", "unsafe_code)"].concat());
        assert_eq!(allows, is_allowed, "{}", path.display());
    }
}

#[test]
fn documents_link_to_files_that_are_there() {
    let mut n_links = 0;
    for name in ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let text = text_of(&root().join(name));
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if !target.starts_with("http") && !target.starts_with('#') {
                n_links += 1;
                assert!(root().join(target).exists(), "{name} links to {target}");
            }
        }
    }
    assert!(n_links > 0, "the search is broken");
}

#[test]
fn ci_runs_the_command_the_readme_names() {
    assert!(text_of(&root().join(".ci/run")).contains("scripts/test"));
    assert!(text_of(&root().join("README.md")).contains("scripts/test"));
}

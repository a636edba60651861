//! Bad input is named, with its file, place and what was expected; nothing is left behind.

use crate::run::{simulated, track, turn, words};
use std::path::Path;

/// A short shot folder; each check spoils a copy of it in one way.
fn short_shot() -> tempfile::TempDir {
    simulated(&["--seconds", "0.3"])
}

fn copied(from: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
    }
    folder
}

fn check(name: &str, good: &Path, spoil: impl Fn(&Path), expected: &[&str]) {
    let folder = copied(good);
    spoil(folder.path());
    let json = folder.path().join("shots.json");
    let output = track(&[folder.path().to_str().unwrap(), "--json", json.to_str().unwrap()]);
    let said = words(&output);
    assert_eq!(output.status.code(), Some(1), "{name}: {said}");
    for word in expected {
        assert!(said.contains(word), "{name}: {said:?} lacks {word:?}");
    }
    assert!(!said.contains("panicked") && !said.contains("left in /dev/shm"), "{name}: {said}");
    assert!(!json.exists(), "{name}: nothing was measured, so nothing is written");
    println!("{name}: {}", said.lines().next().unwrap_or_default());
}

fn rewritten(path: &Path, change: impl Fn(String) -> String) {
    let text = std::fs::read_to_string(path).unwrap();
    std::fs::write(path, change(text)).unwrap();
}

#[test]
fn a_spoiled_recording_is_refused_with_its_place() {
    let _turn = turn();
    let good = short_shot();
    let video = |folder: &Path| folder.join("left.y4m");
    let cut = |folder: &Path| {
        let file = std::fs::OpenOptions::new().write(true).open(video(folder)).unwrap();
        file.set_len(5 * 307_206 + 1000).unwrap();
    };
    check(
        "truncated",
        good.path(),
        cut,
        &["left.y4m", "frame 5", "307200 bytes", "after 954 bytes"],
    );
    let garbage = |folder: &Path| std::fs::write(video(folder), "not a video").unwrap();
    check("not a video", good.path(), garbage, &["left.y4m", "line 1", "YUV4MPEG2"]);
    let gone = |folder: &Path| std::fs::remove_file(folder.join("right.timestamps")).unwrap();
    check("no timestamps", good.path(), gone, &["right.timestamps", "No such file"]);
    let word = |folder: &Path| {
        rewritten(&folder.join("left.timestamps"), |text| text.replacen('\n', "\nsoon\n", 1));
    };
    check("a word", good.path(), word, &["left.timestamps", "line 2", "integer", "soon"]);
    let short = |folder: &Path| {
        rewritten(&folder.join("left.timestamps"), |text| text.lines().next().unwrap().to_owned());
    };
    check("one stamp", good.path(), short, &["left.timestamps", "27 lines", "1 lines"]);
}

#[test]
fn a_spoiled_rig_is_refused_with_its_place() {
    let _turn = turn();
    let good = short_shot();
    let rig = |folder: &Path| folder.join("rig.toml");
    let with = |from: &'static str, to: &'static str| {
        move |folder: &Path| {
            rewritten(&rig(folder), |text| {
                assert!(text.contains(from), "{text}");
                text.replacen(from, to, 1)
            });
        }
    };
    let gone = |folder: &Path| std::fs::remove_file(rig(folder)).unwrap();
    check("no rig", good.path(), gone, &["rig.toml", "expected"]);
    check(
        "not TOML",
        good.path(),
        with("[left]", "[left"),
        &["rig.toml", "line 2", "expected `]`"],
    );
    check("no table", good.path(), with("[right]", "[wrong]"), &["rig.toml", "right"]);
    let mirror = with("focal_px            = [1240.0,", "focal_px            = [-1240.0,");
    check("no focal length", good.path(), mirror, &["rig.toml", "line", "focal_px", "-1240"]);
    let small = with("[640, 480]", "[1280, 720]");
    check("other images", good.path(), small, &["640x480", "1280x720", "left"]);
}

#[test]
fn spoiled_candidates_are_refused_with_their_place() {
    let _turn = turn();
    let good = short_shot();
    let with_csv = |left: &'static str| {
        move |folder: &Path| {
            for name in ["left.y4m", "right.y4m"] {
                std::fs::remove_file(folder.join(name)).unwrap();
            }
            std::fs::write(folder.join("left.csv"), left).unwrap();
            std::fs::write(folder.join("right.csv"), "t_ns,x_px,y_px\n0,1,2\n").unwrap();
        }
    };
    check("no column", good.path(), with_csv("t,x,y\n1,2,3\n"), &["left.csv", "line 1", "t_ns"]);
    let word = with_csv("t_ns,x_px,y_px\n0,1,2\n5,left,3\n");
    check("a word", good.path(), word, &["left.csv", "line 3", "x_px", "left"]);
    let back = with_csv("t_ns,x_px,y_px\n9,1,2\n5,1,3\n");
    check("back in time", good.path(), back, &["left.csv", "line 3", "t_ns"]);
}

#[test]
fn a_folder_without_a_shot_is_refused() {
    let empty = tempfile::tempdir().unwrap();
    let output = track(&[empty.path().to_str().unwrap(), "--json", "-"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output).contains("expected left.y4m"), "{}", words(&output));
    let output = track(&["/nowhere", "--json", "-"]);
    assert!(words(&output).contains("/nowhere: expected a shot folder"), "{}", words(&output));
    assert_eq!(track(&["--json"]).status.code(), Some(2), "misused");
}

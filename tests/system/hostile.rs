//! Files that people outside write, damaged at random: each is read or refused with its name, and
//! nothing panics, hangs or takes memory without end.
//!
//! Valid files are cut, doubled, flipped and filled with what breaks parsers; ChaCha8 makes the
//! same damage on every machine, and a failure names its seed.

use crate::run::simulated;
use capture::recording::Recording;
use capture::stamps;
use fusion::Rig;
use fusion::aim::Machine;
use fusion::calibration::exchange::document::Document;
use fusion::calibration::exchange::{self, Files, Given};
use fusion::candidates_csv;
use fusion::drill::Drill;
use page::label_file::{Extent, LabelFile};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Damaged files of each kind.
const N_CASES: u64 = 3000;

/// What breaks parsers.
const POISON: [&[u8]; 16] = [
    b"nan",
    b"-inf",
    b"1e999",
    b"-0",
    b"99999999999999999999",
    b"\0",
    b"\xff\xfe",
    b"[[[[[[[[",
    b"\"",
    b"\n\n",
    b",,,,",
    b"= =",
    b"{}",
    b"W4294967295 H4294967295",
    b"&a [*a, *a]",
    b"-1",
];

fn damaged(valid: &[u8], seed: u64) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut bytes = valid.to_vec();
    for _ in 0..rng.random_range(1..6) {
        let at = |rng: &mut ChaCha8Rng, n: usize| rng.random_range(0..=n);
        let (a, b) = (at(&mut rng, bytes.len()), at(&mut rng, bytes.len()));
        let (from, to) = (a.min(b), a.max(b).min(a.min(b) + 200));
        match rng.random_range(0..5) {
            0 => drop(bytes.drain(from..to)),
            1 => bytes.splice(from..from, bytes[from..to].to_vec()).for_each(drop),
            2 if from < bytes.len() => bytes[from] ^= 1 << rng.random_range(0..8),
            3 => bytes.truncate(from.max(1)),
            _ => {
                let poison = POISON[rng.random_range(0..POISON.len())];
                bytes.splice(from..to, poison.iter().copied()).for_each(drop);
            }
        }
    }
    bytes
}

/// Reads damaged copies of a text; a refusal must name the file. Some must be refused, else the
/// damage does none; those that are still read may say anything.
fn check(name: &str, valid: &[u8], read: impl Fn(&[u8], &str) -> Result<(), String>) {
    read(valid, name).unwrap_or_else(|why| panic!("{name} as it is: {why}"));
    let mut n_refused = 0;
    for seed in 0..N_CASES {
        let bytes = damaged(valid, seed);
        let read = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| read(&bytes, name)));
        match read {
            Ok(Ok(())) => {}
            Ok(Err(why)) => {
                n_refused += 1;
                assert!(why.contains(name), "{name}, seed {seed}: {why}");
                assert!(why.len() < 2000, "{name}, seed {seed}: {} bytes of words", why.len());
            }
            Err(_) => panic!("{name}, seed {seed}: {}", String::from_utf8_lossy(&bytes)),
        }
    }
    println!("{name}: {n_refused} of {N_CASES} refused");
    assert!(n_refused > N_CASES / 5, "{name}: {n_refused}");
}

fn check_text(name: &str, valid: &str, read: impl Fn(&str, &str) -> Result<(), fusion::Error>) {
    check(name, valid.as_bytes(), |bytes, name| {
        // What is no UTF-8 is refused where files are opened.
        let Ok(text) = std::str::from_utf8(bytes) else { return Ok(()) };
        read(text, name).map_err(|why| why.to_string())
    });
}

const MACHINE: &str = include_str!("../../fusion/rigs/machine.toml");
const DRILL: &str = include_str!("../../fusion/rigs/drill.toml");

#[test]
fn rigs_machines_and_drills_are_read_or_refused() {
    check_text("desk.toml", include_str!("../../fusion/rigs/desk.toml"), |text, name| {
        Rig::from_file_text(name, text).map(drop)
    });
    check_text("machine.toml", MACHINE, |text, name| Machine::from_file_text(name, text).map(drop));
    let machine = Machine::from_file_text("machine.toml", MACHINE).unwrap();
    check_text("drill.toml", DRILL, |text, name| {
        Drill::from_file_text(name, text, &machine).map(drop)
    });
}

#[test]
fn rigs_of_other_tools_are_read_or_refused() {
    for (name, valid) in [
        (
            "camchain.yaml",
            include_str!("../../fusion/src/calibration/exchange/fixtures/camchain.yaml"),
        ),
        (
            "left_camera.yml",
            include_str!("../../fusion/src/calibration/exchange/fixtures/left_camera.yml"),
        ),
    ] {
        let image_px = Some([640, 480]);
        let read = |bytes: &[u8], name: &str| {
            let Ok(text) = std::str::from_utf8(bytes) else { return Ok(()) };
            let document = Document::parse(name, text).map_err(|why| why.to_string())?;
            let files = match name {
                "camchain.yaml" => Files { both: vec![document], own: None },
                // Half of a rig: it must be refused in words when it is read.
                _ => return Ok(()),
            };
            let given = Given { image_px, is_mm: false };
            exchange::rig_from(&files, &given).map(drop).map_err(|why| why.to_string())
        };
        check(name, valid.as_bytes(), read);
    }
}

#[test]
fn candidates_are_read_or_refused() {
    let lines: String = (0..40).map(|i| format!("{},{}.5,100.25\n", i * 11_111_111, i)).collect();
    let valid = format!("t_ns,x_px,y_px\n{lines}");
    check("left.csv", valid.as_bytes(), |bytes, name| {
        candidates_csv::frames_from(bytes, name).map(drop).map_err(|why| why.to_string())
    });
}

/// Writes a damaged file into a folder and reads it there.
fn check_file(name: &str, valid: &[u8], read: impl Fn(&Path) -> Result<(), String>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    check(name, valid, |bytes, _| {
        std::fs::write(&path, bytes).unwrap();
        read(&path)
    });
}

#[test]
fn clips_stamps_and_labels_are_read_or_refused() {
    let folder = simulated(&["--shots", "1", "--seconds", "0.05", "--noise", "0"]);
    let video = std::fs::read(folder.path().join("left.y4m")).unwrap();
    // The head and the first rows: the rest is pixels, of which any are right.
    let n_frames = 1;
    let head = video.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let video = &video[..head + n_frames * (640 * 480 + b"FRAME\n".len())];
    check_file("left.y4m", video, |path| {
        let recording = Recording::open(path);
        let mut recording = recording.map_err(|why| why.to_string())?;
        let (width, height) = recording.size_px();
        let mut luma = vec![0; width as usize * height as usize];
        recording.read_into(&mut luma).map_err(|why| why.to_string())
    });
    let stamps = std::fs::read(folder.path().join("left.timestamps")).unwrap();
    check_file("left.timestamps", &stamps, |path| {
        stamps::from_file(path).map(drop).map_err(|why| why.to_string())
    });
    let extent = Extent { n_frames: 100, size_px: (640, 480) };
    let labels: String = (0..60).map(|i| format!("{i},{}.5,20.25\n", i * 3)).collect();
    check_file("labels.csv", format!("frame,x_px,y_px\n{labels}").as_bytes(), |path| {
        LabelFile::open(path, extent).map(drop).map_err(|why| why.to_string())
    });
}

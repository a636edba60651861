//! A USB camera made of answers (`tests/fake-cameras/fake-v4l2.c`) under the real `capture`: this
//! kernel has no V4L2, and whoever tests has no camera.

use crate::filmed::{
    Board, PERIOD_NS, check_all_arrived, frames_of, intervals_ns, jpeg, median, shim, words_of,
};
use crate::run::{binary, simulated, turn};
use shm_layout::commands::{Command as Asked, Kind, Outcome};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

const N_PICTURES: usize = 8;

/// A folder that the library takes for a camera.
struct Fake {
    folder: tempfile::TempDir,
    shim: PathBuf,
}

impl Fake {
    fn new(format: &str, payloads: &[Vec<u8>]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let shim = shim("fake-v4l2.c", folder.path());
        let fake = Self { folder, shim };
        fake.put("video0", b"");
        fake.put("format", format.as_bytes());
        for (k, payload) in payloads.iter().enumerate() {
            fake.put(&k.to_string(), payload);
        }
        fake
    }

    fn put(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.folder.path().join(name), bytes).unwrap();
    }

    fn remove(&self, name: &str) {
        std::fs::remove_file(self.folder.path().join(name)).unwrap();
    }

    fn device(&self) -> String {
        self.folder.path().join("video0").display().to_string()
    }

    fn capture(&self, board: &Board, flags: &[&str]) -> Child {
        let device = self.device();
        let mut all = vec!["--source", "usb", "--device", &device];
        all.extend(flags);
        board.capture(&binary("capture"), &self.environment(), &all)
    }

    fn environment(&self) -> [(&str, &Path); 2] {
        [("LD_PRELOAD", &self.shim), ("FAKE_V4L2", self.folder.path())]
    }
}

fn pictures() -> Vec<Vec<u8>> {
    let shot = simulated(&["--seed", "5"]);
    frames_of(shot.path(), N_PICTURES)
}

/// The first frames as they stand in shared memory.
fn published(board: &Board) -> Vec<Vec<u8>> {
    let reader = board.member.frames().unwrap().reader().unwrap();
    let (mut frames, begun) = (Vec::new(), Instant::now());
    while frames.len() < N_PICTURES && begun.elapsed() < Duration::from_secs(20) {
        match reader.receive().unwrap() {
            Some(frame) => frames.push(frame.payload().to_vec()),
            None => std::thread::sleep(Duration::from_millis(1)),
        }
    }
    frames
}

#[test]
fn frames_of_a_usb_camera_arrive_as_they_are_in_every_format() {
    let _turn = turn();
    let pictures = pictures();
    let yuyv = |luma: &Vec<u8>| luma.iter().flat_map(|&y| [y, 128]).collect::<Vec<u8>>();
    let formats: [(&str, Vec<Vec<u8>>, u8); 3] = [
        ("GREY", pictures.clone(), 0),
        ("YUYV", pictures.iter().map(yuyv).collect(), 0),
        ("MJPG", pictures.iter().map(|luma| jpeg(luma, (640, 480))).collect(), 12),
    ];
    for (format, payloads, off_max) in formats {
        let fake = Fake::new(format, &payloads);
        let board = Board::new("usb");
        let capture = fake.capture(&board, &["--frames", "90"]);
        let frames = published(&board);
        // Read while it runs: what was published goes with its publisher.
        let (infos, strips) = board.all(Duration::from_millis(500));
        let (code, words) = words_of(capture);
        assert_eq!(code, Some(0), "{format}: {words}");
        println!("{format}: {words}");
        // How many frames the automatic start took is not told: the pictures follow one another.
        let off = |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        let is_it = |first: &usize| {
            let shown = pictures.iter().cycle().skip(*first);
            frames.iter().zip(shown).all(|(frame, picture)| off(frame, picture) <= off_max)
        };
        assert_eq!(frames.len(), N_PICTURES);
        assert!((0..N_PICTURES).any(|first| is_it(&first)), "{format}: other pixels");
        assert!(words.contains("90 frames at ") && words.contains("copied 90 times"), "{words}");
        let spacing_ns = median(intervals_ns(&infos));
        assert!((spacing_ns - PERIOD_NS).abs() < PERIOD_NS / 100, "{spacing_ns}");
        if words.contains(" 0 dropped") {
            check_all_arrived(&infos, &strips, 90);
        } else {
            // A busy machine may be late by four frames: then their numbers are left out.
            assert!(infos.last().unwrap().frame_idx > 89, "{words}");
        }
        board.close();
    }
}

#[test]
fn a_usb_camera_is_set_unplugged_busy_and_forbidden() {
    let _turn = turn();
    let fake = Fake::new("GREY", &pictures());
    let board = Board::new("usb-gone");
    let capture = fake.capture(&board, &[]);
    while board.infos_for(Duration::from_millis(200)).is_empty() {}
    let mut command = Asked::new(Kind::SetCamera);
    command.exposure_us = 700.0;
    assert_eq!(board.ask(command), (Outcome::Done, "set from the next frames on".to_owned()));
    let log = std::fs::read_to_string(fake.folder.path().join("log")).unwrap();
    // Manual, then twice 100 us of the automatic 15.6 ms cut to 2, then what was asked.
    let exposures: Vec<&str> = log.lines().filter(|line| line.starts_with("0x9a0902")).collect();
    assert_eq!(exposures, ["0x9a0902 20", "0x9a0902 7"], "{log}");
    fake.put("gone", b"");
    let (code, words) = words_of(capture);
    assert_eq!(code, Some(75), "{words}");
    let (device, gone) = (fake.device(), "is gone: No such device (os error 19)");
    assert_eq!(words, format!("capture left: Fake USB camera ({device}) {gone}\n"), "one line");
    fake.remove("gone");

    for (file, code_expected, why) in [
        ("busy", 75, "is busy: another program uses it"),
        ("denied", 77, "is this user in the group video?"),
    ] {
        fake.put(file, b"");
        let (code, words) = words_of(fake.capture(&board, &[]));
        assert_eq!((code, words.lines().count()), (Some(code_expected), 1), "{words}");
        assert!(words.contains(why), "{words}");
        fake.remove(file);
    }
    let (code, words) = words_of(fake.capture(&board, &["--size", "1280x720"]));
    assert!(code == Some(78) && words.contains("GREY comes as 640x480"), "{code:?} {words}");
    let (code, words) = words_of(board.capture(&binary("capture"), &[], &["--source", "usb"]));
    assert!(code == Some(69) && words.contains("no camera"), "{code:?} {words}");
    board.close();
}

#[test]
fn a_preview_tells_light_and_writes_what_it_saw() {
    let _turn = turn();
    let pictures = pictures();
    let fake = Fake::new("GREY", &pictures[..1]);
    let file = fake.folder.path().join("aim.png");
    let preview = Command::new(binary("capture"))
        .args(["--source", "usb", "--device", &fake.device(), "--frames", "1", "--preview"])
        .arg(&file)
        .envs(fake.environment())
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&preview.stdout).into_owned();
    assert!(preview.status.success() && words.starts_with("focus "), "{preview:?}");
    assert_eq!(image::open(&file).unwrap().into_luma8().into_raw(), pictures[0]);
}

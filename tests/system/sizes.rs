//! Capture begins anew, with frames of another size or not, while workers run: they follow, what
//! they find is what workers find that never saw the other size, bit for bit, and they take no more
//! memory.

use crate::run::turn;
use shm_layout::services::{Domain, Place};
use shm_layout::{Camera, StripCandidates};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use tests::latency::usage::memory;
use tests::processes::{Household, Until, own_court};

const N_WORKERS: u32 = 2;
const N_FRAMES: usize = 150;

/// Noise on grey and a ball that flies: both sizes from the same rule, so that a pixel of one
/// picture taken for one of the other would be something new.
fn write_recording(folder: &Path, name: &str, (width_px, height_px): (usize, usize)) -> PathBuf {
    let mut bytes = format!("YUV4MPEG2 W{width_px} H{height_px} F90:1 Cmono\n").into_bytes();
    let mut stamps = String::new();
    let mut state = width_px as u32;
    for frame_idx in 0..N_FRAMES {
        bytes.extend_from_slice(b"FRAME\n");
        let (ball_x, ball_y) = (20 + frame_idx * width_px / 200, 60 + frame_idx * height_px / 300);
        for y in 0..height_px {
            for x in 0..width_px {
                state ^= state << 13;
                state ^= state >> 17;
                state ^= state << 5;
                let squared = x.abs_diff(ball_x).pow(2) + y.abs_diff(ball_y).pow(2);
                let ball = if frame_idx > 60 && squared <= 16 { 110 } else { 0 };
                // A step between the halves: where rows are mixed up it is elsewhere.
                let ground = if y < height_px / 2 { 60 } else { 120 };
                bytes.push(ground + ball + (state % 8) as u8);
            }
        }
        stamps += &format!("{}\n", frame_idx * 1_000_000_000 / 90);
    }
    std::fs::write(folder.join(name).with_extension("timestamps"), stamps).unwrap();
    let recording = folder.join(name).with_extension("y4m");
    std::fs::write(&recording, bytes).unwrap();
    recording
}

/// What of a message does not depend on when it was made: all floats by their bits.
type Found = (u32, u32, Vec<[u32; 13]>);

/// What came of the newest recording, by frame and strip.
#[derive(Default)]
struct Taken {
    recording_ids: Vec<u64>,
    found: BTreeMap<(u64, u32), Found>,
}

impl Taken {
    fn take(&mut self, message: &StripCandidates) {
        if self.recording_ids.last() != Some(&message.recording_id) {
            assert!(!self.recording_ids.contains(&message.recording_id), "a strip went back");
            self.recording_ids.push(message.recording_id);
            self.found = BTreeMap::new();
        }
        let spots = message.spots().iter().map(|spot| spot.to_array().map(f32::to_bits));
        let of_frame = (message.n_strips, message.is_learning, spots.collect());
        let again = self.found.insert((message.frame_idx, message.strip_idx), of_frame);
        assert!(again.is_none(), "twice: {} {}", message.frame_idx, message.strip_idx);
    }
}

/// What workers find in the last of these recordings, played one after the other; one that is to be
/// killed is cut off in the middle.
fn played(recordings: &[(&Path, bool)]) -> BTreeMap<(u64, u32), Found> {
    let court = own_court("sizes").unwrap();
    let board = Domain::new(&court, Place::Board(Camera::Left)).unwrap();
    let mut house = Household::new(&court).unwrap();
    for strip in 0..N_WORKERS {
        let (strip, n) = (strip.to_string(), N_WORKERS.to_string());
        let flags = ["--camera", "left", "--strip", &strip, "--of", &n, "--learning-frames", "20"];
        house.start("worker", "worker", &flags, Until::Stopped, Stdio::null()).unwrap();
    }
    let member = board.join("test").unwrap();
    let strips = member.candidates().unwrap().reader().unwrap();
    let mut taken = Taken::default();
    for (idx, (recording, is_killed)) in recordings.iter().enumerate() {
        let (n, path) = (N_WORKERS.to_string(), recording.to_str().unwrap());
        let flags = ["--camera", "left", "--workers", &n, "--speed", "max", "--recording", path];
        let capture = house.start("capture", "capture", &flags, Until::Done, Stdio::null());
        let capture = capture.unwrap();
        let n_all = N_FRAMES * N_WORKERS as usize;
        let n_wanted = if *is_killed { n_all / 2 } else { n_all };
        while taken.recording_ids.len() != idx + 1 || taken.found.len() < n_wanted {
            match strips.receive().unwrap() {
                Some(strip) => taken.take(&strip),
                None => std::thread::yield_now(),
            }
        }
        if *is_killed {
            capture.kill().unwrap();
        }
        assert_eq!(capture.wait().unwrap().success(), !is_killed);
    }
    assert_eq!(taken.recording_ids.len(), recordings.len());
    drop((strips, member));
    taken.found
}

#[test]
fn workers_follow_frames_of_another_size_and_find_nothing_that_is_not_there() {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let small = write_recording(folder.path(), "small", (640, 480));
    let large = write_recording(folder.path(), "large", (1280, 720));
    for (last, first) in [(&large, &small), (&small, &large)] {
        let alone = played(&[(last, false)]);
        let spots = alone.values().map(|(_, _, spots)| spots.len());
        let n_spots: usize = spots.sum();
        assert_eq!(alone.len(), N_FRAMES * N_WORKERS as usize);
        assert!((20..N_FRAMES * 2).contains(&n_spots), "{n_spots} spots");
        for is_killed in [false, true] {
            let after = played(&[(first, is_killed), (last, false)]);
            assert!(after == alone, "killed: {is_killed}: other candidates after another size");
        }
    }
}

#[test]
fn a_worker_has_room_for_one_recording_only() {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let recording = write_recording(folder.path(), "again", (640, 480));
    let court = own_court("room").unwrap();
    let mut house = Household::new(&court).unwrap();
    let flags = ["--camera", "left", "--strip", "0", "--of", "1"];
    let worker = house.start("worker", "worker", &flags, Until::Stopped, Stdio::null()).unwrap();
    let worker = worker.id();
    let path = recording.to_str().unwrap();
    let taken_mib: Vec<f64> = (0..6)
        .map(|_| {
            let flags = ["--camera", "left", "--speed", "max", "--recording", path];
            let capture = house.start("capture", "capture", &flags, Until::Done, Stdio::null());
            assert!(capture.unwrap().wait().unwrap().success());
            memory(worker).unwrap().private_kib as f64 / 1024.0
        })
        .collect();
    // A second background is 6 MiB.
    assert!(taken_mib.iter().all(|mib| mib - taken_mib[0] < 3.0), "{taken_mib:?}");
}

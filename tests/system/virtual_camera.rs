//! libcamera's virtual camera, which `scripts/virtual-camera` prepares, under the real `capture`.

use crate::filmed::{
    Board, PERIOD_NS, check_all_arrived, frames_of, intervals_ns, jpeg, median, words_of,
};
use crate::run::{binary, simulated, turn};
use shm_layout::StripCandidates;
use shm_layout::commands::{Command as Asked, Kind, Outcome};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::Duration;

/// `scripts/virtual-camera` has prepared it; where is libcamera, and the capture built with it?
struct Virtual {
    place: PathBuf,
}

impl Virtual {
    fn find() -> Option<Self> {
        let place = binary("").parent().unwrap().join("virtual-camera");
        if place.join("target/release/capture").is_file() {
            return Some(Self { place });
        }
        println!("skipped: scripts/virtual-camera has not prepared {}", place.display());
        None
    }

    /// The camera shows these pictures, each four times, again and again.
    fn show(&self, pictures: &Path) {
        let folder = self.place.join("share/libcamera/pipeline/virtual");
        std::fs::create_dir_all(&folder).unwrap();
        let size = |width_px: u32, height_px: u32| {
            let rates = "frame_rates: [1, 500]";
            format!("    - {{ width: {width_px}, height: {height_px}, {rates} }}\n")
        };
        let sizes = size(640, 480) + &size(1280, 720);
        let frames = format!("  frames: {{ path: \"{}/\" }}\n", pictures.display());
        let rest = "  location: \"CameraLocationFront\"\n  model: \"Virtual tennis\"\n";
        let head = "%YAML 1.1\n---\n\"VirtualBall\":\n  supported_formats:\n";
        let text = [head, &sizes, &frames, rest].concat();
        std::fs::write(folder.join("virtual.yaml"), text).unwrap();
    }

    fn capture(&self, board: &Board, unplugged: &Path, flags: &[&str]) -> Child {
        let mut all = vec!["--source", "libcamera"];
        all.extend(flags);
        let library = self.place.join("lib");
        let shim = library.join("libfake-udmabuf.so");
        let environment: [(&str, &Path); 3] =
            [("LD_LIBRARY_PATH", &library), ("LD_PRELOAD", &shim), ("FAKE_UNPLUGGED", unplugged)];
        board.capture(&self.place.join("target/release/capture"), &environment, &all)
    }
}

/// Balls of the labels in these pictures: (picture, x, y).
fn labels_of(folder: &Path, first: usize) -> BTreeMap<usize, (f64, f64)> {
    let text = std::fs::read_to_string(folder.join("left.labels.csv")).unwrap();
    let label = |line: &str| {
        let fields: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
        let picture = (fields[0] as usize).checked_sub(first)?;
        (fields[3] == 0.0).then_some((picture, (fields[1], fields[2])))
    };
    text.lines().skip(1).filter_map(label).collect()
}

/// Of the frames that show a labelled ball, the share with a candidate within 3 px of it, if the
/// first frame was the camera's frame number `offset`.
fn found(strips: &[StripCandidates], balls: &BTreeMap<usize, (f64, f64)>, offset: u64) -> f64 {
    let mut seen: BTreeMap<u64, bool> = BTreeMap::new();
    for strip in strips.iter().filter(|strip| strip.is_learning == 0) {
        let picture = ((strip.frame_idx + offset) / 4) as usize;
        let Some((x_px, y_px)) = balls.get(&picture) else { continue };
        let is_near = strip
            .spots()
            .iter()
            .any(|spot| (f64::from(spot.x_px) - x_px).hypot(f64::from(spot.y_px) - y_px) < 3.0);
        *seen.entry(strip.frame_idx).or_default() |= is_near;
    }
    seen.values().filter(|seen| **seen).count() as f64 / seen.len().max(1) as f64
}

#[test]
fn every_frame_of_the_virtual_camera_arrives_in_order_on_time_and_copied_once() {
    let Some(camera) = Virtual::find() else { return };
    let _turn = turn();
    let shot = simulated(&["--seed", "3"]);
    let pictures = shot.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    // The ball comes into view at frame 94; each picture is shown four times.
    let (first, n_pictures) = (84, 90);
    for (k, luma) in frames_of(shot.path(), first + n_pictures)[first..].iter().enumerate() {
        std::fs::write(pictures.join(format!("{k}.jpg")), jpeg(luma, (640, 480))).unwrap();
    }
    camera.show(&pictures);
    let board = Board::new("virtual");
    let unplugged = shot.path().join("unplugged");
    let capture = camera.capture(&board, &unplugged, &["--frames", "300"]);
    let (infos, strips) = board.all(Duration::from_secs(1));
    let (code, words) = words_of(capture);
    assert_eq!(code, Some(0), "{words}");
    println!("{words}");
    assert!(words.contains("300 frames at ") && words.contains(" 0 dropped"), "{words}");
    assert!(words.contains("copied 300 times, 92160000 bytes"), "one copy a frame: {words}");
    check_all_arrived(&infos, &strips, 300);
    let spacing_ns = median(intervals_ns(&infos));
    assert!((spacing_ns - PERIOD_NS).abs() < PERIOD_NS / 50, "{spacing_ns}");
    let span_ns = infos[299].exposed_ns - infos[0].exposed_ns;
    assert!((span_ns - 299 * PERIOD_NS).abs() < 3 * PERIOD_NS, "{span_ns}");

    // How many frames the automatic start took is not told, so it is looked for.
    let balls = labels_of(shot.path(), first);
    let best = (0..60).map(|offset| (found(&strips, &balls, offset), offset));
    let (share, offset) = best.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    println!("balls found in {:.1} % of frames, from the camera's frame {offset}", 100.0 * share);
    assert!(share > 0.9, "{share}");
    board.close();
}

#[test]
fn the_virtual_camera_is_set_stopped_started_killed_and_unplugged() {
    let Some(camera) = Virtual::find() else { return };
    let _turn = turn();
    let shot = simulated(&["--seed", "3"]);
    let pictures = shot.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    let luma = &frames_of(shot.path(), 1)[0];
    std::fs::write(pictures.join("0.jpg"), jpeg(luma, (640, 480))).unwrap();
    camera.show(&pictures);
    let board = Board::new("unplug");
    let unplugged = shot.path().join("unplugged");
    let mut capture = camera.capture(&board, &unplugged, &[]);
    let second = Duration::from_secs(1);
    while board.infos_for(second).is_empty() {}

    let set = |set: fn(&mut Asked)| {
        let mut command = Asked::new(Kind::SetCamera);
        set(&mut command);
        board.ask(command)
    };
    let exposure = set(|command| command.exposure_us = 1000.0);
    let why = "this camera has no exposure (us) to set".to_owned();
    assert_eq!(exposure, (Outcome::Refused, why), "the virtual one has not");
    let too_fast = set(|command| command.frame_rate_hz = 900.0);
    assert!(too_fast.0 == Outcome::Refused && too_fast.1.contains("500.0"), "{too_fast:?}");
    assert_eq!(set(|command| command.frame_rate_hz = 45.0).0, Outcome::Done);
    let slower = board.infos_for(second);
    let spacing_ns = median(intervals_ns(&slower[slower.len() / 2..]));
    assert!((spacing_ns - 2 * PERIOD_NS).abs() < PERIOD_NS / 20, "45 frames/s: {spacing_ns}");

    assert_eq!(board.ask(Asked::new(Kind::Stop)).0, Outcome::Done);
    let last_idx =
        board.infos_for(second / 4).last().unwrap_or(&slower[slower.len() - 1]).frame_idx;
    assert!(board.infos_for(second / 2).is_empty(), "frames while stopped");
    assert_eq!(board.ask(Asked::new(Kind::Start)).0, Outcome::Done);
    let again = board.infos_for(second / 2);
    assert_eq!(again[0].frame_idx, last_idx + 1, "none is lost by stopping");

    capture.kill().unwrap();
    assert_eq!(words_of(capture).0, None);
    board.infos_for(second / 4);
    let capture = camera.capture(&board, &unplugged, &["--size", "1280x720"]);
    let restarted = loop {
        let infos = board.infos_for(second / 2);
        if !infos.is_empty() {
            break infos;
        }
    };
    assert_ne!(restarted[0].recording_id, again[0].recording_id);
    assert_eq!((restarted[0].frame_idx, restarted[0].width_px), (0, 1280));

    std::fs::write(&unplugged, "").unwrap();
    let (code, words) = words_of(capture);
    std::fs::remove_file(&unplugged).unwrap();
    assert_eq!(code, Some(75), "{words}");
    let why = "capture left: Virtual tennis (VirtualBall) is gone: no frame for 1.0 s\n";
    assert_eq!(words, why, "one line");

    let capture = camera.capture(&board, &unplugged, &["--device", "another"]);
    let (code, words) = words_of(capture);
    assert!(code == Some(69) && words.contains("no camera \"another\""), "{code:?} {words}");
    let capture = camera.capture(&board, &unplugged, &["--size", "1920x1080"]);
    let (code, words) = words_of(capture);
    assert!(code == Some(78) && words.contains("1920x1080 at 90 frames/s"), "{code:?} {words}");
    board.close();
}

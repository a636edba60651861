//! A board for cameras that are not there: real workers, a listener, and the real `capture` under
//! a library that answers for the camera.

use crate::run::binary;
use shm_layout::commands::{Answers, Command as Asked, Outcome};
use shm_layout::services::{Domain, Member, Place};
use shm_layout::{Camera, FrameInfo, StripCandidates};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub const N_STRIPS: u32 = 2;
pub const PERIOD_NS: i64 = 11_111_111;

pub fn shim(source: &str, folder: &Path) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("fake-cameras").join(source);
    let library = folder.join("libfake.so");
    let arguments = ["-shared", "-fPIC", "-O2", "-o"];
    let cc = Command::new("cc").args(arguments).arg(&library).arg(source).arg("-ldl").status();
    assert!(cc.unwrap().success(), "scripts/setup installs a C compiler");
    library
}

/// The luma of a simulated recording, frame by frame.
pub fn frames_of(folder: &Path, n: usize) -> Vec<Vec<u8>> {
    let mut recording = capture::recording::Recording::open(&folder.join("left.y4m")).unwrap();
    let (width_px, height_px) = recording.size_px();
    let read = |_| {
        let mut luma = vec![0; (width_px * height_px) as usize];
        recording.read_into(&mut luma).unwrap();
        luma
    };
    (0..n).map(read).collect()
}

pub fn jpeg(luma: &[u8], (width_px, height_px): (u32, u32)) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 98);
    encoder.encode(luma, width_px, height_px, image::ExtendedColorType::L8).unwrap();
    bytes
}

/// Two workers and a listener, waiting for a capture.
pub struct Board {
    domain: Domain,
    pub member: Member,
    workers: Vec<Child>,
    infos: shm_layout::ports::MessageReader<FrameInfo>,
    strips: shm_layout::ports::MessageReader<StripCandidates>,
    court: String,
}

impl Board {
    pub fn new(name: &str) -> Self {
        let court = format!("{name}-{}", std::process::id());
        let domain = Domain::new(&court, Place::Board(Camera::Left)).unwrap();
        let member = domain.join("test").unwrap();
        let infos = member.frames_info().unwrap().reader().unwrap();
        let strips = member.candidates().unwrap().reader().unwrap();
        let worker = |strip: u32| {
            Command::new(binary("worker"))
                .args(["--court", &court, "--camera", "left", "--learning-frames", "20"])
                .args(["--strip", &strip.to_string(), "--of", &N_STRIPS.to_string()])
                .arg("--with-parent")
                .spawn()
                .unwrap()
        };
        let workers = (0..N_STRIPS).map(worker).collect();
        Self { domain, member, workers, infos, strips, court }
    }

    pub fn capture(&self, binary: &Path, environment: &[(&str, &Path)], flags: &[&str]) -> Child {
        Command::new(binary)
            .args(["--court", &self.court, "--camera", "left", "--workers", "2", "--with-parent"])
            .args(flags)
            .envs(environment.iter().copied())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// Everything that comes until nothing has come for so long, once something has.
    pub fn all(&self, quiet: Duration) -> (Vec<FrameInfo>, Vec<StripCandidates>) {
        let (mut infos, mut strips) = (Vec::new(), Vec::new());
        let (begun, mut last) = (Instant::now(), Instant::now());
        while last.elapsed() < quiet || infos.is_empty() {
            assert!(begun.elapsed() < Duration::from_secs(30), "{} frames came", infos.len());
            let n_before = infos.len() + strips.len();
            while let Some(info) = self.infos.receive().unwrap() {
                infos.push(*info);
            }
            while let Some(strip) = self.strips.receive().unwrap() {
                strips.push(*strip);
            }
            if infos.len() + strips.len() > n_before {
                last = Instant::now();
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        (infos, strips)
    }

    pub fn infos_for(&self, how_long: Duration) -> Vec<FrameInfo> {
        let (begun, mut infos) = (Instant::now(), Vec::new());
        while begun.elapsed() < how_long {
            while let Some(info) = self.infos.receive().unwrap() {
                infos.push(*info);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        infos
    }

    /// Capture's own answer.
    pub fn ask(&self, command: Asked) -> (Outcome, String) {
        let client = self.member.commands().unwrap().client().unwrap();
        let Answers { answers, .. } = client.ask(command, Duration::from_secs(5)).unwrap();
        let own = answers.iter().find(|answer| answer.outcome() != Outcome::NotMine);
        let own = own.expect("capture answers");
        (own.outcome(), own.reason())
    }

    pub fn close(mut self) {
        for worker in &mut self.workers {
            let pid = rustix::process::Pid::from_child(worker);
            rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
            assert!(worker.wait().unwrap().success());
        }
        let Self { domain, member, infos, strips, .. } = self;
        drop((infos, strips, member));
        assert_eq!(domain.close().unwrap(), Vec::<String>::new(), "left in shared memory");
    }
}

pub fn median(mut values: Vec<i64>) -> i64 {
    values.sort_unstable();
    values[values.len() / 2]
}

pub fn intervals_ns(infos: &[FrameInfo]) -> Vec<i64> {
    infos.windows(2).map(|pair| pair[1].exposed_ns - pair[0].exposed_ns).collect()
}

/// Every frame arrives once, in order, is seen by every strip in order, and its stamp is the
/// camera's: before it was published and less than 100 ms so.
pub fn check_all_arrived(infos: &[FrameInfo], strips: &[StripCandidates], n_frames: u64) {
    let numbers: Vec<u64> = infos.iter().map(|info| info.frame_idx).collect();
    assert_eq!(numbers, (0..n_frames).collect::<Vec<_>>(), "in order, none lost");
    for strip_idx in 0..N_STRIPS {
        let of_strip = strips.iter().filter(|strip| strip.strip_idx == strip_idx);
        assert_eq!(of_strip.map(|strip| strip.frame_idx).collect::<Vec<_>>(), numbers);
    }
    for info in infos {
        let late_ns = info.published_ns - info.exposed_ns;
        assert!((0..100_000_000).contains(&late_ns), "frame {}: {late_ns}", info.frame_idx);
        assert_eq!(info.clock_sigma_ns, 0, "on this board's clock");
    }
}

pub fn words_of(capture: Child) -> (Option<i32>, String) {
    let Output { status, stderr, .. } = capture.wait_with_output().unwrap();
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

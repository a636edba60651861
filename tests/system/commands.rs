//! Commands to a board of real processes: done as answered, or refused with the reason.

use crate::run::{left_in_shm, run, turn, words};
use rustix::process::{Pid, Signal, kill_process};
use shm_layout::ports::MessageReader;
use shm_layout::services::{Domain, Member, Place};
use shm_layout::{Camera, FrameInfo, StripCandidates};
use std::path::Path;
use std::process::{Output, Stdio};
use std::time::Duration;
use tests::chain::Chain;
use tests::processes::{Error, Household, Until, free_endpoint, own_court};
use zenoh::Wait as _;

/// An image is several of Zenoh's batches, and was once more than the bridge could pass on.
const WIDTH_PX: u32 = 640;
const HEIGHT_PX: u32 = 480;
const N_FRAMES: usize = 900;
/// Slow, so that the recording lasts a minute and outlives every check.
const FRAME_RATE_HZ: usize = 15;
const N_WORKERS: u32 = 2;

/// Noise on grey, different in every frame.
fn luma_of(frame_idx: usize) -> Vec<u8> {
    let mut state = frame_idx as u32 + 1;
    let mut noise = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        96 + (state % 8) as u8
    };
    (0..WIDTH_PX * HEIGHT_PX).map(|_| noise()).collect()
}

fn write_recording(folder: &Path) -> std::path::PathBuf {
    let mut bytes = format!("YUV4MPEG2 W{WIDTH_PX} H{HEIGHT_PX} F15:1 Cmono\n").into_bytes();
    let mut stamps = String::new();
    for frame_idx in 0..N_FRAMES {
        bytes.extend_from_slice(b"FRAME\n");
        bytes.extend(luma_of(frame_idx));
        stamps += &format!("{}\n", frame_idx * 1_000_000_000 / FRAME_RATE_HZ);
    }
    let recording = folder.join("left.y4m");
    std::fs::write(&recording, bytes).unwrap();
    std::fs::write(folder.join("left.timestamps"), stamps).unwrap();
    recording
}

/// A left board that plays, and the bridge beside fusion; this process is fusion.
struct Court {
    name: String,
    endpoint: String,
    house: Household,
    _fusion: Reading,
    board: Reading,
}

/// What a domain's readers see; dropped before the domain is closed.
struct Reading {
    infos: MessageReader<FrameInfo>,
    strips: MessageReader<StripCandidates>,
    _member: Member,
}

impl Reading {
    fn of(court: &str, place: Place) -> Self {
        let member = Domain::new(court, place).unwrap().join("test").unwrap();
        Self {
            infos: member.frames_info().unwrap().reader().unwrap(),
            strips: member.candidates().unwrap().reader().unwrap(),
            _member: member,
        }
    }

    /// The last frame that has come by now.
    fn last_frame(&self) -> Option<u64> {
        std::iter::from_fn(|| self.infos.receive().unwrap()).map(|info| info.frame_idx).last()
    }

    fn next_frame(&self) -> u64 {
        loop {
            if let Some(info) = self.infos.receive().unwrap() {
                return info.frame_idx;
            }
            std::thread::yield_now();
        }
    }

    /// The first message of each strip for which this holds; what came before is passed over.
    fn first_of_each_strip(&self, is_it: impl Fn(&StripCandidates) -> bool) -> Vec<u64> {
        let mut found = vec![None; N_WORKERS as usize];
        while found.contains(&None) {
            match self.strips.receive().unwrap() {
                Some(strip) if is_it(&strip) => {
                    found[strip.strip_idx as usize].get_or_insert(strip.frame_idx);
                }
                Some(_) => {}
                None => std::thread::yield_now(),
            }
        }
        found.into_iter().flatten().collect()
    }
}

/// As a [`Chain`] does, but with a folder for recordings and a background that is learned soon.
fn start_board(house: &mut Household, endpoint: &str, recordings: &Path) {
    let recordings = recordings.to_str().unwrap();
    let flags = ["board", "--camera", "left", "--connect", endpoint, "--recordings", recordings];
    house.start("bridge left", "bridge", &flags, Until::Stopped, Stdio::null()).unwrap();
    for strip in 0..N_WORKERS {
        let (strip, n) = (strip.to_string(), N_WORKERS.to_string());
        let flags = ["--camera", "left", "--strip", &strip, "--of", &n, "--learning-frames", "20"];
        let name = format!("worker left {strip}");
        house.start(&name, "worker", &flags, Until::Stopped, Stdio::null()).unwrap();
    }
}

impl Court {
    fn start(folder: &Path) -> Self {
        let name = own_court("commands").unwrap();
        let endpoint = free_endpoint().unwrap();
        let chain =
            Chain { n_workers: N_WORKERS, worker_flags: Vec::new(), endpoint: endpoint.clone() };
        let fusion = Reading::of(&name, Place::Fusion);
        // A reader of the board's infos would be taken for the bridge: it is there first.
        let mut house = Household::new(&name).unwrap();
        chain.start_fusion_bridge(&mut house).unwrap();
        start_board(&mut house, &endpoint, &folder.join("recordings"));
        let recording = write_recording(folder);
        chain.start_capture(&mut house, Camera::Left, &recording, "real").unwrap();
        while fusion.infos.receive().unwrap().is_none() {
            house.look().unwrap();
            std::thread::yield_now();
        }
        let board = Reading::of(&name, Place::Board(Camera::Left));
        Self { name, endpoint, house, _fusion: fusion, board }
    }

    fn command(&self, arguments: &[&str]) -> Output {
        command(&self.name, &self.endpoint, "left", arguments)
    }

    fn done(&self, arguments: &[&str]) -> String {
        let output = self.command(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", words(&output));
        said(&output)
    }

    fn refused(&self, arguments: &[&str], reason: &str) {
        let output = self.command(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", said(&output));
        assert!(words(&output).contains(reason), "{arguments:?}: {}", words(&output));
    }

    fn signal(&self, resident: &str, signal: Signal) {
        let running = self.house.running();
        let (_, pid) = running.iter().find(|(name, _)| *name == resident).unwrap();
        kill_process(Pid::from_raw(*pid as i32).unwrap(), signal).unwrap();
    }

    /// Waits until one process more has ended; its name and how it did.
    fn next_ended(&mut self) -> (String, String) {
        loop {
            match self.house.look() {
                Err(Error::Ended { name, how }) => return (name, how),
                Err(why) => panic!("{why}"),
                Ok(()) => std::thread::yield_now(),
            }
        }
    }
}

fn command(court: &str, endpoint: &str, camera: &str, arguments: &[&str]) -> Output {
    let flags = ["command", "--court", court, "--camera", camera, "--connect", endpoint];
    run("bridge", &[&flags[..], arguments].concat())
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn number_after(text: &str, word: &str) -> u64 {
    let rest = text.split(word).nth(1).unwrap_or_else(|| panic!("{text:?} lacks {word:?}"));
    let digits: String = rest.trim_start().chars().take_while(char::is_ascii_digit).collect();
    digits.parse().unwrap()
}

#[test]
fn every_command_is_done_or_refused_with_the_reason() {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let mut court = Court::start(folder.path());
    frames_stop_and_start(&court);
    the_background_is_learned_anew(&court);
    an_image_is_the_recordings_frame(&court, folder.path());
    health_tells_what_was_seen(&court);
    a_recording_is_made(&court, folder.path());
    what_cannot_be_is_refused(&court);
    who_is_silent_or_dead_is_said_so(&mut court);
    all_of_the_board_ends(court);
}

fn frames_stop_and_start(court: &Court) {
    court.board.next_frame(); // so that there is a last one
    assert_eq!(court.done(&["stop"]), "left: frames are stopped\n");
    let last = court.board.last_frame();
    // Waits for a frame for most of a second: a dozen would have come.
    let image = Path::new("/nowhere/a.png").to_str().unwrap();
    court.refused(&["image", image], "no frame came within");
    assert_eq!(court.board.last_frame(), None, "a frame came after {last:?}");
    // More at once than are taken: whoever is not served is told so.
    let (name, endpoint) = (&court.name, &court.endpoint);
    std::thread::scope(|scope| {
        let ask = || scope.spawn(|| command(name, endpoint, "left", &["image", image]));
        for output in [(); 5].map(|()| ask()).map(|thread| thread.join().unwrap()) {
            let said = words(&output);
            let is_told = said.contains("no frame came") || said.contains("ask again");
            assert!(output.status.code() == Some(1) && is_told, "{said}");
        }
    });
    assert_eq!(court.done(&["stop"]), "left: frames are stopped already\n");
    assert_eq!(court.done(&["start"]), "left: frames flow again\n");
    let next = court.board.next_frame();
    // None: the one that was waited for above was the last.
    assert!(last.is_none_or(|last| next == last + 1), "it goes on where it was: {next}, {last:?}");
    assert_eq!(court.done(&["start"]), "left: frames flow already\n");
}

fn the_background_is_learned_anew(court: &Court) {
    court.board.first_of_each_strip(|strip| strip.is_learning == 0);
    let from_idx = number_after(&court.done(&["learn-background"]), "from frame");
    let first = court.board.first_of_each_strip(|strip| strip.is_learning == 1);
    assert_eq!(first, [from_idx; N_WORKERS as usize], "all strips from the same frame on");
    let learned = court.board.first_of_each_strip(|strip| strip.is_learning == 0);
    assert_eq!(learned, [from_idx + 20; N_WORKERS as usize]);
}

fn an_image_is_the_recordings_frame(court: &Court, folder: &Path) {
    for name in ["frame.png", "frame.pgm"] {
        let path = folder.join(name);
        let text = court.done(&["image", path.to_str().unwrap()]);
        let frame_idx = number_after(&text, "frame ") as usize;
        let image = image::open(&path).unwrap().into_luma8();
        assert_eq!(image.dimensions(), (WIDTH_PX, HEIGHT_PX));
        assert!(image.as_raw() == &luma_of(frame_idx), "{text}");
    }
}

fn health_tells_what_was_seen(court: &Court) {
    let text = court.done(&["health", "--json"]);
    let health: serde_json::Value = serde_json::from_str(&text).unwrap();
    let number = |name: &str| health[name].as_f64().unwrap();
    assert_eq!(health["camera"], "left");
    assert!(number("n_frames") > 60.0 && number("n_batches") > 60.0, "{text}");
    assert!(number("n_ring_bytes") > 0.0 && number("free_disk_bytes") > 0.0, "{text}");
    assert!(number("uptime_s") > 1.0 && health["is_recording"] == false, "{text}");
    println!("{}", court.done(&["health"]).trim());
}

fn a_recording_is_made(court: &Court, folder: &Path) {
    let text = court.done(&["record", "1"]);
    court.refused(&["record", "1"], "is being recorded already");
    while court.done(&["health", "--json"]).contains("\"is_recording\":true") {}
    let path = text.split(' ').nth(1).unwrap();
    assert!(Path::new(path).starts_with(folder.join("recordings")), "{text}");
    let bytes = std::fs::read(path).unwrap();
    let magic = b"\x89MCAP0\r\n";
    assert!(bytes.starts_with(magic) && bytes.ends_with(magic), "it was ended");
    let n_frame_bytes = luma_of(0).len();
    assert!(bytes.len() > 5 * n_frame_bytes, "{} bytes", bytes.len());
}

fn what_cannot_be_is_refused(court: &Court) {
    court.refused(&["camera", "--exposure-us", "500"], "frames come from a recording");
    court.refused(&["camera", "--gain=-1"], "gain -1");
    for misused in [
        &["record", "601"][..],
        &["record", "0"],
        &["image", "a.jpg"],
        &["camera"],
        &["dance"],
        &[],
    ] {
        let output = court.command(misused);
        assert_eq!(output.status.code(), Some(2), "{misused:?}: {}", words(&output));
    }
    let session = client_of(&court.endpoint);
    let key = format!("court/{}/command/left", court.name);
    let version = bridge_version(&court.name, &session);
    let garbage = [&version.to_le_bytes()[..], &[0xff; 20]].concat();
    for (payload, reason) in [
        (vec![], "no version"),
        (vec![0xff; 30], "speaks version 65535"),
        (garbage, "not a message"),
        (vec![0; 100_000], "speaks version 0"),
    ] {
        // Who has just joined may not know yet that the board answers.
        let reply = (0..50)
            .find_map(|_| session.get(&key).payload(payload.clone()).wait().unwrap().recv().ok());
        let reply = reply.expect("a board that is there answers").into_result().unwrap_err();
        let text = String::from_utf8(reply.payload().to_bytes().into_owned()).unwrap();
        assert!(text.contains(reason), "{text:?} lacks {reason:?}");
    }
}

fn who_is_silent_or_dead_is_said_so(court: &mut Court) {
    court.signal("worker left 0", Signal::STOP);
    court.refused(&["learn-background"], "1 of 3 processes of this board do not answer");
    court.signal("worker left 0", Signal::CONT);
    court.signal("worker left 1", Signal::KILL);
    let killed = court.next_ended();
    assert_eq!(killed, ("worker left 1".to_owned(), "was killed by signal 9".to_owned()));
    assert!(court.done(&["learn-background"]).contains("on by 1 worker\n"));
}

fn all_of_the_board_ends(mut court: Court) {
    assert!(court.done(&["shutdown"]).contains("the bridge and 2 other processes"));
    let mut ended = Vec::new();
    // Capture may end with success; who ends that was to go on is named by `look`.
    while ended.len() < 2 {
        let (name, how) = court.next_ended();
        assert_eq!(how, "ended early", "{name}");
        ended.push(name);
    }
    ended.sort();
    assert_eq!(ended, ["bridge left", "worker left 0"]);
    while court.house.running().iter().any(|(name, _)| *name == "capture left") {
        court.house.look().unwrap();
        std::thread::yield_now();
    }
    let left: Vec<&str> = court.house.running().iter().map(|(name, _)| *name).collect();
    assert_eq!(left, ["bridge fusion"]);
    court.refused(&["health"], "the board is not there");
    let Court { name, house, _fusion, board, .. } = court;
    drop((_fusion, board));
    house.stop().unwrap();
    assert_eq!(left_in_shm(&name), Vec::<String>::new());
}

#[test]
fn a_board_that_is_not_there_or_of_another_version_is_said_so() {
    let court = own_court("no-board").unwrap();
    let endpoint = free_endpoint().unwrap();
    let says = |camera: &str, expected: &[&str]| {
        let output = command(&court, &endpoint, camera, &["start"]);
        assert_eq!(output.status.code(), Some(1), "{}", said(&output));
        for expected in expected {
            assert!(words(&output).contains(expected), "{} lacks {expected}", words(&output));
        }
    };
    says("left", &["no bridge beside fusion is reached"]);
    let fusion = Reading::of(&court, Place::Fusion);
    let mut house = Household::new(&court).unwrap();
    let chain = Chain { n_workers: 1, worker_flags: vec![], endpoint: endpoint.clone() };
    chain.start_fusion_bridge(&mut house).unwrap();
    says("both", &["left: the board is not there", "right: the board is not there"]);
    let session = client_of(&endpoint);
    let token = session.liveliness().declare_token(format!("court/{court}/left/alive/v65000"));
    let _token = token.wait().unwrap();
    says("both", &["left: the other end speaks version 65000", "right: the board is not there"]);
    drop((session, fusion));
    house.stop().unwrap();
}

/// A session of somebody else, connected as commanders are.
fn client_of(endpoint: &str) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "\"client\"").unwrap();
    config.insert_json5("connect/endpoints", &format!("[{endpoint:?}]")).unwrap();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    zenoh::open(config).wait().unwrap()
}

/// What the board's token says it speaks.
fn bridge_version(court: &str, session: &zenoh::Session) -> u16 {
    let key = format!("court/{court}/left/alive/*");
    let tokens = session.liveliness().get(key).timeout(Duration::from_secs(20)).wait().unwrap();
    let token = tokens.recv().unwrap().into_result().unwrap();
    token.key_expr().as_str().rsplit_once("/v").unwrap().1.parse().unwrap()
}

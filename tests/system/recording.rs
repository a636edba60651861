//! Ten shots of play, recorded twice at once: one recorder is killed, the other ends its file. What
//! fusion then tells of either file is, byte by byte, what it told when they were served.

use crate::run::{binary, track, turn, words};
use bridge::recording::reader::{Entry, Recording};
use bridge::wire::batch::Message;
use serde_json::Value;
use shm_layout::services::{Domain, Place};
use shm_layout::stop::Stop;
use shm_layout::{Camera, StripCandidates};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{SystemTime, UNIX_EPOCH};
use tests::chain::Chain;
use tests::processes::{self, Household, Until, free_endpoint};

const N_SHOTS: usize = 10;
/// The victim is killed when so many shots were told.
const N_SHOTS_BEFORE_KILL: usize = 4;

/// What is left of the play.
struct Played {
    folder: tempfile::TempDir,
    /// What fusion wrote to stdout, shot by shot.
    told: Vec<String>,
    killed_day_ns: u64,
}

impl Played {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

/// Played once for all tests: it takes as long as ten shots take.
fn played() -> &'static Played {
    static PLAYED: OnceLock<Played> = OnceLock::new();
    PLAYED.get_or_init(|| {
        let _turn = turn();
        play()
    })
}

fn play() -> Played {
    let folder = tempfile::tempdir().unwrap();
    let rig = folder.path().join("rig.toml");
    let still = Command::new(env!("CARGO_BIN_EXE_simulate"))
        .args(["--shots", "1", "--seconds", "0.8", "--write", folder.path().to_str().unwrap()])
        .status();
    assert!(still.unwrap().success() && rig.is_file());
    let court = processes::own_court("recording").unwrap();
    let mut house = Household::new(&court).unwrap();
    let told = folder.path().join("told");
    start_fusion(&mut house, &rig, &told);

    let out = folder.path().join("ended.mcap");
    let arguments = ["--place", "fusion", "--out", out.to_str().unwrap(), "--rig"];
    let arguments = [&arguments[..], &[rig.to_str().unwrap()]].concat();
    house.start("record", "record", &arguments, Until::Stopped, Stdio::null()).unwrap();
    let mut victim = Some(victim(&court, &folder.path().join("killed.mcap"), &rig));
    // Recorders are there before the boards: so they hear all that fusion hears.
    let member = Domain::new(&court, Place::Fusion).unwrap().join("test").unwrap();
    let (candidates, infos) = (member.candidates().unwrap(), member.frames_info().unwrap());
    while candidates.n_readers() < 3 || infos.n_readers() < 3 {
        house.look().unwrap();
        std::thread::yield_now();
    }
    let shots = member.shots().unwrap().reader().unwrap();
    start_play(&mut house);

    let (mut n_told, mut killed_day_ns) = (0, None);
    while n_told < N_SHOTS {
        house.look().unwrap();
        while shots.receive().unwrap().is_some() {
            n_told += 1;
        }
        if let Some(mut victim) = victim.take_if(|_| n_told >= N_SHOTS_BEFORE_KILL) {
            victim.kill().unwrap();
            victim.wait().unwrap();
            killed_day_ns = SystemTime::now().duration_since(UNIX_EPOCH).ok();
        }
        let is_playing = house.running().iter().any(|(name, _)| *name == "simulate");
        assert!(is_playing || n_told >= N_SHOTS, "{n_told} of {N_SHOTS} shots were told");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    house.end("record").unwrap();
    house.end("fusion").unwrap();
    drop((shots, candidates, infos, member));
    house.stop().unwrap();
    let told = lines_of(&told);
    Played { folder, told, killed_day_ns: killed_day_ns.unwrap().as_nanos() as u64 }
}

fn start_fusion(house: &mut Household, rig: &Path, told: &Path) {
    let stdout = Stdio::from(File::create(told).unwrap());
    let arguments = ["--rig", rig.to_str().unwrap()];
    house.start("fusion", "fusion", &arguments, Until::Stopped, stdout).unwrap();
}

fn start_play(house: &mut Household) {
    let endpoint = free_endpoint().unwrap();
    let chain = Chain { n_workers: 1, worker_flags: Vec::new(), endpoint };
    chain.start_fusion_bridge(house).unwrap();
    for camera in Camera::BOTH {
        chain.start_board(house, camera).unwrap();
    }
    let n_shots = N_SHOTS.to_string();
    let arguments = ["--live", "--period-s", "2", "--shots", &n_shots, "--play-shots", &n_shots];
    house.start("simulate", "simulate", &arguments, Until::Done, Stdio::null()).unwrap();
}

/// A recorder that no household looks after.
fn victim(court: &str, out: &Path, rig: &Path) -> Child {
    Command::new(binary("record"))
        .args(["--court", court, "--place", "fusion", "--with-parent", "--out"])
        .arg(out)
        .arg("--rig")
        .arg(rig)
        .spawn()
        .unwrap()
}

fn lines_of(told: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(told).unwrap();
    text.lines().filter(|line| line.contains("\"outcome\"")).map(str::to_owned).collect()
}

/// What stands in a recording, each with the time of day at which it was read.
#[derive(Default)]
struct Recorded {
    strips: Vec<(u64, StripCandidates)>,
    shots: Vec<String>,
    is_cut_off: bool,
}

fn recorded(path: &Path) -> Recorded {
    let mut recording = Recording::open(path).unwrap();
    let mut recorded = Recorded::default();
    while let Some((day_ns, entry)) = recording.next_entry().unwrap() {
        match entry {
            Entry::Message(Message::Candidates(strip)) => recorded.strips.push((day_ns, *strip)),
            Entry::Shot(text) => recorded.shots.push(text),
            _ => {}
        }
    }
    Recorded { is_cut_off: recording.is_cut_off(), ..recorded }
}

/// What fusion tells of a recording, live, line by line.
fn told_again(recording: &Path, rig: &Path) -> Vec<String> {
    let court = processes::own_court("replaying").unwrap();
    let mut house = Household::new(&court).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let told = folder.path().join("told");
    start_fusion(&mut house, rig, &told);
    house.start("replay", "replay", &[recording], Until::Done, Stdio::null()).unwrap();
    house.wait_for("replay", &Stop::on_signals(false).unwrap()).unwrap();
    house.end("fusion").unwrap();
    house.stop().unwrap();
    lines_of(&told)
}

#[test]
fn ten_recorded_shots_are_told_again_byte_by_byte() {
    let played = played();
    let _turn = turn();
    let path = played.path("ended.mcap");
    let recorded = recorded(&path);
    assert!(!recorded.is_cut_off);
    assert_eq!(played.told.len(), N_SHOTS);
    assert!(recorded.shots == played.told, "what is recorded is what was told");
    let again = told_again(&path, &played.path("rig.toml"));
    println!("{} shots, {} bytes", again.len(), again.iter().map(String::len).sum::<usize>());
    assert!(again == played.told, "{} shots were told again", again.len());

    // `track` does the same, with the rig that stands in the recording.
    let json = played.path("again.json");
    let output = track(&[path.to_str().unwrap(), "--json", json.to_str().unwrap()]);
    assert!(output.status.success(), "{}", words(&output));
    let document: Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    let mut told: Vec<Value> =
        played.told.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    // Only what is told as it happens is numbered.
    for (idx, shot) in told.iter_mut().enumerate() {
        assert_eq!(shot.as_object_mut().unwrap().remove("shot_idx"), Some(idx.into()));
    }
    assert!(document["shots"].as_array().unwrap() == &told);
}

#[test]
fn a_killed_recorder_leaves_all_but_the_last_second() {
    let played = played();
    let _turn = turn();
    let [ended, killed] = ["ended.mcap", "killed.mcap"].map(|name| recorded(&played.path(name)));
    assert!(killed.is_cut_off);
    let n = killed.strips.len();
    let is_same = ended.strips.iter().zip(&killed.strips).all(|((_, a), (_, b))| {
        // Every bit: NaN is not equal to itself.
        format!("{a:?}") == format!("{b:?}")
    });
    assert!(is_same && n <= ended.strips.len(), "both recorders read the same");
    let is_old = |day_ns: u64| day_ns + 1_000_000_000 < played.killed_day_ns;
    let n_old = ended.strips.iter().filter(|(day_ns, _)| is_old(*day_ns)).count();
    let last_ns = killed.strips[n - 1].0;
    let lost_s = (played.killed_day_ns - last_ns) as f64 * 1e-9;
    println!("{n} of {} strips, up to {lost_s:.3} s before it was killed", ended.strips.len());
    assert!(n >= n_old, "{n} strips, {n_old} were a second old");

    let n_shots = killed.shots.len();
    assert!(n_shots + 1 >= N_SHOTS_BEFORE_KILL, "{n_shots} shots");
    let again = told_again(&played.path("killed.mcap"), &played.path("rig.toml"));
    assert!(again[..n_shots] == killed.shots, "shots that stand in it are told again");
}

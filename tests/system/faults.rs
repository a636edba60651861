//! A whole court under faults: every promise of ARCHITECTURE.md's "Failure" is an assertion here.
//!
//! `soak` does the same for hours. What the link promises is in `link.rs` and `hosts.rs`, what
//! files of strangers may do in `hostile.rs`.

use crate::run::{binary, turn, words};
use bridge::recording::reader::Recording;
use rustix::process::{Signal, kill_process};
use shm_layout::Camera;
use shm_layout::stop::Stop;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};
use tests::faults::balance::Frames;
use tests::faults::campaign::{self, Plan};
use tests::faults::part::Part;
use tests::faults::site::{KEPT, Site, SiteOptions};
use tests::faults::spoiled::Spoiled;

/// What was asked for is there within this, on a machine that does other tests meanwhile.
pub(crate) const WITHIN: Duration = Duration::from_secs(20);

pub(crate) fn site(n_shots: usize) -> (tempfile::TempDir, Site) {
    spoiled_site(n_shots, Vec::new())
}

fn spoiled_site(n_shots: usize, spoiled: Vec<(Range<u64>, Spoiled)>) -> (tempfile::TempDir, Site) {
    let folder = tempfile::tempdir().unwrap();
    let site = site_in(folder.path(), n_shots, spoiled);
    (folder, site)
}

fn site_in(folder: &Path, n_shots: usize, spoiled: Vec<(Range<u64>, Spoiled)>) -> Site {
    let options = SiteOptions { seed: 1, n_shots, spoiled, folder: folder.to_owned() };
    Site::start(&options, |_| ()).unwrap()
}

/// Frames of both cameras come to fusion that were captured after this moment.
pub(crate) fn goes_on(site: &Site) {
    let now_ns = shm_layout::stamp::now_ns();
    let come = || site.at_fusion.seen().last.iter().all(|last| last.published_ns > now_ns);
    site.wait_until("frames of both cameras", WITHIN, come).unwrap();
}

/// Ends all, and nothing is left behind.
pub(crate) fn end(site: Site) -> [String; 2] {
    let (ends, left) = site.end().unwrap();
    assert_eq!(left, Vec::<String>::new());
    ends.map(|end| {
        assert_eq!(end.exit_code, Some(0), "{}", end.words);
        end.words
    })
}

/// Kills and standstills of anybody.
fn random_faults() -> Plan {
    Plan {
        seed: 2026,
        calm_s: 0.0,
        faults_s: 90.0,
        n_faults: 60,
        pause_s: [0.3, 1.2],
        parts: Part::all(),
        still_share: 0.3,
    }
}

#[test]
fn whoever_is_killed_or_stands_still_all_is_counted_and_no_shot_is_wrong() {
    let _turn = turn();
    let (_folder, site) = site(8);
    let stop = Stop::on_signals(false).unwrap();
    let report = campaign::run(site, &random_faults(), &stop, |_| ()).unwrap();
    print!("{report}");
    assert_eq!(report.broken, Vec::<String>::new());
    assert!(report.faults.len() >= 30, "{}", report.faults.len());
    assert!(report.balls.n_measured > 0, "{:?}", report.balls);
    // One in ten may have met the load of the tests that run meanwhile.
    assert!(report.slow.len() * 10 <= report.faults.len(), "{:?}", report.slow);
}

#[test]
fn a_worker_that_does_nothing_is_killed_and_another_one_works() {
    let _turn = turn();
    let (_folder, site) = site(1);
    let worker = Part::Worker(Camera::Left, 1);
    let stuck = worker.process(&site.court).unwrap();
    kill_process(stuck, Signal::STOP).unwrap();
    let said = "worker 1 is done with no frame for 2 s: it is killed";
    let is_said = || site.board_words(Camera::Left).contains(said);
    site.wait_until("word of it", WITHIN, is_said).unwrap();
    goes_on(&site);
    assert_ne!(worker.process(&site.court).unwrap(), stuck);
    let [left, right] = end(site);
    assert!(left.contains(", 1 restarts"), "{left}");
    assert!(right.contains(" lost, 0 restarts"), "{right}");
}

#[test]
fn a_second_fusion_is_refused_and_the_first_goes_on() {
    let _turn = turn();
    let (folder, site) = site(1);
    let first = Part::Fusion.process(&site.court).unwrap();
    let rig = folder.path().join("rig.toml");
    let second = Command::new(binary("fusion"))
        .args(["--court", &site.court, "--rig", rig.to_str().unwrap()])
        .output()
        .unwrap();
    assert_eq!(second.status.code(), Some(1), "{}", words(&second));
    assert!(
        words(&second).contains("cannot write shots (does another process?)"),
        "{}",
        words(&second)
    );
    assert_eq!(Part::Fusion.process(&site.court).unwrap(), first);
    goes_on(&site);
    end(site);
}

#[test]
fn frames_no_camera_should_give_cost_no_ball_that_flies_afterwards() {
    let _turn = turn();
    let spoiled = vec![
        (0..20, Spoiled::Spots(1000)),
        (20..25, Spoiled::Noise),
        (25..30, Spoiled::White),
        (30..35, Spoiled::Black),
        (35..45, Spoiled::Repeated),
    ];
    let (_folder, site) = spoiled_site(3, spoiled);
    let stop = Stop::on_signals(false).unwrap();
    let plan = Plan { calm_s: 35.0, faults_s: 0.0, n_faults: 0, ..random_faults() };
    let report = campaign::run(site, &plan, &stop, |_| ()).unwrap();
    print!("{report}");
    assert_eq!(report.broken, Vec::<String>::new());
    assert!(report.balls.n_measured >= 6, "{:?}", report.balls);
    // Workers may be too slow for the spoiled frames alone: 45 of some 700 in a lap.
    let Frames { n_lost_in_calm, n_in_calm, .. } = report.frames;
    assert!(n_lost_in_calm * 700 <= n_in_calm * 45, "{n_lost_in_calm} of {n_in_calm}");
}

/// A small file system of its own, if this process may make one; gone when it is dropped.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn mounted(folder: &Path, options: &str) -> Option<Self> {
        fs::create_dir_all(folder).unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", options, "tmpfs"]).arg(folder).stderr(Stdio::null());
        mount.status().is_ok_and(|status| status.success()).then(|| Self(folder.to_owned()))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status(); // the machine has one more tmpfs
    }
}

#[test]
fn a_full_disk_ends_the_recording_with_a_word_and_nothing_else() {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let Some(disk) = SmallDisk::mounted(&folder.path().join(KEPT), "size=256k") else {
        println!("skipped: no file system may be mounted here");
        return;
    };
    let site = site_in(folder.path(), 1, Vec::new());
    let says = |what: &str| {
        let is_said = || site.unit_words(Part::Recorder).contains(what);
        site.wait_until(what, WITHIN, is_said).unwrap();
    };
    says("No space left on device");
    // What fitted is read as what a killed recorder leaves is.
    let mut recording = Recording::open(&disk.0.join("court-0.mcap")).unwrap();
    let mut n_entries = 0;
    while recording.next_entry().unwrap().is_some() {
        n_entries += 1;
    }
    assert!(recording.is_cut_off() && n_entries > 100, "{n_entries}");
    goes_on(&site);

    let mut mount = Command::new("mount");
    let remounted = mount.args(["-o", "remount,ro"]).arg(&disk.0).status().unwrap();
    assert!(remounted.success());
    says("Read-only file system");
    goes_on(&site);
    let others = |part| part != Part::Recorder;
    let ends = site.ends();
    assert!(!ends.iter().any(|end| others(end.part)), "{ends:?}");
    end(site);
}

/// Set for the run inside a mount namespace of its own, or with a clock that is set.
const OWN_WORLD: &str = "TENNIS_TEST_OWN_WORLD";

#[test]
fn shared_memory_that_is_full_is_named_and_frames_come_when_there_is_room() {
    let _turn = turn();
    if std::env::var_os(OWN_WORLD).is_none() {
        in_a_small_shared_memory();
        return;
    }
    let (_folder, site) = site(1);
    let n_before = site.at_fusion.seen().n_complete;
    // Every part of it has been written to by then.
    let is_used = || site.at_fusion.seen().n_complete > n_before + 400;
    site.wait_until("frames", WITHIN, is_used).unwrap();
    let filler = Path::new("/dev/shm/filler");
    let mut file = fs::File::create(filler).unwrap();
    let why = std::io::copy(&mut std::io::repeat(7), &mut file).unwrap_err();
    assert_eq!(why.kind(), std::io::ErrorKind::StorageFull);
    goes_on(&site);

    let capture = Part::Capture(Camera::Left).process(&site.court).unwrap();
    kill_process(capture, Signal::KILL).unwrap();
    let said = "MiB free";
    let is_said = || site.board_words(Camera::Left).contains(said);
    site.wait_until(said, WITHIN, is_said).unwrap();
    drop(file);
    fs::remove_file(filler).unwrap();
    goes_on(&site);
    let [left, right] = end(site);
    assert!(left.contains("capture failed with exit code 1"), "{left}");
    assert!(right.contains(" lost, 0 restarts"), "{right}");
}

/// The same test once more, with a /dev/shm that can be filled without harm to others.
fn in_a_small_shared_memory() {
    let mut unshare = Command::new("unshare");
    unshare.args(["--mount", "--propagation", "private", "sh", "-c"]);
    unshare.arg("mount -t tmpfs -o size=100m tmpfs /dev/shm && exec \"$@\"").arg("sh");
    let mut can = Command::new("unshare");
    can.args(["--mount", "--propagation", "private", "true"]).stderr(Stdio::null());
    if !can.status().is_ok_and(|status| status.success()) {
        println!("skipped: no mount namespace may be made here");
        return;
    }
    unshare.arg(std::env::current_exe().unwrap());
    once_more(
        unshare,
        "faults::shared_memory_that_is_full_is_named_and_frames_come_when_there_is_room",
    );
}

/// Runs one test once more in a world of its own, and expects it to pass there.
fn once_more(mut command: Command, name: &str) {
    command.args(["--exact", name, "--nocapture"]).env(OWN_WORLD, "1");
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}\n{}", words(&output));
    assert!(said.contains("1 passed"), "{said}");
}

/// libfaketime's library, where Debian has it.
fn faketime() -> Option<PathBuf> {
    let arch = std::env::consts::ARCH;
    let path = format!("/usr/lib/{arch}-linux-gnu/faketime/libfaketimeMT.so.1");
    Some(PathBuf::from(path)).filter(|path| path.is_file())
}

#[test]
fn a_clock_that_is_set_by_an_hour_costs_no_ball() {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let Some(offset) =
        std::env::var_os(OWN_WORLD).map(|_| std::env::var("FAKETIME_TIMESTAMP_FILE"))
    else {
        let Some(library) = faketime() else {
            println!("skipped: libfaketime is not installed (scripts/setup test)");
            return;
        };
        let offset = folder.path().join("offset");
        fs::write(&offset, "+0").unwrap();
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.env("LD_PRELOAD", library).env("FAKETIME_TIMESTAMP_FILE", offset);
        // Read anew at every look; what never can be set is not.
        command.env("FAKETIME_NO_CACHE", "1").env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
        once_more(command, "faults::a_clock_that_is_set_by_an_hour_costs_no_ball");
        return;
    };
    let offset = offset.unwrap();
    let (_folder, site) = site(3);
    let begun = SystemTime::now();
    let stop = Stop::on_signals(false).unwrap();
    let plan = Plan { calm_s: 30.0, faults_s: 0.0, n_faults: 0, ..random_faults() };
    let (mut n_steps, steps) = (0, ["+3600", "-3600", "+0"]);
    let report = campaign::run(site, &plan, &stop, |part| {
        if n_steps < steps.len() && part > 0.25 * (n_steps + 1) as f64 {
            fs::write(&offset, steps[n_steps]).unwrap();
            let ahead_s = match begun.elapsed() {
                Ok(ahead) => ahead.as_secs_f64(),
                Err(back) => -back.duration().as_secs_f64(),
            };
            let wanted_s = [3600.0, -3600.0, 0.0][n_steps];
            assert!((ahead_s - wanted_s).abs() < 60.0, "the clock was not set: {ahead_s} s");
            n_steps += 1;
        }
    })
    .unwrap();
    print!("{report}");
    assert_eq!((n_steps, &report.broken), (steps.len(), &Vec::new()));
    assert!(report.balls.n_measured >= 6, "{:?}", report.balls);
}

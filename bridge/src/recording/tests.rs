//! Files that are written and read again; whole, cut off, and by other readers.

use super::files::{Series, Written};
use super::queue::{Item, LeftOut};
use super::reader::{Entry, Recording, rig_from};
use super::recorder::{self, Options};
use super::replayer::{self, Speed};
use super::times::Times;
use super::writer::{Counts, Writer};
use super::{Error, queue};
use crate::wire::batch::Message;
use foxglove::Decode as _;
use foxglove::messages::{ImageAnnotations, RawImage, SceneUpdate};
use shm_layout::launcher::{
    CommandKind, LauncherAnswer, LauncherCommand, LauncherState, Limits, Settings, Why,
};
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use shm_layout::{Camera, Candidate, FrameInfo, Link, StripCandidates, Taken};
use std::collections::BTreeMap;
use std::io::BufWriter;
use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

const RIG: &str = "[left]\nposition_in_court_m = [-2.0, -1.0, 3.5]\n";
const SHOT: &str = r#"{"outcome":"measured","launch":{"speed_m_s":27.700000000000003}}"#;

fn strip(frame_idx: u64, camera: Camera) -> Message {
    let mut strip = StripCandidates {
        recording_id: 5,
        frame_idx,
        exposed_ns: 1_000_000 * frame_idx as i64,
        camera_idx: camera.idx() as u32,
        n_candidates: 2,
        ..StripCandidates::default()
    };
    strip.candidates[0] = Candidate::at(frame_idx as f32 + 0.1, 3.0);
    // NaN would not be equal to itself.
    strip.candidates[0] = Candidate::from_array(strip.candidates[0].to_array().map(not_nan));
    Message::Candidates(Box::new(strip))
}

fn not_nan(number: f32) -> f32 {
    if number.is_nan() { -1.0 } else { number }
}

fn info(frame_idx: u64, camera: Camera) -> Message {
    let camera_idx = camera.idx() as u32;
    Message::FrameInfo(FrameInfo { recording_id: 5, frame_idx, camera_idx, ..Default::default() })
}

/// Frames of both cameras, with a shot and a link in between.
fn items(n_frames: u64) -> Vec<Item> {
    let mut items = Vec::new();
    for frame_idx in 0..n_frames {
        for camera in Camera::BOTH {
            items.push(Item::Message(info(frame_idx, camera)));
            items.push(Item::Message(strip(frame_idx, camera)));
        }
        if frame_idx % 10 == 9 {
            items.push(Item::Shot(SHOT.to_owned()));
            items.push(Item::Link(Link::default()));
        }
    }
    items.push(Item::Frame(
        FrameInfo { width_px: 4, height_px: 2, ..Default::default() },
        vec![9; 8],
    ));
    items
}

fn begun(path: &Path) -> Writer<BufWriter<std::fs::File>> {
    let out = BufWriter::new(std::fs::File::create(path).unwrap());
    let about = BTreeMap::from([("court".to_owned(), "a".to_owned())]);
    Writer::begin(out, Times { day_minus_stamp_ns: 1 << 60 }, 0, about, Some(RIG)).unwrap()
}

/// Closes a chunk every 16 things, as time would.
fn written(path: &Path, items: &[Item]) -> Counts {
    let mut writer = begun(path);
    for (idx, item) in items.iter().enumerate() {
        writer.put(1000 * idx as i64, item).unwrap();
        if idx % 16 == 15 {
            writer.flush().unwrap();
        }
    }
    writer.finish(&LeftOut::default()).unwrap()
}

/// What a replay needs, and whether the file was cut off.
fn read(path: &Path) -> (Vec<Entry>, bool) {
    let mut recording = Recording::open(path).unwrap();
    let mut entries = Vec::new();
    while let Some((_, entry)) = recording.next_entry().unwrap() {
        if matches!(entry, Entry::Message(_) | Entry::Shot(_)) {
            entries.push(entry);
        }
    }
    (entries, recording.is_cut_off())
}

fn entries_of(items: &[Item]) -> Vec<Entry> {
    let entry = |item: &Item| match item {
        Item::Message(message) => Some(Entry::Message(message.clone())),
        Item::Shot(text) => Some(Entry::Shot(text.clone())),
        _ => None,
    };
    items.iter().filter_map(entry).collect()
}

#[test]
fn what_is_recorded_comes_back_as_it_was_and_in_its_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let items = items(50);
    written(&path, &items);
    let (entries, is_cut_off) = read(&path);
    assert!(!is_cut_off);
    assert_eq!(entries, entries_of(&items));
    assert_eq!(rig_from(&path).unwrap().as_deref(), Some(RIG));
}

#[test]
fn wherever_a_file_is_cut_off_what_stands_before_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let items = items(20);
    written(&path, &items);
    let (bytes, all) = (std::fs::read(&path).unwrap(), entries_of(&items));
    let mut n_before = 0;
    for n_bytes in (0..bytes.len()).step_by(97) {
        std::fs::write(&path, &bytes[..n_bytes]).unwrap();
        let (entries, is_cut_off) = read(&path);
        assert!(is_cut_off);
        assert_eq!(entries, all[..entries.len()], "{n_bytes} bytes");
        assert!(entries.len() >= n_before);
        n_before = entries.len();
    }
    assert_eq!(n_before, all.len(), "only the index was missing in the end");
}

#[test]
fn all_that_was_flushed_is_in_the_file_of_a_killed_recorder() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let items = items(10);
    let mut writer = begun(&path);
    for item in &items {
        writer.put(0, item).unwrap();
    }
    assert_eq!(read(&path), (Vec::new(), true), "a chunk is written when it is whole");
    writer.flush().unwrap();
    assert_eq!(read(&path), (entries_of(&items), true));
}

fn series(first: &Path, each_lasts: Duration) -> Series {
    let about = BTreeMap::from([("court".to_owned(), "a".to_owned())]);
    Series { first: first.to_owned(), each_lasts, about, rig_toml: Some(RIG.to_owned()) }
}

fn write_all(series: &Series, items: &[Item]) -> Result<Written, Error> {
    let (inlet, outlet) = queue::of_size(items.len(), 1 << 20);
    for item in items {
        inlet.put(0, item.clone()).unwrap();
    }
    drop(inlet);
    series.clone().begin()?.write_all(&outlet)
}

#[test]
fn a_file_whose_time_is_over_is_followed_by_another_behind_a_shot() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let items = items(50);
    let one = write_all(&series(&path, Duration::from_secs(60)), &items).unwrap();
    assert_eq!(one.n_files, 1);
    std::fs::remove_file(&path).unwrap();

    let each = series(&path, Duration::ZERO);
    let written = write_all(&each, &items).unwrap();
    assert_eq!(written.n_files, 6, "five shots, and what came after them");
    // Every file begins with an empty court of its own.
    let n_scenes = written.counts["/scene"] - one.counts["/scene"];
    assert_eq!(n_scenes, 5);
    let mut all = Vec::new();
    for number in 1..=6 {
        let path = each.path(number);
        assert_eq!(rig_from(&path).unwrap().as_deref(), Some(RIG));
        let (entries, is_cut_off) = read(&path);
        assert!(!is_cut_off, "{}", path.display());
        assert_eq!(matches!(entries.last(), Some(Entry::Shot(_))), number < 6);
        all.extend(entries);
    }
    assert_eq!(all, entries_of(&items), "nothing is lost between two files");
    assert!(!each.path(7).exists());
    assert!(each.path(2).ends_with("a-2.mcap"));
}

#[test]
fn a_file_in_the_way_of_the_next_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let each = series(&folder.path().join("a.mcap"), Duration::ZERO);
    std::fs::write(each.path(2), "somebody's").unwrap();
    let refusal = write_all(&each, &items(50)).unwrap_err().to_string();
    assert!(refusal.contains("a-2.mcap: is there already"), "{refusal}");
    let (entries, is_cut_off) = read(&each.path(1));
    assert!(!is_cut_off, "what was recorded until then can be read");
    assert_eq!(entries.len(), 41);
}

#[test]
fn a_finished_file_has_an_index_and_viewers_messages_decode() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let counts = written(&path, &items(30));
    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let statistics = summary.stats.as_ref().unwrap();
    let topic = |id: &u16| summary.channels[id].topic.clone();
    let by_topic = statistics.channel_message_counts.iter().map(|(id, n)| (topic(id), *n));
    assert_eq!(by_topic.collect::<Counts>(), counts);
    assert_eq!((statistics.metadata_count, statistics.attachment_count), (2, 1));

    let (mut n_circles, mut images, mut scenes) = (0, Vec::new(), Vec::new());
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        let data = &message.data[..];
        match schema.name.as_str() {
            "foxglove.ImageAnnotations" => {
                n_circles += ImageAnnotations::decode(data).unwrap().circles.len();
            }
            "foxglove.RawImage" => images.push(RawImage::decode(data).unwrap()),
            "foxglove.SceneUpdate" => scenes.push(SceneUpdate::decode(data).unwrap()),
            _ => {}
        }
    }
    assert_eq!(n_circles, 2 * 2 * 30);
    assert_eq!((images.len(), images[0].data.len()), (1, 8));
    assert_eq!(scenes.len(), 1 + 3, "the empty court and three shots");
    assert!(scenes.iter().all(|scene| scene.entities[1].id == "cameras"));
}

#[test]
fn what_is_no_recording_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, "this is a text, and not a short one").unwrap();
    let refusal = Recording::open(&path).unwrap().next_entry().unwrap_err().to_string();
    assert!(refusal.contains("a.mcap: expected a recording"), "{refusal}");

    written(&path, &items(5));
    let bytes = std::fs::read(&path).unwrap();
    for at in (0..bytes.len()).step_by(53) {
        let mut spoiled = bytes.clone();
        spoiled[at] ^= 0xff;
        std::fs::write(&path, &spoiled).unwrap();
        let mut recording = Recording::open(&path).unwrap();
        while let Ok(Some(_)) = recording.next_entry() {} // read, or refused: no harm either way
    }
}

/// A fusion that takes in so many strips, of which frames; it had taken in some before.
fn fusion(court: String, n_strips: usize, ready: &mpsc::Sender<()>) -> Vec<u64> {
    let member = Domain::new(&court, Place::Fusion).unwrap().join("fusion").unwrap();
    let (strips, infos) = (member.candidates().unwrap(), member.frames_info().unwrap());
    let (strips, infos) = (strips.reader().unwrap(), infos.reader().unwrap());
    let taken_out = member.taken().unwrap().writer().unwrap();
    ready.send(()).unwrap();
    let mut taken = Taken { n_infos: 1000, n_strips: 77 };
    let mut frames = Vec::new();
    while frames.len() < n_strips {
        while infos.receive().unwrap().is_some() {
            taken.n_infos += 1;
        }
        std::thread::yield_now(); // whoever writes is as fast as it may be
        while let Some(strip) = strips.receive().unwrap() {
            frames.push(strip.frame_idx);
            taken.n_strips += 1;
            if taken.n_strips.is_multiple_of(Taken::EVERY_STRIPS) {
                break;
            }
        }
        taken_out.send(taken).unwrap();
    }
    while infos.receive().unwrap().is_some() {
        taken.n_infos += 1;
    }
    taken_out.send(taken).unwrap();
    // What was sent goes with its sender.
    while strips.receive().unwrap().is_none() && member.candidates().unwrap().n_writers() > 0 {
        std::thread::yield_now();
    }
    frames
}

#[test]
fn a_replay_is_never_faster_than_fusion_and_leaves_nothing_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let n_frames = 2000;
    written(&path, &items(n_frames));
    let court = format!("replay-{}", std::process::id());
    let (to_us, ready) = mpsc::channel();
    let n_strips = 2 * n_frames as usize;
    let of_fusion = court.clone();
    let taking = std::thread::spawn(move || fusion(of_fusion, n_strips, &to_us));
    ready.recv().unwrap();
    let stop = Stop::on_signals(false).unwrap();
    let replayed = replayer::run(&path, &court, Speed::Max, &stop).unwrap();
    let frames = taking.join().unwrap();
    assert_eq!(frames, (0..n_frames).flat_map(|idx| [idx; 2]).collect::<Vec<_>>());
    assert_eq!((replayed.n_infos, replayed.n_strips), (2 * n_frames, 2 * n_frames));
    assert_eq!(replayed.n_shots, n_frames / 10);
    Domain::new(&court, Place::Fusion).unwrap().close().unwrap();
}

#[test]
fn what_goes_on_between_fusion_and_the_machine_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let court = format!("machine-{}", std::process::id());
    let member = Domain::new(&court, Place::Fusion).unwrap().join("test").unwrap();
    let _readers = (
        member.candidates().unwrap().reader().unwrap(),
        member.frames_info().unwrap().reader().unwrap(),
    );
    let out = folder.path().join("a.mcap");
    let options = Options {
        court: court.clone(),
        place: Place::Fusion,
        with_frames: false,
        lasting: None,
        out: out.clone(),
        each_lasts: Duration::from_secs(600),
        rig: None,
    };
    let stop = Stop::on_signals(false).unwrap();
    let recording = std::thread::spawn({
        let stop = stop.clone();
        move || recorder::run(&options, &stop).unwrap()
    });
    let answers = member.launcher_answers().unwrap();
    while answers.n_readers() == 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    let settings = Settings::from_array([22.0, 0.16, 0.02, -30.0]);
    let limits = Limits { min: settings, max: settings };
    let (kind, command_idx, correction_idx) = (CommandKind::Fire.code(), 8, 41);
    let (state, why, sent_ns, reserved) =
        (LauncherState::Fired.code(), Why::Nothing.code(), now_ns(), 0);
    // What was sent goes with its writer: they stay until it was read.
    let corrections = member.corrections_json().unwrap().writer().unwrap();
    let commands = member.launcher_commands().unwrap().writer().unwrap();
    let answers = answers.writer().unwrap();
    corrections.send(r#"{"schema":"correction/1","sentence":"as it was"}"#).unwrap();
    commands
        .send(LauncherCommand { command_idx, correction_idx, sent_ns, kind, reserved, settings })
        .unwrap();
    let at_ns = now_ns();
    answers.send(LauncherAnswer { command_idx, at_ns, state, why, settings, limits }).unwrap();
    stop.raise();
    let counts = recording.join().unwrap().written.counts;
    let bytes = std::fs::read(&out).unwrap();
    for (topic, expected) in [
        ("/corrections", "as it was"),
        ("/launcher/commands", r#""correction_idx":41"#),
        ("/launcher/answers", r#""state":"fired""#),
    ] {
        let of_topic = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
        let texts = of_topic.filter(|message| message.channel.topic == topic);
        let texts: Vec<String> =
            texts.map(|message| String::from_utf8(message.data.to_vec()).unwrap()).collect();
        assert!(texts.len() == 1 && texts[0].contains(expected), "{topic}: {texts:?}");
        assert_eq!(counts[topic], 1);
    }
    drop((corrections, commands, answers, member));
    Domain::new(&court, Place::Fusion).unwrap().close().unwrap();
}

#[test]
fn a_full_disk_is_told_of_by_the_thread_that_writes() {
    let out = BufWriter::new(std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap());
    let writer = Writer::begin(out, Times::of_now(), 0, BTreeMap::new(), None);
    let why = writer.err().map(|why| format!("{why:?}")).unwrap_or_default();
    assert!(why.contains("StorageFull"), "{why}");
    let (inlet, outlet) = queue::of_size(4, 4);
    drop(outlet);
    let gone = inlet.put(0, Item::Shot(String::new())).map_err(Error::from);
    assert!(matches!(gone, Err(Error::WriterGone)));
}

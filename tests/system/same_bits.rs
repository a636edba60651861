//! The candidates are the same bytes for every number of workers, and wherever frames come from.

use crate::run::{simulated, track, turn, words};
use shm_layout::Camera;
use shm_layout::stop::Stop;
use std::path::Path;
use std::process::Stdio;
use tests::chain::Chain;
use tests::processes::{self, Household, Until, free_endpoint};

#[test]
fn candidates_are_the_same_bytes_for_1_2_3_4_and_8_workers() {
    let _turn = turn();
    let folder = simulated(&["--seed", "3", "--sway-px", "2"]);
    let mut of_one: Option<[String; 2]> = None;
    for n_workers in ["1", "2", "3", "4", "8"] {
        let out = tempfile::tempdir().unwrap();
        let output = track(&[
            folder.path().to_str().unwrap(),
            "--candidates",
            out.path().to_str().unwrap(),
            "--workers",
            n_workers,
        ]);
        assert!(output.status.success(), "{}", words(&output));
        let files = ["left.csv", "right.csv"]
            .map(|name| std::fs::read_to_string(out.path().join(name)).unwrap());
        let n_lines = files.iter().map(|file| file.lines().count()).sum::<usize>();
        assert!(n_lines > 100, "{n_lines} candidates: nothing is being compared");
        match &of_one {
            None => {
                println!("{n_lines} candidates");
                of_one = Some(files);
            }
            Some(of_one) => assert!(of_one == &files, "{n_workers} workers differ from one"),
        }
    }
}

/// Luma of every frame of a `Cmono` recording.
fn frames_of(recording: &Path) -> (usize, usize, Vec<Vec<u8>>) {
    let bytes = std::fs::read(recording).unwrap();
    let header_end = bytes.iter().position(|&b| b == b'\n').unwrap() + 1;
    let header = std::str::from_utf8(&bytes[..header_end]).unwrap();
    let side = |tag: char| {
        let word = header.split_whitespace().find(|word| word.starts_with(tag)).unwrap();
        word[1..].parse::<usize>().unwrap()
    };
    let (width_px, height_px) = (side('W'), side('H'));
    let with_line = "FRAME\n".len() + width_px * height_px;
    let frames = bytes[header_end..].chunks_exact(with_line).map(|f| f[6..].to_vec()).collect();
    (width_px, height_px, frames)
}

#[test]
fn pictures_give_the_same_candidates_as_the_recording_of_them() {
    let _turn = turn();
    let folder = simulated(&["--seconds", "1.4", "--first-launch-s", "0.7"]);
    let out = tempfile::tempdir().unwrap();
    let arguments = [folder.path(), Path::new("--candidates"), out.path()];
    let output = track(&arguments.map(|argument| argument.to_str().unwrap()));
    assert!(output.status.success(), "{}", words(&output));
    let recorded = std::fs::read_to_string(out.path().join("left.csv")).unwrap();

    let pictures = tempfile::tempdir().unwrap();
    let (width_px, height_px, frames) = frames_of(&folder.path().join("left.y4m"));
    for (idx, luma) in frames.into_iter().enumerate() {
        let picture = image::GrayImage::from_raw(width_px as u32, height_px as u32, luma).unwrap();
        let ending = if idx % 2 == 0 { "png" } else { "pgm" };
        picture.save(pictures.path().join(format!("{idx:05}.{ending}"))).unwrap();
    }
    let court = processes::own_court("pictures").unwrap();
    let mut house = Household::new(&court).unwrap();
    let arguments: [&str; 4] =
        ["--recorded", "left", "--candidates", pictures.path().to_str().unwrap()];
    house.start("fusion", "fusion", &arguments, Until::Done, Stdio::null()).unwrap();
    let endpoint = free_endpoint().unwrap();
    let chain = Chain { n_workers: 2, worker_flags: Vec::new(), endpoint };
    chain.start_fusion_bridge(&mut house).unwrap();
    chain.start_board(&mut house, Camera::Left).unwrap();
    let stamps = folder.path().join("left.timestamps");
    let arguments = [
        ["--camera", "left"],
        ["--pictures", pictures.path().to_str().unwrap()],
        ["--timestamps", stamps.to_str().unwrap()],
        ["--speed", "max"],
        ["--workers", "2"],
    ];
    let mut arguments = arguments.concat();
    arguments.push("--wait-for-bridge");
    house.start("capture", "capture", &arguments, Until::Done, Stdio::null()).unwrap();
    house.wait_for("fusion", &Stop::on_signals(false).unwrap()).unwrap();
    house.stop().unwrap();
    let from_pictures = std::fs::read_to_string(pictures.path().join("left.csv")).unwrap();
    assert!(recorded.lines().count() > 20, "nothing is being compared");
    assert!(recorded == from_pictures);
}

//! `calibrate chessboard` on pictures that others took and rendered.

use crate::run::{numbers, run, shared, simulated, track, turn, words};
use fusion::Rig;
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Output;

/// The target directory, of which the test's own binary stands in `release/deps`.
fn target() -> PathBuf {
    std::env::current_exe().unwrap().ancestors().nth(3).unwrap().to_owned()
}

/// OpenCV's stereo set: 13 pairs, 9x6 corners, 25 mm squares.
fn opencv_pictures() -> Option<PathBuf> {
    let folder = target().join("opencv-doc");
    if folder.join("left01.jpg").exists() {
        return Some(folder);
    }
    println!("skipped: {} is not here (scripts/setup test)", folder.display());
    None
}

fn calibrate(arguments: &[&str]) -> Output {
    run("calibrate", &[&["chessboard"], arguments].concat())
}

/// The report, and the rig that was written.
fn calibrated(arguments: &[&str]) -> (Value, Rig) {
    let folder = tempfile::tempdir().unwrap();
    let [json, out] = ["report.json", "rig.toml"].map(|name| folder.path().join(name));
    let mut all = arguments.to_vec();
    all.extend(["--json", json.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    let output = calibrate(&all);
    assert!(output.status.success(), "{}", words(&output));
    println!("{}", String::from_utf8_lossy(&output.stdout));
    let report: Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    let text = std::fs::read_to_string(out).unwrap();
    assert_eq!(report["rig_toml"], text);
    (report, text.parse().unwrap())
}

fn refused(report: &Value) -> Vec<(&str, &str)> {
    let all = report["pair"]["views_refused"].as_array().unwrap().iter();
    all.map(|one| (one["view"].as_str().unwrap(), one["reason"].as_str().unwrap())).collect()
}

#[test]
fn opencvs_own_pictures_give_a_better_rig_than_opencv() {
    let Some(folder) = opencv_pictures() else { return };
    let folder = folder.to_str().unwrap();
    let (report, rig) = calibrated(&[folder, "--corners", "9x6", "--square-mm", "25"]);
    let pair = &report["pair"];
    assert_eq!(pair["views_used"].as_array().unwrap().len(), 13);
    // OpenCV 5: 0.217 and 0.177 px, 83.2 mm.
    let [rms_px, row_px, baseline_m, sigma_m] =
        ["rms_px", "row_error_rms_px", "baseline_m", "baseline_sigma_m"]
            .map(|field| pair[field].as_f64().unwrap());
    assert!(rms_px < 0.22 && row_px < 0.18, "{rms_px} {row_px}");
    assert!((baseline_m - 0.0832).abs() < 0.0003 && sigma_m < 0.0003, "{baseline_m} {sigma_m}");
    // Every number that was fitted has its sigma, in the report and in the rig.
    let covariance = rig.covariance().unwrap();
    let n_known = (0..30).filter(|&i| covariance[(i, i)] > 0.0).count();
    assert_eq!(report["sigma"].as_object().unwrap().len(), n_known);
    assert!(n_known >= 2 * 5 + 6, "{n_known}");
}

#[test]
fn a_picture_of_another_view_is_the_one_refused() {
    let Some(folder) = opencv_pictures() else { return };
    let mixed = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, mixed.path().join(path.file_name().unwrap())).unwrap();
    }
    std::fs::copy(folder.join("right09.jpg"), mixed.path().join("right05.jpg")).unwrap();
    std::fs::remove_file(mixed.path().join("left07.jpg")).unwrap();
    let mixed = mixed.path().to_str().unwrap();
    let (report, _) = calibrated(&[mixed, "--corners", "9x6", "--square-mm", "25"]);
    let refused = refused(&report);
    let [("07", no_picture), ("05", mis_paired)] = refused[..] else { panic!("{refused:?}") };
    assert_eq!(no_picture, "left: no picture");
    assert!(mis_paired.starts_with("mis-paired"), "{mis_paired}");
    assert_eq!(report["pair"]["views_used"].as_array().unwrap().len(), 11);
    assert!((report["pair"]["baseline_m"].as_f64().unwrap() - 0.0832).abs() < 0.0003);
}

#[test]
fn a_rendered_rig_is_found_to_millimetres_and_track_accepts_it() {
    let Some(folder) = shared("data/chess-blender") else { return };
    let pictures = folder.to_str().unwrap();
    let (report, rig) = calibrated(&[pictures, "--corners", "9x6", "--square-mm", "200"]);
    assert_eq!(refused(&report), []);
    let truth: toml::Table =
        std::fs::read_to_string(folder.join("../blender-a/rig.toml")).unwrap().parse().unwrap();
    let pose_of = |camera: &str| {
        let json = serde_json::to_value(&truth[camera]).unwrap();
        let rows: Vec<f64> =
            json["court_from_camera"].as_array().unwrap().iter().flat_map(numbers).collect();
        let place = numbers(&json["position_in_court_m"]);
        (Matrix3::from_row_slice(&rows), Vector3::from_vec(place))
    };
    let ((left, left_m), (right, right_m)) = (pose_of("left"), pose_of("right"));
    let found = rig.right_from_left();
    let off = found.rotation.matrix() * (right.transpose() * left).transpose();
    let off_deg = Rotation3::from_matrix_unchecked(off).angle().to_degrees();
    let off_m = found.translation.vector.norm() - (left_m - right_m).norm();
    println!("baseline off by {:+.2} mm, rotation by {off_deg:.4} degrees", off_m * 1e3);
    assert!(off_m.abs() < 0.003 && off_deg < 0.03, "{off_m} {off_deg}");

    let _turn = turn();
    let shot = simulated(&["--seconds", "0.3"]);
    std::fs::write(shot.path().join("rig.toml"), rig.to_string()).unwrap();
    let output = track(&[shot.path().to_str().unwrap(), "--json", "-"]);
    assert!(output.status.success(), "{}", words(&output));
}

#[test]
fn one_camera_alone_gives_its_lens() {
    let Some(folder) = opencv_pictures() else { return };
    let pictures = (1..10).map(|i| folder.join(format!("left{i:02}.jpg")));
    let pictures: Vec<String> = pictures.map(|p| p.to_str().unwrap().to_owned()).collect();
    let out = tempfile::NamedTempFile::new().unwrap();
    let mut arguments = vec!["--corners", "9x6", "--square-mm", "25", "--left"];
    arguments.extend(pictures.iter().map(String::as_str));
    arguments.extend(["--out", out.path().to_str().unwrap()]);
    let output = calibrate(&arguments);
    assert!(output.status.success(), "{}", words(&output));
    let text = std::fs::read_to_string(out.path()).unwrap();
    let table: toml::Table = text.parse().unwrap();
    let focal_px = table["left"]["focal_px"][0].as_float().unwrap();
    // OpenCV 5 finds 533 to 536 px by all thirteen.
    assert!((focal_px - 534.0).abs() < 4.0, "{text}");
}

#[test]
fn what_is_no_chessboard_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let says = |arguments: &[&str], code: i32| {
        let output = calibrate(arguments);
        let said = words(&output) + &String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(!said.contains("panicked"), "{said}");
        said
    };
    let sizes = ["--corners", "9x6", "--square-mm", "25"];
    let check = |arguments: &[&str], code: i32, expected: &[&str]| {
        let said = says(&[arguments, &sizes[..]].concat(), code);
        assert!(expected.iter().all(|word| said.contains(word)), "{said:?} lacks {expected:?}");
    };
    let empty = folder.path().to_str().unwrap().to_owned();
    check(&[&empty], 1, &["expected pictures like left01.jpg"]);
    check(&[], 2, &["required"]);
    std::fs::write(path("left01.png"), "no picture").unwrap();
    check(&[&empty], 1, &["left01.png"]);
    let grey = image::GrayImage::from_pixel(640, 480, image::Luma([90]));
    for name in ["left01.png", "right01.png", "left02.png"] {
        grey.save(path(name)).unwrap();
    }
    let refusals = ["view 01 refused: left: no chessboard found", "02 refused: right: no picture"];
    check(&[&empty], 1, &refusals);
    check(&[&empty], 1, &["left: 0 usable views of the board, expected at least 3"]);
    let [left, right] = [path("left01.png"), path("right01.png")];
    check(&["--left", &left, &left, "--right", &right], 1, &["2 pictures of --left, 1 of --right"]);
    image::GrayImage::new(320, 240).save(path("right02.png")).unwrap();
    check(&[&empty], 1, &["right picture of view 02: 320x240 px, expected 640x480"]);
    let said = says(&[&empty, "--corners", "9by6", "--square-mm", "25"], 2);
    assert!(said.contains("like 9x6"), "{said}");
}

#[test]
fn where_a_file_cannot_be_written_is_said() {
    let Some(folder) = opencv_pictures() else { return };
    let nowhere = Path::new("/nowhere/rig.toml").to_str().unwrap();
    let folder = folder.to_str().unwrap();
    let output = calibrate(&[folder, "--corners", "9x6", "--square-mm", "25", "--out", nowhere]);
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output).contains(nowhere), "{}", words(&output));
}

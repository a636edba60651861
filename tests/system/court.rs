//! `calibrate court` on courts that were rendered, here and elsewhere.

use crate::accuracy::{bounce_error_m, json_from};
use crate::run::{blender_a, numbers, run, shared, shots_of, turn, words};
use fusion::Rig;
use fusion::calibration::prior::LensSigma;
use std::path::Path;
use tests::courts::{self, Odds, Score};

/// Rigs and courts of each kind; `courts --rigs 100` is the whole of it.
const N_RIGS: u64 = 4;

fn scores(odds: &Odds) -> Vec<Score> {
    let scores: Vec<Score> =
        (1..=N_RIGS).map(|seed| courts::score_from_seed(seed, odds).unwrap()).collect();
    println!("{odds:?}\n{}", courts::text_from(&scores));
    scores
}

/// Every bounce at the far baseline is measured this well, and no worse than the calibration says.
fn check(scores: &[Score], off_max_m: f64) {
    for score in scores {
        assert!(score.off_m.norm() < off_max_m, "{score:?}");
        for axis in 0..2 {
            assert!(score.off_m[axis].abs() < 4.0 * score.sigma_m[axis], "{score:?}");
            assert!(score.sigma_m[axis] < off_max_m, "{score:?}");
        }
    }
}

#[test]
fn rigs_set_up_by_hand_are_calibrated_to_millimetres_at_the_far_baseline() {
    check(&scores(&Odds { paint_sigma_m: 0.0, lens: LensSigma::EXACT }), 0.01);
    check(&scores(&Odds { paint_sigma_m: 0.005, lens: LensSigma::ROUGH }), 0.015);
}

/// Averages both videos of a shot folder up to the launch and calibrates from the court's lines.
fn calibrated_from_lines(folder: &Path, start: &Path, out: &Path) {
    let pictures = ["left", "right"].map(|camera| {
        let picture = folder.join(format!("{camera}.png"));
        let video = folder.join(format!("{camera}.y4m"));
        let output =
            run("background", &[text(&video), "--n-frames", "90", "--out", text(&picture)]);
        assert!(output.status.success(), "{}", words(&output));
        picture
    });
    let [left, right] = [text(&pictures[0]), text(&pictures[1])];
    let (start, out) = (text(start), text(out));
    let flags = ["court", "--left", left, "--right", right, "--rig", start, "--out", out];
    let output = run("calibrate", &flags);
    assert!(output.status.success(), "{}", words(&output));
    println!("{}", String::from_utf8_lossy(&output.stdout));
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Nothing of the true rig but its lenses: cameras half a metre and some degrees from there.
fn rough_rig(truth: &Path) -> String {
    let mut rig: Rig = std::fs::read_to_string(truth).unwrap().parse().unwrap();
    let mut step = fusion::world::adjustment::RigStep::zeros();
    for (i, by) in [(9, 0.04), (10, -0.05), (12, 0.4), (14, -0.5), (24, -0.04), (28, 0.5)] {
        step[i] = by;
    }
    rig = rig.adjusted(&step).unwrap();
    rig.to_string()
}

#[test]
fn a_rendered_shot_is_measured_with_a_rig_from_its_own_lines_with_a_chessboard_and_without() {
    let Some(folder) = blender_a() else { return };
    let Some(boards) = shared("data/chess-blender") else { return };
    let _turn = turn();
    let folder = folder.path();
    let [rig, rough, chess] = ["rig.toml", "rough.toml", "chess.toml"].map(|f| folder.join(f));
    std::fs::write(&rough, rough_rig(&rig)).unwrap();
    let flags = ["chessboard", text(&boards), "--corners", "9x6", "--square-mm", "200"];
    let output = run("calibrate", &[&flags[..], &["--out", text(&chess)]].concat());
    assert!(output.status.success(), "{}", words(&output));
    let truth = json_from(&folder.join("truth.json"));
    for (name, start) in [("lines alone", &rough), ("chessboard and lines", &chess)] {
        calibrated_from_lines(folder, start, &rig);
        let shots = shots_of(folder, &[]);
        let error_m = bounce_error_m(name, &shots, &numbers(&truth["bounce"]["ball_centre"]));
        assert!(error_m < 0.03, "{name}: {error_m}");
    }
}

#[test]
fn pictures_that_are_no_court_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let says = |flags: &[&str], expected: &str| {
        let output = run("calibrate", &[&["court"], flags].concat());
        assert_eq!(output.status.code(), Some(1));
        let said = words(&output);
        assert!(said.contains(expected), "{said:?} lacks {expected:?}");
    };
    image::GrayImage::from_pixel(640, 480, image::Luma([90])).save(path("grey.png")).unwrap();
    image::GrayImage::new(320, 240).save(path("small.png")).unwrap();
    let rig = courts::fusion_rig(&tests::scenario::Scenario::empty()).unwrap();
    std::fs::write(path("rig.toml"), rig.to_string()).unwrap();
    let [grey, small, rig] = ["grey.png", "small.png", "rig.toml"].map(path);
    let [grey, small, rig] = [text(&grey), text(&small), text(&rig)];
    let flags = |left, right| ["--left", left, "--right", right, "--rig", rig];
    says(&flags(grey, grey), "the left picture shows no tennis court");
    says(&flags(small, grey), "the left picture is 320x240, the rig's camera has 640x480");
    says(&flags(grey, "/nowhere.png"), "/nowhere.png");
    says(&[&flags(grey, grey)[..], &["--paint-mm", "-1"]].concat(), "--paint-mm is -1");
}

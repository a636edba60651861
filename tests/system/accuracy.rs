//! What a shot is measured as, against its truth. Errors are printed as well as asserted.

use crate::run::{blender_a, have, numbers, shared, shots_of, simulated, track, turn, words};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// The thesis was 0.64 m off, or 0.11 m after subtracting a "constant" by hand.
const MAX_ERROR_M: f64 = 0.010;
/// Of ten simulated shots: mean, and worst.
const MAX_SIMULATED_M: [f64; 2] = [0.005, 0.015];

pub fn json_from(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Distance on the ground between the measured and the true bounce; prints both.
pub fn bounce_error_m(name: &str, shots: &Value, truth_m: &[f64]) -> f64 {
    let list = shots["shots"].as_array().unwrap();
    assert_eq!(list.len(), 1, "{name}: one ball was served");
    assert_eq!(list[0]["outcome"], "measured", "{name}");
    let bounce = &list[0]["bounce"];
    let measured_m = numbers(&bounce["position_m"]);
    let sigma_m = |axis: usize| bounce["covariance_m2"][axis][axis].as_f64().unwrap().sqrt();
    let (dx_m, dy_m) = (measured_m[0] - truth_m[0], measured_m[1] - truth_m[1]);
    println!(
        "{name}: bounce at ({:+.3}, {:.3}) m, error ({:+.3} ± {:.3}, {:+.3} ± {:.3}) m",
        measured_m[0],
        measured_m[1],
        dx_m,
        sigma_m(0),
        dy_m,
        sigma_m(1),
    );
    dx_m.hypot(dy_m)
}

fn check_every_frame_is_accounted_for(shots: &Value, n_frames: [usize; 2]) {
    for (camera, n) in ["left", "right"].into_iter().zip(n_frames) {
        let counts = &shots["frames"][camera];
        let expected = serde_json::json!({"captured": n, "processed": n, "lost": 0});
        assert_eq!(counts, &expected, "{camera}");
    }
}

fn n_lines(path: &Path) -> usize {
    std::fs::read_to_string(path).unwrap().lines().count()
}

#[test]
fn an_independently_rendered_thesis_shot_is_measured_within_a_centimetre() {
    let Some(folder) = blender_a() else { return };
    let _turn = turn();
    let shots = shots_of(folder.path(), &[]);
    check_every_frame_is_accounted_for(&shots, [157, 157]);
    let truth = json_from(&folder.path().join("truth.json"));
    let error_m = bounce_error_m("blender-a", &shots, &numbers(&truth["bounce"]["ball_centre"]));
    assert!(error_m < MAX_ERROR_M, "{error_m}");
    // 100 km/h, 8.1 degrees up, straight on, no spin.
    let launch = &shots["shots"][0]["launch"];
    for (field, truth, off_max) in [
        ("speed_m_s", 100.0 / 3.6, 0.005 * 100.0 / 3.6),
        ("elevation_deg", 8.1, 0.15),
        ("azimuth_deg", 0.0, 0.1),
        ("spin_rpm", 0.0, 60.0),
    ] {
        let (value, sigma) = (&launch[field], &launch["sigma"][field]);
        let off = value.as_f64().unwrap() - truth;
        println!("blender-a: {field} off by {off:+.3}, sigma {:.3}", sigma.as_f64().unwrap());
        assert!(off.abs() < off_max, "{field}: {off}");
    }
}

#[test]
fn ten_simulated_shots_are_measured_within_millimetres() {
    let _turn = turn();
    let mut errors_m = Vec::new();
    for seed in 1..=10 {
        let folder = simulated(&["--seed", &seed.to_string()]);
        let shots = shots_of(folder.path(), &[]);
        let stamps = ["left", "right"].map(|c| folder.path().join(format!("{c}.timestamps")));
        check_every_frame_is_accounted_for(&shots, stamps.map(|path| n_lines(&path)));
        let truth = json_from(&folder.path().join("truth.json"));
        let truth_m = numbers(&truth["bounce"]["position_m"]);
        errors_m.push(bounce_error_m(&format!("simulated {seed}"), &shots, &truth_m));
    }
    let mean_m = errors_m.iter().sum::<f64>() / 10.0;
    let worst_m = errors_m.iter().copied().fold(0.0, f64::max);
    println!("ten simulated shots: mean {:.1} cm, worst {:.1} cm", mean_m * 1e2, worst_m * 1e2);
    let [mean_max_m, worst_max_m] = MAX_SIMULATED_M;
    assert!(mean_m < mean_max_m && worst_m < worst_max_m, "{errors_m:?}");
}

#[test]
fn the_demo_measures_what_it_serves() {
    let _turn = turn();
    let demo = Command::new(env!("CARGO_BIN_EXE_demo")).args(["--shots", "2"]).output().unwrap();
    let said = String::from_utf8_lossy(&demo.stdout);
    println!("{said}");
    assert!(demo.status.success(), "{}", words(&demo));
    assert!(said.contains("2 of 2 shots measured"), "{said}");
}

/// The 43 frames without a ball are played first, to learn the background from.
const N_EMPTY: usize = 43;
const FIRST_EMPTY: usize = 121;

#[test]
fn most_visible_balls_of_a_real_clip_are_among_the_candidates() {
    let Some(clip) = shared("data/amateur-grass") else { return };
    if !have("ffmpeg") {
        return;
    }
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let shrunk = "scale=640:360:flags=area,split[a][b]";
    let filter = format!(
        "[0:v]{shrunk};[a]trim=start_frame={FIRST_EMPTY},setpts=PTS-STARTPTS[e];[e][b]concat"
    );
    let converted = Command::new("ffmpeg")
        .args(["-loglevel", "error", "-i"])
        .arg(clip.join("amateur-grass.mp4"))
        .args(["-filter_complex", &filter, "-fps_mode", "passthrough", "-pix_fmt", "gray"])
        .args(["-f", "yuv4mpegpipe", "-strict", "-1"])
        .arg(folder.path().join("left.y4m"))
        .status()
        .unwrap();
    assert!(converted.success());
    let stamps: String =
        (0..N_EMPTY + 164).map(|k| format!("{}\n", k as i64 * 33_366_700)).collect();
    std::fs::write(folder.path().join("left.timestamps"), stamps).unwrap();
    let out = folder.path().join("out");
    let path = |p: &Path| p.to_str().unwrap().to_owned();
    let output = track(&[&path(folder.path()), "--candidates", &path(&out)]);
    assert!(output.status.success(), "{}", words(&output));

    let found = candidates_by_frame(&out.join("left.csv"));
    let labels = std::fs::read_to_string(clip.join("gt640.csv")).unwrap();
    let easy = easy_labels(&labels);
    let n_found = easy
        .iter()
        .filter(|(frame_idx, x_px, y_px)| {
            let near = |spot: &(f64, f64)| (spot.0 - x_px).hypot(spot.1 - y_px) <= 5.0;
            found.get(frame_idx).is_some_and(|spots| spots.iter().any(near))
        })
        .count();
    let n_played = found.values().map(Vec::len).sum::<usize>();
    let per_frame = (n_played - n_found) as f64 / 164.0;
    let share = n_found as f64 / easy.len() as f64;
    println!(
        "amateur-grass: {n_found} of {} easy balls found ({:.0} %), {per_frame:.1} other \
         candidates per frame",
        easy.len(),
        share * 100.0
    );
    // Both numbers of both best rows of the thesis' Table 1 (73 % at 4.0, 64 % at 2.1) at once.
    assert!(share > 0.73 && per_frame < 2.1, "{share} at {per_frame}");
}

/// Candidates by frame of the clip; those of the empty frames played first are left out.
fn candidates_by_frame(path: &Path) -> std::collections::BTreeMap<usize, Vec<(f64, f64)>> {
    let mut found = std::collections::BTreeMap::<usize, Vec<(f64, f64)>>::new();
    for line in std::fs::read_to_string(path).unwrap().lines().skip(1) {
        let fields: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
        let played_idx = (fields[0] / 33_366_700.0).round() as usize;
        if let Some(frame_idx) = played_idx.checked_sub(N_EMPTY) {
            found.entry(frame_idx).or_default().push((fields[1], fields[2]));
        }
    }
    found
}

/// Frame and place of every label that is not marked `hard`.
fn easy_labels(csv: &str) -> Vec<(usize, f64, f64)> {
    let mut lines = csv.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let (frame, x, y, hard) = (column("frame"), column("x"), column("y"), column("hard"));
    lines
        .map(|line| line.split(',').collect::<Vec<_>>())
        .filter(|fields| fields[hard] == "0")
        .map(|fields| {
            let number = |idx: usize| fields[idx].parse::<f64>().unwrap();
            (number(frame) as usize, number(x), number(y))
        })
        .collect()
}

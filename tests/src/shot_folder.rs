//! Scenario, truth -> a shot folder on disk: videos, stamps, labels, rig.toml, truth.
//!
//! The folder is what `track` reads; its files are described in the project's formats. Both cameras
//! are rendered at the same time, one thread each. Here degrees, km/h and rpm may appear:
//! truth.json is a border. Stamps in truth.csv and truth.json are on the left camera's clock.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::thread;

use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};

use crate::camera::{self, Side};
use crate::renderer::Renderer;
use crate::scenario::Scenario;
use crate::truth::{Flight, Truth};
use page::labels::{self, Labels};

/// Writes a folder of `n_frames` per camera; `progress` hears how many the left one has.
pub fn write(
    directory: &Path,
    scenario: &Scenario,
    truth: &Truth,
    n_frames: u64,
    progress: impl Fn(u64) + Sync,
) -> io::Result<()> {
    fs::create_dir_all(directory)?;
    fs::write(directory.join("rig.toml"), rig_toml(scenario))?;
    fs::write(directory.join("truth.csv"), truth_csv(scenario, truth, n_frames))?;
    fs::write(directory.join("truth.json"), format!("{:#}\n", truth_json(scenario, truth)))?;
    let quiet = |_| ();
    thread::scope(|threads| {
        let right = threads
            .spawn(|| write_camera(directory, scenario, truth, Side::Right, n_frames, quiet));
        write_camera(directory, scenario, truth, Side::Left, n_frames, &progress)?;
        right.join().expect("a panic there has said why")
    })
}

/// One camera's video and stamps.
fn write_camera(
    directory: &Path,
    scenario: &Scenario,
    truth: &Truth,
    side: Side,
    n_frames: u64,
    progress: impl Fn(u64),
) -> io::Result<()> {
    let renderer = Renderer::new(scenario, truth, side);
    let (width, height) = (renderer.camera().width_px, renderer.camera().height_px);
    let mut video = BufWriter::new(File::create(directory.join(format!("{}.y4m", side.name())))?);
    let stamps = File::create(directory.join(format!("{}.timestamps", side.name())))?;
    let mut stamps = BufWriter::new(stamps);
    let (rate, per) = ratio_from_rate(scenario.frame_rate_hz);
    writeln!(video, "YUV4MPEG2 W{width} H{height} F{rate}:{per} Ip A1:1 Cmono")?;
    let mut luma = vec![0; width * height];
    let mut labels = Labels::new();
    for frame_idx in 0..n_frames {
        let exposed_at_s = scenario.exposed_at_s(side, frame_idx);
        let label = renderer.label_at(exposed_at_s);
        labels.extend(label.map(|label| (frame_idx as usize, label)));
        renderer.render_into(frame_idx, exposed_at_s, &mut luma);
        video.write_all(b"FRAME\n")?;
        video.write_all(&luma)?;
        writeln!(stamps, "{}", scenario.stamp_ns(side, frame_idx))?;
        progress(frame_idx + 1);
    }
    let file = File::create(directory.join(format!("{}.labels.csv", side.name())))?;
    labels::to_csv(&labels, BufWriter::new(file)).map_err(io::Error::other)?;
    video.flush()?;
    stamps.flush()
}

/// A frame rate as a fraction, to a thousandth.
fn ratio_from_rate(frame_rate_hz: f64) -> (u64, u64) {
    if frame_rate_hz.fract() == 0.0 {
        (frame_rate_hz as u64, 1)
    } else {
        ((frame_rate_hz * 1000.0).round() as u64, 1000)
    }
}

/// The rig, exact.
pub fn rig_toml(scenario: &Scenario) -> String {
    let p = scenario.launcher_in_court_m;
    format!(
        "# A simulated rig: exact.\n{}\n{}\n\
         [ball]\ndiameter_m = {:?}\nmass_kg    = {:?}\n\n\
         [launcher]\nposition_in_court_m = {:?}\n",
        camera::toml_from_camera(Side::Left, &scenario.rig.left),
        camera::toml_from_camera(Side::Right, &scenario.rig.right),
        2.0 * scenario.world.ball_radius_m,
        scenario.world.ball_mass_kg,
        [p.x, p.y, p.z],
    )
}

/// The ball's centre at the left camera's frames, while one is in flight.
fn truth_csv(scenario: &Scenario, truth: &Truth, n_frames: u64) -> String {
    let mut text = String::from("t_ns,x,y,z\n");
    for frame_idx in 0..n_frames {
        let at_s = scenario.exposed_at_s(Side::Left, frame_idx);
        if let Some(p) = truth.position_in_court_m(at_s) {
            let t_ns = scenario.stamp_ns(Side::Left, frame_idx);
            text += &format!("{t_ns},{:.6},{:.6},{:.6}\n", p.x, p.y, p.z);
        }
    }
    text
}

/// The first shot's launch and bounce at the top, and every shot in `shots`.
pub fn truth_json(scenario: &Scenario, truth: &Truth) -> Value {
    let shots: Vec<Value> = truth.flights.iter().map(shot_json).collect();
    let first = |key: &str| shots.first().map_or(Value::Null, |s| s[key].clone());
    let world = &scenario.world;
    json!({
        "launch": first("launch"),
        "bounce": first("bounce"),
        "net": first("net"),
        "shots": shots,
        "seed": scenario.seed,
        "right_minus_left_ns": scenario.right_offset_ns,
        "right_phase_ns": scenario.right_phase_ns,
        "noise_level": scenario.noise_level,
        "wind_m_s": xyz(&world.wind_m_s),
        "air_density_kg_m3": world.air_density_kg_m3,
        "surface_friction": world.surface_friction,
    })
}

fn shot_json(flight: &Flight) -> Value {
    let launch = &flight.launch;
    let launch_json = json!({
        "t_ns": ns(launch.launched_at_s),
        "position_m": point(&launch.position_in_court_m),
        "velocity_m_s": xyz(&launch.velocity_in_court_m_s()),
        "speed_m_s": launch.speed_m_s,
        "elevation_deg": launch.elevation_rad.to_degrees(),
        "azimuth_deg": launch.azimuth_rad.to_degrees(),
        "spin_rpm": rpm(launch.backspin_rad_s),
        "drag_coefficient": launch.drag_coefficient,
        "lift_scale": launch.lift_scale,
    });
    let bounces = flight.bounces.iter().map(|b| {
        json!({
            "t_ns": ns(b.bounced_at_s),
            "position_m": point(&b.position_in_court_m),
            "velocity_in_m_s": xyz(&b.velocity_in_m_s),
            "velocity_out_m_s": xyz(&b.velocity_out_m_s),
            "spin_in_rad_s": xyz(&b.spin_in_rad_s),
            "spin_out_rad_s": xyz(&b.spin_out_rad_s),
        })
    });
    let bounces: Vec<Value> = bounces.collect();
    let net = flight.net.map(|n| {
        json!({
            "t_ns": ns(n.crossed_at_s),
            "position_m": point(&n.position_in_court_m),
            "height_m": n.position_in_court_m.z,
            "clearance_m": n.clearance_m,
        })
    });
    json!({
        "launch": launch_json,
        "bounce": bounces.first(),
        "bounces": bounces,
        "net": net,
        "end": format!("{:?}", flight.end),
        "end_t_ns": ns(flight.ended_at_s()),
    })
}

fn ns(at_s: f64) -> i64 {
    (at_s * 1e9).round() as i64
}

fn rpm(spin_rad_s: f64) -> f64 {
    spin_rad_s * 60.0 / std::f64::consts::TAU
}

fn point(p: &Point3<f64>) -> Value {
    xyz(&p.coords)
}

fn xyz(v: &Vector3<f64>) -> Value {
    json!([v.x, v.y, v.z])
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;

    #[test]
    fn a_folder_holds_what_the_formats_say() {
        let directory = tempfile::tempdir().expect("a place to write");
        let scenario = Scenario { right_offset_ns: 1234, ..Scenario::thesis_shot() };
        let truth = Truth::from_scenario(&scenario);
        let n_seen = AtomicU64::new(0);
        let progress = |n| n_seen.store(n, Ordering::Relaxed);
        write(directory.path(), &scenario, &truth, 70, progress).expect("written");
        assert_eq!(n_seen.load(Ordering::Relaxed), 70);

        let read = |name: &str| fs::read(directory.path().join(name)).expect(name);
        let text = |name: &str| String::from_utf8(read(name)).expect("text");
        for side in Side::BOTH {
            let video = read(&format!("{}.y4m", side.name()));
            let header: &[u8] = b"YUV4MPEG2 W640 H480 F90:1 Ip A1:1 Cmono\n";
            assert!(video.starts_with(header));
            assert!(video[header.len()..].starts_with(b"FRAME\n"));
            assert_eq!(video.len(), header.len() + 70 * (6 + 640 * 480));
            assert_eq!(text(&format!("{}.timestamps", side.name())).lines().count(), 70);
        }
        assert_eq!(text("left.timestamps").lines().nth(1), Some("11111111"));
        assert_eq!(text("right.timestamps").lines().nth(1), Some("11112345"));

        let rig: toml::Table = text("rig.toml").parse().expect("valid TOML");
        assert_eq!(rig["ball"]["diameter_m"].as_float(), Some(0.066));
        assert_eq!(rig["launcher"]["position_in_court_m"][2].as_float(), Some(1.0));
        assert_eq!(rig["right"]["position_in_court_m"][0].as_float(), Some(2.0));

        let csv = text("truth.csv");
        assert_eq!(csv.lines().next(), Some("t_ns,x,y,z"));
        // Launched at 0.7041 s: frames 64 (0.7111 s) to 69.
        assert_eq!(csv.lines().count(), 1 + 6);
    }

    #[test]
    fn the_truth_is_told_in_the_units_of_the_formats() {
        let scenario = Scenario::thesis_shot();
        let json = truth_json(&scenario, &Truth::from_scenario(&scenario));
        let number = |pointer: &str| json.pointer(pointer).and_then(Value::as_f64).expect(pointer);
        assert!((number("/launch/elevation_deg") - 8.1).abs() < 1e-9);
        assert!((number("/launch/speed_m_s") - 27.7778).abs() < 1e-4);
        assert_eq!(number("/launch/t_ns"), 704_111_111.0);
        assert!((number("/bounce/position_m/1") - 21.366).abs() < 0.5);
        assert!((number("/bounce/velocity_in_m_s/2") + 5.28).abs() < 0.05);
        assert_eq!(json["shots"].as_array().map(Vec::len), Some(1));
    }

    #[test]
    fn a_court_without_shots_has_no_launch() {
        let scenario = Scenario::empty();
        let json = truth_json(&scenario, &Truth::from_scenario(&scenario));
        assert!(json["launch"].is_null() && json["bounce"].is_null());
    }
}

//! Shots -> the document `shots/1`: what `track --json` writes.
//!
//! The only place where this room uses degrees. What was not observed is `null`, never a guess:
//! a quadratic tells neither spin nor the clocks' difference. A number that is not finite becomes
//! `null` too.

use crate::aim::machine_toml::rpm_from_rad_s;
use crate::intake::FrameCounts;
use crate::launch::Launch;
use crate::shot::{Bounce, ClockOffset, Shot, TrackPoint};
use crate::world::camera::RawPixel;
use nalgebra::Vector3;
use serde::Serialize;
use shm_layout::{Camera, StampNs};

/// The whole document, indented; counts are left, right, None for a camera that is absent.
#[must_use]
pub fn text_from(
    shots: &[Shot],
    frames: [Option<FrameCounts>; 2],
    clock: Option<ClockOffset>,
) -> String {
    let document = Document {
        schema: "shots/1",
        frames: FramesView {
            left: frames[Camera::Left.idx()].into(),
            right: frames[Camera::Right.idx()].into(),
        },
        clock: ClockView {
            right_minus_left_ms: clock.map(|clock| clock.right_minus_left_s * 1e3),
            sigma_ms: clock.map(|clock| clock.sigma_s * 1e3),
        },
        shots: shots.iter().map(ShotView::from).collect(),
    };
    serde_json::to_string_pretty(&document).expect("the views have text keys and plain values")
}

/// One shot alone, on one line, with its number since fusion started: what is published as it
/// happens.
#[must_use]
pub fn text_from_shot(shot: &Shot, shot_idx: u64) -> String {
    let view = LiveView { shot_idx, shot: shot.into() };
    serde_json::to_string(&view).expect("the view has text keys and plain values")
}

#[derive(Serialize)]
struct LiveView {
    shot_idx: u64,
    #[serde(flatten)]
    shot: ShotView,
}

#[derive(Serialize)]
struct Document {
    schema: &'static str,
    frames: FramesView,
    clock: ClockView,
    shots: Vec<ShotView>,
}

#[derive(Serialize)]
struct FramesView {
    left: CameraView,
    right: CameraView,
}

/// `{}` for a camera that is absent.
#[derive(Serialize)]
#[serde(untagged)]
enum CameraView {
    Present { captured: u64, processed: u64, lost: u64 },
    Absent {},
}

impl From<Option<FrameCounts>> for CameraView {
    fn from(counts: Option<FrameCounts>) -> Self {
        match counts {
            Some(FrameCounts { captured, processed, lost }) => {
                Self::Present { captured, processed, lost }
            }
            None => Self::Absent {},
        }
    }
}

#[derive(Serialize)]
struct ClockView {
    right_minus_left_ms: Option<f64>,
    sigma_ms: Option<f64>,
}

#[derive(Serialize)]
struct ShotView {
    outcome: &'static str,
    launch: Option<LaunchView>,
    bounce: Option<BounceView>,
    net: Option<NetView>,
    track: Vec<TrackPointView>,
    residual_px: ResidualView,
    frames_lost: LostView,
}

#[derive(Serialize)]
struct LaunchView {
    t_ns: StampNs,
    position_m: [f64; 3],
    speed_m_s: f64,
    elevation_deg: Option<f64>,
    azimuth_deg: Option<f64>,
    spin_rpm: Option<f64>,
    sigma: LaunchSigmaView,
}

#[derive(Serialize)]
struct LaunchSigmaView {
    speed_m_s: f64,
    elevation_deg: Option<f64>,
    azimuth_deg: Option<f64>,
    spin_rpm: Option<f64>,
}

#[derive(Serialize)]
struct BounceView {
    t_ns: StampNs,
    position_m: [f64; 3],
    velocity_in_m_s: [f64; 3],
    velocity_out_m_s: Option<[f64; 3]>,
    covariance_m2: [[f64; 2]; 2],
}

#[derive(Serialize)]
struct NetView {
    height_m: f64,
    sigma_m: f64,
}

#[derive(Serialize)]
struct TrackPointView {
    t_ns: StampNs,
    position_m: [f64; 3],
    velocity_m_s: [f64; 3],
    sigma_m: [f64; 3],
    left_px: Option<[f64; 2]>,
    right_px: Option<[f64; 2]>,
}

#[derive(Serialize)]
struct ResidualView {
    left: Option<f64>,
    right: Option<f64>,
}

/// `null` for a camera that is not there.
#[derive(Serialize)]
struct LostView {
    left: Option<u64>,
    right: Option<u64>,
}

impl From<&Shot> for ShotView {
    fn from(shot: &Shot) -> Self {
        let [left, right] = shot.residual_px;
        Self {
            outcome: shot.outcome.text(),
            launch: shot.launch.as_ref().map(LaunchView::from),
            bounce: shot.bounce.as_ref().map(BounceView::from),
            net: shot.net.map(|net| NetView { height_m: net.height_m, sigma_m: net.sigma_m }),
            track: shot.track.iter().map(TrackPointView::from).collect(),
            residual_px: ResidualView { left, right },
            frames_lost: LostView { left: shot.frames_lost[0], right: shot.frames_lost[1] },
        }
    }
}

impl From<&Launch> for LaunchView {
    fn from(launch: &Launch) -> Self {
        let degrees = |angle_rad: Option<f64>| angle_rad.map(f64::to_degrees);
        let direction = launch.direction.as_ref();
        Self {
            t_ns: launch.t_ns,
            position_m: launch.position_m.coords.into(),
            speed_m_s: launch.velocity_m_s.norm(),
            elevation_deg: degrees(direction.map(|d| d.elevation_rad)),
            azimuth_deg: degrees(direction.map(|d| d.azimuth_rad)),
            spin_rpm: launch.spin.map(|spin| rpm_from_rad_s(spin.backspin_rad_s)),
            sigma: LaunchSigmaView {
                speed_m_s: launch.speed_sigma_m_s,
                elevation_deg: degrees(direction.map(|d| d.elevation_sigma_rad)),
                azimuth_deg: degrees(direction.map(|d| d.azimuth_sigma_rad)),
                spin_rpm: launch.spin.map(|spin| rpm_from_rad_s(spin.sigma_rad_s)),
            },
        }
    }
}

impl From<&Bounce> for BounceView {
    fn from(bounce: &Bounce) -> Self {
        Self {
            t_ns: bounce.t_ns,
            position_m: bounce.position_m.coords.into(),
            velocity_in_m_s: bounce.velocity_in_m_s.into(),
            velocity_out_m_s: bounce.velocity_out_m_s.map(Vector3::into),
            covariance_m2: bounce.covariance_m2,
        }
    }
}

impl From<&TrackPoint> for TrackPointView {
    fn from(point: &TrackPoint) -> Self {
        Self {
            t_ns: point.t_ns,
            position_m: point.position_m.coords.into(),
            velocity_m_s: point.velocity_m_s.into(),
            sigma_m: point.sigma_m.into(),
            left_px: point.left_px.map(pair),
            right_px: point.right_px.map(pair),
        }
    }
}

fn pair(pixel: RawPixel) -> [f64; 2] {
    [pixel.x_px, pixel.y_px]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::launch::Spin;
    use crate::shot::Outcome;
    use nalgebra::Point3;
    use serde_json::{Value, json};

    fn empty_shot() -> Shot {
        Shot {
            outcome: Outcome::TooFewPoints,
            launch: None,
            bounce: None,
            net: None,
            track: Vec::new(),
            residual_px: [None, None],
            clock: None,
            causes: None,
            frames_lost: [Some(3), None],
        }
    }

    #[test]
    fn what_was_not_observed_is_null_and_an_absent_camera_is_empty() {
        let counts = FrameCounts { captured: 157, processed: 156, lost: 1 };
        let text = text_from(&[empty_shot()], [Some(counts), None], None);
        let value: Value = serde_json::from_str(&text).unwrap();
        let expected = json!({
            "schema": "shots/1",
            "frames": {"left": {"captured": 157, "processed": 156, "lost": 1}, "right": {}},
            "clock": {"right_minus_left_ms": null, "sigma_ms": null},
            "shots": [{
                "outcome": "too few points", "launch": null, "bounce": null, "net": null,
                "track": [], "residual_px": {"left": null, "right": null},
                "frames_lost": {"left": 3, "right": null},
            }],
        });
        assert_eq!(value, expected);
    }

    #[test]
    fn degrees_cross_the_border_and_nan_does_not() {
        let direction = crate::launch::Direction {
            elevation_rad: 0.1_f64,
            azimuth_rad: -0.2,
            elevation_sigma_rad: f64::NAN,
            azimuth_sigma_rad: f64::INFINITY,
        };
        let launch = Launch {
            t_ns: 5,
            position_m: Point3::new(0.0, 0.0, 1.0),
            height_sigma_m: 0.05,
            velocity_m_s: Vector3::new(0.0, 3.0, 4.0),
            speed_sigma_m_s: 0.1,
            direction: Some(direction),
            spin: Some(Spin { backspin_rad_s: -std::f64::consts::TAU, sigma_rad_s: 0.5 }),
        };
        let shot = Shot { launch: Some(launch), ..empty_shot() };
        let value: Value = serde_json::from_str(&text_from_shot(&shot, 7)).unwrap();
        let launch = &value["launch"];
        assert_eq!(launch["speed_m_s"], 5.0);
        assert_eq!(launch["elevation_deg"], 0.1_f64.to_degrees());
        assert!((launch["spin_rpm"].as_f64().unwrap() + 60.0).abs() < 1e-9);
        assert_eq!(launch["sigma"]["elevation_deg"], Value::Null);
        assert_eq!(launch["sigma"]["azimuth_deg"], Value::Null);
    }
}

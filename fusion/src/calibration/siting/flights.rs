//! A place in the far half -> a shot that bounces there, and when each camera sees it.
//!
//! The shot leaves the launcher without spin, in still air. Its elevation is that of the thesis'
//! shot, 8.1 degrees, or the least one in steps of 2 above with which it clears the net; its speed
//! follows by the secant method on where [`Reference`] comes down, its azimuth by the place.

use super::seen;
use crate::motion::later_ns;
use crate::rectified::Sighting;
use crate::reference::{Commanded, Reference};
use crate::world::acceleration::Breeze;
use crate::world::ball::{DRAG_COEFFICIENT, Physics};
use crate::world::court::{DOUBLES_HALF_WIDTH_M, NET_CENTER_HEIGHT_M, NET_POST_HEIGHT_M, NET_Y_M};
use crate::world::rebound::HARD_COURT;
use crate::world::rig::Rig;
use nalgebra::{Matrix2, Point3, Vector2};
use shm_layout::{Camera, StampNs};

/// The least elevation, its steps, and the greatest that is tried.
const ELEVATIONS_DEG: [f64; 3] = [8.1, 2.0, 70.0];

/// How far the ball's centre passes above the net's tape at least.
const CLEARANCE_M: f64 = 0.15;

/// A shot comes down this near to its place.
const PLACE_TOLERANCE_M: f64 = 1e-3;

/// Rounds of the secant method; five are usual.
const N_ROUNDS_MAX: usize = 20;

/// What is used of the flight after the bounce, as in [`path`](crate::path).
pub const AFTER_S: f64 = 0.25;

/// The net's posts stand 3 feet outside of the doubles court (ITF Rule 2).
const POST_X_M: f64 = DOUBLES_HALF_WIDTH_M + 0.914;

/// How a shot is watched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watch {
    /// Frames of each camera in a second.
    pub rate_hz: f64,
    /// 1 sigma of a ball's centre, each axis.
    pub noise_px: f64,
    /// Whether a ball is seen through the net.
    pub is_net_clear: bool,
}

/// A shot from the launcher.
pub struct Flight {
    /// From the launch to the bounce, time 0 at the launch.
    pub reference: Reference,
    /// At the launch.
    pub speed_m_s: f64,
    /// At the launch.
    pub elevation_rad: f64,
}

/// What the air does.
#[must_use]
pub fn still() -> Breeze {
    Breeze { drag_coefficient: DRAG_COEFFICIENT, wind_m_s: Vector2::zeros() }
}

/// A shot that bounces at x and y; None if no machine can.
#[must_use]
pub fn to_place(place_m: [f64; 2], launcher_m: Point3<f64>, physics: &Physics) -> Option<Flight> {
    let away = Vector2::from(place_m) - launcher_m.coords.xy();
    let azimuth_rad = away.x.atan2(away.y);
    let [least, step, greatest] = ELEVATIONS_DEG;
    let n_steps = ((greatest - least) / step) as u32;
    (0..=n_steps).find_map(|i| {
        let elevation_rad = (least + f64::from(i) * step).to_radians();
        let shot = |speed_m_s: f64| {
            let command = Commanded::new(speed_m_s, elevation_rad, azimuth_rad, 0.0).ok()?;
            Reference::new(&command, launcher_m, &still(), physics, &HARD_COURT)
        };
        let (reference, speed_m_s) = reaching(away.norm(), shot)?;
        let is_clear = reference.net_height_m? > NET_POST_HEIGHT_M + CLEARANCE_M;
        is_clear.then_some(Flight { reference, speed_m_s, elevation_rad })
    })
}

/// The speed at which a shot goes this far.
fn reaching(far_m: f64, shot: impl Fn(f64) -> Option<Reference>) -> Option<(Reference, f64)> {
    let length_m = |shot: &Reference| {
        (shot.before_bounce.position_m.xy() - shot.launch.position_m.xy()).norm()
    };
    let (mut last_m_s, mut speed_m_s) = (15.0, 22.0);
    let mut last_m = length_m(&shot(last_m_s)?);
    for _ in 0..N_ROUNDS_MAX {
        let reference = shot(speed_m_s)?;
        let flown_m = length_m(&reference);
        if (flown_m - far_m).abs() < PLACE_TOLERANCE_M {
            return Some((reference, speed_m_s));
        }
        let per_m = (speed_m_s - last_m_s) / (flown_m - last_m);
        (last_m_s, last_m) = (speed_m_s, flown_m);
        // The first secants may be far off.
        speed_m_s = (speed_m_s + (far_m - flown_m) * per_m).clamp(0.5 * last_m_s, 2.0 * last_m_s);
    }
    None
}

/// Whether the net stands between a camera and the ball.
#[must_use]
pub fn is_behind_net(camera_m: &Point3<f64>, ball_m: &Point3<f64>) -> bool {
    if ball_m.y <= NET_Y_M || camera_m.y >= NET_Y_M {
        return false;
    }
    let part = (NET_Y_M - camera_m.y) / (ball_m.y - camera_m.y);
    let crossed = camera_m + (ball_m - camera_m) * part;
    let off = crossed.x.abs() / POST_X_M;
    // The tape hangs from the posts to the strap in the middle, nearly straight.
    let tape_m = NET_CENTER_HEIGHT_M + (NET_POST_HEIGHT_M - NET_CENTER_HEIGHT_M) * off;
    off <= 1.0 && crossed.z < tape_m
}

/// Every frame that shows the ball, of both cameras, in order of time; stamps count from the
/// launch. `at` tells where the ball is, up to `until_s`.
pub fn sightings(
    rig: &Rig,
    watch: &Watch,
    at: impl Fn(f64) -> Point3<f64>,
    until_s: f64,
) -> Vec<Sighting> {
    let covariance_px2 = Matrix2::identity() * watch.noise_px.powi(2);
    let centres =
        Camera::BOTH.map(|camera| Point3::from(rig.tracking_from(camera).translation.vector));
    let n_frames = (until_s * watch.rate_hz) as usize + 1;
    let mut all = Vec::new();
    for i in 0..n_frames {
        let t_s = i as f64 / watch.rate_hz;
        let ball_m = at(t_s);
        let t_ns: StampNs = later_ns(0, t_s);
        for camera in Camera::BOTH {
            let is_hidden = !watch.is_net_clear && is_behind_net(&centres[camera.idx()], &ball_m);
            if let Some(raw) = seen(rig, camera, &ball_m).filter(|_| !is_hidden) {
                all.push(Sighting { camera, t_ns, raw, covariance_px2, hidden_px2: 0.0 });
            }
        }
    }
    all
}

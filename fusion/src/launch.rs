//! Flight -> launch: where, how fast, which way and with what spin the ball left.
//!
//! The fitted flight itself, where it passes the launcher's plane if the rig has one, else at the
//! first sighting. Every sigma is that of the unknowns through the derivative of the number.

use crate::flight::Flight;
use crate::flight::model::Instant;
use crate::motion::azimuth_elevation_rad;
use crate::world::rig::Rig;
use nalgebra::{Matrix3, Point3, Vector3};
use shm_layout::StampNs;

/// Longest a ball is flown back. A launcher is nearer; a bounced ball takes longer to go back to
/// it.
const FLY_BACK_MAX_S: f64 = 1.2;

/// How a shot began.
#[derive(Debug, Clone, PartialEq)]
pub struct Launch {
    /// When.
    pub t_ns: StampNs,
    /// The ball's centre, tracking frame.
    pub position_m: Point3<f64>,
    /// 1 sigma of its height.
    pub height_sigma_m: f64,
    /// Tracking frame.
    pub velocity_m_s: Vector3<f64>,
    /// 1 sigma of the speed.
    pub speed_sigma_m_s: f64,
    /// Elevation and azimuth, and their sigmas; None without a court.
    pub direction: Option<Direction>,
    /// How it turned; None where that was not fitted.
    pub spin: Option<Spin>,
}

/// Where a launch points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction {
    /// Above the ground.
    pub elevation_rad: f64,
    /// From +y towards +x.
    pub azimuth_rad: f64,
    /// 1 sigma.
    pub elevation_sigma_rad: f64,
    /// 1 sigma.
    pub azimuth_sigma_rad: f64,
}

/// How a ball turns about the level axis across its flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spin {
    /// Backspin; topspin is negative.
    pub backspin_rad_s: f64,
    /// 1 sigma, with the scatter of lift from ball to ball.
    pub sigma_rad_s: f64,
}

/// The flight at its start; None if it does not come from the launcher's plane.
#[must_use]
pub fn from_flight(flight: &Flight, rig: &Rig) -> Option<Launch> {
    let start = match rig.launcher_in_court_m() {
        Some(launcher) => instant(flight, launcher)?,
        None => flight.at(flight.sightings().first()?),
    };
    let covariance = flight.velocity_covariance(&start);
    let [backspin_rad_s, sigma_rad_s] = flight.backspin_rad_s(&start);
    let Instant { position_m, velocity_m_s, .. } = start;
    let (speed_sigma_m_s, direction) = speed_and_direction(&velocity_m_s, &covariance);
    Some(Launch {
        t_ns: flight.t_ns(&start),
        position_m,
        height_sigma_m: flight.position_covariance_m2(&start)[(2, 2)].sqrt(),
        velocity_m_s,
        speed_sigma_m_s,
        direction: Some(direction),
        spin: Some(Spin { backspin_rad_s, sigma_rad_s }),
    })
}

/// When it passes the launcher's plane; None if it does not come from there.
#[must_use]
pub fn instant(flight: &Flight, launcher_in_court_m: Point3<f64>) -> Option<Instant> {
    flight.passing(1, launcher_in_court_m.y, FLY_BACK_MAX_S)
}

/// Sigma of the speed, and where a velocity points.
#[must_use]
pub fn speed_and_direction(
    velocity_m_s: &Vector3<f64>,
    covariance: &Matrix3<f64>,
) -> (f64, Direction) {
    let sigma_along = |unit: Vector3<f64>| unit.dot(&(covariance * unit)).max(0.0).sqrt();
    let speed_m_s = velocity_m_s.norm();
    let [azimuth_rad, elevation_rad] = azimuth_elevation_rad(velocity_m_s);
    let (sin, cos) = azimuth_rad.sin_cos();
    let (rise, level) = elevation_rad.sin_cos();
    let upwards = Vector3::new(-rise * sin, -rise * cos, level);
    let direction = Direction {
        elevation_rad,
        azimuth_rad,
        elevation_sigma_rad: sigma_along(upwards) / speed_m_s,
        azimuth_sigma_rad: sigma_along(Vector3::new(cos, -sin, 0.0)) / (speed_m_s * level),
    };
    (sigma_along(velocity_m_s / speed_m_s), direction)
}

//! Where cameras could stand, or do -> what they see of the court, and how well they measure there.
//!
//! In this order: [`Site`] (mast height, baseline, tilt, toe-in and lens make a rig), [`coverage`]
//! (what is seen of the ground), [`flights`] (a shot to each place of the far half, and when it is
//! seen), [`sigmas`] (how well the flight fit would know its bounce), [`report`] (all of it, as
//! JSON), [`picture`] (as SVG). Court frame, SI units.
//!
//! What is left out: trees, players, light; a ball in the image is seen in every frame.

pub mod coverage;
pub mod flights;
pub mod picture;
pub mod report;
pub mod sigmas;
#[cfg(test)]
mod tests;

use crate::world::ball::Ball;
use crate::world::camera::Lens;
use crate::world::rig::{Eye, Mounting, Rig, isometry_from};
use nalgebra::{IsometryMatrix3, Point3};
use shm_layout::Camera;
use std::ops::RangeInclusive;

/// Where a machine lets go of the ball if nobody says.
const LAUNCHER_M: [f64; 3] = [0.0, 0.0, 1.0];

/// Two equal cameras on masts, on the near baseline, as far left as right of its middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Of both optical centres.
    pub height_m: f64,
    /// From one to the other.
    pub baseline_m: f64,
    /// Downwards, from level.
    pub tilt_rad: f64,
    /// Each towards the other.
    pub toe_in_rad: f64,
    /// Of both lenses; no distortion.
    pub focal_px: f64,
    /// Width and height.
    pub image_px: [u32; 2],
}

/// Cameras that cannot stand so, or of which nothing can be said.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// A number no site has.
    #[error("{field} is {got}, expected {expected}")]
    Value {
        /// Which.
        field: &'static str,
        /// The value, with its unit.
        got: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// Numbers that make no rig together.
    #[error(transparent)]
    Rig(#[from] crate::Error),
    /// A rig that knows no court.
    #[error(
        "the rig has a [stereo] table, expected position_in_court_m and court_from_camera: without \
         a court nothing can be said of it"
    )]
    NoCourt,
    /// Cameras that look elsewhere.
    #[error(
        "no part of the far half court is seen by both cameras: left sees {:.0} %, right {:.0} % \
         of it; both must look at y of 12 to 24 m", left * 100.0, right * 100.0
    )]
    NothingSeen {
        /// Part of the far half that the left camera sees.
        left: f64,
        /// And the right one.
        right: f64,
    },
    /// A lens whose image has rays of its own only in part.
    #[error(
        "the distortion of the {camera} camera has no inverse at the edge of its image: its \
         numbers hold for the middle alone"
    )]
    Distortion {
        /// Which.
        camera: Camera,
    },
}

impl Site {
    /// The thesis' rig (its section 3.1): 4 m apart, 3.5 m up, 10° down and 6° in, f = 1240 px.
    pub const THESIS: Self = Self {
        height_m: 3.5,
        baseline_m: 4.0,
        tilt_rad: 10.0 * std::f64::consts::PI / 180.0,
        toe_in_rad: 6.0 * std::f64::consts::PI / 180.0,
        focal_px: 1240.0,
        image_px: [640, 480],
    };

    /// Cameras that stand so.
    ///
    /// # Errors
    /// [`Refused::Value`], [`Refused::Rig`].
    pub fn rig(&self) -> Result<Rig, Refused> {
        let Self { height_m, baseline_m, tilt_rad, toe_in_rad, focal_px, image_px } = *self;
        let [tilt_deg, toe_in_deg] = [tilt_rad.to_degrees(), toe_in_rad.to_degrees()];
        let checks: [(_, _, _, RangeInclusive<f64>, _); 5] = [
            ("height", height_m, "m", 0.2..=30.0, "0.2 to 30 m"),
            ("baseline", baseline_m, "m", 0.1..=30.0, "0.1 to 30 m"),
            ("tilt", tilt_deg, "degrees", -30.0..=80.0, "-30 to 80 degrees, downwards"),
            ("toe-in", toe_in_deg, "degrees", -60.0..=60.0, "-60 to 60 degrees"),
            ("focal length", focal_px, "px", 10.0..=1e5, "10 to 100000 px"),
        ];
        for (field, value, unit, range, expected) in checks {
            if !range.contains(&value) {
                return Err(Refused::Value { field, got: format!("{value} {unit}"), expected });
            }
        }
        let center_px = image_px.map(|side| (f64::from(side) - 1.0) / 2.0);
        let lens = Lens::new("camera", image_px, [focal_px; 2], center_px, [0.0; 5])?;
        let eye = Eye { lens, row_time_us: 0.0, exposure_us: 0.0 };
        let pose = |x_m: f64, turn_rad: f64| looking([x_m, 0.0, height_m], tilt_rad, turn_rad);
        let mounting = Mounting::Court {
            court_from_left: pose(-baseline_m / 2.0, toe_in_rad)?,
            court_from_right: pose(baseline_m / 2.0, -toe_in_rad)?,
        };
        Ok(Rig::new([eye; 2], mounting, Ball::default(), Some(Point3::from(LAUNCHER_M)))?)
    }
}

/// A camera that looks along +y, turned to the right and then downwards.
fn looking(
    centre_m: [f64; 3],
    tilt_rad: f64,
    turn_rad: f64,
) -> Result<IsometryMatrix3<f64>, crate::Error> {
    let ((down, level), (right, ahead)) = (tilt_rad.sin_cos(), turn_rad.sin_cos());
    // Columns: the camera's x, y and z in the court.
    let rows = [
        [ahead, -right * down, right * level],
        [-right, -ahead * down, ahead * level],
        [0.0, -level, -down],
    ];
    isometry_from("court_from_camera", rows, "position_in_court_m", centre_m)
}

/// Where the machine of a rig lets go of the ball.
fn launcher_of(rig: &Rig) -> Point3<f64> {
    rig.launcher_in_court_m().unwrap_or(Point3::from(LAUNCHER_M))
}

/// The raw pixel at which a camera sees a point; None outside of its image.
///
/// Far outside, a lens' polynomial turns back and points into the image again. A pixel counts only
/// if its own ray leads to the point.
fn seen(rig: &Rig, camera: Camera, point: &Point3<f64>) -> Option<crate::world::camera::RawPixel> {
    const TOLERANCE: f64 = 1e-6;
    let lens = &rig.eye(camera).lens;
    let in_camera = rig.tracking_from(camera).inverse() * point;
    let raw = lens.raw_from_point(&in_camera)?;
    let [width, height] = lens.image_px().map(f64::from);
    let is_inside =
        (-0.5..width - 0.5).contains(&raw.x_px) && (-0.5..height - 0.5).contains(&raw.y_px);
    if !is_inside {
        return None;
    }
    let ray = lens.ray_from_raw(raw)?;
    (ray - in_camera.coords / in_camera.z).norm().lt(&TOLERANCE).then_some(raw)
}

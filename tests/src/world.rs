//! What a flight depends on besides its launch: ball, air, court surface, fence.
//!
//! Conventions: SI, frame `court`. The defaults are those of the independent render `blender-a`,
//! except for the drag coefficient, which is that of the balls a coach has (0.51 new to 0.55).

use nalgebra::Vector3;

use crate::court::PaintErrors;

/// What the flight depends on besides its launch.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    /// Half the diameter of a ball; ITF type 2: 65.4-68.6 mm across.
    pub ball_radius_m: f64,
    /// ITF type 2: 56.0-59.4 g.
    pub ball_mass_kg: f64,
    /// Mean drag coefficient of the balls in play.
    pub drag_coefficient: f64,
    /// Air: 1.21 at 18 degrees C and sea level.
    pub air_density_kg_m3: f64,
    /// Velocity of the air over the ground.
    pub wind_m_s: Vector3<f64>,
    /// Gravity.
    pub gravity_m_s2: f64,
    /// Sliding friction of the surface; acrylic 0.5-0.6, clay 0.8.
    pub surface_friction: f64,
    /// The fence behind the far baseline.
    pub fence_y_m: f64,
    /// How far the lines were painted from where they belong.
    pub paint_errors_m: PaintErrors,
}

impl Default for World {
    fn default() -> Self {
        Self {
            ball_radius_m: 0.033,
            ball_mass_kg: 0.0577,
            drag_coefficient: 0.53,
            air_density_kg_m3: 1.21,
            wind_m_s: Vector3::zeros(),
            gravity_m_s2: 9.81,
            surface_friction: 0.6,
            fence_y_m: 30.0,
            paint_errors_m: [[0.0; 2]; 9],
        }
    }
}

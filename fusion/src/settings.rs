//! What may be tuned; the defaults suit the reference rig and its workers.

use crate::merged::Waits;
use crate::world::air;

/// How a path is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fit {
    /// Maximum likelihood on raw pixels with drag, lift and bounce ([`crate::flight`]).
    #[default]
    Physics,
    /// The thesis' Eq 26 on triangulated points ([`crate::quadratic`]).
    Quadratic,
}

/// What may be tuned; the defaults suit the reference rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// 1 sigma of a candidate's centre, each axis. Too small and good points miss their gates.
    pub sigma_px: f64,
    /// Rows a pair may be apart, on top of what time and size allow.
    pub row_gate_px: f64,
    /// Least Eq 21 similarity of a pair: 0.2 is a factor of 2.2 in all sizes.
    pub similarity_min: f64,
    /// How long one camera is waited for by the other.
    pub waits: Waits,
    /// How a path is measured.
    pub fit: Fit,
    /// See [`air`].
    pub air_density_kg_m3: f64,
    /// 1 sigma of the ground's height where a ball bounces: how flat the court is and how well the
    /// rig knows it. A millimetre is 2 to 4 along the flight.
    pub ground_sigma_m: f64,
    /// 1 sigma by which light pulls all centres of a ball alike, so that no residual shows it.
    pub bias_sigma_px: f64,
    /// Whether a camera that was found to have turned is believed to stand where it now does; else
    /// that is told, and nothing is done.
    pub refines_rig: bool,
    /// Whether a shot is told as soon as its bounce is sure, most often with the first frame after
    /// it, in place of 40 ms after it. Where it bounced is known as well; of how it went on from
    /// there no more is told than what is expected of a ball, with wide sigmas.
    pub tells_early: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            sigma_px: 0.3,
            row_gate_px: 2.5,
            similarity_min: 0.2,
            waits: Waits::LIVE,
            fit: Fit::Physics,
            air_density_kg_m3: air::DENSITY_KG_M3,
            ground_sigma_m: 2e-4,
            bias_sigma_px: 0.03,
            refines_rig: false,
            tells_early: false,
        }
    }
}

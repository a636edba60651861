//! What a ball machine can be told: never anything else goes out.

use super::{AZIMUTH, BACKSPIN, ELEVATION, SPEED};
use nalgebra::{Point3, Vector4};
use std::ops::RangeInclusive;

/// How a machine's balls differ from each other, told the same: 1 sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Part of the speed.
    pub speed_part: f64,
    /// Of the launch.
    pub elevation_rad: f64,
    /// Of the launch.
    pub azimuth_rad: f64,
    /// Part of the spin.
    pub spin_part: f64,
}

impl Scatter {
    /// As measured on a real machine: 1.5 km/h at 86, landings 0.52 m along and 0.26 m across.
    pub const USUAL: Self =
        Self { speed_part: 0.0174, elevation_rad: 0.003, azimuth_rad: 0.010, spin_part: 0.1 };
}

/// What a machine can be told, and how well it does it.
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    /// Where it lets go of the ball.
    pub launcher_in_court_m: Point3<f64>,
    /// Of the ball when it leaves.
    pub speed_m_s: RangeInclusive<f64>,
    /// Above the ground.
    pub elevation_rad: RangeInclusive<f64>,
    /// From +y towards +x.
    pub azimuth_rad: RangeInclusive<f64>,
    /// Topspin is negative.
    pub backspin_rad_s: RangeInclusive<f64>,
    /// Least distance between the ball and the net's edge.
    pub net_clearance_m: f64,
    /// A first guess; it is learned from there.
    pub scatter: Scatter,
    /// Most that speed (m/s), elevation, azimuth (rad) and spin (rad/s) of the same wanted shot may
    /// be changed from one ball to the next.
    pub step_max: [f64; 4],
}

/// Rounding of a solution that lies on a limit.
const ROUNDING: f64 = 1e-9;

const NAMES: [&str; 4] = ["speed", "elevation", "azimuth", "spin"];

impl Machine {
    /// The thesis' machine: 40 to 110 km/h, 0 to 50 degrees up, 10 degrees aside, 2500 rpm either
    /// way, from 1 m above the centre mark; and 15 cm over the net.
    #[must_use]
    pub fn of_thesis() -> Self {
        let rpm = std::f64::consts::PI / 30.0;
        Self {
            launcher_in_court_m: Point3::new(0.0, 0.0, 1.0),
            speed_m_s: 40.0 / 3.6..=110.0 / 3.6,
            elevation_rad: 0.0..=50_f64.to_radians(),
            azimuth_rad: (-10_f64).to_radians()..=10_f64.to_radians(),
            backspin_rad_s: -2500.0 * rpm..=2500.0 * rpm,
            net_clearance_m: 0.15,
            scatter: Scatter::USUAL,
            step_max: [2.0, 0.05, 0.05, 60.0],
        }
    }

    /// In the order of the settings.
    #[must_use]
    pub fn ranges(&self) -> [&RangeInclusive<f64>; 4] {
        let mut ranges = [&self.speed_m_s; 4];
        ranges[ELEVATION] = &self.elevation_rad;
        ranges[AZIMUTH] = &self.azimuth_rad;
        ranges[BACKSPIN] = &self.backspin_rad_s;
        ranges
    }

    /// Whether settings, and the way they pass the net, are within the limits.
    pub(super) fn allows(&self, settings: &Vector4<f64>, clearance_m: f64) -> bool {
        let is_within = |(range, &value): (&RangeInclusive<f64>, &f64)| {
            (range.start() - ROUNDING..=range.end() + ROUNDING).contains(&value)
        };
        clearance_m >= self.net_clearance_m - ROUNDING
            && self.ranges().into_iter().zip(settings.iter()).all(is_within)
    }

    /// The same machine with other limits, in the order of the settings.
    #[must_use]
    pub fn with_ranges(&self, [speed, elevation, azimuth, spin]: [RangeInclusive<f64>; 4]) -> Self {
        Self {
            speed_m_s: speed,
            elevation_rad: elevation,
            azimuth_rad: azimuth,
            backspin_rad_s: spin,
            ..self.clone()
        }
    }

    /// The nearest settings within the limits.
    #[must_use]
    pub fn clamped(&self, settings: &Vector4<f64>) -> Vector4<f64> {
        let mut clamped = *settings;
        for (value, range) in clamped.iter_mut().zip(self.ranges()) {
            *value = value.clamp(*range.start(), *range.end());
        }
        clamped
    }

    /// Limits that settings stand at, or the net.
    pub(super) fn limits_at(&self, settings: &Vector4<f64>, clearance_m: f64) -> Vec<&'static str> {
        let is_at = |i: usize| {
            let range = self.ranges()[i];
            let near = 1e-6 * (range.end() - range.start());
            settings[i] <= range.start() + near || settings[i] >= range.end() - near
        };
        let mut names: Vec<&str> =
            (SPEED..=BACKSPIN).filter(|&i| is_at(i)).map(|i| NAMES[i]).collect();
        if clearance_m < self.net_clearance_m + 0.01 {
            names.push("net");
        }
        names
    }
}

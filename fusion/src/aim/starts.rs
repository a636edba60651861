//! Where Newton's method begins: parabolas through what is wanted, by a ball without drag that is
//! a little slower.

use super::{Machine, Shape, Wanted};
use crate::world::ball::Physics;
use crate::world::court;
use nalgebra::Vector4;

/// Drag costs a ball about this part of its speed on average.
const SLOWED: f64 = 0.86;

/// Settings to start from: the flat one and the lob where a speed is wanted, else one.
pub(super) fn of(wanted: &Wanted, machine: &Machine, physics: &Physics) -> Vec<Vector4<f64>> {
    let launcher = machine.launcher_in_court_m;
    let way = wanted.landing_m - launcher.coords.xy();
    let (far_m, azimuth_rad) = (way.norm(), way.x.atan2(way.y));
    let drop_m = launcher.z - physics.ball.radius_m();
    let gravity_m_s2 = -physics.gravity_m_s2.z;
    let (mut speed, mut backspin, mut net_m, mut apex_m) = (None, 0.0, None, None);
    for shape in wanted.shapes {
        match shape {
            Shape::SpeedMS(wanted) => speed = Some(wanted),
            Shape::BackspinRadS(wanted) => backspin = wanted,
            Shape::NetHeightM(wanted) => net_m = Some(wanted),
            Shape::ApexM(wanted) => apex_m = Some(wanted),
        }
    }
    let start = |speed: f64, slope: f64| Vector4::new(speed, slope.atan(), azimuth_rad, backspin);
    if let Some(speed) = speed {
        // -drop = far t - (g far² / 2 v²) (1 + t²), with t the tangent of the elevation.
        let bend_m = gravity_m_s2 * far_m * far_m / (2.0 * (SLOWED * speed).powi(2));
        let root = far_m * far_m - 4.0 * bend_m * (bend_m - drop_m);
        let steepest = far_m / (2.0 * bend_m);
        let apart = root.max(0.0).sqrt() / (2.0 * bend_m);
        return vec![start(speed, steepest - apart), start(speed, steepest + apart)];
    }
    let (slope, fall) = if let Some(apex_m) = apex_m {
        let rise_m = (apex_m - launcher.z).max(0.05);
        let up_m_s = (2.0 * gravity_m_s2 * rise_m).sqrt();
        let down_m_s = (2.0 * gravity_m_s2 * (rise_m + drop_m).max(0.0)).sqrt();
        let level_m_s = far_m * gravity_m_s2 / (up_m_s + down_m_s);
        (up_m_s / level_m_s, gravity_m_s2 / (2.0 * level_m_s * level_m_s))
    } else {
        // z = z0 + a x - b x² through the net's plane and the landing.
        let share = (court::NET_Y_M - launcher.y) / way.y;
        let net_far_m = far_m * share;
        let over_m = net_m.unwrap_or(1.5) - launcher.z;
        let fall = (over_m / net_far_m + drop_m / far_m) / (far_m - net_far_m);
        (over_m / net_far_m + fall * net_far_m, fall.max(1e-3))
    };
    let level_m_s = (gravity_m_s2 / (2.0 * fall)).sqrt();
    vec![start(level_m_s * slope.hypot(1.0) / SLOWED, slope)]
}

//! Arc of the first points -> launch: where, how fast and which way the ball left.
//!
//! The arc is read in its middle, where it is known best, and the ball flown back from there: to
//! the launcher's plane if the rig has one, else to the first point seen. (Eq 26 itself, carried
//! back 0.2 s further, is 0.14 m and 1.2 m/s off.) It flies with gravity, drag, and what the arc's
//! own acceleration has beyond these, which is mostly lift: it grows with the speed squared and
//! turns with the ball. (As a constant vector it is metres off for a lob first seen at its top.)

use crate::launch::{Launch, speed_and_direction};
use crate::motion::seconds_between;
use crate::quadratic::arc::Arc;
use crate::world::ball::{Physics, State};
use crate::world::rig::Rig;
use nalgebra::Matrix3;
use shm_layout::StampNs;

/// Longest a ball is flown back. A launcher is nearer; a bounced ball takes longer to go back to
/// it.
const FLY_BACK_MAX_S: f64 = 2.0;

/// 1 sigma, each axis, of the acceleration a ball is flown back with: spin turns it in ways an arc
/// of 0.4 s does not show. Without it elevations of 40 rendered shots scatter 1.5 of their sigmas.
const MODEL_SIGMA_M_S2: f64 = 0.2;

/// The arc in its middle, flown back; None if it does not pass the launcher. The covariance is that
/// of the arc carried back itself, and of what the model leaves out.
#[must_use]
pub fn from_arc(arc: &Arc, first_ns: StampNs, rig: &Rig) -> Option<Launch> {
    let middle = arc.state_at(arc.middle_ns());
    let physics = rig.physics().explaining(&arc.acceleration_m_s2(), &middle.velocity_m_s);
    let launcher = rig.launcher_in_court_m().filter(|_| rig.court_from_left().is_some());
    let back_s = match launcher {
        Some(launcher) => time_to_plane_s(middle, launcher.y, &physics)?,
        None => seconds_between(arc.middle_ns(), first_ns),
    };
    let launched = physics.propagated(middle, back_s);
    let State { position_m, velocity_m_s } = launched;
    let t_ns = arc.middle_ns().saturating_add((back_s * 1e9).round() as StampNs);
    let covariance = arc.covariance_at(t_ns).fixed_view::<3, 3>(3, 3)
        + Matrix3::identity() * (MODEL_SIGMA_M_S2 * back_s).powi(2);
    let (speed_sigma_m_s, direction) = speed_and_direction(&velocity_m_s, &covariance);
    let direction = rig.court_from_left().map(|_| direction);
    let height_sigma_m = arc.covariance_at(t_ns)[(2, 2)].sqrt();
    Some(Launch {
        t_ns,
        position_m,
        height_sigma_m,
        velocity_m_s,
        speed_sigma_m_s,
        direction,
        spin: None,
    })
}

/// When a ball is in the plane y, by Newton; None if it does not go there.
fn time_to_plane_s(state: State, y_m: f64, physics: &Physics) -> Option<f64> {
    let mut time_s = 0.0;
    for _ in 0..10 {
        let there = physics.propagated(state, time_s);
        let step_s = (y_m - there.position_m.y) / there.velocity_m_s.y;
        time_s += step_s;
        if time_s.is_nan() || time_s.abs() > FLY_BACK_MAX_S {
            return None;
        }
        if step_s.abs() < 1e-9 {
            return Some(time_s);
        }
    }
    None
}

//! Shot → the message of the service `shots`, for the controller on the same computer.

use crate::shot::{Outcome, Shot};
use nalgebra::Vector3;

/// The message of a shot. What was not observed is NaN there.
#[must_use]
pub fn from_shot(shot: &Shot, shot_idx: u64) -> shm_layout::Shot {
    let unseen = [f64::NAN; 3];
    let launch = shot.launch.as_ref();
    let direction = launch.and_then(|launch| launch.direction.as_ref());
    let angle = |angle: Option<f64>| angle.unwrap_or(f64::NAN);
    let bounce = shot.bounce.as_ref();
    shm_layout::Shot {
        shot_idx,
        is_measured: u32::from(shot.outcome == Outcome::Measured),
        reserved: 0,
        launch_ns: launch.map_or(0, |launch| launch.t_ns),
        launch_speed_m_s: launch.map_or(f64::NAN, |launch| launch.velocity_m_s.norm()),
        launch_elevation_rad: angle(direction.map(|d| d.elevation_rad)),
        launch_azimuth_rad: angle(direction.map(|d| d.azimuth_rad)),
        launch_backspin_rad_s: angle(launch.and_then(|l| l.spin).map(|s| s.backspin_rad_s)),
        launch_sigma: [
            launch.map_or(f64::NAN, |launch| launch.speed_sigma_m_s),
            angle(direction.map(|d| d.elevation_sigma_rad)),
            angle(direction.map(|d| d.azimuth_sigma_rad)),
            angle(launch.and_then(|l| l.spin).map(|s| s.sigma_rad_s)),
        ],
        bounce_ns: bounce.map_or(0, |bounce| bounce.t_ns),
        bounce_in_court_m: bounce.map_or(unseen, |bounce| bounce.position_m.coords.into()),
        bounce_covariance_m2: bounce.map_or([[f64::NAN; 2]; 2], |bounce| bounce.covariance_m2),
        velocity_in_m_s: bounce.map_or(unseen, |bounce| bounce.velocity_in_m_s.into()),
        velocity_out_m_s: bounce.and_then(|b| b.velocity_out_m_s).map_or(unseen, Vector3::into),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_observed_is_nan_and_never_zero() {
        let shot = Shot {
            outcome: Outcome::TooFewPoints,
            launch: None,
            bounce: None,
            net: None,
            track: Vec::new(),
            residual_px: [None, None],
            clock: None,
            causes: None,
            frames_lost: [None, None],
        };
        let message = from_shot(&shot, 3);
        assert_eq!((message.shot_idx, message.is_measured), (3, 0));
        let numbers = message.bounce_in_court_m.into_iter().chain(message.velocity_out_m_s);
        assert!(numbers.chain([message.launch_speed_m_s]).all(f64::is_nan));
    }
}

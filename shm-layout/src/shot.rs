//! Shot: what fusion measured of one ball, for the controller beside it.

use crate::StampNs;
use iceoryx2::prelude::ZeroCopySend;

/// One measured shot. Court frame, SI units; NaN stands for what was not observed (then its
/// sigma is NaN too), and the stamp beside it says nothing.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("tennis/Shot/2")]
pub struct Shot {
    /// 0, 1, 2 … since fusion started.
    pub shot_idx: u64,
    /// 1 if the whole flight was measured up to a bounce, else 0.
    pub is_measured: u32,
    /// Keeps the size a multiple of eight; always 0.
    pub reserved: u32,
    /// When the ball left the launcher, left camera's clock.
    pub launch_ns: StampNs,
    /// Speed at launch.
    pub launch_speed_m_s: f64,
    /// Angle of the launch above the ground.
    pub launch_elevation_rad: f64,
    /// Angle of the launch from +y towards +x.
    pub launch_azimuth_rad: f64,
    /// Backspin at launch; topspin is negative.
    pub launch_backspin_rad_s: f64,
    /// 1 sigma of speed (m/s), elevation (rad), azimuth (rad), backspin (rad/s).
    pub launch_sigma: [f64; 4],
    /// When the ball touched the ground, left camera's clock.
    pub bounce_ns: StampNs,
    /// Ball's centre at the bounce.
    pub bounce_in_court_m: [f64; 3],
    /// Covariance of x and y of the bounce.
    pub bounce_covariance_m2: [[f64; 2]; 2],
    /// Velocity just before the bounce.
    pub velocity_in_m_s: [f64; 3],
    /// Velocity just after it.
    pub velocity_out_m_s: [f64; 3],
}

const _: () = assert!(size_of::<Shot>() == 200, "no padding may hide in a shared type");

//! Velocities around bounces -> the pace of the court, as the ITF rates it.
//!
//! `CPR = 100 (1 − μ) + 150 (0.81 − e)` with `e = v_z′/|v_z|` and
//! `μ = (v_t − v_t′) / (|v_z| (1 + e))` (ITF CS 01/02; 30 and below is slow, 45 and above is fast).
//! The ITF fires balls without spin at 30 m/s and 16° at the ground at 23 °C and corrects `e` for
//! temperature; a ball machine's shots are slower and steeper. A ball that stops sliding shows less
//! friction than there is, and steep ones do: so only bounces below [`STEEPEST_RAD`] count, and the
//! figure is an estimate of a rating, good for comparing courts and days, not a certificate.

use crate::shot::Bounce;

/// Steepest bounce that counts: 20 degrees; on μ = 0.6 a ball without spin slides all through below
/// 21.
pub const STEEPEST_RAD: f64 = 0.35;

/// A court's pace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// ITF court pace rating.
    pub rating: f64,
    /// 1 sigma of the mean, from the scatter of single bounces.
    pub sigma: f64,
    /// Mean friction and restitution.
    pub friction: f64,
    /// Vertical speed after over before.
    pub restitution: f64,
    /// Bounces that counted.
    pub n: usize,
}

/// From all bounces of a session; None from fewer than two that count.
#[must_use]
pub fn from_bounces<'a>(bounces: impl Iterator<Item = &'a Bounce>) -> Option<Pace> {
    let rated: Vec<[f64; 3]> = bounces.filter_map(rated).collect();
    let n = rated.len();
    let mean = |i: usize| rated.iter().map(|one| one[i]).sum::<f64>() / n as f64;
    let [rating, friction, restitution] = [0, 1, 2].map(mean);
    let square: f64 = rated.iter().map(|one| (one[0] - rating).powi(2)).sum();
    let sigma = (square / (n.saturating_sub(1) * n) as f64).sqrt();
    (n > 1).then_some(Pace { rating, sigma, friction, restitution, n })
}

/// Rating, friction and restitution of one bounce.
fn rated(bounce: &Bounce) -> Option<[f64; 3]> {
    let (before, after) = (bounce.velocity_in_m_s, bounce.velocity_out_m_s?);
    let (fall_m_s, slide_m_s) = (-before.z, before.xy().norm());
    let is_flat = fall_m_s > 0.0 && fall_m_s.atan2(slide_m_s) < STEEPEST_RAD;
    let restitution = after.z / fall_m_s;
    let friction = (slide_m_s - after.xy().norm()) / (fall_m_s * (1.0 + restitution));
    let rating = 100.0 * (1.0 - friction) + 150.0 * (0.81 - restitution);
    (is_flat && rating.is_finite()).then_some([rating, friction, restitution])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    fn bounce(before: [f64; 3], after: [f64; 3]) -> Bounce {
        Bounce {
            t_ns: 0,
            t_sigma_s: None,
            position_m: Point3::origin(),
            covariance_m2: [[0.0; 2]; 2],
            velocity_in_m_s: Vector3::from(before),
            velocity_out_m_s: Some(Vector3::from(after)),
            velocity_sigma_m_s: None,
        }
    }

    #[test]
    fn a_court_of_the_itfs_own_numbers_has_its_rating() {
        // 30 m/s at 16°: 28.84 and 8.27 m/s; μ 0.6 and e 0.8 are 100 · 0.4 + 150 · 0.01 = 41.5.
        let (level, fall) = (30.0 * 16_f64.to_radians().cos(), 30.0 * 16_f64.to_radians().sin());
        let slid = level - 0.6 * fall * 1.8;
        let one = bounce([0.0, level, -fall], [0.0, slid, 0.8 * fall]);
        let steep = bounce([0.0, 10.0, -8.0], [0.0, 7.0, 6.0]);
        let pace = from_bounces([&one, &one, &steep].into_iter()).unwrap();
        assert!((pace.rating - 41.5).abs() < 1e-9 && pace.n == 2, "{pace:?}");
        assert!((pace.friction - 0.6).abs() < 1e-9 && (pace.restitution - 0.8).abs() < 1e-9);
        assert!(from_bounces([&one].into_iter()).is_none());
    }
}

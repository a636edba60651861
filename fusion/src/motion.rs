//! A few consecutive points -> where the ball is, how fast, and where it will be: Eq 24, mended.
//!
//! Eq 24 takes the acceleration from the last three points, which multiplies their noise by 5.5,
//! and adds it once too often (`Vel` already contains `Acc ΔT`). What bends a flight is known well
//! enough: gravity and drag. So only position and velocity are estimated, by weighted least squares
//! over the last [`N_POINTS_MAX`] points: `p(t) = p + v τ + ½ a τ²` with `a` of
//! [`Physics`]; two points predict with a noise gain of 2.2, eight with 0.8. Real times, so gaps do
//! no harm. Forwards and backwards are the same thing.

use crate::points::Point;
use crate::world::ball::{Physics, State};
use nalgebra::{Matrix3, Matrix6, Point3, Vector3, Vector6};
use shm_layout::StampNs;

/// Points a motion is estimated from: 0.09 s at 90 Hz. More would let unknown spin bias it.
pub const N_POINTS_MAX: usize = 8;

/// Error of a prediction that does not grow with time: the centroid of a lit ball.
const UNKNOWN_POSITION_M: f64 = 0.005;

/// Seconds from `reference_ns` to `t_ns`.
#[must_use]
pub fn seconds_between(reference_ns: StampNs, t_ns: StampNs) -> f64 {
    t_ns.saturating_sub(reference_ns) as f64 * 1e-9
}

/// Position and velocity at one time, with covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// The time they hold for: that of the reference point.
    pub t_ns: StampNs,
    /// Position and velocity.
    pub state: State,
    covariance: Matrix6<f64>,
    span_s: f64,
}

impl Motion {
    /// From up to [`N_POINTS_MAX`] points; the first given is the reference (the last token when
    /// looking forwards, the first when looking backwards). None for fewer than two, or two at the
    /// same time.
    #[must_use]
    pub fn from_points<'a>(
        points: impl Iterator<Item = &'a Point>,
        physics: &Physics,
    ) -> Option<Self> {
        let points: Vec<&Point> = points.take(N_POINTS_MAX).collect();
        let (first, last) = (points.first()?, points.last()?);
        let span_s = seconds_between(first.t_ns, last.t_ns);
        if span_s == 0.0 {
            return None;
        }
        let velocity_m_s = (last.position_m - first.position_m) / span_s;
        let acceleration_m_s2 = physics.acceleration_m_s2(&velocity_m_s);
        let mut normal = Matrix6::zeros();
        let mut right_side = Vector6::zeros();
        for point in &points {
            let tau_s = seconds_between(first.t_ns, point.t_ns);
            let position = point.position_m.coords - acceleration_m_s2 * (0.5 * tau_s * tau_s);
            let w = point.information_per_m2;
            let wp = w * position;
            for (row, row_factor) in [(0, 1.0), (3, tau_s)] {
                right_side.fixed_rows_mut::<3>(row).axpy(row_factor, &wp, 1.0);
                for (column, factor) in [(0, row_factor), (3, row_factor * tau_s)] {
                    let mut block = normal.fixed_view_mut::<3, 3>(row, column);
                    block += w * factor;
                }
            }
        }
        let cholesky = normal.cholesky()?;
        let solution = cholesky.solve(&right_side);
        Some(Self {
            t_ns: first.t_ns,
            state: State {
                position_m: Point3::from(solution.fixed_rows::<3>(0).into_owned()),
                velocity_m_s: solution.fixed_rows::<3>(3).into_owned(),
            },
            covariance: cholesky.inverse(),
            span_s: span_s.abs(),
        })
    }

    /// The state at another time, and the covariance of its position with what is not known of the
    /// acceleration.
    #[must_use]
    pub fn predicted(&self, t_ns: StampNs, physics: &Physics) -> (State, Matrix3<f64>) {
        let dt_s = seconds_between(self.t_ns, t_ns);
        let state = physics.propagated(self.state, dt_s);
        let p = self.covariance.fixed_view::<3, 3>(0, 0);
        let pv = self.covariance.fixed_view::<3, 3>(0, 3);
        let v = self.covariance.fixed_view::<3, 3>(3, 3);
        // The points' middle is half their span away from the reference.
        let horizon_s = dt_s.abs() + self.span_s / 2.0;
        let unknown_m = UNKNOWN_POSITION_M + 0.5 * physics.unknown_m_s2 * horizon_s * horizon_s;
        let covariance = p
            + (pv + pv.transpose()) * dt_s
            + v * (dt_s * dt_s)
            + Matrix3::identity() * unknown_m.powi(2);
        (state, covariance)
    }
}

/// Azimuth (from +y towards +x) and elevation (above x-y) of a vector, in the court's axes.
#[must_use]
pub fn azimuth_elevation_rad(vector: &Vector3<f64>) -> [f64; 2] {
    [vector.x.atan2(vector.y), vector.z.atan2(vector.x.hypot(vector.y))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;

    #[test]
    fn exact_points_predict_the_next_exactly() {
        let physics = pretend::reference_rig().physics();
        let points = pretend::exact_points(12);
        for n in 2..=8 {
            let motion = Motion::from_points(points[..n].iter().rev(), &physics).unwrap();
            let (state, _) = motion.predicted(points[n].t_ns, &physics);
            let error_m = (state.position_m - points[n].position_m).norm();
            assert!(error_m < 0.004, "{n} points: {error_m} m");
            let motion = Motion::from_points(points[12 - n..].iter(), &physics).unwrap();
            let (state, _) = motion.predicted(points[11 - n].t_ns, &physics);
            let error_m = (state.position_m - points[11 - n].position_m).norm();
            assert!(error_m < 0.004, "backwards, {n} points: {error_m} m");
        }
    }

    #[test]
    fn noise_gain_is_that_of_the_notes() {
        let physics = pretend::reference_rig().physics();
        for (n, gain) in [(2, 5_f64.sqrt()), (3, 1.53), (8, 0.8)] {
            let mut points = pretend::exact_points(9);
            for point in &mut points {
                point.covariance_m2 = Matrix3::identity();
                point.information_per_m2 = Matrix3::identity();
            }
            let motion = Motion::from_points(points[8 - n..8].iter().rev(), &physics).unwrap();
            let (_, covariance) = motion.predicted(points[8].t_ns, &physics);
            assert!((covariance[(0, 0)].sqrt() - gain).abs() < 0.05, "{n}: {covariance}");
        }
    }

    #[test]
    fn two_points_at_one_time_have_no_motion() {
        let physics = pretend::reference_rig().physics();
        let point = pretend::exact_points(1)[0];
        assert!(Motion::from_points([point, point].iter(), &physics).is_none());
        assert!(Motion::from_points([point].iter(), &physics).is_none());
    }
}

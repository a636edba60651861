//! Points of a part of a flight -> arc: Eq 26, a quadratic in time per axis, with covariance.
//!
//! `x = a_x + b_x t + c_x t² + j_x t³/6`, likewise y and z. All nine coefficients a, b, c come from
//! one weighted least squares, because a triangulated point's errors are not independent by axis:
//! almost all of them lie along the line of sight. Their covariance is scaled by χ² per degree of
//! freedom when above 1.
//!
//! **Third order.** Drag falls with the square of the speed, which no quadratic can follow: fitted
//! to all of a flight (thesis 8.3) Eq 26 lands 4-7 cm off without any noise, and worse when
//! weighted, since the near points then rule. `j` is what drag adds: from the arc's own speed and
//! acceleration and the ball's drag, not fitted, so no noise is added either. What is left at the
//! bounce is millimetres (`flight`, tests).
//!
//! **Short arcs.** Twelve points do not tell an acceleration: Eq 26 alone gave a ball after its
//! bounce a speed up to 6 m/s off. So c is expected where gravity and drag put it, as surely as
//! spin leaves room for ([`Physics::unknown_m_s2`]). Over 0.4 s the points overrule that a
//! hundredfold.
//!
//! **Outliers**: two rounds, each leaving out the points further off than three sigma, sigma being
//! the greater of the expected one and that of the median distance (MAD).

use crate::motion::seconds_between;
use crate::points::Point;
use crate::world::ball::{Physics, State};
use nalgebra::{Matrix3, Point3, SMatrix, SVector, Vector3};
use shm_layout::StampNs;

/// Fewest points of an arc: three fix it, as many again confirm it.
pub const MIN_POINTS: usize = 6;

/// Rounds of leaving out outliers.
const N_ROUNDS: usize = 2;

/// The cubic term is small: each step squares what is left.
const N_NEWTON_STEPS: usize = 4;

/// Mahalanobis distance in 3-D that 99.7 % of good points stay below, as 3 sigma do in 1-D.
const THREE_SIGMA_3D: f64 = 3.76;

/// Median Mahalanobis distance of good points in 3-D.
const MEDIAN_3D: f64 = 1.538;

/// 1 sigma of how far the sunlit side pulls a ball's centre, diameters. It does so alike in every
/// frame and both cameras, so no residual shows it: 40 rendered shots under a low sun from the side
/// were 8 mm off across the flight, all the same way.
const SHADING_SIGMA_DIAMETERS: f64 = 0.1;

/// Covariance of position (first three) and velocity (last three).
pub type StateCovariance = SMatrix<f64, 6, 6>;

/// A quadratic per axis around one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Arc {
    reference_ns: StampNs,
    /// a, b and c, each of x, y, z; time in seconds from the reference.
    coefficients: SVector<f64, 9>,
    /// Third derivative, by drag.
    jerk_m_s3: Vector3<f64>,
    /// 1 sigma, each axis, by which all positions may be off together.
    shading_sigma_m: f64,
    covariance: SMatrix<f64, 9, 9>,
    /// Mahalanobis distance beyond which a point is an outlier.
    distance_max: f64,
}

impl Arc {
    /// Eq 26 through the points; None if they are fewer than [`MIN_POINTS`], outliers left out, or
    /// do not spread in time.
    #[must_use]
    pub fn from_points(points: &[Point], physics: &Physics) -> Option<Self> {
        let (first, last) = (points.first()?, points.last()?);
        let reference_ns = first.t_ns.midpoint(last.t_ns);
        let mut used: Vec<&Point> = points.iter().collect();
        let span_s = seconds_between(first.t_ns, last.t_ns);
        let velocity_m_s = (last.position_m - first.position_m) / span_s;
        let expected_m_s2 = physics.acceleration_m_s2(&velocity_m_s);
        let start = Self {
            shading_sigma_m: SHADING_SIGMA_DIAMETERS * physics.ball.diameter_m,
            reference_ns,
            coefficients: SVector::zeros(),
            jerk_m_s3: Vector3::zeros(),
            covariance: SMatrix::zeros(),
            distance_max: THREE_SIGMA_3D,
        };
        let quadratic = start.fitted(&used, expected_m_s2, physics)?;
        let mut arc = quadratic.refitted(&used, physics)?;
        for _ in 0..N_ROUNDS {
            let mut distances: Vec<f64> = used.iter().map(|point| arc.distance(point)).collect();
            distances.sort_by(f64::total_cmp);
            let median = distances[distances.len() / 2];
            let distance_max = THREE_SIGMA_3D * (median / MEDIAN_3D).max(1.0);
            used = points.iter().filter(|point| arc.distance(point) <= distance_max).collect();
            arc = Self { distance_max, ..arc.refitted(&used, physics)? };
        }
        Some(arc)
    }

    /// The same points or fewer, with acceleration and jerk expected from this arc's velocity.
    fn refitted(&self, points: &[&Point], physics: &Physics) -> Option<Self> {
        let v = self.state_at(self.reference_ns).velocity_m_s;
        let a = self.acceleration_m_s2();
        // d/dt (-k |v| v)
        let speed_m_s = v.norm();
        let jerk_m_s3 = (a * speed_m_s + v * (v.dot(&a) / speed_m_s)) * -physics.drag_per_m();
        let expected_m_s2 = physics.acceleration_m_s2(&v);
        Self { jerk_m_s3, ..self.clone() }.fitted(points, expected_m_s2, physics)
    }

    /// Least squares for the coefficients with this arc's jerk.
    fn fitted(
        &self,
        points: &[&Point],
        expected_m_s2: Vector3<f64>,
        physics: &Physics,
    ) -> Option<Self> {
        if points.len() < MIN_POINTS {
            return None;
        }
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        let mut right_side = SVector::<f64, 9>::zeros();
        let prior = (2.0 / physics.unknown_m_s2).powi(2);
        for axis in 0..3 {
            normal[(6 + axis, 6 + axis)] = prior;
            right_side[6 + axis] = prior * expected_m_s2[axis] / 2.0;
        }
        for point in points {
            let tau_s = seconds_between(self.reference_ns, point.t_ns);
            let design = blocks([1.0, tau_s, tau_s * tau_s]);
            let weighted = design.transpose() * point.information_per_m2;
            normal += weighted * design;
            right_side +=
                weighted * (point.position_m.coords - self.jerk_m_s3 * (tau_s.powi(3) / 6.0));
        }
        let cholesky = normal.cholesky()?;
        let arc = Self {
            coefficients: cholesky.solve(&right_side),
            covariance: cholesky.inverse(),
            ..self.clone()
        };
        let chi2: f64 = points.iter().map(|point| arc.distance(point).powi(2)).sum();
        let n_free = (3 * points.len() - 9) as f64;
        Some(Self { covariance: arc.covariance * (chi2 / n_free).max(1.0), ..arc })
    }

    /// Mahalanobis distance of a point from the arc at its time.
    fn distance(&self, point: &Point) -> f64 {
        let miss = point.position_m - self.state_at(point.t_ns).position_m;
        miss.dot(&(point.information_per_m2 * miss)).max(0.0).sqrt()
    }

    /// Whether a point is too far off to be of this arc.
    #[must_use]
    pub fn is_outlier(&self, point: &Point) -> bool {
        self.distance(point) > self.distance_max
    }

    /// Position and velocity.
    #[must_use]
    pub fn state_at(&self, t_ns: StampNs) -> State {
        let tau_s = seconds_between(self.reference_ns, t_ns);
        let state = state_design(tau_s) * self.coefficients;
        State {
            position_m: Point3::from(
                state.fixed_rows::<3>(0) + self.jerk_m_s3 * (tau_s.powi(3) / 6.0),
            ),
            velocity_m_s: state.fixed_rows::<3>(3) + self.jerk_m_s3 * (tau_s * tau_s / 2.0),
        }
    }

    /// The middle of the points in time, where the arc is known best.
    #[must_use]
    pub fn middle_ns(&self) -> StampNs {
        self.reference_ns
    }

    /// The flight's acceleration in the middle.
    #[must_use]
    pub fn acceleration_m_s2(&self) -> Vector3<f64> {
        self.coefficients.fixed_rows::<3>(6) * 2.0
    }

    /// Covariance of [`Arc::state_at`]: the fit's, and of the position what shading adds.
    #[must_use]
    pub fn covariance_at(&self, t_ns: StampNs) -> StateCovariance {
        let design = state_design(seconds_between(self.reference_ns, t_ns));
        let mut covariance = design * self.covariance * design.transpose();
        for axis in 0..3 {
            covariance[(axis, axis)] += self.shading_sigma_m.powi(2);
        }
        covariance
    }

    /// When a coordinate (0 is x) passes `level_m`, up to two times, earlier first: the roots of
    /// the quadratic, led by Newton to those of the cubic.
    #[must_use]
    pub fn times_at_level(&self, axis: usize, level_m: f64) -> Vec<StampNs> {
        let [a, b, c] = [0, 3, 6].map(|term| self.coefficients[term + axis]);
        let a = a - level_m;
        let root = (b * b - 4.0 * a * c).sqrt();
        // q / c and a / q: neither loses digits when c is small.
        let q = -0.5 * (b + root.copysign(b));
        let j = self.jerk_m_s3[axis];
        let cubic = |start_s: f64| {
            (0..N_NEWTON_STEPS).fold(start_s, |t, _| {
                let value = a + t * (b + t * (c + t * j / 6.0));
                t - value / (b + t * (2.0 * c + t * j / 2.0))
            })
        };
        let mut times_s = [q / c, a / q].map(cubic);
        times_s.sort_by(f64::total_cmp);
        times_s
            .into_iter()
            .filter(|tau_s| tau_s.is_finite() && tau_s.abs() < 10.0)
            .map(|tau_s| self.reference_ns.saturating_add((tau_s * 1e9).round() as StampNs))
            .collect()
    }
}

/// Position and velocity from the coefficients.
fn state_design(tau_s: f64) -> SMatrix<f64, 6, 9> {
    let mut design = SMatrix::<f64, 6, 9>::zeros();
    design.fixed_rows_mut::<3>(0).copy_from(&blocks([1.0, tau_s, tau_s * tau_s]));
    design.fixed_rows_mut::<3>(3).copy_from(&blocks([0.0, 1.0, 2.0 * tau_s]));
    design
}

/// One row block of the design: these factors of a, b and c, the same for every axis.
fn blocks(factors: [f64; 3]) -> SMatrix<f64, 3, 9> {
    let mut matrix = SMatrix::<f64, 3, 9>::zeros();
    for (i, factor) in factors.into_iter().enumerate() {
        matrix.fixed_columns_mut::<3>(3 * i).copy_from(&(Matrix3::identity() * factor));
    }
    matrix
}

/// Covariance of the two coordinates in the plane where the third, `axis`, has a given value: an
/// error along `axis` shifts the crossing along the flight.
#[must_use]
pub fn crossing_covariance(
    covariance: &StateCovariance,
    velocity_m_s: &Vector3<f64>,
    axis: usize,
) -> [[f64; 2]; 2] {
    let others: Vec<usize> = (0..3).filter(|&i| i != axis).collect();
    let mut jacobian = SMatrix::<f64, 2, 3>::zeros();
    for (row, &i) in others.iter().enumerate() {
        jacobian[(row, i)] = 1.0;
        jacobian[(row, axis)] = -velocity_m_s[i] / velocity_m_s[axis];
    }
    let c = jacobian * covariance.fixed_view::<3, 3>(0, 0) * jacobian.transpose();
    [[c[(0, 0)], c[(0, 1)]], [c[(1, 0)], c[(1, 1)]]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;

    /// No drag, and any acceleration is as good as another.
    fn pure_quadratic() -> Physics {
        let mut physics = pretend::reference_rig().physics();
        physics.ball.mass_kg = f64::INFINITY;
        Physics { unknown_m_s2: f64::INFINITY, ..physics }
    }

    /// Points on an exact quadratic.
    fn on_a_quadratic(n: usize) -> Vec<Point> {
        let mut points = pretend::exact_points(n);
        for point in &mut points {
            let t = seconds_between(0, point.t_ns);
            point.position_m = Point3::new(1.0 - t, 20.0 * t - 3.0 * t * t, 2.0 + t - 5.0 * t * t);
        }
        points
    }

    #[test]
    fn a_quadratic_is_found_exactly() {
        let points = on_a_quadratic(40);
        let arc = Arc::from_points(&points, &pure_quadratic()).unwrap();
        for point in &points {
            let state = arc.state_at(point.t_ns);
            assert!((state.position_m - point.position_m).norm() < 1e-9);
            let t = seconds_between(0, point.t_ns);
            assert!((state.velocity_m_s.z - (1.0 - 10.0 * t)).abs() < 1e-8);
        }
        let times = arc.times_at_level(2, 0.033);
        let end_s = (1.0 + (1.0_f64 + 20.0 * 1.967).sqrt()) / 10.0;
        assert!((seconds_between(0, times[1]) - end_s).abs() < 2e-9, "{times:?}");
    }

    #[test]
    fn outliers_are_left_out() {
        let mut points = on_a_quadratic(40);
        for i in [5, 17, 39] {
            points[i].position_m += Vector3::new(0.1, 0.4, 0.2);
        }
        let arc = Arc::from_points(&points, &pure_quadratic()).unwrap();
        for (i, point) in on_a_quadratic(40).iter().enumerate() {
            let error_m = (arc.state_at(point.t_ns).position_m - point.position_m).norm();
            assert!(error_m < 1e-9, "{i}: {error_m} m");
            assert_eq!(arc.is_outlier(&points[i]), [5, 17, 39].contains(&i));
        }
    }

    #[test]
    fn five_points_are_too_few() {
        assert_eq!(Arc::from_points(&on_a_quadratic(5), &pure_quadratic()), None);
        assert_eq!(Arc::from_points(&[on_a_quadratic(1)[0]; 9], &pure_quadratic()), None);
    }

    #[test]
    fn a_height_error_shifts_the_crossing_along_the_flight() {
        let mut covariance = StateCovariance::zeros();
        covariance[(2, 2)] = 0.01;
        let velocity = Vector3::new(0.0, 18.0, -6.0);
        let [[x, _], [_, y]] = crossing_covariance(&covariance, &velocity, 2);
        assert!(x == 0.0 && (y - 0.09).abs() < 1e-12, "{x} {y}");
    }
}

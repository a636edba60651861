//! Causes -> where the ball comes down, with derivatives: the way back from [`crate::causes`].
//!
//! [`Departure`] is also what [`crate::aim`] solves for. Court frame; the physics must be those of
//! a rig that knows the court: without gravity nothing comes down.

use crate::causes::{Cause, CauseColumn, N_CAUSES};
use crate::world::acceleration::{Aloft, Breeze};
use crate::world::ball::Physics;
use crate::world::trajectory::{Here, Trajectory};
use nalgebra::{Point3, SMatrix, SVector, Vector2, Vector3};

/// Derivative of a place on the ground by all causes.
pub type LandingSlope = SMatrix<f64, 2, N_CAUSES>;

/// A ball on its way, and how velocity and spin depend on speed, elevation, azimuth, backspin,
/// sidespin and gyrospin, the first six causes.
pub struct Departure {
    /// At the launcher.
    pub aloft: Aloft,
    d_velocity: SMatrix<f64, 3, 6>,
    d_spin: SMatrix<f64, 3, 6>,
}

impl Departure {
    /// From the first six causes; axes but that of backspin are taken to stay.
    #[must_use]
    pub fn new(
        position_m: Point3<f64>,
        [speed_m_s, elevation, azimuth, back, side, gyro]: [f64; 6],
    ) -> Self {
        let (sin, cos) = elevation.sin_cos();
        let (x, y) = azimuth.sin_cos();
        let direction = Vector3::new(cos * x, cos * y, sin);
        let up = Vector3::new(-sin * x, -sin * y, cos);
        // The level axis to the right of the launch, and how it turns with the azimuth.
        let (right, d_right) = (Vector3::new(y, -x, 0.0), Vector3::new(-x, -y, 0.0));
        let none = Vector3::zeros();
        Self {
            aloft: Aloft {
                position_m,
                velocity_m_s: direction * speed_m_s,
                spin_rad_s: right * back + up * side + direction * gyro,
            },
            d_velocity: SMatrix::from_columns(&[
                direction,
                up * speed_m_s,
                right * (cos * speed_m_s),
                none,
                none,
                none,
            ]),
            d_spin: SMatrix::from_columns(&[none, none, d_right * back, right, up, direction]),
        }
    }

    /// How a place of the flight that follows depends on the six.
    #[must_use]
    pub fn slope(&self, here: &Here) -> SMatrix<f64, 3, 6> {
        here.d_position.fixed_columns::<3>(3) * self.d_velocity
            + here.d_position.fixed_columns::<3>(6) * self.d_spin
    }
}

/// Where a ball comes down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landed {
    /// Its centre, court.
    pub place_m: Vector2<f64>,
    /// By all causes.
    pub d_place: LandingSlope,
    /// How long it flew, s.
    pub flight_s: f64,
}

/// The flight that follows from causes.
struct Flown {
    departure: Departure,
    trajectory: Trajectory,
}

impl Flown {
    fn new(causes: &CauseColumn, plane_y_m: f64, physics: &Physics, lasts_s: Option<f64>) -> Self {
        let value = |cause: Cause| causes[cause.idx()];
        let release_m = Point3::new(value(Cause::ReleaseX), plane_y_m, value(Cause::ReleaseZ));
        let departure = Departure::new(release_m, std::array::from_fn(|i| causes[i]));
        let breeze = Breeze {
            drag_coefficient: value(Cause::Drag),
            wind_m_s: Vector2::new(value(Cause::WindX), value(Cause::WindY)),
        };
        let rise_m_s = departure.aloft.velocity_m_s.z;
        let lasts_s = lasts_s.unwrap_or_else(|| longest_flight_s(rise_m_s, physics));
        let trajectory = Trajectory::new(&departure.aloft, &breeze, physics, 0.0, lasts_s);
        Self { departure, trajectory }
    }

    /// How a place of it depends on all causes.
    fn slope(&self, here: &Here) -> SMatrix<f64, 3, N_CAUSES> {
        let mut d_position = SMatrix::<f64, 3, N_CAUSES>::zeros();
        d_position.fixed_columns_mut::<6>(0).copy_from(&self.departure.slope(here));
        // Columns of the trajectory's own order.
        for (cause, column) in [
            (Cause::Drag, 9),
            (Cause::WindX, 10),
            (Cause::WindY, 11),
            (Cause::ReleaseX, 0),
            (Cause::ReleaseZ, 2),
        ] {
            d_position.set_column(cause.idx(), &here.d_position.column(column));
        }
        d_position
    }
}

/// Where the ball comes down that leaves a plane across the court with these causes; None if it
/// does not within the four seconds of a [`Trajectory`].
#[must_use]
pub fn landed(causes: &CauseColumn, plane_y_m: f64, physics: &Physics) -> Option<Landed> {
    let flown = Flown::new(causes, plane_y_m, physics, None);
    let flight_s = flown.trajectory.time_at_level(2, physics.ball.radius_m(), -1.0, 0.0)?;
    let here = flown.trajectory.place_at(flight_s);
    let d_place = at_level(&here, &flown.slope(&here), 2).fixed_rows::<2>(0).into_owned();
    Some(Landed { place_m: here.position_m.coords.xy(), d_place, flight_s })
}

/// Places of a flight that are looked at.
const N_PLACES: usize = 5;

/// Their coordinates.
pub const N_PASSED: usize = 3 * N_PLACES;

/// Where the ball passes with these causes: its place at every fifth part of a time, court, m; and
/// how that depends on the causes.
#[must_use]
pub fn passed(
    causes: &CauseColumn,
    plane_y_m: f64,
    physics: &Physics,
    flight_s: f64,
) -> (SVector<f64, N_PASSED>, SMatrix<f64, N_PASSED, N_CAUSES>) {
    let flown = Flown::new(causes, plane_y_m, physics, Some(flight_s));
    let mut places = SVector::<f64, N_PASSED>::zeros();
    let mut slopes = SMatrix::<f64, N_PASSED, N_CAUSES>::zeros();
    for k in 0..N_PLACES {
        let here = flown.trajectory.place_at(flight_s * (k + 1) as f64 / N_PLACES as f64);
        places.fixed_rows_mut::<3>(3 * k).copy_from(&here.position_m.coords);
        slopes.fixed_rows_mut::<3>(3 * k).copy_from(&flown.slope(&here));
    }
    (places, slopes)
}

/// How a place moves with anything where one of its coordinates is held.
#[must_use]
pub fn at_level<const N: usize>(
    here: &Here,
    d_position: &SMatrix<f64, 3, N>,
    axis: usize,
) -> SMatrix<f64, 3, N> {
    let d_time = d_position.row(axis) / here.velocity_m_s[axis];
    d_position - here.velocity_m_s * d_time
}

/// Without drag it is in the air for less than this; backspin holds it up half as long again.
#[must_use]
pub fn longest_flight_s(rise_m_s: f64, physics: &Physics) -> f64 {
    let gravity_m_s2 = -physics.gravity_m_s2.z;
    1.5 * (2.0 * rise_m_s.max(0.0) / gravity_m_s2 + 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;

    #[test]
    fn every_derivative_is_that_of_differences() {
        let physics = pretend::reference_rig().physics();
        let causes =
            CauseColumn::from([24.0, 0.2, 0.05, 80.0, 0.0, 0.0, 0.53, 1.0, -1.0, 0.1, 1.0]);
        let here = landed(&causes, 0.2, &physics).unwrap();
        let steps = [0.01, 1e-4, 1e-4, 0.1, 0.1, 0.1, 1e-3, 0.01, 0.01, 1e-3, 1e-3];
        for cause in Cause::ALL {
            let step = steps[cause.idx()];
            let moved = |sign: f64| {
                let mut causes = causes;
                causes[cause.idx()] += sign * step;
                landed(&causes, 0.2, &physics).unwrap().place_m
            };
            let by_difference = (moved(1.0) - moved(-1.0)) / (2.0 * step);
            let off = (by_difference - here.d_place.column(cause.idx())).norm();
            assert!(off < 1e-3 * (1.0 + by_difference.norm()), "{cause:?}: {off}");
        }
    }
}

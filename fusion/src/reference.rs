//! What the ball machine was told -> the flight that should follow; [`difference`] -> how the shot
//! that did differs.
//!
//! From the launcher at the commanded speed, elevation, azimuth and spin, by
//! [`trajectory`](crate::world::trajectory), until the ball touches the ground, and through
//! [`rebound`]. Source: the thesis' Section 2.5 and Appendix B, whose equations are written out in
//! the tests. Without spin they land where this does; with spin, at the same drag, they bend up to
//! 5 % more, for there spin stays. Eq 12's drag grows with spin (tunnel); here it is a constant.
//!
//! Court frame. Azimuth is from +y towards +x, as of [`Direction`](crate::launch::Direction); the
//! spin's axis is level and across the launch, as the thesis has it. The physics must be those of a
//! rig that knows the court: without gravity nothing comes down.

pub mod difference;

pub use difference::Difference;

use crate::flight::unknowns::spin_axes;
use crate::world::acceleration::{Aloft, Breeze, spin_left};
use crate::world::ball::Physics;
use crate::world::court;
use crate::world::rebound::{self, Surface};
use crate::world::trajectory::{STEP_S, Trajectory};
use nalgebra::{Point3, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::RangeInclusive;

/// Halvings that bring the apex to a nanosecond.
const N_HALVINGS: usize = 30;

const SPEEDS_M_S: RangeInclusive<f64> = 1.0..=70.0;
const ELEVATIONS_RAD: RangeInclusive<f64> = -PI / 9.0..=PI / 2.25;
const AZIMUTHS_RAD: RangeInclusive<f64> = -FRAC_PI_2..=FRAC_PI_2;
const BACKSPINS_RAD_S: RangeInclusive<f64> = -600.0..=600.0;

/// A number that no ball machine can be told, or asked for.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("`{field}` is {got}, expected {expected}")]
pub struct Refused {
    /// Which one.
    pub field: &'static str,
    /// Its value.
    pub got: f64,
    /// What would be accepted.
    pub expected: &'static str,
}

/// What the machine was told; each number is finite and one a machine could be told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Commanded {
    speed_m_s: f64,
    elevation_rad: f64,
    azimuth_rad: f64,
    backspin_rad_s: f64,
}

impl Commanded {
    /// Elevation is above the ground, azimuth from +y towards +x; topspin is negative.
    pub fn new(
        speed_m_s: f64,
        elevation_rad: f64,
        azimuth_rad: f64,
        backspin_rad_s: f64,
    ) -> Result<Self, Refused> {
        let elevations = "-0.349 to 1.396 rad (-20 to 80 degrees)";
        let azimuths = "-1.571 to 1.571 rad (-90 to 90 degrees)";
        for (field, got, range, expected) in [
            ("speed_m_s", speed_m_s, SPEEDS_M_S, "1 to 70 m/s"),
            ("elevation_rad", elevation_rad, ELEVATIONS_RAD, elevations),
            ("azimuth_rad", azimuth_rad, AZIMUTHS_RAD, azimuths),
            ("backspin_rad_s", backspin_rad_s, BACKSPINS_RAD_S, "-600 to 600 rad/s"),
        ] {
            // Not a number is in no range.
            if !range.contains(&got) {
                return Err(Refused { field, got, expected });
            }
        }
        Ok(Self { speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s })
    }

    /// Speed (m/s), elevation, azimuth (rad), backspin (rad/s).
    #[must_use]
    pub fn settings(&self) -> [f64; 4] {
        [self.speed_m_s, self.elevation_rad, self.azimuth_rad, self.backspin_rad_s]
    }

    /// Over ground.
    #[must_use]
    pub fn velocity_m_s(&self) -> Vector3<f64> {
        let (rise, level) = self.elevation_rad.sin_cos();
        let (x, y) = self.azimuth_rad.sin_cos();
        Vector3::new(level * x, level * y, rise) * self.speed_m_s
    }

    /// About the level axis to the right of the launch.
    #[must_use]
    pub fn spin_rad_s(&self) -> Vector3<f64> {
        spin_axes(&self.velocity_m_s()).column(1) * self.backspin_rad_s
    }
}

/// The flight that should follow a command: it leaves the launcher at time 0 and comes down.
#[derive(Clone)]
pub struct Reference {
    /// At time 0.
    pub launch: Aloft,
    /// Launch to bounce.
    pub flight_time_s: f64,
    /// The highest place of the flight; the launcher if the ball only falls.
    pub apex_m: Point3<f64>,
    /// The centre above the ground in the net's plane; None if it does not get there in the air.
    pub net_height_m: Option<f64>,
    /// Just before the bounce.
    pub before_bounce: Aloft,
    /// Just after it.
    pub after_bounce: Aloft,
    trajectory: Trajectory,
}

impl Reference {
    /// None if the ball does not come down within the four seconds of a [`Trajectory`].
    #[must_use]
    pub fn new(
        commanded: &Commanded,
        launcher_in_court_m: Point3<f64>,
        breeze: &Breeze,
        physics: &Physics,
        surface: &Surface,
    ) -> Option<Self> {
        let launch = Aloft {
            position_m: launcher_in_court_m,
            velocity_m_s: commanded.velocity_m_s(),
            spin_rad_s: commanded.spin_rad_s(),
        };
        let trajectory = Trajectory::new(&launch, breeze, physics, 0.0, f64::INFINITY);
        let radius_m = physics.ball.radius_m();
        let flight_time_s = trajectory.time_at_level(2, radius_m, -1.0, 0.0)?;
        let before_bounce = ball_at(&trajectory, &launch, flight_time_s);
        let Aloft { position_m, velocity_m_s, spin_rad_s } = before_bounce;
        let (out_m_s, spin_out_rad_s, _) =
            rebound::after(&velocity_m_s, &spin_rad_s, radius_m, surface);
        let mut reference = Self {
            launch,
            flight_time_s,
            apex_m: trajectory.place_at(apex_s(&trajectory, flight_time_s)).position_m,
            net_height_m: None,
            before_bounce,
            after_bounce: Aloft { position_m, velocity_m_s: out_m_s, spin_rad_s: spin_out_rad_s },
            trajectory,
        };
        let net = reference.passing(court::NET_Y_M).filter(|ball| ball.t_s >= 0.0);
        reference.net_height_m = net.map(|ball| ball.aloft.position_m.z);
        Some(reference)
    }

    /// The ball some time after the launch; None before the launch and after the bounce.
    #[must_use]
    pub fn at(&self, t_s: f64) -> Option<Aloft> {
        let is_flying = (0.0..=self.flight_time_s).contains(&t_s);
        is_flying.then(|| ball_at(&self.trajectory, &self.launch, t_s))
    }

    /// `n` places, equally far apart in time, from the launcher to the bounce: a line to draw.
    #[must_use]
    pub fn positions_m(&self, n: usize) -> Vec<Point3<f64>> {
        let step_s = self.flight_time_s / n.saturating_sub(1).max(1) as f64;
        (0..n).map(|i| self.trajectory.place_at(i as f64 * step_s).position_m).collect()
    }

    /// Where it passes a plane across the court on its way to the bounce. Begins a step before the
    /// launch, lest the launcher's own plane be missed by rounding.
    fn passing(&self, y_m: f64) -> Option<Passing> {
        let t_s = self.trajectory.time_at_level(1, y_m, 1.0, -STEP_S)?;
        let aloft = ball_at(&self.trajectory, &self.launch, t_s);
        (t_s < self.flight_time_s).then_some(Passing { t_s, aloft })
    }
}

/// The ball in a plane across the court.
#[derive(Clone, Copy)]
struct Passing {
    t_s: f64,
    aloft: Aloft,
}

fn ball_at(trajectory: &Trajectory, launch: &Aloft, t_s: f64) -> Aloft {
    let here = trajectory.place_at(t_s);
    let spin_rad_s = launch.spin_rad_s * spin_left(t_s);
    Aloft { position_m: here.position_m, velocity_m_s: here.velocity_m_s, spin_rad_s }
}

/// When it is highest, up to a time. A ball that backspin lifts may fall before it rises, so the
/// highest step is looked for first, and the level place next to it then.
pub(crate) fn apex_s(trajectory: &Trajectory, flight_time_s: f64) -> f64 {
    let height_m = |t_s: f64| trajectory.place_at(t_s).position_m.z;
    let times_s = (0..=(flight_time_s / STEP_S) as usize).map(|i| i as f64 * STEP_S);
    let highest_s = times_s
        .max_by(|a_s, b_s| height_m(*a_s).total_cmp(&height_m(*b_s)))
        .expect("a flight has its launch");
    let mut low_s = (highest_s - STEP_S).max(0.0);
    let mut high_s = (highest_s + STEP_S).min(flight_time_s);
    for _ in 0..N_HALVINGS {
        let middle_s = 0.5 * (low_s + high_s);
        let rises = trajectory.place_at(middle_s).velocity_m_s.z > 0.0;
        if rises { low_s = middle_s } else { high_s = middle_s }
    }
    low_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;
    use crate::world::ball::{drag_of_thesis, lift_of_thesis};
    use crate::world::rebound::HARD_COURT;
    use nalgebra::Vector2;

    const LAUNCHER: Point3<f64> = Point3::new(0.0, 0.0, 1.0);

    fn breeze(drag_coefficient: f64, x: f64, y: f64) -> Breeze {
        Breeze { drag_coefficient, wind_m_s: Vector2::new(x, y) }
    }

    /// Speed, elevation and azimuth in degrees, backspin.
    fn commanded([speed_m_s, elevation, azimuth, backspin_rad_s]: [f64; 4]) -> Commanded {
        let (elevation_rad, azimuth_rad) = (elevation.to_radians(), azimuth.to_radians());
        Commanded::new(speed_m_s, elevation_rad, azimuth_rad, backspin_rad_s).unwrap()
    }

    fn flown(command: [f64; 4], breeze: &Breeze) -> Reference {
        let physics = pretend::reference_rig().physics();
        Reference::new(&commanded(command), LAUNCHER, breeze, &physics, &HARD_COURT).unwrap()
    }

    fn landing_m(command: [f64; 4], breeze: &Breeze) -> Vector2<f64> {
        flown(command, breeze).before_bounce.position_m.coords.xy()
    }

    #[test]
    fn a_command_no_machine_can_be_given_is_refused_by_name() {
        let fine = [25.0, 0.1, -0.1, 300.0];
        let make = |v: [f64; 4]| Commanded::new(v[0], v[1], v[2], v[3]);
        assert!(make(fine).is_ok());
        let fields = ["speed_m_s", "elevation_rad", "azimuth_rad", "backspin_rad_s"];
        let limits = [[1.0, 70.0], [-0.349, 1.396], [-1.57, 1.57], [-600.0, 600.0]];
        for (i, (field, [low, high])) in fields.into_iter().zip(limits).enumerate() {
            let with = |value: f64| {
                let mut values = fine;
                values[i] = value;
                make(values)
            };
            assert!(with(low).is_ok() && with(high).is_ok(), "{field}");
            for got in [low - 0.01, high + 0.01, f64::NAN, f64::INFINITY, -f64::INFINITY] {
                let refused = with(got).unwrap_err();
                assert_eq!(refused.field, field);
                assert!(refused.to_string().starts_with(&format!("`{field}` is {got}, expected")));
            }
        }
    }

    #[test]
    fn the_shot_of_section_3_4_lands_about_the_far_baseline() {
        let y_m =
            landing_m([30.0, 8.1, 0.0, 0.0], &breeze(drag_of_thesis(f64::INFINITY), 0.0, 0.0)).y;
        assert!((y_m / court::LENGTH_M - 1.0).abs() < 0.03, "{y_m} m");
    }

    /// Where Appendix B lands, in steps of 0.1 ms (its error: a millimetre). The spin's axis and
    /// speed stay; Eq 11 and 12 follow the ratio of the speeds, unless the drag is held.
    fn appendix_b_m(command: [f64; 4], wind_m_s: Vector2<f64>, drag: Option<f64>) -> Vector2<f64> {
        const STEP_S: f64 = 1e-4;
        let physics = pretend::reference_rig().physics();
        let (mass_kg, radius_m) = (physics.ball.mass_kg, physics.ball.radius_m());
        let half_ad = physics.air_per_m() * mass_kg;
        let (sin, cos) = command[2].to_radians().sin_cos();
        let wind = Vector3::new(wind_m_s.x, wind_m_s.y, 0.0);
        let mut momentum = (commanded(command).velocity_m_s() - wind) * mass_kg;
        let mut x = LAUNCHER.coords;
        while x.z > radius_m {
            let v = momentum / mass_kg;
            let ratio = v.norm() / (command[3] * radius_m).abs();
            let lift = lift_of_thesis(ratio) * if command[3] < 0.0 { -1.0 } else { 1.0 };
            let drag = drag.unwrap_or(drag_of_thesis(ratio));
            let lifted = Vector3::new(-v.z * sin, -v.z * cos, v.xy().norm()) * lift;
            let force = (lifted - v * drag) * (half_ad * v.norm());
            momentum += (force + physics.gravity_m_s2 * mass_kg) * STEP_S;
            x += (momentum / mass_kg + wind) * STEP_S;
        }
        x.xy()
    }

    #[test]
    fn appendix_b_lands_where_the_reference_does() {
        let winds = [(0.0, 0.0), (10.0, 0.0), (-2.0, 3.0)];
        for (azimuth, (x, y)) in [-10.0, 0.0, 20.0].into_iter().flat_map(|a| winds.map(|w| (a, w)))
        {
            let command = [28.0, 9.0, azimuth, 0.0];
            let of_thesis = appendix_b_m(command, Vector2::new(x, y), None);
            let off_m = (landing_m(command, &breeze(0.55, x, y)) - of_thesis).norm();
            assert!(off_m < 0.01, "{azimuth} deg, wind {x} {y}: {off_m} m");
        }
        // With the same drag only the spin's decay is left: over 1.2 s, 5 % of it on average.
        let unspun = appendix_b_m([28.0, 9.0, 5.0, 0.0], Vector2::zeros(), Some(0.6));
        for backspin_rad_s in [-250.0, -100.0, 100.0, 250.0] {
            let command = [28.0, 9.0, 5.0, backspin_rad_s];
            let of_thesis = appendix_b_m(command, Vector2::zeros(), Some(0.6));
            let off_m = (landing_m(command, &breeze(0.6, 0.0, 0.0)) - of_thesis).norm();
            let bent_m = (of_thesis - unspun).norm();
            assert!(off_m < 0.05 * bent_m, "{backspin_rad_s} rad/s: {off_m} m of {bent_m} m");
        }
    }

    #[test]
    fn a_landing_moves_as_the_notes_say() {
        // The design's notes have another integrator, and a shot that goes 20 m; this one goes 6 %
        // farther (what else theirs has is not told), and what moves it acts on the square of its
        // time: 12 %.
        const COMMAND: [f64; 4] = [24.0, 11.6, 0.0, 0.0];
        let still = breeze(0.53, 0.0, 0.0);
        let base_m = landing_m(COMMAND, &still);
        assert!((base_m.y / 20.0 - 1.0).abs() < 0.065 && base_m.x.abs() < 1e-12, "{base_m}");
        let topspin_rad_s = 200.0 * PI / 30.0;
        let faster = [24.24, 11.6, 0.0, 0.0];
        let higher = [24.0, 11.9, 0.0, 0.0];
        let turned = [24.0, 11.6, 0.3, 0.0];
        let topped = [24.0, 11.6, 0.0, -topspin_rad_s];
        for (name, command, breeze, axis, expected_m) in [
            ("speed", faster, still, 1, 0.28),
            ("elevation", higher, still, 1, 0.30),
            ("azimuth", turned, still, 0, 0.105),
            ("topspin", topped, still, 1, -0.64),
            ("headwind", COMMAND, breeze(0.53, 0.0, -1.0), 1, -0.37),
            ("crosswind", COMMAND, breeze(0.53, 1.0, 0.0), 0, 0.19),
            ("drag", COMMAND, breeze(0.53 * 1.05, 0.0, 0.0), 1, -0.21),
        ] {
            let moved_m = (landing_m(command, &breeze) - base_m)[axis];
            assert!((moved_m / expected_m - 1.0).abs() < 0.12, "{name}: {moved_m} m");
        }
    }

    #[test]
    fn a_flight_begins_at_the_launcher_and_ends_on_the_ground() {
        let reference = flown([27.0, 8.0, 3.0, 120.0], &breeze(0.53, 1.0, -1.0));
        let line_m = reference.positions_m(50);
        assert_eq!((line_m.len(), line_m[0]), (50, LAUNCHER));
        let bounce_m = reference.before_bounce.position_m;
        assert!((line_m[49] - bounce_m).norm() < 1e-9 && (bounce_m.z - 0.033).abs() < 1e-9);
        let apex_m = reference.apex_m;
        assert!(line_m.iter().all(|place| place.z <= apex_m.z + 1e-9) && apex_m.z > 1.5);
        let net_m = reference.net_height_m.unwrap();
        let after_net = line_m.iter().position(|place| place.y > court::NET_Y_M).unwrap();
        let [a, b] = [line_m[after_net - 1], line_m[after_net]];
        assert!(net_m > a.z.min(b.z) - 0.01 && net_m < a.z.max(b.z) + 0.01, "{net_m}");
        assert_eq!(reference.at(reference.flight_time_s), Some(reference.before_bounce));
        assert_eq!(reference.at(0.0), Some(reference.launch));
        assert_eq!(
            (reference.at(-0.01), reference.at(reference.flight_time_s + 0.01)),
            (None, None)
        );
        assert!(reference.after_bounce.velocity_m_s.z > 0.0);
        assert!(reference.positions_m(0).is_empty());
    }

    #[test]
    fn a_ball_that_only_falls_is_highest_at_the_launcher_and_misses_the_net() {
        let reference = flown([8.0, -20.0, 0.0, 0.0], &breeze(0.53, 0.0, 0.0));
        assert!((reference.apex_m - LAUNCHER).norm() < 1e-6);
        assert_eq!(reference.net_height_m, None);
    }

    #[test]
    fn a_ball_that_stays_up_is_no_reference() {
        let physics = pretend::reference_rig().physics();
        let still = breeze(0.53, 0.0, 0.0);
        let new = |launcher, breeze| {
            let command = commanded([70.0, 80.0, 0.0, 0.0]);
            Reference::new(&command, launcher, breeze, &physics, &HARD_COURT).is_none()
        };
        assert!(new(LAUNCHER, &still));
        assert!(new(Point3::new(0.0, 0.0, f64::NAN), &still));
    }
}

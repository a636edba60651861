//! Reference, shot -> measured less reference: + is too far, too fast, too high, too much backspin.
//!
//! Sigmas are those of the measurement alone; the reference is as good as its drag and wind are
//! known. Launches are compared in the plane across the court where the measured one is told: the
//! launcher's, or that of the first sighting if the rig does not know the launcher. The thesis'
//! Section 10.2 names this as what a machine's feedback needs.

use super::Reference;
use crate::flight::unknowns::spin_axes;
use crate::launch::Launch;
use crate::motion::{azimuth_elevation_rad, seconds_between};
use crate::shot::{Bounce, Shot, TrackPoint};
use nalgebra::{Matrix2, Vector2, Vector3};

/// Measured less reference, in the unit of the field it stands in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Off {
    /// + is more than commanded.
    pub value: f64,
    /// 1 sigma of the measurement; None where that is not known.
    pub sigma: Option<f64>,
}

/// How far off the ball came down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landing {
    /// x and y: + is too far right, and too long.
    pub off_m: Vector2<f64>,
    /// Of the measured place.
    pub covariance_m2: Matrix2<f64>,
    /// The distance in sigmas of the measurement; by chance one shot in 90 is
    /// beyond 3. None if the covariance has no inverse.
    pub mahalanobis: Option<f64>,
}

/// Measured less reference; None is what the shot did not observe, or where the reference never
/// was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Where it came down, seen or extrapolated as the shot's outcome says.
    pub landing: Option<Landing>,
    /// From the launch to the bounce.
    pub flight_time_s: Option<Off>,
    /// The centre above the ground in the net's plane.
    pub net_height_m: Option<Off>,
    /// Here and below: where the measured flight begins.
    pub launch_speed_m_s: Option<Off>,
    /// Above the ground.
    pub elevation_rad: Option<Off>,
    /// + is to the right.
    pub azimuth_rad: Option<Off>,
    /// Topspin is negative.
    pub backspin_rad_s: Option<Off>,
}

impl Difference {
    /// A launch without a direction, which is one without a court, is in no known place and not
    /// compared.
    #[must_use]
    pub fn new(reference: &Reference, shot: &Shot) -> Self {
        let bounce = shot.bounce.as_ref();
        let start = shot.launch.as_ref().and_then(|launch| {
            Some((launch, launch.direction?, reference.passing(launch.position_m.y)?))
        });
        let off = |value: f64, sigma: f64| Off { value, sigma: Some(sigma) };
        Self {
            landing: bounce.map(|bounce| landing_of(reference, bounce)),
            flight_time_s: start.zip(bounce).map(|((launch, _, there), bounce)| Off {
                value: seconds_between(launch.t_ns, bounce.t_ns)
                    - (reference.flight_time_s - there.t_s),
                sigma: flight_time_sigma_s(launch, &shot.track, bounce),
            }),
            net_height_m: shot
                .net
                .zip(reference.net_height_m)
                .map(|(net, height_m)| off(net.height_m - height_m, net.sigma_m)),
            launch_speed_m_s: start.map(|(launch, _, there)| {
                let more_m_s = launch.velocity_m_s.norm() - there.aloft.velocity_m_s.norm();
                off(more_m_s, launch.speed_sigma_m_s)
            }),
            elevation_rad: start.map(|(_, direction, there)| {
                let [_, elevation_rad] = azimuth_elevation_rad(&there.aloft.velocity_m_s);
                off(direction.elevation_rad - elevation_rad, direction.elevation_sigma_rad)
            }),
            azimuth_rad: start.map(|(_, direction, there)| {
                let [azimuth_rad, _] = azimuth_elevation_rad(&there.aloft.velocity_m_s);
                off(direction.azimuth_rad - azimuth_rad, direction.azimuth_sigma_rad)
            }),
            backspin_rad_s: start.and_then(|(launch, _, there)| {
                let spin = launch.spin?;
                let right = spin_axes(&there.aloft.velocity_m_s).column(1).into_owned();
                let backspin_rad_s = there.aloft.spin_rad_s.dot(&right);
                Some(off(spin.backspin_rad_s - backspin_rad_s, spin.sigma_rad_s))
            }),
        }
    }
}

fn landing_of(reference: &Reference, bounce: &Bounce) -> Landing {
    let off_m = (bounce.position_m - reference.before_bounce.position_m).xy();
    let covariance_m2 = Matrix2::from(bounce.covariance_m2);
    let square = covariance_m2.cholesky().map(|roots| off_m.dot(&roots.solve(&off_m)));
    let mahalanobis = square.map(f64::sqrt).filter(|distance| distance.is_finite());
    Landing { off_m, covariance_m2, mahalanobis }
}

/// A shot does not keep the sigma of its launch's time. It is that of the first sighting's place,
/// and of the speed for as long as the ball was flown back from there, over the speed; as if
/// neither knew of the other nor of the bounce.
fn flight_time_sigma_s(launch: &Launch, track: &[TrackPoint], bounce: &Bounce) -> Option<f64> {
    let first = track.first()?;
    let unseen_s = seconds_between(launch.t_ns, first.t_ns);
    let seen_s = first.sigma_m.y / first.velocity_m_s.y;
    let flown_back_s = unseen_s * launch.speed_sigma_m_s / launch.velocity_m_s.norm();
    Some(Vector3::new(bounce.t_sigma_s?, seen_s, flown_back_s).norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::launch::{Direction, Spin};
    use crate::pretend::{self, POOR_SIGHT, Serve};
    use crate::reference::Commanded;
    use crate::shot::{NetCrossing, Outcome};
    use crate::world::acceleration::Breeze;
    use crate::world::rebound::HARD_COURT;
    use crate::{Fusion, Settings};
    use nalgebra::Point3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn reference() -> Reference {
        let commanded = Commanded::new(27.0, 0.15, 0.05, 150.0).unwrap();
        let breeze = Breeze { drag_coefficient: 0.53, wind_m_s: Vector2::new(1.0, -1.0) };
        let physics = pretend::reference_rig().physics();
        let launcher = Point3::new(0.1, 0.2, 1.0);
        Reference::new(&commanded, launcher, &breeze, &physics, &HARD_COURT).unwrap()
    }

    /// The shot that is the reference itself, told from some time after its launch on.
    fn shot_of(reference: &Reference, from_s: f64) -> Shot {
        let there = reference.at(from_s).unwrap();
        let [azimuth_rad, elevation_rad] = azimuth_elevation_rad(&there.velocity_m_s);
        let ns = |t_s: f64| 1_000_000_000 + (t_s * 1e9).round() as i64;
        let right = spin_axes(&there.velocity_m_s).column(1).into_owned();
        Shot {
            outcome: Outcome::Measured,
            launch: Some(Launch {
                t_ns: ns(from_s),
                position_m: there.position_m,
                height_sigma_m: 0.01,
                velocity_m_s: there.velocity_m_s,
                speed_sigma_m_s: 0.1,
                direction: Some(Direction {
                    elevation_rad,
                    azimuth_rad,
                    elevation_sigma_rad: 0.002,
                    azimuth_sigma_rad: 0.001,
                }),
                spin: Some(Spin {
                    backspin_rad_s: there.spin_rad_s.dot(&right),
                    sigma_rad_s: 20.0,
                }),
            }),
            bounce: Some(Bounce {
                t_ns: ns(reference.flight_time_s),
                t_sigma_s: Some(3e-4),
                position_m: reference.before_bounce.position_m,
                covariance_m2: [[1e-4, 0.0], [0.0, 4e-4]],
                velocity_in_m_s: reference.before_bounce.velocity_m_s,
                velocity_out_m_s: Some(reference.after_bounce.velocity_m_s),
                velocity_sigma_m_s: None,
            }),
            net: Some(NetCrossing { height_m: reference.net_height_m.unwrap(), sigma_m: 0.01 }),
            track: vec![TrackPoint {
                t_ns: ns(from_s + 0.3),
                position_m: there.position_m,
                velocity_m_s: there.velocity_m_s,
                sigma_m: Vector3::repeat(0.02),
                left_px: None,
                right_px: None,
            }],
            residual_px: [None, None],
            clock: None,
            causes: None,
            frames_lost: [Some(0); 2],
        }
    }

    fn offs(d: &Difference) -> [Option<Off>; 6] {
        [
            d.flight_time_s,
            d.net_height_m,
            d.launch_speed_m_s,
            d.elevation_rad,
            d.azimuth_rad,
            d.backspin_rad_s,
        ]
    }

    #[test]
    fn the_reference_differs_from_itself_by_nothing_wherever_it_was_first_seen() {
        let reference = reference();
        for from_s in [0.0, 0.25] {
            let difference = Difference::new(&reference, &shot_of(&reference, from_s));
            for off in offs(&difference) {
                let Off { value, sigma } = off.unwrap();
                assert!(value.abs() < 1e-6 && sigma.unwrap() > 0.0, "{difference:?}");
            }
            let landing = difference.landing.unwrap();
            assert_eq!((landing.off_m, landing.mahalanobis), (Vector2::zeros(), Some(0.0)));
        }
    }

    #[test]
    fn more_than_the_reference_is_positive() {
        let reference = reference();
        let mut shot = shot_of(&reference, 0.0);
        let bounce = shot.bounce.as_mut().unwrap();
        bounce.position_m += Vector3::new(0.03, -0.08, 0.0);
        bounce.t_ns += 20_000_000;
        shot.net.as_mut().unwrap().height_m += 0.1;
        let launch = shot.launch.as_mut().unwrap();
        launch.velocity_m_s *= 1.0 + 0.5 / launch.velocity_m_s.norm();
        launch.direction.as_mut().unwrap().elevation_rad += 0.01;
        launch.direction.as_mut().unwrap().azimuth_rad -= 0.02;
        launch.spin.as_mut().unwrap().backspin_rad_s += 30.0;
        let difference = Difference::new(&reference, &shot);
        let landing = difference.landing.unwrap();
        assert!((landing.off_m - Vector2::new(0.03, -0.08)).norm() < 1e-12);
        // 3 sigma to the right and 4 short.
        assert!((landing.mahalanobis.unwrap() - 5.0).abs() < 1e-9);
        let expected = [0.02, 0.1, 0.5, 0.01, -0.02, 30.0];
        for (off, expected) in offs(&difference).into_iter().zip(expected) {
            assert!((off.unwrap().value - expected).abs() < 1e-6, "{difference:?}");
        }
    }

    #[test]
    fn a_ball_that_does_as_told_differs_by_no_more_than_the_sigmas_say() {
        for seed in 0..10 {
            let rng = &mut ChaCha8Rng::seed_from_u64(seed);
            let serve = Serve { lift_coefficient: 0.0, ..Serve::random(rng, 200_000_000) };
            let Serve { speed_m_s, elevation_rad, azimuth_rad, drag_coefficient, .. } = serve;
            let commanded = Commanded::new(speed_m_s, elevation_rad, azimuth_rad, 0.0).unwrap();
            let breeze = Breeze { drag_coefficient, wind_m_s: Vector2::zeros() };
            let rig = pretend::reference_rig();
            let launcher = rig.launcher_in_court_m().unwrap();
            let reference =
                Reference::new(&commanded, launcher, &breeze, &rig.physics(), &HARD_COURT).unwrap();
            let mut fusion = Fusion::new(rig, Settings::default());
            let (frames, _) = pretend::seen(&[serve], 180, &POOR_SIGHT, seed);
            let mut shots: Vec<Shot> =
                frames.iter().flat_map(|(camera, frame)| fusion.update(*camera, frame)).collect();
            shots.extend(fusion.finish());
            let difference = Difference::new(&reference, &shots[0]);
            // 4 sigma: one of these 70 numbers is beyond in one set of seeds of 200.
            for off in offs(&difference) {
                let Off { value, sigma } = off.unwrap();
                assert!(value.abs() < 4.0 * sigma.unwrap(), "seed {seed}: {difference:?}");
            }
            let landing = difference.landing.unwrap();
            assert!(landing.mahalanobis.unwrap() < 4.0, "seed {seed}: {landing:?}");
        }
    }

    #[test]
    fn what_was_not_observed_has_no_difference() {
        let reference = reference();
        let mut shot = shot_of(&reference, 0.0);
        shot.bounce.as_mut().unwrap().covariance_m2 = [[0.0; 2]; 2];
        shot.bounce.as_mut().unwrap().t_sigma_s = None;
        shot.launch.as_mut().unwrap().spin = None;
        let difference = Difference::new(&reference, &shot);
        assert_eq!(difference.landing.unwrap().mahalanobis, None);
        assert_eq!(difference.flight_time_s.unwrap().sigma, None);
        assert_eq!(difference.backspin_rad_s, None);
        shot.launch.as_mut().unwrap().direction = None;
        assert_eq!(Difference::new(&reference, &shot).launch_speed_m_s, None);
        (shot.bounce, shot.net, shot.launch) = (None, None, None);
        let difference = Difference::new(&reference, &shot);
        assert_eq!((offs(&difference), difference.landing), ([None; 6], None));
    }
}

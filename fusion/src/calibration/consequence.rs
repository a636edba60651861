//! A rig and how wrong it may be -> how far off a bounce near the far baseline is then measured.
//!
//! A reference serve ([`LANDING_Y_M`] deep, from the launcher) is seen by both cameras without
//! noise. How its measured bounce answers a change of the rig is linear,
//! `−(d touch / d unknowns) A⁻¹ B δ`: A is what the sightings and what is known beforehand say of
//! the flight's unknowns, B how its pixels mix these with the rig's numbers
//! ([`evidence::response`]). It is what a fit through the other
//! rig would give (tests), for what physics knows holds against the rig too.
//!
//! Far baseline: x is across, y is along.

use crate::Settings;
use crate::clock::OFFSET_SIGMA_S;
use crate::flight::evidence::{self, SHARED};
use crate::flight::fit;
use crate::flight::fitted::{Fitted, Scene};
use crate::flight::model::{Model, Span};
use crate::flight::unknowns::{Known, Prior, Unknowns};
use crate::motion::later_ns;
use crate::rectified::Sighting;
use crate::world::acceleration::{Aloft, Breeze};
use crate::world::adjustment::{RIG, RigCovariance, RigStep};
use crate::world::ball::{DRAG_COEFFICIENT, Physics};
use crate::world::rebound::{self, HARD_COURT};
use crate::world::rig::Rig;
use crate::world::trajectory::Trajectory;
use nalgebra::{Matrix2, Point3, SMatrix, Vector2, Vector3};
use shm_layout::Camera;

/// Where the reference serve lands.
pub const LANDING_Y_M: f64 = 22.5;

/// Its speed: the thesis' 100 km/h.
const SPEED_M_S: f64 = 27.78;

/// Where it starts if the rig knows no launcher.
const START_M: Point3<f64> = Point3::new(0.0, 0.0, 1.0);

/// What its sightings are worth, and how many there are a second.
const SIGMA_PX: f64 = 0.1;
const RATE_HZ: f64 = 90.0;

/// What is seen of it after its bounce, as [`crate::path`] uses it.
const AFTER_S: f64 = 0.25;

/// Longest flight, and how far it is followed beyond what was seen.
const FLIGHT_MAX_S: f64 = 3.0;
const REACH_S: [f64; 2] = [1.2, 1.5];

/// Fewest sightings before the bounce that measure it.
const N_MIN: usize = 16;

/// Elevations between which the serve's is looked for.
const ELEVATIONS_RAD: [f64; 2] = [0.0, 0.5];

/// What is measured wrongly of a bounce near the far baseline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FarError {
    /// Along the court, 1 sigma.
    pub along_m: f64,
    /// Across the court, 1 sigma.
    pub across_m: f64,
}

/// What a rig that is so sure of its numbers measures wrongly, 1 sigma; None where it knows no
/// court or does not see the far baseline.
#[must_use]
pub fn at_far_baseline(rig: &Rig, covariance: &RigCovariance) -> Option<FarError> {
    let response = Reference::of(rig)?.response(rig)?;
    let off: Matrix2<f64> = response * covariance * response.transpose();
    let [across_m, along_m] = [0, 1].map(|i| off[(i, i)].max(0.0).sqrt());
    Some(FarError { along_m, across_m })
}

/// How far a measured bounce moves, x and y, when the rig's numbers are changed by this and the
/// pixels stay. A camera that has itself moved so moves it the other way. None as before.
#[must_use]
pub fn shifted_by(rig: &Rig, step: &RigStep) -> Option<Vector2<f64>> {
    Some(Reference::of(rig)?.response(rig)? * step)
}

/// A serve that both cameras saw.
struct Reference {
    truth: Unknowns,
    sightings: Vec<Sighting>,
    prior: Prior,
    physics: Physics,
}

impl Reference {
    fn of(rig: &Rig) -> Option<Self> {
        rig.court_from_left()?;
        let physics = rig.physics();
        let truth = landing(&physics, rig.launcher_in_court_m().unwrap_or(START_M))?;
        let span = Span { from_s: -FLIGHT_MAX_S, to_s: FLIGHT_MAX_S, has_bounce: true };
        let model = Model::new(&truth, &physics, &span);
        let touch = model.touch()?;
        let known = Known {
            clock_s: [0.0, OFFSET_SIGMA_S],
            ground_sigma_m: Settings::default().ground_sigma_m,
            out_and_in_m_s: [truth.out_m_s, touch.velocity_m_s],
        };
        let n_back = (FLIGHT_MAX_S * RATE_HZ) as i64;
        let n_on = ((touch.t_s + AFTER_S) * RATE_HZ) as i64;
        let mut sightings = Vec::new();
        for i in -n_back..n_on {
            let t_s = i as f64 / RATE_HZ;
            let position_m = model.place_at(t_s).position_m;
            for camera in Camera::BOTH {
                let raw = rig.raw_from_tracking(camera, &position_m);
                let is_there = position_m.y >= START_M.y.max(start_y_m(rig));
                let lens = &rig.eye(camera).lens;
                let Some(raw) = raw.filter(|raw| is_there && lens.contains(*raw)) else { continue };
                let covariance_px2 = Matrix2::identity() * SIGMA_PX.powi(2);
                let t_ns = later_ns(0, t_s);
                sightings.push(Sighting { camera, t_ns, raw, covariance_px2, hidden_px2: 0.0 });
            }
        }
        let n_before = sightings.iter().filter(|s| s.t_ns < later_ns(0, touch.t_s)).count();
        let prior = Prior::new(&truth, &known);
        (n_before >= N_MIN).then_some(Self { truth, sightings, prior, physics })
    }

    fn scene<'a>(&'a self, rig: &'a Rig) -> Scene<'a> {
        Scene {
            rig,
            physics: &self.physics,
            launcher_m: rig.launcher_in_court_m(),
            has_bounce: true,
            reach_s: REACH_S,
            bias_sigma_px: 0.0,
        }
    }

    /// Derivative of x and y of the measured bounce by the rig's numbers.
    fn response(&self, rig: &Rig) -> Option<SMatrix<f64, 2, RIG>> {
        let (scene, Self { sightings, truth, prior, .. }) = (self.scene(rig), self);
        let fitted: Fitted = fit::bound(sightings, 0, truth, prior, &scene)?;
        let own: SMatrix<f64, _, SHARED> = evidence::response(sightings, &fitted, prior, &scene)?;
        let touch = fitted.model.touch()?;
        let by_own = touch.d_position.fixed_rows::<2>(0);
        Some(by_own * own.fixed_columns::<RIG>(0))
    }
}

fn start_y_m(rig: &Rig) -> f64 {
    rig.launcher_in_court_m().unwrap_or(START_M).y
}

/// A flight that lands [`LANDING_Y_M`] deep, as of half of its time.
fn landing(physics: &Physics, start_m: Point3<f64>) -> Option<Unknowns> {
    let breeze = Breeze { drag_coefficient: DRAG_COEFFICIENT, wind_m_s: Vector2::zeros() };
    let flown = |elevation_rad: f64| {
        let (sin, cos) = elevation_rad.sin_cos();
        let start = Aloft {
            position_m: start_m,
            velocity_m_s: Vector3::new(0.0, cos, sin) * SPEED_M_S,
            spin_rad_s: Vector3::zeros(),
        };
        let flight = Trajectory::new(&start, &breeze, physics, 0.0, FLIGHT_MAX_S);
        let t_s = flight.time_at_level(2, physics.ball.radius_m(), -1.0, 0.0)?;
        Some((flight, t_s))
    };
    let [mut low, mut high] = ELEVATIONS_RAD;
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        let (flight, t_s) = flown(middle)?;
        let is_short = flight.at(t_s).position_m.y < LANDING_Y_M;
        if is_short { low = middle } else { high = middle }
    }
    let (flight, t_s) = flown(low)?;
    let (half, touch) = (flight.at(0.5 * t_s), flight.at(t_s));
    if (touch.position_m.y - LANDING_Y_M).abs() > 1e-3 {
        return None; // from where this launcher stands no such serve gets there
    }
    let radius_m = physics.ball.radius_m();
    let (out_m_s, ..) =
        rebound::after(&touch.velocity_m_s, &Vector3::zeros(), radius_m, &HARD_COURT);
    Some(Unknowns {
        aloft: Aloft {
            position_m: half.position_m,
            velocity_m_s: half.velocity_m_s,
            spin_rad_s: Vector3::zeros(),
        },
        breeze,
        clock_s: 0.0,
        ground_m: 0.0,
        out_m_s,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::noise;
    use crate::pretend;
    use crate::world::adjustment::{CAMERA, OPTICS, name_of};

    /// The bounce of the reference serve, measured with another rig than it was seen with.
    fn really_fitted(seen_with: &Rig, rig: &Rig) -> Vector2<f64> {
        let reference = Reference::of(seen_with).unwrap();
        let (scene, prior) = (reference.scene(rig), &reference.prior);
        // A rough fit takes the noise as it is said, and Student's t pulls harder than Gauss where
        // there is none.
        let noise = [noise::weight(0.0).sqrt(); 2];
        let mut unknowns = reference.truth;
        for _ in 0..5 {
            let start = (&unknowns, noise);
            let fitted = fit::roughly(&reference.sightings, 0, start, prior, &scene).unwrap();
            unknowns = fitted.unknowns;
        }
        let span = Span { from_s: 0.0, to_s: FLIGHT_MAX_S, has_bounce: true };
        let touch_of = |unknowns| *Model::new(unknowns, &reference.physics, &span).touch().unwrap();
        (touch_of(&unknowns).position_m - touch_of(&reference.truth).position_m).xy()
    }

    #[test]
    fn a_step_shifts_the_bounce_as_a_fit_with_the_changed_rig_does() {
        let rig = pretend::reference_rig();
        let turn = OPTICS..OPTICS + 3;
        let centre = OPTICS + 3..OPTICS + 6;
        let sized = |numbers: std::ops::Range<usize>, size| numbers.map(move |i| (i, size));
        let steps = sized(turn, 2e-5).chain(sized(centre, 1e-3)).chain(sized(0..4, 0.1));
        for (i, size) in steps.flat_map(|(i, size)| [(i, size), (i + CAMERA, size)]) {
            let mut step = RigStep::zeros();
            step[i] = size;
            let told_m = shifted_by(&rig, &step).unwrap();
            let found_m = really_fitted(&rig, &rig.adjusted(&step).unwrap());
            let off_m = (told_m - found_m).norm();
            println!("{}: {:.2?} mm", name_of(i), (told_m * 1e3).as_slice());
            assert!(off_m < 0.05 * found_m.norm() + 1e-4, "{}: {told_m} {found_m}", name_of(i));
        }
    }

    #[test]
    fn toe_in_of_a_twentieth_of_a_degree_is_centimetres_along() {
        // 1.08 px of disparity: z² / (f b) · 1.08 = 0.11 m. Gravity, drag and the ground know half.
        let mut step = RigStep::zeros();
        step[OPTICS + 1] = 0.05_f64.to_radians();
        let shift_m = shifted_by(&pretend::reference_rig(), &step).unwrap();
        assert!((0.03..0.11).contains(&shift_m.y.abs()) && shift_m.x.abs() < 0.05, "{shift_m}");
    }

    #[test]
    fn the_sigma_is_that_of_the_steps() {
        let rig = pretend::reference_rig();
        let mut step = RigStep::zeros();
        step[OPTICS + 1] = 1e-4;
        let shift_m = shifted_by(&rig, &step).unwrap();
        let sigma = at_far_baseline(&rig, &(step * step.transpose())).unwrap();
        assert!((sigma.along_m - shift_m.y.abs()).abs() < 1e-9);
        assert!((sigma.across_m - shift_m.x.abs()).abs() < 1e-9);
    }

    #[test]
    fn a_rig_that_sees_no_far_baseline_or_knows_no_court_has_no_answer() {
        let covariance = RigCovariance::identity();
        assert_eq!(at_far_baseline(&pretend::courtless_rig(), &covariance), None);
        let away = pretend::REFERENCE_RIG.replace("0.0, 3.5]", "40.0, 3.5]");
        assert_eq!(at_far_baseline(&away.parse().unwrap(), &covariance), None);
    }
}

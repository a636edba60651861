//! Served balls, and a rig that is nearly right -> the rig, refined, with its covariance.
//!
//! The chain measures every recording with the rig as it is; each flight's evidence
//! ([`crate::flight::evidence`]: reprojection under gravity, drag, lift and a bounce at the height
//! of a radius, its clocks its own) is added to what was known of the rig before ([`Belief`]); the
//! rig moves to where both agree best, and all is measured again, until it stays. This is bundle
//! adjustment with the flights taken out (Schur complement); gravity is the vertical and the scale.
//!
//! **What to expect**: drag, wind and above all lift are not known to a flight, so that gravity is
//! a poor scale: toe-in with a common pitch is hardly told. Thirty serves bring 1 sigma at the far
//! baseline from 0.9 cm to 0.8, from 2.1 to 1.8, and of a rig known to 0.02° and 1 cm each from 5.9
//! cm to 4.8; what is left has a mean square of 0.7 to 1.2 of that (20 rigs each, 0.1 px). Relative
//! pitch and roll come out well. So balls confirm court lines, and do not replace them.
//!
//! **From a rig set up by eye** (`alone`), 20 simulated serves bring a common tilt that is 0.3° and
//! masts that are 5 cm off to bounces 1 to 15 cm off (stated: 30 cm), and fail at a toe-in that is
//! 0.2° off: flights are then seen in pieces.
//!
//! What no flight tells (where the court is along the ground, and which way it points) stays as it
//! was known: [`alone`] holds the left camera's x, y and heading. Flights that are odd beside all
//! others pull no harder than `ODD_SIGMAS`.

use crate::calibration::belief::Belief;
use crate::calibration::consequence;
use crate::flight::evidence::Evidence;
use crate::watch::turn::{News, Story};
use crate::world::adjustment::{OPTICS, RIG, RigCovariance, RigStep, first_of};
use crate::world::rig::Rig;
use crate::{Error, FrameCandidates, Fusion, Outcome, Settings};
use nalgebra::{Matrix3, Vector3};
use shm_layout::Camera;

/// Most rounds of measuring all recordings; three or four are usual.
const N_ROUNDS_MAX: usize = 12;

/// A step that is so small a part of every sigma is the last.
const STEP_MIN: f64 = 0.1;

/// Fewest flights that make a rig.
pub const N_FLIGHTS_MIN: usize = 3;

/// A flight that alone is surer of a turn than this pulls no harder.
const ODD_SIGMAS: f64 = 6.0;

/// 1 sigma of a pose set up by eye, for a start from nothing: a turn (2°), a place.
const ALONE_TURN_RAD: f64 = 0.035;
const ALONE_PLACE_M: f64 = 0.3;

/// 1 sigma of a pose of a rig that does not say: a turn (0.1°), a place.
const UNSAID_TURN_RAD: f64 = 1.7e-3;
const UNSAID_PLACE_M: f64 = 0.03;

/// What both cameras reported, in the order of time.
pub type Recording = Vec<(Camera, FrameCandidates)>;

/// What came of it.
#[derive(Debug, Clone)]
pub struct Refined {
    /// With covariance.
    pub rig: Rig,
    /// Flights of each recording that were used, in the end.
    pub n_flights: Vec<usize>,
    /// RMS distance (both axes) of each camera's sightings from their flights, in the end.
    pub rms_px: [Option<f64>; 2],
    /// Rounds of measuring.
    pub n_rounds: usize,
    /// Whether it stayed in the end.
    pub has_settled: bool,
}

/// Covariance of a rig of which nothing is known but what was seen by eye, and which defines the
/// court by its left camera's x, y and heading.
#[must_use]
pub fn alone(rig: &Rig) -> RigCovariance {
    let mut covariance = posed(ALONE_TURN_RAD, ALONE_PLACE_M);
    let left = first_of(Camera::Left) + OPTICS;
    let up = rig.tracking_from(Camera::Left).rotation.inverse() * Vector3::z();
    let level = (Matrix3::identity() - up * up.transpose()) * ALONE_TURN_RAD.powi(2);
    covariance.fixed_view_mut::<3, 3>(left, left).copy_from(&level);
    for axis in 0..2 {
        covariance[(left + 3 + axis, left + 3 + axis)] = 0.0;
    }
    covariance
}

/// What the rig says of itself, or else that it is about right.
#[must_use]
pub fn prior_of(rig: &Rig) -> RigCovariance {
    rig.covariance().copied().unwrap_or_else(|| posed(UNSAID_TURN_RAD, UNSAID_PLACE_M))
}

fn posed(turn_rad: f64, place_m: f64) -> RigCovariance {
    let mut sigmas = RigStep::zeros();
    for camera in Camera::BOTH {
        let pose = first_of(camera) + OPTICS;
        sigmas.fixed_rows_mut::<3>(pose).fill(turn_rad);
        sigmas.fixed_rows_mut::<3>(pose + 3).fill(place_m);
    }
    RigCovariance::from_diagonal(&sigmas.map(|sigma| sigma * sigma))
}

/// Refines a rig; `prior` is how sure it is before.
///
/// # Errors
/// [`Error::RigValue`] if the rig knows no court, too few flights are measured with it, or they
/// lead nowhere.
pub fn refined(
    rig: &Rig,
    prior: &RigCovariance,
    recordings: &[Recording],
    settings: &Settings,
) -> Result<Refined, Error> {
    if rig.court_from_left().is_none() {
        let expected = "poses in the court, at least by eye";
        return Err(Error::RigMissing { field: "left.position_in_court_m".to_owned(), expected });
    }
    let before = Belief::from_covariance(prior);
    let (mut now, mut belief) = (rig.clone(), before.clone());
    let (mut n_rounds, mut has_settled) = (0, false);
    let mut heard = Heard::default();
    while n_rounds < N_ROUNDS_MAX && !has_settled {
        n_rounds += 1;
        let gates = gates_of(&belief.rig_covariance());
        heard = Heard::of(&now.clone().with_covariance(gates)?, recordings, settings);
        let n_flights: usize = heard.n_flights.iter().sum();
        if n_flights < N_FLIGHTS_MIN {
            return Err(refused(format!("{n_flights} flights measured"), n_rounds));
        }
        let sum = heard.sum(&belief.about(&belief.step()));
        let known = before.about(&rig.step_to(&now));
        belief = known
            .updated(&sum)
            .ok_or_else(|| refused("flights that lead nowhere".to_owned(), n_rounds))?;
        let step = belief.step();
        has_settled = is_small(&now, &step, &belief.rig_covariance());
        now = now.adjusted(&step)?;
    }
    let Heard { n_flights, rms_px, .. } = heard;
    let rig = now.with_covariance(belief.rig_covariance())?;
    Ok(Refined { rig, n_flights, rms_px, n_rounds, has_settled })
}

/// How wrong the rig may be for the chain that measures: with doubt of degrees any spot could be
/// the ball's, and nothing would be one. What is farther off is drawn in round by round.
fn gates_of(covariance: &RigCovariance) -> RigCovariance {
    let most = posed(UNSAID_TURN_RAD, UNSAID_PLACE_M);
    let is_poses = |i: usize| most[(i, i)] > 0.0;
    let is_wide = (0..RIG).any(|i| is_poses(i) && covariance[(i, i)] > most[(i, i)]);
    if is_wide { most } else { *covariance }
}

fn refused(got: String, n_rounds: usize) -> Error {
    Error::RigValue {
        field: "rig".to_owned(),
        got: format!("{got} with it in round {n_rounds}"),
        expected: "a rig that is near enough, and at least 3 flights seen by both cameras",
    }
}

/// Whether a step matters neither at the far baseline nor, if that is not seen, to any number.
fn is_small(rig: &Rig, step: &RigStep, covariance: &RigCovariance) -> bool {
    let far = consequence::at_far_baseline(rig, covariance);
    match consequence::shifted_by(rig, step).zip(far) {
        Some((shift, far)) => shift.norm() < STEP_MIN * far.along_m.hypot(far.across_m),
        None => (0..RIG).all(|i| step[i].abs() <= STEP_MIN * covariance[(i, i)].sqrt()),
    }
}

/// What all recordings say.
#[derive(Default)]
struct Heard {
    evidence: Vec<Evidence>,
    n_flights: Vec<usize>,
    rms_px: [Option<f64>; 2],
}

impl Heard {
    fn of(rig: &Rig, recordings: &[Recording], settings: &Settings) -> Self {
        let mut heard = Self::default();
        let (mut squares, mut n) = ([0.0; 2], [0.0; 2]);
        for recording in recordings {
            let mut fusion = Fusion::new(rig.clone(), *settings);
            let n_before = heard.evidence.len();
            let mut shots = Vec::new();
            for (camera, frame) in recording {
                shots.extend(fusion.update(*camera, frame));
                heard.evidence.extend_from_slice(fusion.evidence());
            }
            shots.extend(fusion.finish());
            heard.evidence.extend_from_slice(fusion.evidence());
            heard.n_flights.push(heard.evidence.len() - n_before);
            for shot in shots.iter().filter(|shot| shot.outcome == Outcome::Measured) {
                for camera in 0..2 {
                    let Some(rms_px) = shot.residual_px[camera] else { continue };
                    squares[camera] += rms_px * rms_px;
                    n[camera] += 1.0;
                }
            }
        }
        heard.rms_px = [0, 1].map(|i| (n[i] > 0.0).then(|| f64::sqrt(squares[i] / n[i])));
        heard
    }

    /// All of it, odd flights less.
    fn sum(&self, belief: &Belief) -> Evidence {
        let mut sum = Evidence::default();
        for flight in &self.evidence {
            let alone = News::new(belief, flight).and_then(|news| news.turn_of(Story::ANY));
            let sigmas = alone.map_or(0.0, |turn| turn.square.sqrt());
            sum.add(&flight.scaled((ODD_SIGMAS / sigmas).min(1.0)));
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend::{self, GOOD_SIGHT, Serve};
    use crate::world::adjustment::CAMERA;
    use nalgebra::Point3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    fn recordings(n: u64) -> Vec<Recording> {
        let recording = |shot| {
            let serve = Serve::random(&mut ChaCha8Rng::seed_from_u64(shot), 100_000_000);
            let serve = Serve { lift_coefficient: 0.0, ..serve };
            pretend::seen(&[serve], 150, &GOOD_SIGHT, shot).0
        };
        (0..n).map(recording).collect()
    }

    /// What a court's line crossings tell of a rig, each known to so many pixels in both cameras.
    fn by_court(rig: &Rig, sigma_px: f64) -> RigCovariance {
        let mut evidence = Evidence::default();
        let across_m = [-5.485, -4.115, 0.0, 4.115, 5.485];
        let places = [11.885, 18.285, 23.77].into_iter().flat_map(|y| across_m.map(|x| (x, y)));
        for (x, y) in places {
            for camera in Camera::BOTH {
                let place = Point3::new(x, y, 0.0);
                let (raw, slope) = rig.raw_and_slope_by_camera(camera, &place).unwrap();
                if rig.eye(camera).lens.contains(raw) {
                    let first = first_of(camera);
                    let mut part =
                        evidence.information.fixed_view_mut::<CAMERA, CAMERA>(first, first);
                    part += slope.transpose() * slope / sigma_px.powi(2);
                }
            }
        }
        let before = Belief::from_covariance(&posed(ALONE_TURN_RAD, ALONE_PLACE_M));
        before.updated(&evidence).unwrap().rig_covariance()
    }

    /// Refines rigs drawn from a covariance; the mean square of what is then left at the far
    /// baseline, along and across, in its sigmas, and the sigma along before and after.
    fn refined_from(prior: &RigCovariance, n_rigs: u64, n_flights: u64) -> ([f64; 2], [f64; 2]) {
        let exact = pretend::reference_rig();
        let settings = Settings { sigma_px: 0.1, ..Settings::default() };
        let recordings = recordings(n_flights);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let axes = nalgebra::SymmetricEigen::new(*prior);
        let sizes = axes.eigenvalues.map(|v| v.max(0.0).sqrt());
        let before = consequence::at_far_baseline(&exact, prior).unwrap();
        let (mut squares, mut along_m) = ([0.0; 2], 0.0);
        for _ in 0..n_rigs {
            let drawn = sizes.map(|size| size * normal.sample(&mut rng));
            let rig = exact.adjusted(&(axes.eigenvectors * drawn)).unwrap();
            let refined = refined(&rig, prior, &recordings, &settings).unwrap();
            assert!(refined.has_settled, "{refined:?}");
            let covariance = refined.rig.covariance().unwrap();
            let now = consequence::at_far_baseline(&exact, covariance).unwrap();
            let off_m = consequence::shifted_by(&exact, &exact.step_to(&refined.rig)).unwrap();
            let sigmas = [off_m.y / now.along_m, off_m.x / now.across_m];
            squares = [0, 1].map(|i| squares[i] + sigmas[i] * sigmas[i] / n_rigs as f64);
            along_m = now.along_m;
        }
        println!("mean square {squares:.2?}, along {:.4} -> {along_m:.4} m", before.along_m);
        (squares, [before.along_m, along_m])
    }

    #[test]
    fn thirty_balls_refine_what_lines_say_to_less_than_a_centimetre() {
        // Crossings to 0.3 px are three times worse than what `calibrate court` finds.
        let prior = by_court(&pretend::reference_rig(), 0.3);
        let (squares, [before_m, now_m]) = refined_from(&prior, 6, 30);
        // Six squares scatter by 0.6.
        assert!(squares.iter().all(|square| (0.1..2.5).contains(square)), "{squares:?}");
        assert!(now_m < 0.95 * before_m && now_m < 0.01, "{now_m} of {before_m}");
    }

    #[test]
    fn no_flights_and_no_court_are_refused_by_name() {
        let (rig, settings) = (pretend::reference_rig(), Settings::default());
        let empty = refined(&rig, &prior_of(&rig), &[Recording::new()], &settings);
        assert!(empty.unwrap_err().to_string().contains("0 flights measured"));
        let courtless = pretend::courtless_rig();
        let error = refined(&courtless, &prior_of(&courtless), &[], &settings).unwrap_err();
        assert!(error.to_string().contains("left.position_in_court_m"), "{error}");
    }

    #[test]
    fn from_nothing_the_left_camera_holds_the_court() {
        let rig = pretend::reference_rig();
        let covariance = alone(&rig);
        let up = rig.tracking_from(Camera::Left).rotation.inverse() * Vector3::z();
        let turn = covariance.fixed_view::<3, 3>(OPTICS, OPTICS);
        assert!((turn * up).norm() < 1e-12, "no doubt about its heading");
        assert_eq!((covariance[(12, 12)], covariance[(13, 13)]), (0.0, 0.0));
        assert!(covariance[(14, 14)] > 0.0);
    }
}

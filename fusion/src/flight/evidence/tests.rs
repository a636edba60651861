//! Laws of [`super`].

use super::*;
use crate::flight::unknowns::{Known, Unknowns};
use crate::pretend;
use crate::world::acceleration::{Aloft, Breeze};
use crate::world::adjustment::{OPTICS, RigCovariance, RigStep, name_of};
use crate::world::rig::Rig;
use nalgebra::{Matrix2, Point3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use shm_layout::Camera;

fn truth() -> Unknowns {
    Unknowns {
        aloft: Aloft {
            position_m: Point3::new(0.1, 14.0, 2.0),
            velocity_m_s: Vector3::new(0.4, 21.0, -1.5),
            spin_rad_s: Vector3::new(-120.0, 5.0, 10.0),
        },
        breeze: Breeze { drag_coefficient: 0.52, wind_m_s: Vector2::new(0.3, -0.5) },
        clock_s: 0.0,
        ground_m: 0.0,
        out_m_s: Vector3::new(0.3, 13.0, 4.1),
    }
}

const SIGMA_PX: f64 = 0.1;

/// One flight with its sightings, as two cameras saw it.
struct Flown {
    sightings: Vec<Sighting>,
    prior: Prior,
}

impl Flown {
    fn seen_by(rig: &Rig, noise_seed: u64) -> Self {
        let truth = truth();
        let known = Known {
            clock_s: [0.0, 1e-3],
            ground_sigma_m: 2e-4,
            out_and_in_m_s: [truth.out_m_s, Vector3::new(0.3, 19.0, -6.0)],
        };
        let prior = Prior::new(&truth, &known);
        let physics = rig.physics();
        let span = crate::flight::model::Span { from_s: -0.4, to_s: 0.7, has_bounce: true };
        let model = crate::flight::model::Model::new(&truth, &physics, &span);
        let mut rng = ChaCha8Rng::seed_from_u64(noise_seed);
        let normal = Normal::new(0.0, SIGMA_PX).unwrap();
        let mut sightings = Vec::new();
        for i in -30..55 {
            for camera in Camera::BOTH {
                let t_ns = i * pretend::PERIOD_NS;
                let at = model.place_at(t_ns as f64 * 1e-9).position_m;
                let mut raw = rig.raw_from_tracking(camera, &at).unwrap();
                raw.x_px += normal.sample(&mut rng);
                raw.y_px += normal.sample(&mut rng);
                let covariance_px2 = Matrix2::identity() * SIGMA_PX.powi(2);
                sightings.push(Sighting { camera, t_ns, raw, covariance_px2, hidden_px2: 0.0 });
            }
        }
        Self { sightings, prior }
    }

    /// Of all unknowns, under Gaussian noise, from a flight near it.
    fn least_cost(&self, mut fitted: Fitted, scene: &Scene) -> f64 {
        let (sightings, prior) = (&self.sightings[..], &self.prior);
        for _ in 0..8 {
            let sums = Sums::of(sightings, &fitted, prior, scene).unwrap();
            let covariance = fit::inverse(&(sums.known + sums.own)).unwrap();
            let step = -(covariance * (sums.known_gradient + sums.own_pull));
            fitted.unknowns = fitted.unknowns.plus(&step);
        }
        let Fitted { reference_ns, unknowns, noise, .. } = fitted;
        let fit = Fit { sightings, reference_ns, prior, scene, noise, spread: 1.0 };
        let model = fit.model_to_launcher(&unknowns);
        let squares = sightings.iter().map(|s| {
            let (_, off) = slope_and_off(s, fitted.time_s(s), &model, scene.rig).unwrap();
            off.norm_squared() / (SIGMA_PX * noise[s.camera.idx()]).powi(2)
        });
        prior.cost(&unknowns) + 0.5 * squares.sum::<f64>()
    }

    fn fitted(&self, rig: &Rig) -> Fitted {
        with_scene(rig, |scene| {
            let start = (&truth(), [1.0; 2]);
            fit::from_sightings(&self.sightings, 0, start, &self.prior, scene).unwrap()
        })
    }
}

fn with_scene<T>(rig: &Rig, run: impl Fn(&Scene) -> T) -> T {
    let physics = rig.physics();
    let launcher_m = None;
    let (has_bounce, reach_s, bias_sigma_px) = (true, [1.2, 1.5], 0.0);
    run(&Scene { rig, physics: &physics, launcher_m, has_bounce, reach_s, bias_sigma_px })
}

#[test]
fn the_gradient_is_the_derivative_of_the_least_cost() {
    let rig = pretend::reference_rig();
    let flown = Flown::seen_by(&rig, 3);
    let fitted = flown.fitted(&rig);
    let found = with_scene(&rig, |scene| {
        let sums = Sums::of(&flown.sightings, &fitted, &flown.prior, scene).unwrap();
        sums.reduced(1.0).unwrap()
    });
    let least = |step: &RigStep| {
        let rig = rig.adjusted(step).unwrap();
        with_scene(&rig, |scene| flown.least_cost(fitted.clone(), scene))
    };
    let turn = OPTICS..OPTICS + 6;
    let numbers = turn.clone().chain(turn.map(|i| i + CAMERA)).chain([0, 2, 3, CAMERA, CAMERA + 4]);
    let cost = least(&RigStep::zeros());
    for i in numbers {
        let size = 0.3 / found.information[(i, i)].sqrt();
        let mut step = RigStep::zeros();
        step[i] = size;
        let (plus, minus) = (least(&step), least(&-step));
        let gradient = (plus - minus) / (2.0 * size);
        let curvature = (plus + minus - 2.0 * cost) / (size * size);
        let unit = found.information[(i, i)].sqrt();
        let off = (gradient - found.gradient[i]) / unit;
        assert!(off.abs() < 0.02, "{}: {off} of {}", name_of(i), gradient / unit);
        let ratio = curvature / found.information[(i, i)];
        assert!((0.9..1.1).contains(&ratio), "{}: {ratio}", name_of(i));
    }
}

#[test]
fn what_many_flights_say_is_the_turn_that_was_made_and_its_sigma_is_honest() {
    let rig = pretend::reference_rig();
    let i = CAMERA + OPTICS;
    let mut squares = 0.0;
    let n_rounds = 40;
    for seed in 0..n_rounds {
        let mut step = RigStep::zeros();
        step[i] = 2e-5;
        let turned = rig.adjusted(&step).unwrap();
        let flown = Flown::seen_by(&turned, seed);
        let fitted = flown.fitted(&rig);
        let evidence = with_scene(&rig, |scene| {
            of_flight(&flown.sightings, &fitted, &flown.prior, scene).unwrap()
        });
        let told = -evidence.gradient[i] / evidence.information[(i, i)];
        let sigma = evidence.information[(i, i)].powf(-0.5);
        assert!(sigma < 3e-5, "{sigma}");
        squares += ((told - 2e-5) / sigma).powi(2) / n_rounds as f64;
    }
    // 40 squares scatter by 0.22.
    assert!((0.5..1.6).contains(&squares), "{squares}");
}

#[test]
fn a_doubt_about_the_rig_is_in_the_covariance_and_honest() {
    let exact = pretend::reference_rig();
    let mut sigmas = RigStep::zeros();
    for camera in Camera::BOTH {
        let pose = first_of(camera) + OPTICS;
        sigmas.fixed_rows_mut::<3>(pose).fill(1.5e-4);
        sigmas.fixed_rows_mut::<3>(pose + 3).fill(5e-3);
        sigmas.fixed_rows_mut::<2>(first_of(camera)).fill(1.0);
    }
    let covariance = RigCovariance::from_diagonal(&sigmas.map(|s| s * s));
    let n_rounds = 150;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let normal = Normal::new(0.0, 1.0).unwrap();
    let (mut squares, mut blind) = (0.0, 0.0);
    let flat = |covariance: &Covariance, touch: &crate::flight::model::Instant| {
        let slope = touch.d_position.fixed_rows::<2>(0).into_owned();
        slope * covariance * slope.transpose()
    };
    let span = crate::flight::model::Span { from_s: -0.4, to_s: 0.7, has_bounce: true };
    let model = crate::flight::model::Model::new(&truth(), &exact.physics(), &span);
    let true_m = model.touch().unwrap().position_m;
    for seed in 0..n_rounds {
        let flown = Flown::seen_by(&exact, seed);
        let step = sigmas.map(|s| s * normal.sample(&mut rng));
        let rig = exact.adjusted(&step).unwrap();
        for (sum, rig) in [
            (&mut blind, rig.clone()),
            (&mut squares, rig.clone().with_covariance(covariance).unwrap()),
        ] {
            let fitted = flown.fitted(&rig);
            let touch = fitted.model.touch().unwrap();
            let off_m = (touch.position_m - true_m).xy();
            let inverse = flat(&fitted.covariance, touch).try_inverse().unwrap();
            *sum += off_m.dot(&(inverse * off_m)) / (2.0 * n_rounds as f64);
        }
    }
    println!("mean square {squares:.2}, without the doubt {blind:.1}");
    // 300 squares scatter by 0.08.
    assert!((0.6..1.3).contains(&squares), "{squares}");
    assert!(blind > 3.0, "{blind}: the doubt matters");
}

#[test]
fn a_turn_that_only_the_bounce_shows_is_told_in_full() {
    // 0.05° of toe-in: what it does gathers in a few sightings, 5 sigmas and more.
    let rig = pretend::reference_rig();
    let (i, turn_rad) = (OPTICS + 1, 8.7e-4);
    let told = |turn_rad: f64| {
        let mut step = RigStep::zeros();
        step[i] = turn_rad;
        let flown = Flown::seen_by(&rig.adjusted(&step).unwrap(), 1);
        let fitted = flown.fitted(&rig);
        let evidence = with_scene(&rig, |scene| {
            of_flight(&flown.sightings, &fitted, &flown.prior, scene).unwrap()
        });
        -evidence.gradient[i] / evidence.information[(i, i)]
    };
    let ratio = (told(turn_rad) - told(0.0)) / turn_rad;
    assert!((0.7..1.2).contains(&ratio), "{ratio}");
}

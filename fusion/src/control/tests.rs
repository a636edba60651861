//! A machine that is not there, whose balls tell as much as those of the reference rig do.

mod dead;

use super::*;
use crate::Settings;
use crate::aim::Shape;
use crate::causes::{CauseMatrix, Causes, N_CAUSES};
use crate::pretend::{self, GOOD_SIGHT, THESIS_SERVE};
use crate::shot::Bounce;
use crate::world::rebound::HARD_COURT;
use nalgebra::{Point3, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::sync::OnceLock;

/// What a flight of the reference rig at 0.1 px tells.
fn information() -> CauseMatrix {
    static INFORMATION: OnceLock<CauseMatrix> = OnceLock::new();
    *INFORMATION.get_or_init(|| {
        let serve = pretend::Serve { launch_ns: 100_000_000, ..THESIS_SERVE };
        let (frames, _) = pretend::seen(&[serve], 150, &GOOD_SIGHT, 1);
        let settings = Settings { sigma_px: 0.1, ..Settings::default() };
        let (_, shots) = pretend::told(pretend::reference_rig(), settings, &frames);
        shots[0].causes.unwrap().information
    })
}

/// A machine, its balls and the wind.
pub(crate) struct Court {
    rng: ChaCha8Rng,
    /// Part of the speed, rad, rad, part of the spin.
    bias: [f64; 4],
    scatter: Scatter,
    drag: f64,
    wind_m_s: Vector2<f64>,
    gust_m_s: f64,
}

impl Court {
    pub(crate) fn new(seed: u64, scatter: Scatter) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            bias: [0.05, 0.026, 0.0175, -0.1],
            scatter,
            drag: 0.5,
            wind_m_s: Vector2::new(-1.0, 1.5),
            gust_m_s: 0.5,
        }
    }

    fn normal(&mut self, sigma: f64) -> f64 {
        let unit: f64 = self.rng.sample(StandardNormal);
        unit * sigma
    }

    /// What comes of settings in the mean.
    fn mean(&self, settings: &[f64; 4]) -> CauseColumn {
        let [speed, elevation, azimuth, spin] = *settings;
        let [by_speed, by_elevation, by_azimuth, by_spin] = self.bias;
        CauseColumn::from([
            speed * (1.0 + by_speed),
            elevation + by_elevation,
            azimuth + by_azimuth,
            spin * (1.0 + by_spin),
            0.0,
            0.0,
            self.drag,
            self.wind_m_s.x,
            self.wind_m_s.y,
            0.0,
            1.0,
        ])
    }

    /// How far the mean of such balls lands from where it should.
    fn mean_off_m(&self, aimed: &Aimed) -> f64 {
        let causes = self.mean(&aimed.commanded.settings());
        let landing = landed(&causes, 0.0, &pretend::reference_rig().physics()).unwrap();
        (landing.place_m - aimed.wanted.landing_m()).norm()
    }

    /// A ball as told.
    pub(crate) fn fired(&mut self, aimed: &Aimed) -> Shot {
        let mut causes = self.mean(&aimed.commanded.settings());
        let Scatter { speed_part, elevation_rad, azimuth_rad, spin_part } = self.scatter;
        let gust_m_s = self.gust_m_s;
        let sigmas = [
            speed_part * causes[0],
            elevation_rad,
            azimuth_rad,
            spin_part * causes[3].abs(),
            0.0,
            0.0,
            0.02,
            gust_m_s,
            gust_m_s,
        ];
        for (i, sigma) in sigmas.into_iter().enumerate() {
            causes[i] += self.normal(sigma);
        }
        self.seen(&causes)
    }

    /// A dead ball as told.
    fn fired_dead(&mut self, aimed: &Aimed) -> Shot {
        let alive = self.bias[0];
        self.bias[0] -= 0.15;
        let shot = self.fired(aimed);
        self.bias[0] = alive;
        shot
    }

    /// A flight with these causes as it is measured.
    fn seen(&mut self, causes: &CauseColumn) -> Shot {
        let information = information();
        let eigen = information.symmetric_eigen();
        let mut likely = *causes;
        for i in 0..N_CAUSES {
            let value = eigen.eigenvalues[i];
            if value > 1e-12 * eigen.eigenvalues.max() {
                likely += eigen.eigenvectors.column(i) * self.normal(value.powf(-0.5));
            }
        }
        let landing = landed(causes, 0.0, &pretend::reference_rig().physics()).unwrap();
        let [x, y] = [landing.place_m.x, landing.place_m.y].map(|v| v + self.normal(0.005));
        Shot {
            outcome: Outcome::Measured,
            launch: None,
            bounce: Some(Bounce {
                t_ns: 0,
                t_sigma_s: None,
                position_m: Point3::new(x, y, 0.033),
                covariance_m2: [[2.5e-5, 0.0], [0.0, 2.5e-5]],
                velocity_in_m_s: Vector3::zeros(),
                velocity_out_m_s: None,
                velocity_sigma_m_s: None,
            }),
            net: None,
            track: Vec::new(),
            residual_px: [None; 2],
            clock: None,
            causes: Some(Causes { fitted: likely, likely, information }),
            frames_lost: [None; 2],
        }
    }
}

pub(crate) fn control(scatter: Scatter) -> Control {
    let machine = Machine { scatter, ..Machine::of_thesis() };
    Control::new(machine, pretend::reference_rig().physics(), HARD_COURT)
}

/// Deep and short, left and right, slow and fast, with and without spin.
pub(crate) fn targets() -> Vec<Wanted> {
    let machine = Machine::of_thesis();
    let spin = |rpm: f64| Some(Shape::BackspinRadS(rpm * std::f64::consts::PI / 30.0));
    [
        (-2.0, 21.5, Shape::SpeedMS(25.0), spin(0.0)),
        (2.0, 21.5, Shape::SpeedMS(24.0), spin(-800.0)),
        (-1.5, 18.0, Shape::SpeedMS(20.0), spin(0.0)),
        (1.5, 18.0, Shape::SpeedMS(21.0), spin(600.0)),
        (0.0, 20.0, Shape::SpeedMS(22.0), spin(-1200.0)),
        (0.0, 22.0, Shape::SpeedMS(19.5), spin(0.0)),
    ]
    .into_iter()
    .map(|(x, y, first, second)| Wanted::new(Vector2::new(x, y), first, second, &machine).unwrap())
    .collect()
}

const PRECISE: Scatter =
    Scatter { speed_part: 0.003, elevation_rad: 0.0014, azimuth_rad: 0.0014, spin_part: 0.02 };

/// Root mean square over targets of the mean's distance.
fn off_m(control: &Control, court: &Court, targets: &[Wanted]) -> f64 {
    let squares: f64 = targets
        .iter()
        .map(|wanted| match control.preview(wanted) {
            Ok(aimed) => court.mean_off_m(&aimed).powi(2),
            Err(out) => court.mean_off_m(&out.nearest.unwrap()).powi(2),
        })
        .sum();
    (squares / targets.len() as f64).sqrt()
}

/// Plays balls; gives out how far off the mean is after each.
fn played(
    control: &mut Control,
    court: &mut Court,
    n_balls: usize,
    mut each: impl FnMut(&Aimed, &Correction),
) -> Vec<f64> {
    let targets = targets();
    (0..n_balls)
        .map(|_| {
            let wanted = targets[court.rng.random_range(0..targets.len())];
            let aimed = control.aimed(&wanted).unwrap_or_else(|out| out.nearest.unwrap());
            let shot = court.fired(&aimed);
            let correction = control.update(&aimed, &shot);
            each(&aimed, &correction);
            off_m(control, court, &targets)
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn a_biased_machine_hits_its_targets_as_soon_as_its_scatter_allows() {
    // What is wanted of the mean after so many balls: m.
    for (name, scatter, wanted) in [
        ("precise", PRECISE, [(3, 0.20), (7, 0.10)]),
        ("usual", Scatter::USUAL, [(5, 0.28), (20, 0.14)]),
    ] {
        let sessions: Vec<Vec<f64>> = (0..24)
            .map(|seed| {
                let mut court = Court::new(seed, scatter);
                played(&mut control(scatter), &mut court, 20, |_, _| ())
            })
            .collect();
        let after = |n: usize| median(sessions.iter().map(|offs| offs[n - 1]).collect());
        let all: Vec<f64> = (1..=20).map(after).collect();
        println!("{name}: {all:.2?}");
        for (n, most_m) in wanted {
            assert!(after(n) < most_m, "{name}: {} m after {n}", after(n));
        }
    }
}

#[test]
fn the_parts_sum_to_the_miss_and_little_is_left_over() {
    let mut court = Court::new(5, Scatter::USUAL);
    let mut control = control(Scatter::USUAL);
    let mut rests = Vec::new();
    played(&mut control, &mut court, 30, |_, correction| {
        println!("{}", correction.sentence);
        let sum: Vector2<f64> = correction.parts.iter().map(|part| part.off_m).sum();
        assert!((sum - correction.miss_m.unwrap()).norm() < 1e-12);
        rests.push(correction.parts.last().unwrap().off_m.norm());
    });
    assert!(median(rests.clone()) < 0.05, "{rests:.3?}");
}

#[test]
fn a_step_of_the_wind_is_followed_within_five_balls() {
    for (name, scatter) in [("precise", PRECISE), ("usual", Scatter::USUAL)] {
        let mut after = vec![Vec::new(); 5];
        let (mut before, mut at_once) = (Vec::new(), Vec::new());
        for seed in 0..24 {
            let mut court = Court::new(100 + seed, scatter);
            let mut control = control(scatter);
            before.push(*played(&mut control, &mut court, 15, |_, _| ()).last().unwrap());
            court.wind_m_s.y -= 3.0;
            at_once.push(off_m(&control, &court, &targets()));
            for (k, off) in played(&mut control, &mut court, 5, |_, _| ()).into_iter().enumerate() {
                after[k].push(off);
            }
        }
        let after: Vec<f64> = after.into_iter().map(median).collect();
        let (before, at_once) = (median(before), median(at_once));
        println!("{name}: {before:.2} m, the wind turns: {at_once:.2}, then {after:.2?}");
        assert!(after[4] < 0.3 * at_once, "{name}: {after:.2?}");
    }
}

#[test]
fn a_gust_is_not_chased() {
    let mut worse = Vec::new();
    for seed in 0..24 {
        let mut court = Court::new(200 + seed, PRECISE);
        let mut control = control(PRECISE);
        let before = *played(&mut control, &mut court, 12, |_, _| ()).last().unwrap();
        court.wind_m_s.y += 3.0;
        played(&mut control, &mut court, 1, |_, _| ());
        court.wind_m_s.y -= 3.0;
        let offs = played(&mut control, &mut court, 2, |_, _| ());
        worse.push(offs[1] - before);
    }
    let second = median(worse.clone());
    println!("after a gust of 3 m/s (1.1 m) and an ordinary ball: {second:+.2} m");
    assert!(second < 0.1, "{worse:.2?}");
}

#[test]
fn nothing_goes_beyond_the_limits_whatever_is_believed() {
    let machine = Machine::of_thesis();
    let ranges = machine.ranges().map(Clone::clone);
    let mut control = control(Scatter::USUAL);
    let mut court = Court::new(9, Scatter::USUAL);
    court.bias = [-0.25, -0.15, 0.15, 0.0];
    let wanted = Wanted::new(
        Vector2::new(3.6, 23.5),
        Shape::SpeedMS(30.0),
        Some(Shape::BackspinRadS(-250.0)),
        &machine,
    );
    let wanted = wanted.unwrap();
    let mut last: Option<[f64; 4]> = None;
    let mut n_refused = 0;
    for _ in 0..25 {
        let aimed = match control.aimed(&wanted) {
            Ok(aimed) => aimed,
            Err(out) => {
                n_refused += 1;
                out.nearest.unwrap()
            }
        };
        let settings = aimed.commanded.settings();
        for (range, value) in ranges.iter().zip(settings) {
            assert!(range.contains(&value), "{value} of {range:?}");
        }
        if let Some(last) = last {
            for i in 0..4 {
                let step = (settings[i] - last[i]).abs();
                assert!(step <= machine.step_max[i] + 1e-9 || n_refused > 0, "{step}");
            }
        }
        last = Some(settings);
        let shot = court.fired(&aimed);
        control.update(&aimed, &shot);
    }
    assert!(n_refused > 0, "30 m/s with a machine that is 25 % slow");
}

#[test]
fn a_shot_that_is_not_trusted_changes_nothing() {
    let mut control = control(Scatter::USUAL);
    let mut court = Court::new(3, Scatter::USUAL);
    let aimed = control.aimed(&targets()[0]).unwrap();
    let shot = court.fired(&aimed);
    let before = control.belief().mean();
    control.distrust(Some("the left camera has turned"));
    let correction = control.update(&aimed, &shot);
    assert_eq!(correction.trust, Trust::Distrusted("the left camera has turned"));
    assert!(correction.sentence.contains("the left camera has turned"), "{}", correction.sentence);
    control.distrust(None);
    let blind = Shot { outcome: Outcome::OneCamera, ..shot.clone() };
    assert_eq!(control.update(&aimed, &blind).trust, Trust::NotMeasured(Outcome::OneCamera));
    assert_eq!(control.belief().mean(), before);
    assert_eq!(control.update(&aimed, &shot).trust, Trust::Used);
    assert_ne!(control.belief().mean(), before);
}

#[test]
fn wind_and_drag_are_known_after_twenty_balls() {
    let (mut squares, mut stated) = ([0.0; 3], [0.0; 3]);
    let n_sessions = 24;
    for seed in 0..n_sessions {
        let mut court = Court::new(300 + seed, Scatter::USUAL);
        let mut control = control(Scatter::USUAL);
        played(&mut control, &mut court, 20, |_, _| ());
        let (mean, covariance) = (control.belief().mean(), control.belief().covariance());
        let truth = [court.drag, court.wind_m_s.x, court.wind_m_s.y];
        for i in 0..3 {
            squares[i] += (mean[DRAG + i] - truth[i]).powi(2) / n_sessions as f64;
            stated[i] += covariance[(DRAG + i, DRAG + i)] / n_sessions as f64;
        }
    }
    let rms = squares.map(f64::sqrt);
    let stated = stated.map(f64::sqrt);
    println!("drag, wind x, wind y off: {rms:.3?}, stated {stated:.3?}");
    assert!(rms[0] / 0.5 < 0.05 && rms[1] < 0.7 && rms[2] < 0.7, "{rms:?}");
    for i in 0..3 {
        assert!((0.5..1.6).contains(&(rms[i] / stated[i])), "{rms:?} {stated:?}");
    }
}

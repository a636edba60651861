//! `cargo bench -p fusion`: how long it takes to aim, and to learn from a ball.
//!
//! Medians and the slowest of a thousand, on whatever machine this is; a ball comes every three
//! seconds.

use fusion::aim::{Conditions, Machine, Shape, Wanted, aim};
use fusion::causes::{CauseColumn, CauseMatrix, Causes};
use fusion::control::actuators;
use fusion::control::belief::Belief;
use fusion::world::acceleration::Breeze;
use fusion::world::ball::{Ball, Physics};
use fusion::world::rebound::HARD_COURT;
use nalgebra::{Vector2, Vector3, Vector4};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::time::Instant;

const N: usize = 1000;

fn main() {
    let machine = Machine::of_thesis();
    let physics = Physics {
        ball: Ball::default(),
        air_density_kg_m3: 1.2,
        gravity_m_s2: Vector3::new(0.0, 0.0, -9.81),
        excess_per_m: [0.0; 3],
        unknown_m_s2: 0.0,
    };
    let breeze = Breeze { drag_coefficient: 0.53, wind_m_s: Vector2::new(1.0, -1.0) };
    let conditions = Conditions { breeze: &breeze, physics: &physics, surface: &HARD_COURT };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (mut n_hit, mut hit_ms, mut missed_ms) = (0, Vec::new(), Vec::new());
    for _ in 0..N {
        let landing = Vector2::new(rng.random_range(-3.5..3.5), rng.random_range(16.0..23.5));
        let speed = Shape::SpeedMS(rng.random_range(15.0..28.0));
        let spin = Shape::BackspinRadS(rng.random_range(-150.0..150.0));
        let wanted = Wanted::new(landing, speed, Some(spin), &machine).expect("within range");
        let begun = Instant::now();
        let is_hit = black_box(aim(&wanted, &machine, &conditions)).is_ok();
        let ms = begun.elapsed().as_secs_f64() * 1e3;
        n_hit += usize::from(is_hit);
        if is_hit { &mut hit_ms } else { &mut missed_ms }.push(ms);
    }
    tell(&format!("aim, {n_hit} within reach"), hit_ms);
    tell(&format!("aim, {} out of reach: the nearest", N - n_hit), missed_ms);

    let settings = Vector4::new(24.0, 0.15, 0.02, -60.0);
    let told = actuators::told(&settings, machine.launcher_in_court_m);
    let (design, scatter) =
        (actuators::design(&settings), actuators::scatter(&settings, &machine.scatter));
    let sigmas = [0.05, 1e-3, 1e-3, 10.0, 30.0, 30.0, 0.03, 0.8, 0.8, 0.01, 0.01];
    let information =
        CauseMatrix::from_diagonal(&CauseColumn::from(sigmas.map(|sigma: f64| sigma.powi(-2))));
    let (mean, _) = actuators::prior();
    let mut belief = Belief::default();
    let mut learned_ms = Vec::new();
    for _ in 0..N {
        let mut likely = told + design * mean;
        for (i, sigma) in sigmas.into_iter().enumerate() {
            likely[i] += rng.random_range(-2.0..2.0) * sigma;
        }
        let causes = Causes { fitted: likely, likely, information };
        let launcher = machine.launcher_in_court_m;
        let begun = Instant::now();
        let passage = causes.passage(launcher.y, &physics).expect("it comes down");
        black_box(belief.update(&passage, &told, &design, &scatter).expect("a ball"));
        learned_ms.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    tell("learn from a ball", learned_ms);
}

fn tell(what: &str, mut ms: Vec<f64>) {
    ms.sort_by(f64::total_cmp);
    let (median, worst) = (ms.get(ms.len() / 2), ms.last());
    if let (Some(median), Some(worst)) = (median, worst) {
        println!("{what}: {median:.3} ms (median), {worst:.3} ms (slowest)");
    }
}

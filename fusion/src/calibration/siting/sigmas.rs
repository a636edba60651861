//! A shot to a place -> how well its bounce would be measured: 1 sigma along and across the flight.
//!
//! From the flight fit itself: every frame that shows the ball is a sighting, and [`fit::bound`]
//! (Cramér-Rao, with what the fit knows beforehand: launcher, clocks, air, ground) gives the
//! covariance of all unknowns, and of the place where the ball touches the ground. Two things that
//! no residual shows are considered on top (Schmidt), as the fit does: the bias of all centres
//! alike, and, if the rig says how sure it is, the rig. The place answers to an offset of each
//! sighting by `G = D C Sᵀ W`; a bias b adds `(Σ G b)(Σ G b)ᵀ`, the rig `(Σ G H) P (Σ G H)ᵀ`.
//!
//! The robust fit itself is about 5 % less sure than the bound, and so is its stated sigma.

use super::flights::{self, AFTER_S, Flight, Watch};
use super::launcher_of;
use crate::clock::OFFSET_SIGMA_S;
use crate::flight::evidence;
use crate::flight::fit::{self, BIASES};
use crate::flight::fitted::{Fitted, Scene};
use crate::flight::model::{Model, Span};
use crate::flight::unknowns::{Known, Prior, Unknowns};
use crate::motion::seconds_between;
use crate::rectified::Sighting;
use crate::world::adjustment::RIG;
use crate::world::ball::Physics;
use crate::world::rig::Rig;
use nalgebra::{Matrix2, Vector2};

/// Fewest sightings of each camera before the bounce.
const N_BEFORE_MIN: usize = 3;

/// Fewest sightings after a bounce, of both cameras together, that make it one.
pub const N_AFTER_MIN: usize = 3;

/// How far before the first and after the last sighting a flight is followed.
const REACH_S: [f64; 2] = [2.5, 2.0];

/// What the fit would be told besides sightings.
#[derive(Debug, Clone, Copy)]
pub struct Terms<'a> {
    /// The cameras.
    pub rig: &'a Rig,
    /// Gravity, air, the ball.
    pub physics: &'a Physics,
    /// Rate, noise, net.
    pub watch: &'a Watch,
    /// 1 sigma of the ground's height.
    pub ground_sigma_m: f64,
    /// 1 sigma by which all centres may be off together.
    pub bias_sigma_px: f64,
}

/// 1 sigma of a place on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sigma {
    /// Along the flight.
    pub along_m: f64,
    /// Across it.
    pub across_m: f64,
}

/// How a shot would be seen and measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Frames of left and right that show the ball before its bounce.
    pub n_before: [usize; 2],
    /// And after it, within a quarter of a second.
    pub n_after: [usize; 2],
    /// When both cameras first see the ball, after the launch; None if they never do.
    pub both_from_s: Option<f64>,
    /// By noise, bias and rig; None if it would not be measured.
    pub sigma: Option<Sigma>,
    /// By noise alone.
    pub by_noise: Option<Sigma>,
    /// By what the rig's calibration leaves open; None if the rig says nothing of it.
    pub by_rig: Option<Sigma>,
}

/// Of one shot.
#[must_use]
pub fn measured(flight: &Flight, terms: &Terms) -> Measured {
    let reference = &flight.reference;
    let truth = Unknowns {
        aloft: reference.launch,
        breeze: flights::still(),
        clock_s: 0.0,
        ground_m: 0.0,
        out_m_s: reference.after_bounce.velocity_m_s,
    };
    let touch_s = reference.flight_time_s;
    let until_s = touch_s + AFTER_S;
    let span = Span { from_s: 0.0, to_s: until_s, has_bounce: true };
    let whole = Model::new(&truth, terms.physics, &span);
    let at = |t_s: f64| whole.place_at(t_s).position_m;
    let sightings = flights::sightings(terms.rig, terms.watch, at, until_s);
    let is_before = |s: &Sighting| seconds_between(0, s.t_ns) <= touch_s;
    let counts = |is_wanted: bool| {
        let wanted = sightings.iter().filter(|s| is_before(s) == is_wanted);
        wanted.fold([0; 2], |mut counts, s| {
            counts[s.camera.idx()] += 1;
            counts
        })
    };
    let (n_before, n_after) = (counts(true), counts(false));
    let both = sightings.windows(2).find(|pair| pair[0].t_ns == pair[1].t_ns);
    let mut measured = Measured {
        n_before,
        n_after,
        both_from_s: both.map(|pair| seconds_between(0, pair[0].t_ns)),
        sigma: None,
        by_noise: None,
        by_rig: None,
    };
    if n_before.iter().any(|&n| n < N_BEFORE_MIN) {
        return measured;
    }
    let has_bounce = n_after.iter().sum::<usize>() >= N_AFTER_MIN;
    let used: Vec<Sighting> =
        sightings.into_iter().filter(|s| has_bounce || is_before(s)).collect();
    let known = Known {
        clock_s: [0.0, OFFSET_SIGMA_S],
        ground_sigma_m: terms.ground_sigma_m,
        out_and_in_m_s: [truth.out_m_s, reference.before_bounce.velocity_m_s],
    };
    let prior = Prior::new(&truth, &known);
    let scene = Scene {
        rig: terms.rig,
        physics: terms.physics,
        launcher_m: Some(launcher_of(terms.rig)),
        has_bounce,
        reach_s: REACH_S,
        bias_sigma_px: terms.bias_sigma_px,
    };
    let fitted = fit::bound(&used, 0, &truth, &prior, &scene);
    if let Some(parts) = fitted.and_then(|fitted| Parts::new(&fitted, &used, &prior, &scene)) {
        let Parts { heading, noise_m2, bias_m2, rig_m2 } = parts;
        let all_m2 = noise_m2 + bias_m2 + rig_m2.unwrap_or_default();
        measured.sigma = Some(sigma(&all_m2, &heading));
        measured.by_noise = Some(sigma(&noise_m2, &heading));
        measured.by_rig = rig_m2.map(|rig_m2| sigma(&rig_m2, &heading));
    }
    measured
}

fn sigma(covariance_m2: &Matrix2<f64>, heading: &Vector2<f64>) -> Sigma {
    let across = Vector2::new(-heading.y, heading.x);
    let of = |axis: &Vector2<f64>| axis.dot(&(covariance_m2 * axis)).max(0.0).sqrt();
    Sigma { along_m: of(heading), across_m: of(&across) }
}

/// Covariances of the place, by what they come from.
struct Parts {
    /// Of the flight, level.
    heading: Vector2<f64>,
    noise_m2: Matrix2<f64>,
    bias_m2: Matrix2<f64>,
    rig_m2: Option<Matrix2<f64>>,
}

impl Parts {
    fn new(fitted: &Fitted, sightings: &[Sighting], prior: &Prior, scene: &Scene) -> Option<Self> {
        let touch = fitted.model.touch()?;
        let place = touch.d_position.fixed_rows::<2>(0).into_owned();
        let gain = place * fitted.covariance;
        let response = place * evidence::response(sightings, fitted, prior, scene)?;
        let by_rig = response.fixed_columns::<RIG>(0).into_owned();
        let by_bias = response.fixed_columns::<{ BIASES.len() }>(RIG).into_owned();
        Some(Self {
            heading: touch.velocity_m_s.xy().try_normalize(1e-9)?,
            noise_m2: gain * place.transpose(),
            bias_m2: by_bias * by_bias.transpose(),
            rig_m2: scene.rig.covariance().map(|rig| by_rig * rig * by_rig.transpose()),
        })
    }
}

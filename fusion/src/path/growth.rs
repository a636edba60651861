//! Sightings of one ball -> more of them: along the flight that is fitted to them, each way.

use super::Terms;
use crate::flight::evidence::{self, Evidence};
use crate::flight::fit::{self, LAUNCHER_SIGMA_M};
use crate::flight::fitted::{Fitted, Scene};
use crate::flight::unknowns::{Known, Prior, Unknowns};
use crate::history::{History, Kept};
use crate::look::{self, GATE_SIGMAS, Look};
use crate::motion::{World, later_ns, seconds_between};
use crate::rectified::Sighting;
use crate::seeds::DETECTED;
use crate::tracklets::Tracklet;
use crate::world::acceleration::{Aloft, Breeze};
use crate::world::ball::DRAG_COEFFICIENT;
use crate::world::rebound::{self, HARD_COURT};
use crate::world::rig::Rig;
use nalgebra::{Matrix3, Point3, Vector2, Vector3};
use shm_layout::{Camera, StampNs};

/// Fewest tokens before the bounce a flight can be fitted to.
pub const N_TOKENS_MIN: usize = 6;

/// How far a path grows outwards in one round, and rounds at most.
const GROWTH_S: f64 = 0.25;
const N_ROUNDS_MAX: usize = 8;

/// Fewest sightings after a bounce that make it one, and of one camera: as many instants.
const N_AFTER_MIN: usize = 3;
const N_AFTER_LONE_MIN: usize = 6;

/// What is used of the flight after the bounce: more tells little of the bounce.
pub const AFTER_S: f64 = 0.25;

/// Nearer to the bounce than this a sighting does not say on which side it is.
const NEAR_BOUNCE_S: f64 = 0.004;

/// Longest flight back to the launcher, and on to the ground, beyond what was seen.
const REACH_S: [f64; 2] = [1.2, 1.5];

/// Whether these are the same spots.
fn is_same(a: &[Sighting], b: &[Sighting]) -> bool {
    let spot = |s: &Sighting| (s.camera, s.t_ns, s.raw);
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| spot(a) == spot(b))
}

/// By time on the left clock.
pub fn ordered(mut sightings: Vec<Sighting>, terms: &Terms) -> Vec<Sighting> {
    sightings.sort_by_key(|s| (terms.world.left_ns(s.camera, s.t_ns), s.camera));
    sightings
}

/// What a path is gathered from, and how it is fitted.
#[derive(Clone, Copy)]
pub struct Given<'a> {
    /// Both cameras' last seconds.
    pub history: &'a History,
    /// How it is fitted.
    pub terms: &'a Terms<'a>,
}

/// A path that grows along the flight that is fitted to it.
#[derive(Clone)]
pub struct Growth {
    /// In order of time.
    pub sightings: Vec<Sighting>,
    /// To them.
    pub fitted: Fitted,
    /// Whether the flight goes on after the ground.
    pub has_bounce: bool,
    /// Where it began, if nothing else tells how far away it is, or it was found to begin there.
    pub launcher_m: Option<Point3<f64>>,
    prior: Prior,
    reference_ns: StampNs,
}

impl Growth {
    /// To sightings before the bounce, from where a tracklet has them; None without a solution.
    pub fn new(tracklet: &Tracklet, sightings: Vec<Sighting>, terms: &Terms) -> Option<Self> {
        let falling = tracklet.falling.as_ref().unwrap_or(&tracklet.motion);
        let (first, last) = (sightings.first()?, sightings.last()?);
        let reference_ns = first.t_ns.midpoint(last.t_ns);
        let physics = terms.world.physics;
        let state = falling.flown(reference_ns, physics);
        let start = Unknowns {
            aloft: Aloft {
                position_m: state.position_m,
                velocity_m_s: state.velocity_m_s,
                spin_rad_s: Vector3::zeros(),
            },
            breeze: Breeze { drag_coefficient: DRAG_COEFFICIENT, wind_m_s: Vector2::zeros() },
            clock_s: terms.world.clock_s[0],
            ground_m: 0.0,
            out_m_s: Vector3::zeros(),
        };
        let prior = Prior::new(&start, &known(terms, [Vector3::zeros(); 2]));
        // Of one camera's sightings nothing else tells how far away they are.
        let is_lone = sightings.iter().all(|s| s.camera == first.camera);
        let launcher_m = terms.world.rig.launcher_in_court_m().filter(|_| is_lone);
        let scene = scene(terms, launcher_m, false);
        let fitted = fit::roughly(&sightings, reference_ns, (&start, [1.0; 2]), &prior, &scene)?;
        Some(Self { sightings, fitted, has_bounce: false, prior, launcher_m, reference_ns })
    }

    fn refit(&mut self, sightings: Vec<Sighting>, start: &Unknowns, terms: &Terms) -> bool {
        let scene = scene(terms, self.launcher_m, self.has_bounce);
        let start = (start, self.fitted.noise);
        let fitted = fit::roughly(&sightings, self.reference_ns, start, &self.prior, &scene);
        match fitted {
            Some(fitted) if sightings.len() >= N_TOKENS_MIN => {
                (self.fitted, self.sightings) = (fitted, sightings);
                true
            }
            _ => false,
        }
    }

    /// Takes in those sightings that it does not have; they are not fitted yet.
    pub fn take_in(&mut self, mut more: Vec<Sighting>, terms: &Terms) {
        let frame = |s: &Sighting| (s.camera, s.t_ns);
        more.retain(|new| !self.sightings.iter().any(|old| frame(old) == frame(new)));
        self.sightings.extend(more);
        self.sightings = ordered(std::mem::take(&mut self.sightings), terms);
    }

    /// From now on with what these terms say of the clocks and the ground, before its bounce.
    pub fn take_terms(&mut self, terms: &Terms) {
        self.prior = Prior::new(&self.prior.mean, &known(terms, [Vector3::zeros(); 2]));
    }

    /// To the last digit, with the noise as it is.
    pub fn finish(&mut self, terms: &Terms) {
        let scene = scene(terms, self.launcher_m, self.has_bounce);
        let start = (&self.fitted.unknowns, self.fitted.noise);
        let (sightings, prior) = (&self.sightings, &self.prior);
        let fitted = fit::from_sightings(sightings, self.reference_ns, start, prior, &scene);
        if let Some(fitted) = fitted {
            self.fitted = fitted;
        }
    }

    /// What it says of the rig.
    pub fn evidence(&self, terms: &Terms) -> Option<Evidence> {
        let scene = scene(terms, self.launcher_m, self.has_bounce);
        evidence::of_flight(&self.sightings, &self.fitted, &self.prior, &scene)
    }

    /// Outwards, over gaps too, until there is nothing more.
    pub fn grow(&mut self, is_after: bool, given: Given) {
        let time_of = |s: Option<&Sighting>| s.map_or(0.0, |s| self.fitted.time_s(s));
        let mut span_s = [time_of(self.sightings.first()), time_of(self.sightings.last())];
        for _ in 0..N_ROUNDS_MAX {
            span_s = [span_s[0] - GROWTH_S, span_s[1] + GROWTH_S];
            let gathered = self.gathered(span_s, is_after, given);
            if is_same(&gathered.sightings, &self.sightings) {
                if gathered.is_all {
                    break;
                }
                continue;
            }
            let start = self.fitted.unknowns;
            if !self.refit(gathered.sightings, &start, given.terms) {
                break;
            }
        }
    }

    /// Through the bounce, if enough was seen of what followed. The tracklet may have lost its ball
    /// there: the flight knows better where it came down.
    pub fn with_rise(self, after: Vec<Sighting>, given: Given) -> Self {
        let mut risen = self.clone();
        if risen.go_on(after, given.terms).is_none() {
            return self;
        }
        risen.grow(true, given);
        let touch_s = risen.fitted.model.touch().map_or(f64::INFINITY, |touch| touch.t_s);
        let is_after = |s: &&Sighting| risen.fitted.time_s(s) > touch_s;
        let n_after = risen.sightings.iter().filter(is_after).count();
        let is_lone = risen.launcher_m.is_some();
        let n_min = if is_lone { N_AFTER_LONE_MIN } else { N_AFTER_MIN };
        if n_after >= n_min { risen } else { self }
    }

    /// Takes in the first sightings after the bounce; None if the flight does not come down.
    pub fn go_on(&mut self, after: Vec<Sighting>, terms: &Terms) -> Option<()> {
        let touch = *self.fitted.model.touch()?;
        let physics = terms.world.physics;
        let spin = self.fitted.model.spin_at(touch.t_s);
        let radius_m = physics.ball.radius_m();
        let (out_m_s, ..) = rebound::after(&touch.velocity_m_s, &spin, radius_m, &HARD_COURT);
        let mut start = self.fitted.unknowns;
        start.out_m_s = out_m_s;
        let known = known(terms, [out_m_s, touch.velocity_m_s]);
        self.prior = Prior::new(&self.prior.mean, &known);
        let is_soon = |s: &Sighting| {
            let since_s = seconds_between(self.reference_ns, s.t_ns) - touch.t_s;
            since_s < AFTER_S
        };
        let mut all = self.sightings.clone();
        all.extend(after.into_iter().filter(is_soon));
        self.has_bounce = true;
        self.refit(ordered(all, terms), &start, terms).then_some(())
    }

    /// A flight that passes the launcher, for all that is known of it, came from there.
    pub fn adopt_launcher_if_near(&mut self, terms: &Terms) {
        let Some(launcher) = terms.world.rig.launcher_in_court_m() else { return };
        let first_s = self.fitted.time_s(&self.sightings[0]);
        let Some(there) = self.fitted.model.passing(1, launcher.y, first_s - REACH_S[0]) else {
            return;
        };
        let slope = &there.d_position;
        let near_m2 = Matrix3::identity() * LAUNCHER_SIGMA_M.powi(2);
        let covariance = slope * self.fitted.covariance * slope.transpose() + near_m2;
        let off = there.position_m - launcher;
        let is_near = covariance
            .try_inverse()
            .is_some_and(|inverse| off.dot(&(inverse * off)) < GATE_SIGMAS * GATE_SIGMAS);
        if is_near {
            self.launcher_m = Some(launcher);
            self.finish(terms);
        }
    }

    /// When it left the launcher, or the earliest that is looked at.
    fn begin_s(&self, rig: &Rig) -> f64 {
        let first_s = self.sightings.first().map_or(0.0, |s| self.fitted.time_s(s));
        let back_s = first_s - REACH_S[0];
        let launcher = rig.launcher_in_court_m();
        let there = launcher.and_then(|at| self.fitted.model.passing(1, at.y, back_s));
        there.map_or(back_s, |there| there.t_s)
    }

    /// How long the flight had been in its camera's image when it was first seen.
    pub fn unseen_s(&self, Given { history, terms }: Given) -> f64 {
        let (rig, first) = (terms.world.rig, self.sightings[0]);
        let begin_s = self.begin_s(rig);
        let lens = rig.eye(first.camera).lens;
        let is_in_image = |kept: &&Kept| {
            let time_s = self.fitted.time_s(&Sighting { t_ns: kept.t_ns, ..first });
            let position_m = self.fitted.model.place_at(time_s).position_m;
            let raw = rig.raw_from_tracking(first.camera, &position_m);
            time_s >= begin_s && raw.is_some_and(|raw| lens.contains(raw))
        };
        let from_ns = later_ns(first.t_ns, -REACH_S[0]);
        let entered = history.since(first.camera, from_ns).find(is_in_image);
        entered.map_or(0.0, |kept| seconds_between(kept.t_ns, first.t_ns))
    }

    /// The spot of every frame of a time span that fits the flight best, if any is within the
    /// gate.
    pub fn gathered(
        &self,
        [earliest_s, latest_s]: [f64; 2],
        is_after: bool,
        Given { history, terms }: Given,
    ) -> Gathered {
        let touch_s = self.fitted.model.touch().map_or(f64::INFINITY, |touch| touch.t_s);
        let begin_s = self.begin_s(terms.world.rig);
        let end_s = if is_after { touch_s + AFTER_S } else { touch_s - NEAR_BOUNCE_S };
        let (from_s, to_s) = (earliest_s.max(begin_s), latest_s.min(end_s));
        let is_all = earliest_s <= begin_s && latest_s >= end_s;
        let from_ns = later_ns(self.reference_ns, from_s - MARGIN_S);
        let mut sightings = Vec::with_capacity(self.sightings.len() + 64);
        let mut worth = 0.0;
        for camera in Camera::BOTH {
            for kept in history.since(camera, from_ns) {
                if seconds_between(self.reference_ns, kept.t_ns) > to_s + MARGIN_S {
                    break;
                }
                match look::at(kept, &self.fitted, from_s..to_s, history, terms) {
                    None => {}
                    Some(Look::Missed) => worth += (1.0 - DETECTED).ln(),
                    Some(Look::Seen { sighting, gain }) => {
                        worth += gain;
                        sightings.push(sighting);
                    }
                }
            }
        }
        Gathered { sightings: ordered(sightings, terms), is_all, worth }
    }
}

/// What was gathered along a flight.
pub struct Gathered {
    /// In order of time.
    pub sightings: Vec<Sighting>,
    /// Whether that was all of the flight.
    is_all: bool,
    /// As that of a path.
    pub worth: f64,
}

/// Rounding of times when frames are looked up.
const MARGIN_S: f64 = 0.05;

fn known(terms: &Terms, out_and_in_m_s: [Vector3<f64>; 2]) -> Known {
    let Terms { world, ground_sigma_m, .. } = *terms;
    Known { clock_s: world.clock_s, ground_sigma_m, out_and_in_m_s }
}

fn scene<'a>(terms: &Terms<'a>, launcher_m: Option<Point3<f64>>, has_bounce: bool) -> Scene<'a> {
    let World { rig, physics, .. } = terms.world;
    let bias_sigma_px = terms.bias_sigma_px;
    Scene { rig, physics, launcher_m, has_bounce, reach_s: REACH_S, bias_sigma_px }
}

//! Points of the last frames -> seeds: two points, and the sightings that lie on a flight through
//! them.
//!
//! Any two points a few frames apart, at a speed a ball may have, are a hypothesis: gravity and
//! drag draw the curve through both. It is projected into every frame of the last [`WINDOW_S`] of
//! both cameras, each at its own time, and the nearest spot within a gate is a hit. A hit is worth
//! `ln(Pd / (β π r²))`, since clutter of density β seldom falls into the gate by chance; a frame
//! without one costs `ln(1 − Pd)`. The two points themselves prove nothing and count nothing. So a
//! missed frame costs little, and a false flight needs several false spots in the right places.
//!
//! **Cost**: pairs of points within a short window, at most [`MAX_PAIRS`] per frame, times the
//! frames of the window: bounded whatever the clutter. Twenty false spots per camera take about
//! 0.15 ms a frame, the whole chain (`accuracy --cells empty`).
//!
//! One camera alone: [`crate::lone`].

use crate::Dropped;
use crate::history::{History, Kept, SpotId};
use crate::motion::{World, later_ns, seconds_between, state_between};
use crate::points::{Point, PointFrame};
use crate::world::ball::State;
use crate::world::camera::RawPixel;
use nalgebra::{Point3, Vector3};
use shm_layout::{Camera, StampNs};
use std::collections::VecDeque;

/// How far back a seed looks.
pub const WINDOW_S: f64 = 0.15;

/// Most frames of points kept, whatever their rate.
const MAX_INSTANTS: usize = 64;

/// Most pairs of points looked at per frame; the others are dropped and counted.
pub const MAX_PAIRS: usize = 96;

/// Most points of one instant.
pub const MAX_POINTS: usize = 32;

/// Time between the two points of a seed: nearer and the speed is noise.
const APART_S: std::ops::RangeInclusive<f64> = 0.018..=0.12;

/// Speeds of a ball in play: after its bounce it is still faster than 6 m/s; 60 is a first serve.
const SPEED_M_S: std::ops::RangeInclusive<f64> = 6.0..=60.0;

/// Part of the frames in which a ball is found, at worst.
pub const DETECTED: f64 = 0.6;

/// What a seed must be worth. With 5000 hypotheses a second chance passes once in an hour.
pub const WORTH_MIN: f64 = 16.0;

/// What each camera must say for it by itself.
const WORTH_EACH_MIN: f64 = 4.0;

/// Fewest hits besides the two points themselves.
const N_HITS_MIN: usize = 4;

/// Fewest of them in each camera: one camera's spots lie on a curve at any depth, so a ball in one
/// and false spots in the other make a flight that is none.
const N_EACH_MIN: usize = 2;

/// Gate around the curve between its two points; it widens in proportion beyond them.
const GATE_PX: f64 = 1.5;
const GATE_SIGMAS: f64 = 3.0;

/// The widest gate.
const GATE_MAX_PX: f64 = 14.0;

/// A hypothesis that was confirmed.
#[derive(Debug, Clone, PartialEq)]
pub struct Seed {
    /// Place and velocity at the first point.
    pub state: State,
    /// Time of the first point, left clock.
    pub t_ns: StampNs,
    /// How long it had flown from the launcher, if only that tells how far away it is.
    pub flown_s: Option<f64>,
    /// Spots on the curve; those of the hypothesis first.
    pub hits: Vec<SpotId>,
    /// How many are those of the hypothesis.
    pub n_own: usize,
    /// Sum of what hits and misses are worth.
    pub worth: f64,
}

/// Why a hypothesis is no seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// All its hits are worth too little.
    Unlikely,
    /// One of the cameras says too little for it.
    OneCamera,
    /// It has too few hits.
    FewHits,
}

/// The hypotheses of a frame, and what became of them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tried {
    /// All that were tried.
    pub n: u64,
    /// Those that are seeds.
    pub n_found: u64,
    /// [`Refusal::Unlikely`].
    pub n_unlikely: u64,
    /// [`Refusal::OneCamera`].
    pub n_one_camera: u64,
    /// [`Refusal::FewHits`].
    pub n_few_hits: u64,
    /// Those that were too many to be tried.
    pub n_beyond_max: u64,
    /// What the best one was worth.
    pub best_worth: Option<f64>,
}

impl Tried {
    pub(crate) fn count(&mut self, worth: f64, refusal: Option<Refusal>) {
        self.n += 1;
        *match refusal {
            None => &mut self.n_found,
            Some(Refusal::Unlikely) => &mut self.n_unlikely,
            Some(Refusal::OneCamera) => &mut self.n_one_camera,
            Some(Refusal::FewHits) => &mut self.n_few_hits,
        } += 1;
        self.best_worth = Some(self.best_worth.map_or(worth, |best| best.max(worth)));
    }
}

/// Keeps the points of the last frames.
#[derive(Default)]
pub struct Seeds {
    instants: VecDeque<PointFrame>,
    tried: Tried,
}

impl Seeds {
    /// What became of the last frame's hypotheses.
    #[must_use]
    pub fn tried(&self) -> Tried {
        self.tried
    }

    /// Takes the points of a frame in; gives out the hypotheses they confirm, best first.
    pub fn update(
        &mut self,
        frame: PointFrame,
        history: &History,
        world: &World,
        dropped: &mut Dropped,
    ) -> Vec<Seed> {
        let now_ns = frame.t_ns;
        let is_old = |old: &PointFrame| seconds_between(old.t_ns, now_ns) > *APART_S.end();
        while self.instants.len() >= MAX_INSTANTS || self.instants.front().is_some_and(is_old) {
            self.instants.pop_front();
        }
        let mut found = Vec::new();
        let is_free = |point: &Point| point.ids.iter().all(|&id| !history.is_claimed(id));
        let pairs = self
            .instants
            .iter()
            .flat_map(|old| &old.points)
            .flat_map(|first| frame.points.iter().map(move |second| (first, second)));
        let mut tried = Tried::default();
        for (first, second) in pairs {
            let dt_s = seconds_between(first.t_ns, second.t_ns);
            let distance_m = (second.position_m - first.position_m).norm();
            if !APART_S.contains(&dt_s)
                || !SPEED_M_S.contains(&(distance_m / dt_s))
                || !is_free(first)
            {
                continue;
            }
            if tried.n >= MAX_PAIRS as u64 {
                tried.n_beyond_max += 1;
                continue;
            }
            found.extend(Curve::new(first, second, world).seed(history, world, &mut tried));
        }
        dropped.n_pairs_beyond_max += tried.n_beyond_max;
        self.tried = tried;
        let n_beyond = frame.points.len().saturating_sub(MAX_POINTS);
        dropped.n_points_beyond_max += n_beyond as u64;
        let points = frame.points.into_iter().take(MAX_POINTS).collect();
        self.instants.push_back(PointFrame { t_ns: now_ns, points });
        found.sort_by(|a, b| b.worth.total_cmp(&a.worth));
        found
    }
}

/// The flight through two points, and the gate around it.
pub(crate) struct Curve {
    /// The spots the two points were made of.
    pub own: Vec<SpotId>,
    /// Time of the first point, left clock, and until the second.
    pub t_ns: StampNs,
    pub apart_s: f64,
    /// Place and velocity at the first point.
    pub state: State,
    acceleration_m_s2: Vector3<f64>,
    sigma_px: f64,
    /// Half of how far the rows of the pairs disagree: clocks that are apart, or false pairs.
    mismatch_px: f64,
}

/// What the frames of the last [`WINDOW_S`] say of a curve, the spots it was made of left out.
pub(crate) struct Support {
    pub worth: f64,
    pub worth_each: [f64; 2],
    pub n_hits: [usize; 2],
    pub hits: Vec<SpotId>,
}

impl Curve {
    fn new(first: &Point, second: &Point, world: &World) -> Self {
        let places = [first, second].map(|point| (point.t_ns, point.position_m));
        let own = [first, second].iter().flat_map(|point| point.ids).collect();
        let sigma_px = first.left.sigma_px().max(second.left.sigma_px());
        let mismatch_px = 0.5 * first.row_mismatch_px.abs().max(second.row_mismatch_px.abs());
        Self { mismatch_px, ..Self::through(places, own, sigma_px, world) }
    }

    /// Through two places, the earlier first, that come from these spots.
    pub fn through(
        [(first_ns, first_m), (second_ns, second_m)]: [(StampNs, Point3<f64>); 2],
        own: Vec<SpotId>,
        sigma_px: f64,
        world: &World,
    ) -> Self {
        let apart_s = seconds_between(first_ns, second_ns);
        let mean = (second_m - first_m) / apart_s;
        Self {
            own,
            t_ns: first_ns,
            apart_s,
            state: state_between(&first_m, &second_m, apart_s, world.physics),
            acceleration_m_s2: world.physics.acceleration_m_s2(&mean),
            sigma_px,
            mismatch_px: 0.0,
        }
    }

    fn position_m(&self, since_s: f64) -> Point3<f64> {
        self.state.position_m
            + self.state.velocity_m_s * since_s
            + self.acceleration_m_s2 * (0.5 * since_s * since_s)
    }

    fn seed(self, history: &History, world: &World, tried: &mut Tried) -> Option<Seed> {
        let support = self.support(&Camera::BOTH, history, world);
        let has = |all: bool, refusal| (!all).then_some(refusal);
        let each = support.worth_each.iter().all(|&worth| worth >= WORTH_EACH_MIN)
            && support.n_hits.iter().all(|&n| n >= N_EACH_MIN);
        let n_hits = support.n_hits.iter().sum::<usize>();
        let refusal = has(support.worth >= WORTH_MIN, Refusal::Unlikely)
            .or(has(each, Refusal::OneCamera))
            .or(has(n_hits >= N_HITS_MIN, Refusal::FewHits));
        tried.count(support.worth, refusal);
        refusal.is_none().then(|| self.seed_with(support, None))
    }

    /// The seed it is, if that is support enough.
    pub fn seed_with(self, support: Support, flown_s: Option<f64>) -> Seed {
        let Self { own: mut hits, t_ns, state, .. } = self;
        let n_own = hits.len();
        hits.extend(support.hits);
        Seed { state, t_ns, flown_s, hits, n_own, worth: support.worth }
    }

    /// What some cameras' frames say of it.
    pub fn support(&self, cameras: &[Camera], history: &History, world: &World) -> Support {
        let mut support =
            Support { worth: 0.0, worth_each: [0.0; 2], n_hits: [0; 2], hits: Vec::new() };
        let from_ns = later_ns(self.t_ns, self.apart_s - WINDOW_S);
        for &camera in cameras {
            for kept in history.since(camera, from_ns) {
                let is_own = |id: &SpotId| (id.camera, id.serial) == (camera, kept.serial);
                if self.own.iter().any(is_own) {
                    continue;
                }
                let worth = &mut support.worth_each[camera.idx()];
                match self.hit(kept, world) {
                    Sight::Out => {}
                    Sight::Missed => *worth += (1.0 - DETECTED).ln(),
                    Sight::Hit { idx, gate_px } => {
                        *worth += hit_worth(gate_px, camera, history, world);
                        support.n_hits[camera.idx()] += 1;
                        support.hits.push(kept.id(idx));
                    }
                }
            }
        }
        support.worth = support.worth_each.iter().sum();
        support
    }

    /// The free spot nearest to the curve in a frame.
    fn hit(&self, kept: &Kept, world: &World) -> Sight {
        let eye = world.rig.eye(kept.camera);
        let since = |row_px: f64| {
            let row_ns = later_ns(kept.t_ns, row_px * eye.row_time_us * 1e-6);
            seconds_between(self.t_ns, world.left_ns(kept.camera, row_ns))
        };
        let [_, height_px] = eye.lens.image_px();
        let project =
            |since_s: f64| world.rig.raw_from_tracking(kept.camera, &self.position_m(since_s));
        let mut since_s = since(f64::from(height_px) / 2.0);
        if eye.row_time_us > 0.0 {
            let Some(near) = project(since_s) else { return Sight::Out };
            since_s = since(near.y_px.clamp(0.0, f64::from(height_px)));
        }
        let Some(pixel) = project(since_s).filter(|pixel| eye.lens.contains(*pixel)) else {
            return Sight::Out;
        };
        let beyond_s = (-since_s).max(since_s - self.apart_s).max(0.0);
        let widened =
            (GATE_PX + GATE_SIGMAS * self.sigma_px) * (1.0 + 2.0 * beyond_s / self.apart_s);
        let gate_px = (widened + self.mismatch_px).min(GATE_MAX_PX);
        let distance_px = |raw: &RawPixel| (raw.x_px - pixel.x_px).hypot(raw.y_px - pixel.y_px);
        kept.spots_in([pixel.y_px - gate_px, pixel.y_px + gate_px])
            .filter(|(idx, _)| !kept.is_claimed(*idx))
            .map(|(idx, spot)| (idx, distance_px(&spot.sighting.raw)))
            .filter(|(_, px)| *px <= gate_px)
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(Sight::Missed, |(idx, _)| Sight::Hit { idx, gate_px })
    }
}

enum Sight {
    Out,
    Missed,
    Hit { idx: usize, gate_px: f64 },
}

/// What a spot within a gate is worth: how much likelier a ball puts one there than clutter.
fn hit_worth(gate_px: f64, camera: Camera, history: &History, world: &World) -> f64 {
    let [width_px, height_px] = world.rig.eye(camera).lens.image_px().map(f64::from);
    let density = history.clutter(camera) / (width_px * height_px);
    let by_chance = (density * std::f64::consts::PI * gate_px * gate_px).min(1.0);
    (DETECTED / by_chance).ln()
}

#[cfg(test)]
mod tests;

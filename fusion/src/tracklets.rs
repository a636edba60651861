//! Seeds + frames -> tracklets: balls that are being followed, sighting by sighting.
//!
//! The thesis' shift-token transfer (8.1), incremental: in every frame of either camera each
//! tracklet says where it expects its ball ([`Motion`]), takes the spot that fits best within its
//! gate as a token, and goes on without one if there is none. On the ground it bounces
//! ([`Motion::bounced`]) and goes on with the doubt a bounce brings. A tracklet ends when it has
//! found nothing for [`SILENCE_S`] or is out of both images.
//!
//! In place of Eq 25's score, which never rejected anything, a token has to be within the gate of a
//! prediction that knows its own doubt. One token per frame and tracklet, the worthiest tracklet
//! first; its spots are claimed, so that nothing else grows on them.
//!
//! **Cost** per frame: tracklets (at most [`MAX_TRACKLETS`]) times the spots of a few rows.

use crate::Dropped;
use crate::history::{History, SpotId};
use crate::motion::{Motion, World, later_ns, seconds_between};
use crate::rectified::Sighting;
use crate::seeds::{DETECTED, Seed};
use shm_layout::{Camera, StampNs};

/// Most balls followed at a time; those worth least are dropped and counted.
pub const MAX_TRACKLETS: usize = 16;

/// A tracklet that finds nothing for this long has ended: 27 frames at 90 Hz.
pub const SILENCE_S: f64 = 0.3;

/// Longest a ball that went out of sight in the air is waited for.
const DUE_MAX_S: f64 = 2.5;

/// A tracklet that one camera has missed for so many frames in a row follows something else.
const N_MISSED_MAX: u32 = 30;

/// Most tokens of a tracklet; 4 s of two cameras at 128 Hz.
const MAX_TOKENS: usize = 1024;

/// Mahalanobis distance of a token from where it is expected: 99.97 % of good ones are nearer.
const GATE_SIGMAS: f64 = 4.0;

/// An expectation more doubtful than this finds everything.
const DOUBT_MAX_PX: f64 = 25.0;

/// Tokens after a bounce, and for how long, that make it certain.
const N_AFTER_BOUNCE: usize = 6;
const AFTER_BOUNCE_S: f64 = 0.04;

/// Tokens after a bounce with which a shot may be told early whose flight was not fitted while it
/// flew: two tell too little too often, and the fit was in vain.
const N_EARLY: usize = 3;

/// Worth of a tracklet is not counted beyond this, so that an old one dies as soon as a young one.
const WORTH_MAX: f64 = 100.0;

/// A spot that is the ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Token {
    /// Which spot.
    pub id: SpotId,
    /// When, on the camera's clock.
    pub t_ns: StampNs,
    /// Bounces before it.
    pub n_bounces: u32,
}

/// Why a tracklet is followed no longer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// It found nothing for [`SILENCE_S`].
    Silent,
    /// One camera missed it for so long, while the other went on, that it followed something else.
    OneCamera,
    /// There were too many, and it was worth least.
    Crowded,
    /// The recording was over.
    Over,
}

/// What became of a tracklet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackletNote {
    /// Counted up within a run.
    pub id: u64,
    /// Whether one camera's spots alone made it.
    pub is_lone: bool,
    /// Its first and its last token.
    pub span_ns: [StampNs; 2],
    /// Tokens of each camera.
    pub n_found: [u32; 2],
    /// Frames of each camera that should have shown its ball.
    pub n_missed: [u32; 2],
    /// Bounces it was followed through.
    pub n_bounces: u32,
    /// Why it ended.
    pub end: End,
}

/// A ball that is followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracklet {
    /// Its tokens in order of time.
    pub tokens: Vec<Token>,
    /// At the last token.
    pub motion: Motion,
    /// Just before the first bounce.
    pub falling: Option<Motion>,
    /// Whether it has been judged already.
    pub is_told: bool,
    /// Counted up within a run.
    pub id: u64,
    is_lone: bool,
    begun_ns: StampNs,
    n_found: [u32; 2],
    n_missed_ever: [u32; 2],
    worth: f64,
    n_bounces: u32,
    last_ns: StampNs,
    due_ns: StampNs,
    was_tried_early: bool,
    n_missed: [u32; 2],
    is_lost: bool,
}

impl Tracklet {
    /// Runs along a seed's hits; None if they are no motion.
    fn from_seed(seed: &Seed, history: &History, world: &World) -> Option<Self> {
        let mut hits: Vec<(StampNs, SpotId)> = seed
            .hits
            .iter()
            .filter_map(|&id| Some((world.left_ns(id.camera, history.sighting(id)?.t_ns), id)))
            .collect();
        hits.sort_unstable_by_key(|(t_ns, id)| (*t_ns, id.camera, id.serial));
        let (first_ns, _) = *hits.first()?;
        let state = world.physics.propagated(seed.state, seconds_between(seed.t_ns, first_ns));
        let motion = match seed.flown_s {
            Some(flown_s) => {
                let flown_s = flown_s + seconds_between(seed.t_ns, first_ns);
                Motion::from_launcher(first_ns, state, flown_s, world)
            }
            None => Motion::new(first_ns, state, world),
        };
        let mut tracklet = Self {
            tokens: Vec::with_capacity(64),
            motion,
            falling: None,
            is_told: false,
            was_tried_early: false,
            id: 0,
            is_lone: seed.flown_s.is_some(),
            begun_ns: first_ns,
            n_found: [0; 2],
            n_missed_ever: [0; 2],
            worth: seed.worth.min(WORTH_MAX),
            n_bounces: 0,
            last_ns: first_ns,
            due_ns: first_ns,
            n_missed: [0; 2],
            is_lost: false,
        };
        // Both cameras' sightings of the two points first: one camera alone would bend the filter
        // before the other tells the depth.
        let own = &seed.hits[..seed.n_own];
        let is_own = |id: &SpotId| own.contains(id);
        for id in own {
            tracklet.take_in(history.sighting(*id)?, world);
        }
        tracklet.motion = tracklet.motion.advanced(first_ns, world)?;
        for (_, id) in hits {
            let sighting = history.sighting(id)?;
            if is_own(&id) || tracklet.take_in(sighting, world) {
                tracklet.push(id, sighting.t_ns);
            }
        }
        Some(tracklet)
    }

    /// Takes a sighting in if it is within the gate.
    fn take_in(&mut self, sighting: &Sighting, world: &World) -> bool {
        let Some((there, expected)) = self.motion.expected_at(sighting, world) else {
            return false;
        };
        let is_near = expected.square(sighting).is_some_and(|s| s <= GATE_SIGMAS * GATE_SIGMAS);
        if is_near {
            self.motion = there;
            self.motion.update(&expected, sighting);
        }
        is_near
    }

    fn push(&mut self, id: SpotId, t_ns: StampNs) {
        if self.tokens.len() < MAX_TOKENS {
            self.tokens.push(Token { id, t_ns, n_bounces: self.n_bounces });
        }
        self.n_found[id.camera.idx()] += 1;
        self.last_ns = self.last_ns.max(t_ns);
    }

    fn note(&self, end: End) -> TrackletNote {
        let Self { id, is_lone, n_found, n_missed_ever: n_missed, n_bounces, .. } = *self;
        let end = if self.is_lost { End::OneCamera } else { end };
        let span_ns = [self.begun_ns, self.last_ns];
        TrackletNote { id, is_lone, span_ns, n_found, n_missed, n_bounces, end }
    }

    /// What its tokens are.
    pub fn sightings<'a>(&self, history: &'a History) -> impl Iterator<Item = &'a Sighting> {
        self.tokens.iter().filter_map(|token| history.sighting(token.id))
    }

    /// When the ball will have come down and been seen after it, before its first bounce.
    fn came_down_ns(&self, world: &World) -> StampNs {
        let latest_ns = later_ns(self.last_ns, DUE_MAX_S);
        let touch_ns = match self.n_bounces {
            0 => self.motion.touches_before_ns(latest_ns, world),
            _ => None,
        };
        touch_ns.map_or(self.last_ns, |touch_ns| later_ns(touch_ns, SILENCE_S))
    }

    /// Whether it is followed and was not followed through a bounce yet.
    #[must_use]
    pub fn has_flown_only(&self) -> bool {
        self.n_bounces == 0 && !self.is_lost
    }

    /// Whether enough was seen after a bounce to be sure of it.
    #[must_use]
    pub fn has_bounced(&self) -> bool {
        let mut after = self.tokens.iter().filter(|token| token.n_bounces > 0);
        let first_ns = after.next().map(|token| token.t_ns);
        let n_after = 1 + after.count();
        n_after >= N_AFTER_BOUNCE
            && first_ns.is_some_and(|ns| seconds_between(ns, self.last_ns) >= AFTER_BOUNCE_S)
    }

    /// Whether enough was seen after a bounce to be told early, if a fit is sure of it; true once.
    pub fn may_be_told_early(&mut self) -> bool {
        let n_after = self.tokens.iter().filter(|token| token.n_bounces > 0).count();
        let may = n_after >= N_EARLY && !self.was_tried_early;
        self.was_tried_early |= may;
        may
    }

    /// Whether it will find nothing more.
    #[must_use]
    pub fn has_ended(&self, now_ns: StampNs) -> bool {
        self.is_lost || seconds_between(self.last_ns, now_ns) > SILENCE_S
    }

    /// Whether all is known that will be of a tracklet that has ended. A ball that went out of
    /// sight in the air may come back, as another tracklet, until it would have come down.
    #[must_use]
    pub fn is_due(&self, now_ns: StampNs) -> bool {
        self.has_ended(now_ns) && now_ns >= self.due_ns
    }

    /// Not to be judged before a time: its flight, once fitted, comes down later than it seemed.
    pub fn postpone(&mut self, due_ns: StampNs) {
        self.due_ns = due_ns;
    }

    /// Looks for its ball in a camera's newest frame.
    fn update(&mut self, camera: Camera, history: &mut History, world: &World) {
        let is_alone = history.is_alone(camera);
        let Some(newest) = history.newest(camera) else { return };
        if self.has_ended(newest.t_ns) {
            return;
        }
        let mut motion = self.motion.clone();
        let mut has_bounced = false;
        if let Some(touch_ns) = motion.touches_before_ns(world.left_ns(camera, newest.t_ns), world)
        {
            let Some(after) = motion.bounced(touch_ns, world) else { return };
            (motion, has_bounced) = (after, true);
        }
        let Some((there, expected)) = motion.expected(camera, newest.t_ns, world) else { return };
        let doubt = expected.covariance_px2;
        if doubt.trace().sqrt() > DOUBT_MAX_PX {
            return;
        }
        let is_in_image = expected.is_in_image;
        let reach_px = GATE_SIGMAS * (doubt[(1, 1)] + 4.0).sqrt();
        let row_px = expected.pixel_px.y;
        let mut best: Option<(f64, usize)> = None;
        for (idx, spot) in newest.spots_in([row_px - reach_px, row_px + reach_px]) {
            if newest.is_claimed(idx) {
                continue;
            }
            let Some(square) = expected.square(&spot.sighting) else { continue };
            if square <= GATE_SIGMAS * GATE_SIGMAS && best.is_none_or(|(least, _)| square < least) {
                best = Some((square, idx));
            }
        }
        let Some((square, idx)) = best else {
            if is_in_image {
                self.worth += (1.0 - DETECTED).ln();
                self.n_missed[camera.idx()] += 1;
                self.n_missed_ever[camera.idx()] += 1;
                let [left, right] = self.n_missed;
                self.is_lost = left.abs_diff(right) > N_MISSED_MAX && !is_alone;
            }
            return;
        };
        self.n_missed[camera.idx()] = 0;
        let id = newest.id(idx);
        let sighting = newest.spots[idx].sighting;
        if has_bounced {
            self.n_bounces += 1;
            self.falling.get_or_insert_with(|| self.motion.clone());
        }
        self.motion = there;
        self.motion.update(&expected, &sighting);
        self.push(id, sighting.t_ns);
        self.due_ns = self.came_down_ns(world);
        self.worth = (self.worth + 5.0 - 0.5 * square).min(WORTH_MAX);
        history.claim(id);
    }
}

/// All balls that are followed.
#[derive(Default)]
pub struct Tracklets {
    /// Worthiest first.
    pub all: Vec<Tracklet>,
    /// What became of those that have ended since somebody took this.
    pub ended: Vec<TrackletNote>,
    n_begun: u64,
}

impl Tracklets {
    /// Follows all balls into a camera's newest frame.
    pub fn update(&mut self, camera: Camera, history: &mut History, world: &World) {
        self.all.sort_by(|a, b| b.worth.total_cmp(&a.worth));
        for tracklet in &mut self.all {
            tracklet.update(camera, history, world);
        }
        history.count_clutter(camera);
    }

    /// Takes seeds in, best first; those whose spots are claimed by then are the same ball.
    pub fn sow(
        &mut self,
        seeds: &[Seed],
        history: &mut History,
        world: &World,
        dropped: &mut Dropped,
    ) {
        for seed in seeds {
            if seed.hits.iter().any(|&id| history.is_claimed(id)) {
                continue;
            }
            let Some(mut tracklet) = Tracklet::from_seed(seed, history, world) else { continue };
            tracklet.id = self.n_begun;
            self.n_begun += 1;
            tracklet.tokens.iter().for_each(|token| history.claim(token.id));
            self.all.push(tracklet);
        }
        self.all.sort_by(|a, b| b.worth.total_cmp(&a.worth));
        dropped.n_tracklets_beyond_max += self.all.len().saturating_sub(MAX_TRACKLETS) as u64;
        let beyond = self.all.drain(self.all.len().min(MAX_TRACKLETS)..);
        self.ended.extend(beyond.map(|tracklet| tracklet.note(End::Crowded)));
    }

    /// Takes out those of which all has been told; without a time, all.
    pub fn take_out_ended(&mut self, now_ns: Option<StampNs>) {
        let is_open = |tracklet: &Tracklet, ns| !(tracklet.is_told && tracklet.has_ended(ns));
        let ended =
            self.all.extract_if(.., |tracklet| !now_ns.is_some_and(|ns| is_open(tracklet, ns)));
        let end = if now_ns.is_some() { End::Silent } else { End::Over };
        self.ended.extend(ended.map(|tracklet| tracklet.note(end)));
    }
}

#[cfg(test)]
mod tests;

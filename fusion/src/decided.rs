//! Tracklets -> shots, each as soon as it is decided.
//!
//! A tracklet is decided when enough was seen after its bounce ([`Tracklet::has_bounced`]), when it
//! has found nothing for a while ([`Tracklet::has_ended`]), or when the recording is over. Then its
//! path is gathered, fitted and judged, once. A tracklet that was told goes on being followed, so
//! that what becomes of its ball is not taken for another.

use crate::clock::Clock;
use crate::flight::Flight;
use crate::history::History;
use crate::motion::World;
use crate::path::{self, Terms};
use crate::quadratic;
use crate::rectified::Sighting;
use crate::shot::{self, Rejection, Shot, Verdict};
use crate::tracklets::{Tracklet, Tracklets};
use crate::world::ball::State;
use crate::world::rectification::Rectification;
use crate::{Fit, Rejected};
use shm_layout::StampNs;

/// Part of a path's sightings that an earlier shot may have had: rolling balls cross.
const SHARED_MAX: f64 = 0.3;

/// Longest flight from the launcher.
const FLOWN_MAX_S: f64 = 3.0;

/// How much faster than at its end a ball flies on average.
const FASTER: f64 = 0.82;

/// A ball flown back without spin, wind or its own drag is off by 2 m at worst; one that has
/// bounced is off by more than this.
const ELSEWHERE_M: f64 = 5.0;

/// What the sightings of a path must be worth, all frames counted that should have shown the ball:
/// chance makes one in 10^13.
const WORTH_MIN: f64 = 30.0;

/// Judges tracklets, each once.
#[derive(Default)]
pub struct Decider {
    /// Of the last shot.
    told: Vec<Sighting>,
    rejected: Rejected,
}

impl Decider {
    /// Paths that were no shot so far, by reason.
    #[must_use]
    pub fn rejected(&self) -> Rejected {
        self.rejected
    }

    /// Takes out what has ended; gives out what is decided. Without a time all is.
    pub fn update(
        &mut self,
        tracklets: &mut Tracklets,
        now_ns: Option<StampNs>,
        history: &History,
        terms: &Terms,
        setup: (&Rectification, Fit),
        clock: &mut Clock,
    ) -> Vec<Shot> {
        let mut shots = Vec::new();
        for tracklet in &mut tracklets.all {
            let is_over = now_ns.is_none_or(|now_ns| tracklet.is_due(now_ns));
            if tracklet.is_told || !(is_over || tracklet.has_bounced()) {
                continue;
            }
            tracklet.is_told = true;
            match self.judged(tracklet, history, terms, setup) {
                Verdict::Shot(shot) => {
                    if let Some(offset) = shot.clock {
                        let at_ns = tracklet.motion.t_ns;
                        clock.update(at_ns, [offset.right_minus_left_s, offset.sigma_s]);
                    }
                    shots.push(*shot);
                }
                Verdict::Rejected(rejection) => self.rejected.count(rejection),
            }
        }
        let is_over = |tracklet: &Tracklet, ns| tracklet.is_told && tracklet.has_ended(ns);
        tracklets.all.retain(|tracklet| now_ns.is_some_and(|ns| !is_over(tracklet, ns)));
        shots
    }

    fn judged(
        &mut self,
        tracklet: &Tracklet,
        history: &History,
        terms: &Terms,
        (rectification, fit): (&Rectification, Fit),
    ) -> Verdict {
        if self.shares_too_much(tracklet.sightings(history)) {
            return Verdict::Rejected(Rejection::SameBall);
        }
        if is_from_elsewhere(tracklet, &terms.world) {
            return Verdict::Rejected(Rejection::NotFromLauncher);
        }
        let Some(path) = path::along(tracklet, history, terms) else {
            return Verdict::Rejected(Rejection::TooShort);
        };
        if self.shares_too_much(path.sightings.iter()) {
            return Verdict::Rejected(Rejection::SameBall);
        }
        if path.worth.is_nan() || path.worth < WORTH_MIN {
            return Verdict::Rejected(Rejection::Unlikely);
        }
        let verdict = match (fit, Flight::from_path(&path)) {
            (Fit::Physics, Some(flight)) => shot::from_flight(&flight, terms.world.rig),
            _ => {
                let points = quadratic::points_from(&path.sightings, rectification, &terms.world);
                quadratic::from_points(&points, terms.world.rig)
            }
        };
        if matches!(verdict, Verdict::Shot(_)) {
            self.told = path.sightings;
        }
        verdict
    }

    /// Whether these are the sightings of a shot that was told.
    fn shares_too_much<'a>(&self, sightings: impl Iterator<Item = &'a Sighting>) -> bool {
        let (mut n, mut n_shared) = (0.0, 0.0);
        for sighting in sightings {
            n += 1.0;
            n_shared += f64::from(u8::from(self.told.contains(sighting)));
        }
        n_shared > SHARED_MAX * n
    }
}

/// Whether a ball can not have come from the launcher, roughly: it is not fitted yet.
fn is_from_elsewhere(tracklet: &Tracklet, world: &World) -> bool {
    let Some(launcher) = world.rig.launcher_in_court_m() else { return false };
    let motion = tracklet.falling.as_ref().unwrap_or(&tracklet.motion);
    let State { position_m, velocity_m_s } = motion.state;
    let back_s = (position_m.y - launcher.y) / velocity_m_s.y;
    if !(0.0..FLOWN_MAX_S).contains(&back_s) {
        return true;
    }
    // Drag slowed it on its way: it took less time than its last speed says.
    let there = world.physics.propagated(motion.state, -FASTER * back_s).position_m;
    (there.z - launcher.z).abs().max((there.x - launcher.x).abs()) > ELSEWHERE_M
}

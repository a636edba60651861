//! Tracklets -> shots, each as soon as it is decided.
//!
//! A tracklet is decided when enough was seen after its bounce ([`Tracklet::has_bounced`]), when it
//! has found nothing for a while ([`Tracklet::has_ended`]), or when the recording is over. Then its
//! path is gathered, fitted and judged, once. A tracklet that was told goes on being followed, so
//! that what becomes of its ball is not taken for another.

use crate::clock::Clock;
use crate::flight::Flight;
use crate::history::History;
use crate::path::{self, Path, Terms};
use crate::quadratic;
use crate::rectified::Sighting;
use crate::shot::{self, Rejection, Shot, Verdict};
use crate::tracklets::{Tracklet, Tracklets};
use crate::world::rectification::Rectification;
use crate::{Fit, Rejected};
use shm_layout::StampNs;

/// Part of a path's sightings that an earlier shot may have had: rolling balls cross.
const SHARED_MAX: f64 = 0.3;

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
            let is_over = now_ns.is_none_or(|now_ns| tracklet.has_ended(now_ns));
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
        tracklets.all.retain(|tracklet| now_ns.is_some_and(|ns| !tracklet.has_ended(ns)));
        shots
    }

    fn judged(
        &mut self,
        tracklet: &Tracklet,
        history: &History,
        terms: &Terms,
        (rectification, fit): (&Rectification, Fit),
    ) -> Verdict {
        let Some(path) = path::along(tracklet, history, terms) else {
            return Verdict::Rejected(Rejection::TooShort);
        };
        if self.is_told(&path) {
            return Verdict::Rejected(Rejection::SameBall);
        }
        let verdict = match (fit, Flight::from_path(&path)) {
            (Fit::Physics, Some(flight)) => shot::from_flight(&flight, terms.world.rig),
            _ => {
                let points =
                    quadratic::points_from(&path.sightings, rectification, &terms.world);
                quadratic::from_points(&points, terms.world.rig)
            }
        };
        if matches!(verdict, Verdict::Shot(_)) {
            self.told = path.sightings;
        }
        verdict
    }

    fn is_told(&self, path: &Path) -> bool {
        let n_shared = path.sightings.iter().filter(|s| self.told.contains(s)).count();
        n_shared as f64 > SHARED_MAX * path.sightings.len() as f64
    }
}

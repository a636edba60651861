//! Tracklets -> shots, each as soon as it is decided.
//!
//! The longest path through all tracklets that wait is decided when [`N_AFTER_BOUNCE`] of its
//! points lie behind a bounce, when no point has joined it for [`SILENCE_S`] of stream time, or
//! when the recording is over. It is then judged and measured ([`crate::shot`]), and its tracklets
//! are removed with all that lie within its time, so that nothing is published twice.
//!
//! A court's ball machine has one ball in the air: while the longest path is not decided, the
//! At most [`MAX_WAITING_TRACKLETS`] do, none longer than [`WAITING_MAX_S`].

use crate::flight::Flight;
use crate::motion::seconds_between;
use crate::path::{self, Path};
use crate::shot::{self, LastSeen, Rejection, Shot, Verdict};
use crate::tracklets::Tracklet;
use crate::world::rig::Rig;
use crate::{Dropped, Rejected};
use shm_layout::StampNs;

/// Points after a bounce that make it certain and give the velocity out of it: 0.13 s.
pub const N_AFTER_BOUNCE: usize = 12;

/// Without a new point for this long a ball is gone; more than any gap a path bridges.
pub const SILENCE_S: f64 = 0.5;

/// Most tracklets that wait; those with the lowest score are dropped.
pub const MAX_WAITING_TRACKLETS: usize = 256;

/// Longest a tracklet waits: longer than any flight.
pub const WAITING_MAX_S: f64 = 4.0;

/// Holds tracklets until the shot they belong to is decided.
#[derive(Default)]
pub struct Decider {
    waiting: Vec<Tracklet>,
    last_seen: Option<LastSeen>,
    rejected: Rejected,
}

impl Decider {
    /// Paths that were no shot so far, by reason.
    #[must_use]
    pub fn rejected(&self) -> Rejected {
        self.rejected
    }

    /// Takes in the tracklets of a window that ended at `now_ns`; gives out what is decided.
    pub fn update(
        &mut self,
        tracklets: Vec<Tracklet>,
        now_ns: StampNs,
        rig: &Rig,
        dropped: &mut Dropped,
    ) -> Vec<Shot> {
        self.waiting.extend(tracklets);
        let shots = self.decided(Some(now_ns), rig);
        self.waiting.retain(|tracklet| seconds_between(tracklet.end_ns(), now_ns) <= WAITING_MAX_S);
        self.waiting.sort_by(|a, b| b.score().total_cmp(&a.score()));
        let n_beyond = self.waiting.len().saturating_sub(MAX_WAITING_TRACKLETS);
        dropped.n_tracklets_beyond_max += n_beyond as u64;
        self.waiting.truncate(MAX_WAITING_TRACKLETS);
        shots
    }

    /// Takes in the last tracklets and decides all that wait. What comes next is another recording.
    pub fn finish(&mut self, tracklets: Vec<Tracklet>, rig: &Rig) -> Vec<Shot> {
        self.waiting.extend(tracklets);
        let shots = self.decided(None, rig);
        self.last_seen = None;
        shots
    }

    /// Shots among what waits; without a time nothing more is to come and all is decided.
    fn decided(&mut self, now_ns: Option<StampNs>, rig: &Rig) -> Vec<Shot> {
        let mut shots = Vec::new();
        while let Some(path) = path::from_tracklets(&self.waiting, &rig.physics()) {
            if now_ns.is_some_and(|now_ns| !self.is_decided(&path, now_ns, rig)) {
                break;
            }
            self.waiting.retain(|tracklet| !shares_a_point(tracklet, &path));
            match shot::from_path(&path, rig, self.last_seen) {
                Verdict::Shot(shot) => {
                    self.waiting.retain(|tracklet| !is_within(tracklet, &path));
                    self.last_seen = last_seen(&path, shot.bounce.as_ref().map(|b| b.position_m.y));
                    shots.push(*shot);
                }
                Verdict::Rejected(rejection) => {
                    self.rejected.count(rejection);
                    if rejection == Rejection::SameBall {
                        let y_m = self.last_seen.map(|last| last.y_m);
                        self.last_seen = last_seen(&path, y_m);
                    }
                }
            }
        }
        shots.sort_by_key(|shot| shot.track.first().map(|point| point.t_ns));
        shots
    }

    fn is_decided(&self, path: &Path, now_ns: StampNs, rig: &Rig) -> bool {
        let is_court_known = rig.court_from_left().is_some();
        let flight = Flight::from_path(&path.points, is_court_known, rig.physics());
        let is_silent =
            path.points.last().is_none_or(|last| seconds_between(last.t_ns, now_ns) > SILENCE_S);
        let rolls_on =
            is_court_known && self.last_seen.is_some_and(|seen| seen.is_followed_by(path));
        flight.after.len() >= N_AFTER_BOUNCE || is_silent || rolls_on
    }
}

fn shares_a_point(tracklet: &Tracklet, path: &Path) -> bool {
    tracklet.tokens.iter().any(|token| path.point_ids.contains(&token.point_id))
}

fn is_within(tracklet: &Tracklet, path: &Path) -> bool {
    path.points.first().is_some_and(|first| first.t_ns <= tracklet.start_ns())
        && path.points.last().is_some_and(|last| tracklet.end_ns() <= last.t_ns)
}

fn last_seen(path: &Path, bounce_y_m: Option<f64>) -> Option<LastSeen> {
    let last = path.points.last()?;
    Some(LastSeen { t_ns: last.t_ns, y_m: bounce_y_m.unwrap_or(last.position_m.y) })
}

//! Shots during play -> whether a camera has turned since the rig was calibrated.
//!
//! Each shot's evidence of the rig ([`crate::flight::evidence`]) is kept for the last
//! `N_RECENT` shots. What was before these, from the calibration through the first `N_FIRST`
//! shots, is what the rig was like when play began ([`Belief`]); later shots join nothing, so that
//! a camera that drifts slowly is held against its first hour and not against yesterday's drift.
//! After each shot the last 3, 4, 5, 8, 13 and 20 are asked which camera has turned ([`turn`]).
//!
//! **When it is told**: the odds are over `LOG_ODDS_MIN` (one in 10⁶ by chance), without any one of
//! the shots they are still 100, and the turn matters: [`TURN_MIN_RAD`], or
//! [`SHIFT_MIN_M`] at the far baseline. One odd shot is trusted as far as `ODD_SIGMAS`. Which
//! camera it was is told if the odds between them are 100; a camera that looks more to the right is
//! otherwise much like the other one looking more to the left.
//!
//! **Sooner, if the rig says how sure it is**: its doubt widens the gates, so that the sightings
//! around the bounce that tell most of toe-in are not left out. 0.05° is then told by the third
//! shot; with a rig that says nothing by the fourth to eleventh.
//!
//! **Then**: recalibrate. If what is left of the shift would be known to a quarter of it, a refined
//! rig comes with the news; nobody uses it without being asked to.

pub mod turn;
pub mod words;

use crate::calibration::belief::Belief;
use crate::calibration::consequence;
use crate::flight::evidence::Evidence;
use crate::world::rig::Rig;
use nalgebra::Vector2;
use std::collections::VecDeque;
use turn::{News, Story, Turn, Who};

/// Shots that are looked at anew.
const N_RECENT: usize = 20;
const WINDOWS: [usize; 6] = [3, 4, 5, 8, 13, N_RECENT];

/// Shots that tell what the rig was like at first.
const N_FIRST: usize = 30;

/// Odds of 10⁶ to 1 that something has turned.
const LOG_ODDS_MIN: f64 = 13.8;

/// Without any one of the shots odds of 100 to 1 are left.
const LOG_ODDS_LESS: f64 = 4.6;

/// Odds of 100 to 1 that it was this camera.
const LOG_ODDS_WHO: f64 = 4.6;

/// A shot that alone is surer of a turn than this pulls no harder.
const ODD_SIGMAS: f64 = 6.0;

/// A turn smaller than this does not matter (0.02°) unless it shifts bounces by a centimetre.
pub const TURN_MIN_RAD: f64 = 3.5e-4;
/// See [`TURN_MIN_RAD`].
pub const SHIFT_MIN_M: f64 = 0.01;

/// A shift so many times larger than what would be left of it makes a refined rig.
const REFINED_TIMES: f64 = 4.0;

/// The same news is told again after so many shots.
const N_AGAIN: u32 = 20;

/// A camera has turned.
#[derive(Debug, Clone, PartialEq)]
pub struct Alarm {
    /// Who; None if either may have.
    pub who: Option<Who>,
    /// How much, and how sure that is. If either may have turned, both have their part.
    pub turn: Turn,
    /// How far off bounces near the far baseline now are, x and y.
    pub shift_m: Option<Vector2<f64>>,
    /// Shots it was told from.
    pub n_shots: usize,
    /// The rig as it now seems to stand.
    pub refined: Option<Rig>,
}

/// Watches over a rig.
#[derive(Debug, Clone)]
pub struct Watch {
    prior: Belief,
    first: Evidence,
    n_first: usize,
    recent: VecDeque<Evidence>,
    /// What the rig was like before it was found to have turned.
    frozen: Option<Belief>,
    /// Shots since the last news.
    since: Option<u32>,
    was_refined: bool,
}

impl Watch {
    /// Over a rig that was just calibrated.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        Self {
            prior: Belief::of_rig(rig),
            first: Evidence::default(),
            n_first: 0,
            recent: VecDeque::with_capacity(N_RECENT),
            frozen: None,
            since: None,
            was_refined: false,
        }
    }

    /// Takes a shot's evidence in; gives out what is to be told.
    pub fn update(&mut self, evidence: &Evidence, rig: &Rig) -> Option<Alarm> {
        let trust = self.trust(evidence);
        if self.recent.len() == N_RECENT {
            let oldest = self.recent.pop_front()?;
            if self.n_first < N_FIRST {
                self.first.add(&oldest);
                self.n_first += 1;
            }
        }
        self.recent.push_back(evidence.scaled(trust));
        self.since = self.since.map(|n| n.saturating_add(1));
        let (n_shots, turn) = self.found()?;
        let alarm = self.alarm(n_shots, turn, rig)?;
        self.frozen = Some(self.before(n_shots)?);
        let is_news = match self.since {
            None => true,
            Some(n) => n >= N_AGAIN || (alarm.refined.is_some() && !self.was_refined),
        };
        if !is_news {
            return None;
        }
        self.was_refined = alarm.refined.is_some();
        self.since = Some(0);
        Some(alarm)
    }

    /// What the rig was like before the last `n` shots.
    fn before(&self, n: usize) -> Option<Belief> {
        if let Some(frozen) = &self.frozen {
            return Some(frozen.clone());
        }
        let mut evidence = self.first.clone();
        let n_older = (self.recent.len() - n).min(N_FIRST - self.n_first);
        self.recent.iter().take(n_older).for_each(|older| evidence.add(older));
        self.prior.updated(&evidence)
    }

    /// How far a shot is trusted, by what it alone says.
    fn trust(&self, evidence: &Evidence) -> f64 {
        let alone = self.before(0).and_then(|before| News::new(&before, evidence));
        let square = alone.and_then(|news| news.turn_of(Story::ANY)).map_or(0.0, |t| t.square);
        if square > ODD_SIGMAS * ODD_SIGMAS { ODD_SIGMAS / square.sqrt() } else { 1.0 }
    }

    /// The surest turn of all windows, if it is sure enough.
    fn found(&self) -> Option<(usize, Turn)> {
        let windows = WINDOWS.into_iter().filter(|&n| n <= self.recent.len());
        let found = windows.filter_map(|n| {
            let before = self.before(n)?;
            let turn = self.news(&before, n, None)?.best(None)?;
            let is_sure = turn.log_odds > LOG_ODDS_MIN
                && (0..n).all(|left_out| {
                    let news = self.news(&before, n, Some(left_out));
                    let turn = news.and_then(|news| news.turn_of(turn.story));
                    turn.is_some_and(|turn| turn.log_odds > LOG_ODDS_LESS)
                });
            is_sure.then_some((n, turn))
        });
        found.max_by(|a, b| a.1.log_odds.total_cmp(&b.1.log_odds))
    }

    fn news(&self, before: &Belief, n: usize, left_out: Option<usize>) -> Option<News> {
        let mut sum = Evidence::default();
        let last = self.recent.iter().rev().take(n).enumerate();
        last.filter(|(i, _)| Some(*i) != left_out).for_each(|(_, shot)| sum.add(shot));
        News::new(before, &sum)
    }

    /// None if the turn does not matter.
    fn alarm(&self, n_shots: usize, turn: Turn, rig: &Rig) -> Option<Alarm> {
        let news = self.news(&self.before(n_shots)?, n_shots, None)?;
        let stories: Vec<Turn> =
            Who::ALL.into_iter().filter_map(|who| news.best(Some(who))).collect();
        let others = stories.iter().filter(|story| story.story.who != turn.story.who);
        let next = others.map(|story| story.log_odds).fold(f64::NEG_INFINITY, f64::max);
        let who = (next + LOG_ODDS_WHO < turn.log_odds).then_some(turn.story.who);
        let turn = turn::averaged(&stories)?;
        // It was seen with the camera turned and measured with the rig that is not.
        let shift_m = consequence::shifted_by(rig, &-turn.step);
        let is_far = shift_m.is_some_and(|shift| shift.norm() >= SHIFT_MIN_M);
        if turn.step.norm() < TURN_MIN_RAD && !is_far {
            return None;
        }
        // Which camera it was matters little along the court, and is a centimetre across.
        let left = consequence::at_far_baseline(rig, &turn.covariance);
        let is_known = left.zip(shift_m).is_some_and(|(left, shift)| {
            left.along_m.hypot(left.across_m) * REFINED_TIMES < shift.norm()
        });
        let refined = is_known.then(|| refined(rig, &turn)).flatten();
        Some(Alarm { who, turn, shift_m, n_shots, refined })
    }
}

/// The rig with its cameras turned, and as sure of that as the turn is.
fn refined(rig: &Rig, turn: &Turn) -> Option<Rig> {
    let refined = rig.adjusted(&turn.step).ok()?;
    match rig.covariance() {
        Some(covariance) => refined.with_covariance(covariance + turn.covariance).ok(),
        None => Some(refined),
    }
}

#[cfg(test)]
mod tests;

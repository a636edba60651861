//! Tracklets -> flights that are fitted before their balls come down ([`Ahead`]).
//!
//! One flight a frame at most, so that no frame waits for more than one fit. First as the stamps
//! are doubted; then, unless it contradicts them, as they are stated ([`Clock`]); then with what
//! was seen since, frame by frame.

use crate::clock::Clock;
use crate::history::History;
use crate::motion::{World, later_ns, seconds_between};
use crate::path::ahead::Ahead;
use crate::path::{Path, Terms};
use crate::tracklets::Tracklet;
use shm_layout::StampNs;

/// A flight is fitted from this long before its ball comes down on.
const AHEAD_S: f64 = 0.08;

/// And again this long after the last time: once for a frame of both cameras.
const AGAIN_S: f64 = 0.008;

/// A flight that could not be fitted is tried again after this long.
const RETRY_S: f64 = 0.03;

/// Paths of one flight at most: what is no shot the third time is none.
const N_GIVEN_MAX: u32 = 3;

/// One flight.
struct Flight {
    tracklet_id: u64,
    tried_ns: StampNs,
    /// None if it could not be fitted.
    ahead: Option<Ahead>,
    /// What it was fitted with.
    clock_s: [f64; 2],
    /// Whether it was held against what the stamps say.
    is_judged: bool,
    /// Paths through its bounce that were given out.
    n_given: u32,
}

/// Flights whose bounces are awaited.
#[derive(Default)]
pub struct Awaited {
    /// One for each tracklet at most.
    flights: Vec<Flight>,
}

impl Awaited {
    /// Fits the flight that needs it most, if any does.
    pub fn update(
        &mut self,
        tracklets: &[Tracklet],
        now_ns: StampNs,
        history: &History,
        terms: &Terms,
        clock: &Clock,
    ) {
        let is_followed = |flight: &Flight| {
            tracklets.iter().any(|tracklet| tracklet.id == flight.tracklet_id && !tracklet.is_told)
        };
        self.flights.retain(is_followed);
        let due_ns = later_ns(now_ns, AHEAD_S);
        let comes_down = |tracklet: &&Tracklet| {
            !tracklet.is_told
                && tracklet.has_flown_only()
                && tracklet
                    .motion
                    .touches_before_ns(due_ns, &terms.world)
                    .is_some_and(|touch_ns| touch_ns > now_ns)
                && !super::is_from_elsewhere(tracklet, &terms.world)
        };
        let next = tracklets.iter().filter(comes_down).find_map(|tracklet| {
            let at = self.flights.iter().position(|flight| flight.tracklet_id == tracklet.id);
            let is_due = at.is_none_or(|at| self.flights[at].is_due(now_ns));
            is_due.then_some((tracklet, at))
        });
        let Some((tracklet, at)) = next else { return };
        match at {
            Some(at) => self.flights[at].go_on(tracklet, now_ns, history, terms, clock),
            None => self.flights.push(Flight::new(tracklet, now_ns, history, terms)),
        }
    }

    /// Whether a tracklet's flight is fitted.
    #[must_use]
    pub fn has(&self, tracklet: &Tracklet) -> bool {
        let is_its = |flight: &&Flight| flight.tracklet_id == tracklet.id;
        self.flights.iter().find(is_its).is_some_and(|flight| flight.ahead.is_some())
    }

    /// A tracklet's path through its bounce, once that was seen.
    #[must_use]
    pub fn through_bounce(
        &mut self,
        tracklet: &Tracklet,
        history: &History,
        terms: &Terms,
    ) -> Option<Path> {
        let is_its = |flight: &&mut Flight| flight.tracklet_id == tracklet.id;
        let flight = self.flights.iter_mut().find(is_its)?;
        let ahead = flight.ahead.as_ref().filter(|_| flight.n_given < N_GIVEN_MAX)?;
        let path = ahead.through_bounce(history, &flight.terms(terms))?;
        flight.n_given += 1;
        Some(path)
    }
}

impl Flight {
    fn new(tracklet: &Tracklet, now_ns: StampNs, history: &History, terms: &Terms) -> Self {
        Self {
            tracklet_id: tracklet.id,
            tried_ns: now_ns,
            ahead: Ahead::new(tracklet, history, terms),
            clock_s: terms.world.clock_s,
            is_judged: false,
            n_given: 0,
        }
    }

    fn is_due(&self, now_ns: StampNs) -> bool {
        let since_s = seconds_between(self.tried_ns, now_ns);
        match (&self.ahead, self.is_judged) {
            (None, _) => since_s > RETRY_S,
            (Some(_), false) => true,
            (Some(_), true) => since_s > AGAIN_S,
        }
    }

    fn go_on(
        &mut self,
        tracklet: &Tracklet,
        now_ns: StampNs,
        history: &History,
        terms: &Terms,
        clock: &Clock,
    ) {
        let Some(ahead) = &self.ahead else {
            *self = Self::new(tracklet, now_ns, history, terms);
            return;
        };
        self.tried_ns = now_ns;
        if !self.is_judged {
            self.is_judged = true;
            if !clock.is_contradicted(now_ns, ahead.clock_s()) {
                self.clock_s = clock.offset_s(now_ns);
            }
        }
        let again = ahead.updated(history, &self.terms(terms));
        self.ahead = again;
    }

    fn terms<'a>(&self, terms: &Terms<'a>) -> Terms<'a> {
        Terms { world: World { clock_s: self.clock_s, ..terms.world }, ..*terms }
    }
}

#[cfg(test)]
mod tests;

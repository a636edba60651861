//! Tracklet -> the flight of a ball that has not come down yet, so that its bounce is measured in
//! one short fit.
//!
//! While a ball flies nothing is urgent: its path is gathered and its flight fitted then, and again
//! with what was seen since. It is known to millimetres where and when it will come down, and
//! roughly how it will rise ([`rebound`](crate::world::rebound)). So what is left to do when it has
//! come down is to see that it did: see [`Ahead::through_bounce`].

use super::growth::{Given, Growth};
use super::{Path, Terms, tokens};
use crate::history::History;
use crate::look::GATE_SIGMAS;
use crate::rectified::Sighting;
use crate::shot::MIN_FLIGHT_SIGHTINGS;
use crate::tracklets::Tracklet;

/// A sighting farther than this from where the ball would be under the ground shows that it is not
/// there.
const AWAY_SIGMAS: f64 = 5.0;

/// What the frames after the bounce must be worth: one good sighting is worth up to 8, a frame that
/// should show the ball and does not takes 1.2 away. In clutter one sighting is not enough.
const AFTER_WORTH_MIN: f64 = 4.0;

/// Squared distance of all of them together from where a rising ball is expected, in sigmas, for
/// the first sighting and for each more: one in 2000 is farther off. Each camera alone finds a ball
/// that was stopped in the air not far off, but both tell how far away it is.
const SQUARES_MAX: [f64; 2] = [20.0, 6.0];

/// Frames of the cameras come one after the other, so a last sighting may not be that of both.
const OVERLAP_S: f64 = 0.02;

/// A flight that is fitted before its ball comes down.
#[derive(Clone)]
pub struct Ahead {
    /// To all that was seen, and on through the ground.
    falling: Growth,
    /// The same, and on as a ball is expected to rise, with the doubt of that.
    risen: Growth,
    /// Of the path so far.
    worth: f64,
}

impl Ahead {
    /// Of a tracklet that has not bounced. None if both cameras have not seen enough of it, or it
    /// does not come down.
    #[must_use]
    pub fn new(tracklet: &Tracklet, history: &History, terms: &Terms) -> Option<Self> {
        let given = Given { history, terms };
        let before = tokens(tracklet, 0, history, terms);
        if before.len() < MIN_FLIGHT_SIGHTINGS || terms.world.ground_m().is_none() {
            return None;
        }
        let mut falling = Growth::new(tracklet, before, terms)?;
        if falling.launcher_m.is_some() {
            return None; // one camera: how far away it is hangs on its whole path
        }
        falling.grow(false, given);
        falling.finish(terms);
        falling.adopt_launcher_if_near(terms);
        Self::of(falling, given)
    }

    /// With what was seen since, under terms that may be others: what is known of the clocks.
    #[must_use]
    pub fn updated(&self, history: &History, terms: &Terms) -> Option<Self> {
        let given = Given { history, terms };
        let mut falling = self.falling.clone();
        falling.take_terms(terms);
        falling.grow(false, given);
        falling.finish(terms);
        Self::of(falling, given)
    }

    fn of(falling: Growth, given: Given) -> Option<Self> {
        let mut risen = falling.clone();
        risen.go_on(Vec::new(), given.terms)?;
        let worth = falling.gathered([f64::NEG_INFINITY, f64::INFINITY], false, given).worth;
        Some(Self { falling, risen, worth })
    }

    /// What it tells of the clocks: right less left, and 1 sigma.
    #[must_use]
    pub fn clock_s(&self) -> [f64; 2] {
        self.falling.fitted.clock_s()
    }

    /// The path through the bounce, as soon as one was seen: frames after the ball will have come
    /// down show it where it rises to, and not where it would be under the ground. None before.
    ///
    /// The first frame may do. What a ball does that is caught, hit or stopped before it comes down
    /// is to be somewhere else by then, or nowhere.
    #[must_use]
    pub fn through_bounce(&self, history: &History, terms: &Terms) -> Option<Path> {
        let given = Given { history, terms };
        let touch_s = self.risen.fitted.model.touch()?.t_s;
        let last_s = self.risen.sightings.last().map(|s| self.risen.fitted.time_s(s))?;
        let rising = self.risen.gathered([touch_s, f64::INFINITY], true, given);
        let rig = terms.world.rig;
        let is_away = |s: &Sighting| {
            let under = self.falling.fitted.distance(s, rig);
            under.is_some_and(|distance| distance > AWAY_SIGMAS)
        };
        if rising.worth < AFTER_WORTH_MIN || !rising.sightings.iter().any(is_away) {
            return None;
        }
        let [first, more] = SQUARES_MAX;
        let square_max = first + more * (rising.sightings.len() as f64 - 1.0);
        if self.risen.fitted.square_of_all(&rising.sightings, rig)? > square_max {
            return None;
        }
        let since = self.risen.gathered([last_s - OVERLAP_S, f64::INFINITY], true, given);
        let mut whole = self.risen.clone();
        whole.take_in(since.sightings, terms);
        whole.finish(terms);
        let touch_s = whole.fitted.model.touch()?.t_s;
        let is_after = |s: &Sighting| {
            let distance = whole.fitted.distance(s, rig);
            whole.fitted.time_s(s) > touch_s && distance.is_some_and(|d| d <= GATE_SIGMAS)
        };
        if !whole.sightings.iter().any(is_after) {
            return None;
        }
        let evidence = whole.evidence(terms).map(Box::new);
        let Growth { sightings, fitted, has_bounce, .. } = whole;
        let worth = self.worth + rising.worth;
        Some(Path { sightings, fitted: Some(fitted), evidence, has_bounce, worth })
    }
}

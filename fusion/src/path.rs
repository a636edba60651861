//! Tracklet -> path: every sighting of one ball, from its first to some after its bounce.
//!
//! The thesis chains tracklets through a graph (8.2). Here the flight itself does: it is fitted to
//! the tracklet's tokens ([`crate::flight`]), and every frame of [`History`] is asked, at its own
//! time and row, for the spot nearest to where that flight was. What lies within the gate joins,
//! the flight is fitted again, and so on outwards, each way, until nothing new comes. So a ball
//! that was hidden, that only one camera saw, or whose tracklet began late is one path, and a token
//! that was none is left out. What is urgent is fitted before: [`ahead`].

pub mod ahead;
mod growth;

use crate::flight::evidence::Evidence;
use crate::flight::fitted::Fitted;
use crate::history::History;
use crate::motion::World;
use crate::rectified::Sighting;
use crate::tracklets::Tracklet;
use growth::{Given, Growth, N_TOKENS_MIN, ordered};

/// Longest a ball that only one camera saw may have been in its image before it was seen: one that
/// bounced far away fits a flight from the launcher too, but one nobody saw.
const LONE_UNSEEN_MAX_S: f64 = 0.2;

/// Every sighting of one ball.
#[derive(Clone)]
pub struct Path {
    /// In order of time.
    pub sightings: Vec<Sighting>,
    /// The flight that leads through them; None without a court.
    pub fitted: Option<Fitted>,
    /// What it says of the rig; None without a court.
    pub evidence: Option<Box<Evidence>>,
    /// Whether it was seen after a bounce.
    pub has_bounce: bool,
    /// How much likelier a ball on this flight leaves these sightings, in every frame that should
    /// show it, than chance: the logarithm of the ratio. Infinite without a court.
    pub worth: f64,
}

/// How a flight is fitted.
#[derive(Debug, Clone, Copy)]
pub struct Terms<'a> {
    /// Cameras, air, clocks.
    pub world: World<'a>,
    /// 1 sigma of the ground's height.
    pub ground_sigma_m: f64,
    /// 1 sigma by which all centres may be off together.
    pub bias_sigma_px: f64,
}

/// Gathers the sightings of a tracklet's ball; None if there are too few for a flight.
#[must_use]
pub fn along(tracklet: &Tracklet, history: &History, terms: &Terms) -> Option<Path> {
    let [before, after] = [0, 1].map(|n_bounces| tokens(tracklet, n_bounces, history, terms));
    if before.len() < N_TOKENS_MIN {
        return None;
    }
    if terms.world.ground_m().is_none() {
        return Some(Path {
            sightings: before,
            fitted: None,
            evidence: None,
            has_bounce: false,
            worth: f64::INFINITY,
        });
    }
    let given = Given { history, terms };
    let mut growth = Growth::new(tracklet, before, terms)?;
    let is_lone = growth.launcher_m.is_some();
    growth.grow(false, given);
    growth.finish(terms);
    growth.grow(false, given);
    growth = growth.with_rise(after, given);
    if !growth.has_bounce {
        // The tokens after it were none of this ball.
        growth = growth.with_rise(Vec::new(), given);
    }
    growth.finish(terms);
    growth.adopt_launcher_if_near(terms);
    let whole = [f64::NEG_INFINITY, f64::INFINITY];
    let is_late = is_lone && growth.unseen_s(given) > LONE_UNSEEN_MAX_S;
    let worth = match is_late {
        true => f64::NEG_INFINITY,
        false => growth.gathered(whole, growth.has_bounce, given).worth,
    };
    let evidence = growth.evidence(terms).map(Box::new);
    let Growth { sightings, fitted, has_bounce, .. } = growth;
    Some(Path { sightings, fitted: Some(fitted), evidence, has_bounce, worth })
}

/// A tracklet's tokens after so many bounces, by time.
fn tokens(tracklet: &Tracklet, n_bounces: u32, history: &History, terms: &Terms) -> Vec<Sighting> {
    let own = tracklet.tokens.iter().filter(|token| token.n_bounces == n_bounces);
    ordered(own.filter_map(|token| history.sighting(token.id)).copied().collect(), terms)
}

#[cfg(test)]
mod tests;

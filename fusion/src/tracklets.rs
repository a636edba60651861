//! Points of consecutive instants -> tracklets: short runs one ballistic motion explains.
//!
//! Shift-token transfer (thesis 8.1) in windows of instants that overlap. A seed is a pair of
//! points up to three instants apart at a possible speed; from it the next position is predicted
//! ([`crate::motion`], Eq 24 mended), the best point within the gates becomes a token, and so on
//! until `MAX_MISSES` predictions in a row find nothing.
//!
//! **Score** (Eq 25), of the *step* from the last token to the expected and to the actual point:
//! `S = e^(−r/dM) + e^(−θ/π) + e^(−φ/π)`, r their distance, θ and φ the change of azimuth and of
//! elevation. The thesis takes θ and φ of the difference *vector*, whose direction is random just
//! when the hit is good; a perfect hit scored 1.74 where 3 was meant, and the worst one 1.34, above
//! its threshold of 1. Here a perfect hit scores 3. `dM` is what the fastest ball covers since the
//! last token. Beyond `r ≤ dM` a token must lie within `GATE_SIGMAS` of the prediction.
//!
//! Also otherwise: one best point per token in place of recursion over all (exponential); seeds at
//! any instant of the window, not only its first three; missed instants cost
//! `MISS_PENALTY`, they were free.
//!
//! **Limits**, all dropping the least: [`MAX_POINTS`] per instant, [`MAX_SEEDS`] and
//! [`MAX_TRACKLETS`] per window. With 20 false spots per camera a window takes about 10 ms.

use crate::motion::{Motion, azimuth_elevation_rad, seconds_between};
use crate::points::{Point, PointFrame};
use crate::world::ball::{Physics, State};
use crate::{Dropped, Settings};
use shm_layout::StampNs;
use std::collections::{HashSet, VecDeque};
use std::f64::consts::PI;

/// Most points of one instant, best pair first.
pub const MAX_POINTS: usize = 32;

/// Most seeds tried in one window, earliest first.
pub const MAX_SEEDS: usize = 4096;

/// Most tracklets of one window, highest score first.
pub const MAX_TRACKLETS: usize = 32;

/// Fewest tokens worth keeping: the seed's two and two that confirm it.
pub const MIN_TOKENS: usize = 4;

/// Predictions in a row that may find nothing. The thesis allows three; with 30 % of balls missed
/// by each camera half the pairs are missing, and five bring 199 of 200 shots home instead of 195.
const MAX_MISSES: usize = 5;

/// Instants the second point of a seed may be ahead.
const MAX_SEED_STEP: usize = 3;

/// Score lost per instant without a token.
const MISS_PENALTY: f64 = 0.3;

/// Speeds of a ball in play: a rolling one is no longer of interest, 60 m/s is a first serve.
const SPEED_RANGE_M_S: std::ops::RangeInclusive<f64> = 5.0..=60.0;

/// Longest time between two tokens, whatever the frame rate.
const STEP_MAX_S: f64 = 0.12;

/// Mahalanobis gate: five sigma leave room for a pixel sigma that was guessed.
const GATE_SIGMAS: f64 = 5.0;

/// Least Eq 25 score of a token: at the edge of `dM`, a step in the right direction.
const SCORE_MIN: f64 = 2.0;

/// An instant this long after the last one begins a new window: nothing is carried across.
const GAP_MAX_S: f64 = 0.5;

/// A point of a tracklet and what it scored.
#[derive(Debug, Clone, PartialEq)]
pub struct Token {
    /// Which point: the same in every window that holds it.
    pub point_id: u64,
    /// The point.
    pub point: Point,
    /// Eq 25, less what was missed before it; 0 for a seed, which nothing predicted.
    pub score: f64,
}

/// Tokens in order of time, at least [`MIN_TOKENS`].
#[derive(Debug, Clone, PartialEq)]
pub struct Tracklet {
    /// The tokens.
    pub tokens: Vec<Token>,
    /// Motion at the first token.
    pub head: Motion,
    /// Motion at the last token.
    pub tail: Motion,
}

impl Tracklet {
    fn from_tokens(tokens: Vec<Token>, physics: &Physics) -> Option<Self> {
        let points = || tokens.iter().map(|token| &token.point);
        let head = Motion::from_points(points(), physics)?;
        let tail = Motion::from_points(points().rev(), physics)?;
        Some(Self { tokens, head, tail })
    }

    /// Time of the first token.
    #[must_use]
    pub fn start_ns(&self) -> StampNs {
        self.head.t_ns
    }

    /// Time of the last token.
    #[must_use]
    pub fn end_ns(&self) -> StampNs {
        self.tail.t_ns
    }

    /// Sum of the tokens' scores.
    #[must_use]
    pub fn score(&self) -> f64 {
        self.tokens.iter().map(|token| token.score).sum()
    }
}

struct Instant {
    t_ns: StampNs,
    points: Vec<(u64, Point)>,
}

/// A token by its place in the window.
#[derive(Clone, Copy)]
struct Place {
    instant_idx: usize,
    point_idx: usize,
    score: f64,
}

/// Collects instants into overlapping windows and finds the tracklets of each.
#[derive(Default)]
pub struct Windows {
    instants: VecDeque<Instant>,
    n_new: usize,
    next_point_id: u64,
}

impl Windows {
    /// Takes an instant in; gives out the tracklets of a window whenever one is full.
    pub fn update(
        &mut self,
        frame: PointFrame,
        physics: &Physics,
        settings: &Settings,
        dropped: &mut Dropped,
    ) -> Option<Vec<Tracklet>> {
        let last_ns = self.instants.back().map(|last| last.t_ns);
        let is_apart =
            last_ns.is_some_and(|last_ns| seconds_between(last_ns, frame.t_ns) > GAP_MAX_S);
        let before = if is_apart { self.finish(physics, dropped) } else { None };
        self.push(frame, dropped);
        if self.instants.len() < settings.n_window_frames {
            return before;
        }
        let mut found = before.unwrap_or_default();
        found.extend(self.tracklets(physics, dropped));
        let n_kept = settings.n_overlap_frames.min(settings.n_window_frames.saturating_sub(1));
        self.instants.drain(..self.instants.len() - n_kept);
        self.n_new = 0;
        Some(found)
    }

    /// No more instants will come: the tracklets of what is left. None if that is nothing new.
    pub fn finish(&mut self, physics: &Physics, dropped: &mut Dropped) -> Option<Vec<Tracklet>> {
        let found = (self.n_new > 0).then(|| self.tracklets(physics, dropped));
        self.instants.clear();
        self.n_new = 0;
        found
    }

    fn push(&mut self, frame: PointFrame, dropped: &mut Dropped) {
        let ids = self.next_point_id..;
        dropped.n_points_beyond_max += frame.points.len().saturating_sub(MAX_POINTS) as u64;
        let points: Vec<(u64, Point)> =
            ids.zip(frame.points.into_iter().take(MAX_POINTS)).collect();
        self.next_point_id += points.len() as u64;
        self.instants.push_back(Instant { t_ns: frame.t_ns, points });
        self.n_new += 1;
    }

    fn tracklets(&self, physics: &Physics, dropped: &mut Dropped) -> Vec<Tracklet> {
        let mut found: Vec<Vec<Place>> = Vec::new();
        let mut explained: HashSet<[u64; 2]> = HashSet::new();
        let mut n_seeds = 0;
        for seed in self.seeds() {
            let ids = seed.map(|place| self.point(place).0);
            if explained.contains(&ids) {
                continue;
            }
            n_seeds += 1;
            if n_seeds > MAX_SEEDS {
                dropped.n_windows_beyond_max_seeds += 1;
                break;
            }
            let places = self.grown(seed, physics);
            if places.len() < MIN_TOKENS {
                continue;
            }
            // Any two near tokens of it would only grow the same tracklet again.
            for (i, a) in places.iter().enumerate() {
                for b in places.iter().skip(i + 1).take(MAX_SEED_STEP) {
                    explained.insert([self.point(*a).0, self.point(*b).0]);
                }
            }
            found.push(places);
        }
        let mut tracklets: Vec<Tracklet> = found
            .into_iter()
            .filter_map(|places| Tracklet::from_tokens(self.tokens(&places), physics))
            .collect();
        tracklets.sort_by(|a, b| b.score().total_cmp(&a.score()));
        dropped.n_tracklets_beyond_max += tracklets.len().saturating_sub(MAX_TRACKLETS) as u64;
        tracklets.truncate(MAX_TRACKLETS);
        tracklets
    }

    /// Pairs of points at a possible speed, in order of time.
    fn seeds(&self) -> impl Iterator<Item = [Place; 2]> + '_ {
        let places_at = |instant_idx: usize| {
            let n = self.instants.get(instant_idx).map_or(0, |instant| instant.points.len());
            (0..n).map(move |point_idx| Place { instant_idx, point_idx, score: 0.0 })
        };
        (0..self.instants.len())
            .flat_map(places_at)
            .flat_map(move |first| {
                (1..=MAX_SEED_STEP)
                    .flat_map(move |ahead| places_at(first.instant_idx + ahead))
                    .map(move |second| [first, second])
            })
            .filter(|[first, second]| {
                let [a, b] = [self.point(*first).1, self.point(*second).1];
                let dt_s = seconds_between(a.t_ns, b.t_ns);
                let distance_m = (b.position_m - a.position_m).norm();
                dt_s <= STEP_MAX_S && SPEED_RANGE_M_S.contains(&(distance_m / dt_s))
            })
    }

    /// Shift-token transfer: the seed, and the best point of every further instant.
    fn grown(&self, seed: [Place; 2], physics: &Physics) -> Vec<Place> {
        let mut places = seed.to_vec();
        let mut n_missed = 0;
        let mut motion = self.motion(&places, physics);
        for instant_idx in seed[1].instant_idx + 1..self.instants.len() {
            let Some(known) = &motion else { break };
            match self.best_in(instant_idx, known, physics) {
                Some(mut place) => {
                    place.score -= MISS_PENALTY * n_missed as f64;
                    places.push(place);
                    n_missed = 0;
                    motion = self.motion(&places, physics);
                }
                None => n_missed += 1,
            }
            if n_missed > MAX_MISSES {
                break;
            }
        }
        places
    }

    fn motion(&self, places: &[Place], physics: &Physics) -> Option<Motion> {
        Motion::from_points(places.iter().rev().map(|place| &self.point(*place).1), physics)
    }

    /// The point of an instant that goes on best from `motion`, if any is within the gates.
    fn best_in(&self, instant_idx: usize, motion: &Motion, physics: &Physics) -> Option<Place> {
        let instant = &self.instants[instant_idx];
        if seconds_between(motion.t_ns, instant.t_ns) > STEP_MAX_S {
            return None;
        }
        let mut best: Option<Place> = None;
        for (point_idx, (_, point)) in instant.points.iter().enumerate() {
            if let Some(score) = score(motion, point, physics)
                && best.is_none_or(|best| score > best.score)
            {
                best = Some(Place { instant_idx, point_idx, score });
            }
        }
        best
    }

    fn point(&self, place: Place) -> &(u64, Point) {
        &self.instants[place.instant_idx].points[place.point_idx]
    }

    fn tokens(&self, places: &[Place]) -> Vec<Token> {
        places
            .iter()
            .map(|place| {
                let (point_id, point) = *self.point(*place);
                Token { point_id, point, score: place.score }
            })
            .collect()
    }
}

/// Eq 25 as mended above; None outside the gates.
fn score(motion: &Motion, point: &Point, physics: &Physics) -> Option<f64> {
    let dt_s = seconds_between(motion.t_ns, point.t_ns);
    let reach_m = SPEED_RANGE_M_S.end() * dt_s;
    let actual = point.position_m - motion.state.position_m;
    if dt_s <= 0.0 || actual.norm() > 2.0 * reach_m {
        return None; // cheap, before anything is predicted
    }
    let (State { position_m, .. }, covariance) = motion.predicted(point.t_ns, physics);
    let expected = position_m - motion.state.position_m;
    let miss = actual - expected;
    let cholesky = (covariance + point.covariance_m2).cholesky()?;
    let is_near = miss.dot(&cholesky.solve(&miss)) <= GATE_SIGMAS.powi(2);
    let r_m = miss.norm();
    let [azimuth, elevation] = azimuth_elevation_rad(&actual);
    let [azimuth_expected, elevation_expected] = azimuth_elevation_rad(&expected);
    let turn = (azimuth - azimuth_expected).abs();
    let theta = turn.min(2.0 * PI - turn);
    let phi = (elevation - elevation_expected).abs();
    let score = (-r_m / reach_m).exp() + (-theta / PI).exp() + (-phi / PI).exp();
    (is_near && r_m <= reach_m && score >= SCORE_MIN).then_some(score)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pretend;

    /// One point per instant along a flight, with every `n`th left out.
    fn tracklets_of(points: Vec<Point>, is_seen: impl Fn(usize) -> bool) -> Vec<Tracklet> {
        let physics = pretend::reference_rig().physics();
        let settings = Settings::default();
        let (mut windows, mut dropped) = (Windows::default(), Dropped::default());
        let mut found = Vec::new();
        for (i, point) in points.into_iter().enumerate() {
            let points = if is_seen(i) { vec![point] } else { vec![] };
            let frame = PointFrame { t_ns: point.t_ns, points };
            found.extend(windows.update(frame, &physics, &settings, &mut dropped));
        }
        found.extend(windows.finish(&physics, &mut dropped));
        found.into_iter().flatten().collect()
    }

    #[test]
    fn a_perfect_hit_scores_three() {
        let physics = pretend::reference_rig().physics();
        let mut points = pretend::exact_points(6);
        let motion = Motion::from_points(points[..5].iter().rev(), &physics).unwrap();
        let (state, _) = motion.predicted(points[5].t_ns, &physics);
        points[5].position_m = state.position_m;
        assert!((score(&motion, &points[5], &physics).unwrap() - 3.0).abs() < 1e-9);
        points[5].position_m.x += 1.0;
        assert_eq!(score(&motion, &points[5], &physics), None);
    }

    #[test]
    fn windows_overlap_and_share_their_tokens() {
        let found = tracklets_of(pretend::exact_points(60), |_| true);
        let lengths: Vec<usize> = found.iter().map(|tracklet| tracklet.tokens.len()).collect();
        assert_eq!(lengths, [30, 30, 10]);
        let last = found[0].tokens[25].point_id;
        assert_eq!(found[1].tokens[0].point_id, last, "five instants are in both windows");
    }

    #[test]
    fn five_misses_are_bridged_and_six_are_not() {
        let bridged = tracklets_of(pretend::exact_points(28), |i| !(10..15).contains(&i));
        assert_eq!(bridged.iter().map(|t| t.tokens.len()).collect::<Vec<_>>(), [23]);
        let broken = tracklets_of(pretend::exact_points(28), |i| !(10..16).contains(&i));
        assert_eq!(broken.iter().map(|t| t.tokens.len()).collect::<Vec<_>>(), [12, 10]);
    }

    #[test]
    fn what_stands_still_is_no_seed() {
        let mut points = pretend::exact_points(40);
        let place = points[0].position_m;
        points.iter_mut().for_each(|point| point.position_m = place);
        assert!(tracklets_of(points, |_| true).is_empty());
    }
}

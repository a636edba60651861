//! Tracklets -> path: the longest believable chain of tracklets.
//!
//! Tracklets are the nodes of a directed graph, sorted by their first time (the thesis found them
//! "already sorted" and linked only neighbours in the list; here every pair within reach is tried).
//! An edge leads from a to b if
//! - **overlap**: b's head holds tokens of a's tail (windows overlap), or
//! - **extrapolation**: a carried on and b carried back meet between a's end and b's start, within
//!   a margin that grows with the gap. Through a bounce this holds too: the falling and the rising
//!   parabola meet near the ground.
//!
//! A path scores the sum of its tokens, tokens shared counted once, less `GAP_PENALTY_PER_S`.
//! The longest path to every node follows from those before it: O(nodes + edges).

use crate::motion::seconds_between;
use crate::points::Point;
use crate::tracklets::{Token, Tracklet};
use crate::world::ball::Physics;

/// Longest gap an extrapolation bridges: 36 frames at 90 Hz, 8 m of flight.
const GAP_MAX_S: f64 = 0.4;

/// How far two tracklets' ends may reach into each other without sharing a token: one of them took
/// up a false point there.
const REACH_BACK_S: f64 = 0.05;

/// Distance at which carried-on tracklets meet: noise of the ends, spin.
const MEETING_MARGIN_M: f64 = 0.15;

/// How the margin grows: velocity at the end of a tracklet is known to 0.5-1.5 m/s.
const MEETING_MARGIN_M_S: f64 = 2.0;

/// Velocities that meet may differ by this: what a bounce takes off along the ground (5 m/s), and
/// the noise of two ends.
const TURN_LEVEL_MAX_M_S: f64 = 10.0;

/// The same upwards, well above the ground.
const TURN_UPRIGHT_MAX_M_S: f64 = 6.0;

/// Nearer to the ground than this a ball may turn upwards at any speed.
const BOUNCE_HEIGHT_MAX_M: f64 = 0.6;

/// Times looked at in a gap.
const N_MEETING_TIMES: i64 = 16;

/// A third of a frame's worth of tokens per frame at 90 Hz.
const GAP_PENALTY_PER_S: f64 = 80.0;

/// Points of one ball in order of time, from the tracklets that form the longest path.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// The points.
    pub points: Vec<Point>,
    /// Which points, as in [`Token`].
    pub point_ids: Vec<u64>,
    /// Sum of their scores less penalties.
    pub score: f64,
}

/// The longest path through the tracklets; None without tracklets.
#[must_use]
pub fn from_tracklets(tracklets: &[Tracklet], physics: &Physics) -> Option<Path> {
    let mut nodes: Vec<&Tracklet> = tracklets.iter().collect();
    nodes.sort_by_key(|tracklet| (tracklet.start_ns(), tracklet.end_ns()));
    let mut best: Vec<(f64, Option<usize>)> = Vec::with_capacity(nodes.len());
    for (b_idx, b) in nodes.iter().enumerate() {
        let mut here = (b.score(), None);
        for (a_idx, a) in nodes[..b_idx].iter().enumerate() {
            if let Some(gain) = gain(a, b, physics)
                && best[a_idx].0 + gain > here.0
            {
                here = (best[a_idx].0 + gain, Some(a_idx));
            }
        }
        best.push(here);
    }
    let end = (0..nodes.len()).max_by(|&a, &b| best[a].0.total_cmp(&best[b].0))?;
    let chain = std::iter::successors(Some(end), |&idx| best[idx].1).collect::<Vec<_>>();
    let mut tokens: Vec<&Token> = Vec::new();
    for &idx in chain.iter().rev() {
        let last_ns = tokens.last().map(|token| token.point.t_ns);
        tokens.extend(
            nodes[idx].tokens.iter().filter(|t| last_ns.is_none_or(|last| t.point.t_ns > last)),
        );
    }
    Some(Path {
        points: tokens.iter().map(|token| token.point).collect(),
        point_ids: tokens.iter().map(|token| token.point_id).collect(),
        score: best[end].0,
    })
}

/// What b adds to a path that ends with a; None if it does not follow from it.
fn gain(a: &Tracklet, b: &Tracklet, physics: &Physics) -> Option<f64> {
    if b.end_ns() <= a.end_ns() {
        return None;
    }
    let gap_s = seconds_between(a.end_ns(), b.start_ns());
    let is_in_reach = (-REACH_BACK_S..GAP_MAX_S).contains(&gap_s);
    let is_joined = shares_a_token(a, b) || (is_in_reach && meets(a, b, physics));
    if !is_joined {
        return None;
    }
    let is_new = |token: &&Token| token.point.t_ns > a.end_ns();
    let new_score: f64 = b.tokens.iter().filter(is_new).map(|token| token.score).sum();
    Some(new_score - GAP_PENALTY_PER_S * gap_s.max(0.0))
}

fn shares_a_token(a: &Tracklet, b: &Tracklet) -> bool {
    let first_id = b.tokens.first().map(|token| token.point_id);
    a.end_ns() >= b.start_ns()
        && a.tokens.iter().any(|token| {
            first_id <= Some(token.point_id)
                && b.tokens.iter().any(|other| other.point_id == token.point_id)
        })
}

/// Whether a carried on and b carried back come together in the gap between them.
fn meets(a: &Tracklet, b: &Tracklet, physics: &Physics) -> bool {
    let gap_ns = b.start_ns().saturating_sub(a.end_ns());
    let gap_s = seconds_between(a.end_ns(), b.start_ns()).abs();
    let margin_m = MEETING_MARGIN_M + MEETING_MARGIN_M_S * gap_s;
    (0..=N_MEETING_TIMES).any(|i| {
        let t_ns = a.end_ns().saturating_add(gap_ns / N_MEETING_TIMES * i);
        let (from_a, _) = a.tail.predicted(t_ns, physics);
        let (from_b, _) = b.head.predicted(t_ns, physics);
        let turn_m_s = from_b.velocity_m_s - from_a.velocity_m_s;
        let is_bounce = from_b.position_m.z < BOUNCE_HEIGHT_MAX_M && turn_m_s.z > 0.0;
        (from_a.position_m - from_b.position_m).norm() <= margin_m
            && turn_m_s.xy().norm() <= TURN_LEVEL_MAX_M_S
            && (is_bounce || turn_m_s.z.abs() <= TURN_UPRIGHT_MAX_M_S)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::PointFrame;
    use crate::pretend;
    use crate::tracklets::Windows;
    use crate::{Dropped, Settings};
    use nalgebra::Vector3;

    fn tracklets_of(points: &[Point], is_seen: impl Fn(usize) -> bool) -> Vec<Tracklet> {
        let physics = pretend::reference_rig().physics();
        let (mut windows, mut dropped) = (Windows::default(), Dropped::default());
        let mut found = Vec::new();
        for (i, point) in points.iter().enumerate() {
            let points = if is_seen(i) { vec![*point] } else { vec![] };
            let frame = PointFrame { t_ns: point.t_ns, points };
            let settings = Settings::default();
            found.extend(windows.update(frame, &physics, &settings, &mut dropped));
        }
        found.extend(windows.finish(&physics, &mut dropped));
        found.into_iter().flatten().collect()
    }

    #[test]
    fn overlapping_windows_become_one_path_without_doubles() {
        let physics = pretend::reference_rig().physics();
        let points = pretend::exact_points(70);
        let path = from_tracklets(&tracklets_of(&points, |_| true), &physics).unwrap();
        assert_eq!(path.points, points);
        assert!(path.score < 70.0 * 3.0);
    }

    #[test]
    fn a_gap_is_bridged_by_extrapolation() {
        let physics = pretend::reference_rig().physics();
        let points = pretend::exact_points(70);
        let is_seen = |i| !(30..50).contains(&i);
        let path = from_tracklets(&tracklets_of(&points, is_seen), &physics).unwrap();
        assert_eq!(path.points.len(), 50);
    }

    #[test]
    fn a_bounce_is_bridged_where_the_parabolas_meet() {
        let physics = pretend::reference_rig().physics();
        let points = pretend::bouncing_points();
        let is_seen = |i: usize| i % 7 != 3;
        let path = from_tracklets(&tracklets_of(&points, is_seen), &physics).unwrap();
        let n_seen = (0..points.len()).filter(|&i| is_seen(i)).count();
        assert!(path.points.len() + 2 >= n_seen, "{} of {n_seen}", path.points.len());
    }

    #[test]
    fn what_is_elsewhere_is_not_joined_and_the_longer_wins() {
        let physics = pretend::reference_rig().physics();
        let points = pretend::exact_points(60);
        let mut moved = points.clone();
        moved[45..].iter_mut().for_each(|p| p.position_m += Vector3::new(3.0, 0.0, 0.0));
        let path = from_tracklets(&tracklets_of(&moved, |_| true), &physics).unwrap();
        assert_eq!(path.points, points[..45]);
        assert_eq!(from_tracklets(&[], &physics), None);
    }
}

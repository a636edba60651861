//! Balls that were served, shots that were told, frames that were seen → what became of each.

use super::campaign::{Fault, Told};
use super::served::{BallKey, Flown, Held, Miss};
use crate::accuracy::figures::{mean, quantile};
use crate::witness::Seen;
use serde::Serialize;
use shm_layout::StampNs;
use std::collections::{BTreeMap, BTreeSet};

/// A ball that flew within this of a fault may be lost by it: what is in the air before the next
/// frame, and afterwards the half second in which a worker learns the background anew.
const BEFORE_NS: i64 = 100_000_000;
const AFTERWARDS_NS: i64 = 1_000_000_000;

/// Messages of a killed bridge may have been on their way for so long.
const ON_THE_WAY_NS: i64 = 100_000_000;

/// Balls, by what became of them.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Balls {
    /// That bounced.
    pub n_served: usize,
    /// Shots within their own 99.9 % ellipse.
    pub n_measured: usize,
    /// Without one, but with a fault during the flight.
    pub n_explained: usize,
    /// Without one, and without a reason.
    pub unexplained: Vec<String>,
    /// Outside of their ellipse, or of no ball.
    pub wrong: Vec<String>,
    /// Shots that say that no bounce was measured.
    pub n_without_bounce: usize,
    /// Mean distance from the truth, mm.
    pub mean_off_mm: f64,
    /// From the bounce until the shot was told, ms: p50, p99, most.
    pub told_after_ms: [f64; 3],
}

/// Frames of both boards.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Frames {
    /// Captured by each board.
    pub n_captured: [u64; 2],
    /// Complete there.
    pub n_complete: [u64; 2],
    /// Complete on a board, not beside fusion, and no bridge was away.
    pub unexplained: Vec<String>,
    /// Numbers of the calm time that were not complete on the board, or not beside fusion.
    pub n_lost_in_calm: u64,
    /// Frames of the calm time.
    pub n_in_calm: u64,
    /// From published to complete beside fusion in the calm time, ms: p50, p99, most.
    pub way_ms: [f64; 3],
}

/// Draws the balance of balls.
#[must_use]
pub fn balls_from(served: &[Flown], told: &[Told], faults: &[Fault]) -> Balls {
    let mut balls = Balls { n_served: served.len(), ..Balls::default() };
    let (mut measured, mut off_m, mut after_ms) = (BTreeSet::new(), Vec::new(), Vec::new());
    let of = |key: BallKey| format!("ball {} of lap {}", key.ball_idx + 1, key.lap);
    for shot in told {
        match shot.held {
            Held::Right(key, off) => {
                if !measured.insert(key) {
                    balls.wrong.push(format!("{} was told twice", of(key)));
                }
                off_m.push(off);
                after_ms.push(shot.after_ms);
            }
            Held::Wrong(key, miss) => {
                let flown = served.iter().find(|flown| flown.key == key);
                balls.wrong.push(format!("{}: {}", of(key), wrong_words(miss, flown, faults)));
            }
            Held::WithoutBounce => balls.n_without_bounce += 1,
            Held::Invented => balls.wrong.push("a shot that nobody served".to_owned()),
        }
    }
    for flown in served {
        if measured.contains(&flown.key) {
            balls.n_measured += 1;
        } else if is_explained(flown, faults) {
            balls.n_explained += 1;
        } else {
            balls.unexplained.push(of(flown.key));
        }
    }
    balls.mean_off_mm = mean(&off_m).unwrap_or(0.0) * 1e3;
    balls.told_after_ms =
        [0.5, 0.99, 1.0].map(|share| quantile(&after_ms, share).unwrap_or(f64::NAN));
    balls
}

/// By how much a shot was wrong, and what was done while its ball flew.
fn wrong_words(miss: Miss, flown: Option<&Flown>, faults: &[Fault]) -> String {
    let [x, y] = miss.off_m.map(|off| off * 1e3);
    let [sigma_x, sigma_y] = miss.sigma_m.map(|sigma| sigma * 1e3);
    let meanwhile = faults.iter().filter(|fault| flown.is_some_and(|flown| met(fault, flown)));
    let meanwhile = meanwhile.map(|fault| {
        let after_ms = flown.map_or(0, |flown| (fault.at_ns - flown.launched_ns) / 1_000_000);
        let (part, kind, for_ms) = (fault.part, fault.kind, fault.recovery_ms());
        format!("{part} {kind:?} {after_ms} ms after the launch, for {for_ms:.0} ms")
    });
    let meanwhile: Vec<String> = meanwhile.collect();
    let meanwhile = match meanwhile.is_empty() {
        true => "nothing was done".to_owned(),
        false => meanwhile.join(", "),
    };
    format!(
        "off by {x:.1}, {y:.1} mm (stated {sigma_x:.1}, {sigma_y:.1}), {:.1} squared sigmas; \
         {meanwhile}",
        miss.squared_sigmas
    )
}

fn is_explained(flown: &Flown, faults: &[Fault]) -> bool {
    faults.iter().any(|fault| fault.part.is_needed_for_shots() && met(fault, flown))
}

/// Whether a ball may have been lost by a fault.
fn met(fault: &Fault, flown: &Flown) -> bool {
    let until_ns = flown.bounced_ns.unwrap_or(flown.launched_ns);
    fault.at_ns - BEFORE_NS < until_ns + AFTERWARDS_NS
        && fault.recovered_ns + AFTERWARDS_NS > flown.launched_ns
}

/// Draws the balance of frames; the calm time has a begin and an end.
#[must_use]
pub fn frames_from(
    calm_ns: [StampNs; 2],
    faults: &[Fault],
    seen_on_boards: &[Seen; 2],
    seen_at_fusion: &Seen,
) -> Frames {
    let away = faults.iter().filter(|fault| fault.part.is_bridge());
    let away = away.map(|fault| fault.at_ns - ON_THE_WAY_NS..=fault.recovered_ns);
    // Before the first whole frame beside fusion the bridges were not there yet either: one that
    // joins between a frame's info and its last strip brings a part of it.
    let firsts = [0, 1].map(|idx: u32| {
        let of_camera = seen_at_fusion.frames.values().filter(move |f| f.camera_idx == idx);
        let whole = of_camera.filter(|frame| frame.complete_ns.is_some());
        whole.map(|frame| frame.published_ns).min().unwrap_or_default()
    });
    let away: Vec<_> = away.chain([StampNs::MIN..=firsts[0].max(firsts[1])]).collect();
    let mut frames = Frames::default();
    let mut way_ms = Vec::new();
    for (board, seen) in seen_on_boards.iter().enumerate() {
        frames.n_captured[board] = seen.n_captured();
        frames.n_complete[board] = seen.n_complete;
        let mut ends: BTreeMap<u64, [u64; 3]> = BTreeMap::new();
        for (key @ (recording_id, frame_idx), frame) in &seen.frames {
            let there = seen_at_fusion.frames.get(key).and_then(|there| there.complete_ns);
            let is_away = away.iter().any(|window| window.contains(&frame.published_ns));
            let is_missed = frame.complete_ns.is_some() && there.is_none() && !is_away;
            if is_missed {
                frames.unexplained.push(missed_text(board, *frame_idx, frame.published_ns, faults));
            }
            if calm_ns[0] <= frame.published_ns && frame.published_ns < calm_ns[1] {
                let [first, last, n_there] =
                    ends.entry(*recording_id).or_insert([*frame_idx, 0, 0]);
                *last = *frame_idx + 1;
                *first = (*first).min(*frame_idx);
                *n_there += u64::from(frame.complete_ns.is_some() && there.is_some());
                way_ms.extend(there.map(|at_ns| (at_ns - frame.published_ns) as f64 * 1e-6));
            }
        }
        for [first, last, n_there] in ends.into_values() {
            frames.n_in_calm += last - first;
            frames.n_lost_in_calm += last - first - n_there;
        }
    }
    frames.way_ms = [0.5, 0.99, 1.0].map(|share| quantile(&way_ms, share).unwrap_or(f64::NAN));
    frames
}

/// Which frame, and the faults around it.
fn missed_text(board: usize, frame_idx: u64, at_ns: StampNs, faults: &[Fault]) -> String {
    let words = |fault: Option<&Fault>| {
        fault.map_or("nothing".to_owned(), |fault| {
            let Fault { part, kind, .. } = fault;
            let ms = (fault.at_ns - at_ns) as f64 * 1e-6;
            format!("{part} ({kind:?}, back in {:.0} ms) at {ms:+.0} ms", fault.recovery_ms())
        })
    };
    let before = words(faults.iter().rfind(|fault| fault.at_ns < at_ns));
    let after = words(faults.iter().find(|fault| fault.at_ns >= at_ns));
    format!("frame {frame_idx} of board {board}, between {before} and {after}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of one camera, 10 ms apart from 1 s on: which are whole.
    fn seen(camera_idx: u32, shift_ns: StampNs, are_whole: &[(u64, bool)]) -> Seen {
        let mut seen = Seen::default();
        for &(frame_idx, is_whole) in are_whole {
            let frame = seen.frames.entry((u64::from(camera_idx), frame_idx)).or_default();
            frame.camera_idx = camera_idx;
            frame.published_ns = 1_000_000_000 + frame_idx as StampNs * 10_000_000 + shift_ns;
            frame.complete_ns = is_whole.then_some(frame.published_ns + 1_000_000);
        }
        seen
    }

    #[test]
    fn frames_are_lost_unexplained_once_the_bridges_have_brought_a_whole_one() {
        let whole = [(0, true), (1, true), (2, true), (3, true)];
        let boards = [seen(0, 0, &whole), seen(1, 0, &whole)];
        // A bridge joined in the middle of the left camera's first frame; fusion's clock is behind.
        let mut at_fusion = seen(0, -50_000, &[(0, false), (1, true), (2, false), (3, true)]);
        at_fusion.frames.extend(seen(1, -50_000, &whole).frames);
        let calm_ns = [1_005_000_000, 1_100_000_000];
        let frames = frames_from(calm_ns, &[], &boards, &at_fusion);
        assert_eq!(frames.unexplained, ["frame 2 of board 0, between nothing and nothing"]);
        assert_eq!((frames.n_in_calm, frames.n_lost_in_calm), (6, 1));
    }
}

//! Tallies -> the stage at which a ball was lost, and one sentence that says why.
//!
//! The farthest stage that anything reached in the window is the one: a path that was judged, else
//! a ball that was followed, else what there was to sow it from. Frames that never came are told
//! besides, for they are often the reason.

use super::Window;
use super::tally::{self, BothTally, CameraTally};
use super::trace::{JudgementNote, Trace};
use crate::motion::seconds_between;
use crate::shot::{Outcome, Rejection};
use crate::tracklets::{End, TrackletNote};
use crate::world::rig::Rig;
use crate::{decided, lone, seeds};
use shm_layout::{Camera, StampNs};
use std::ops::RangeInclusive;

/// A ball that fewer frames than this show of a camera cannot be found: two points and what
/// confirms them.
const N_WITH_MIN: u64 = 4;

/// Most gaps that a sentence names.
const MAX_NAMED: usize = 4;

/// Where a ball was lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// It was not: a shot was told.
    Told(Outcome),
    /// Its path was fitted or judged, and was no shot.
    Judged(Rejection),
    /// It was followed, and not to its end.
    Followed,
    /// Points there were, but no flight was confirmed by what else was seen.
    Seeds,
    /// Pairs there were, but no ball can be where they are.
    Points,
    /// Both cameras had candidates, but none that go together.
    Pairs,
    /// Candidates there were, but none within the image.
    Rectified,
    /// Frames came, but without candidates.
    Candidates,
    /// The background was still being learned.
    Learning,
    /// One camera's frames did not come, and the other's are not enough.
    SecondCamera,
    /// Neither camera's frames came.
    Arrival,
}

/// What a window is explained from.
pub struct Facts<'a> {
    /// What happened.
    pub trace: &'a Trace,
    /// When.
    pub window: &'a Window,
    /// What the cameras' frames brought, left and right.
    pub cameras: &'a [CameraTally; 2],
    /// What was made of both.
    pub both: &'a BothTally,
    /// With which rig.
    pub rig: &'a Rig,
}

impl Facts<'_> {
    /// A time in seconds since the first frame.
    #[must_use]
    pub fn s_of(&self, t_ns: StampNs) -> f64 {
        seconds_between(self.trace.first_ns.unwrap_or(t_ns), t_ns)
    }

    /// Judgements of the window.
    pub fn judgements(&self) -> impl Iterator<Item = &JudgementNote> {
        tally::judgements(self.trace, self.window)
    }

    /// Tracklets of the window that have ended.
    pub fn tracklets(&self) -> impl Iterator<Item = &TrackletNote> {
        self.trace.tracklets.iter().filter(|tracklet| self.window.overlaps(tracklet.span_ns))
    }

    /// Where the ball was lost and why.
    #[must_use]
    pub fn stage_and_sentence(&self) -> (Stage, String) {
        let (stage, mut sentence) = self.farthest();
        if stage != Stage::SecondCamera && stage != Stage::Arrival {
            for (camera, tally) in Camera::BOTH.into_iter().zip(self.cameras) {
                if let Some(gone) = self.gone(tally).filter(|_| tally.is_there) {
                    sentence += &format!("; the {camera} camera's {gone}");
                }
            }
        }
        (stage, sentence)
    }

    fn farthest(&self) -> (Stage, String) {
        let told = self.trace.shots.iter().find(|shot| self.window.overlaps(shot.span_ns));
        if let Some(shot) = told {
            let [from_s, to_s] = shot.span_ns.map(|t_ns| self.s_of(t_ns));
            let outcome = shot.outcome.text();
            let sentence = format!("a shot from {from_s:.2} to {to_s:.2} s was told: {outcome}");
            return (Stage::Told(shot.outcome), sentence);
        }
        let worth = |judgement: &JudgementNote| judgement.worth.unwrap_or(f64::NEG_INFINITY);
        let n_of = |judgement: &JudgementNote| judgement.n_sightings.iter().sum::<usize>();
        let best = self
            .judgements()
            .max_by(|a, b| worth(a).total_cmp(&worth(b)).then(n_of(a).cmp(&n_of(b))));
        if let Some((judgement, rejection)) = best.and_then(|j| Some((j, j.said.err()?))) {
            return (Stage::Judged(rejection), self.judged(judgement, rejection));
        }
        if let Some(tracklet) = self.tracklets().max_by_key(|tracklet| tracklet.n_found) {
            let [from_s, to_s] = tracklet.span_ns.map(|t_ns| self.s_of(t_ns));
            let end = end_words(tracklet.end);
            let sentence = format!("a ball was followed from {from_s:.2} to {to_s:.2} s: {end}");
            return (Stage::Followed, sentence);
        }
        self.before_seeds()
    }

    fn judged(&self, judgement: &JudgementNote, rejection: Rejection) -> String {
        let [from_s, to_s] = judgement.span_ns.map(|t_ns| self.s_of(t_ns));
        let [left, right] = judgement.n_sightings;
        let why = match (rejection, judgement.worth) {
            (Rejection::Unlikely, Some(worth)) => format!(
                "its flight should have been seen far more often: it is worth {worth:.1}, {} is \
                 needed",
                decided::WORTH_MIN
            ),
            _ => rejection_words(rejection).to_owned(),
        };
        format!(
            "a ball was followed from {from_s:.2} to {to_s:.2} s, seen {left} times by the left \
             and {right} times by the right camera, but {why}"
        )
    }

    /// Nothing was followed: what there was to begin with.
    fn before_seeds(&self) -> (Stage, String) {
        let [left, right] = self.cameras;
        match (left.is_missing(), right.is_missing()) {
            (true, true) => {
                let gone = |camera, tally| self.gone_words(camera, tally);
                let [left, right] = [gone(Camera::Left, left), gone(Camera::Right, right)];
                return (Stage::Arrival, format!("{left}; {right}"));
            }
            (true, false) => return self.one_camera(Camera::Right, Camera::Left),
            (false, true) => return self.one_camera(Camera::Left, Camera::Right),
            (false, false) => {}
        }
        if let Some(camera) = self.first_camera(|tally| 2 * tally.n_learning > tally.n_arrived) {
            let n = self.cameras[camera.idx()].n_learning;
            let sentence = format!(
                "the {camera} camera's background was being learned in {n} frames: no candidates \
                 are reported then"
            );
            return (Stage::Learning, sentence);
        }
        let [left_has, right_has] = [left, right].map(|tally| self.has_candidates(tally));
        if left.n_with < N_WITH_MIN || right.n_with < N_WITH_MIN {
            let sentence = format!(
                "what came was looked at, but too few frames have candidates: the left camera has \
                 {left_has}, the right one {right_has}"
            );
            return (Stage::Candidates, sentence);
        }
        if let Some(camera) = self.first_camera(|tally| tally.n_rectified() == 0) {
            let sentence = format!("no candidate of the {camera} camera is within its image");
            return (Stage::Rectified, sentence);
        }
        self.of_both()
    }

    /// Both cameras have candidates.
    fn of_both(&self) -> (Stage, String) {
        let BothTally { n_instants, n_pairs, n_points, tried, .. } = *self.both;
        if n_pairs == 0 {
            let sentence = format!(
                "in {n_instants} instants no candidate of the left camera goes with one of the \
                 right: rows or sizes disagree, as with a rig or clocks that are wrong"
            );
            return (Stage::Pairs, sentence);
        }
        if n_points == 0 {
            let sentence =
                format!("{n_pairs} pairs of candidates, none where a ball can be on this court");
            return (Stage::Points, sentence);
        }
        let sentence = match tried.best_worth {
            None => format!("{n_points} points, no two of which a ball in play could have passed"),
            Some(best) => format!(
                "{n_points} points and {} flights through two of them, none confirmed by what \
                 else was seen: {} worth too little (the best {best:.1}, {} is needed), {} seen by \
                 one camera only, {} by too few frames",
                tried.n,
                tried.n_unlikely,
                seeds::WORTH_MIN,
                tried.n_one_camera,
                tried.n_few_hits,
            ),
        };
        (Stage::Seeds, sentence)
    }

    /// One camera's frames are there, the other's are not.
    fn one_camera(&self, there: Camera, missing: Camera) -> (Stage, String) {
        let tally = &self.cameras[there.idx()];
        let gone = self.gone_words(missing, &self.cameras[missing.idx()]);
        let has = self.has_candidates(tally);
        if tally.n_with < N_WITH_MIN {
            return (Stage::Candidates, format!("the {there} camera has {has}; {gone}"));
        }
        let alone = &self.both.tried_alone;
        let is_place_known =
            self.rig.court_from_left().is_some() && self.rig.launcher_in_court_m().is_some();
        let why = match (is_place_known, alone.best_worth) {
            (false, _) => "no second camera, and the rig names no launcher's place".to_owned(),
            (true, None) => {
                "no second camera, and no flight from the launcher fits the first one's candidates"
                    .to_owned()
            }
            (true, Some(best)) => format!(
                "no second camera, and none of {} flights from the launcher was confirmed by the \
                 first one (the best is worth {best:.1}, {} is needed)",
                alone.n,
                lone::WORTH_MIN
            ),
        };
        (Stage::SecondCamera, format!("the {there} camera has {has}; {gone}: {why}"))
    }

    fn first_camera(&self, is_so: impl Fn(&CameraTally) -> bool) -> Option<Camera> {
        Camera::BOTH.into_iter().find(|camera| is_so(&self.cameras[camera.idx()]))
    }

    /// "candidates from 12.31 to 13.02 s in 61 of 64 frames".
    fn has_candidates(&self, tally: &CameraTally) -> String {
        let Some(span_ns) = tally.with_ns else {
            return format!("no candidates in {} frames", tally.n_arrived);
        };
        let [from_s, to_s] = span_ns.map(|t_ns| self.s_of(t_ns));
        let frames = tally.n_between;
        format!("candidates from {from_s:.2} to {to_s:.2} s in {} of {frames} frames", tally.n_with)
    }

    fn gone_words(&self, camera: Camera, tally: &CameraTally) -> String {
        match (tally.is_there, self.gone(tally)) {
            (false, _) => format!("there is no {camera} camera"),
            (true, Some(gone)) => format!("the {camera} camera's {gone}"),
            (true, None) => format!("no frame of the {camera} camera came"),
        }
    }

    /// "frames 1107..1375 never arrived (lost on the link)"; None if all did.
    #[must_use]
    pub fn gone(&self, tally: &CameraTally) -> Option<String> {
        let mut parts = Vec::new();
        if !tally.lost.is_empty() {
            let named = named(&tally.lost);
            parts.push(format!("frames {named} never arrived (lost on the link or its board)"));
        }
        if let Some(since_ns) = tally.silent_since_ns {
            let since_s = self.s_of(since_ns);
            parts.push(format!("last frame is of {since_s:.2} s: none has arrived since"));
        }
        if tally.n_late > 0 {
            parts.push(format!("{} frames arrived too late", tally.n_late));
        }
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

/// Some ranges of numbers, and how many more there are.
#[must_use]
pub fn named(ranges: &[RangeInclusive<u64>]) -> String {
    let name = |range: &RangeInclusive<u64>| match range.start() == range.end() {
        true => range.start().to_string(),
        false => format!("{}..{}", range.start(), range.end()),
    };
    let names: Vec<String> = ranges.iter().take(MAX_NAMED).map(name).collect();
    let n_more = ranges.len().saturating_sub(MAX_NAMED);
    let more = if n_more > 0 { format!(" and {n_more} more gaps") } else { String::new() };
    names.join(", ") + &more
}

/// Why a tracklet is followed no longer, in words.
#[must_use]
pub fn end_words(end: End) -> &'static str {
    match end {
        End::Silent => "then nothing was found for 0.3 s",
        End::OneCamera => "one camera missed it for 30 frames while the other went on",
        End::Crowded => "given up, as too many others were worth more",
        End::Over => "then the recording was over",
    }
}

/// Why a path is no shot, in words.
#[must_use]
pub fn rejection_words(rejection: Rejection) -> &'static str {
    match rejection {
        Rejection::TooShort => "too little of it is on one flight before a bounce",
        Rejection::TooSlow => "it flew slower than any launch",
        Rejection::AwayFromNet => "it did not fly towards the far baseline",
        Rejection::NotFromLauncher => "flown back, it does not come from the launcher",
        Rejection::OnGround => "it never left the ground: a shadow, or a ball that rolls",
        Rejection::SameBall => "it is the ball of a shot that was told",
        Rejection::Unlikely => "its flight should have been seen far more often",
    }
}

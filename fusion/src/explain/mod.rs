//! Trace + window -> why a ball was lost, stage by stage.
//!
//! [`trace`] is what the stages noted while they ran, [`tally`] its sums in a window, [`stage`]
//! says at which stage the ball was lost and in one sentence why, [`report`] tells of all stages in
//! their order. Nothing is measured again: what is told is what happened.
//!
//! Times are seconds since the first frame, each on its own camera's clock. A file of candidates
//! has no row for a frame without any, so of such files lost frames are not known.

pub mod report;
pub mod stage;
pub mod tally;
pub mod trace;

use crate::motion::later_ns;
use crate::world::rig::Rig;
use shm_layout::{Camera, StampNs};
use stage::{Facts, Stage};
use trace::Trace;

/// What is looked at around a time.
const BEFORE_S: f64 = 0.5;
const AFTER_S: f64 = 2.0;

/// What is looked at before and after a shot.
const MARGIN_S: f64 = 0.3;

/// The part of a run that is explained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Its first instant.
    pub from_ns: StampNs,
    /// Its last instant.
    pub to_ns: StampNs,
}

impl Window {
    /// Around a time in seconds since the first frame; None if there was no frame.
    #[must_use]
    pub fn at_s(trace: &Trace, at_s: f64) -> Option<Self> {
        let at_ns = later_ns(trace.first_ns?, at_s);
        Some(Self { from_ns: later_ns(at_ns, -BEFORE_S), to_ns: later_ns(at_ns, AFTER_S) })
    }

    /// Around the Nth shot, counted from 1; None if there was none.
    #[must_use]
    pub fn of_shot(trace: &Trace, number: u64) -> Option<Self> {
        let [from_ns, to_ns] = trace.shot(number)?.span_ns;
        Some(Self { from_ns: later_ns(from_ns, -MARGIN_S), to_ns: later_ns(to_ns, MARGIN_S) })
    }

    /// All of a run; None if there was no frame.
    #[must_use]
    pub fn whole(trace: &Trace) -> Option<Self> {
        let times_ns = || trace.frames.iter().map(|frame| frame.t_ns);
        Some(Self { from_ns: times_ns().min()?, to_ns: times_ns().max()? })
    }

    /// Whether a time is in it.
    #[must_use]
    pub fn contains(&self, t_ns: StampNs) -> bool {
        (self.from_ns..=self.to_ns).contains(&t_ns)
    }

    /// Whether some of a span is in it.
    #[must_use]
    pub fn overlaps(&self, [from_ns, to_ns]: [StampNs; 2]) -> bool {
        from_ns <= self.to_ns && to_ns >= self.from_ns
    }
}

/// Why a ball was lost, or what was told of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Explanation {
    /// Where it was lost.
    pub stage: Stage,
    /// Why, in one sentence.
    pub sentence: String,
    /// All stages, a few lines each, and the sentence.
    pub text: String,
}

/// Explains a window of a run.
#[must_use]
pub fn explained(trace: &Trace, window: &Window, rig: &Rig) -> Explanation {
    let cameras = Camera::BOTH.map(|camera| tally::of_camera(camera, trace, window));
    let both = tally::of_both(trace, window);
    let facts = Facts { trace, window, cameras: &cameras, both: &both, rig };
    let (stage, sentence) = facts.stage_and_sentence();
    let text = report::text_of(&facts, &sentence);
    Explanation { stage, sentence, text }
}

#[cfg(test)]
mod tests;

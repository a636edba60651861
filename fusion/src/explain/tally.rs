//! Notes of a window -> what each camera's frames brought, and what was made of both.

use super::trace::{Fate, FrameNote, Trace};
use super::{Window, trace};
use crate::arrivals;
use crate::history::SILENT_S;
use crate::motion::seconds_between;
use crate::seeds::Tried;
use shm_layout::{Camera, StampNs};
use std::ops::RangeInclusive;

/// What one camera's frames of a window brought.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CameraTally {
    /// Whether a frame of it ever came.
    pub is_there: bool,
    /// Frames that came.
    pub n_arrived: u64,
    /// Numbers of the frames that are known to be lost.
    pub lost: Vec<RangeInclusive<u64>>,
    /// The stamp after which no frame came any more, though the other camera's did.
    pub silent_since_ns: Option<StampNs>,
    /// Whether that was before the middle of the window.
    pub is_silent_mostly: bool,
    /// Frames that came too late to be looked at.
    pub n_late: u64,
    /// Frames whose stamp was not after that of the frame before.
    pub n_backward: u64,
    /// Frames in which the background was still being learned.
    pub n_learning: u64,
    /// Frames with candidates.
    pub n_with: u64,
    /// The first and the last of them.
    pub with_ns: Option<[StampNs; 2]>,
    /// Frames that came from the first of them to the last.
    pub n_between: u64,
    n_since_last_with: u64,
    /// Candidates.
    pub n_candidates: u64,
    /// Spots beyond the most a frame may have.
    pub n_beyond_max: u64,
    /// Candidates that are not finite numbers.
    pub n_not_finite: u64,
    /// Candidates outside the image.
    pub n_outside_image: u64,
    /// Candidates of each frame, a sign each: see `sign_of`.
    pub signs: String,
}

impl CameraTally {
    /// Frames that are known to be lost.
    #[must_use]
    pub fn n_lost(&self) -> u64 {
        self.lost.iter().fold(0, |n, lost| n.saturating_add(1 + lost.end() - lost.start()))
    }

    /// Candidates that were rectified.
    #[must_use]
    pub fn n_rectified(&self) -> u64 {
        self.n_candidates.saturating_sub(self.n_not_finite + self.n_outside_image)
    }

    /// Whether less than half of its frames were looked at.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        let n_gone = self.n_lost().saturating_add(self.n_late);
        let n_used = self.n_arrived - self.n_late - self.n_backward;
        !self.is_there || self.n_arrived == 0 || n_gone > n_used || self.is_silent_mostly
    }

    fn add(&mut self, frame: &FrameNote) {
        self.n_arrived += 1;
        self.n_late += u64::from(frame.fate == Fate::Late);
        self.n_backward += u64::from(frame.fate == Fate::Backward);
        self.n_learning += u64::from(frame.is_learning);
        self.n_candidates += frame.n_candidates;
        self.n_beyond_max += frame.n_beyond_max;
        self.n_not_finite += frame.n_not_finite;
        self.n_outside_image += frame.n_outside_image;
        self.n_since_last_with += 1;
        if frame.n_candidates > 0 {
            let is_first = self.with_ns.is_none();
            self.n_between += if is_first { 1 } else { self.n_since_last_with };
            self.n_since_last_with = 0;
            self.n_with += 1;
            let first_ns = self.with_ns.map_or(frame.t_ns, |[first_ns, _]| first_ns);
            self.with_ns = Some([first_ns, frame.t_ns]);
        }
    }
}

/// A digit for a frame's candidates, `+` for more than nine, `~` while the background is learned,
/// `!` for a frame that came too late or with a stamp that goes back.
fn sign_of(frame: &FrameNote) -> char {
    match (frame.fate, frame.is_learning) {
        (Fate::Late | Fate::Backward, _) => '!',
        (_, true) => '~',
        _ => u32::try_from(frame.n_candidates)
            .ok()
            .and_then(|n| char::from_digit(n, 10))
            .unwrap_or('+'),
    }
}

/// Most signs of frames that did not come, in one gap.
const MAX_GAP_SIGNS: u64 = 90;

/// What one camera's frames of a window brought.
#[must_use]
pub fn of_camera(camera: Camera, trace: &Trace, window: &Window) -> CameraTally {
    let mut tally = CameraTally::default();
    let mut last: Option<&FrameNote> = None;
    let span_ns = [window.from_ns, window.to_ns];
    for frame in trace.frames.iter().filter(|frame| frame.camera == camera) {
        tally.is_there = true;
        if frame.fate != Fate::Backward {
            let last = last.replace(frame).filter(|last| last.recording_id == frame.recording_id);
            let ends = last.map(|last| [last, frame].map(|end| (end.frame_idx, end.t_ns)));
            if let Some(lost) = ends.and_then(|ends| arrivals::lost_between(ends, span_ns)) {
                let n_signs = (lost.end() - lost.start()).min(MAX_GAP_SIGNS - 1) + 1;
                tally.signs.extend((0..n_signs).map(|_| '.'));
                tally.lost.push(lost);
            }
        }
        if window.contains(frame.t_ns) {
            tally.add(frame);
            tally.signs.push(sign_of(frame));
        }
    }
    tally.silent_since_ns = silent_since_ns(camera, trace, window);
    let middle_ns = window.from_ns.midpoint(window.to_ns);
    tally.is_silent_mostly = tally.silent_since_ns.is_some_and(|since_ns| since_ns < middle_ns);
    tally
}

/// When a camera's last frame of all was taken, if the window goes on for long without it.
fn silent_since_ns(camera: Camera, trace: &Trace, window: &Window) -> Option<StampNs> {
    let last_of = |camera| {
        let own = trace.frames.iter().filter(|frame| frame.camera == camera);
        own.map(|frame| frame.t_ns).max()
    };
    let own_ns = last_of(camera)?;
    let other_ns = Camera::BOTH.into_iter().filter_map(last_of).max()?.min(window.to_ns);
    let is_gone = seconds_between(own_ns, other_ns) > SILENT_S;
    is_gone.then_some(own_ns)
}

/// What was made of both cameras' frames in a window.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BothTally {
    /// Instants at which both had a frame.
    pub n_instants: u64,
    /// Pairs of candidates.
    pub n_pairs: u64,
    /// Points where a ball can be.
    pub n_points: u64,
    /// Points where none can be.
    pub n_outside_court: u64,
    /// Hypotheses of two cameras.
    pub tried: Tried,
    /// Hypotheses of one camera alone.
    pub tried_alone: Tried,
    /// Frames for which one camera was taken for alone.
    pub n_alone: u64,
}

/// What was made of both cameras' frames in a window.
#[must_use]
pub fn of_both(trace: &Trace, window: &Window) -> BothTally {
    let mut tally = BothTally::default();
    for instant in trace.instants.iter().filter(|instant| window.contains(instant.t_ns)) {
        if let Some([n_pairs, n_points]) = instant.pairs_and_points {
            tally.n_instants += 1;
            tally.n_pairs += n_pairs;
            tally.n_points += n_points;
        }
        tally.n_outside_court += instant.n_outside_court;
        add(&mut tally.tried, &instant.tried);
        if let Some(tried) = &instant.tried_alone {
            tally.n_alone += 1;
            add(&mut tally.tried_alone, tried);
        }
    }
    tally
}

fn add(sum: &mut Tried, tried: &Tried) {
    sum.n += tried.n;
    sum.n_found += tried.n_found;
    sum.n_unlikely += tried.n_unlikely;
    sum.n_one_camera += tried.n_one_camera;
    sum.n_few_hits += tried.n_few_hits;
    sum.n_beyond_max += tried.n_beyond_max;
    sum.best_worth = match (sum.best_worth, tried.best_worth) {
        (Some(a), Some(b)) => Some(a.max(b)),
        (a, b) => a.or(b),
    };
}

/// The judgements whose sightings are in a window, but those of a ball that was told before.
pub fn judgements<'a>(
    trace: &'a Trace,
    window: &'a Window,
) -> impl Iterator<Item = &'a trace::JudgementNote> {
    trace.judgements.iter().filter(|judgement| window.overlaps(judgement.span_ns))
}

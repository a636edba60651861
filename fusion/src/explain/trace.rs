//! What happened to every frame, seed, tracklet and path, kept for somebody to ask why.
//!
//! Each stage leaves a few plain numbers of what it did last; [`Trace`] collects them, if there is
//! one ([`crate::Fusion::traced`]). **Limits**: [`MAX_NOTES`] of each kind, the oldest forgotten.

use crate::Dropped;
use crate::candidates::FrameCandidates;
use crate::seeds::Tried;
use crate::shot::{Outcome, Rejection, Shot};
use crate::tracklets::TrackletNote;
use shm_layout::{Camera, StampNs};
use std::collections::VecDeque;

/// Most notes of each kind: twenty minutes of two cameras.
pub const MAX_NOTES: usize = 1 << 18;

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It was looked at.
    Taken,
    /// Its stamp was not after that of the frame before.
    Backward,
    /// It came when the other camera's later frames had been taken in.
    Late,
}

/// A frame that arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameNote {
    /// Whose.
    pub camera: Camera,
    /// Which run of `capture`.
    pub recording_id: u64,
    /// 0, 1, 2 … within the recording.
    pub frame_idx: u64,
    /// Mid-exposure of the first row.
    pub t_ns: StampNs,
    /// The background was still being learned.
    pub is_learning: bool,
    /// Candidates that arrived.
    pub n_candidates: u64,
    /// Spots beyond the most a frame may have.
    pub n_beyond_max: u64,
    /// Candidates that are not finite numbers.
    pub n_not_finite: u64,
    /// Candidates outside the image.
    pub n_outside_image: u64,
    /// What became of it.
    pub fate: Fate,
}

/// What was made of the spots no tracklet had claimed, when a frame had been taken in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InstantNote {
    /// Whose frame.
    pub camera: Camera,
    /// Its stamp.
    pub t_ns: StampNs,
    /// Pairs and the points made of them; None if the other camera had no frame at this instant.
    pub pairs_and_points: Option<[u64; 2]>,
    /// Points where no ball can be.
    pub n_outside_court: u64,
    /// What seeds were tried, of two cameras.
    pub tried: Tried,
    /// What seeds were tried, of this camera alone, if the other one was silent.
    pub tried_alone: Option<Tried>,
}

impl InstantNote {
    /// Nothing yet.
    #[must_use]
    pub fn of_frame(camera: Camera, t_ns: StampNs) -> Self {
        Self {
            camera,
            t_ns,
            pairs_and_points: None,
            n_outside_court: 0,
            tried: Tried::default(),
            tried_alone: None,
        }
    }
}

/// What was said of a tracklet when it was decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JudgementNote {
    /// Which tracklet.
    pub tracklet_id: u64,
    /// From its first to its last sighting, of the path if there was one.
    pub span_ns: [StampNs; 2],
    /// Sightings of each camera, of the path if there was one.
    pub n_sightings: [usize; 2],
    /// What the path's sightings were worth; None if no flight could be laid through the tokens.
    pub worth: Option<f64>,
    /// What it is.
    pub said: Result<Outcome, Rejection>,
}

/// A shot that was told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShotNote {
    /// From the launch to the end of its track.
    pub span_ns: [StampNs; 2],
    /// Whether it is whole.
    pub outcome: Outcome,
}

/// All notes of a run, oldest first.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// Stamp of the first frame of all.
    pub first_ns: Option<StampNs>,
    /// Frames as they arrived.
    pub frames: VecDeque<FrameNote>,
    /// Frames in the order of time, and what they gave.
    pub instants: VecDeque<InstantNote>,
    /// Tracklets that have ended.
    pub tracklets: VecDeque<TrackletNote>,
    /// What was decided.
    pub judgements: VecDeque<JudgementNote>,
    /// What was told.
    pub shots: VecDeque<ShotNote>,
    /// Shots that are no longer in `shots`.
    pub n_shots_forgotten: u64,
}

/// Appends to a list that has a limit; says how many had to go.
pub(crate) fn note<T>(list: &mut VecDeque<T>, item: T) -> u64 {
    let is_full = list.len() >= MAX_NOTES;
    if is_full {
        list.pop_front();
    }
    list.push_back(item);
    u64::from(is_full)
}

impl Trace {
    /// Takes note of a frame that arrived, and of what had been left out before and after it.
    pub fn note_frame(
        &mut self,
        camera: Camera,
        frame: &FrameCandidates,
        [before, after]: [&Dropped; 2],
    ) {
        let fate = if after.n_backward_frames > before.n_backward_frames {
            Fate::Backward
        } else if after.n_late_frames > before.n_late_frames {
            Fate::Late
        } else {
            Fate::Taken
        };
        self.first_ns.get_or_insert(frame.exposed_ns);
        let frame = FrameNote {
            camera,
            recording_id: frame.recording_id,
            frame_idx: frame.frame_idx,
            t_ns: frame.exposed_ns,
            is_learning: frame.is_learning,
            n_candidates: frame.spots.len() as u64,
            n_beyond_max: frame.n_dropped,
            n_not_finite: after.n_not_finite - before.n_not_finite,
            n_outside_image: after.n_outside_image - before.n_outside_image,
            fate,
        };
        note(&mut self.frames, frame);
    }

    /// Takes note of what a frame gave.
    pub fn note_instant(&mut self, instant: InstantNote) {
        note(&mut self.instants, instant);
    }

    /// Takes note of tracklets that have ended, and of what was decided.
    pub fn note_ends(
        &mut self,
        ended: impl IntoIterator<Item = TrackletNote>,
        judgements: &[JudgementNote],
    ) {
        for tracklet in ended {
            note(&mut self.tracklets, tracklet);
        }
        for judgement in judgements {
            note(&mut self.judgements, *judgement);
        }
    }

    /// Takes note of shots that were told.
    pub fn note_shots(&mut self, shots: &[Shot]) {
        for shot in shots {
            let Some(span_ns) = shot.span_ns() else { continue };
            let told = ShotNote { span_ns, outcome: shot.outcome };
            self.n_shots_forgotten += note(&mut self.shots, told);
        }
    }

    /// The Nth shot, counted from 1; None if there is none, or no longer.
    #[must_use]
    pub fn shot(&self, number: u64) -> Option<&ShotNote> {
        let idx = number.checked_sub(1 + self.n_shots_forgotten)?;
        self.shots.get(usize::try_from(idx).ok()?)
    }
}

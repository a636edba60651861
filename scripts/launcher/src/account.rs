//! Messages of a board → an account of every frame: `frames = complete + lost + in flight`.
//!
//! A frame is known of by its number: `frames-info` or any strip tells it, and a number that is
//! left out is a frame, too. It is complete when all its strips are there. What is not, and is
//! further back than workers reach, is lost. A killed capture's last frames may be told of after
//! the next capture's first: two recordings are kept.
//!
//! **Limit**: a reader that is away for more than 1.4 s misses messages, and counts their frames
//! lost.

use shm_layout::{FrameInfo, MAX_STRIPS, StripCandidates};
use std::collections::{BTreeMap, VecDeque};

/// Frames that may still become complete: 0.7 s at 90 frames/s.
const WINDOW: usize = 64;

/// Recordings that may still be told of.
const MAX_RECORDINGS: usize = 2;

/// So many of the newest frames are in flight: what workers' queues hold, and as much again.
const IN_FLIGHT: u64 = 8;

/// Frames of a board since the account began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Frames that capture numbered.
    pub n_frames: u64,
    /// Those that all strips are done with.
    pub n_complete: u64,
    /// Those that some strip will never be done with.
    pub n_lost: u64,
    /// Candidates of all strips.
    pub n_candidates: u64,
}

/// Strips of a frame that are there, one bit each, of how many.
#[derive(Debug, Clone, Copy)]
struct Strips {
    seen: u32,
    n: u32,
}

impl Strips {
    fn is_complete(self) -> bool {
        self.seen.count_ones() == self.n
    }
}

#[derive(Debug, Default)]
struct Recording {
    id: u64,
    n_frames: u64,
    n_complete: u64,
    /// The newest frames that any strip has told of.
    window: BTreeMap<u64, Strips>,
}

impl Recording {
    fn note(&mut self, frame_idx: u64) {
        self.n_frames = self.n_frames.max(frame_idx.saturating_add(1));
    }

    fn update(&mut self, strip: &StripCandidates) {
        self.note(strip.frame_idx);
        let new = Strips { seen: 0, n: strip.n_strips };
        let strips = self.window.entry(strip.frame_idx).or_insert(new);
        let was_complete = strips.is_complete();
        strips.seen |= 1 << strip.strip_idx;
        self.n_complete += u64::from(strips.is_complete() && !was_complete);
        while self.window.len() > WINDOW {
            self.window.pop_first();
        }
    }

    /// Frames that will not become complete; `is_over` if none is in flight any more.
    fn n_lost(&self, is_over: bool) -> u64 {
        let until = if is_over { self.n_frames } else { self.n_frames.saturating_sub(IN_FLIGHT) };
        let n_newer = self.window.range(until..).filter(|(_, strips)| strips.is_complete()).count();
        until.saturating_sub(self.n_complete.saturating_sub(n_newer as u64))
    }
}

/// The account of one board.
#[derive(Debug, Default)]
pub struct Account {
    /// The newest one last.
    recordings: VecDeque<Recording>,
    /// What the recordings before those came to.
    before: Counts,
    n_candidates: u64,
}

impl Account {
    /// Takes note of a captured frame.
    pub fn update_info(&mut self, info: &FrameInfo) {
        self.recording(info.recording_id).note(info.frame_idx);
    }

    /// Takes note of what a strip was done with.
    pub fn update(&mut self, strip: &StripCandidates) {
        if (1..=MAX_STRIPS).contains(&strip.n_strips) && strip.strip_idx < strip.n_strips {
            self.n_candidates += strip.spots().len() as u64;
            self.recording(strip.recording_id).update(strip);
        }
    }

    /// The account now; with `is_over` nothing is in flight any more.
    #[must_use]
    pub fn counts(&self, is_over: bool) -> Counts {
        let mut counts = Counts { n_candidates: self.n_candidates, ..self.before };
        for (idx, recording) in self.recordings.iter().enumerate() {
            counts.add(recording, is_over || idx + 1 < self.recordings.len());
        }
        counts
    }

    fn recording(&mut self, id: u64) -> &mut Recording {
        let known = self.recordings.iter().position(|recording| recording.id == id);
        let idx = known.unwrap_or_else(|| {
            if self.recordings.len() == MAX_RECORDINGS
                && let Some(oldest) = self.recordings.pop_front()
            {
                self.before.add(&oldest, true);
            }
            self.recordings.push_back(Recording { id, ..Recording::default() });
            self.recordings.len() - 1
        });
        &mut self.recordings[idx]
    }
}

impl Counts {
    fn add(&mut self, recording: &Recording, is_over: bool) {
        self.n_frames += recording.n_frames;
        self.n_complete += recording.n_complete;
        self.n_lost += recording.n_lost(is_over);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(recording_id: u64, frame_idx: u64) -> FrameInfo {
        FrameInfo { recording_id, frame_idx, ..FrameInfo::default() }
    }

    fn strip(recording_id: u64, frame_idx: u64, strip_idx: u32) -> StripCandidates {
        let (n_strips, n_candidates) = (2, 3);
        let of_frame = StripCandidates { recording_id, frame_idx, ..StripCandidates::default() };
        StripCandidates { strip_idx, n_strips, n_candidates, ..of_frame }
    }

    #[test]
    fn every_frame_is_complete_or_lost_or_among_the_newest() {
        let mut account = Account::default();
        for idx in 0..100 {
            account.update_info(&info(7, idx));
            // One strip is late by three frames, and misses frame 50 and the numbers 20 to 29.
            account.update(&strip(7, idx, 0));
            if idx >= 3 && idx - 3 != 50 && !(20..30).contains(&(idx - 3)) {
                account.update(&strip(7, idx - 3, 1));
            }
        }
        let expected = Counts { n_frames: 100, n_complete: 86, n_lost: 11, n_candidates: 558 };
        assert_eq!(account.counts(false), expected);
        assert_eq!(account.counts(true), Counts { n_lost: 14, ..expected });
    }

    #[test]
    fn a_recording_that_was_cut_off_counts_as_what_was_told_of_it_however_late() {
        let mut account = Account::default();
        for id in 1..=6 {
            account.update_info(&info(id, 9));
            account.update(&strip(id, 9, 0));
            account.update(&strip(id, 9, 1));
            if id > 1 {
                account.update_info(&info(id - 1, 11)); // 10 and 11 were told of too late
            }
        }
        let counts = account.counts(true);
        assert_eq!((counts.n_frames, counts.n_complete, counts.n_lost), (5 * 12 + 10, 6, 64));
        assert_eq!(account.counts(false).n_lost, 5 * 11 + 2);
        assert!(account.recordings.len() <= MAX_RECORDINGS);
    }
}

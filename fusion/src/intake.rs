//! Messages of one board → whole frames, and an account of every captured one.
//!
//! `frames-info` says what was captured, strips say what was looked at. A frame is *captured* when
//! either is known of it, *processed* when all its strips arrived, and *lost* when it can no longer
//! be: so `captured = processed + lost` once a recording is over, and nothing is unaccounted for.

use crate::candidates::{FrameCandidates, Gather};
use shm_layout::{FrameInfo, StripCandidates};

/// What became of a board's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameCounts {
    /// Frames the camera took, as far as they are known of.
    pub captured: u64,
    /// Frames whose candidates all arrived.
    pub processed: u64,
    /// The others.
    pub lost: u64,
}

/// One board's messages, put together.
#[derive(Default)]
pub struct Intake {
    gather: Gather,
    recording_id: Option<u64>,
    /// The recording before, and how many frames are known of it: one stream's messages may
    /// overtake the other's, and a recording that was cut off is told of to its end all the same.
    previous: Option<(u64, u64)>,
    /// Frames of recordings that ended because the next one began.
    n_captured_before: u64,
    n_captured: u64,
    n_processed: u64,
    n_processed_before: u64,
    has_last: bool,
}

impl Intake {
    /// Takes note of a captured frame.
    pub fn update_info(&mut self, info: &FrameInfo) {
        self.note_frame(info.recording_id, info.frame_idx);
        self.has_last |= info.is_last != 0 && self.recording_id == Some(info.recording_id);
    }

    /// Takes a strip in and gives out the frames that are whole now, in order.
    pub fn update(&mut self, strip: &StripCandidates) -> Vec<FrameCandidates> {
        self.note_frame(strip.recording_id, strip.frame_idx);
        let frames = self.gather.update(strip);
        self.note_processed(&frames);
        frames
    }

    /// No more will come: gives out what is whole, gives up the rest.
    pub fn finish(&mut self) -> Vec<FrameCandidates> {
        let frames = self.gather.finish();
        self.note_processed(&frames);
        frames
    }

    /// True once the last frame of the recording was announced and none is outstanding.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.has_last && self.n_processed == self.n_captured
    }

    /// True once the last frame of the recording was announced.
    #[must_use]
    pub fn has_last(&self) -> bool {
        self.has_last
    }

    /// The account so far; what is still on its way counts as lost until it is here.
    #[must_use]
    pub fn counts(&self) -> FrameCounts {
        let captured = self.n_captured_before + self.n_captured;
        let processed = self.n_processed_before + self.n_processed;
        FrameCounts { captured, processed, lost: captured.saturating_sub(processed) }
    }

    fn note_frame(&mut self, recording_id: u64, frame_idx: u64) {
        let n_known = frame_idx.saturating_add(1);
        if let Some((previous_id, n_before)) = &mut self.previous
            && *previous_id == recording_id
        {
            self.n_captured_before += n_known.saturating_sub(*n_before);
            *n_before = n_known.max(*n_before);
            return;
        }
        if self.recording_id != Some(recording_id) {
            self.previous = self.recording_id.map(|id| (id, self.n_captured));
            self.recording_id = Some(recording_id);
            self.n_captured_before += std::mem::take(&mut self.n_captured);
            self.n_processed_before += std::mem::take(&mut self.n_processed);
            self.has_last = false;
        }
        self.n_captured = self.n_captured.max(n_known);
    }

    fn note_processed(&mut self, frames: &[FrameCandidates]) {
        for frame in frames {
            if self.recording_id == Some(frame.recording_id) {
                self.n_processed += 1;
            } else {
                self.n_processed_before += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(frame_idx: u64, is_last: bool) -> FrameInfo {
        let is_last = u32::from(is_last);
        FrameInfo { recording_id: 7, frame_idx, is_last, ..FrameInfo::default() }
    }

    fn strip(frame_idx: u64, strip_idx: u32) -> StripCandidates {
        let (recording_id, n_strips) = (7, 2);
        StripCandidates { recording_id, frame_idx, strip_idx, n_strips, ..Default::default() }
    }

    #[test]
    fn every_captured_frame_is_processed_or_lost() {
        let mut intake = Intake::default();
        for frame_idx in 0..10 {
            intake.update_info(&info(frame_idx, frame_idx == 9));
            for strip_idx in 0..2 {
                if (frame_idx, strip_idx) != (4, 1) {
                    intake.update(&strip(frame_idx, strip_idx));
                }
            }
        }
        assert!(intake.has_last() && !intake.is_whole());
        intake.finish();
        assert_eq!(intake.counts(), FrameCounts { captured: 10, processed: 9, lost: 1 });
    }

    #[test]
    fn a_recording_that_was_cut_off_is_told_of_to_its_end_after_the_next_began() {
        let mut intake = Intake::default();
        let info = |recording_id, frame_idx| FrameInfo { recording_id, ..info(frame_idx, false) };
        intake.update_info(&info(7, 10));
        intake.update_info(&info(8, 3));
        intake.update_info(&info(7, 11));
        intake.update_info(&info(7, 9));
        intake.update_info(&info(8, 4));
        assert_eq!(intake.counts().captured, 12 + 5);
    }

    #[test]
    fn a_recording_without_a_loss_is_whole_in_whatever_order_it_comes() {
        let mut intake = Intake::default();
        for frame_idx in [1, 0, 2] {
            intake.update(&strip(frame_idx, 1));
            intake.update(&strip(frame_idx, 0));
        }
        assert!(!intake.is_whole(), "the last frame is not announced yet");
        for frame_idx in 0..3 {
            intake.update_info(&info(frame_idx, frame_idx == 2));
        }
        assert!(intake.is_whole());
        assert_eq!(intake.counts(), FrameCounts { captured: 3, processed: 3, lost: 0 });
    }
}

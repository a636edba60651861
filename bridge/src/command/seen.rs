//! What the board's bridge has seen and sent, counted on one thread and read on another.

use crate::ring::Ring;
use crate::wire::Stream;
use crate::wire::batch::Message;
use std::sync::atomic::{AtomicU64, Ordering};

/// Counts since the bridge started.
#[derive(Debug, Default)]
pub struct Seen {
    n_frames: AtomicU64,
    n_candidates: AtomicU64,
    n_batches: AtomicU64,
    n_ring_bytes: AtomicU64,
    n_evicted: AtomicU64,
    /// Of the newest frame.
    frame_idx: AtomicU64,
    n_frame_bytes: AtomicU64,
}

/// The counts at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Frames whose infos were seen.
    pub n_frames: u64,
    /// Candidates seen.
    pub n_candidates: u64,
    /// Batches handed to the network.
    pub n_batches: u64,
    /// Bytes of the batches that are kept.
    pub n_ring_bytes: u64,
    /// Batches that are no longer kept.
    pub n_evicted: u64,
    /// Number of the newest frame within its recording.
    pub frame_idx: u64,
    /// Pixels of the newest frame.
    pub n_frame_bytes: u64,
}

impl Seen {
    /// Takes note of a batch that was sent and of the ring that keeps it.
    pub fn note(&self, messages: &[Message]) {
        self.n_batches.fetch_add(1, Ordering::Relaxed);
        for message in messages {
            match message {
                Message::FrameInfo(info) => {
                    let n_bytes = u64::from(info.width_px) * u64::from(info.height_px);
                    self.n_frame_bytes.store(n_bytes, Ordering::Relaxed);
                    self.frame_idx.store(info.frame_idx, Ordering::Relaxed);
                    self.n_frames.fetch_add(1, Ordering::Relaxed);
                }
                Message::Candidates(strip) => {
                    self.n_candidates.fetch_add(strip.spots().len() as u64, Ordering::Relaxed);
                }
            }
        }
    }

    /// Takes note of what is kept.
    pub fn note_ring(&self, ring: &Ring) {
        self.n_ring_bytes.store(ring.n_bytes() as u64, Ordering::Relaxed);
        let n_evicted = Stream::ALL.iter().map(|stream| ring.oldest_idx(*stream)).sum();
        self.n_evicted.store(n_evicted, Ordering::Relaxed);
    }

    /// The counts now.
    #[must_use]
    pub fn counts(&self) -> Counts {
        Counts {
            n_frames: self.n_frames.load(Ordering::Relaxed),
            n_candidates: self.n_candidates.load(Ordering::Relaxed),
            n_batches: self.n_batches.load(Ordering::Relaxed),
            n_ring_bytes: self.n_ring_bytes.load(Ordering::Relaxed),
            n_evicted: self.n_evicted.load(Ordering::Relaxed),
            frame_idx: self.frame_idx.load(Ordering::Relaxed),
            n_frame_bytes: self.n_frame_bytes.load(Ordering::Relaxed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_layout::{FrameInfo, StripCandidates};

    #[test]
    fn frames_and_candidates_are_counted_and_the_newest_frame_is_known() {
        let seen = Seen::default();
        let info = |frame_idx| {
            Message::FrameInfo(FrameInfo {
                frame_idx,
                width_px: 640,
                height_px: 480,
                ..FrameInfo::default()
            })
        };
        let strip = StripCandidates { n_candidates: 3, ..StripCandidates::default() };
        seen.note(&[info(4), info(5)]);
        seen.note(&[Message::Candidates(Box::new(strip))]);
        let mut ring = Ring::default();
        ring.push(Stream::Candidates, 0, vec![0; 10].into());
        ring.push(Stream::FramesInfo, 11_000_000_000, vec![0; 7].into());
        seen.note_ring(&ring);
        let expected = Counts {
            n_frames: 2,
            n_candidates: 3,
            n_batches: 2,
            n_ring_bytes: 7,
            n_evicted: 1,
            frame_idx: 5,
            n_frame_bytes: 640 * 480,
        };
        assert_eq!(seen.counts(), expected);
    }
}

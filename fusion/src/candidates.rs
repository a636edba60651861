//! Strips of a frame -> the whole frame's candidates, in order.
//!
//! Workers share a frame by rows and finish when they finish: messages arrive out of order across
//! strips and frames, twice, or never. [`Gather`] waits for all strips of a frame and hands frames
//! out in increasing `frame_idx`. A missing frame holds the others up until [`N_AHEAD`] later ones
//! are complete; then it is lost. The result is the same for every number of strips: the
//! [`MAX_CANDIDATES`] best spots, in the order of their rows.

use shm_layout::{Candidate, MAX_CANDIDATES, MAX_STRIPS, StampNs, StripCandidates};
use std::collections::BTreeMap;

/// Frames a message may be ahead of the one waited for: 0.7 s at 90 Hz.
pub const MAX_PENDING_FRAMES: u64 = 64;

/// A frame is lost when this many later ones are complete: 0.09 s at 90 Hz. Workers on one board
/// finish within two frames of each other.
pub const N_AHEAD: usize = 8;

/// All candidates of one frame of one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameCandidates {
    /// Which run of `capture`.
    pub recording_id: u64,
    /// 0, 1, 2 … within the recording.
    pub frame_idx: u64,
    /// Mid-exposure of the first row.
    pub exposed_ns: StampNs,
    /// As in [`StripCandidates`]: 1 sigma of `exposed_ns` on this machine's clock, or
    /// [`shm_layout::stamp::OWN_CLOCK`].
    pub clock_sigma_ns: u32,
    /// The background was still being learned.
    pub is_learning: bool,
    /// Spots beyond [`MAX_CANDIDATES`], left out by a worker or here.
    pub n_dropped: u64,
    /// The spots, by row, then column; a size that is not known is NaN.
    pub spots: Vec<Candidate>,
}

impl FrameCandidates {
    /// Keeps the [`MAX_CANDIDATES`] best spots, in row order, and counts the others.
    pub fn settle(&mut self) {
        self.spots.sort_by(Candidate::by_worth);
        self.n_dropped += self.spots.len().saturating_sub(MAX_CANDIDATES) as u64;
        self.spots.truncate(MAX_CANDIDATES);
        self.spots.sort_by(Candidate::by_place);
    }
}

/// What [`Gather`] could not use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GatherCounts {
    /// Frames that never became complete.
    pub n_lost_frames: u64,
    /// Messages of a strip that was there already.
    pub n_duplicates: u64,
    /// Messages of a frame (or a recording) that was given out or given up before.
    pub n_late: u64,
    /// Messages whose strip numbers cannot be, or contradict those of the frame's other strips.
    pub n_invalid: u64,
    /// Times a new recording began.
    pub n_new_recordings: u64,
}

struct Pending {
    strips_seen: u32,
    n_strips: u32,
    frame: FrameCandidates,
}

impl Pending {
    fn is_complete(&self) -> bool {
        self.strips_seen.count_ones() == self.n_strips
    }
}

/// Puts the strips of one camera's frames together.
#[derive(Default)]
pub struct Gather {
    /// The recording, and the frame to be given out next.
    current: Option<(u64, u64)>,
    previous_recording_id: Option<u64>,
    pending: BTreeMap<u64, Pending>,
    counts: GatherCounts,
}

impl Gather {
    /// What could not be used so far.
    #[must_use]
    pub fn counts(&self) -> GatherCounts {
        self.counts
    }

    /// Takes one strip in; gives out the frames that are now complete and next in order: mostly
    /// none or one, several after a lost frame.
    pub fn update(&mut self, strip: &StripCandidates) -> Vec<FrameCandidates> {
        let is_possible = (1..=MAX_STRIPS).contains(&strip.n_strips);
        if !is_possible || strip.strip_idx >= strip.n_strips {
            self.counts.n_invalid += 1;
            return Vec::new();
        }
        if self.previous_recording_id == Some(strip.recording_id) {
            self.counts.n_late += 1;
            return Vec::new();
        }
        let mut frames = self.begun(strip);
        self.keep(strip);
        frames.extend(self.released(false));
        frames
    }

    /// Recording over: gives out what is complete, counts the rest as lost.
    pub fn finish(&mut self) -> Vec<FrameCandidates> {
        self.released(true)
    }

    /// Begins a recording if the strip is the first of one; gives out the rest of the last one.
    fn begun(&mut self, strip: &StripCandidates) -> Vec<FrameCandidates> {
        let recording_id = strip.recording_id;
        let last_id = match self.current {
            Some((id, _)) if id == recording_id => return Vec::new(),
            Some((id, _)) => Some(id),
            None => None,
        };
        let rest = self.released(true);
        self.counts.n_new_recordings += 1;
        self.previous_recording_id = last_id;
        // A recording begins with frame 0, whichever of its first frames is reported first. Who
        // joins later begins where the stream is.
        let first_idx = if strip.frame_idx < N_AHEAD as u64 { 0 } else { strip.frame_idx };
        self.current = Some((recording_id, first_idx));
        rest
    }

    fn keep(&mut self, strip: &StripCandidates) {
        let Some((_, next_idx)) = self.current else { return };
        if strip.frame_idx < next_idx {
            self.counts.n_late += 1;
            return;
        }
        let pending = self.pending.entry(strip.frame_idx).or_insert_with(|| Pending {
            strips_seen: 0,
            n_strips: strip.n_strips,
            frame: FrameCandidates {
                recording_id: strip.recording_id,
                frame_idx: strip.frame_idx,
                exposed_ns: strip.exposed_ns,
                clock_sigma_ns: 0,
                is_learning: false,
                n_dropped: 0,
                spots: Vec::new(),
            },
        });
        let bit = 1 << strip.strip_idx;
        if pending.n_strips != strip.n_strips || pending.frame.exposed_ns != strip.exposed_ns {
            self.counts.n_invalid += 1;
        } else if pending.strips_seen & bit != 0 {
            self.counts.n_duplicates += 1;
        } else {
            pending.strips_seen |= bit;
            let frame = &mut pending.frame;
            frame.clock_sigma_ns = frame.clock_sigma_ns.max(strip.clock_sigma_ns);
            pending.frame.is_learning |= strip.is_learning != 0;
            pending.frame.n_dropped += u64::from(strip.n_dropped);
            pending.frame.spots.extend_from_slice(strip.spots());
        }
    }

    /// Frames that need not be waited for any longer, in order.
    fn released(&mut self, is_over: bool) -> Vec<FrameCandidates> {
        let mut frames = Vec::new();
        let Some((recording_id, mut next_idx)) = self.current else { return frames };
        while let Some(lowest) = self.pending.first_entry() {
            let (idx, is_complete) = (*lowest.key(), lowest.get().is_complete());
            let is_given_up = is_over || self.is_overdue(next_idx);
            if idx > next_idx && is_given_up {
                let n_lost = idx - next_idx;
                self.counts.n_lost_frames = self.counts.n_lost_frames.saturating_add(n_lost);
                next_idx = idx;
            }
            if idx > next_idx || !(is_complete || is_over || self.is_overdue(idx)) {
                break;
            }
            next_idx = idx.saturating_add(1);
            match self.pending.remove(&idx) {
                Some(mut pending) if is_complete => {
                    pending.frame.settle();
                    frames.push(pending.frame);
                }
                _ => self.counts.n_lost_frames = self.counts.n_lost_frames.saturating_add(1),
            }
        }
        self.current = Some((recording_id, next_idx));
        frames
    }

    /// Whether a frame has been waited for long enough.
    fn is_overdue(&self, waited_idx: u64) -> bool {
        let n_complete = self.pending.values().filter(|pending| pending.is_complete()).count();
        let last_idx = self.pending.last_key_value().map_or(waited_idx, |(idx, _)| *idx);
        n_complete >= N_AHEAD || last_idx - waited_idx >= MAX_PENDING_FRAMES
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng, seq::SliceRandom};
    use rand_chacha::ChaCha8Rng;

    /// Frame `frame_idx` shared between `n_strips` workers; 100 spots over 480 rows.
    fn strips(frame_idx: u64, n_strips: u32) -> Vec<StripCandidates> {
        let mut rng = ChaCha8Rng::seed_from_u64(frame_idx);
        let mut spots: Vec<Candidate> = (0..100)
            .map(|_| Candidate {
                x_px: rng.random_range(0.0..640.0),
                y_px: rng.random_range(0.0..480.0),
                area_px: rng.random_range(1..30) as f32,
                ..Candidate::default()
            })
            .collect();
        spots.sort_by(|a, b| b.area_px.total_cmp(&a.area_px));
        (0..n_strips)
            .map(|strip_idx| {
                let rows = 480.0 / n_strips as f32;
                let mine = spots.iter().filter(|spot| (spot.y_px / rows) as u32 == strip_idx);
                // Ties at the cut are broken as the workers must: upper, then left first.
                let mut mine: Vec<Candidate> = mine.copied().collect();
                mine.sort_by(|a, b| {
                    b.area_px.total_cmp(&a.area_px).then(a.y_px.total_cmp(&b.y_px))
                });
                let n = mine.len().min(MAX_CANDIDATES);
                let mut candidates = [Candidate::default(); MAX_CANDIDATES];
                candidates[..n].copy_from_slice(&mine[..n]);
                StripCandidates {
                    recording_id: 7,
                    frame_idx,
                    exposed_ns: (frame_idx as i64).wrapping_mul(11_111_111),
                    strip_idx,
                    n_strips,
                    n_candidates: n as u32,
                    n_dropped: (mine.len() - n) as u32,
                    candidates,
                    ..StripCandidates::default()
                }
            })
            .collect()
    }

    fn gathered(strips: &[StripCandidates]) -> (Vec<FrameCandidates>, GatherCounts) {
        let mut gather = Gather::default();
        let mut frames: Vec<FrameCandidates> =
            strips.iter().flat_map(|strip| gather.update(strip)).collect();
        frames.extend(gather.finish());
        (frames, gather.counts())
    }

    #[test]
    fn a_frame_is_the_same_for_any_number_of_strips() {
        let (whole, _) = gathered(&strips(3, 1));
        assert_eq!(whole[0].spots.len(), MAX_CANDIDATES);
        assert_eq!(whole[0].n_dropped, 36);
        for n_strips in [2, 3, 4, 8] {
            assert_eq!(gathered(&strips(3, n_strips)).0, whole, "{n_strips} strips");
        }
    }

    #[test]
    fn frames_come_out_in_order_however_strips_come_in() {
        let mut all: Vec<StripCandidates> = (0..40).flat_map(|idx| strips(idx, 4)).collect();
        let (in_order, _) = gathered(&all);
        for chunk in all.chunks_mut(12) {
            chunk.shuffle(&mut ChaCha8Rng::seed_from_u64(1));
        }
        let (frames, counts) = gathered(&all);
        assert_eq!(frames, in_order);
        assert_eq!(counts, GatherCounts { n_new_recordings: 1, ..GatherCounts::default() });
    }

    #[test]
    fn a_lost_strip_loses_its_frame_and_holds_up_no_more_than_eight() {
        let mut gather = Gather::default();
        let mut seen = Vec::new();
        for frame_idx in 0..20 {
            for strip in strips(frame_idx, 2) {
                if (frame_idx, strip.strip_idx) != (5, 1) {
                    seen.extend(gather.update(&strip).iter().map(|frame| frame.frame_idx));
                }
            }
            if frame_idx == 12 {
                assert_eq!(seen.last(), Some(&4), "frame 5 may still come");
            }
            if frame_idx == 13 {
                assert_eq!(seen.last(), Some(&13), "eight later frames are complete");
            }
        }
        assert_eq!(seen, (0..20).filter(|&idx| idx != 5).collect::<Vec<u64>>());
        assert_eq!(gather.counts().n_lost_frames, 1);
        assert!(gather.update(&strips(5, 2)[1]).is_empty());
        assert_eq!(gather.counts().n_late, 1);
    }

    #[test]
    fn messages_that_cannot_be_are_counted_and_harm_nothing() {
        let good = strips(0, 2);
        let bad = [(0, 0), (2, 2), (0, 9), (7, 3)].map(|(strip_idx, n_strips)| StripCandidates {
            strip_idx,
            n_strips,
            ..good[0]
        });
        let mut all = vec![good[0], good[0]];
        all.extend(bad);
        all.push(good[1]);
        all.push(good[1]);
        let (frames, counts) = gathered(&all);
        assert_eq!(frames, gathered(&good).0);
        assert_eq!((counts.n_invalid, counts.n_duplicates, counts.n_late), (4, 1, 1));
    }

    #[test]
    fn a_new_recording_gives_out_the_old_one_and_starts_again() {
        let mut all = strips(100, 1);
        all.extend(strips(102, 1));
        all.extend(strips(0, 1).into_iter().map(|s| StripCandidates { recording_id: 8, ..s }));
        all.extend(strips(101, 1));
        let (frames, counts) = gathered(&all);
        let ids: Vec<_> = frames.iter().map(|f| (f.recording_id, f.frame_idx)).collect();
        assert_eq!(ids, [(7, 100), (7, 102), (8, 0)]);
        assert_eq!((counts.n_new_recordings, counts.n_late, counts.n_lost_frames), (2, 1, 1));
    }

    #[test]
    fn a_leap_of_the_index_costs_no_memory_and_no_time() {
        let mut all = strips(0, 2);
        all.truncate(1);
        all.extend(strips(1 << 60, 2));
        let (frames, counts) = gathered(&all);
        assert_eq!(frames.len(), 1);
        assert_eq!(counts.n_lost_frames, 1 << 60);
        let mut last = strips(0, 1);
        last[0].frame_idx = u64::MAX;
        assert_eq!(gathered(&last).0.len(), 1);
    }
}

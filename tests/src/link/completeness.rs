//! What was sent and what was heard → what is missing, what came twice, what came out of order.

use super::Times;
use super::board::{N_STRIPS, Sent};
use super::heard::{Heard, HeardStrip};
use serde::Serialize;
use shm_layout::{Camera, StampNs};

/// Of one board.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Completeness {
    /// Strips the board wrote.
    pub n_sent: usize,
    /// Those of them that arrived.
    pub n_arrived: usize,
    /// Frames of which a strip is missing: first and last of each run.
    pub missing_frames: Vec<(u64, u64)>,
    /// Strips that arrived more than once.
    pub n_twice: usize,
    /// Strips that arrived after one of a later frame.
    pub n_out_of_order: usize,
    /// Strips nobody sent.
    pub n_foreign: usize,
    /// Infos of frames that did not arrive.
    pub n_infos_missing: usize,
    /// The longest time without a strip while the board played.
    pub longest_silence_ns: StampNs,
    /// From the mending of the link to the next strip; `None` without a cut or without a strip.
    pub heard_after_ns: Option<StampNs>,
    /// From the mending of the link until all that had been sent by then was there.
    pub filled_after_ns: Option<StampNs>,
}

impl Completeness {
    /// Compares.
    #[must_use]
    pub fn from_heard(sent: &Sent, heard: &Heard, times: &Times) -> Self {
        let is_ours = |strip: &&HeardStrip| strip.camera == sent.camera;
        let strips: Vec<HeardStrip> = heard.strips.iter().filter(is_ours).copied().collect();
        let mut arrived_ns = vec![[None; N_STRIPS as usize]; sent.finished_ns.len()];
        let (mut n_twice, mut n_out_of_order, mut n_foreign, mut newest_idx) = (0, 0, 0, 0);
        for strip in &strips {
            let frame = usize::try_from(strip.frame_idx).ok().and_then(|i| arrived_ns.get_mut(i));
            let slot = frame.and_then(|frame| frame.get_mut(strip.strip_idx as usize));
            match slot.filter(|_| strip.recording_id == sent.recording_id) {
                None => n_foreign += 1,
                Some(Some(_)) => n_twice += 1,
                Some(empty) => *empty = Some(strip.arrived_ns),
            }
            n_out_of_order += usize::from(strip.frame_idx < newest_idx);
            newest_idx = newest_idx.max(strip.frame_idx);
        }
        let has_hole = |frame: &[Option<StampNs>]| frame.iter().any(Option::is_none);
        let holes = (0_u64..).zip(&arrived_ns).filter(|(_, frame)| has_hole(*frame));
        let mended_ns = times.cut_ns.map(|(_, mended_ns)| mended_ns);
        Self {
            n_sent: sent.n_strips(),
            n_arrived: arrived_ns.iter().flatten().flatten().count(),
            missing_frames: runs(holes.map(|(idx, _)| idx)),
            n_twice,
            n_out_of_order,
            n_foreign,
            n_infos_missing: infos_missing(sent, heard),
            longest_silence_ns: longest_silence_ns(&strips),
            heard_after_ns: mended_ns.and_then(|mended_ns| heard_after_ns(&strips, mended_ns)),
            filled_after_ns: mended_ns.and_then(|at_ns| filled_after_ns(sent, &arrived_ns, at_ns)),
        }
    }

    /// Nothing is missing, twice, out of order or foreign.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        let n_wrong = self.n_twice + self.n_out_of_order + self.n_foreign + self.n_infos_missing;
        self.n_arrived == self.n_sent && n_wrong == 0
    }
}

/// First and last of each run of consecutive numbers.
fn runs(idxs: impl Iterator<Item = u64>) -> Vec<(u64, u64)> {
    let mut runs: Vec<(u64, u64)> = Vec::new();
    for idx in idxs {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == idx => *last = idx,
            _ => runs.push((idx, idx)),
        }
    }
    runs
}

fn infos_missing(sent: &Sent, heard: &Heard) -> usize {
    let mut is_there = vec![false; sent.exposed_ns.len()];
    for info in &heard.infos {
        let is_ours = Camera::from_idx(info.camera_idx) == Some(sent.camera);
        if is_ours && info.recording_id == sent.recording_id {
            let frame = usize::try_from(info.frame_idx).ok().and_then(|i| is_there.get_mut(i));
            *frame.unwrap_or(&mut false) = true;
        }
    }
    is_there.iter().filter(|is_there| !**is_there).count()
}

fn longest_silence_ns(strips: &[HeardStrip]) -> StampNs {
    let gaps = strips.windows(2).map(|pair| pair[1].arrived_ns - pair[0].arrived_ns);
    gaps.max().unwrap_or(0)
}

fn heard_after_ns(strips: &[HeardStrip], mended_ns: StampNs) -> Option<StampNs> {
    let after = strips.iter().map(|strip| strip.arrived_ns).find(|&at_ns| at_ns >= mended_ns);
    after.map(|at_ns| at_ns - mended_ns)
}

fn filled_after_ns(
    sent: &Sent,
    arrived_ns: &[[Option<StampNs>; N_STRIPS as usize]],
    mended_ns: StampNs,
) -> Option<StampNs> {
    let both = sent.finished_ns.iter().flatten().zip(arrived_ns.iter().flatten());
    let before = both.filter(|(finished_ns, _)| **finished_ns < mended_ns);
    let last_ns = before.map(|(_, arrived_ns)| *arrived_ns).collect::<Option<Vec<_>>>()?;
    last_ns.into_iter().max().map(|last_ns| (last_ns - mended_ns).max(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent() -> Sent {
        let finished_ns = (0..6).map(|i| [i * 100, i * 100 + 1]).collect();
        let exposed_ns = (0..6).map(|i| i * 100 - 50).collect();
        Sent { camera: Camera::Left, recording_id: 3, exposed_ns, finished_ns }
    }

    fn strip(frame_idx: u64, strip_idx: u32, arrived_ns: StampNs) -> HeardStrip {
        HeardStrip {
            camera: Camera::Left,
            recording_id: 3,
            frame_idx,
            strip_idx,
            exposed_ns: 0,
            clock_sigma_ns: 0,
            arrived_ns,
        }
    }

    fn heard(frames: &[(u64, StampNs)]) -> Heard {
        let both = |&(idx, at_ns): &(u64, StampNs)| [strip(idx, 0, at_ns), strip(idx, 1, at_ns)];
        Heard { strips: frames.iter().flat_map(both).collect(), ..Heard::default() }
    }

    #[test]
    fn holes_doubles_and_strangers_are_told() {
        let mut heard = heard(&[(0, 5), (3, 305), (2, 310), (2, 311), (9, 900)]);
        heard.strips.push(HeardStrip { recording_id: 4, ..strip(1, 0, 901) });
        let times = Times { begun_ns: 0, cut_ns: None };
        let completeness = Completeness::from_heard(&sent(), &heard, &times);
        assert_eq!((completeness.n_sent, completeness.n_arrived), (12, 6));
        assert_eq!(completeness.missing_frames, [(1, 1), (4, 5)]);
        assert_eq!((completeness.n_twice, completeness.n_foreign), (2, 3));
        assert_eq!(completeness.n_out_of_order, 5); // frame 2 twice, and the stranger's 1
        assert_eq!(completeness.n_infos_missing, 6);
        assert_eq!(completeness.longest_silence_ns, 589);
        assert!(!completeness.is_complete());
    }

    #[test]
    fn a_cut_is_over_when_all_that_was_sent_before_its_end_is_there() {
        let heard = heard(&[(0, 5), (1, 450), (2, 460), (3, 470), (4, 471), (5, 600)]);
        let times = Times { begun_ns: 0, cut_ns: Some((50, 420)) };
        let completeness = Completeness::from_heard(&sent(), &heard, &times);
        assert_eq!(completeness.heard_after_ns, Some(30));
        assert_eq!(completeness.filled_after_ns, Some(51));
    }
}

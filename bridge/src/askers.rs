//! Who asks this board for batches → from which on it may have them.
//!
//! The first bridge beside fusion that asks may have all that is kept: the board began when it met
//! that one. Any later one, which follows one that was killed, has 2 s of what was before its first
//! question: that may be in the air. All that is kept, up to 10 s, would have to be read before
//! anything new is (1.3 s, measured).

use crate::ring::Ring;
use crate::wire::{N_STREAMS, Stream};
use shm_layout::StampNs;
use std::collections::VecDeque;

/// What a later asker may have of what was before it.
const IN_THE_AIR_NS: i64 = 2_000_000_000;

/// Most askers that are remembered; an older one is a new one.
const MAX_ASKERS: usize = 8;

/// Askers of one run of a board's bridge.
#[derive(Debug, Default)]
pub struct Askers {
    /// With the first batch of each stream that each may have.
    known: VecDeque<(u64, [u64; N_STREAMS])>,
}

impl Askers {
    /// The oldest batch of each stream that is here for who asks now.
    pub fn oldest_for(&mut self, asker_id: u64, ring: &Ring, now_ns: StampNs) -> [u64; N_STREAMS] {
        let known = self.known.iter().find(|(known_id, _)| *known_id == asker_id);
        let from_idx = known.map(|(_, from_idx)| *from_idx).unwrap_or_else(|| {
            let in_the_air = |stream| ring.first_since(stream, now_ns - IN_THE_AIR_NS);
            let is_first = self.known.is_empty();
            let from_idx = if is_first { [0; N_STREAMS] } else { Stream::ALL.map(in_the_air) };
            self.known.truncate(MAX_ASKERS - 1);
            self.known.push_front((asker_id, from_idx));
            from_idx
        });
        Stream::ALL.map(|stream| ring.oldest_idx(stream).max(from_idx[stream.idx()]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    #[test]
    fn the_first_may_have_all_and_later_ones_what_is_in_the_air() {
        let (mut askers, mut ring) = (Askers::default(), Ring::default());
        let push = |ring: &mut Ring, from_s: i64, until_s: i64| {
            for tenth in from_s * 10..until_s * 10 {
                ring.push(Stream::Candidates, tenth * SECOND_NS / 10, vec![0; 3].into());
            }
        };
        push(&mut ring, 0, 5);
        let [infos, candidates] = Stream::ALL.map(Stream::idx);
        assert_eq!(askers.oldest_for(7, &ring, 5 * SECOND_NS), [0; 2]);
        let later = askers.oldest_for(8, &ring, 5 * SECOND_NS);
        assert_eq!((later[infos], later[candidates]), (0, 30));
        push(&mut ring, 5, 8);
        assert_eq!(askers.oldest_for(8, &ring, 8 * SECOND_NS), later, "as at its first question");
        assert_eq!(askers.oldest_for(7, &ring, 8 * SECOND_NS), [0; 2]);
        push(&mut ring, 8, 20);
        let kept = ring.oldest_idx(Stream::Candidates);
        assert!(kept > 30);
        assert_eq!(askers.oldest_for(8, &ring, 20 * SECOND_NS)[candidates], kept);
        for stranger_id in 100..200 {
            askers.oldest_for(stranger_id, &ring, 20 * SECOND_NS);
        }
        assert_eq!(askers.known.len(), MAX_ASKERS);
    }
}

//! Batches of one stream as they arrive → the same in their order, whole, or known to be lost.
//!
//! A batch is passed on when all before it were passed on or are lost. What is missing is told
//! ([`Order::missing`]) and comes later as any other batch does. Missing ones are lost when the
//! board says that it no longer has them ([`Order::note_oldest`]), when it begins anew, or when
//! more than [`MAX_HELD`] batches wait for them.

use crate::wire::batch::Batch;
use crate::wire::missing::MAX_ASKED;
use std::collections::BTreeMap;
use std::ops::Range;

/// Most batches that wait for an earlier one: 10 s of a board with eight workers.
pub const MAX_HELD: usize = 8192;

/// Counts of one stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Batches that were passed on.
    pub n_passed: u64,
    /// Those of them that had been overtaken or asked for.
    pub n_filled: u64,
    /// Batches that can no longer be had.
    pub n_lost: u64,
    /// Batches that came twice, or after they had been given up.
    pub n_late: u64,
    /// How often the board's bridge began anew.
    pub n_restarts: u64,
}

/// Brings one stream of a board into order.
#[derive(Debug, Default)]
pub struct Order {
    session_id: Option<u64>,
    next_idx: u64,
    /// The one after the newest that is known to exist.
    end_idx: u64,
    /// Batches before this were sent before anybody listened here: no loss if they are gone. `None`
    /// until one was heard.
    joined_idx: Option<u64>,
    held: BTreeMap<u64, Batch>,
    counts: Counts,
}

impl Order {
    /// Takes a batch in, asked for or not; gives out those that are next.
    pub fn update(&mut self, batch: Batch) -> Vec<Batch> {
        let mut passed = self.begun(batch.session_id);
        let idx = batch.batch_idx;
        self.joined_idx.get_or_insert(idx);
        if idx < self.next_idx || self.held.contains_key(&idx) {
            self.counts.n_late += 1;
            return passed;
        }
        self.counts.n_filled += u64::from(idx < self.end_idx);
        self.end_idx = self.end_idx.max(idx.saturating_add(1));
        self.held.insert(idx, batch);
        passed.extend(self.released());
        while self.held.len() > MAX_HELD {
            let first_idx = self.held.keys().next().copied().unwrap_or(self.next_idx);
            passed.extend(self.given_up(first_idx));
        }
        passed
    }

    /// Takes in what the oldest batch is that the board still has. Gives out those that waited for
    /// what is gone. Not to be called while an answer to a question is on its way.
    pub fn note_oldest(&mut self, session_id: u64, oldest_idx: u64) -> Vec<Batch> {
        let mut passed = self.begun(session_id);
        passed.extend(self.given_up(oldest_idx.min(self.end_idx)));
        passed
    }

    /// Takes in how far the board has come, without giving anything up.
    pub fn note_end(&mut self, session_id: u64, end_idx: u64) {
        if self.session_id == Some(session_id) {
            self.end_idx = self.end_idx.max(end_idx);
        }
    }

    /// The first batches to be asked for, with the session they are of.
    #[must_use]
    pub fn missing(&self) -> Option<(u64, Range<u64>)> {
        let session_id = self.session_id?;
        let until = self.held.keys().next().copied().unwrap_or(self.end_idx);
        let until = until.min(self.next_idx.saturating_add(MAX_ASKED));
        (self.next_idx < until).then_some((session_id, self.next_idx..until))
    }

    /// Counts so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// How many batches wait.
    #[must_use]
    pub fn n_held(&self) -> usize {
        self.held.len()
    }

    /// A board that began anew: what waited is passed on, what was missing is lost.
    fn begun(&mut self, session_id: u64) -> Vec<Batch> {
        if self.session_id == Some(session_id) {
            return Vec::new();
        }
        let rest = self.given_up(self.end_idx);
        self.counts.n_restarts += u64::from(self.session_id.is_some());
        // Only who was here before the session began has a right to its first batches.
        let joined_idx = self.session_id.is_some().then_some(0);
        let counts = self.counts;
        *self = Self { session_id: Some(session_id), joined_idx, counts, ..Self::default() };
        rest
    }

    /// Waits no longer for what is missing before `idx`.
    fn given_up(&mut self, idx: u64) -> Vec<Batch> {
        let mut passed = Vec::new();
        while self.next_idx < idx {
            let until = self.held.keys().next().copied().unwrap_or(idx).min(idx);
            let heard_of = self.joined_idx.unwrap_or(u64::MAX).clamp(self.next_idx, until);
            self.counts.n_lost += until - heard_of;
            self.next_idx = until;
            passed.extend(self.released());
        }
        passed
    }

    fn released(&mut self) -> Vec<Batch> {
        let mut passed = Vec::new();
        while let Some(batch) = self.held.remove(&self.next_idx) {
            self.next_idx = self.next_idx.saturating_add(1);
            passed.push(batch);
        }
        self.counts.n_passed += passed.len() as u64;
        passed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn batch(session_id: u64, batch_idx: u64) -> Batch {
        Batch { session_id, batch_idx, messages: Vec::new() }
    }

    fn numbers(batches: &[Batch]) -> Vec<u64> {
        batches.iter().map(|batch| batch.batch_idx).collect()
    }

    fn passed(order: &mut Order, session_id: u64, batch_idx: u64) -> Vec<u64> {
        numbers(&order.update(batch(session_id, batch_idx)))
    }

    #[test]
    fn a_hole_is_asked_for_and_later_batches_wait_for_it() {
        let mut order = Order::default();
        assert_eq!(passed(&mut order, 7, 0), [0]);
        assert!(order.missing().is_none());
        assert!(passed(&mut order, 7, 3).is_empty());
        assert_eq!(order.missing(), Some((7, 1..3)));
        assert_eq!(passed(&mut order, 7, 1), [1]);
        assert_eq!(order.missing(), Some((7, 2..3)));
        assert_eq!(passed(&mut order, 7, 2), [2, 3]);
        let Counts { n_passed, n_filled, n_lost, .. } = order.counts();
        assert_eq!((n_passed, n_filled, n_lost), (4, 2, 0));
    }

    #[test]
    fn a_last_batch_that_was_lost_is_missed_too() {
        let mut order = Order::default();
        passed(&mut order, 7, 0);
        order.note_end(7, 3);
        assert_eq!(order.missing(), Some((7, 1..3)));
    }

    #[test]
    fn what_the_board_no_longer_has_is_lost_and_waited_for_no_longer() {
        let mut order = Order::default();
        passed(&mut order, 7, 0);
        passed(&mut order, 7, 9);
        assert_eq!(numbers(&order.note_oldest(7, 5)), Vec::<u64>::new());
        assert_eq!((order.counts().n_lost, order.missing()), (4, Some((7, 5..9))));
        assert_eq!(numbers(&order.note_oldest(7, 9)), [9]);
        assert_eq!((order.counts().n_lost, order.missing()), (8, None));
    }

    #[test]
    fn who_joins_late_asks_for_what_is_still_there_and_counts_nothing_lost() {
        let mut order = Order::default();
        assert!(passed(&mut order, 7, 100).is_empty());
        assert_eq!(order.missing(), Some((7, 0..100)));
        assert_eq!(numbers(&order.note_oldest(7, 100)), [100]);
        assert_eq!(order.counts().n_lost, 0);
        assert_eq!(order.counts().n_filled, 0);
    }

    #[test]
    fn a_board_that_begins_anew_lets_go_what_waited() {
        let mut order = Order::default();
        passed(&mut order, 7, 0);
        passed(&mut order, 7, 5);
        let now: Vec<_> =
            order.update(batch(8, 0)).iter().map(|b| (b.session_id, b.batch_idx)).collect();
        assert_eq!(now, [(7, 5), (8, 0)]);
        assert_eq!((order.counts().n_lost, order.counts().n_restarts), (4, 1));
        // It was heard from before: the first batches of the new run are not to be lost.
        let mut order = Order::default();
        passed(&mut order, 7, 0);
        passed(&mut order, 8, 2);
        assert_eq!(order.missing(), Some((8, 0..2)));
    }

    #[test]
    fn those_that_wait_have_a_limit() {
        let mut order = Order::default();
        passed(&mut order, 7, 0);
        let last = MAX_HELD as u64 + 2;
        let all: Vec<u64> = (2..=last).flat_map(|idx| passed(&mut order, 7, idx)).collect();
        assert_eq!(all, (2..=last).collect::<Vec<_>>());
        assert_eq!((order.counts().n_lost, order.n_held()), (1, 0));
    }

    proptest! {
        /// Whatever is lost and repeated on the way, all that the board keeps is passed on once,
        /// in its order.
        #[test]
        fn what_can_be_had_is_passed_on_once_and_in_order(
            is_dropped in prop::collection::vec(any::<bool>(), 1..300),
            is_repeated in any::<bool>(),
        ) {
            let mut order = Order::default();
            let mut all = passed(&mut order, 1, 0);
            for (idx, is_dropped) in (1..).zip(&is_dropped) {
                if !is_dropped {
                    all.extend(passed(&mut order, 1, idx));
                    if is_repeated {
                        all.extend(passed(&mut order, 1, idx));
                    }
                }
            }
            let end_idx = is_dropped.len() as u64 + 1;
            order.note_end(1, end_idx);
            while let Some((_, range)) = order.missing() {
                for idx in range {
                    all.extend(passed(&mut order, 1, idx));
                }
            }
            prop_assert_eq!(all, (0..end_idx).collect::<Vec<_>>());
            prop_assert_eq!(order.counts().n_lost, 0);
        }
    }
}

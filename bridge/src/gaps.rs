//! Batch numbers → what did not arrive.

/// Counts of one board's batches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Gaps {
    session_id: Option<u64>,
    next_idx: u64,
    /// Batches that arrived.
    pub n_arrived: u64,
    /// Batches that a later one overtook: lost, as TCP keeps their order.
    pub n_lost: u64,
    /// How often the board's bridge began anew.
    pub n_restarts: u64,
}

impl Gaps {
    /// Notes a batch and says how many are missing before it.
    pub fn update(&mut self, session_id: u64, batch_idx: u64) -> u64 {
        if self.session_id != Some(session_id) {
            self.n_restarts += u64::from(self.session_id.is_some());
            self.session_id = Some(session_id);
            self.next_idx = 0;
        }
        let n_missing = batch_idx.saturating_sub(self.next_idx);
        self.next_idx = self.next_idx.max(batch_idx.saturating_add(1));
        self.n_arrived += 1;
        self.n_lost += n_missing;
        n_missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_is_counted_once_and_a_restart_is_no_hole() {
        let mut gaps = Gaps::default();
        let missing: Vec<u64> = [(7, 0), (7, 1), (7, 5), (7, 6), (8, 0), (8, 2)]
            .into_iter()
            .map(|(session_id, batch_idx)| gaps.update(session_id, batch_idx))
            .collect();
        assert_eq!(missing, [0, 0, 3, 0, 0, 1]);
        assert_eq!((gaps.n_arrived, gaps.n_lost, gaps.n_restarts), (6, 4, 1));
    }

    #[test]
    fn joining_late_counts_what_came_before() {
        let mut gaps = Gaps::default();
        assert_eq!(gaps.update(1, 10), 10);
    }
}

//! A board's last ten seconds of batches, as they were sent: what did not arrive is asked for here.
//!
//! 10 s of a board with eight workers are 8000 batches of some 300 bytes; [`MAX_RING_BYTES`] holds
//! them with 64 candidates in every strip of half the frames.

use crate::wire::{N_STREAMS, Stream};
use shm_layout::StampNs;
use std::collections::VecDeque;
use zenoh::bytes::ZBytes;

/// How long a batch is kept.
pub const KEPT_NS: i64 = 10_000_000_000;

/// Most bytes that are kept, of all streams together.
pub const MAX_RING_BYTES: usize = 16 << 20;

#[derive(Debug)]
struct Kept {
    sent_ns: StampNs,
    bytes: ZBytes,
}

/// The batches that a board still has, oldest first, without a hole.
#[derive(Debug, Default)]
pub struct Ring {
    kept: [VecDeque<Kept>; N_STREAMS],
    end_idx: [u64; N_STREAMS],
    n_bytes: usize,
}

impl Ring {
    /// Takes the next batch of a stream in, and gives up what is older than [`KEPT_NS`] or beyond
    /// [`MAX_RING_BYTES`]. Returns its number.
    pub fn push(&mut self, stream: Stream, now_ns: StampNs, bytes: ZBytes) -> u64 {
        self.n_bytes += bytes.len();
        self.kept[stream.idx()].push_back(Kept { sent_ns: now_ns, bytes });
        self.end_idx[stream.idx()] += 1;
        while self.n_bytes > MAX_RING_BYTES
            || self.oldest_ns().is_some_and(|ns| ns < now_ns - KEPT_NS)
        {
            self.drop_oldest();
        }
        self.end_idx[stream.idx()] - 1
    }

    /// Number of the next batch of a stream.
    #[must_use]
    pub fn end_idx(&self, stream: Stream) -> u64 {
        self.end_idx[stream.idx()]
    }

    /// Number of the oldest batch of a stream that is still here.
    #[must_use]
    pub fn oldest_idx(&self, stream: Stream) -> u64 {
        self.end_idx(stream) - self.kept[stream.idx()].len() as u64
    }

    /// Number of the first batch of a stream that was sent at that time or later.
    #[must_use]
    pub fn first_since(&self, stream: Stream, since_ns: StampNs) -> u64 {
        let kept = &self.kept[stream.idx()];
        self.oldest_idx(stream) + kept.partition_point(|kept| kept.sent_ns < since_ns) as u64
    }

    /// Those of the batches `first_idx..end_idx` that are still here.
    pub fn range(
        &self,
        stream: Stream,
        first_idx: u64,
        end_idx: u64,
    ) -> impl Iterator<Item = &ZBytes> {
        let oldest_idx = self.oldest_idx(stream);
        let n = self.kept[stream.idx()].len() as u64;
        let place = |idx: u64| idx.saturating_sub(oldest_idx).min(n) as usize;
        self.kept[stream.idx()].range(place(first_idx)..place(end_idx)).map(|kept| &kept.bytes)
    }

    /// Bytes of all batches that are here.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        self.n_bytes
    }

    fn oldest_ns(&self) -> Option<StampNs> {
        self.kept.iter().filter_map(|kept| kept.front()).map(|kept| kept.sent_ns).min()
    }

    fn drop_oldest(&mut self) {
        let oldest_ns = self.oldest_ns();
        for kept in &mut self.kept {
            if kept.front().map(|first| first.sent_ns) == oldest_ns
                && let Some(first) = kept.pop_front()
            {
                self.n_bytes -= first.bytes.len();
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    fn bytes(of: u64, n: usize) -> ZBytes {
        vec![of as u8; n].into()
    }

    #[test]
    fn what_was_sent_in_the_last_ten_seconds_can_be_had_and_nothing_before() {
        let mut ring = Ring::default();
        for idx in 0..100 {
            let at_ns = idx as i64 * SECOND_NS / 2;
            assert_eq!(ring.push(Stream::Candidates, at_ns, bytes(idx, 3)), idx);
        }
        let since = |since_ns| ring.first_since(Stream::Candidates, since_ns);
        assert_eq!([since(0), since(48 * SECOND_NS - 1), since(i64::MAX)], [79, 96, 100]);
        assert_eq!(ring.first_since(Stream::FramesInfo, 0), 0);
        assert_eq!(
            (ring.oldest_idx(Stream::Candidates), ring.end_idx(Stream::Candidates)),
            (79, 100)
        );
        let had: Vec<u8> =
            ring.range(Stream::Candidates, 70, 82).map(|b| b.to_bytes()[0]).collect();
        assert_eq!(had, [79, 80, 81]);
        assert_eq!(ring.range(Stream::Candidates, 99, 200).count(), 1);
        assert_eq!(ring.range(Stream::Candidates, 200, 300).count(), 0);
        assert_eq!(ring.range(Stream::FramesInfo, 0, 10).count(), 0);
    }

    #[test]
    fn bytes_are_limited_and_the_oldest_goes_whichever_stream_it_is_of() {
        let mut ring = Ring::default();
        for idx in 0..40_u64 {
            let stream = Stream::ALL[(idx % 2) as usize];
            ring.push(stream, idx as i64, bytes(idx, 1 << 20));
        }
        for stream in Stream::ALL {
            assert_eq!((ring.oldest_idx(stream), ring.end_idx(stream)), (12, 20));
        }
    }
}

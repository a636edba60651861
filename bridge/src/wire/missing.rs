//! Which batches are asked for again ↔ bytes. The answer is those batches as they were.

use super::{N_STREAMS, Refusal, Stream, bytes_from, from_bytes};
use bincode::{Decode, Encode};

/// Most batches that may be asked for at once: 0.5 s of a board with eight workers.
pub const MAX_ASKED: u64 = 512;

/// Most bytes of such a message.
const MAX_BYTES: usize = 64;

/// Asks a board for batches of one of its streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub struct Missing {
    /// [`Stream::idx`] of the stream.
    pub stream_idx: u8,
    /// The run of the board's bridge they are of.
    pub session_id: u64,
    /// The first.
    pub first_idx: u64,
    /// The one after the last: at most [`MAX_ASKED`] more.
    pub end_idx: u64,
}

impl Missing {
    /// The stream they are of.
    #[must_use]
    pub fn stream(&self) -> Option<Stream> {
        Stream::ALL.get(usize::from(self.stream_idx)).copied()
    }

    /// Its bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        bytes_from::<MAX_BYTES>(self)
    }

    /// The request in these bytes.
    ///
    /// # Errors
    /// When they are none of this version, or ask for no batch or too many.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        let asked: Self = from_bytes::<Self, MAX_BYTES>(bytes)?;
        let n_asked = asked.end_idx.checked_sub(asked.first_idx);
        match n_asked {
            _ if usize::from(asked.stream_idx) >= N_STREAMS => {
                Err(Refusal::malformed(format_args!("stream {} asked for", asked.stream_idx)))
            }
            Some(1..=MAX_ASKED) => Ok(asked),
            _ => Err(Refusal::malformed(format_args!(
                "batches {} to {} asked for, at most {MAX_ASKED} at once",
                asked.first_idx, asked.end_idx
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_request_comes_back_as_it_was(
            session_id in any::<u64>(),
            first_idx in 0..u64::MAX - MAX_ASKED,
            n in 1..=MAX_ASKED,
        ) {
            let asked = Missing {
                stream_idx: 1,
                session_id,
                first_idx,
                end_idx: first_idx + n,
            };
            prop_assert_eq!(Missing::from_bytes(&asked.to_bytes()), Ok(asked));
        }

        #[test]
        fn any_bytes_are_a_request_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let _ = Missing::from_bytes(&bytes);
        }
    }

    #[test]
    fn a_stream_that_does_not_exist_is_refused() {
        let asked = Missing { stream_idx: 2, session_id: 1, first_idx: 0, end_idx: 1 };
        assert!(matches!(Missing::from_bytes(&asked.to_bytes()), Err(Refusal::Malformed(_))));
    }

    #[test]
    fn who_asks_for_nothing_or_for_everything_is_refused() {
        for (first_idx, end_idx) in [(5, 5), (5, 4), (0, MAX_ASKED + 1), (0, u64::MAX)] {
            let asked = Missing { stream_idx: 0, session_id: 1, first_idx, end_idx };
            assert!(matches!(Missing::from_bytes(&asked.to_bytes()), Err(Refusal::Malformed(_))));
        }
    }
}

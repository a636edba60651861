//! Ping and pong ↔ bytes: what the time is on the board, and how far its batches have come.

use super::{N_STREAMS, Refusal, bytes_from, from_bytes};
use bincode::{Decode, Encode};
use shm_layout::StampNs;

/// Most bytes of a ping or a pong.
const MAX_BYTES: usize = 256;

/// Asks a board for its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub struct Ping {
    /// When it was asked, on the asker's clock.
    pub sent_ns: StampNs,
    /// Which run of the asker's bridge this is.
    pub asker_id: u64,
    /// 1 sigma of the board's clock as the asker knows it by now;
    /// [`shm_layout::stamp::OWN_CLOCK`] while it does not.
    pub clock_sigma_ns: u32,
}

/// A board's answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub struct Pong {
    /// As in the ping.
    pub sent_ns: StampNs,
    /// When the ping came, on the board's clock.
    pub received_ns: StampNs,
    /// When this left, on the board's clock.
    pub answered_ns: StampNs,
    /// What the board's clock of the day is ahead of that of its stamps.
    pub day_minus_stamp_ns: i64,
    /// Which run of the board's bridge this is.
    pub session_id: u64,
    /// The oldest batch of each stream that the asker may have: those before were lost, or sent
    /// before it was there.
    pub oldest_idx: [u64; N_STREAMS],
    /// The one after the newest: a last batch that did not arrive is missed by this.
    pub end_idx: [u64; N_STREAMS],
}

impl Ping {
    /// Its bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        bytes_from::<MAX_BYTES>(self)
    }

    /// The ping in these bytes.
    ///
    /// # Errors
    /// When they are none of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        from_bytes::<Self, MAX_BYTES>(bytes)
    }
}

impl Pong {
    /// Its bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        bytes_from::<MAX_BYTES>(self)
    }

    /// The pong in these bytes.
    ///
    /// # Errors
    /// When they are none of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        from_bytes::<Self, MAX_BYTES>(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_pong_comes_back_as_it_was(stamps in any::<[i64; 4]>(), counts in any::<[u64; 5]>()) {
            let pong = Pong {
                sent_ns: stamps[0],
                received_ns: stamps[1],
                answered_ns: stamps[2],
                day_minus_stamp_ns: stamps[3],
                session_id: counts[0],
                oldest_idx: [counts[1], counts[2]],
                end_idx: [counts[3], counts[4]],
            };
            prop_assert_eq!(Pong::from_bytes(&pong.to_bytes()), Ok(pong));
        }

        #[test]
        fn a_ping_comes_back_as_it_was(
            sent_ns in any::<i64>(),
            asker_id in any::<u64>(),
            clock_sigma_ns in any::<u32>(),
        ) {
            let ping = Ping { sent_ns, asker_id, clock_sigma_ns };
            prop_assert_eq!(Ping::from_bytes(&ping.to_bytes()), Ok(ping));
        }

        #[test]
        fn any_bytes_are_a_ping_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = (Ping::from_bytes(&bytes), Pong::from_bytes(&bytes));
        }
    }
}

//! A batch of messages ↔ bytes.

use super::{Refusal, bytes_from, from_bytes};
use bincode::{Decode, Encode};
use shm_layout::{Camera, Candidate, FrameInfo, MAX_CANDIDATES, MAX_STRIPS, StripCandidates};

/// Most messages in a batch: at 90 frames/s with 8 workers, 9 are written in 11 ms.
pub const MAX_MESSAGES: usize = 64;

/// Most bytes of a batch; one message is at most 3.4 kB.
pub const MAX_BYTES: usize = 256 * 1024;
const _: () = assert!(MAX_MESSAGES * (16 + size_of::<StripCandidates>()) <= MAX_BYTES);

/// What a board sends at once on one of its streams.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// Which run of the board's bridge this is; numbers begin anew with it.
    pub session_id: u64,
    /// 0, 1, 2 … within the session. A missing number is a lost batch.
    pub batch_idx: u64,
    /// The messages, in the order they were written.
    pub messages: Vec<Message>,
}

/// One message of a batch.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// A frame was captured.
    FrameInfo(FrameInfo),
    /// A strip of a frame was looked at.
    Candidates(Box<StripCandidates>),
}

#[derive(Encode, Decode)]
struct WireBatch {
    session_id: u64,
    batch_idx: u64,
    messages: Vec<WireMessage>,
}

#[derive(Encode, Decode)]
enum WireMessage {
    FrameInfo(WireFrameInfo),
    Candidates(WireCandidates),
}

#[derive(Encode, Decode)]
struct WireFrameInfo {
    recording_id: u64,
    frame_idx: u64,
    exposed_ns: i64,
    published_ns: i64,
    width_px: u32,
    height_px: u32,
    is_last: bool,
    camera_idx: u32,
    clock_sigma_ns: u32,
}

#[derive(Encode, Decode)]
struct WireCandidates {
    recording_id: u64,
    frame_idx: u64,
    exposed_ns: i64,
    frame_published_ns: i64,
    started_ns: i64,
    finished_ns: i64,
    strip_idx: u32,
    n_strips: u32,
    n_dropped: u32,
    is_learning: bool,
    camera_idx: u32,
    clock_sigma_ns: u32,
    spots: Vec<[f32; 13]>,
}

/// The bytes of a batch.
///
/// # Panics
/// When it has more than [`MAX_MESSAGES`] messages.
#[must_use]
pub fn bytes_from_batch(batch: &Batch) -> Vec<u8> {
    assert!(batch.messages.len() <= MAX_MESSAGES, "outbound cuts batches");
    bytes_from::<MAX_BYTES>(&WireBatch {
        session_id: batch.session_id,
        batch_idx: batch.batch_idx,
        messages: batch.messages.iter().map(wire_from_message).collect(),
    })
}

/// The batch in these bytes.
///
/// # Errors
/// When they are of another version, too long, not a batch, or more than one.
pub fn batch_from_bytes(bytes: &[u8]) -> Result<Batch, Refusal> {
    let wire: WireBatch = from_bytes::<_, MAX_BYTES>(bytes)?;
    if wire.messages.len() > MAX_MESSAGES {
        return Err(Refusal::malformed(format_args!("{} messages", wire.messages.len())));
    }
    let messages = wire.messages.into_iter().map(message_from_wire).collect::<Result<_, _>>()?;
    Ok(Batch { session_id: wire.session_id, batch_idx: wire.batch_idx, messages })
}

fn wire_from_message(message: &Message) -> WireMessage {
    match message {
        Message::FrameInfo(info) => WireMessage::FrameInfo(WireFrameInfo {
            recording_id: info.recording_id,
            frame_idx: info.frame_idx,
            exposed_ns: info.exposed_ns,
            published_ns: info.published_ns,
            width_px: info.width_px,
            height_px: info.height_px,
            is_last: info.is_last != 0,
            camera_idx: info.camera_idx,
            clock_sigma_ns: info.clock_sigma_ns,
        }),
        Message::Candidates(strip) => WireMessage::Candidates(WireCandidates {
            recording_id: strip.recording_id,
            frame_idx: strip.frame_idx,
            exposed_ns: strip.exposed_ns,
            frame_published_ns: strip.frame_published_ns,
            started_ns: strip.started_ns,
            finished_ns: strip.finished_ns,
            strip_idx: strip.strip_idx,
            n_strips: strip.n_strips,
            n_dropped: strip.n_dropped,
            is_learning: strip.is_learning != 0,
            camera_idx: strip.camera_idx,
            clock_sigma_ns: strip.clock_sigma_ns,
            spots: strip.spots().iter().map(Candidate::to_array).collect(),
        }),
    }
}

fn message_from_wire(wire: WireMessage) -> Result<Message, Refusal> {
    let check = |is_fit: bool, what: String| is_fit.then_some(()).ok_or(Refusal::Malformed(what));
    let check_camera = |camera_idx: u32| {
        check(Camera::from_idx(camera_idx).is_some(), format!("camera {camera_idx}"))
    };
    match wire {
        WireMessage::FrameInfo(info) => {
            check_camera(info.camera_idx)?;
            Ok(Message::FrameInfo(FrameInfo {
                recording_id: info.recording_id,
                frame_idx: info.frame_idx,
                exposed_ns: info.exposed_ns,
                published_ns: info.published_ns,
                width_px: info.width_px,
                height_px: info.height_px,
                is_last: u32::from(info.is_last),
                camera_idx: info.camera_idx,
                clock_sigma_ns: info.clock_sigma_ns,
                reserved: 0,
            }))
        }
        WireMessage::Candidates(strip) => {
            check_camera(strip.camera_idx)?;
            let (idx, n) = (strip.strip_idx, strip.n_strips);
            check((1..=MAX_STRIPS).contains(&n) && idx < n, format!("strip {idx} of {n}"))?;
            let n_spots = strip.spots.len();
            check(n_spots <= MAX_CANDIDATES, format!("{n_spots} candidates"))?;
            Ok(Message::Candidates(Box::new(strip_from_wire(&strip))))
        }
    }
}

fn strip_from_wire(wire: &WireCandidates) -> StripCandidates {
    let mut strip = StripCandidates {
        recording_id: wire.recording_id,
        frame_idx: wire.frame_idx,
        exposed_ns: wire.exposed_ns,
        frame_published_ns: wire.frame_published_ns,
        started_ns: wire.started_ns,
        finished_ns: wire.finished_ns,
        strip_idx: wire.strip_idx,
        n_strips: wire.n_strips,
        n_dropped: wire.n_dropped,
        is_learning: u32::from(wire.is_learning),
        n_candidates: wire.spots.len() as u32,
        camera_idx: wire.camera_idx,
        clock_sigma_ns: wire.clock_sigma_ns,
        ..StripCandidates::default()
    };
    for (slot, fields) in strip.candidates.iter_mut().zip(&wire.spots) {
        *slot = Candidate::from_array(*fields);
    }
    strip
}

#[cfg(test)]
mod tests {
    use super::super::VERSION;
    use super::*;
    use proptest::prelude::*;

    fn any_info() -> impl Strategy<Value = Message> {
        (any::<[u64; 2]>(), any::<[i64; 2]>(), any::<[u32; 2]>(), any::<bool>(), 0..2_u32).prop_map(
            |(ids, stamps, sides, is_last, camera_idx)| {
                Message::FrameInfo(FrameInfo {
                    recording_id: ids[0],
                    frame_idx: ids[1],
                    exposed_ns: stamps[0],
                    published_ns: stamps[1],
                    width_px: sides[0],
                    height_px: sides[1],
                    is_last: u32::from(is_last),
                    camera_idx,
                    clock_sigma_ns: sides[0] ^ sides[1],
                    reserved: 0,
                })
            },
        )
    }

    fn any_strip() -> impl Strategy<Value = Message> {
        let spots = prop::collection::vec(prop::array::uniform13(-1e4_f32..1e4), 0..=64);
        (any::<[u64; 2]>(), any::<[i64; 4]>(), 0..8_u32, any::<u32>(), any::<bool>(), spots)
            .prop_map(|(ids, stamps, strip_idx, n_dropped, is_learning, spots)| {
                Message::Candidates(Box::new(strip_from_wire(&WireCandidates {
                    recording_id: ids[0],
                    frame_idx: ids[1],
                    exposed_ns: stamps[0],
                    frame_published_ns: stamps[1],
                    started_ns: stamps[2],
                    finished_ns: stamps[3],
                    strip_idx,
                    n_strips: 8,
                    n_dropped,
                    is_learning,
                    camera_idx: 1,
                    clock_sigma_ns: n_dropped / 2,
                    spots,
                })))
            })
    }

    fn any_batch() -> impl Strategy<Value = Batch> {
        let message = prop_oneof![any_info(), any_strip()];
        let messages = prop::collection::vec(message, 0..=MAX_MESSAGES);
        (any::<u64>(), any::<u64>(), messages).prop_map(|(session_id, batch_idx, messages)| Batch {
            session_id,
            batch_idx,
            messages,
        })
    }

    proptest! {
        #[test]
        fn a_batch_comes_back_as_it_was(batch in any_batch()) {
            prop_assert_eq!(batch_from_bytes(&bytes_from_batch(&batch)), Ok(batch));
        }

        #[test]
        fn any_bytes_are_a_batch_or_refused(body in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut bytes = VERSION.to_le_bytes().to_vec();
            bytes.extend(body);
            if let Ok(batch) = batch_from_bytes(&bytes) {
                prop_assert!(batch.messages.len() <= MAX_MESSAGES);
            }
        }

        #[test]
        fn a_cut_or_lengthened_batch_is_refused(
            batch in any_batch(),
            at in any::<prop::sample::Index>(),
        ) {
            let mut bytes = bytes_from_batch(&batch);
            prop_assert!(batch_from_bytes(&bytes[..at.index(bytes.len())]).is_err());
            bytes.push(0);
            prop_assert!(batch_from_bytes(&bytes).is_err());
        }
    }

    #[test]
    fn another_version_is_named() {
        let mut bytes = bytes_from_batch(&Batch { session_id: 1, batch_idx: 2, messages: vec![] });
        bytes[0] = 9;
        let refusal = batch_from_bytes(&bytes).unwrap_err();
        assert_eq!(refusal, Refusal::Version { theirs: 9 });
        let both = format!("version 9, this bridge version {VERSION}");
        assert!(refusal.to_string().contains(&both));
    }

    #[test]
    fn a_length_of_2_to_the_40_is_refused_without_allocating_it() {
        let mut bytes = VERSION.to_le_bytes().to_vec();
        bytes.extend([0, 0, 253, 0, 0, 0, 0, 0, 1, 0, 0]); // ids 0 and 0, then a u64 length
        assert!(matches!(batch_from_bytes(&bytes), Err(Refusal::Malformed(_))));
    }
}

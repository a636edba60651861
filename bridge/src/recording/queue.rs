//! What was read from shared memory → the thread that writes, without ever waiting.
//!
//! A disk may stand still for seconds; whoever reads shared memory must not. What the queue has no
//! room for is left out and counted: pixels first, for which there is room of their own, long
//! before anything that a replay needs.

use super::topics::Topic;
use crate::wire::batch::{Batch, Message, batch_from_bytes, bytes_from_batch};
use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, TrySendError, bounded};
use shm_layout::{FrameInfo, Link, StampNs};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

/// Most things that wait: 28 MB at the most, 5 s of two boards with eight workers, 45 s with one.
pub const MAX_WAITING: usize = 8192;

/// Most bytes of pixels that wait: 2 s of 640x480 at 90 frames/s.
pub const MAX_PIXEL_BYTES: usize = 64 << 20;

/// One thing to be written.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// Of a board.
    Message(Message),
    /// A frame's pixels.
    Frame(FrameInfo, Vec<u8>),
    /// A shot's JSON.
    Shot(String),
    /// How a board's link is.
    Link(Link),
    /// JSON of the machine's side.
    Machine(Topic, String),
}

/// A thing as it waits: a message as its bytes, for in memory there is room for all candidates that
/// a strip may have, and a board that comes back brings 2 s of it at once.
#[derive(Debug)]
enum Waiting {
    Bytes(Vec<u8>),
    Item(Item),
}

impl Waiting {
    fn from_item(item: Item) -> Self {
        match item {
            Item::Message(message) => {
                let messages = vec![message];
                Self::Bytes(bytes_from_batch(&Batch { session_id: 0, batch_idx: 0, messages }))
            }
            item => Self::Item(item),
        }
    }

    fn into_item(self) -> Option<Item> {
        match self {
            Self::Bytes(bytes) => batch_from_bytes(&bytes).ok()?.messages.pop().map(Item::Message),
            Self::Item(item) => Some(item),
        }
    }
}

/// What was left out.
#[derive(Debug, Default)]
pub struct LeftOut {
    /// Frames' pixels the queue had no room for.
    pub n_frames: AtomicU64,
    /// Frames that shared memory had overwritten before they were read.
    pub n_frames_missed: AtomicU64,
    /// Everything else the queue had no room for.
    pub n_messages: AtomicU64,
}

impl LeftOut {
    /// What was left out since it was this.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        let since = |now: &AtomicU64, before: &AtomicU64| {
            AtomicU64::new(now.load(Ordering::Relaxed) - before.load(Ordering::Relaxed))
        };
        Self {
            n_frames: since(&self.n_frames, &before.n_frames),
            n_frames_missed: since(&self.n_frames_missed, &before.n_frames_missed),
            n_messages: since(&self.n_messages, &before.n_messages),
        }
    }
}

impl Clone for LeftOut {
    fn clone(&self) -> Self {
        self.since(&Self::default())
    }
}

impl std::fmt::Display for LeftOut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [n_messages, n_frames, n_missed] =
            [&self.n_messages, &self.n_frames, &self.n_frames_missed]
                .map(|n| n.load(Ordering::Relaxed));
        match (n_messages, n_frames + n_missed) {
            (0, 0) => f.write_str("nothing left out"),
            _ => write!(
                f,
                "left out, as the disk was too slow: {n_messages} messages, {n_frames} frames; \
                 {n_missed} frames not read in time"
            ),
        }
    }
}

/// The end that things are put into.
#[derive(Debug)]
pub struct Inlet {
    items: Sender<(StampNs, Waiting)>,
    n_pixel_bytes: Arc<AtomicUsize>,
    max_pixel_bytes: usize,
    /// What was left out so far.
    pub left_out: Arc<LeftOut>,
}

/// The end that things come out of.
#[derive(Debug)]
pub struct Outlet {
    items: Receiver<(StampNs, Waiting)>,
    n_pixel_bytes: Arc<AtomicUsize>,
    /// What was left out so far.
    pub left_out: Arc<LeftOut>,
}

/// The other end is gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gone;

/// A queue of so many things and so many bytes of pixels.
#[must_use]
pub fn of_size(max_waiting: usize, max_pixel_bytes: usize) -> (Inlet, Outlet) {
    let (to_thread, items) = bounded(max_waiting);
    let n_pixel_bytes = Arc::new(AtomicUsize::new(0));
    let left_out = Arc::new(LeftOut::default());
    let outlet = Outlet {
        items,
        n_pixel_bytes: Arc::clone(&n_pixel_bytes),
        left_out: Arc::clone(&left_out),
    };
    (Inlet { items: to_thread, n_pixel_bytes, max_pixel_bytes, left_out }, outlet)
}

impl Inlet {
    /// Puts in what was read at this time, or leaves it out.
    ///
    /// # Errors
    /// When nobody takes anything out any more.
    pub fn put(&self, read_ns: StampNs, item: Item) -> Result<(), Gone> {
        let n_left_out = match &item {
            Item::Frame(..) => &self.left_out.n_frames,
            _ => &self.left_out.n_messages,
        };
        match self.items.try_send((read_ns, Waiting::from_item(item))) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full((_, waiting))) => {
                if let Waiting::Item(Item::Frame(_, luma)) = waiting {
                    self.n_pixel_bytes.fetch_sub(luma.len(), Ordering::Relaxed);
                }
                if n_left_out.fetch_add(1, Ordering::Relaxed) == 0 {
                    tracing::error!("the disk is too slow: something is left out of the recording");
                }
                Ok(())
            }
            Err(TrySendError::Disconnected(_)) => Err(Gone),
        }
    }

    /// Puts a frame in: its pixels are copied only if there is room for them.
    ///
    /// # Errors
    /// When nobody takes anything out any more.
    pub fn put_frame(&self, read_ns: StampNs, info: FrameInfo, luma: &[u8]) -> Result<(), Gone> {
        let waiting = self.n_pixel_bytes.load(Ordering::Relaxed);
        if waiting.saturating_add(luma.len()) > self.max_pixel_bytes {
            if self.left_out.n_frames.fetch_add(1, Ordering::Relaxed) == 0 {
                tracing::error!("the disk is too slow: frames are left out of the recording");
            }
            return Ok(());
        }
        self.n_pixel_bytes.fetch_add(luma.len(), Ordering::Relaxed);
        self.put(read_ns, Item::Frame(info, luma.to_vec()))
    }
}

impl Outlet {
    /// The next thing and when it was read. Give every frame's bytes back.
    ///
    /// # Errors
    /// When nothing came for so long, or the inlet is gone and all was taken.
    pub fn next_within(&self, timeout: Duration) -> Result<(StampNs, Item), RecvTimeoutError> {
        loop {
            let (read_ns, waiting) = self.items.recv_timeout(timeout)?;
            if let Some(item) = waiting.into_item() {
                return Ok((read_ns, item));
            }
            // Nobody sends what cannot be read again; a replay would refuse the whole recording.
            self.left_out.n_messages.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// A frame of so many bytes was written.
    pub fn give_back(&self, n_bytes: usize) {
        self.n_pixel_bytes.fetch_sub(n_bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_layout::StripCandidates;

    fn info() -> Item {
        Item::Message(Message::FrameInfo(FrameInfo::default()))
    }

    #[test]
    fn what_there_is_no_room_for_is_counted_and_nobody_waits() {
        let (inlet, outlet) = of_size(2, 100);
        for read_ns in 0..5 {
            inlet.put(read_ns, info()).unwrap();
        }
        assert_eq!(outlet.left_out.n_messages.load(Ordering::Relaxed), 3);
        for read_ns in 0..2 {
            assert_eq!(outlet.next_within(Duration::ZERO), Ok((read_ns, info())));
        }
        assert_eq!(outlet.next_within(Duration::ZERO), Err(RecvTimeoutError::Timeout));
    }

    #[test]
    fn a_strip_waits_in_as_little_room_as_it_needs_and_comes_out_as_it_was() {
        let mut strip = StripCandidates { frame_idx: 7, n_candidates: 2, ..Default::default() };
        let candidate = shm_layout::Candidate { x_px: 320.5, y_px: 0.1, ..Default::default() };
        strip.candidates[..2].fill(candidate);
        let item = Item::Message(Message::Candidates(Box::new(strip)));
        let waiting = Waiting::from_item(item.clone());
        let Waiting::Bytes(bytes) = &waiting else { panic!("{waiting:?}") };
        assert!(bytes.capacity() < size_of::<StripCandidates>() / 8, "{}", bytes.capacity());
        assert!(waiting.into_item() == Some(item), "other than it was");
    }

    #[test]
    fn pixels_are_left_out_before_anything_else() {
        let (inlet, outlet) = of_size(10, 100);
        for read_ns in 0..4 {
            inlet.put_frame(read_ns, FrameInfo::default(), &[0; 40]).unwrap();
            inlet.put(read_ns, info()).unwrap();
        }
        let count = |n: &AtomicU64| n.load(Ordering::Relaxed);
        assert_eq!(count(&outlet.left_out.n_frames), 2);
        assert_eq!(count(&outlet.left_out.n_messages), 0);
        outlet.give_back(40);
        inlet.put_frame(9, FrameInfo::default(), &[0; 40]).unwrap();
        assert_eq!(count(&outlet.left_out.n_frames), 2, "there is room again");
    }

    #[test]
    fn a_frame_that_found_no_place_gives_its_bytes_back() {
        let (inlet, outlet) = of_size(1, 100);
        inlet.put(0, info()).unwrap();
        for _ in 0..10 {
            inlet.put_frame(1, FrameInfo::default(), &[0; 40]).unwrap();
        }
        assert_eq!(outlet.n_pixel_bytes.load(Ordering::Relaxed), 0);
        assert_eq!(outlet.left_out.n_frames.load(Ordering::Relaxed), 10);
    }

    #[test]
    fn a_writer_that_is_gone_is_noticed() {
        let (inlet, outlet) = of_size(1, 100);
        drop(outlet);
        assert_eq!(inlet.put(0, info()), Err(Gone));
    }
}

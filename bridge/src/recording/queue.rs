//! What was read from shared memory → the thread that writes, without ever waiting.
//!
//! A disk may stand still for seconds; whoever reads shared memory must not. What the queue has no
//! room for is left out and counted: pixels first, for which there is room of their own, long
//! before anything that a replay needs.

use super::topics::Topic;
use crate::wire::batch::Message;
use crossbeam::channel::{Receiver, Sender, TrySendError, bounded};
use shm_layout::{FrameInfo, Link, StampNs};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Most things that wait: 28 MB, 5 s of two boards with eight workers, 45 s with one.
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
    items: Sender<(StampNs, Item)>,
    n_pixel_bytes: Arc<AtomicUsize>,
    max_pixel_bytes: usize,
    /// What was left out so far.
    pub left_out: Arc<LeftOut>,
}

/// The end that things come out of.
#[derive(Debug)]
pub struct Outlet {
    /// Ends when the inlet is gone and all was taken. Give every frame's bytes back.
    pub items: Receiver<(StampNs, Item)>,
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
        match self.items.try_send((read_ns, item)) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full((_, item))) => {
                if let Item::Frame(_, luma) = item {
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
    /// A frame of so many bytes was written.
    pub fn give_back(&self, n_bytes: usize) {
        self.n_pixel_bytes.fetch_sub(n_bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let kept: Vec<StampNs> = outlet.items.try_iter().map(|(read_ns, _)| read_ns).collect();
        assert_eq!(kept, [0, 1]);
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

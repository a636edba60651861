//! Rectified frames of both cameras, as they arrive -> the same in the order of their stamps.
//!
//! A frame waits until the other camera has shown that it will send nothing earlier: by a later
//! frame, or, live, by one so late that its next cannot come so soon. Without the second, of two
//! cameras that expose together, whose stamps differ by a clock's few microseconds, each frame of
//! one would wait for the next of the other. How long it waits beyond that depends on what the
//! other one has done before:
//!
//! - **It has been sending**: its link may be cut, and its board keeps the last ten seconds. So its
//!   frames are waited for until those of this camera span [`Waits::heard_s`]. A shot that fell
//!   into an outage is measured late, and as well as any other.
//! - **It has never sent**: there may be one camera only. [`Waits::n_unheard_frames`] frames wait.
//! - **It was waited for in vain**: it is silent, and is not waited for until it sends again; then
//!   it is as one that has been sending. What it sends from before what was given out meanwhile is
//!   dropped and counted.
//!
//! **Limit**: never more than [`MAX_WAITING`] frames of a camera wait, or `n_unheard_frames` if
//! that is more.

use crate::Dropped;
use crate::matched::Period;
use crate::motion::{later_ns, seconds_between};
use crate::rectified::RectifiedFrame;
use shm_layout::{Camera, StampNs};
use std::collections::VecDeque;

/// Most frames of a camera that wait for one that has been sending: 10 s at 400 Hz.
pub const MAX_WAITING: usize = 4096;

/// How long one camera is waited for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waits {
    /// Frames that wait for a camera that has never sent: 32 are 0.35 s at 90 Hz.
    pub n_unheard_frames: usize,
    /// Seconds, by the stamps of what waits, for one that has been sending: as long as its board
    /// keeps what was not sent.
    pub heard_s: f64,
    /// Part of a camera's shortest period after a frame of it within which it sends no other.
    /// Stamps of steady cameras are off by less than a millisecond; what comes sooner is late.
    pub steady: f64,
}

impl Waits {
    /// For boards that send what they see.
    pub const LIVE: Self = Self { n_unheard_frames: 32, heard_s: 10.0, steady: 0.75 };

    /// For two recordings, which are played independently: one may be ahead by twelve minutes at
    /// 90 frames/s.
    pub const RECORDED: Self =
        Self { n_unheard_frames: 1 << 16, heard_s: f64::INFINITY, steady: 0.0 };

    /// Whether what waits of one camera has waited long enough for the other.
    fn are_over(&self, waiting: &VecDeque<RectifiedFrame>, is_heard: bool) -> bool {
        if !is_heard {
            return waiting.len() > self.n_unheard_frames;
        }
        let (Some(first), Some(last)) = (waiting.front(), waiting.back()) else { return false };
        waiting.len() > self.n_unheard_frames.max(MAX_WAITING)
            || seconds_between(first.t_ns, last.t_ns) > self.heard_s
    }
}

#[derive(Default)]
struct Side {
    waiting: VecDeque<RectifiedFrame>,
    is_heard: bool,
    is_silent: bool,
    period: Period,
    /// It sends nothing from before that, as far as its period is known.
    next_ns: Option<StampNs>,
}

/// Brings two streams of frames into one.
#[derive(Default)]
pub struct Merge {
    sides: [Side; 2],
    now_ns: Option<StampNs>,
}

impl Merge {
    /// Takes a frame in, later than the last of its camera; gives out what is now in order.
    pub fn update(
        &mut self,
        frame: RectifiedFrame,
        waits: &Waits,
        dropped: &mut Dropped,
    ) -> Vec<RectifiedFrame> {
        let (own, other) = (frame.camera.idx(), 1 - frame.camera.idx());
        self.sides[own].is_silent = false;
        self.sides[own].is_heard = true;
        if self.now_ns.is_some_and(|now_ns| frame.t_ns < now_ns) {
            dropped.n_late_frames += 1;
            return Vec::new();
        }
        let side = &mut self.sides[own];
        side.period.update(frame.t_ns);
        let period_s = side.period.shortest_ns().map(|period_ns| seconds_between(0, period_ns));
        side.next_ns = period_s.map(|period_s| later_ns(frame.t_ns, waits.steady * period_s));
        side.waiting.push_back(frame);
        if waits.are_over(&self.sides[own].waiting, self.sides[other].is_heard) {
            self.sides[other].is_silent = true;
        }
        let mut released = Vec::new();
        while let Some(next) = self.next_if(|side| side.is_silent) {
            released.push(next);
        }
        released
    }

    /// Whether a camera was waited for in vain.
    #[must_use]
    pub fn is_silent(&self, camera: Camera) -> bool {
        self.sides[camera.idx()].is_silent
    }

    /// No more frames will come: gives out all that wait.
    pub fn finish(&mut self) -> Vec<RectifiedFrame> {
        let mut released = Vec::new();
        while let Some(next) = self.next_if(|_| true) {
            released.push(next);
        }
        *self = Self::default();
        released
    }

    /// The earliest frame, if the other camera has one too or need not be waited for.
    fn next_if(&mut self, is_over: impl Fn(&Side) -> bool) -> Option<RectifiedFrame> {
        let first_ns = |side: &Side| side.waiting.front().map(|frame| frame.t_ns);
        let is_over = |side: &Side, t_ns| is_over(side) || side.next_ns >= Some(t_ns);
        let [left, right] = &self.sides;
        let camera = match (first_ns(left), first_ns(right)) {
            (Some(left_ns), Some(right_ns)) if right_ns < left_ns => Camera::Right,
            (Some(_), Some(_)) => Camera::Left,
            (Some(left_ns), None) if is_over(right, left_ns) || self.now_ns >= Some(left_ns) => {
                Camera::Left
            }
            (None, Some(right_ns)) if is_over(left, right_ns) || self.now_ns >= Some(right_ns) => {
                Camera::Right
            }
            _ => return None,
        };
        let frame = self.sides[camera.idx()].waiting.pop_front()?;
        self.now_ns = Some(frame.t_ns);
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_layout::stamp::OWN_CLOCK;

    fn frame(camera: Camera, t_ns: StampNs) -> RectifiedFrame {
        let (frame_idx, clock_sigma_ns) = (0, OWN_CLOCK);
        RectifiedFrame { camera, frame_idx, t_ns, clock_sigma_ns, spots: Vec::new() }
    }

    /// A stream, and how many of its frames came out, and in which order.
    struct Stream {
        merge: Merge,
        dropped: Dropped,
        seen: Vec<StampNs>,
    }

    impl Stream {
        fn new() -> Self {
            Self { merge: Merge::default(), dropped: Dropped::default(), seen: Vec::new() }
        }

        /// How many come out for a frame taken in.
        fn take(&mut self, camera: Camera, t_ms: StampNs) -> usize {
            let frame = frame(camera, t_ms * 1_000_000);
            let released = self.merge.update(frame, &Waits::LIVE, &mut self.dropped);
            self.seen.extend(released.iter().map(|frame| frame.t_ns));
            released.len()
        }
    }

    #[test]
    fn frames_come_out_in_order_however_far_one_camera_is_ahead() {
        let mut stream = Stream::new();
        for i in 0..20 {
            stream.take(Camera::Left, 10 * i);
        }
        for i in 0..20 {
            stream.take(Camera::Right, 10 * i + 3);
        }
        stream.seen.extend(stream.merge.finish().iter().map(|frame| frame.t_ns));
        assert_eq!(stream.seen.len(), 40);
        assert!(stream.seen.is_sorted());
        assert_eq!(stream.dropped, Dropped::default());
    }

    #[test]
    fn equal_stamps_do_not_wait_for_the_next_frame() {
        let mut stream = Stream::new();
        stream.take(Camera::Left, 0);
        assert_eq!(stream.take(Camera::Right, 0), 2);
    }

    #[test]
    fn a_frame_does_not_wait_for_a_camera_that_cannot_send_an_earlier_one_so_soon() {
        for apart_ms in [0, 1, 3, 5, 7, 8] {
            let mut stream = Stream::new();
            let mut n_held = 0;
            for i in 0..100 {
                let (left_ms, right_ms) = (11 * i, 11 * i + apart_ms);
                n_held += usize::from(stream.take(Camera::Left, left_ms) == 0);
                stream.take(Camera::Right, right_ms);
                let is_out = stream.seen.last() == Some(&(right_ms * 1_000_000));
                assert_eq!(is_out, apart_ms == 0 || i >= 8, "{apart_ms} ms, frame {i}");
            }
            // A left frame comes 11 ms less `apart_ms` after the right one: at most 0.75 periods.
            let is_held = apart_ms < 3;
            assert_eq!(n_held > 50, is_held, "{apart_ms} ms: {n_held}");
            assert!(stream.seen.is_sorted());
            assert_eq!(stream.dropped, Dropped::default());
        }
    }

    #[test]
    fn a_camera_that_becomes_quicker_loses_no_frame() {
        let mut stream = Stream::new();
        // The right camera's frames 22 ms apart, then 11; each arrives when it is exposed.
        for i in 0..100 {
            if i % 2 == 0 || i >= 50 {
                stream.take(Camera::Right, 11 * i);
            }
            stream.take(Camera::Left, 11 * i + 5);
        }
        assert_eq!(stream.dropped, Dropped::default());
        assert!(stream.seen.is_sorted() && stream.seen.len() >= 173, "{}", stream.seen.len());
    }

    #[test]
    fn one_camera_alone_waits_for_the_other_a_third_of_a_second() {
        let mut stream = Stream::new();
        let mut n_out = 0;
        for i in 0..100 {
            n_out += stream.take(Camera::Left, 11 * i);
            assert_eq!(n_out, if i < 32 { 0 } else { i as usize + 1 });
        }
        assert!(stream.merge.is_silent(Camera::Right));
        // The second board joins: from its first frame on both are in order.
        assert_eq!(stream.take(Camera::Right, 11 * 50), 0, "what is over is over");
        assert_eq!(stream.dropped.n_late_frames, 1);
        assert_eq!(stream.take(Camera::Left, 11 * 100), 0, "it is waited for now");
        assert_eq!(stream.take(Camera::Right, 11 * 101), 1);
    }

    #[test]
    fn a_camera_that_was_sending_is_waited_for_ten_seconds_and_then_no_more() {
        let mut stream = Stream::new();
        stream.take(Camera::Left, 0);
        stream.take(Camera::Right, 0);
        for i in 1..=1001 {
            assert_eq!(stream.take(Camera::Left, 10 * i), 0, "{i}");
        }
        assert_eq!(stream.take(Camera::Left, 10_020), 1002);
        assert!(stream.merge.is_silent(Camera::Right));
        assert_eq!(stream.take(Camera::Left, 10_030), 1, "nobody waits for what is gone");
        // Back, with what its board has kept: the old part is late, the rest is in order.
        for i in 100..=1010 {
            stream.take(Camera::Right, 10 * i + 5);
        }
        assert_eq!(stream.dropped.n_late_frames, 903);
        assert!(stream.seen.is_sorted());
        // One of the eight could not be preceded, 5 ms after a left frame.
        assert_eq!(stream.take(Camera::Left, 10_200), 7, "what it had is given out");
        assert_eq!(stream.take(Camera::Left, 10_210), 0, "it is waited for again");
    }

    #[test]
    fn what_waits_is_limited_even_if_stamps_stand_nearly_still() {
        let mut stream = Stream::new();
        stream.take(Camera::Left, 0);
        stream.take(Camera::Right, 0);
        let mut merge = stream.merge;
        let mut n_waiting = 0;
        for t_ns in 1..=2 * MAX_WAITING as StampNs {
            let out = merge.update(frame(Camera::Left, t_ns), &Waits::LIVE, &mut stream.dropped);
            n_waiting = n_waiting + 1 - out.len();
            assert!(n_waiting <= MAX_WAITING);
        }
    }
}

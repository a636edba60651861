//! Rectified frames of both cameras, as they arrive -> the same in the order of their stamps.
//!
//! A frame waits until the other camera has shown that it will send nothing earlier. So that one
//! silent camera never stops the other, a camera that keeps more than
//! [`Settings::n_waiting_frames`](crate::Settings) waiting is silent, and is not waited for until
//! it sends again. What it then sends late is out of order and is dropped and counted.

use crate::Dropped;
use crate::rectified::RectifiedFrame;
use shm_layout::{Camera, StampNs};
use std::collections::VecDeque;

#[derive(Default)]
struct Side {
    waiting: VecDeque<RectifiedFrame>,
    is_silent: bool,
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
        n_waiting_max: usize,
        dropped: &mut Dropped,
    ) -> Vec<RectifiedFrame> {
        let (own, other) = (frame.camera.idx(), 1 - frame.camera.idx());
        self.sides[own].is_silent = false;
        if self.now_ns.is_some_and(|now_ns| frame.t_ns < now_ns) {
            dropped.n_late_frames += 1;
            return Vec::new();
        }
        self.sides[own].waiting.push_back(frame);
        if self.sides[own].waiting.len() > n_waiting_max {
            self.sides[other].is_silent = true;
        }
        let mut released = Vec::new();
        while let Some(next) = self.next_if(|side| side.is_silent) {
            released.push(next);
        }
        released
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
        let [left, right] = &self.sides;
        let camera = match (first_ns(left), first_ns(right)) {
            (Some(left_ns), Some(right_ns)) if right_ns < left_ns => Camera::Right,
            (Some(_), Some(_)) => Camera::Left,
            (Some(left_ns), None) if is_over(right) || self.now_ns >= Some(left_ns) => Camera::Left,
            (None, Some(right_ns)) if is_over(left) || self.now_ns >= Some(right_ns) => {
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
        RectifiedFrame { camera, t_ns, clock_sigma_ns: OWN_CLOCK, spots: Vec::new() }
    }

    #[test]
    fn frames_come_out_in_order_however_far_one_camera_is_ahead() {
        let (mut merge, mut dropped) = (Merge::default(), Dropped::default());
        let mut seen = Vec::new();
        let mut take = |frames: Vec<RectifiedFrame>| seen.extend(frames.iter().map(|f| f.t_ns));
        for i in 0..20 {
            take(merge.update(frame(Camera::Left, 10 * i), 32, &mut dropped));
        }
        for i in 0..20 {
            take(merge.update(frame(Camera::Right, 10 * i + 3), 32, &mut dropped));
        }
        take(merge.finish());
        assert_eq!(seen.len(), 40);
        assert!(seen.is_sorted());
        assert_eq!(dropped, Dropped::default());
    }

    #[test]
    fn equal_stamps_do_not_wait_for_the_next_frame() {
        let (mut merge, mut dropped) = (Merge::default(), Dropped::default());
        merge.update(frame(Camera::Left, 0), 32, &mut dropped);
        assert_eq!(merge.update(frame(Camera::Right, 0), 32, &mut dropped).len(), 2);
    }

    #[test]
    fn a_silent_camera_stops_nobody_and_its_late_frames_are_counted() {
        let (mut merge, mut dropped) = (Merge::default(), Dropped::default());
        let mut n_out = 0;
        for i in 0..100 {
            n_out += merge.update(frame(Camera::Left, i), 8, &mut dropped).len();
        }
        assert_eq!(n_out, 100, "after eight frames nobody waits");
        assert!(merge.update(frame(Camera::Right, 50), 8, &mut dropped).is_empty());
        assert_eq!(dropped.n_late_frames, 1);
        assert!(merge.update(frame(Camera::Left, 100), 8, &mut dropped).is_empty(), "it is back");
        assert_eq!(merge.update(frame(Camera::Right, 101), 8, &mut dropped).len(), 1);
    }
}

//! Messages of a board → workers that do nothing though frames come.
//!
//! A process that has died is seen by the kernel; one that waits for ever, or goes round in a
//! circle, is seen by what it does not send. A camera that gives no frames is no fault of a worker:
//! time counts from the first frame that a worker has not answered.

use shm_layout::MAX_STRIPS;
use std::time::{Duration, Instant};

/// A worker that is done with no frame for so long is stuck; one that starts is done with its
/// first within a tenth of it.
pub const STUCK_AFTER: Duration = Duration::from_secs(2);

/// So many frames must have come meanwhile: one that came just before is no proof.
const N_FRAMES_MIN: u32 = 20;

#[derive(Debug, Clone, Copy, Default)]
struct Unanswered {
    n_frames: u32,
    since: Option<Instant>,
}

/// What each worker has not answered.
#[derive(Debug, Default)]
pub struct Answers {
    of_strips: [Unanswered; MAX_STRIPS as usize],
}

impl Answers {
    /// Takes note of a frame.
    pub fn update_frame(&mut self, now: Instant) {
        for strip in &mut self.of_strips {
            strip.n_frames = strip.n_frames.saturating_add(1);
            strip.since.get_or_insert(now);
        }
    }

    /// Takes note of a worker that was done with one, or was started.
    pub fn update(&mut self, strip_idx: u32) {
        if let Some(strip) = self.of_strips.get_mut(strip_idx as usize) {
            *strip = Unanswered::default();
        }
    }

    /// Workers, of so many, that are stuck.
    #[must_use]
    pub fn stuck(&self, n_workers: u32, now: Instant) -> Vec<u32> {
        let is_stuck = |strip: &Unanswered| {
            strip.n_frames >= N_FRAMES_MIN && strip.since.is_some_and(|s| now - s >= STUCK_AFTER)
        };
        let strips = (0..n_workers).zip(&self.of_strips);
        strips.filter(|(_, strip)| is_stuck(strip)).map(|(idx, _)| idx).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_answers_no_frame_for_long_is_stuck_and_a_silent_camera_is_nobodys_fault() {
        let begun = Instant::now();
        let at = |ms: u64| begun + Duration::from_millis(ms);
        let mut answers = Answers::default();
        for frame in 0..400 {
            answers.update_frame(at(frame * 11));
            answers.update(0);
            if frame < 50 || frame == 200 || frame == 125 {
                answers.update(1);
            }
            // The first that was not answered is number 201.
            let is_late = frame >= 201 + 182;
            assert_eq!(answers.stuck(2, at(frame * 11)) == [1], is_late, "{frame}");
        }
        answers.update(1);
        assert!(answers.stuck(2, at(60_000)).is_empty(), "no frame came");
        answers.update_frame(at(60_000));
        assert!(answers.stuck(2, at(99_000)).is_empty(), "a frame a minute");
    }
}

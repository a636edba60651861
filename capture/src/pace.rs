//! When the next frame is published: at the speed of its stamps, or as fast as workers keep up.
//!
//! A writer never waits for a reader in these services, so a recording that may lose nothing needs
//! its own brake: capture reads the candidates the workers send and keeps at most
//! [`MAX_IN_FLIGHT`] frames between itself and the slowest strip. That is less than the frames'
//! queue holds, so nothing is ever overwritten.

use crate::Error;
use shm_layout::ports::{Alarm, MessageReader, MessageService};
use shm_layout::table::FRAMES;
use shm_layout::{StampNs, StripCandidates};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Frames published and not yet done by every strip.
pub const MAX_IN_FLIGHT: usize = 3;
const _: () = assert!(MAX_IN_FLIGHT < FRAMES.depth, "or a slow worker's queue would overflow");

/// Workers that finish nothing for this long are stuck or dead.
const PROGRESS_WITHIN: Duration = Duration::from_secs(10);

/// How fast a recording is played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Speed {
    /// As it was recorded; what workers are too slow for is lost, and counted.
    Real,
    /// As fast as workers keep up; nothing is lost.
    Max,
}

/// The brake: which published frames some strip has not finished yet.
#[derive(Debug)]
pub struct InFlight {
    candidates: MessageReader<StripCandidates>,
    alarm: Alarm,
    n_workers: u32,
    unfinished: VecDeque<(u64, u32)>,
    progress_at: Instant,
}

impl InFlight {
    /// Reads the progress of `n_workers` from their candidates.
    ///
    /// # Errors
    /// When the service has too many readers.
    pub fn new(
        candidates: &MessageService<StripCandidates>,
        n_workers: u32,
    ) -> Result<Self, Error> {
        Ok(Self {
            candidates: candidates.reader()?,
            alarm: candidates.alarm()?,
            n_workers,
            unfinished: VecDeque::with_capacity(FRAMES.depth + 1),
            progress_at: Instant::now(),
        })
    }

    /// Notes that a frame was published.
    pub fn add(&mut self, frame_idx: u64) {
        // Further back than a worker's queue reaches it will not be finished, by nobody at all.
        if self.unfinished.len() > FRAMES.depth {
            self.unfinished.pop_front();
        }
        self.unfinished.push_back((frame_idx, 0));
    }

    /// Waits until at most `n_left` frames are unfinished; `look` is called at least every 50 ms.
    ///
    /// # Errors
    /// [`Error::WorkersStuck`] when nothing was finished for 10 s, what `look` returns.
    pub fn wait_until_at_most(
        &mut self,
        n_left: usize,
        mut look: impl FnMut() -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.progress_at = Instant::now();
        loop {
            self.take_progress()?;
            if self.unfinished.len() <= n_left {
                return Ok(());
            }
            look()?;
            if self.progress_at.elapsed() > PROGRESS_WITHIN {
                let waited_s = PROGRESS_WITHIN.as_secs();
                let frame_idx = self.unfinished.front().map_or(0, |&(idx, _)| idx);
                return Err(Error::WorkersStuck { waited_s, frame_idx });
            }
            self.alarm.wait()?;
        }
    }

    /// Takes note of what the workers have finished, without waiting.
    ///
    /// # Errors
    /// When shared memory is gone.
    pub fn take_progress(&mut self) -> Result<(), Error> {
        while let Some(strip) = self.candidates.receive()? {
            self.progress_at = Instant::now();
            for (frame_idx, n_done) in &mut self.unfinished {
                *n_done += u32::from(*frame_idx == strip.frame_idx);
            }
            // Further back than a worker's queue reaches, a frame was lost: it will not finish.
            let oldest = strip.frame_idx.saturating_sub(FRAMES.depth as u64);
            let n_workers = self.n_workers;
            self.unfinished.retain(|&(idx, n_done)| n_done < n_workers && idx >= oldest);
        }
        Ok(())
    }
}

/// When a frame with this stamp is due, if the one with `first_ns` was published at `begun`.
#[must_use]
pub fn due_at(begun: Instant, first_ns: StampNs, exposed_ns: StampNs) -> Instant {
    begun + Duration::from_nanos(exposed_ns.saturating_sub(first_ns).unsigned_abs())
}

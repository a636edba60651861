//! Frames of both cameras -> the shared memory beside a `fusion` process, as its bridge writes
//! them, no faster than it takes them in.
//!
//! Stamps are those of this machine: the time of the frames, which starts now and goes as fast as
//! `fusion` does. Both boards' clocks are known to 50 µs.

use std::time::{Duration, Instant};

use shm_layout::ports::{Alarm, MessageReader, MessageWriter};
use shm_layout::services::{self, Member};
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use shm_layout::{Camera, FrameInfo, MAX_CANDIDATES, StampNs, StripCandidates, Taken};

use crate::accuracy::stream::Seen;

/// Messages of a kind that `fusion` may be behind: fewer than shared memory keeps for it, and more
/// than the 64 after which it says how far it is.
const MAX_AHEAD: u64 = 512;
/// A `fusion` that takes nothing for this long is not there.
const TAKEN_WITHIN: Duration = Duration::from_secs(30);
/// 1 sigma of what translating stamps has cost.
const CLOCK_SIGMA_NS: u32 = 50_000;

/// Why frames could not be served.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Shared memory was refused.
    #[error(transparent)]
    Services(#[from] services::Error),
    /// Nobody reads.
    #[error("no fusion takes candidates: waited {0:?}")]
    NobodyTakes(Duration),
    /// Asked to end.
    #[error("stopped")]
    Stopped,
}

/// The writing ends of a court's `fusion` domain.
pub struct Served {
    infos: MessageWriter<FrameInfo>,
    strips: MessageWriter<StripCandidates>,
    taken: MessageReader<Taken>,
    alarm: Alarm,
    before: Taken,
    now: Taken,
    written: Taken,
    begun_ns: StampNs,
    sizes_px: [[u32; 2]; 2],
    stop: Stop,
}

impl Served {
    /// Once `fusion` reads. `begun_ns` is the stamp of time 0 of all frames.
    ///
    /// # Errors
    /// When nobody reads, or shared memory is refused.
    pub fn open(
        member: &Member,
        begun_ns: StampNs,
        sizes_px: [[u32; 2]; 2],
        stop: &Stop,
    ) -> Result<Self, Error> {
        let taken = member.taken()?;
        let mut served = Self {
            infos: member.frames_info()?.writer()?,
            strips: member.candidates()?.writer()?,
            taken: taken.reader()?,
            alarm: taken.alarm()?,
            before: Taken::default(),
            now: Taken::default(),
            written: Taken::default(),
            begun_ns,
            sizes_px,
            stop: stop.clone(),
        };
        served.before = served.next_taken()?;
        served.now = served.before;
        Ok(served)
    }

    /// Whoever commands may take his time: what is at `at_s` is not to be before now.
    pub fn catch_up(&mut self, at_s: f64) {
        self.begun_ns += (now_ns() - self.stamp_ns(at_s)).max(0);
    }

    /// The stamp of a time of the frames.
    pub fn stamp_ns(&self, at_s: f64) -> StampNs {
        self.begun_ns + (at_s * 1e9).round() as i64
    }

    /// One frame of one camera.
    ///
    /// # Errors
    /// When `fusion` takes nothing any more.
    pub fn send(&mut self, seen: &Seen) -> Result<(), Error> {
        self.wait_for_room(MAX_AHEAD)?;
        let frame = &seen.frame;
        let exposed_ns = self.begun_ns + frame.exposed_ns;
        let camera_idx = seen.camera.idx() as u32;
        let [width_px, height_px] = self.sizes_px[seen.camera.idx()];
        self.infos.send(FrameInfo {
            recording_id: frame.recording_id,
            frame_idx: frame.frame_idx,
            exposed_ns,
            published_ns: exposed_ns,
            width_px,
            height_px,
            camera_idx,
            clock_sigma_ns: CLOCK_SIGMA_NS,
            ..FrameInfo::default()
        })?;
        self.written.n_infos += 1;
        let mut strip = StripCandidates {
            recording_id: frame.recording_id,
            frame_idx: frame.frame_idx,
            exposed_ns,
            frame_published_ns: exposed_ns,
            started_ns: exposed_ns,
            finished_ns: exposed_ns,
            n_dropped: frame.n_dropped as u32,
            is_learning: u32::from(frame.is_learning),
            camera_idx,
            clock_sigma_ns: CLOCK_SIGMA_NS,
            ..StripCandidates::default()
        };
        let n = frame.spots.len().min(MAX_CANDIDATES);
        strip.n_candidates = n as u32;
        strip.candidates[..n].copy_from_slice(&frame.spots[..n]);
        self.strips.send(strip)?;
        self.written.n_strips += 1;
        Ok(())
    }

    /// Waits until `fusion` has taken in all there is.
    ///
    /// # Errors
    /// When it does not.
    pub fn settle(&mut self) -> Result<(), Error> {
        self.wait_for_room(0)
    }

    fn wait_for_room(&mut self, max_ahead: u64) -> Result<(), Error> {
        while self.n_ahead() > max_ahead {
            let next = self.next_taken()?;
            if next.n_infos < self.now.n_infos || next.n_strips < self.now.n_strips {
                // Another fusion counts, from its own beginning: what was sent before is lost.
                (self.before, self.written) = (next, Taken::default());
            }
            self.now = next;
        }
        Ok(())
    }

    fn n_ahead(&self) -> u64 {
        let n_infos = self.now.n_infos.saturating_sub(self.before.n_infos);
        let n_strips = self.now.n_strips.saturating_sub(self.before.n_strips);
        let behind = |written: u64, taken: u64| written.saturating_sub(taken);
        behind(self.written.n_infos, n_infos).max(behind(self.written.n_strips, n_strips))
    }

    /// What `fusion` says next.
    fn next_taken(&mut self) -> Result<Taken, Error> {
        let begun = Instant::now();
        loop {
            if self.stop.is_raised() {
                return Err(Error::Stopped);
            }
            if let Some(taken) = self.taken.receive()? {
                return Ok(*taken);
            }
            if begun.elapsed() > TAKEN_WITHIN {
                return Err(Error::NobodyTakes(TAKEN_WITHIN));
            }
            self.alarm.wait()?;
        }
    }
}

/// Width and height of both cameras of a scenario.
pub fn sizes_px(scenario: &crate::scenario::Scenario) -> [[u32; 2]; 2] {
    Camera::BOTH.map(|camera| {
        let eye = scenario.rig.camera(crate::camera::Side::BOTH[camera.idx()]);
        [eye.width_px as u32, eye.height_px as u32]
    })
}

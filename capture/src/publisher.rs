//! Lends a frame in shared memory, has it filled, and publishes it to whoever reads.
//!
//! The simulator publishes through this too: what pretends to be a camera comes in by this door.

use crate::Error;
use shm_layout::dev_shm;
use shm_layout::ports::{FrameService, FrameWriter, MessageService, MessageWriter};
use shm_layout::services::Member;
use shm_layout::stamp::{OWN_CLOCK, now_ns};
use shm_layout::{Camera, FrameInfo, StampNs};
use std::time::{Duration, Instant};

/// How long a recording waits for those who are to read it.
const READERS_WITHIN: Duration = Duration::from_secs(20);

/// The writing end of one camera's frames.
#[derive(Debug)]
pub struct Publisher {
    frames: FrameService,
    infos: MessageService<FrameInfo>,
    frame_writer: FrameWriter,
    info_writer: MessageWriter<FrameInfo>,
    camera: Camera,
    recording_id: u64,
    next_idx: u64,
    width_px: u32,
    height_px: u32,
    clock_sigma_ns: u32,
}

/// What became of a published frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Published {
    /// Its number within the recording.
    pub frame_idx: u64,
    /// How many readers have it.
    pub n_reached: usize,
}

impl Publisher {
    /// Opens the services of `camera` for frames of one size.
    ///
    /// # Errors
    /// When /dev/shm is too small, or another capture publishes this camera.
    pub fn new(
        member: &Member,
        camera: Camera,
        (width_px, height_px): (u32, u32),
    ) -> Result<Self, Error> {
        dev_shm::check_holds_frames(width_px, height_px)?;
        let (frames, infos) = (member.frames()?, member.frames_info()?);
        let frame_writer = frames.writer(width_px as usize * height_px as usize)?;
        let info_writer = infos.writer()?;
        // Boots and runs differ in it; two runs within a nanosecond do not happen.
        let recording_id = u64::from(std::process::id()) << 40 ^ now_ns().unsigned_abs();
        Ok(Self {
            frames,
            infos,
            frame_writer,
            info_writer,
            camera,
            recording_id,
            next_idx: 0,
            width_px,
            height_px,
            clock_sigma_ns: 0,
        })
    }

    /// The same for stamps that are on no machine's clock: those of a recording, or of a play.
    #[must_use]
    pub fn on_own_clock(self) -> Self {
        Self { clock_sigma_ns: OWN_CLOCK, ..self }
    }

    /// Waits until `n_workers` read the frames and, with `with_bridge`, somebody reads the infos;
    /// `look` is called every few milliseconds.
    ///
    /// # Errors
    /// [`Error::NobodyListens`] after 20 s, what `look` returns.
    pub fn wait_for_readers(
        &self,
        n_workers: usize,
        with_bridge: bool,
        mut look: impl FnMut() -> Result<(), Error>,
    ) -> Result<(), Error> {
        let begun = Instant::now();
        loop {
            let n_workers_here = self.frames.n_readers();
            let is_bridge_here = !with_bridge || self.infos.n_readers() > 0;
            if n_workers_here >= n_workers && is_bridge_here {
                return Ok(());
            }
            look()?;
            if begun.elapsed() > READERS_WITHIN {
                return Err(Error::NobodyListens {
                    waited_s: READERS_WITHIN.as_secs(),
                    n_workers,
                    n_workers_here,
                    and_bridge: if is_bridge_here { "" } else { " and the bridge (missing)" },
                });
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Numbers that no frame will have: frames the camera dropped.
    pub fn skip(&mut self, n_frames: u64) {
        self.next_idx += n_frames;
    }

    /// Publishes the next frame: `fill` writes its luma straight into shared memory.
    ///
    /// # Errors
    /// What `fill` returns, or when shared memory is gone.
    pub fn publish(
        &mut self,
        exposed_ns: StampNs,
        is_last: bool,
        fill: impl FnOnce(&mut [u8]) -> Result<(), Error>,
    ) -> Result<Published, Error> {
        let mut loan = self.frame_writer.loan(self.width_px as usize * self.height_px as usize)?;
        fill(loan.payload_mut())?;
        let info = FrameInfo {
            recording_id: self.recording_id,
            frame_idx: self.next_idx,
            exposed_ns,
            published_ns: now_ns(),
            width_px: self.width_px,
            height_px: self.height_px,
            is_last: u32::from(is_last),
            camera_idx: self.camera.idx() as u32,
            clock_sigma_ns: self.clock_sigma_ns,
            reserved: 0,
        };
        // The info goes first: a frame that reaches nobody must still be known to have existed.
        self.info_writer.send(info)?;
        let n_reached = self.frame_writer.send(loan, info)?;
        self.next_idx += 1;
        Ok(Published { frame_idx: info.frame_idx, n_reached })
    }
}

//! Who watches one place of a court: every frame that was told of, and when all its strips were
//! there. It shares no code with those whose accounts it is to check.

use anyhow::Context as _;
use shm_layout::services::{Domain, Error};
use shm_layout::stamp::now_ns;
use shm_layout::{FrameInfo, StampNs, StripCandidates};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// How often it looks.
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// What is known of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Frame {
    /// [`shm_layout::Camera::idx`] of whose it is.
    pub camera_idx: u32,
    /// When capture handed it over.
    pub published_ns: StampNs,
    /// Strips that are there, one bit each.
    strips: u32,
    /// When the last of them came.
    pub complete_ns: Option<StampNs>,
}

/// All that was seen.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// By recording and number.
    pub frames: BTreeMap<(u64, u64), Frame>,
    /// Strips that came twice.
    pub n_twice: u64,
    /// The frame of each camera that was complete last.
    pub last: [Frame; 2],
    /// Frames that became complete.
    pub n_complete: u64,
}

impl Seen {
    /// Frames that capture numbered, whether or not anything else is known of them.
    #[must_use]
    pub fn n_captured(&self) -> u64 {
        let mut ends = BTreeMap::new();
        for (recording_id, frame_idx) in self.frames.keys() {
            ends.insert(*recording_id, *frame_idx + 1);
        }
        ends.values().sum()
    }

    fn update_info(&mut self, info: &FrameInfo) {
        let frame = self.frames.entry((info.recording_id, info.frame_idx)).or_default();
        (frame.camera_idx, frame.published_ns) = (info.camera_idx, info.published_ns);
    }

    fn update(&mut self, strip: &StripCandidates) {
        let frame = self.frames.entry((strip.recording_id, strip.frame_idx)).or_default();
        (frame.camera_idx, frame.published_ns) = (strip.camera_idx, strip.frame_published_ns);
        let bit = 1 << strip.strip_idx;
        self.n_twice += u64::from(frame.strips & bit != 0);
        frame.strips |= bit;
        if frame.complete_ns.is_none() && frame.strips.count_ones() == strip.n_strips {
            frame.complete_ns = Some(now_ns());
            if let Some(last) = self.last.get_mut(frame.camera_idx as usize) {
                *last = *frame;
            }
            self.n_complete += 1;
        }
    }
}

/// Watches until it is asked what it saw.
#[derive(Debug)]
pub struct Witness {
    seen: Arc<Mutex<Seen>>,
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<Result<(), Error>>,
}

impl Witness {
    /// Begins to watch; returns once it reads.
    ///
    /// # Errors
    /// When shared memory cannot be had.
    pub fn of(domain: &Domain) -> anyhow::Result<Self> {
        let (seen, is_over): (Arc<Mutex<Seen>>, Arc<AtomicBool>) = Default::default();
        let (reads, is_reading) = std::sync::mpsc::channel();
        let thread = std::thread::spawn({
            let (domain, seen, is_over) = (domain.clone(), Arc::clone(&seen), Arc::clone(&is_over));
            move || {
                let member = domain.join("witness")?;
                let (infos, strips) =
                    (member.frames_info()?.reader()?, member.candidates()?.reader()?);
                let _ = reads.send(()); // who started this one may be gone
                while !is_over.load(Ordering::Relaxed) {
                    {
                        let mut seen = locked(&seen);
                        while let Some(info) = infos.receive()? {
                            seen.update_info(&info);
                        }
                        while let Some(strip) = strips.receive()? {
                            seen.update(&strip);
                        }
                    }
                    std::thread::sleep(LOOK_EVERY);
                }
                Ok(())
            }
        });
        if is_reading.recv().is_ok() {
            return Ok(Self { seen, is_over, thread });
        }
        let ended = thread.join().map_err(|_| anyhow::anyhow!("a witness panicked"))?;
        ended.context("a witness cannot read")?;
        anyhow::bail!("a witness ended early")
    }

    /// What it saw by now.
    pub fn seen(&self) -> MutexGuard<'_, Seen> {
        locked(&self.seen)
    }

    /// Leaves, and tells what it saw.
    ///
    /// # Errors
    /// When it could not read to the end.
    pub fn end(self) -> anyhow::Result<Seen> {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().map_err(|_| anyhow::anyhow!("a witness panicked"))??;
        Ok(std::mem::take(&mut locked(&self.seen)))
    }
}

fn locked(seen: &Mutex<Seen>) -> MutexGuard<'_, Seen> {
    seen.lock().unwrap_or_else(PoisonError::into_inner)
}

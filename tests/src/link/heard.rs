//! Fusion's shared memory → everything that arrived there, with the time it did.

use super::Error;
use shm_layout::ports::{Alarm, MessageReader};
use shm_layout::services::{Domain, Member, Place};
use shm_layout::stamp::now_ns;
use shm_layout::{Camera, FrameInfo, Link, StampNs, StripCandidates};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A strip that arrived. Stamps are as they stood in shared memory, but for `arrived_ns`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HeardStrip {
    /// Whose.
    pub camera: Camera,
    /// Of which run of its capture.
    pub recording_id: u64,
    /// Which frame.
    pub frame_idx: u64,
    /// Which strip of it.
    pub strip_idx: u32,
    /// Mid-exposure.
    pub exposed_ns: StampNs,
    /// 1 sigma of it.
    pub clock_sigma_ns: u32,
    /// Now, on this machine's clock.
    pub arrived_ns: StampNs,
}

/// All that arrived.
#[derive(Debug, Clone, Default)]
pub struct Heard {
    /// In the order of arrival.
    pub strips: Vec<HeardStrip>,
    /// In the order of arrival.
    pub infos: Vec<FrameInfo>,
    /// In the order of arrival.
    pub links: Vec<Link>,
}

/// A thread that reads in fusion's place.
#[derive(Debug)]
pub struct Listener {
    thread: JoinHandle<Result<Heard, Error>>,
    n_strips: Arc<AtomicUsize>,
    is_over: Arc<AtomicBool>,
}

struct Ends {
    strips: MessageReader<StripCandidates>,
    infos: MessageReader<FrameInfo>,
    links: MessageReader<Link>,
    alarm: Alarm,
    /// Dropped last: what it opened goes with it.
    _member: Member,
}

impl Ends {
    fn open(domain: &Domain) -> Result<Self, Error> {
        let member = domain.join("listener")?;
        let candidates = member.candidates()?;
        Ok(Self {
            strips: candidates.reader()?,
            infos: member.frames_info()?.reader()?,
            links: member.links()?.reader()?,
            alarm: candidates.alarm()?,
            _member: member,
        })
    }
}

impl Listener {
    /// Reads from now on. The bridge beside fusion waits until it does.
    ///
    /// # Errors
    /// When the court's name is not fit.
    pub fn start(court: &str) -> Result<Self, Error> {
        let domain = Domain::new(court, Place::Fusion)?;
        let n_strips = Arc::new(AtomicUsize::new(0));
        let is_over = Arc::new(AtomicBool::new(false));
        let (count, over) = (Arc::clone(&n_strips), Arc::clone(&is_over));
        let thread = std::thread::spawn(move || listen(&Ends::open(&domain)?, &count, &over));
        Ok(Self { thread, n_strips, is_over })
    }

    /// All that arrived, once so many strips have or nothing new came for `patience`.
    ///
    /// # Errors
    /// When shared memory was gone.
    pub fn join(self, n_expected: usize, patience: Duration) -> Result<Heard, Error> {
        let (mut n_seen, mut seen_at) = (0, Instant::now());
        while seen_at.elapsed() < patience && !self.thread.is_finished() {
            let n_strips = self.n_strips.load(Ordering::Relaxed);
            if n_strips >= n_expected {
                break;
            }
            if n_strips != n_seen {
                (n_seen, seen_at) = (n_strips, Instant::now());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().map_err(|_| Error::ThreadGone)?
    }
}

fn listen(ends: &Ends, n_strips: &AtomicUsize, is_over: &AtomicBool) -> Result<Heard, Error> {
    let mut heard = Heard::default();
    loop {
        // Asked before reading, so that what came before is read once more.
        let is_last = is_over.load(Ordering::Relaxed);
        while let Some(strip) = ends.strips.receive()? {
            let arrived_ns = now_ns();
            heard.strips.extend(heard_strip(&strip, arrived_ns));
        }
        while let Some(info) = ends.infos.receive()? {
            heard.infos.push(*info);
        }
        while let Some(link) = ends.links.receive()? {
            heard.links.push(*link);
        }
        n_strips.store(heard.strips.len(), Ordering::Relaxed);
        if is_last {
            return Ok(heard);
        }
        ends.alarm.wait()?;
    }
}

fn heard_strip(strip: &StripCandidates, arrived_ns: StampNs) -> Option<HeardStrip> {
    Some(HeardStrip {
        camera: Camera::from_idx(strip.camera_idx)?,
        recording_id: strip.recording_id,
        frame_idx: strip.frame_idx,
        strip_idx: strip.strip_idx,
        exposed_ns: strip.exposed_ns,
        clock_sigma_ns: strip.clock_sigma_ns,
        arrived_ns,
    })
}

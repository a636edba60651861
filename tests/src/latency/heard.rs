//! What a reader of every service hears, and when. It only reads.

use anyhow::Context as _;
use shm_layout::ports::{Message, MessageService};
use shm_layout::services::{Domain, Error, Member, Place};
use shm_layout::stamp::now_ns;
use shm_layout::{Camera, FrameInfo, StampNs, StripCandidates};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;

/// Most messages of a kind that are kept: an hour of two boards with two workers each.
const MAX_KEPT: usize = 1_400_000;

/// Which strip of which frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct StripKey {
    /// [`Camera::idx`].
    pub camera_idx: u32,
    /// The recording.
    pub recording_id: u64,
    /// The frame.
    pub frame_idx: u64,
    /// The strip.
    pub strip_idx: u32,
}

/// A strip's candidates, as they came.
#[derive(Debug, Clone, Copy)]
pub struct Strip {
    /// Which.
    pub key: StripKey,
    /// Of how many.
    pub n_strips: u32,
    /// Middle of the first row's exposure.
    pub exposed_ns: StampNs,
    /// When capture published the frame.
    pub published_ns: StampNs,
    /// When the worker began.
    pub started_ns: StampNs,
    /// When it was done.
    pub finished_ns: StampNs,
    /// When this reader had it.
    pub arrived_ns: StampNs,
}

/// A shot, as it came.
#[derive(Debug, Clone, Copy)]
pub struct Bounced {
    /// When the ball touched the ground; None if no bounce was measured.
    pub bounce_ns: Option<StampNs>,
    /// When this reader had the shot.
    pub arrived_ns: StampNs,
}

/// How far fusion had come.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Strips it had measured with since it started.
    pub n_strips: u64,
    /// When this reader knew.
    pub arrived_ns: StampNs,
}

/// All that was heard.
#[derive(Debug, Default)]
pub struct Heard {
    /// What counts: frames exposed from then to then.
    pub window_ns: [StampNs; 2],
    /// Frames of both boards: camera, number, when the middle of the first row was exposed.
    pub infos: Vec<FrameInfo>,
    /// In the boards' shared memory.
    pub on_boards: Vec<Strip>,
    /// In fusion's, in the order in which fusion reads them.
    pub at_fusion: Vec<Strip>,
    /// In their order.
    pub progress: Vec<Progress>,
    /// In their order.
    pub shots: Vec<Bounced>,
    /// Shots as a browser has them, in their order.
    pub pushed: Vec<Bounced>,
    /// Messages beyond what is kept.
    pub n_left_out: u64,
}

/// Listens until it is asked.
#[derive(Debug)]
pub struct Listener {
    is_over: Arc<AtomicBool>,
    window_ns: [AtomicI64; 2],
    threads: Vec<JoinHandle<Result<Heard, Error>>>,
}

impl Listener {
    /// Begins; returns once it reads everywhere.
    ///
    /// # Errors
    /// When shared memory cannot be had.
    pub fn new(court: &str) -> anyhow::Result<Self> {
        let is_over = Arc::new(AtomicBool::new(false));
        let (ready, is_ready) = channel();
        let mut threads = Vec::new();
        for camera in Camera::BOTH {
            let domain = Domain::new(court, Place::Board(camera))?;
            threads.push(spawned(domain, &is_over, &ready, board));
        }
        for listen in [at_fusion, progress, shots] {
            threads.push(spawned(Domain::new(court, Place::Fusion)?, &is_over, &ready, listen));
        }
        drop(ready);
        for _ in 0..threads.len() {
            is_ready.recv().context("a listener cannot read")?;
        }
        Ok(Self {
            is_over,
            window_ns: [AtomicI64::new(i64::MAX), AtomicI64::new(i64::MAX)],
            threads,
        })
    }

    /// From now on it counts.
    pub fn begin(&self) {
        self.window_ns[0].store(now_ns(), Ordering::Relaxed);
    }

    /// What is exposed from now on does not count any more.
    pub fn end_window(&self) {
        self.window_ns[1].store(now_ns(), Ordering::Relaxed);
    }

    /// Leaves, and tells what it heard.
    ///
    /// # Errors
    /// When it could not read to the end.
    pub fn end(self) -> anyhow::Result<Heard> {
        self.is_over.store(true, Ordering::Relaxed);
        let window_ns = [0, 1].map(|i| self.window_ns[i].load(Ordering::Relaxed));
        let mut all = Heard { window_ns, ..Heard::default() };
        for thread in self.threads {
            let heard = thread.join().map_err(|_| anyhow::anyhow!("a listener panicked"))??;
            all.infos.extend(heard.infos);
            all.on_boards.extend(heard.on_boards);
            all.at_fusion.extend(heard.at_fusion);
            all.progress.extend(heard.progress);
            all.shots.extend(heard.shots);
            all.n_left_out += heard.n_left_out;
        }
        Ok(all)
    }
}

type Listen = fn(&Member, &AtomicBool, &Sender<()>) -> Result<Heard, Error>;

fn spawned(
    domain: Domain,
    is_over: &Arc<AtomicBool>,
    ready: &Sender<()>,
    listen: Listen,
) -> JoinHandle<Result<Heard, Error>> {
    let (is_over, ready) = (Arc::clone(is_over), ready.clone());
    std::thread::spawn(move || {
        let member = domain.join("latency")?;
        listen(&member, &is_over, &ready)
    })
}

fn keep<T>(kept: &mut Vec<T>, n_left_out: &mut u64, one: T) {
    if kept.len() < MAX_KEPT { kept.push(one) } else { *n_left_out += 1 }
}

fn strip_from(strip: &StripCandidates, arrived_ns: StampNs) -> Strip {
    let StripCandidates { camera_idx, recording_id, frame_idx, strip_idx, .. } = *strip;
    Strip {
        key: StripKey { camera_idx, recording_id, frame_idx, strip_idx },
        n_strips: strip.n_strips,
        exposed_ns: strip.exposed_ns,
        published_ns: strip.frame_published_ns,
        started_ns: strip.started_ns,
        finished_ns: strip.finished_ns,
        arrived_ns,
    }
}

/// Reads one service whenever something was sent on it, until it is over; `keep` takes what comes.
fn read_along<T: Message>(
    service: &MessageService<T>,
    is_over: &AtomicBool,
    ready: &Sender<()>,
    mut keep: impl FnMut(&T) -> Result<(), Error>,
) -> Result<(), Error> {
    let (reader, alarm) = (service.reader()?, service.alarm()?);
    let _ = ready.send(()); // who started this one may be gone
    while !is_over.load(Ordering::Relaxed) {
        while let Some(message) = reader.receive()? {
            keep(&message)?;
        }
        alarm.wait()?;
    }
    Ok(())
}

fn board(member: &Member, is_over: &AtomicBool, ready: &Sender<()>) -> Result<Heard, Error> {
    let infos = member.frames_info()?.reader()?;
    let mut heard = Heard::default();
    read_along(&member.candidates()?, is_over, ready, |strip| {
        let strip = strip_from(strip, now_ns());
        keep(&mut heard.on_boards, &mut heard.n_left_out, strip);
        // An info carries its own stamp: it need not be read at once.
        while let Some(info) = infos.receive()? {
            keep(&mut heard.infos, &mut heard.n_left_out, *info);
        }
        Ok(())
    })?;
    while let Some(info) = infos.receive()? {
        keep(&mut heard.infos, &mut heard.n_left_out, *info);
    }
    Ok(heard)
}

fn at_fusion(member: &Member, is_over: &AtomicBool, ready: &Sender<()>) -> Result<Heard, Error> {
    let mut heard = Heard::default();
    read_along(&member.candidates()?, is_over, ready, |strip| {
        let strip = strip_from(strip, now_ns());
        keep(&mut heard.at_fusion, &mut heard.n_left_out, strip);
        Ok(())
    })?;
    Ok(heard)
}

fn progress(member: &Member, is_over: &AtomicBool, ready: &Sender<()>) -> Result<Heard, Error> {
    let mut heard = Heard::default();
    read_along(&member.taken()?, is_over, ready, |taken| {
        // Fusion says it whenever it has nothing to read, most often the same as before.
        let n_strips = taken.n_strips;
        if heard.progress.last().is_none_or(|last| last.n_strips < n_strips) {
            let now = Progress { n_strips, arrived_ns: now_ns() };
            keep(&mut heard.progress, &mut heard.n_left_out, now);
        }
        Ok(())
    })?;
    Ok(heard)
}

fn shots(member: &Member, is_over: &AtomicBool, ready: &Sender<()>) -> Result<Heard, Error> {
    let mut heard = Heard::default();
    read_along(&member.shots()?, is_over, ready, |shot| {
        let bounce_ns = (shot.is_measured == 1).then_some(shot.bounce_ns);
        let shot = Bounced { bounce_ns, arrived_ns: now_ns() };
        keep(&mut heard.shots, &mut heard.n_left_out, shot);
        Ok(())
    })?;
    Ok(heard)
}

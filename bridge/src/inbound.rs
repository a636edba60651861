//! Network → batches → the shared memory that fusion reads.
//!
//! Zenoh's threads decode; one thread owns the shared memory. The bounded queue between them drops
//! what is newest when fusion's computer is overwhelmed, and counts it.

use crate::gaps::Gaps;
use crate::session::{self, Options};
use crate::wire::{self, Batch, Message};
use crate::{Error, network};
use crossbeam::channel::{RecvTimeoutError, Sender, bounded};
use shm_layout::Camera;
use shm_layout::ports::MessageWriter;
use shm_layout::services::{Domain, Place};
use shm_layout::stop::{LOOK_EVERY, Stop};
use shm_layout::{FrameInfo, StripCandidates};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use zenoh::Wait;
use zenoh::sample::Sample;

/// Decoded batches waiting for shared memory: 5 s of two boards.
const MAX_WAITING: usize = 1024;

/// What came in, per camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Received {
    /// Numbers seen and missed.
    pub gaps: [Gaps; 2],
    /// Payloads that are no batch of ours.
    pub n_refused: u64,
    /// Batches the queue had no room for.
    pub n_overflowed: u64,
}

struct Arrived {
    camera: Camera,
    batch: Batch,
}

#[derive(Debug, Default)]
struct Counts {
    n_refused: AtomicU64,
    n_overflowed: AtomicU64,
}

/// Moves messages from the network to fusion until stopped.
///
/// # Errors
/// When shared memory or the network cannot be had.
pub fn run(options: &Options, stop: &Stop) -> Result<Received, Error> {
    let court = &options.court;
    let member = Domain::new(court, Place::Fusion)?.join("bridge")?;
    let (candidates, frames_info) = (member.candidates()?, member.frames_info()?);
    let (strips, infos) = (candidates.writer()?, frames_info.writer()?);
    // Boards start when somebody listens here, so nobody does before fusion reads.
    while candidates.n_readers() == 0 || frames_info.n_readers() == 0 {
        if stop.is_raised() {
            return Ok(Received::default());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let session = session::open(options)?;
    let (to_memory, from_network) = bounded(MAX_WAITING);
    let counts = Arc::new(Counts::default());
    let mut subscribers = Vec::new();
    for camera in Camera::BOTH {
        let (to_memory, counts) = (to_memory.clone(), Arc::clone(&counts));
        let subscriber = session
            .declare_subscriber(session::candidates_key(court, camera)?)
            .callback(move |sample| take(camera, &sample, &to_memory, &counts))
            .wait()
            .map_err(network(format!("subscribe to the {camera} board")))?;
        subscribers.push(subscriber);
    }
    let mut received = Received::default();
    while !stop.is_raised() {
        match from_network.recv_timeout(LOOK_EVERY) {
            Ok(arrived) => {
                note(&mut received.gaps[arrived.camera.idx()], &arrived);
                write(&arrived.batch, &infos, &strips)?;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(Error::NetworkThreadGone),
        }
    }
    received.n_refused = counts.n_refused.load(Ordering::Relaxed);
    received.n_overflowed = counts.n_overflowed.load(Ordering::Relaxed);
    Ok(received)
}

/// Runs on Zenoh's threads: decodes and enqueues, never waits.
fn take(camera: Camera, sample: &Sample, to_memory: &Sender<Arrived>, counts: &Counts) {
    match wire::batch_from_bytes(&sample.payload().to_bytes()) {
        Ok(batch) if batch.messages.iter().all(|message| is_of(camera, message)) => {
            if to_memory.try_send(Arrived { camera, batch }).is_err() {
                counts.n_overflowed.fetch_add(1, Ordering::Relaxed);
            }
        }
        Ok(_) => refuse(camera, "it speaks for the other camera", counts),
        Err(refusal) => refuse(camera, &refusal.to_string(), counts),
    }
}

fn refuse(camera: Camera, why: &str, counts: &Counts) {
    // Once is enough: a wrong board sends ninety of these a second.
    if counts.n_refused.fetch_add(1, Ordering::Relaxed) == 0 {
        tracing::error!("a batch of the {camera} board is refused: {why}");
    }
}

fn is_of(camera: Camera, message: &Message) -> bool {
    let camera_idx = match message {
        Message::FrameInfo(info) => info.camera_idx,
        Message::Candidates(strip) => strip.camera_idx,
    };
    Camera::from_idx(camera_idx) == Some(camera)
}

fn note(gaps: &mut Gaps, arrived: &Arrived) {
    let n_missing = gaps.update(arrived.batch.session_id, arrived.batch.batch_idx);
    if n_missing > 0 {
        tracing::warn!("{n_missing} batches of the {} board are lost", arrived.camera);
    }
}

fn write(
    batch: &Batch,
    infos: &MessageWriter<FrameInfo>,
    strips: &MessageWriter<StripCandidates>,
) -> Result<(), Error> {
    for message in &batch.messages {
        match message {
            Message::FrameInfo(info) => infos.send(*info)?,
            Message::Candidates(strip) => strips.send(**strip)?,
        };
    }
    Ok(())
}

//! A board's shared memory → batches → network.
//!
//! Two threads: one empties shared memory (whose queues overwrite their oldest), the other
//! publishes and may be held up by the network. Between them stands a bounded queue that drops its
//! oldest batch; as batches are numbered before they enter it, the far end sees the hole.

use crate::session::{self, Options};
use crate::wire::{self, Batch, MAX_MESSAGES, Message};
use crate::{Error, network};
use crossbeam::channel::{Receiver, Sender, TrySendError, bounded};
use shm_layout::Camera;
use shm_layout::ports::MessageReader;
use shm_layout::services::{Domain, Place};
use shm_layout::stop::Stop;
use shm_layout::{FrameInfo, StripCandidates};
use std::time::Duration;
use zenoh::Wait;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};

/// Batches waiting for the network: 10 s at one per frame.
const MAX_WAITING: usize = 900;

/// What went out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sent {
    /// Batches handed to the network.
    pub n_batches: u64,
    /// Messages in them.
    pub n_messages: u64,
    /// Batches the queue had no room for.
    pub n_overflowed: u64,
}

/// Moves messages of a board to the network until stopped.
///
/// # Errors
/// When shared memory or the network cannot be had.
pub fn run(options: &Options, camera: Camera, stop: &Stop) -> Result<Sent, Error> {
    let court = options.court.as_str();
    let domain = Domain::new(court, Place::Board(camera))?;
    let mut options = options.clone();
    if !session::discover(&mut options, stop)? {
        return Ok(Sent::default());
    }
    let session = session::open(&options)?;
    let publisher = session
        .declare_publisher(session::candidates_key(court, camera)?)
        .congestion_control(CongestionControl::Block)
        .priority(Priority::RealTime)
        .express(true)
        .wait()
        .map_err(network("publish candidates"))?;
    if !wait_for_fusion(&publisher, stop)? {
        return Ok(Sent::default());
    }
    // Only now does the board's capture see a reader: a recording does not start unheard.
    let member = domain.join("bridge")?;
    let candidates = member.candidates()?;
    let (strips, alarm) = (candidates.reader()?, candidates.alarm()?);
    let infos = member.frames_info()?.reader()?;

    let (to_network, from_memory) = bounded(MAX_WAITING);
    let overflow = from_memory.clone();
    let sender = std::thread::spawn(move || publish_all(&from_memory, &publisher));
    let session_id = new_session_id();
    let mut sent = Sent::default();
    while !stop.is_raised() {
        while let Some(messages) = next_messages(&infos, &strips)? {
            sent.n_messages += messages.len() as u64;
            let batch = Batch { session_id, batch_idx: sent.n_batches, messages };
            sent.n_batches += 1;
            sent.n_overflowed += send_newest(&to_network, &overflow, batch)?;
        }
        alarm.wait()?;
    }
    drop((to_network, overflow));
    sender.join().map_err(|_| Error::NetworkThreadGone)??;
    Ok(sent)
}

/// Waits until somebody listens at the far end; false when stopped before.
fn wait_for_fusion(publisher: &Publisher<'_>, stop: &Stop) -> Result<bool, Error> {
    while !stop.is_raised() {
        let status = publisher.matching_status().wait().map_err(network("ask who listens"))?;
        if status.matching() {
            return Ok(true);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(false)
}

/// What stands in shared memory now, infos first; `None` when nothing does.
fn next_messages(
    infos: &MessageReader<FrameInfo>,
    strips: &MessageReader<StripCandidates>,
) -> Result<Option<Vec<Message>>, Error> {
    let mut messages = Vec::new();
    while messages.len() < MAX_MESSAGES
        && let Some(info) = infos.receive()?
    {
        messages.push(Message::FrameInfo(*info));
    }
    while messages.len() < MAX_MESSAGES
        && let Some(strip) = strips.receive()?
    {
        messages.push(Message::Candidates(Box::new(*strip)));
    }
    Ok((!messages.is_empty()).then_some(messages))
}

/// Enqueues a batch, dropping the oldest if there is no room; says how many were dropped.
fn send_newest(
    queue: &Sender<Batch>,
    oldest: &Receiver<Batch>,
    mut batch: Batch,
) -> Result<u64, Error> {
    let mut n_dropped = 0;
    loop {
        batch = match queue.try_send(batch) {
            Ok(()) => return Ok(n_dropped),
            Err(TrySendError::Disconnected(_)) => return Err(Error::NetworkThreadGone),
            Err(TrySendError::Full(batch)) => batch,
        };
        n_dropped += u64::from(oldest.try_recv().is_ok());
    }
}

fn publish_all(batches: &Receiver<Batch>, publisher: &Publisher<'_>) -> Result<(), Error> {
    for batch in batches {
        let bytes = wire::bytes_from_batch(&batch);
        publisher.put(bytes).wait().map_err(network("send a batch"))?;
    }
    Ok(())
}

fn new_session_id() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Realtime);
    u64::from(std::process::id()) << 40 ^ now.tv_nsec.unsigned_abs() ^ now.tv_sec.unsigned_abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_queue_drops_its_oldest() {
        let (sender, receiver) = bounded(2);
        let dropped: u64 = (0..5)
            .map(|batch_idx| {
                let batch = Batch { session_id: 1, batch_idx, messages: Vec::new() };
                send_newest(&sender, &receiver, batch).unwrap()
            })
            .sum();
        let left: Vec<u64> = receiver.try_iter().map(|batch| batch.batch_idx).collect();
        assert_eq!((dropped, left), (3, vec![3, 4]));
    }
}

//! A board's shared memory → numbered batches → network.
//!
//! One thread empties shared memory (whose queues overwrite their oldest), numbers what it finds,
//! keeps it in the [`Ring`] and publishes it. Publishing never waits: what the network has no room
//! for it drops, and the far end asks for it again. Pings are answered where they arrive; questions
//! for what is missing have a thread of their own, for their answers may wait for the network.

use crate::askers::Askers;
use crate::clock;
use crate::command::seen::Seen;
use crate::keys;
use crate::presence::{self, Presence};
use crate::ring::Ring;
use crate::run;
use crate::session::real_time_publisher;
use crate::wire::Stream;
use crate::wire::batch::{Batch, MAX_MESSAGES, Message, bytes_from_batch};
use crate::wire::clock::{Ping, Pong};
use crate::wire::missing::Missing;
use crate::{Error, network};
use crossbeam::channel::{Receiver, bounded};
use shm_layout::ports::{self, Alarm, MessageReader, MessageWriter};
use shm_layout::services::{Domain, Member, Place};
use shm_layout::stamp::{OWN_CLOCK, now_ns};
use shm_layout::stop::Stop;
use shm_layout::{Camera, FrameInfo, Link, StampNs, StripCandidates};
use std::sync::atomic::{AtomicI64, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use zenoh::bytes::ZBytes;
use zenoh::query::Query;
use zenoh::{Session, Wait};

/// Most questions for missing batches that wait; fusion has two open at a time.
const MAX_QUESTIONS: usize = 16;

/// A board that finds nobody says so after this long, once.
const NOBODY_AFTER: Duration = Duration::from_secs(5);

/// A session over which fusion is there, but has not pinged for so long, is of no use: both ends
/// may have different ideas of what was declared (seen after cuts of a minute).
const UNHEARD_NS: i64 = 2_500_000_000;

/// Fusion was there and is gone for so long: a new session finds it as soon as this one, and does
/// not remember.
const GONE_NS: i64 = 10_000_000_000;

/// Fusion pings 20 times a second: it is heard while one came within this.
const HEARD_NS: i64 = 1_000_000_000;

/// How often this board is told of its link.
const TELL_EVERY_NS: i64 = 500_000_000;

/// How a session came to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// The process was asked to end.
    Stopped,
    /// It is of no use any more: another one is to be opened.
    Unheard,
}

/// The ring of one run of this bridge.
#[derive(Debug, Clone)]
struct Archive {
    session_id: u64,
    ring: Arc<Mutex<Ring>>,
    askers: Arc<Mutex<Askers>>,
    /// When fusion pinged last.
    pinged_ns: Arc<AtomicI64>,
    /// What it knows of this board's clock.
    clock_sigma_ns: Arc<AtomicU32>,
}

impl Archive {
    fn ring(&self) -> MutexGuard<'_, Ring> {
        self.ring.lock().expect("nothing in the ring panics")
    }
}

/// A board's shared memory, as the bridge reads it.
struct Memory {
    infos: MessageReader<FrameInfo>,
    strips: MessageReader<StripCandidates>,
    links: MessageWriter<Link>,
    alarm: Alarm,
    /// Dropped last: what it opened goes with it.
    _member: Member,
}

impl Memory {
    fn open(domain: &Domain) -> Result<Self, Error> {
        let member = domain.join("bridge")?;
        let candidates = member.candidates()?;
        let (strips, alarm) = (candidates.reader()?, candidates.alarm()?);
        let links = member.links()?.writer()?;
        // Last: a capture that waits for the bridge begins once somebody reads this.
        let infos = member.frames_info()?.reader()?;
        Ok(Self { infos, strips, links, alarm, _member: member })
    }
}

/// One board's messages; they outlive a session.
pub struct Outbound {
    court: String,
    camera: Camera,
    archive: Archive,
    /// Opened once fusion was met.
    memory: Option<Memory>,
    seen: Arc<Seen>,
}

impl Outbound {
    /// Nothing sent yet; `seen` counts what will be.
    #[must_use]
    pub fn new(court: &str, camera: Camera, seen: Arc<Seen>) -> Self {
        let (ring, pinged_ns) = (Arc::default(), Arc::default());
        let clock_sigma_ns = Arc::new(AtomicU32::new(OWN_CLOCK));
        let (session_id, askers) = (run::id_now(), Arc::default());
        let archive = Archive { session_id, ring, askers, pinged_ns, clock_sigma_ns };
        Self { court: court.to_owned(), camera, archive, memory: None, seen }
    }

    /// Moves messages to the network until stopped or the session is of no use.
    ///
    /// # Errors
    /// When shared memory or the network cannot be had.
    pub fn run(&mut self, session: &Session, stop: &Stop) -> Result<Ended, Error> {
        let (court, camera, archive) = (self.court.as_str(), self.camera, &self.archive);
        let publishers = [
            real_time_publisher(session, keys::of_board(court, camera, Stream::ALL[0].name())?)?,
            real_time_publisher(session, keys::of_board(court, camera, Stream::ALL[1].name())?)?,
        ];
        let _pongs = answer_pings(session, court, camera, archive.clone())?;
        let _missing = answer_missing(session, court, camera, archive.clone())?;
        let fusion = Presence::watch(session, court, Place::Fusion)?;
        let _token = presence::announce(session, court, Place::Board(camera))?;
        if self.memory.is_none() {
            let domain = Domain::new(court, Place::Board(camera))?;
            if !wait_for(&fusion, stop) {
                return Ok(Ended::Stopped);
            }
            // Only now does the board's capture see a reader: a recording does not start unheard.
            self.memory = Some(Memory::open(&domain)?);
        }
        let Some(memory) = &self.memory else { return Ok(Ended::Stopped) };
        self.archive.pinged_ns.store(now_ns(), Ordering::Relaxed);
        let mut told_ns = 0;
        while !stop.is_raised() {
            loop {
                let infos = all(&memory.infos, |info| Message::FrameInfo(*info))?;
                let strips = all(&memory.strips, |strip| Message::Candidates(Box::new(*strip)))?;
                if infos.is_empty() && strips.is_empty() {
                    break;
                }
                for (stream, messages) in Stream::ALL.into_iter().zip([infos, strips]) {
                    if messages.is_empty() {
                        continue;
                    }
                    self.seen.note(&messages);
                    let bytes = self.archive.add(stream, messages, &self.seen);
                    let put = publishers[stream.idx()].put(bytes);
                    put.wait().map_err(network("send a batch"))?;
                }
            }
            memory.alarm.wait()?;
            let now_ns = now_ns();
            let silent_ns = now_ns - self.archive.pinged_ns.load(Ordering::Relaxed);
            if now_ns - told_ns >= TELL_EVERY_NS {
                told_ns = now_ns;
                memory.links.send(self.link(silent_ns, now_ns))?;
            }
            if silent_ns > if fusion.is_there() { UNHEARD_NS } else { GONE_NS } {
                return Ok(Ended::Unheard);
            }
        }
        Ok(Ended::Stopped)
    }

    /// What this board knows of its link.
    fn link(&self, silent_ns: i64, noted_ns: StampNs) -> Link {
        Link {
            noted_ns,
            n_batches: self.seen.counts().n_batches,
            clock_sigma_ns: self.archive.clock_sigma_ns.load(Ordering::Relaxed),
            camera_idx: self.camera.idx() as u32,
            is_alive: u32::from(silent_ns < HEARD_NS),
            ..Link::default()
        }
    }
}

impl Archive {
    /// Numbers a batch and keeps it, which is noted; its bytes.
    fn add(&self, stream: Stream, messages: Vec<Message>, seen: &Seen) -> ZBytes {
        let mut ring = self.ring();
        let batch_idx = ring.end_idx(stream);
        let batch = Batch { session_id: self.session_id, batch_idx, messages };
        let bytes = ZBytes::from(bytes_from_batch(&batch));
        ring.push(stream, now_ns(), bytes.clone());
        seen.note_ring(&ring);
        bytes
    }

    fn pong(&self, ping: Ping, received_ns: StampNs) -> Pong {
        let ring = self.ring();
        let mut askers = self.askers.lock().expect("nothing among the askers panics");
        Pong {
            sent_ns: ping.sent_ns,
            received_ns,
            day_minus_stamp_ns: clock::day_minus_stamp_ns(),
            session_id: self.session_id,
            oldest_idx: askers.oldest_for(ping.asker_id, &ring, received_ns),
            end_idx: Stream::ALL.map(|stream| ring.end_idx(stream)),
            answered_ns: now_ns(),
        }
    }

    /// Those of the batches asked for that are still here.
    fn had(&self, asked: &Missing) -> Vec<ZBytes> {
        match asked.stream() {
            Some(stream) if asked.session_id == self.session_id => {
                self.ring().range(stream, asked.first_idx, asked.end_idx).cloned().collect()
            }
            _ => Vec::new(),
        }
    }
}

fn answer_pings(
    session: &Session,
    court: &str,
    camera: Camera,
    archive: Archive,
) -> Result<impl Sized, Error> {
    let pong = real_time_publisher(session, keys::of_board(court, camera, "pong")?)?;
    session
        .declare_subscriber(keys::of_board(court, camera, "ping")?)
        .callback(move |sample| {
            let received_ns = now_ns();
            archive.pinged_ns.store(received_ns, Ordering::Relaxed);
            match Ping::from_bytes(&sample.payload().to_bytes()) {
                // A pong that cannot be sent is one that did not arrive: the next ping comes soon.
                Ok(ping) => {
                    archive.clock_sigma_ns.store(ping.clock_sigma_ns, Ordering::Relaxed);
                    drop(pong.put(archive.pong(ping, received_ns).to_bytes()).wait());
                }
                Err(refusal) => tracing::debug!("a ping is refused: {refusal}"),
            }
        })
        .wait()
        .map_err(network("answer pings"))
}

fn answer_missing(
    session: &Session,
    court: &str,
    camera: Camera,
    archive: Archive,
) -> Result<impl Sized, Error> {
    let (to_thread, questions) = bounded::<Query>(MAX_QUESTIONS);
    std::thread::spawn(move || answer_all(&questions, &archive));
    session
        .declare_queryable(keys::of_board(court, camera, "missing")?)
        .callback(move |query| {
            if to_thread.try_send(query).is_err() {
                tracing::debug!("too many questions for missing batches: one is left out");
            }
        })
        .wait()
        .map_err(network("answer what is missing"))
}

/// Ends when the queryable is gone.
fn answer_all(questions: &Receiver<Query>, archive: &Archive) {
    for query in questions {
        let payload = query.payload().map(ZBytes::to_bytes).unwrap_or_default();
        match Missing::from_bytes(&payload) {
            Ok(asked) => {
                let had = archive.had(&asked);
                tracing::debug!(?asked, n_had = had.len(), "answering");
                for bytes in had {
                    // Who asked asks again for what does not arrive.
                    if query.reply(query.key_expr().clone(), bytes).wait().is_err() {
                        break;
                    }
                }
            }
            Err(refusal) => drop(query.reply_err(refusal.to_string()).wait()),
        }
    }
}

/// Waits until fusion is there; false when stopped before.
fn wait_for(fusion: &Presence, stop: &Stop) -> bool {
    let begun = Instant::now();
    let mut is_said = false;
    while !stop.is_raised() {
        if fusion.is_there() {
            return true;
        }
        if !is_said && begun.elapsed() > NOBODY_AFTER {
            is_said = true;
            tracing::error!(
                "nobody answers for {} s: is the bridge beside fusion running, can it be reached, \
                 and do both have keys of this court?",
                NOBODY_AFTER.as_secs()
            );
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    false
}

/// All that waits, a batch at most.
fn all<T: ports::Message>(
    reader: &MessageReader<T>,
    message: impl Fn(&T) -> Message,
) -> Result<Vec<Message>, Error> {
    let mut messages = Vec::new();
    while messages.len() < MAX_MESSAGES
        && let Some(received) = reader.receive()?
    {
        messages.push(message(&received));
    }
    Ok(messages)
}

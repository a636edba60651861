//! Network → each board's messages in order and on our clock → the shared memory that fusion reads.
//!
//! Zenoh's threads decode; one thread owns everything else (`board.rs` is what it knows of each
//! board, `translated.rs` puts its stamps on our clock). Between them stands a bounded queue: what
//! it has no room for is counted, missed by its number, and asked for again. Shots go the other
//! way, as texts that nobody here reads.

mod board;
mod memory;
mod translated;

use crate::clock;
use crate::keys;
use crate::launcher::{Exchange, Passed};
use crate::presence::{self, Presence};
use crate::run;
use crate::session::real_time_publisher;
use crate::wire::Stream;
use crate::wire::batch::{Batch, Message, batch_from_bytes};
use crate::wire::clock::{Ping, Pong};
use crate::wire::missing::Missing;
use crate::{Error, network};
use board::Board;
use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, bounded};
use memory::Memory;
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::{OWN_CLOCK, now_ns};
use shm_layout::stop::Stop;
use shm_layout::{Camera, Link, StampNs};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::ConsolidationMode;
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

/// Decoded messages waiting for the thread that owns shared memory: 2 s of two boards.
const MAX_WAITING: usize = 4096;

/// Longest the thread waits for news; pings and shots leave this much late at worst.
const TICK: Duration = Duration::from_millis(5);

/// A ping 20 times a second finds a quick exchange soon even on a busy link, for 3 kB/s.
const PING_EVERY_NS: i64 = 50_000_000;

/// Until a board's clock is known its messages wait: eight exchanges are there after 0.08 s.
const FIRST_PINGS_EVERY_NS: i64 = 10_000_000;

/// How often links are told of.
const TELL_EVERY_NS: i64 = 500_000_000;

/// Longest a question for missing batches may take.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// What came in.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Received {
    /// Each board's link as it was at the end.
    pub links: [Link; 2],
    /// Messages the queue had no room for; those of them that were batches came later.
    pub n_overflowed: u64,
    /// Shots passed on.
    pub n_shots: u64,
    /// Corrections, and what concerns the launcher.
    pub launcher: Passed,
}

enum News {
    Batch(Camera, Stream, Batch),
    Pong(Camera, Pong, StampNs),
    Answered(Camera, Stream),
    Refused(Camera, String),
}

/// The way from Zenoh's threads to ours.
#[derive(Clone)]
struct Inbox {
    news: Sender<News>,
    n_overflowed: Arc<AtomicU64>,
}

impl Inbox {
    fn put(&self, news: News) {
        if self.news.try_send(news).is_err() {
            self.n_overflowed.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn put_batch(&self, camera: Camera, stream: Stream, bytes: &[u8]) {
        self.put(match batch_from_bytes(bytes) {
            Ok(batch) if batch.messages.iter().all(|m| fits(camera, stream, m)) => {
                News::Batch(camera, stream, batch)
            }
            Ok(_) => News::Refused(camera, "it speaks for another camera or stream".to_owned()),
            Err(refusal) => News::Refused(camera, format!("a batch is refused: {refusal}")),
        });
    }
}

/// Moves messages from the network to fusion until stopped. `synced_sigma_ns`: if PTP or chrony
/// keeps the machines' clocks of the day together, how well, 1 sigma.
///
/// # Errors
/// When shared memory or the network cannot be had.
pub fn run(
    session: &Session,
    court: &str,
    synced_sigma_ns: Option<f64>,
    stop: &Stop,
) -> Result<Received, Error> {
    let member = Domain::new(court, Place::Fusion)?.join("bridge")?;
    let memory = Memory::open(&member)?;
    // Boards start when somebody listens here, so nobody does before fusion reads.
    while !memory.is_read(&member)? {
        if stop.is_raised() {
            return Ok(Received::default());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let (to_us, news) = bounded(MAX_WAITING);
    let inbox = Inbox { news: to_us, n_overflowed: Arc::default() };
    let n_overflowed = Arc::clone(&inbox.n_overflowed);
    let sides = [
        Side::open(session, court, Camera::Left, synced_sigma_ns, &inbox)?,
        Side::open(session, court, Camera::Right, synced_sigma_ns, &inbox)?,
    ];
    let shots = session
        .declare_publisher(keys::shot(court)?)
        .congestion_control(CongestionControl::Block)
        .priority(Priority::DataHigh)
        .wait()
        .map_err(network("publish shots"))?;
    let _token = presence::announce(session, court, Place::Fusion)?;
    let exchange = Exchange::open(session, court, &member)?;
    let mut inbound = Inbound { sides, inbox, memory, shots, n_shots: 0, exchange };
    inbound.run(&news, stop)?;
    let launcher = inbound.exchange.passed();
    let links =
        inbound.sides.map(|side| side.board.link(side.board.is_heard_now(now_ns()), now_ns()));
    let n_overflowed = n_overflowed.load(Ordering::Relaxed);
    Ok(Received { links, n_overflowed, n_shots: inbound.n_shots, launcher })
}

struct Inbound<'a> {
    sides: [Side<'a>; 2],
    inbox: Inbox,
    memory: Memory,
    shots: Publisher<'a>,
    n_shots: u64,
    exchange: Exchange<'a>,
}

impl Inbound<'_> {
    fn run(&mut self, news: &Receiver<News>, stop: &Stop) -> Result<(), Error> {
        while !stop.is_raised() {
            match news.recv_timeout(TICK) {
                Ok(first) => {
                    self.take(first)?;
                    // What waits is taken before anything else, but pings must not starve.
                    for next in news.try_iter().take(64) {
                        self.take(next)?;
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(Error::NetworkThreadGone),
            }
            let now_ns = now_ns();
            for side in &mut self.sides {
                side.ping(now_ns);
                side.ask(now_ns, &self.inbox)?;
                if let Some(link) = side.link_to_tell(now_ns) {
                    self.memory.links.send(link)?;
                }
            }
            while let Some(shot) = self.memory.shots.receive()? {
                self.n_shots += 1;
                self.shots.put(shot).wait().map_err(network("send a shot"))?;
            }
            self.exchange.pass()?;
        }
        Ok(())
    }

    fn take(&mut self, news: News) -> Result<(), Error> {
        let messages = match news {
            News::Batch(camera, stream, batch) => {
                self.sides[camera.idx()].board.take_batch(stream, batch, now_ns())
            }
            News::Pong(camera, pong, returned_ns) => {
                let here_ns = clock::day_minus_stamp_ns();
                self.sides[camera.idx()].board.take_pong(&pong, returned_ns, here_ns)
            }
            News::Answered(camera, stream) => {
                tracing::debug!("the {camera} board has answered for {}", stream.name());
                self.sides[camera.idx()].board.note_answered(stream)
            }
            News::Refused(camera, why) => {
                self.sides[camera.idx()].board.refuse(&why);
                return Ok(());
            }
        };
        self.memory.write(messages)
    }
}

/// One board: what is known of it, and the ways to and from it.
struct Side<'a> {
    camera: Camera,
    court: String,
    session: &'a Session,
    board: Board,
    /// Says who comes and goes, and who speaks another version.
    _presence: Presence,
    pings: Publisher<'a>,
    asker_id: u64,
    pinged_ns: StampNs,
    told_ns: StampNs,
    was_alive: bool,
    _subscribers: [Subscriber<()>; 3],
}

impl<'a> Side<'a> {
    fn open(
        session: &'a Session,
        court: &str,
        camera: Camera,
        synced_sigma_ns: Option<f64>,
        inbox: &Inbox,
    ) -> Result<Self, Error> {
        let subscribe = |what: &str, take: Box<dyn Fn(&Sample) + Send + Sync>| {
            session
                .declare_subscriber(keys::of_board(court, camera, what)?)
                .callback(move |sample| take(&sample))
                .wait()
                .map_err(network(format!("subscribe to {what} of the {camera} board")))
        };
        let batches = |stream: Stream| {
            let inbox = inbox.clone();
            let take = move |sample: &Sample| {
                inbox.put_batch(camera, stream, &sample.payload().to_bytes());
            };
            subscribe(stream.name(), Box::new(take))
        };
        let to_us = inbox.clone();
        let pongs = move |sample: &Sample| {
            let returned_ns = now_ns();
            to_us.put(match Pong::from_bytes(&sample.payload().to_bytes()) {
                Ok(pong) => News::Pong(camera, pong, returned_ns),
                Err(refusal) => News::Refused(camera, format!("a pong is refused: {refusal}")),
            });
        };
        let subscribers = [
            batches(Stream::FramesInfo)?,
            batches(Stream::Candidates)?,
            subscribe("pong", Box::new(pongs))?,
        ];
        let pings = real_time_publisher(session, keys::of_board(court, camera, "ping")?)?;
        Ok(Self {
            camera,
            court: court.to_owned(),
            session,
            board: Board::new(camera, synced_sigma_ns),
            _presence: Presence::watch(session, court, Place::Board(camera))?,
            pings,
            asker_id: run::id_now(),
            pinged_ns: 0,
            told_ns: 0,
            was_alive: false,
            _subscribers: subscribers,
        })
    }

    fn ping(&mut self, now_ns: StampNs) {
        let clock_sigma_ns = self.board.clock_sigma_ns();
        let every_ns =
            if clock_sigma_ns == OWN_CLOCK { FIRST_PINGS_EVERY_NS } else { PING_EVERY_NS };
        if now_ns - self.pinged_ns >= every_ns {
            self.pinged_ns = now_ns;
            // Whether or not its token is here: a board's older session may go last.
            // Stamped as late as can be. One that cannot be sent is one that did not arrive.
            let sent_ns = shm_layout::stamp::now_ns();
            let ping = Ping { sent_ns, asker_id: self.asker_id, clock_sigma_ns };
            drop(self.pings.put(ping.to_bytes()).wait());
        }
    }

    fn ask(&mut self, now_ns: StampNs, inbox: &Inbox) -> Result<(), Error> {
        if !self.board.is_heard_now(now_ns) {
            return Ok(());
        }
        for asked in self.board.questions(now_ns) {
            self.question(asked, inbox)?;
        }
        Ok(())
    }

    fn question(&self, asked: Missing, inbox: &Inbox) -> Result<(), Error> {
        let Some(stream) = asked.stream() else { return Ok(()) };
        tracing::debug!(?asked, "the {} board is asked", self.camera);
        let camera = self.camera;
        // Dropped with the callback, when the answer is over.
        let answer = Answer { inbox: inbox.clone(), camera, stream };
        self.session
            .get(keys::of_board(&self.court, camera, "missing")?)
            .payload(asked.to_bytes())
            .priority(Priority::InteractiveHigh)
            // All answers have one key: otherwise the last alone would be passed on.
            .consolidation(ConsolidationMode::None)
            .timeout(ANSWER_WITHIN)
            .callback(move |reply| {
                if let Ok(sample) = reply.result() {
                    let bytes = sample.payload().to_bytes();
                    answer.inbox.put_batch(answer.camera, answer.stream, &bytes);
                }
            })
            .wait()
            .map_err(network(format!("ask the {camera} board for what is missing")))
    }

    fn link_to_tell(&mut self, now_ns: StampNs) -> Option<Link> {
        let is_alive = self.board.is_heard_now(now_ns);
        if is_alive == self.was_alive && now_ns - self.told_ns < TELL_EVERY_NS {
            return None;
        }
        (self.was_alive, self.told_ns) = (is_alive, now_ns);
        Some(self.board.link(is_alive, now_ns))
    }
}

struct Answer {
    inbox: Inbox,
    camera: Camera,
    stream: Stream,
}

impl Drop for Answer {
    fn drop(&mut self) {
        self.inbox.put(News::Answered(self.camera, self.stream));
    }
}

fn fits(camera: Camera, stream: Stream, message: &Message) -> bool {
    let (camera_idx, of) = match message {
        Message::FrameInfo(info) => (info.camera_idx, Stream::FramesInfo),
        Message::Candidates(strip) => (strip.camera_idx, Stream::Candidates),
    };
    of == stream && Camera::from_idx(camera_idx) == Some(camera)
}

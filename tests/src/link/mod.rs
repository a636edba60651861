//! Two boards that are not there, the real bridges, a network as bad as asked → how well candidates
//! and clocks get through.
//!
//! Read in this order: the [`arrangement`] is hosts and bridges; a [`board`] plays frames into a
//! board's shared memory and keeps what it [`sent`](board::Sent); fusion's place is taken by what
//! keeps all that is [`heard`]; comparing both is the [`completeness`], the [`latency`] and the
//! error of the [`clock`]; a [`bare`] socket is measured beside them; a [`report`] prints it all.
//!
//! Everything of ours runs in one process on this machine's clock, so what was sent and what
//! arrived are compared without any doubt, and a host's clock is ahead by a known number of
//! seconds.

// In the order of the chain; the blank lines keep rustfmt from sorting them.
pub mod arrangement;

pub mod board;

pub mod heard;

pub mod completeness;

pub mod latency;

pub mod clock;

pub mod bare;

pub mod report;

use crate::hosts::Network;
use crate::{hosts, processes};
use arrangement::Arrangement;
use board::Board;
use heard::Listener;
use report::Report;
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use shm_layout::{Camera, StampNs};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often the play looks whether something is to be done.
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// Longest the bridges may take to meet.
const MEET_WITHIN: Duration = Duration::from_secs(30);
/// After the last frame, how long messages may still be on their way.
const LAST_WITHIN: Duration = Duration::from_secs(3);
/// Latencies and clocks count from here on: connections and clocks have settled.
const SETTLED_AFTER_NS: i64 = 3_000_000_000;

/// Why nothing could be measured.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A process.
    #[error(transparent)]
    Processes(#[from] processes::Error),
    /// Shared memory.
    #[error(transparent)]
    Services(#[from] shm_layout::services::Error),
    /// The hosts.
    #[error(transparent)]
    Hosts(#[from] hosts::Error),
    /// This machine has no hosts.
    #[error("no hosts can be made here: {0}; --loopback needs none")]
    NoHosts(String),
    /// Somebody does not hear the other.
    #[error("bridges did not meet within {} s", MEET_WITHIN.as_secs())]
    NotMet,
    /// A socket of our own.
    #[error("bare socket: {0}")]
    Socket(std::io::Error),
    /// The bridges' keys.
    #[error("cannot make keys: {0}")]
    Keys(String),
    /// A bridge's clock.
    #[error("the clock of {0} cannot be looked at: {1}")]
    Clock(String, std::io::Error),
    /// A thread of ours panicked, which only a bug can do.
    #[error("a thread of the measurement is gone")]
    ThreadGone,
}

/// What is to be measured.
#[derive(Debug, Clone)]
pub struct Options {
    /// What joins the hosts; `None`: no hosts, all on loopback.
    pub network: Option<Network>,
    /// How long boards play.
    pub play: Duration,
    /// Which link is cut, from when on and for how long.
    pub cut: Option<Cut>,
    /// Whether loopback has TLS too; hosts always do.
    pub tls: bool,
    /// Whether boards find fusion by themselves instead of being told its address.
    pub discovery: bool,
    /// How well clocks of the day are kept together, as the bridge beside fusion is told.
    pub synced_within_us: Option<f64>,
    /// The weather's.
    pub seed: u64,
}

/// A link that is cut for a while.
#[derive(Debug, Clone)]
pub struct Cut {
    /// Name of the host.
    pub host: String,
    /// After the boards began.
    pub after: Duration,
    /// For so long.
    pub lasts: Duration,
}

/// When what happened, on this machine's clock.
#[derive(Debug, Clone, Copy)]
pub struct Times {
    /// Boards began.
    pub begun_ns: StampNs,
    /// The link was cut and mended.
    pub cut_ns: Option<(StampNs, StampNs)>,
}

impl Times {
    /// From here on connections and clocks have settled.
    #[must_use]
    pub fn settled_ns(&self) -> StampNs {
        self.begun_ns + SETTLED_AFTER_NS
    }

    /// Whether a message sent then says something of the ordinary state: connections and clocks
    /// are settled, and no cut is being got over.
    #[must_use]
    pub fn is_ordinary(&self, sent_ns: StampNs) -> bool {
        let near_cut = self.cut_ns.is_some_and(|(cut_ns, mended_ns)| {
            let over_ns = mended_ns.saturating_add(SETTLED_AFTER_NS);
            (cut_ns - 100_000_000..over_ns).contains(&sent_ns)
        });
        sent_ns >= self.settled_ns() && !near_cut
    }
}

/// Measures until the boards have played or `stop` is raised.
///
/// # Errors
/// When hosts, processes or shared memory cannot be had, or a bridge ends early.
pub fn measure(options: &Options, stop: &Stop) -> Result<Report, Error> {
    let court = processes::own_court("link")?;
    let mut arrangement = Arrangement::new(&court, options)?;
    let outcome = play(&court, &mut arrangement, options, stop);
    let emptied = arrangement.stop();
    let report = outcome?;
    emptied?;
    Ok(report)
}

fn play(
    court: &str,
    arrangement: &mut Arrangement,
    options: &Options,
    stop: &Stop,
) -> Result<Report, Error> {
    let is_over = Arc::new(AtomicBool::new(false));
    // The listener first: bridges wait for whoever reads beside fusion.
    let listener = Listener::start(court)?;
    arrangement.start_bridges()?;
    let mut boards = Vec::new();
    for camera in Camera::BOTH {
        let ahead_ns = arrangement.clock_ahead_ns(camera.name())?;
        boards.push(Board::start(court, camera, ahead_ns, Arc::clone(&is_over))?);
    }
    let started = Instant::now();
    while !boards.iter().all(Board::is_playing) && !stop.is_raised() {
        arrangement.look()?;
        if started.elapsed() > MEET_WITHIN {
            is_over.store(true, Ordering::Relaxed);
            return Err(Error::NotMet);
        }
        std::thread::sleep(LOOK_EVERY);
    }
    let bare = options.network.is_none().then(|| bare::Ping::start(Arc::clone(&is_over)));
    let bare = bare.transpose().map_err(Error::Socket)?;
    let mut times = Times { begun_ns: now_ns(), cut_ns: None };
    let mut memory = arrangement.memory();
    watch(arrangement, options, stop, &mut times, &mut memory)?;
    is_over.store(true, Ordering::Relaxed);
    let mut sent = Vec::new();
    for board in boards {
        sent.push(board.join()?);
    }
    let n_sent: usize = sent.iter().map(board::Sent::n_strips).sum();
    let heard = listener.join(n_sent, LAST_WITHIN)?;
    arrangement.look()?;
    memory.note(&arrangement.memory());
    let bare = bare.map(bare::Ping::join).transpose()?;
    let truths = arrangement.truths()?;
    Ok(Report::new(arrangement, options, (&sent, &heard), times, truths, memory, bare))
}

/// While the boards play: cuts and mends, and looks after the processes.
fn watch(
    arrangement: &mut Arrangement,
    options: &Options,
    stop: &Stop,
    times: &mut Times,
    memory: &mut arrangement::Memory,
) -> Result<(), Error> {
    let ns_of = |time: Duration| i64::try_from(time.as_nanos()).unwrap_or(i64::MAX);
    let end_ns = times.begun_ns.saturating_add(ns_of(options.play));
    let mut is_cut = false;
    while now_ns() < end_ns && !stop.is_raised() {
        arrangement.look()?;
        if let Some(cut) = &options.cut {
            let cut_ns = times.begun_ns + ns_of(cut.after);
            let mend_ns = cut_ns + ns_of(cut.lasts);
            if !is_cut && times.cut_ns.is_none() && now_ns() >= cut_ns {
                memory.note(&arrangement.memory());
                arrangement.cut(&cut.host)?;
                (is_cut, times.cut_ns) = (true, Some((now_ns(), i64::MAX)));
            } else if is_cut && now_ns() >= mend_ns {
                arrangement.mend(&cut.host)?;
                is_cut = false;
                times.cut_ns = times.cut_ns.map(|(cut_ns, _)| (cut_ns, now_ns()));
                memory.note(&arrangement.memory());
            }
        }
        std::thread::sleep(LOOK_EVERY);
    }
    Ok(())
}

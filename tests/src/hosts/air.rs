//! The network in user space: frames of each host's TAP device → the other hosts' devices.
//!
//! One thread owns all devices. It sleeps until a frame comes or one is due, which the kernel's
//! high-resolution timers tell to some ten microseconds; it runs before all others (real time), as
//! a network does not wait for the computers on it. A frame goes to the host it is addressed to, or
//! to all others. Its own delay in fair weather is measured by `tests/system/hosts.rs`.

use super::ip::run;
use super::weather::{Counts, Fate, WayOut, Weather};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::io::ErrorKind;
use std::num::NonZeroU64;
use std::os::fd::AsFd as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;
use tun_rs::SyncDevice;

/// Longest Ethernet frame of a device with an MTU of 1500, and some room.
const MAX_FRAME_BYTES: usize = 2048;
/// Most frames taken from a device at once, so that none has to wait long.
const MAX_AT_ONCE: usize = 64;
/// Longest sleep, after which changed settings are looked at.
const LONGEST_SLEEP_NS: u64 = 10_000_000;

/// The hardware address of the host with this index.
#[must_use]
pub fn address_of(host_idx: usize) -> [u8; 6] {
    [2, 0, 0, 0, 0, u8::try_from(host_idx + 1).expect("a test has fewer than 255 hosts")]
}

/// A running network. Dropping it ends its thread.
#[derive(Debug)]
pub struct Air {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    is_over: AtomicBool,
    ports: Mutex<Vec<Port>>,
}

#[derive(Debug, Clone, Copy)]
struct Port {
    weather: Weather,
    is_changed: bool,
    is_cut: bool,
    counts: Counts,
}

impl Shared {
    fn ports(&self) -> MutexGuard<'_, Vec<Port>> {
        self.ports.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Air {
    /// Starts a network between these devices, one a host, in non-blocking mode.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub fn start(devices: Vec<SyncDevice>, weather: Weather, seed: u64) -> std::io::Result<Self> {
        let port = Port { weather, is_changed: false, is_cut: false, counts: Counts::default() };
        let ports = Mutex::new(vec![port; devices.len()]);
        let shared = Arc::new(Shared { is_over: AtomicBool::new(false), ports });
        let seeds = seed..;
        let ways_out = devices.iter().zip(seeds).map(|(_, seed)| WayOut::new(weather, seed));
        let mut carrier = Carrier {
            ways_out: ways_out.collect(),
            n_frames: vec![0; devices.len()],
            devices,
            waiting: BinaryHeap::new(),
            n_accepted: 0,
            begun: Instant::now(),
        };
        let theirs = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("air".to_owned());
        let thread = thread.spawn(move || carrier.run(&theirs))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Cuts a host off, or mends its link.
    pub fn set_cut(&self, host_idx: usize, is_cut: bool) {
        self.shared.ports()[host_idx].is_cut = is_cut;
    }

    /// Changes the weather of a host's way out.
    pub fn set_weather(&self, host_idx: usize, weather: Weather) {
        let port = &mut self.shared.ports()[host_idx];
        (port.weather, port.is_changed) = (weather, true);
    }

    /// What became of a host's frames so far.
    #[must_use]
    pub fn counts(&self, host_idx: usize) -> Counts {
        self.shared.ports()[host_idx].counts
    }
}

impl Drop for Air {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of that thread was printed when it happened.
            let _ = thread.join();
        }
    }
}

/// A frame on its way. Ordered by when it leaves, then by when it was accepted.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Frame {
    leaves_ns: u64,
    accepted_idx: u64,
    from: usize,
    bytes: Vec<u8>,
}

/// Lets this thread run as soon as it can, and its sleeps end when they should. What the system
/// refuses makes frames less punctual, and the network works all the same.
fn go_before_others() {
    let thread_id = rustix::thread::gettid().as_raw_nonzero();
    if run("chrt", &format!("--fifo --pid 10 {thread_id}")).is_err() {
        let _ = rustix::process::setpriority_process(None, -20); // of this thread
    }
    let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
}

struct Carrier {
    devices: Vec<SyncDevice>,
    ways_out: Vec<WayOut>,
    /// On their way, by host.
    n_frames: Vec<usize>,
    waiting: BinaryHeap<Reverse<Frame>>,
    n_accepted: u64,
    begun: Instant,
}

impl Carrier {
    fn run(&mut self, shared: &Shared) {
        go_before_others();
        while !shared.is_over.load(Ordering::Relaxed) {
            self.deliver_due(&mut shared.ports());
            let readable = self.sleep();
            let mut ports = shared.ports();
            for (from, is_readable) in readable.into_iter().enumerate() {
                if is_readable {
                    self.accept(from, &mut ports[from]);
                }
            }
        }
    }

    fn now_ns(&self) -> u64 {
        u64::try_from(self.begun.elapsed().as_nanos()).expect("584 years have not passed")
    }

    /// Until a frame comes or is due; says which devices have one.
    fn sleep(&self) -> Vec<bool> {
        let due_ns = self.waiting.peek().map(|Reverse(frame)| frame.leaves_ns);
        let sleep_ns = due_ns.map(|due_ns| due_ns.saturating_sub(self.now_ns()));
        let sleep_ns = sleep_ns.unwrap_or(LONGEST_SLEEP_NS).min(LONGEST_SLEEP_NS);
        let timeout = Timespec { tv_sec: 0, tv_nsec: sleep_ns as i64 };
        let mut fds: Vec<PollFd<'_>> = self
            .devices
            .iter()
            .map(|device| PollFd::from_borrowed_fd(device.as_fd(), PollFlags::IN))
            .collect();
        // An interrupted sleep is a short one.
        let _ = poll(&mut fds, Some(&timeout));
        fds.iter().map(|fd| fd.revents().contains(PollFlags::IN)).collect()
    }

    fn accept(&mut self, from: usize, port: &mut Port) {
        if std::mem::take(&mut port.is_changed) {
            self.ways_out[from].change(port.weather);
        }
        let mut bytes = [0; MAX_FRAME_BYTES];
        for _ in 0..MAX_AT_ONCE {
            let n_bytes = match self.devices[from].recv(&mut bytes) {
                Ok(n_bytes) => n_bytes,
                Err(why) if why.kind() == ErrorKind::WouldBlock => return,
                Err(_) => return, // the device is down: there is no frame either
            };
            port.counts.n_sent += 1;
            if port.is_cut {
                port.counts.n_cut += 1;
                continue;
            }
            let now_ns = self.now_ns();
            match self.ways_out[from].send(now_ns, n_bytes, self.n_frames[from]) {
                Fate::LeavesAt(leaves_ns) => {
                    let (accepted_idx, bytes) = (self.n_accepted, bytes[..n_bytes].to_vec());
                    self.n_accepted += 1;
                    self.n_frames[from] += 1;
                    self.waiting.push(Reverse(Frame { leaves_ns, accepted_idx, from, bytes }));
                }
                Fate::Lost => port.counts.n_lost += 1,
                Fate::Overflows => port.counts.n_overflowed += 1,
            }
        }
    }

    fn deliver_due(&mut self, ports: &mut [Port]) {
        let now_ns = self.now_ns();
        while self.waiting.peek().is_some_and(|Reverse(frame)| frame.leaves_ns <= now_ns) {
            let Some(Reverse(frame)) = self.waiting.pop() else { return };
            self.n_frames[frame.from] -= 1;
            self.deliver(&frame, ports);
        }
    }

    fn deliver(&self, frame: &Frame, ports: &mut [Port]) {
        let address = frame.bytes.get(..6).unwrap_or_default();
        let addressee = (0..self.devices.len()).find(|&idx| address_of(idx) == *address);
        for to in (0..self.devices.len()).filter(|&idx| idx != frame.from) {
            if addressee.is_some_and(|addressee| addressee != to) {
                continue;
            }
            if ports[frame.from].is_cut || ports[to].is_cut {
                ports[frame.from].counts.n_cut += 1;
            } else if self.devices[to].send(&frame.bytes).is_err() {
                ports[frame.from].counts.n_overflowed += 1;
            }
        }
    }
}

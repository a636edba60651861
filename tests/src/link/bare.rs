//! The same bytes at the same rate over a bare TCP socket on loopback, for comparison: no delay
//! (TCP_NODELAY), one way, blocking reads.

use super::latency::Latency;
use super::{Error, SETTLED_AFTER_NS};
use shm_layout::StampNs;
use shm_layout::stamp::now_ns;
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Bytes of a ping: a batch of one strip with three spots is 3 * 52 bytes and some 50 of numbers.
pub const N_BYTES: usize = 206;
/// As often as two boards send a strip: 2 * 2 * 90 a second.
const EVERY: Duration = Duration::from_micros(2778);

/// A ping on its way until told that it is over.
#[derive(Debug)]
pub struct Ping {
    sender: JoinHandle<std::io::Result<()>>,
    receiver: JoinHandle<std::io::Result<Vec<StampNs>>>,
}

impl Ping {
    /// Starts both ends.
    ///
    /// # Errors
    /// When there is no socket to be had.
    pub fn start(is_over: Arc<AtomicBool>) -> std::io::Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let address = listener.local_addr()?;
        let sender = std::thread::spawn(move || {
            let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
            let mut stream = TcpStream::connect(address)?;
            stream.set_nodelay(true)?;
            let mut bytes = [0; N_BYTES];
            while !is_over.load(Ordering::Relaxed) {
                std::thread::sleep(EVERY);
                bytes[..8].copy_from_slice(&now_ns().to_le_bytes());
                stream.write_all(&bytes)?;
            }
            Ok(())
        });
        let receiver = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept()?;
            let begun_ns = now_ns();
            let (mut took_ns, mut bytes) = (Vec::new(), [0; N_BYTES]);
            while stream.read_exact(&mut bytes).is_ok() {
                let arrived_ns = now_ns();
                let (stamp, _) = bytes.split_first_chunk().expect("a ping is longer than a stamp");
                let sent_ns = StampNs::from_le_bytes(*stamp);
                if sent_ns > begun_ns + SETTLED_AFTER_NS {
                    took_ns.push(arrived_ns - sent_ns);
                }
            }
            Ok(took_ns)
        });
        Ok(Self { sender, receiver })
    }

    /// How long pings took.
    ///
    /// # Errors
    /// When a socket failed.
    pub fn join(self) -> Result<Latency, Error> {
        self.sender.join().map_err(|_| Error::ThreadGone)?.map_err(Error::Socket)?;
        let took_ns = self.receiver.join().map_err(|_| Error::ThreadGone)?;
        Ok(Latency::from_ns(took_ns.map_err(Error::Socket)?))
    }
}

//! The same bytes at the same rate over a bare TCP socket on loopback, for comparison: no delay
//! (TCP_NODELAY), one way, blocking reads.

use super::board::strip_of;
use super::latency::Latency;
use super::{Error, SETTLED_AFTER_NS};
use bridge::wire::batch::{Batch, MAX_BYTES, Message, bytes_from_batch};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use shm_layout::stamp::now_ns;
use shm_layout::{FrameInfo, StampNs};
use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// As often as two boards send a strip: 2 * 2 * 90 a second.
const EVERY: Duration = Duration::from_micros(2778);

/// A ping on its way until told that it is over.
#[derive(Debug)]
pub struct Ping {
    sender: JoinHandle<std::io::Result<()>>,
    receiver: JoinHandle<std::io::Result<Vec<StampNs>>>,
}

/// The length and the bytes of a batch as a board's bridge sends it.
fn bytes_of(idx: u64) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(idx);
    let info = FrameInfo {
        frame_idx: idx / 2,
        exposed_ns: now_ns(),
        published_ns: now_ns(),
        width_px: 640,
        height_px: 480,
        ..FrameInfo::default()
    };
    let strip = strip_of(&info, (idx % 2) as u32, &mut rng);
    let messages = vec![Message::Candidates(Box::new(strip))];
    let batch = bytes_from_batch(&Batch { session_id: 1 << 50, batch_idx: idx, messages });
    let mut bytes = u32::try_from(batch.len()).unwrap_or(u32::MAX).to_le_bytes().to_vec();
    bytes.extend(batch);
    bytes
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
            for idx in 0.. {
                if is_over.load(Ordering::Relaxed) {
                    break;
                }
                std::thread::sleep(EVERY);
                let mut bytes = bytes_of(idx);
                bytes[4..12].copy_from_slice(&now_ns().to_le_bytes());
                stream.write_all(&bytes)?;
            }
            Ok(())
        });
        let receiver = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept()?;
            let begun_ns = now_ns();
            let (mut took_ns, mut head, mut bytes) = (Vec::new(), [0; 4], vec![0; MAX_BYTES]);
            while stream.read_exact(&mut head).is_ok() {
                let n_bytes = (u32::from_le_bytes(head) as usize).min(MAX_BYTES);
                stream.read_exact(&mut bytes[..n_bytes])?;
                let arrived_ns = now_ns();
                let (stamp, _) = bytes.split_first_chunk().expect("MAX_BYTES are more than 8");
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

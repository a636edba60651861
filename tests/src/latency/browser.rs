//! A page that is looked at: which balls are pushed to its viewer, and when.

use super::heard::Bounced;
use anyhow::{Context as _, bail};
use serde::Deserialize;
use shm_layout::StampNs;
use shm_layout::stamp::now_ns;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tungstenite::{Error, Message, WebSocket};

/// Longest the page may take until it answers.
const THERE_WITHIN: Duration = Duration::from_secs(20);

/// How often a viewer to whom nothing is pushed looks whether it is over.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// What is read of what is pushed.
#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Push {
    Ball {
        ball: Ball,
    },
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
struct Ball {
    shot: Shot,
}

#[derive(Deserialize)]
struct Shot {
    bounce: Option<Bounce>,
}

#[derive(Deserialize)]
struct Bounce {
    t_ns: Option<StampNs>,
}

/// Watches until it is asked.
#[derive(Debug)]
pub struct Browser {
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<anyhow::Result<Vec<Bounced>>>,
}

impl Browser {
    /// Watches the page at this address, once it is there.
    ///
    /// # Errors
    /// When it does not answer.
    pub fn open(address: &str) -> anyhow::Result<Self> {
        let begun = Instant::now();
        let stream = loop {
            match TcpStream::connect(address) {
                Ok(stream) => break stream,
                Err(why) if begun.elapsed() > THERE_WITHIN => bail!("page at {address}: {why}"),
                Err(_) => std::thread::sleep(Duration::from_millis(20)),
            }
        };
        let url = format!("ws://{address}/api/v1/live");
        let (socket, _) = tungstenite::client(url, stream)
            .map_err(|why| anyhow::anyhow!("page at {address}: {why}"))?;
        socket.get_ref().set_read_timeout(Some(LOOK_EVERY)).context("wait for a push")?;
        let is_over = Arc::new(AtomicBool::new(false));
        let thread = std::thread::spawn({
            let is_over = Arc::clone(&is_over);
            move || watch(socket, &is_over)
        });
        Ok(Self { is_over, thread })
    }

    /// Leaves, and tells what was pushed.
    ///
    /// # Errors
    /// When the page ended before, or pushed what is no JSON of its kind.
    pub fn end(self) -> anyhow::Result<Vec<Bounced>> {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().map_err(|_| anyhow::anyhow!("the viewer panicked"))?
    }
}

fn watch(mut socket: WebSocket<TcpStream>, is_over: &AtomicBool) -> anyhow::Result<Vec<Bounced>> {
    let mut balls = Vec::new();
    while !is_over.load(Ordering::Relaxed) {
        let text = match socket.read() {
            Ok(Message::Text(text)) => text,
            Ok(_) => continue,
            Err(Error::Io(why))
                if matches!(why.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
            {
                continue;
            }
            Err(why) => return Err(why).context("what the page pushes"),
        };
        let arrived_ns = now_ns();
        if let Push::Ball { ball } = serde_json::from_str(&text).context("what the page pushes")? {
            let bounce_ns = ball.shot.bounce.and_then(|bounce| bounce.t_ns);
            balls.push(Bounced { bounce_ns, arrived_ns });
        }
    }
    Ok(balls)
}

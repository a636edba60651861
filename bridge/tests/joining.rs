//! Who is let into a court, with real sessions over TLS on loopback. Every stranger is put beside a
//! paired board, whose messages must keep arriving.

use bridge::pairing::authority::{Authority, Identity};
use bridge::pairing::bundle::Bundle;
use bridge::session::{self, Options, Role};
use shm_layout::Camera;
use std::net::TcpListener;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

const LEFT: Role = Role::Board(Camera::Left);
const RIGHT: Role = Role::Board(Camera::Right);
/// A paired board's messages in each test: at 5 ms each long enough for many tries to get in.
const N_MESSAGES: usize = 100;
/// Only a hung test comes near this.
const PATIENCE: Duration = Duration::from_secs(60);

/// A court with its authority, and an address for its fusion.
struct Court {
    folder: tempfile::TempDir,
    authority: Authority,
    endpoint: String,
}

impl Court {
    fn new() -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        Self {
            folder: tempfile::tempdir().unwrap(),
            authority: Authority::new().unwrap(),
            endpoint: format!("tls/127.0.0.1:{port}"),
        }
    }

    /// Keys in a folder of their own, signed by this court's authority.
    fn keys(&self, name: &str, role: Role) -> PathBuf {
        self.keys_of(role, self.authority.identity(name, role).unwrap())
    }

    fn keys_of(&self, role: Role, identity: Identity) -> PathBuf {
        let folder = self.folder.path().join(format!("{}", rand_name()));
        let authority_pem = self.authority.certificate_pem.clone();
        let court = "rose".to_owned();
        Bundle { court, role, identity, authority_pem }.unpack(&folder).unwrap();
        folder
    }

    fn fusion(&self) -> Session {
        let keys = Some(self.keys("rose/fusion", Role::Fusion));
        let listen = vec![self.endpoint.clone()];
        session::open(&Options { listen, keys, ..Options::new("rose", Role::Fusion) }).unwrap()
    }

    /// A peer of this court's fusion with any keys.
    fn peer(&self, role: Role, keys: PathBuf) -> Session {
        let connect = vec![self.endpoint.clone()];
        let options = Options { connect, keys: Some(keys), ..Options::new("rose", role) };
        session::open(&options).unwrap()
    }
}

fn received(session: &Session, key: &str) -> Receiver<(String, String)> {
    let (sender, receiver) = channel();
    let subscriber = session.declare_subscriber(key.to_owned()).callback(move |sample| {
        let text = sample.payload().try_to_string().unwrap().into_owned();
        let _ = sender.send((sample.key_expr().to_string(), text));
    });
    subscriber.background().wait().unwrap();
    receiver
}

#[test]
fn paired_peers_exchange() {
    let _ = tracing_subscriber::fmt()
        .with_env_filter(std::env::var("L").unwrap_or_default())
        .try_init();
    let court = Court::new();
    let fusion = court.fusion();
    let at_fusion = received(&fusion, "court/rose/left/candidates");
    let board = court.peer(LEFT, court.keys("rose/left", LEFT));
    let started = Instant::now();
    let mut n = 0;
    while n < N_MESSAGES {
        assert!(started.elapsed() < PATIENCE);
        board.put("court/rose/left/candidates", "good").wait().unwrap();
        if at_fusion.recv_timeout(Duration::from_millis(5)).is_ok() {
            n += 1;
        }
    }
    eprintln!("{n} after {:?}", started.elapsed());
}

#[test]
fn foreign() {
    let _ = tracing_subscriber::fmt()
        .with_env_filter(std::env::var("L").unwrap_or_default())
        .try_init();
    let court = Court::new();
    let other = Court::new();
    let _fusion = court.fusion();
    let mode = std::env::var("MODE").unwrap_or_default();
    let keys = match mode.as_str() {
        "foreign" => court.keys_of(LEFT, other.authority.identity("rose/left", LEFT).unwrap()),
        "otherca" => other.keys("rose/left", LEFT),
        "expired" => court.keys_of(
            LEFT,
            court
                .authority
                .identity_until("rose/left", LEFT, Duration::from_secs(1_700_000_000))
                .unwrap(),
        ),
        _ => court.keys("rose/left", LEFT),
    };
    match mode.as_str() {
        "tcp" | "nocert" => {
            let mut config = zenoh::Config::default();
            config
                .insert_json5(
                    "connect/endpoints",
                    &format!(
                        "[{:?}]",
                        if mode == "tcp" {
                            court.endpoint.replace("tls", "tcp")
                        } else {
                            court.endpoint.clone()
                        }
                    ),
                )
                .unwrap();
            config.insert_json5("listen/endpoints", "[]").unwrap();
            config.insert_json5("scouting/multicast/enabled", "false").unwrap();
            if mode == "nocert" {
                let ca = court.folder.path().join("ca.pem");
                std::fs::write(&ca, &court.authority.certificate_pem).unwrap();
                config
                    .insert_json5("transport/link/tls/root_ca_certificate", &format!("{ca:?}"))
                    .unwrap();
                config.insert_json5("transport/link/tls/verify_name_on_connect", "false").unwrap();
            }
            let _s = zenoh::open(config).wait().unwrap();
            std::thread::sleep(Duration::from_secs(2));
        }
        "garbage" => {
            use std::io::Write;
            for i in 0..5 {
                let mut s = std::net::TcpStream::connect(&court.endpoint[4..]).unwrap();
                if i > 0 {
                    s.write_all(&vec![i as u8 * 37; 100 * i]).unwrap();
                }
                std::thread::sleep(Duration::from_millis(300));
            }
        }
        "hang" => {
            let _s = std::net::TcpStream::connect(&court.endpoint[4..]).unwrap();
            std::thread::sleep(Duration::from_millis(2300));
        }
        "boardserver" => {
            drop(_fusion);
            let keys = court.keys("rose/left", LEFT);
            for (a, b) in [
                ("left.pem", "fusion.pem"),
                ("left.key", "fusion.key"),
                ("left.authority.pem", "fusion.authority.pem"),
            ] {
                std::fs::copy(keys.join(a), keys.join(b)).unwrap();
            }
            let _f = session::open(&Options {
                listen: vec![court.endpoint.clone()],
                keys: Some(keys),
                ..Options::new("rose", Role::Fusion)
            })
            .unwrap();
            let _s = court.peer(RIGHT, court.keys("rose/right", RIGHT));
            std::thread::sleep(Duration::from_secs(2));
        }
        _ => {
            let _s = court.peer(LEFT, keys);
            std::thread::sleep(Duration::from_secs(2));
        }
    }
}
fn rand_name() -> u32 {
    static N: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
    N.fetch_add(1, std::sync::atomic::Ordering::Relaxed)
}

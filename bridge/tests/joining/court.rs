//! A court with its keys, sessions in it, and what was said of strangers.

use bridge::once::{self, Once};
use bridge::pairing::authority::{Authority, Identity};
use bridge::pairing::bundle::Bundle;
use bridge::session::{self, Options, Role};
use shm_layout::Camera;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, Once as Init};
use std::time::{Duration, Instant};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use zenoh::qos::CongestionControl;
use zenoh::{Config, Session, Wait};

pub const LEFT: Role = Role::Board(Camera::Left);
pub const RIGHT: Role = Role::Board(Camera::Right);
/// Only a hung test comes near this.
pub const PATIENCE: Duration = Duration::from_secs(60);
const PAUSE: Duration = Duration::from_millis(2);

static SAID: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Whether a sentence with these words was said by any session of this process.
pub fn was_said(words: &str) -> bool {
    SAID.lock().unwrap().iter().any(|sentence| sentence.contains(words))
}

/// A court named rose, with its authority and an address for its fusion.
pub struct Court {
    folder: tempfile::TempDir,
    pub authority: Authority,
    pub endpoint: String,
}

impl Court {
    pub fn new() -> Self {
        static INIT: Init = Init::new();
        INIT.call_once(|| {
            let once = Once::new(|sentence| {
                eprintln!("said: {sentence}");
                SAID.lock().unwrap().push(sentence.to_owned());
            });
            tracing_subscriber::registry().with(once.with_filter(once::heard())).init();
        });
        Self {
            folder: tempfile::tempdir().unwrap(),
            authority: Authority::new().unwrap(),
            endpoint: free_endpoint(),
        }
    }

    /// Keys in a folder of their own, signed by this court's authority.
    pub fn keys(&self, name: &str, role: Role) -> PathBuf {
        self.keys_of(role, self.authority.identity(name, role).unwrap())
    }

    /// An identity of anybody's in a folder of its own, with this court's authority.
    pub fn keys_of(&self, role: Role, identity: Identity) -> PathBuf {
        static N_FOLDERS: AtomicU32 = AtomicU32::new(0);
        let idx = N_FOLDERS.fetch_add(1, Ordering::Relaxed);
        let folder = self.folder.path().join(idx.to_string());
        let authority_pem = self.authority.certificate_pem.clone();
        let court = "rose".to_owned();
        Bundle { court, role, identity, authority_pem }.unpack(&folder).unwrap();
        folder
    }

    pub fn fusion(&self) -> Session {
        let keys = Some(self.keys("rose/fusion", Role::Fusion));
        let listen = vec![self.endpoint.clone()];
        session::open(&Options { listen, keys, ..Options::new("rose", Role::Fusion) }).unwrap()
    }

    /// A session that connects to this court's fusion, with any keys.
    pub fn peer(&self, role: Role, keys: PathBuf) -> Session {
        let connect = vec![self.endpoint.clone()];
        let options = Options { connect, keys: Some(keys), ..Options::new("rose", role) };
        session::open(&options).unwrap()
    }

    /// As [`Court::peer`], but without rules of its own: only the other side can hold it.
    pub fn lawless(&self, role: Role, keys: Option<&Path>) -> Session {
        let authority = self.folder.path().join("authority.pem");
        std::fs::write(&authority, &self.authority.certificate_pem).unwrap();
        let mut settings = vec![
            ("transport/link/tls/root_ca_certificate".to_owned(), json(&authority)),
            ("transport/link/tls/verify_name_on_connect".to_owned(), "false".to_owned()),
        ];
        if let Some(keys) = keys {
            settings.push(("transport/link/tls/enable_mtls".to_owned(), "true".to_owned()));
            for (key, suffix) in [("connect_certificate", "pem"), ("connect_private_key", "key")] {
                let path = keys.join(format!("{}.{suffix}", role.name()));
                settings.push((format!("transport/link/tls/{key}"), json(&path)));
            }
        }
        stranger(&self.endpoint, settings)
    }
}

/// A bare Zenoh session that connects somewhere.
pub fn stranger(endpoint: &str, settings: Vec<(String, String)>) -> Session {
    let mut config = Config::default();
    let common = [
        ("connect/endpoints", format!("[{endpoint:?}]")),
        ("connect/retry", "{ period_init_ms: 20, period_max_ms: 100 }".to_owned()),
        ("listen/endpoints", "[]".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
    ];
    let common = common.map(|(key, value)| (key.to_owned(), value));
    for (key, value) in common.into_iter().chain(settings) {
        config.insert_json5(&key, &value).unwrap();
    }
    zenoh::open(config).wait().unwrap()
}

fn json(path: &Path) -> String {
    format!("{path:?}")
}

pub fn free_endpoint() -> String {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    format!("tls/127.0.0.1:{port}")
}

/// What a session hears under a key, as (key, text).
pub fn heard(session: &Session, key: &str) -> Receiver<(String, String)> {
    let (sender, receiver) = channel();
    let subscriber = session.declare_subscriber(key.to_owned()).callback(move |sample| {
        let text = sample.payload().try_to_string().unwrap().into_owned();
        let _ = sender.send((sample.key_expr().to_string(), text));
    });
    subscriber.background().wait().unwrap();
    receiver
}

pub fn wait_for(what: &str, mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(PAUSE);
    }
}

/// From one session to another under a key: as many messages as the test asks for, all of which
/// arrive, in order, and nothing else. `is_enough` is called after each.
pub fn all_arrive(from: &Session, key: &str, to: &Session, mut is_enough: impl FnMut(u64) -> bool) {
    // Fusion listens to both cameras at once here; a board may ask for its own only.
    let is_to_board = key.ends_with("/ping");
    let wide = key.replace("/right/", "/*/").replace("/left/", "/*/");
    let at_far_end = heard(to, if is_to_board { key } else { &wide });
    let publisher = from
        .declare_publisher(key.to_owned())
        .congestion_control(CongestionControl::Block)
        .wait()
        .unwrap();
    wait_for("a subscriber", || publisher.matching_status().wait().unwrap().matching());
    let started = Instant::now();
    for idx in 0.. {
        publisher.put(format!("good {idx}")).wait().unwrap();
        let arrived = at_far_end.recv_timeout(PATIENCE).unwrap();
        assert_eq!(arrived, (key.to_owned(), format!("good {idx}")));
        if is_enough(idx) {
            break;
        }
        assert!(started.elapsed() < PATIENCE, "never enough");
        std::thread::sleep(PAUSE);
    }
    assert!(at_far_end.try_recv().is_err());
}

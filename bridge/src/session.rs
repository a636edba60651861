//! Who this process is → its Zenoh session.
//!
//! One court needs no router: the computer beside fusion listens, boards connect and keep trying
//! until it is there. With keys (see [`pairing`]) links are TLS with certificates on both sides,
//! addresses are found by multicast, and [`access`] says who may speak under which key. Without
//! keys there is plain TCP on loopback and nothing else.
//!
//! A link that falls silent is given up after [`LEASE_MS`]; then the connecting side tries anew, an
//! attempt lasting [`OPEN_MS`] at most and a pause [`PAUSE_MAX_MS`]. So a link is back 1.1 s and a
//! handshake after the network is, at the latest.

use crate::pairing::Keys;
use crate::{Error, access, discovery, network, pairing};
use serde_json::{Value, json};
use shm_layout::Camera;
use shm_layout::stop::Stop;
use std::net::IpAddr;
use std::path::PathBuf;
use zenoh::key_expr::OwnedKeyExpr;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Config, Session, Wait};

/// Where the two ends meet without keys, unless told otherwise.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";
/// Where fusion and routers listen with keys, unless told otherwise.
pub const DEFAULT_TLS_LISTEN: &str = "tls/0.0.0.0:7447";
/// Where a commander beside fusion finds it with keys.
pub const DEFAULT_TLS_LOCAL: &str = "tls/127.0.0.1:7447";

/// A link silent for so long is given up, ms.
pub const LEASE_MS: u64 = 1000;
/// An attempt to connect lasts so long at most, from the first packet to the open session, ms.
pub const OPEN_MS: u64 = 1000;
/// Between two attempts, ms; the first pause is 20 and each one twice the last. A packet every
/// tenth of a second burdens nobody, and a restarted process is found without losing time.
pub const PAUSE_MAX_MS: u64 = 100;
/// A commander tries for so long to connect, ms.
const COMMANDER_WITHIN_MS: i64 = 3000;
/// The largest message taken: a raw image of 1456x1088 with room to spare, bytes.
pub const MAX_MESSAGE_BYTES: u64 = 4 << 20;

/// What a process is in its court.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Beside a camera: connects to fusion.
    Board(Camera),
    /// Beside fusion: listens.
    Fusion,
    /// On fusion's computer, for one command: connects to fusion with fusion's keys.
    Commander,
    /// Of a controller or a launcher on another computer: connects to fusion.
    Controller,
    /// May hear shots, corrections and what the launcher says, and nothing else.
    Dashboard,
    /// Joins many courts.
    Router,
}

impl Role {
    /// Whose keys it uses; also their files' name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Board(camera) => camera.name(),
            Self::Fusion | Self::Commander => "fusion",
            Self::Controller => "controller",
            Self::Dashboard => "dashboard",
            Self::Router => "router",
        }
    }

    pub(crate) const fn is_listener(self) -> bool {
        matches!(self, Self::Fusion | Self::Router)
    }
}

/// What a session is opened with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// The court; for a router the name its keys are kept under.
    pub court: String,
    /// What this process is there.
    pub role: Role,
    /// Where it listens (`tls/192.168.1.5:7447`). Empty: fusion's and a router's default, else no
    /// listening.
    pub listen: Vec<String>,
    /// Where it connects. Empty: found by multicast with keys, [`DEFAULT_ENDPOINT`] without.
    pub connect: Vec<String>,
    /// Where [`discover`] found fusion.
    pub found: Option<String>,
    /// Folder of the keys; `None` is [`pairing::default_folder`], if it has this role's keys.
    pub keys: Option<PathBuf>,
    /// Courts a router joins or a dashboard hears besides `court`.
    pub courts: Vec<String>,
}

impl Options {
    /// A process at the default place, with the default keys.
    #[must_use]
    pub fn new(court: &str, role: Role) -> Self {
        Self {
            court: court.to_owned(),
            role,
            listen: Vec::new(),
            connect: Vec::new(),
            found: None,
            keys: None,
            courts: Vec::new(),
        }
    }
}

/// Looks for fusion where it must be found, and waits until it is; false when stopped before. A
/// session opened without this finds it as well, but takes up to eight seconds after an outage.
///
/// # Errors
/// When keys are not fit or there is no network.
pub fn discover(options: &mut Options, stop: &Stop) -> Result<bool, Error> {
    if !Plan::from_options(options)?.is_seeker() {
        return Ok(true);
    }
    options.found = discovery::endpoint(options, stop)?;
    Ok(options.found.is_some())
}

/// Opens a session.
///
/// Zenoh opens a session whether a peer takes it or not, is there or not: a peer's liveliness
/// tells.
///
/// # Errors
/// When keys are needed and not there or not fit, an address is malformed or taken.
pub fn open(options: &Options) -> Result<Session, Error> {
    let plan = Plan::from_options(options)?;
    let mut config = Config::default();
    for (key, value) in plan.settings()? {
        let value = value.to_string();
        config.insert_json5(key, &value).map_err(network(format!("set {key} to {value}")))?;
    }
    if plan.keys.is_none() {
        tracing::info!("no keys: plain TCP on loopback only");
    }
    let what = if plan.listen.is_empty() {
        format!("connect to {:?}", plan.connect)
    } else {
        format!("listen at {:?}", plan.listen)
    };
    zenoh::open(config).wait().map_err(network(what))
}

/// Options with every default filled in, and checked.
struct Plan<'a> {
    options: &'a Options,
    listen: Vec<String>,
    connect: Vec<String>,
    keys: Option<Keys>,
}

impl<'a> Plan<'a> {
    fn from_options(options: &'a Options) -> Result<Self, Error> {
        let given: Vec<&String> = options.listen.iter().chain(&options.connect).collect();
        for endpoint in &given {
            check_endpoint(endpoint)?;
        }
        let wants_keys = given.is_empty() || given.iter().any(|given| given.starts_with("tls/"));
        let keys = if wants_keys { Keys::of_options(options)? } else { None };
        if let (None, Some(endpoint)) =
            (&keys, given.iter().find(|endpoint| endpoint.starts_with("tls/")))
        {
            return Err(Error::NoKeys(
                (*endpoint).clone(),
                pairing::hint(&options.court, options.role),
            ));
        }
        let (mut listen, mut connect) = (options.listen.clone(), options.connect.clone());
        if given.is_empty() {
            let (here, there) = match (&keys, options.role) {
                (None, role) if role.is_listener() => (Some(DEFAULT_ENDPOINT), None),
                (None, _) => (None, Some(DEFAULT_ENDPOINT)),
                (Some(_), role) if role.is_listener() => (Some(DEFAULT_TLS_LISTEN), None),
                (Some(_), Role::Commander) => (None, Some(DEFAULT_TLS_LOCAL)),
                (Some(_), _) => (None, None),
            };
            listen.extend(here.map(str::to_owned));
            connect.extend(there.map(str::to_owned));
        }
        Ok(Self { options, listen, connect, keys })
    }

    fn settings(&self) -> Result<Vec<(&'static str, Value)>, Error> {
        let mode = match self.options.role {
            Role::Router => "router",
            // Peers pass messages on to and from clients, but not between peers.
            Role::Commander | Role::Controller => "client",
            _ => "peer",
        };
        // A client's session opens when it is connected: who commands is told when it is not.
        let connect_within_ms = match self.options.role {
            Role::Commander => COMMANDER_WITHIN_MS,
            _ => -1,
        };
        let mut settings = vec![
            ("mode", json!(mode)),
            ("listen/endpoints", json!(self.listen_endpoints())),
            ("connect/endpoints", json!(self.connect_endpoints())),
            ("connect/timeout_ms", json!(connect_within_ms)),
            ("connect/exit_on_failure", json!(connect_within_ms > 0)),
            (
                "connect/retry",
                json!({
                    "period_init_ms": 20,
                    "period_max_ms": PAUSE_MAX_MS,
                    "period_increase_factor": 2,
                }),
            ),
            ("scouting/gossip/enabled", json!(false)),
            ("transport/link/tx/lease", json!(LEASE_MS)),
            ("transport/link/tx/keep_alive", json!(4)),
            ("transport/unicast/open_timeout", json!(OPEN_MS)),
            ("transport/unicast/accept_timeout", json!(OPEN_MS)),
            ("transport/link/rx/max_message_size", json!(MAX_MESSAGE_BYTES)),
        ];
        settings.extend(self.scouting());
        settings.extend(self.regions());
        if let Some(keys) = &self.keys {
            settings.extend(keys.settings());
            settings.push(("transport/link/protocols", json!(["tls"])));
            settings.push(("access_control", access::rules(self.options)));
        } else {
            settings.push(("transport/link/protocols", json!(["tcp"])));
        }
        Ok(settings)
    }

    /// A router passes messages between regions, and not between the peers of one: it takes them
    /// to be connected with each other. Boards, fusions and dashboards are a region each.
    fn regions(&self) -> Option<(&'static str, Value)> {
        let region = match self.options.role {
            Role::Board(_) => "boards",
            Role::Fusion => "fusions",
            Role::Dashboard => "dashboards",
            Role::Commander | Role::Controller => return None,
            Role::Router => {
                let regions = ["boards", "fusions", "dashboards"];
                let mut south: Vec<Value> = regions
                    .iter()
                    .map(|name| json!({ "filters": [{ "region_names": [name] }] }))
                    .collect();
                south.push(json!({ "filters": [{ "modes": ["client"] }] }));
                return Some(("gateway", json!({ "south": south })));
            }
        };
        Some(("region_name", json!(region)))
    }

    /// Whether it must find who to connect to.
    fn is_seeker(&self) -> bool {
        self.keys.is_some() && self.connect.is_empty() && !self.options.role.is_listener()
    }

    fn connect_endpoints(&self) -> Vec<&String> {
        self.connect.iter().chain(&self.options.found).collect()
    }

    /// With the time a stranger may hold a place while it says nothing.
    fn listen_endpoints(&self) -> Vec<String> {
        let with_timeout = |endpoint: &String| match endpoint.starts_with("tls/") {
            true => format!("{endpoint}#tls_handshake_timeout_ms={OPEN_MS}"),
            false => endpoint.clone(),
        };
        self.listen.iter().map(with_timeout).collect()
    }

    fn scouting(&self) -> Vec<(&'static str, Value)> {
        let is_listener = self.options.role == Role::Fusion;
        let is_seeker = self.is_seeker();
        let found = if is_seeker { json!(["peer", "router"]) } else { json!([]) };
        vec![
            (
                "scouting/multicast/enabled",
                json!(is_seeker || (is_listener && self.keys.is_some())),
            ),
            (
                "scouting/multicast/address",
                json!(discovery::group_from_court(&self.options.court).to_string()),
            ),
            ("scouting/multicast/listen", json!(is_listener)),
            ("scouting/multicast/autoconnect", found),
        ]
    }
}

/// For what is late at once: it goes before everything else, and never waits for room.
pub(crate) fn real_time_publisher(
    session: &Session,
    key: OwnedKeyExpr,
) -> Result<Publisher<'static>, Error> {
    session
        .declare_publisher(key.clone())
        .congestion_control(CongestionControl::Drop)
        .priority(Priority::RealTime)
        .express(true)
        .wait()
        .map_err(network(format!("publish {key}")))
}

/// An endpoint is `tls/...`, or `tcp/...` of this machine.
fn check_endpoint(endpoint: &str) -> Result<(), Error> {
    let refused = |why: &str| Err(Error::Endpoint(endpoint.to_owned(), why.to_owned()));
    let Some((protocol, address)) = endpoint.split_once('/') else {
        return refused("expected tls/HOST:PORT");
    };
    let Some((host, port)) = address.rsplit_once(':') else {
        return refused("the port is missing, 7447 as a rule");
    };
    if port.parse::<u16>().is_err() {
        return refused("the port is no number up to 65535");
    }
    match protocol {
        "tls" => Ok(()),
        "tcp" if is_loopback(host) => Ok(()),
        "tcp" => refused(
            "without keys bridges meet on loopback only; make keys with scripts/pair and say tls/",
        ),
        _ => refused("expected tls/HOST:PORT, or tcp/127.0.0.1:PORT on one machine"),
    }
}

fn is_loopback(host: &str) -> bool {
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

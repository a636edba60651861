//! Who this process is → what others may say to it and hear of it, by the names in their
//! certificates.
//!
//! Zenoh asks for every message in both directions (default: no). Here a rule is a pair of keys
//! and the one who *speaks* there: publishes, declares queryables and liveliness tokens, answers.
//! The other end *hears*: subscribes, asks. Each end keeps to the same rules, so a board that does
//! not is refused where it connects.
//!
//! ```text
//! court/<c>/<cam>/**                  spoken by <c>/<cam>, heard by <c>/fusion
//! court/<c>/<cam>/ping                spoken by <c>/fusion, heard by <c>/<cam>
//! court/<c>/fusion/**                 spoken by <c>/fusion, heard by <c>/<cam>
//! court/<c>/{shot,correction}         spoken by <c>/fusion, heard by <c>/dashboard, */dashboard,
//!                                     <c>/controller
//! court/<c>/wanted                    spoken by <c>/controller, heard by <c>/fusion
//! court/<c>/launcher/**               spoken and heard by <c>/controller, <c>/fusion; heard by
//!                                     dashboards
//! court/<c>/<cam>/health              as well heard by those
//! ```
//!
//! A router (`*/router`) speaks for everybody and holds everybody to these rules.

use crate::session::{Options, Role};
use serde_json::{Value, json};
use shm_layout::Camera;

/// What one peer may do; keys are Zenoh's key expressions.
#[derive(Debug, Default)]
struct Peer {
    /// Common names of certificates.
    names: Vec<String>,
    /// Keys it speaks under.
    speaks: Vec<String>,
    /// Keys we speak under to it.
    hears: Vec<String>,
    /// Wider expressions under which it may ask for what it hears.
    looks: Vec<String>,
    /// Wider expressions under which we may ask for what it speaks.
    is_looked_at: Vec<String>,
}

/// Zenoh's `access_control` for a process with keys.
#[must_use]
pub fn rules(options: &Options) -> Value {
    let (mut rules, mut subjects, mut policies) = (Vec::new(), Vec::new(), Vec::new());
    for (idx, peer) in peers(options).into_iter().enumerate() {
        let mut ids = Vec::new();
        let subject = format!("subject{idx}");
        for (part, keys, flows) in [
            (Part::Speaks, &peer.speaks, ["ingress", "egress"]),
            (Part::Speaks, &peer.hears, ["egress", "ingress"]),
            (Part::Looks, &peer.is_looked_at, ["egress", "ingress"]),
            (Part::Looks, &peer.looks, ["ingress", "egress"]),
        ] {
            if keys.is_empty() {
                continue;
            }
            let messages = part.messages();
            for (messages, flow) in messages.into_iter().zip(flows) {
                if messages.is_empty() {
                    continue;
                }
                let id = format!("rule{}", rules.len());
                rules.push(json!({
                    "id": id,
                    "permission": "allow",
                    "messages": messages,
                    "flows": [flow],
                    "key_exprs": keys,
                }));
                ids.push(id);
            }
        }
        subjects.push(json!({ "id": subject, "cert_common_names": peer.names }));
        policies.push(json!({ "rules": ids, "subjects": [subject] }));
    }
    json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    })
}

#[derive(Clone, Copy)]
enum Part {
    Speaks,
    Looks,
}

impl Part {
    /// Messages of the one who speaks, and of the one who hears.
    fn messages(self) -> [&'static [&'static str]; 2] {
        const SPEAKING: &[&str] =
            &["put", "delete", "reply", "liveliness_token", "declare_queryable"];
        const HEARING: &[&str] =
            &["declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber"];
        const LOOKING: &[&str] =
            &["declare_subscriber", "liveliness_query", "declare_liveliness_subscriber"];
        match self {
            Self::Speaks => [SPEAKING, HEARING],
            Self::Looks => [LOOKING, &[]],
        }
    }
}

fn peers(options: &Options) -> Vec<Peer> {
    let court = options.court.as_str();
    match options.role {
        Role::Board(camera) => vec![Peer {
            names: vec![format!("{court}/fusion"), "*/router".to_owned()],
            speaks: to_board(court, camera),
            hears: of_board(court, camera),
            looks: vec![format!("court/{court}/**")],
            is_looked_at: Vec::new(),
        }],
        Role::Fusion | Role::Commander => fusions_peers(court),
        Role::Controller => vec![Peer {
            names: vec![format!("{court}/fusion")],
            speaks: to_controller(court),
            hears: of_controller(court),
            looks: Vec::new(),
            is_looked_at: Vec::new(),
        }],
        Role::Dashboard => {
            let courts = std::iter::once(court).chain(options.courts.iter().map(String::as_str));
            let mut names: Vec<String> = courts.map(|court| format!("{court}/fusion")).collect();
            names.push("*/router".to_owned());
            vec![Peer {
                names,
                speaks: to_dashboard("*"),
                hears: Vec::new(),
                looks: Vec::new(),
                is_looked_at: Vec::new(),
            }]
        }
        Role::Router => {
            let mut peers: Vec<Peer> =
                options.courts.iter().flat_map(|court| routers_peers(court)).collect();
            peers.push(dashboard("*/dashboard", "*"));
            peers
        }
    }
}

fn fusions_peers(court: &str) -> Vec<Peer> {
    let mut peers: Vec<Peer> = Camera::BOTH.map(|camera| board(court, camera)).into();
    let boards = Camera::BOTH.iter().flat_map(|camera| of_board(court, *camera));
    peers.push(Peer {
        names: vec!["*/router".to_owned()],
        speaks: boards.collect(),
        hears: by_fusion(court),
        looks: vec![format!("court/{court}/**"), "court/*/*".to_owned()],
        is_looked_at: vec![format!("court/{court}/**")],
    });
    // A command, sent by another process of fusion's own computer.
    let all = || vec![format!("court/{court}/**")];
    peers.push(Peer {
        names: vec![format!("{court}/fusion")],
        speaks: all(),
        hears: all(),
        looks: Vec::new(),
        is_looked_at: Vec::new(),
    });
    peers.push(Peer {
        names: vec![format!("{court}/controller")],
        speaks: of_controller(court),
        hears: to_controller(court),
        looks: Vec::new(),
        is_looked_at: Vec::new(),
    });
    peers.push(dashboard(&format!("{court}/dashboard"), court));
    peers.push(dashboard("*/dashboard", court));
    peers
}

fn routers_peers(court: &str) -> Vec<Peer> {
    let mut peers: Vec<Peer> = Camera::BOTH.map(|camera| board(court, camera)).into();
    let boards = Camera::BOTH.iter().flat_map(|camera| of_board(court, *camera));
    peers.push(Peer {
        names: vec![format!("{court}/fusion")],
        speaks: by_fusion(court),
        hears: boards.collect(),
        looks: vec![format!("court/{court}/**")],
        is_looked_at: vec![format!("court/{court}/**"), "court/*/*".to_owned()],
    });
    peers.push(dashboard(&format!("{court}/dashboard"), court));
    peers
}

/// A board, as fusion and routers see it.
fn board(court: &str, camera: Camera) -> Peer {
    Peer {
        names: vec![format!("{court}/{camera}")],
        speaks: of_board(court, camera),
        hears: to_board(court, camera),
        looks: Vec::new(),
        is_looked_at: vec![format!("court/{court}/**")],
    }
}

/// A dashboard, as fusion and routers see it.
fn dashboard(name: &str, court: &str) -> Peer {
    Peer {
        names: vec![name.to_owned()],
        speaks: Vec::new(),
        hears: to_dashboard(court),
        looks: to_dashboard("*"),
        is_looked_at: Vec::new(),
    }
}

fn of_board(court: &str, camera: Camera) -> Vec<String> {
    vec![format!("court/{court}/{camera}/**")]
}

fn to_board(court: &str, camera: Camera) -> Vec<String> {
    vec![format!("court/{court}/{camera}/ping"), format!("court/{court}/fusion/**")]
}

fn by_fusion(court: &str) -> Vec<String> {
    let mut keys: Vec<String> =
        Camera::BOTH.map(|camera| format!("court/{court}/{camera}/ping")).into();
    keys.extend(
        ["fusion/**", "shot", "correction", "launcher/**"]
            .map(|key| format!("court/{court}/{key}")),
    );
    keys
}

/// Commands and answers go both ways: the launcher or who commands it may be there.
fn of_controller(court: &str) -> Vec<String> {
    ["wanted", "launcher/**"].map(|key| format!("court/{court}/{key}")).into()
}

fn to_controller(court: &str) -> Vec<String> {
    ["shot", "correction", "launcher/**"].map(|key| format!("court/{court}/{key}")).into()
}

fn to_dashboard(court: &str) -> Vec<String> {
    ["shot", "correction", "launcher/**", "*/health"]
        .map(|key| format!("court/{court}/{key}"))
        .into()
}

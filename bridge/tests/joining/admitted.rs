//! Paired peers: what each may do works, directly, through a router, and found by multicast.

use crate::court::{Court, LEFT, RIGHT, all_arrive, free_endpoint, heard, wait_for, was_said};
use bridge::session::{self, Options, Role};
use std::process::Command;
use zenoh::{Session, Wait};

const N_MESSAGES: u64 = 50;

fn enough(idx: u64) -> bool {
    idx > N_MESSAGES
}

#[test]
fn paired_peers_exchange_all_that_they_have_to() {
    let court = Court::new();
    let fusion = court.fusion();
    let board = court.peer(LEFT, court.keys("rose/left", LEFT));
    converse(&fusion, &board);
    assert!(!was_said("rose/left may not"));
}

/// What a board and fusion do with each other.
fn converse(fusion: &Session, board: &Session) {
    for key in ["candidates", "frames-info", "health", "pong"] {
        all_arrive(board, &format!("court/rose/left/{key}"), fusion, enough);
    }
    all_arrive(fusion, "court/rose/left/ping", board, enough);
    let _here = board.liveliness().declare_token("court/rose/left/alive/v7").wait().unwrap();
    let _there = fusion.liveliness().declare_token("court/rose/fusion/alive/v7").wait().unwrap();
    wait_for("the board's liveliness", || is_alive(fusion, "court/rose/left/alive/*"));
    wait_for("fusion's liveliness", || is_alive(board, "court/rose/fusion/alive/*"));
    let _answers = answering(board, "court/rose/left/missing");
    wait_for("an answer", || answer(fusion, "court/rose/left/missing").is_some());
}

fn is_alive(session: &Session, key: &str) -> bool {
    session.liveliness().get(key).wait().unwrap().recv().is_ok()
}

fn answering(session: &Session, key: &'static str) -> impl Sized {
    session
        .declare_queryable(key)
        .callback(move |query| query.reply(key, "done").wait().unwrap())
        .wait()
        .unwrap()
}

fn answer(session: &Session, key: &str) -> Option<String> {
    let reply = session.get(key).wait().unwrap().recv().ok()?;
    Some(reply.result().ok()?.payload().try_to_string().unwrap().into_owned())
}

#[test]
fn a_command_beside_fusion_reaches_a_board() {
    let court = Court::new();
    let _fusion = court.fusion();
    let board = court.peer(RIGHT, court.keys("rose/right", RIGHT));
    let _answers = answering(&board, "court/rose/right/command");
    let role = Role::Commander;
    let commander = court.peer(role, court.keys("rose/fusion", role));
    wait_for("an answer", || {
        answer(&commander, "court/rose/right/command").as_deref() == Some("done")
    });
}

#[test]
fn a_command_reaches_a_board_without_keys_on_one_machine() {
    let endpoint = free_endpoint().replace("tls", "tcp");
    let open = |role: Role| {
        let mut options = Options::new("rose", role);
        let endpoints = vec![endpoint.clone()];
        match role {
            Role::Fusion => options.listen = endpoints,
            _ => options.connect = endpoints,
        }
        session::open(&options).unwrap()
    };
    let (_fusion, board, commander) = (open(Role::Fusion), open(LEFT), open(Role::Commander));
    let _answers = answering(&board, "court/rose/left/command");
    wait_for("an answer", || answer(&commander, "court/rose/left/command").is_some());
}

#[test]
fn a_router_joins_courts_and_holds_them_to_the_rules() {
    let club = Court::new();
    let router = session::open(&Options {
        listen: vec![club.endpoint.clone()],
        keys: Some(club.keys("*/router", Role::Router)),
        courts: vec!["rose".to_owned(), "lily".to_owned()],
        ..Options::new("club", Role::Router)
    })
    .unwrap();
    let peer = |court: &str, role: Role, name: &str| {
        let keys = Some(club.keys(name, role));
        let connect = vec![club.endpoint.clone()];
        session::open(&Options { connect, keys, ..Options::new(court, role) }).unwrap()
    };
    let fusion = peer("rose", Role::Fusion, "rose/fusion");
    let board = peer("rose", LEFT, "rose/left");
    let lilys = peer("lily", Role::Fusion, "lily/fusion");
    let dashboard = peer("club", Role::Dashboard, "*/dashboard");
    converse(&fusion, &board);
    let shots = heard(&dashboard, "court/*/shot");
    all_arrive(&fusion, "court/rose/shot", &dashboard, enough);
    all_arrive(&lilys, "court/lily/shot", &dashboard, enough);
    let n_shots = shots.try_iter().count() as u64;
    assert_eq!(n_shots, 2 * (N_MESSAGES + 2));
    // A board of lily's without rules of its own speaks for rose and is not heard.
    let lawless = club.lawless(RIGHT, Some(&club.keys("lily/right", RIGHT)));
    let overheard = heard(&lawless, "court/rose/**");
    all_arrive(&board, "court/rose/left/candidates", &fusion, |idx| {
        lawless.put("court/rose/left/candidates", "evil").wait().unwrap();
        enough(idx)
    });
    assert!(overheard.try_iter().all(|(_, text)| text == "evil"));
    drop(router);
}

#[test]
fn a_router_joins_courts_without_keys_on_one_machine() {
    let endpoint = free_endpoint().replace("tls", "tcp");
    let open = |court: &str, role: Role| {
        let mut options = Options::new(court, role);
        let endpoints = vec![endpoint.clone()];
        match role {
            Role::Router => options.listen = endpoints,
            _ => options.connect = endpoints,
        }
        session::open(&options).unwrap()
    };
    let _router = open("club", Role::Router);
    let (fusion, board) = (open("rose", Role::Fusion), open("rose", LEFT));
    let dashboard = open("club", Role::Dashboard);
    converse(&fusion, &board);
    all_arrive(&fusion, "court/rose/shot", &dashboard, enough);
}

#[test]
fn addresses_beyond_this_machine_need_keys_and_say_how_to_make_them() {
    let refusal = |role: Role, connect: &str| {
        let connect = vec![connect.to_owned()];
        let options = Options { connect, ..Options::new("no-such-court", role) };
        session::open(&options).unwrap_err().to_string()
    };
    let said = refusal(LEFT, "tls/192.0.2.7:7447");
    assert!(said.contains("scripts/pair board no-such-court left"), "{said}");
    let said = refusal(Role::Fusion, "tls/192.0.2.7:7447");
    assert!(said.contains("scripts/pair court no-such-court"), "{said}");
    let said = refusal(LEFT, "tcp/192.0.2.7:7447");
    assert!(said.contains("without keys bridges meet on loopback only"), "{said}");
    for endpoint in ["udp/127.0.0.1:7447", "tls/here", "127.0.0.1:7447", "tcp/127.0.0.1:x#a=b"] {
        assert!(refusal(LEFT, endpoint).starts_with(endpoint));
    }
}

#[test]
fn a_board_finds_its_fusion_and_no_other() {
    let has_network = std::fs::read_to_string("/proc/net/route")
        .is_ok_and(|routes| routes.lines().skip(1).any(|line| !line.is_empty()));
    if !has_network {
        eprintln!("skipped: this machine has no network to look in");
        return;
    }
    let court = Court::new();
    // A name of this run's own: others may test in the same network.
    let name = format!("rose-{}", std::process::id());
    let port = free_endpoint().rsplit_once(':').unwrap().1.to_owned();
    let fusion = session::open(&Options {
        listen: vec![format!("tls/0.0.0.0:{port}")],
        keys: Some(court.keys(&format!("{name}/fusion"), Role::Fusion)),
        ..Options::new(&name, Role::Fusion)
    })
    .unwrap();
    let board = session::open(&Options {
        keys: Some(court.keys(&format!("{name}/left"), LEFT)),
        ..Options::new(&name, LEFT)
    })
    .unwrap();
    let other = format!("lily-{}", std::process::id());
    let stray = session::open(&Options {
        keys: Some(court.keys(&format!("{other}/left"), LEFT)),
        ..Options::new(&other, LEFT)
    })
    .unwrap();
    all_arrive(&board, &format!("court/{name}/left/candidates"), &fusion, enough);
    assert_eq!(stray.info().peers_zid().wait().count(), 0);
}

#[test]
fn follow_prints_the_shots_of_all_courts_as_lines() {
    let endpoint = free_endpoint().replace("tls", "tcp");
    let fusion = session::open(&Options {
        listen: vec![endpoint.clone()],
        ..Options::new("rose", Role::Fusion)
    })
    .unwrap();
    let mut follow = Command::new(env!("CARGO_BIN_EXE_bridge"))
        .args(["--with-parent", "follow", "--connect", &endpoint])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let publisher = fusion.declare_publisher("court/rose/shot").wait().unwrap();
    wait_for("a follower", || publisher.matching_status().wait().unwrap().matching());
    publisher.put("{\"speed\":71.0}").wait().unwrap();
    let mut line = String::new();
    let stdout = follow.stdout.take().unwrap();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut line).unwrap();
    assert_eq!(line, "{\"court\":\"rose\",\"shot\":\"{\\\"speed\\\":71.0}\"}\n");
    follow.kill().unwrap();
    follow.wait().unwrap();
}

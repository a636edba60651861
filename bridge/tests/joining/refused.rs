//! Strangers: who has no keys, wrong keys, old keys, another's keys, or speaks out of turn.

use crate::court::{
    Court, LEFT, RIGHT, all_arrive, free_endpoint, heard, stranger, wait_for, was_said,
};
use bridge::session::{self, Options, Role};
use std::io::Write;
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use zenoh::{Session, Wait};

const LEFTS: &str = "court/rose/left/candidates";
const RIGHTS: &str = "court/rose/right/candidates";
/// Messages of the paired board after the stranger was noticed.
const N_MORE: u64 = 50;

/// While a stranger speaks, every message of a paired right board arrives and none of the
/// stranger's, until it was said that it is refused and for a while after.
fn holds_against(court: &Court, fusion: &Session, said: &[&str], mut speak: impl FnMut()) {
    let board = court.peer(RIGHT, court.keys("rose/right", RIGHT));
    let mut noticed_at = None;
    all_arrive(&board, RIGHTS, fusion, |idx| {
        speak();
        if noticed_at.is_none() && said.iter().all(|words| was_said(words)) {
            noticed_at = Some(idx);
        }
        noticed_at.is_some_and(|noticed_at| idx > noticed_at + N_MORE)
    });
}

fn evil(session: &Session) {
    for key in [LEFTS, RIGHTS] {
        session.put(key, "evil").wait().unwrap();
    }
}

#[test]
fn keys_of_another_court_are_refused() {
    let (court, other) = (Court::new(), Court::new());
    let fusion = court.fusion();
    let identity = other.authority.identity("rose/left", LEFT).unwrap();
    let foreign = court.lawless(LEFT, Some(&court.keys_of(LEFT, identity)));
    let told = format!("{}: it refuses this machine's keys", court.endpoint);
    let said = ["somebody with keys of another court", &told];
    holds_against(&court, &fusion, &said, || evil(&foreign));
}

#[test]
fn who_trusts_another_court_goes_away() {
    let (court, other) = (Court::new(), Court::new());
    let fusion = court.fusion();
    let lost = Options {
        connect: vec![court.endpoint.clone()],
        keys: Some(other.keys("rose/left", LEFT)),
        ..Options::new("rose", LEFT)
    };
    let lost = session::open(&lost).unwrap();
    let told = format!("{}: who listens there is of another court", court.endpoint);
    let said = ["does not take this computer for its fusion", &told];
    holds_against(&court, &fusion, &said, || evil(&lost));
}

#[test]
fn no_keys_are_refused() {
    let court = Court::new();
    let fusion = court.fusion();
    let keyless = court.lawless(LEFT, None);
    holds_against(&court, &fusion, &["somebody without keys"], || evil(&keyless));
}

#[test]
fn expired_keys_are_refused() {
    let court = Court::new();
    let fusion = court.fusion();
    let in_2023 = Duration::from_secs(1_700_000_000);
    let identity = court.authority.identity_until("rose/left", LEFT, in_2023).unwrap();
    let expired = court.lawless(LEFT, Some(&court.keys_of(LEFT, identity)));
    let told = format!("{}: this machine's keys have expired", court.endpoint);
    let said = ["somebody whose keys have expired", &told];
    holds_against(&court, &fusion, &said, || evil(&expired));
}

#[test]
fn plain_tcp_and_garbage_disturb_nobody() {
    let court = Court::new();
    let fusion = court.fusion();
    let plain = stranger(&court.endpoint.replace("tls", "tcp"), Vec::new());
    let mut silent = Vec::new();
    let mut garbage = vec![0xa5_u8; 3000];
    let said = [
        "something else than TLS",
        "somebody connected and said nothing",
        "somebody connected, said nothing and went",
    ];
    holds_against(&court, &fusion, &said, || {
        evil(&plain);
        let address = court.endpoint.trim_start_matches("tls/");
        let mut stream = TcpStream::connect(address).unwrap();
        garbage.rotate_left(1);
        garbage[0] = garbage[0].wrapping_mul(141).wrapping_add(7);
        let _ = stream.write_all(&garbage); // it may hang up at any byte
        drop(TcpStream::connect(address).unwrap());
        if silent.len() < 100 {
            silent.push(TcpStream::connect(address).unwrap());
        }
    });
}

#[test]
fn a_board_joins_while_strangers_hammer() {
    let court = Court::new();
    let fusion = court.fusion();
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            // Some two hundred a second, of which none is ever let in.
            while !is_over.load(Ordering::Relaxed) {
                let address = court.endpoint.trim_start_matches("tls/");
                let mut stream = TcpStream::connect(address).unwrap();
                let _ = stream.write_all(b"no TLS at all");
                std::thread::sleep(Duration::from_millis(5));
            }
        });
        wait_for("strangers", || was_said("something else than TLS"));
        let board = court.peer(LEFT, court.keys("rose/left", LEFT));
        all_arrive(&board, LEFTS, &fusion, |idx| idx > N_MORE);
        is_over.store(true, Ordering::Relaxed);
    });
}

#[test]
fn a_board_speaks_for_its_own_camera_only() {
    let court = Court::new();
    let fusion = court.fusion();
    let left = court.lawless(LEFT, Some(&court.keys("rose/left", LEFT)));
    let said = ["rose/left may not do this and is not listened to: Put on court/rose/right"];
    holds_against(&court, &fusion, &said, || {
        left.put(RIGHTS, "evil").wait().unwrap();
        left.put("court/rose/shot", "evil").wait().unwrap();
        left.put("court/lily/left/candidates", "evil").wait().unwrap();
    });
    all_arrive(&left, LEFTS, &fusion, |idx| idx > N_MORE);
}

#[test]
fn a_dashboard_hears_shots_and_says_nothing() {
    let court = Court::new();
    let fusion = court.fusion();
    let role = Role::Dashboard;
    let dashboard = court.lawless(role, Some(&court.keys("rose/dashboard", role)));
    let overheard = heard(&dashboard, "court/rose/**");
    // Fusion tells it of no subscriber of candidates, so Zenoh does not even send them.
    holds_against(&court, &fusion, &[], || {
        evil(&dashboard);
        fusion.put("court/rose/right/ping", "for the board alone").wait().unwrap();
    });
    all_arrive(&fusion, "court/rose/shot", &dashboard, |idx| idx > N_MORE);
    // Its own words come back to it; of the others' it has shots alone.
    let others = overheard.try_iter().filter(|(_, text)| text != "evil");
    let keys: Vec<String> = others.map(|(key, _)| key).collect();
    assert!(keys.iter().all(|key| key == "court/rose/shot"), "{keys:?}");
}

#[test]
fn a_boards_key_cannot_pose_as_fusion() {
    let court = Court::new();
    let fusion = court.fusion();
    let stolen = court.authority.identity("rose/fusion", LEFT).unwrap();
    let impostor_at = free_endpoint();
    let impostor = session::open(&Options {
        listen: vec![impostor_at.clone()],
        keys: Some(court.keys_of(Role::Fusion, stolen)),
        ..Options::new("rose", Role::Fusion)
    })
    .unwrap();
    fooled_by_none(
        &court,
        &fusion,
        &impostor,
        &impostor_at,
        &[&format!("{impostor_at}: who listens there has a board's keys")],
    );
}

/// What a certificate of a public authority amounts to, which Zenoh takes at the connecting side.
#[test]
fn a_server_of_another_name_is_told_nothing() {
    let court = Court::new();
    let fusion = court.fusion();
    let identity = court.authority.identity("rose.example.org", Role::Fusion).unwrap();
    let impostor_at = free_endpoint();
    let impostor = session::open(&Options {
        listen: vec![impostor_at.clone()],
        keys: Some(court.keys_of(Role::Fusion, identity)),
        ..Options::new("rose", Role::Fusion)
    })
    .unwrap();
    let said = ["somebody is connected whose keys are good, but not for here"];
    fooled_by_none(&court, &fusion, &impostor, &impostor_at, &said);
}

/// A board that connects to an impostor and to fusion speaks with fusion alone.
fn fooled_by_none(court: &Court, fusion: &Session, impostor: &Session, at: &str, said: &[&str]) {
    let overheard = heard(impostor, "court/rose/**");
    let board = session::open(&Options {
        connect: vec![at.to_owned(), court.endpoint.clone()],
        keys: Some(court.keys("rose/right", RIGHT)),
        ..Options::new("rose", RIGHT)
    })
    .unwrap();
    let mut noticed_at = None;
    all_arrive(&board, RIGHTS, fusion, |idx| {
        impostor.put("court/rose/right/ping", "evil").wait().unwrap();
        if noticed_at.is_none() && said.iter().all(|words| was_said(words)) {
            noticed_at = Some(idx);
        }
        noticed_at.is_some_and(|noticed_at| idx > noticed_at + N_MORE)
    });
    all_arrive(fusion, "court/rose/right/ping", &board, |idx| {
        impostor.put("court/rose/right/ping", "evil").wait().unwrap();
        idx > N_MORE
    });
    // Its own words come back to it; of the board's and fusion's it has none.
    assert!(overheard.try_iter().all(|(_, text)| text == "evil"));
}

//! Who may command a board, with real sessions over TLS on loopback: a commander, a board, and
//! fusion between them.

#![allow(clippy::unwrap_used)] // all of it is test code; the lint only knows #[test] functions

mod keyed;

use bridge::command::commander::{Failure, ask};
use bridge::command::seen::Seen;
use bridge::command::{self, Serving, Setting, relay};
use bridge::keys;
use bridge::session::Role;
use bridge::wire::command::{Answer, Command};
use keyed::Court;
use shm_layout::Camera;
use shm_layout::services::{Domain, Place};
use shm_layout::stop::Stop;
use std::sync::Arc;
use zenoh::{Session, Wait};

const LEFT: Role = Role::Board(Camera::Left);

impl Court {
    fn serve(&self, session: &Session) -> (Serving, impl Sized) {
        let setting = Setting {
            court: self.name.clone(),
            camera: Camera::Left,
            recordings: self.folder.path().join("recordings"),
            seen: Arc::new(Seen::default()),
        };
        let serving = command::serve(session, setting, Stop::on_signals(false).unwrap()).unwrap();
        let token = keys::alive(&self.name, Place::Board(Camera::Left)).unwrap();
        (serving, session.liveliness().declare_token(token).wait().unwrap())
    }
}

#[test]
fn a_commander_beside_fusion_is_answered_and_another_board_is_not_heard() {
    let court = Court::new("commanding");
    let (fusion, board) = (court.session(Role::Fusion), court.session(LEFT));
    let here = fusion.liveliness().declare_token(keys::alive(&court.name, Place::Fusion).unwrap());
    let _here = here.wait().unwrap();
    let _relay = relay::serve(&fusion, &court.name).unwrap();
    let (serving, token) = court.serve(&board);
    let commander = court.session(Role::Commander);
    let answer = ask(&commander, &court.name, Camera::Left, &Command::Health).unwrap();
    assert!(matches!(answer, Answer::Health(health) if health.n_frames == 0));
    let refused = |command| match ask(&commander, &court.name, Camera::Left, &command) {
        Err(Failure::Refused(why)) => why,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(Command::Stop), "no capture runs on this board");
    assert_eq!(refused(Command::LearnBackground), "no worker runs on this board");
    assert!(refused(Command::Record { seconds: 5 }).contains("no frame has come yet"));
    assert!(refused(Command::Record { seconds: 601 }).contains("1 to 600 s"));
    assert!(refused(Command::Image).contains("no frame came within"));
    let absent = ask(&commander, &court.name, Camera::Right, &Command::Health);
    assert!(matches!(absent, Err(Failure::NotThere)), "{absent:?}");

    let other = court.session(Role::Board(Camera::Right));
    let unheard = ask(&other, &court.name, Camera::Left, &Command::Shutdown);
    assert!(!matches!(unheard, Ok(_) | Err(Failure::Refused(_))), "{unheard:?}");
    for key in [
        keys::of_board(&court.name, Camera::Left, "command").unwrap(),
        keys::command(&court.name, Camera::Left).unwrap(),
    ] {
        let replies = other.get(&key).payload(Command::Shutdown.to_bytes()).wait().unwrap();
        assert!(replies.recv().is_err(), "a board was heard at {key}");
    }
    assert!(ask(&commander, &court.name, Camera::Left, &Command::Health).is_ok());
    drop((serving, token));
    Domain::new(&court.name, Place::Board(Camera::Left)).unwrap().close().unwrap();
}

//! A controller and a launcher on another computer, over TLS on loopback: what they say stands in
//! shared memory, what stands there they hear, and nothing goes round.

#![allow(clippy::unwrap_used)] // all of it is test code; the lint only knows #[test] functions

mod keyed;

use bridge::launcher::{Exchange, Passed};
use bridge::session::Role;
use keyed::Court;
use shm_layout::launcher::{
    CommandKind, LauncherAnswer, LauncherCommand, LauncherState, Limits, NONE, Settings, Why,
};
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

/// Only a hung test comes near this.
const PATIENCE: Duration = Duration::from_secs(60);

impl Court {
    fn key(&self, what: &str) -> String {
        format!("court/{}/{what}", self.name)
    }

    fn heard(&self, session: &Session, what: &str) -> Receiver<String> {
        let (sender, receiver) = channel();
        let subscriber = session.declare_subscriber(self.key(what)).callback(move |sample| {
            let _ = sender.send(sample.payload().try_to_string().unwrap().into_owned());
        });
        subscriber.background().wait().unwrap();
        receiver
    }
}

fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let started = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(started.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::yield_now();
    }
}

const FIT: Settings = Settings::from_array([20.0, 0.2, 0.0, -30.0]);

fn answer(command_idx: u64) -> LauncherAnswer {
    let (state, why) = (LauncherState::Fired.code(), Why::Nothing.code());
    let limits = Limits { min: FIT, max: FIT };
    LauncherAnswer { command_idx, at_ns: now_ns(), state, why, settings: FIT, limits }
}

#[test]
fn a_controller_elsewhere_wants_commands_and_hears_as_if_it_were_here() {
    let court = Court::new("launch");
    let domain = Domain::new(&court.name, Place::Fusion).unwrap();
    let member = domain.join("bridge").unwrap();
    let fusion = court.session(Role::Fusion);
    let mut exchange = Exchange::open(&fusion, &court.name, &member).unwrap();
    let commands = member.launcher_commands().unwrap();
    let (here, told) = (commands.writer().unwrap(), commands.reader().unwrap());
    let answers = member.launcher_answers().unwrap();
    let (launcher, answered) = (answers.writer().unwrap(), answers.reader().unwrap());
    let wanted = member.wanted().unwrap().reader().unwrap();
    let texts = member.corrections_json().unwrap().writer().unwrap();

    let controller = court.session(Role::Controller);
    let heard_commands = court.heard(&controller, "launcher/command");
    let heard_answers = court.heard(&controller, "launcher/answer");
    let heard_corrections = court.heard(&controller, "correction");
    let dashboard = court.session(Role::Dashboard);
    let seen = court.heard(&dashboard, "launcher/answer");

    // Out: what stands in shared memory, once the network is there.
    wait_for("a correction", || {
        texts.send("{\"schema\":\"correction/1\"}").unwrap();
        exchange.pass().unwrap();
        heard_corrections.try_recv().ok()
    });
    wait_for("an answer on the dashboard", || {
        launcher.send(answer(7)).unwrap();
        exchange.pass().unwrap();
        seen.try_recv().ok().filter(|text| text.contains("\"command_idx\":7"))
    });
    let fired = wait_for("an answer", || heard_answers.try_recv().ok());
    assert!(fired.contains("\"state\":\"fired\""), "{fired}");

    // In: what is wanted and commanded over there.
    let put = |what: &str, text: String| controller.put(court.key(what), text).wait().unwrap();
    put(
        "wanted",
        r#"{"schema":"wanted/1","wanted_idx":3,"landing_m":[1.0,20.0],"speed_m_s":22.0}"#
            .to_owned(),
    );
    put("launcher/command", "{}".to_owned());
    put("launcher/command", format!("\"{}\"", "x".repeat(10_000)));
    let fire = |idx: u64| {
        format!(
            r#"{{"schema":"launcher-command/1","command_idx":{idx},"kind":"fire","settings":
            {{"speed_m_s":20,"elevation_rad":0.2,"azimuth_rad":0,"backspin_rad_s":-30}}}}"#
        )
    };
    for idx in 0..10 {
        put("launcher/command", fire(idx));
    }
    let mut came: Vec<LauncherCommand> = Vec::new();
    wait_for("commands", || {
        exchange.pass().unwrap();
        came.extend(std::iter::from_fn(|| told.receive().unwrap()).map(|command| *command));
        (came.len() >= 10).then_some(())
    });
    assert_eq!(came.iter().map(|c| c.command_idx).collect::<Vec<_>>(), (0..10).collect::<Vec<_>>());
    assert!(came.iter().all(|c| c.settings == FIT && c.correction_idx == NONE));
    let wish = wait_for("a wish", || wanted.receive().unwrap().map(|wish| *wish));
    assert_eq!((wish.wanted_idx, wish.landing_in_court_m), (3, [1.0, 20.0]));
    while answered.receive().unwrap().is_some() {}
    put("launcher/answer", bridge::launcher::json::text_from_answer(&answer(9), now_ns()).unwrap());
    let answer_in = wait_for("an answer from there", || {
        exchange.pass().unwrap();
        answered.receive().unwrap().map(|answer| *answer)
    });
    assert_eq!((answer_in.command_idx, answer_in.settings), (9, FIT));

    // Nothing went round: a command of here is the first that the controller hears from us.
    let kind = CommandKind::EmergencyStop.code();
    let stop = LauncherCommand { kind, command_idx: 99, ..came[0] };
    here.send(stop).unwrap();
    let first_from_us = wait_for("the stop", || {
        exchange.pass().unwrap();
        heard_commands.try_iter().find(|text| text.contains("stop"))
    });
    assert!(first_from_us.contains("\"command_idx\":99"), "{first_from_us}");
    let Passed { n_in, n_refused, n_out, .. } = exchange.passed();
    assert_eq!((n_in, n_refused), (12, 2));
    assert!(n_out >= 2, "{n_out}");
    // What it may not say is not heard: only fusion tells of shots.
    let shots = court.heard(&fusion, "shot");
    put("shot", "evil".to_owned());
    put("wanted", "{}".to_owned());
    wait_for("a refusal", || {
        exchange.pass().unwrap();
        (exchange.passed().n_refused == 3).then_some(())
    });
    assert_eq!(shots.try_iter().count(), 0);
    drop((told, here, answered, launcher, wanted, texts, commands, answers, exchange, member));
    for session in [controller, dashboard, fusion] {
        session.close().wait().unwrap();
    }
    assert_eq!(domain.close().unwrap(), Vec::<String>::new());
}

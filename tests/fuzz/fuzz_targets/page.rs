//! Any request is answered by the page, and never with 500, which is what a panic becomes: whoever
//! asks wrongly is told so.
//!
//! A line `METHOD PATH`, lines `name: value`, an empty line, the body. With the right host and
//! token unless it brings its own: else one random request in 2^64 gets past the walls.
#![no_main]

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::http::Request;
use fusion::Rig;
use fusion::aim::Machine;
use libfuzzer_sys::fuzz_target;
use page::api::{Hall, router};
use page::desk::{Desk, World};
use page::drill::DrillHandle;
use page::drills::Drills;
use page::guard::Guard;
use page::heard::Spots;
use page::history::History;
use page::setup::{Place, Setup};
use std::path::Path;
use std::sync::Arc;
use tokio::runtime::Runtime;
use tower::ServiceExt as _;

const RIG: &str = include_str!("../../../fusion/rigs/desk.toml");
const MACHINE: &str = include_str!("../../../fusion/rigs/machine.toml");

/// Most bytes of an answer: all files of the page are smaller.
const MAX_ANSWER_BYTES: usize = 8 << 20;

struct Court {
    router: Router,
    runtime: Runtime,
    _folder: tempfile::TempDir,
}

fn desk_in(folder: &Path) -> anyhow::Result<Desk> {
    let rig = Rig::from_file_text("desk.toml", RIG)?;
    let physics = Some(rig.physics());
    let world = World {
        court: "fuzz".to_owned(),
        rig: Some(rig),
        machine: Some(Machine::from_file_text("machine.toml", MACHINE)?),
        physics,
    };
    let drill = DrillHandle::new(Drills::open(&folder.join("drills"))?);
    drill.close(); // there is no machine, and nobody waits for it
    let setup = Setup::new(Place { data: folder.to_owned(), ..Place::default() });
    let history = History::open(&folder.join("history.sqlite"))?;
    Ok(Desk::new(world, history, Spots::default(), drill, setup)?)
}

fn court() -> Court {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let desk = desk_in(folder.path()).expect("a page can be opened");
    let guard = Guard::new("127.0.0.1:8080".parse().expect("an address"), &[], "secret".to_owned());
    let router = router(Hall { desk: Arc::new(desk), guard: Arc::new(guard) });
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build();
    Court { router, runtime: runtime.expect("threads can be had"), _folder: folder }
}

/// None of what is no request to any server.
fn request_from(data: &[u8]) -> Option<Request<Body>> {
    let at = data.windows(2).position(|pair| pair == b"\n\n").unwrap_or(data.len());
    let (head, body) = (&data[..at], data.get(at + 2..).unwrap_or_default());
    let mut lines = head.split(|byte| *byte == b'\n');
    let mut words = lines.next()?.splitn(2, |byte| *byte == b' ');
    let mut request = Request::builder().method(words.next()?).uri(words.next()?);
    for line in lines {
        let colon = line.windows(2).position(|pair| pair == b": ")?;
        request = request.header(&line[..colon], &line[colon + 2..]);
    }
    let headers = request.headers_mut()?;
    for (name, value) in [
        ("host", "127.0.0.1:8080"),
        ("authorization", "Bearer secret"),
        ("content-type", "application/json"),
    ] {
        if !headers.contains_key(name) {
            headers.insert(name, value.parse().ok()?);
        }
    }
    request.body(Body::from(body.to_vec())).ok()
}

thread_local! { static COURT: Court = court(); }

fuzz_target!(|data: &[u8]| {
    let Some(request) = request_from(data) else { return };
    COURT.with(|court| {
        let status = court.runtime.block_on(async {
            let answer = court.router.clone().oneshot(request).await.expect("there is an answer");
            let status = answer.status().as_u16();
            to_bytes(answer.into_body(), MAX_ANSWER_BYTES).await.expect("it ends");
            status
        });
        assert_ne!(status, 500);
    });
});

use super::*;
use crate::desk::World;
use crate::drill::DrillHandle;
use crate::heard::{News, Spots};
use crate::history::History;
use crate::setup::Setup;
use axum::body::{Body, to_bytes};
use serde_json::Value;
use tower::ServiceExt as _;

const TOKEN: &str = "secret";

struct Court {
    router: Router,
    desk: Arc<Desk>,
    _folder: tempfile::TempDir,
}

fn court() -> Court {
    let folder = tempfile::tempdir().unwrap();
    let history = History::open(&folder.path().join("history.sqlite")).unwrap();
    let world = World { court: "rose".to_owned(), rig: None, machine: None, physics: None };
    let drill = DrillHandle::default();
    let desk = Desk::new(world, history, Spots::default(), drill, Setup::default()).unwrap();
    let desk = Arc::new(desk);
    let guard = Guard::new("127.0.0.1:8080".parse().unwrap(), &[], TOKEN.to_owned());
    let router = router(Hall { desk: Arc::clone(&desk), guard: Arc::new(guard) });
    Court { router, desk, _folder: folder }
}

impl Court {
    fn shot(&self, shot_idx: u64, y_m: f64) {
        let shot = serde_json::json!({"shot_idx": shot_idx, "outcome": "measured", "launch": null,
            "bounce": {"t_ns": 1, "position_m": [0.5, y_m, 0.03],
            "covariance_m2": [[1e-6, 0.0], [0.0, 1e-6]]}, "net": null, "track": []});
        self.desk.update(News::Shot(shot.to_string()));
    }

    /// What is asked again until it is so: the history is written by a thread of its own.
    fn until(&self, path: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        loop {
            let (status, body) = self.get(path);
            assert_eq!(status, 200, "{path}: {body}");
            if is_so(&body) {
                return body;
            }
            std::thread::yield_now();
        }
    }

    fn get(&self, path: &str) -> (u16, Value) {
        self.ask("GET", path, &[("host", "127.0.0.1:8080")], "")
    }

    fn ask(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> (u16, Value) {
        let mut request = Request::builder().method(method).uri(path);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let request = request.body(Body::from(body.to_owned())).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let response = self.router.clone().oneshot(request).await.unwrap();
            let status = response.status().as_u16();
            let bytes = to_bytes(response.into_body(), 1 << 20).await.unwrap();
            let text = String::from_utf8_lossy(&bytes).into_owned();
            (status, serde_json::from_str(&text).unwrap_or(Value::String(text)))
        })
    }
}

#[test]
fn a_shot_is_a_ball_of_a_session_of_its_own_run() {
    let court = court();
    court.shot(0, 20.0);
    court.shot(1, 21.0);
    court.shot(0, 22.0); // fusion began anew
    let body = court.until("/api/v1/balls", |body| body["balls"].as_array().unwrap().len() == 3);
    let of = |i: usize, key: &str| body["balls"][i][key].clone();
    assert_eq!((of(0, "id"), of(0, "session_id")), (3.into(), 2.into()));
    assert_eq!((of(2, "id"), of(2, "session_id")), (1.into(), 1.into()));
    assert_eq!(body["next"], Value::Null);
    let (_, page) = court.get("/api/v1/balls?limit=2&session=1");
    assert_eq!((&page["balls"][0]["id"], &page["next"]), (&2.into(), &1.into()));
    let (status, ball) = court.get("/api/v1/balls/2");
    assert_eq!((status, &ball["shot"]["bounce"]["position_m"][1]), (200, &21.0.into()));
    let (status, session) = court.get("/api/v1/sessions/1");
    assert_eq!((status, &session["n_measured"]), (200, &2.into()));
    let (_, csv) = court.get("/api/v1/sessions/1/balls.csv");
    assert_eq!(csv.as_str().unwrap().lines().count(), 3);
    let (_, json) = court.get("/api/v1/sessions/1/session.json");
    assert_eq!(json["balls"].as_array().unwrap().len(), 2);
}

#[test]
fn a_shot_that_was_missed_is_counted() {
    let court = court();
    court.shot(0, 20.0);
    court.shot(4, 20.0);
    court.desk.update(News::Shot("{".to_owned()));
    assert_eq!(court.get("/api/v1/status").1["n_lost"], 4);
}

#[test]
fn a_turned_camera_is_told_of() {
    let court = court();
    assert!(court.get("/api/v1/status").1["watch"].is_null());
    let sentence = "the left camera has turned by 0.05 degrees";
    let alarm = serde_json::json!({"schema": "watch/1", "sentence": sentence});
    court.desk.update(News::Watch(alarm.to_string()));
    assert_eq!(court.get("/api/v1/status").1["watch"]["sentence"], sentence);
}

/// Method, address, headers, body, and the status that is due.
type Case<'a> = (&'a str, &'a str, &'a [(&'a str, &'a str)], &'a str, u16);

#[test]
fn what_cannot_be_done_is_refused_in_a_sentence() {
    let court = court();
    let host = ("host", "127.0.0.1:8080");
    let token = ("authorization", "Bearer secret");
    let json = ("content-type", "application/json");
    let long = format!("{{\"name\":\"{}\"}}", "x".repeat(70_000));
    let cases: &[Case<'_>] = &[
        ("GET", "/api/v1/status", &[("host", "evil.example")], "", 403),
        ("GET", "/api/v1/status", &[host, ("origin", "http://evil.example")], "", 403),
        ("GET", "/api/v1/nothing", &[host], "", 404),
        ("GET", "/api/v1/balls/7", &[host], "", 404),
        ("GET", "/api/v1/balls/x", &[host], "", 400),
        ("GET", "/api/v1/balls?limit=0", &[host], "", 400),
        ("GET", "/api/v1/balls?limit=-1", &[host], "", 400),
        ("GET", "/api/v1/sessions/9/balls.csv", &[host], "", 404),
        ("GET", "/api/v1/live", &[host], "", 400),
        ("GET", "/api/v1/cameras/left/picture.png", &[host], "", 404),
        ("GET", "/api/v1/cameras/third/view", &[host], "", 400),
        ("POST", "/api/v1/cameras/left/look", &[host], "", 401),
        ("POST", "/api/v1/cameras/left/look", &[host, token], "", 409), // no such binary here
        ("GET", "/api/v1/setup/jobs/7", &[host], "", 404),
        ("GET", "/api/v1/setup/calibrations/1/found.png", &[host], "", 404),
        ("POST", "/api/v1/setup/calibrations/1/use", &[host, token], "", 404),
        ("POST", "/api/v1/setup/calibrations", &[host, token, json], "{\"kind\":\"sky\"}", 400),
        ("POST", "/api/v1/setup/recordings", &[host, token, json], "{\"seconds\":0}", 400),
        ("GET", "/api/v1/setup/recordings/..%2ftoken", &[host], "", 404),
        ("GET", "/api/v1/setup/pair/..%2ftoken", &[host, token], "", 404),
        ("GET", "/api/v1/logs.txt", &[host], "", 401),
        ("GET", "/../../etc/passwd", &[host], "", 404),
        ("GET", "/assets/..%2f..%2fetc/passwd", &[host], "", 404),
        ("POST", "/index.html", &[host], "", 405),
        ("DELETE", "/api/v1/status", &[host], "", 405),
        ("POST", "/api/v1/sessions", &[host, json], "{\"name\":\"a\"}", 401),
        ("POST", "/api/v1/sessions", &[host, json, ("authorization", "Bearer x")], "{}", 401),
        ("POST", "/api/v1/sessions", &[host, token, json], "{", 400),
        ("POST", "/api/v1/sessions", &[host, token, json], "{\"name\":3}", 422),
        ("POST", "/api/v1/sessions", &[host, token, json], "{\"name\":\"\"}", 400),
        ("POST", "/api/v1/sessions", &[host, token], "{\"name\":\"a\"}", 415),
        ("POST", "/api/v1/sessions", &[host, token, json], &long, 413),
    ];
    for (method, path, headers, body, expected) in cases {
        let (status, answer) = court.ask(method, path, headers, body);
        assert_eq!(status, *expected, "{method} {path} {headers:?}: {answer}");
        let error = answer["error"].as_str().unwrap_or_default();
        assert!(error.len() > 10, "{method} {path}: {answer}");
    }
    let (status, row) =
        court.ask("POST", "/api/v1/sessions", &[host, token, json], "{\"name\":\"Monday\"}");
    assert_eq!((status, &row["name"]), (200, &"Monday".into()));
}

#[test]
fn the_document_tells_of_every_route() {
    let (status, document) = court().get("/api/v1/openapi.json");
    assert_eq!(status, 200);
    let paths = document["paths"].as_object().unwrap();
    for path in [
        "/api/v1/status",
        "/api/v1/balls/{id}",
        "/api/v1/sessions/{id}/balls.csv",
        "/api/v1/clips/{clip}/labels/{frame}",
    ] {
        assert!(paths.contains_key(path), "{path} of {:?}", paths.keys());
    }
    assert!(document["components"]["schemas"]["BallRow"]["properties"]["miss_m"].is_object());
    let secured = &document["paths"]["/api/v1/sessions"]["post"]["security"];
    assert!(secured[0]["token"].is_array(), "{secured}");
    let labelled = &document["paths"]["/api/v1/clips/{clip}/labels/{frame}"]["put"]["security"];
    assert!(labelled[0]["token"].is_array(), "{labelled}");
}

#[test]
fn a_page_may_load_nothing_from_elsewhere_and_be_framed_by_nobody() {
    let court = court();
    let request = Request::builder().uri("/").header("host", "localhost:8080");
    let request = request.body(Body::empty()).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let response = runtime.block_on(court.router.clone().oneshot(request)).unwrap();
    let policy = response.headers()["content-security-policy"].to_str().unwrap();
    assert!(policy.contains("default-src 'self'") && policy.contains("frame-ancestors 'none'"));
    assert_eq!(response.headers()["x-content-type-options"], "nosniff");
    assert_eq!(response.status(), 200);
}

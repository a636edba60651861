use super::*;
use crate::desk::World;
use crate::drill::DrillHandle;
use crate::guard::Guard;
use crate::heard::Spots;
use crate::history::History;
use crate::setup::Setup;
use axum::Router;
use axum::body::{Body, to_bytes};
use axum::http::Request;
use serde_json::{Value, json};
use std::sync::Arc;
use tower::ServiceExt as _;

const TOKEN: &str = "secret";

struct Page {
    router: Router,
    desk: Arc<Desk>,
    _folder: tempfile::TempDir,
}

fn page(world: World) -> Page {
    let folder = tempfile::tempdir().unwrap();
    let history = History::open(&folder.path().join("history.sqlite")).unwrap();
    let drill = DrillHandle::new(Folder::open(&folder.path().join("drills")).unwrap());
    let desk = Desk::new(world, history, Spots::default(), drill, Setup::default()).unwrap();
    let desk = Arc::new(desk);
    let guard = Guard::new("127.0.0.1:8080".parse().unwrap(), &[], TOKEN.to_owned());
    let router = super::super::router(Hall { desk: Arc::clone(&desk), guard: Arc::new(guard) });
    Page { router, desk, _folder: folder }
}

impl Page {
    fn ask(&self, method: &str, path: &str, token: &str, body: &str) -> (u16, Value) {
        let request = Request::builder()
            .method(method)
            .uri(format!("/api/v1{path}"))
            .header("host", "127.0.0.1:8080")
            .header("content-type", "application/json")
            .header("authorization", format!("Bearer {token}"))
            .body(Body::from(body.to_owned()))
            .unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let response = self.router.clone().oneshot(request).await.unwrap();
            let status = response.status().as_u16();
            let bytes = to_bytes(response.into_body(), 1 << 20).await.unwrap();
            (status, serde_json::from_slice(&bytes).unwrap())
        })
    }
}

fn drill(name: &str, [x_m, y_m]: [f64; 2]) -> String {
    let target = json!({"name": "one", "landing_m": [x_m, y_m], "zone_radius_m": 1.0,
        "speed_m_s": 24.0, "spin_rpm": null, "net_height_m": null, "apex_m": null});
    json!({"name": name, "order": "random", "period_s": 3.0, "targets": [target]}).to_string()
}

#[test]
fn drills_are_kept_and_deleted_by_who_has_the_token() {
    let page = page(aiming::tests::world());
    let two = drill("a b", [1.0, 21.0]);
    assert_eq!(page.ask("PUT", "/drills/a%20b", TOKEN, &two).0, 200);
    let (_, listed) = page.ask("GET", "/drills", "", "");
    assert_eq!(listed["drills"][0], serde_json::from_str::<Value>(&two).unwrap());
    for (method, path, body, expected) in [
        ("PUT", "/drills/a%20b", drill("a b", [7.9, 21.0]), 400), // out of reach
        ("PUT", "/drills/a%20b", drill("a b", [1.0, 3.0]), 400),  // before the net
        ("PUT", "/drills/other", drill("a b", [1.0, 21.0]), 400),
        ("PUT", "/drills/..%2Fout", drill("../out", [1.0, 21.0]), 400),
        ("PUT", "/drills/a%20b", "{}".to_owned(), 422),
        ("DELETE", "/drills/..%2Fhistory", String::new(), 400),
        ("DELETE", "/drills/none", String::new(), 404),
        ("DELETE", "/drills/a%20b", String::new(), 200),
        ("DELETE", "/drills/a%20b", String::new(), 404),
    ] {
        assert_eq!(page.ask(method, path, "", &body).0, 401, "{method} {path}");
        let (status, answer) = page.ask(method, path, TOKEN, &body);
        assert_eq!(status, expected, "{method} {path}: {answer}");
        assert!(status == 200 || answer["error"].is_string(), "{answer}");
    }
}

#[test]
fn without_a_machine_file_nothing_is_aimed_and_no_drill_starts() {
    let page = page(World { machine: None, ..aiming::tests::world() });
    let one: Value = serde_json::from_str(&drill("x", [1.0, 21.0])).unwrap();
    let start = json!({"name": "five corners", "is_correcting": true, "balls": 3}).to_string();
    for (method, path, body) in [
        ("POST", "/aim", one["targets"][0].to_string()),
        ("PUT", "/drills/x", one.to_string()),
        ("POST", "/drill/start", start),
    ] {
        let (status, answer) = page.ask(method, path, TOKEN, &body);
        let sentence = answer["error"].as_str().unwrap();
        assert!(status == 409 && sentence.contains("--machine FILE"), "{path}: {answer}");
    }
    assert_eq!(page.ask("GET", "/drills", "", "").1["drills"].as_array().unwrap().len(), 1);
}

#[test]
fn orders_that_nobody_follows_say_so() {
    let page = page(aiming::tests::world());
    page.desk.drill.close();
    let none = json!({"name": "none", "is_correcting": true, "balls": 3}).to_string();
    assert_eq!(page.ask("POST", "/drill/start", TOKEN, &none).0, 404);
    for path in ["/machine/stop", "/machine/resume", "/drill/stop"] {
        assert_eq!(page.ask("POST", path, "", "").0, 401, "{path}");
        let (status, answer) = page.ask("POST", path, TOKEN, "");
        let sentence = answer["error"].as_str().unwrap();
        assert!(status == 503 && sentence.contains("switch"), "{path}: {answer}");
    }
}

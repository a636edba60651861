//! The real `page` beside the real `fusion` and a machine that is not there: over HTTP a drill is
//! kept, aimed and played; its balls survive a kill -9.

use crate::run::{Started, binary, turn};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};
use tests::processes::{Household, Until, own_court};

const MACHINE: &str = include_str!("../../fusion/rigs/machine.toml");
const N_BALLS: usize = 10;

/// `page` while it serves; killed when a test panics.
struct Served {
    child: Started,
    host: String,
    token: String,
}

impl Served {
    fn start(court: &str, folder: &Path) -> Self {
        let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
        let mut child = Command::new(binary("page"))
            .args(["--court", court, "--with-parent", "--listen", "127.0.0.1:0"])
            .args(["--data", &path("data"), "--rig", &path("rig.toml")])
            .args(["--machine", &path("machine.toml")])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address =
            line.trim().strip_prefix("http://").and_then(|url| url.split_once("/#token="));
        let (host, token) = address.unwrap_or_else(|| panic!("expected a URL, got {line:?}"));
        Self { host: host.to_owned(), token: token.to_owned(), child: Started(child) }
    }

    /// The status and what follows the head of the answer.
    fn ask(&self, method: &str, path: &str, token: &str, body: &str) -> (u16, String) {
        let Self { host, .. } = self;
        let n_bytes = body.len();
        let mut stream = TcpStream::connect(host).unwrap();
        let head = format!("{method} /api/v1{path} HTTP/1.1\r\nHost: {host}\r\n");
        let token = if token.is_empty() {
            String::new()
        } else {
            format!("Authorization: Bearer {token}\r\n")
        };
        let kind = "Content-Type: application/json\r\nConnection: close\r\n";
        write!(stream, "{head}{token}{kind}Content-Length: {n_bytes}\r\n\r\n{body}").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        assert!(!head.to_ascii_lowercase().contains("transfer-encoding"), "{head}");
        (head[9..12].parse().unwrap(), body.to_owned())
    }

    fn get(&self, path: &str) -> Value {
        let (status, body) = self.ask("GET", path, "", "");
        assert_eq!(status, 200, "{path}: {body}");
        serde_json::from_str(&body).unwrap()
    }

    /// With the token.
    fn change(&self, method: &str, path: &str, body: &Value) -> (u16, Value) {
        let body = if body.is_null() { String::new() } else { body.to_string() };
        let (status, body) = self.ask(method, path, &self.token, &body);
        (status, serde_json::from_str(&body).unwrap())
    }

    /// Asked again until it is so; fails when somebody of the house ends.
    fn until(&self, house: &mut Household, path: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        loop {
            house.look().unwrap();
            let value = self.get(path);
            if is_so(&value) {
                return value;
            }
            std::thread::yield_now();
        }
    }

    fn end(mut self, signal: Signal) {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, signal).unwrap();
        let status = self.child.wait().unwrap();
        assert!(signal == Signal::KILL || status.success(), "{status}");
    }
}

fn target(name: &str, landing_m: [f64; 2], speed_m_s: f64) -> Value {
    json!({"name": name, "landing_m": landing_m, "zone_radius_m": 1.0, "speed_m_s": speed_m_s,
        "spin_rpm": null, "net_height_m": null, "apex_m": null})
}

fn two() -> Value {
    let targets = [target("deep", [1.0, 21.0], 24.0), target("short", [-1.0, 17.0], 19.5)];
    json!({"name": "two", "order": "in turn", "period_s": 1.0, "targets": targets})
}

/// Fusion with the machine and no drill of its own, and a launcher with its balls.
fn house(court: &str, folder: &Path) -> Household {
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let (rig, machine) = (path("rig.toml"), path("machine.toml"));
    std::fs::write(&machine, MACHINE).unwrap();
    let write_rig = ["--court", court, "--write-rig", &rig];
    assert!(Command::new(binary("practice")).args(write_rig).status().unwrap().success());
    let mut house = Household::new(court).unwrap();
    let flags = ["--rig", &rig, "--machine", &machine];
    house.start("fusion", "fusion", &flags, Until::Stopped, Stdio::null()).unwrap();
    let flags = ["--machine", "real", "--scene", "bias", "--seed", "3"];
    house.start("practice", "practice", &flags, Until::Stopped, Stdio::null()).unwrap();
    house
}

fn balls_of(value: &Value) -> &[Value] {
    value["balls"].as_array().unwrap()
}

/// Told of, with what it was for and what fusion says of it.
fn is_whole(ball: &Value) -> bool {
    ball["target"].is_object() && ball["sentence"].is_string()
}

fn are_whole(value: &Value, n_balls: usize) -> bool {
    balls_of(value).iter().filter(|ball| is_whole(ball)).count() >= n_balls
}

#[test]
fn a_drill_over_http_and_its_balls_survive_a_kill() {
    let _turn = turn();
    let folder = tempfile::tempdir().unwrap();
    let court = own_court("page").unwrap();
    let mut house = house(&court, folder.path());
    let page = Served::start(&court, folder.path());
    page.until(&mut house, "/status", |status| status["machine"].is_object());

    let (status, _) = page.ask("PUT", "/drills/two", "", &two().to_string());
    assert_eq!(status, 401, "without the token");
    let (status, kept) = page.change("PUT", "/drills/two", &two());
    assert_eq!((status, &kept), (200, &two()), "{kept}");
    assert_eq!(page.ask("DELETE", "/drills/two", "", "").0, 401);
    let drills = page.get("/drills");
    let names: Vec<_> = drills["drills"].as_array().unwrap().iter().map(|d| &d["name"]).collect();
    assert_eq!(names, ["five corners", "two"]);
    let far = json!({"name": "two", "order": "in turn", "period_s": 1.0,
        "targets": [target("too far", [7.9, 28.0], 12.0)]});
    let (status, refused) = page.change("PUT", "/drills/two", &far);
    let sentence = refused["error"].as_str().unwrap();
    assert!(status == 400 && sentence.contains("\"too far\": out of reach"), "{refused}");

    let start = json!({"name": "two", "is_correcting": true, "balls": N_BALLS});
    assert_eq!(page.ask("POST", "/drill/start", "", &start.to_string()).0, 401);
    let (status, state) = page.change("POST", "/drill/start", &start);
    assert_eq!((status, &state["running"]), (200, &json!(true)), "{state}");
    assert_eq!(page.change("POST", "/drill/start", &start).0, 409, "one at a time");
    let balls = page.until(&mut house, "/balls", |balls| are_whole(balls, N_BALLS));
    let ended = page.until(&mut house, "/status", |status| status["drill"]["running"] == false);
    assert_eq!((&ended["drill"]["ball"], &ended["drill"]["said"]), (&json!(N_BALLS), &Value::Null));
    assert_eq!(balls_of(&balls).len(), N_BALLS);
    check_balls(&page, balls_of(&balls));

    let (token, newest) = (page.token.clone(), balls_of(&balls)[0]["id"].clone());
    page.end(Signal::KILL);
    let page = Served::start(&court, folder.path());
    assert_eq!(page.token, token, "phones stay trusted");
    assert_eq!(page.get("/balls"), balls, "all are there as they were");
    page.until(&mut house, "/status", |status| status["machine"].is_object());
    let again = json!({"name": "two", "is_correcting": false, "balls": 1});
    assert_eq!(page.change("POST", "/drill/start", &again).0, 200);
    let more = page.until(&mut house, "/balls", |balls| are_whole(balls, N_BALLS + 1));
    let grown = balls_of(&more)[0]["id"].as_i64().unwrap();
    assert_eq!(Some(grown), newest.as_i64().map(|newest| newest + 1));
    stops_and_resumes(&page, &mut house);
    page.end(Signal::TERM);
    house.stop().unwrap();
}

/// In turn, near their targets, and as many in the table.
fn check_balls(page: &Served, balls: &[Value]) {
    for (idx, ball) in balls.iter().rev().enumerate() {
        assert_eq!(ball["target"]["name"], ["deep", "short"][idx % 2], "{ball}");
        if let [Some(x_m), Some(y_m)] = [0, 1].map(|axis| ball["miss_m"][axis].as_f64()) {
            assert!(x_m.hypot(y_m) < 8.0, "{ball}");
        }
    }
    let one = page.get(&format!("/balls/{}", balls[0]["id"]));
    assert!(one["reference_m"].is_array() && one["correction"].is_object(), "{one}");
    let session = balls[0]["session_id"].as_i64().unwrap();
    let (status, csv) = page.ask("GET", &format!("/sessions/{session}/balls.csv"), "", "");
    assert_eq!((status, csv.lines().count()), (200, 1 + balls.len()), "{csv}");
}

/// An emergency stop ends a drill, nothing starts until somebody resumes, and nothing by itself.
fn stops_and_resumes(page: &Served, house: &mut Household) {
    let endless = json!({"name": "two", "is_correcting": true, "balls": null});
    page.until(house, "/status", |status| status["drill"]["running"] == false);
    assert_eq!(page.change("POST", "/drill/start", &endless).0, 200);
    assert_eq!(page.ask("POST", "/machine/stop", "", "").0, 401, "a stranger must not stop either");
    assert_eq!(page.change("POST", "/machine/stop", &Value::Null), (200, json!({})));
    let status = page.get("/status");
    assert_eq!(status["drill"]["running"], false);
    assert_eq!(status["drill"]["said"], "emergency stop");
    page.until(house, "/status", |status| status["machine"]["state"] == "stopped");
    let (status, refused) = page.change("POST", "/drill/start", &endless);
    assert!(status == 409 && refused["error"].as_str().unwrap().contains("resume"), "{refused}");
    assert_eq!(page.change("POST", "/machine/resume", &Value::Null), (200, json!({})));
    let status = page.until(house, "/status", |status| status["machine"]["state"] == "ready");
    assert_eq!(status["drill"]["running"], false);
    assert_eq!(page.change("POST", "/drill/stop", &Value::Null).0, 409, "none runs");
}

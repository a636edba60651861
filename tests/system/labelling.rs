//! `label`: labels set over its own HTTP stand in the CSV when it ends.

use crate::run::{Started, words};
use page::labels::{self, Label};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const CLIP: &str = "/api/v1/clips/clip.y4m";

/// Five frames of 16x8.
fn clip_in(folder: &Path) {
    let mut bytes = b"YUV4MPEG2 W16 H8 F90:1 Cmono\n".to_vec();
    for grey in 0..5 {
        bytes.extend(b"FRAME\n");
        bytes.extend([grey; 128]);
    }
    std::fs::write(folder.join("clip.y4m"), bytes).unwrap();
}

fn label(folder: &Path, video: &str, csv: &str, flags: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_label"));
    command.current_dir(folder).args([video, csv]).args(flags);
    command
}

/// `label` while it serves; killed when a test panics.
struct Served {
    child: Started,
    host: String,
    token: String,
}

impl Served {
    fn start(mut command: Command) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let url = line.trim().strip_prefix("http://");
        let parts = url.and_then(|url| url.split_once("/label/#token="));
        let (host, token) = parts.unwrap_or_else(|| panic!("expected a URL, got {line:?}"));
        Self { child: Started(child), host: host.to_owned(), token: token.to_owned() }
    }

    /// The status and what follows the head of the answer.
    fn ask(&self, method: &str, path: &str, body: &str) -> (u16, Vec<u8>) {
        self.ask_with(&self.token, method, path, body)
    }

    fn ask_with(&self, token: &str, method: &str, path: &str, body: &str) -> (u16, Vec<u8>) {
        let Self { host, .. } = self;
        let n_bytes = body.len();
        let mut stream = TcpStream::connect(host).unwrap();
        let head = format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n");
        let head = format!("{head}Authorization: Bearer {token}\r\n");
        let head = format!("{head}Content-Type: application/json\r\n");
        write!(stream, "{head}Content-Length: {n_bytes}\r\n\r\n{body}").unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let status = std::str::from_utf8(&answer[9..12]).unwrap().parse().unwrap();
        (status, answer[end + 4..].to_vec())
    }

    fn end(mut self, signal: rustix::process::Signal) -> Option<i32> {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, signal).unwrap();
        self.child.wait().unwrap().code()
    }
}

#[test]
fn labels_set_over_http_stand_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    clip_in(folder.path());
    let csv = folder.path().join("ball.csv");
    let read = || labels::from_csv(std::fs::File::open(&csv).unwrap()).unwrap();
    let served = Served::start(label(folder.path(), "clip.y4m", "ball.csv", &[]));
    let (status, page) = served.ask("GET", "/label/", "");
    assert!(status == 200 && page.starts_with(b"<!doctype html>"));
    let (status, png) = served.ask("GET", &format!("{CLIP}/frames/4"), "");
    assert_eq!(status, 200);
    assert_eq!(image::load_from_memory(&png).unwrap().to_luma8().into_raw(), [4; 128]);
    for frame_idx in [1, 2, 4] {
        let body = format!(r#"{{"x_px":{frame_idx}.25,"y_px":3,"is_hard":{}}}"#, frame_idx == 2);
        let (status, text) = served.ask("PUT", &format!("{CLIP}/labels/{frame_idx}"), &body);
        assert_eq!(status, 204, "{}", String::from_utf8_lossy(&text));
        assert_eq!(read()[&frame_idx].x_px, frame_idx as f64 + 0.25, "saved before answered");
    }
    let [first, beyond] = [1, 5].map(|frame_idx| format!("{CLIP}/labels/{frame_idx}"));
    assert_eq!(served.ask_with("guessed", "DELETE", &first, "").0, 401, "and nothing has changed");
    assert_eq!(served.ask("DELETE", &first, "").0, 204);
    assert_eq!(served.ask("PUT", &beyond, r#"{"x_px":1,"y_px":1,"is_hard":false}"#).0, 404);
    // Somebody who has connected and says nothing keeps nobody from ending.
    let silent = TcpStream::connect(&served.host).unwrap();
    assert_eq!(served.end(rustix::process::Signal::INT), Some(0));
    drop(silent);
    let hard = Label { x_px: 2.25, y_px: 3.0, is_hard: true };
    let easy = Label { x_px: 4.25, y_px: 3.0, is_hard: false };
    assert_eq!(read(), [(2, hard), (4, easy)].into());

    let served = Served::start(label(folder.path(), "clip.y4m", "ball.csv", &[]));
    let (_, listed) = served.ask("GET", &format!("{CLIP}/labels"), "");
    assert!(
        String::from_utf8(listed).unwrap().contains(r#""x_px":2.25,"y_px":3.0,"is_hard":true"#)
    );
    assert_eq!(served.end(rustix::process::Signal::TERM), Some(0));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing left beside");
}

#[test]
fn what_cannot_be_labelled_is_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    clip_in(folder.path());
    let csv = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    csv("late.csv", "frame,x_px,y_px\n5,1,1\n");
    csv("word.csv", "frame,x_px,y_px\n1,1,1\n2,here,1\n");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let flags = ["--port", port.as_str()];
    for (video, labels, flags, expected) in [
        ("none.y4m", "new.csv", &[][..], ["none.y4m", "No such file"]),
        ("late.csv", "new.csv", &[], ["late.csv: line 1", "YUV4MPEG2"]),
        ("clip.y4m", "late.csv", &[], ["late.csv: frame 5", "5 frames"]),
        ("clip.y4m", "word.csv", &[], ["word.csv: line 3: x_px", "here"]),
        ("clip.y4m", "none/new.csv", &[], ["none/new.csv", "cannot be written"]),
        // No file can be made in /proc, not even by root.
        ("clip.y4m", "/proc/new.csv", &[], ["/proc/new.csv", "cannot be written"]),
        ("clip.y4m", "new.csv", &flags, [port.as_str(), "in use"]),
    ] {
        let output: Output = label(folder.path(), video, labels, flags).output().unwrap();
        let said = words(&output);
        assert_eq!(output.status.code(), Some(1), "{video} {labels}: {said}");
        for word in expected {
            assert!(said.contains(word), "{video} {labels}: {said:?} lacks {word:?}");
        }
        assert!(said.starts_with("label: ") && !said.contains("panicked"), "{said}");
        assert!(output.stdout.is_empty() && !folder.path().join("new.csv").exists());
    }
}

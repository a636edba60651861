//! Laws of the labelling, asked as a browser does.

use super::*;
use axum::body::Body;
use axum::extract::Request;
use axum::http::HeaderMap;
use tower::ServiceExt as _;

const HERE: &str = "127.0.0.1:4000";
const TRUSTED: [(&str, &str); 3] =
    [("host", HERE), ("authorization", "Bearer secret"), ("content-type", "application/json")];
const BALL: &str = r#"{"x_px":1,"y_px":2,"is_hard":false}"#;

/// Three frames of 10x8, all of one grey each: 0, 50, 100.
fn router_on(folder: &std::path::Path) -> Router {
    let mut bytes = b"YUV4MPEG2 W10 H8 F90:1 Cmono\n".to_vec();
    for grey in [0, 50, 100] {
        bytes.extend(b"FRAME\n");
        bytes.extend([grey; 80]);
    }
    std::fs::write(folder.join("clip.y4m"), bytes).unwrap();
    let guard = Guard::new(HERE.parse().unwrap(), &[], "secret".to_owned());
    let clips = Arc::new(Clips::of_folder(folder.to_owned()));
    router(Bench { clips, guard: Arc::new(guard) })
}

fn answer(router: &Router, request: Request) -> (StatusCode, HeaderMap, Vec<u8>) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let (head, body) = router.clone().oneshot(request).await.unwrap().into_parts();
        let body = axum::body::to_bytes(body, usize::MAX).await.unwrap();
        (head.status, head.headers, body.to_vec())
    })
}

fn asked(method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> Request {
    let mut request = Request::builder().method(method).uri(path);
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    request.body(Body::from(body.to_owned())).unwrap()
}

const CLIP: &str = "/api/v1/clips/clip.y4m";

/// Status and text of a request with the token; the path follows that of the clip.
fn said(router: &Router, method: &str, path: &str, body: &str) -> (u16, String) {
    let path = format!("{CLIP}{path}");
    let (status, _, body) = answer(router, asked(method, &path, &TRUSTED, body));
    (status.as_u16(), String::from_utf8(body).unwrap())
}

#[test]
fn the_tool_and_the_clip_are_shown_without_a_token() {
    let folder = tempfile::tempdir().unwrap();
    let router = router_on(folder.path());
    for (path, kind, _) in TOOL {
        let (status, headers, body) = answer(&router, asked("GET", path, &[("host", HERE)], ""));
        assert!(status.is_success() && body.len() > 500, "{path}");
        assert!(headers["content-type"].to_str().unwrap().contains(kind), "{path}");
        assert_eq!(headers["cache-control"], "no-store");
        assert!(headers["content-security-policy"].to_str().unwrap().contains("ancestors"));
    }
    let got = |path: &str| answer(&router, asked("GET", path, &[("host", HERE)], ""));
    let json = |path: &str| serde_json::from_slice::<serde_json::Value>(&got(path).2).unwrap();
    let clips = json("/api/v1/clips");
    assert_eq!(clips["clips"][0]["name"], "clip.y4m");
    assert_eq!(clips["clips"][0]["is_labelled"], false);
    let clip = json(CLIP);
    assert_eq!((&clip["name"], &clip["n_frames"]), (&"clip.y4m".into(), &3.into()));
    assert_eq!((&clip["width_px"], &clip["height_px"]), (&10.into(), &8.into()));
    assert_eq!((&clip["frame_rate_hz"], &clip["labels_file"]), (&90.0.into(), &"clip.csv".into()));
    for (frame_idx, grey) in [(2, 100), (0, 0), (1, 50)] {
        let (_, headers, png) = got(&format!("{CLIP}/frames/{frame_idx}"));
        assert_eq!(headers["content-type"], "image/png");
        let picture = image::load_from_memory(&png).unwrap();
        assert_eq!((picture.width(), picture.height()), (10, 8));
        assert_eq!(picture.to_luma8().into_raw(), [grey; 80]);
    }
}

#[test]
fn labels_are_set_listed_and_removed() {
    let folder = tempfile::tempdir().unwrap();
    let router = router_on(folder.path());
    assert_eq!(said(&router, "GET", "/labels", ""), (200, r#"{"labels":[]}"#.to_owned()));
    let ball = r#"{"x_px":1.5,"y_px":-0.5,"is_hard":true}"#;
    assert_eq!(said(&router, "PUT", "/labels/2", ball), (204, String::new()));
    let listed = r#"{"labels":[{"frame_idx":2,"x_px":1.5,"y_px":-0.5,"is_hard":true}]}"#;
    assert_eq!(said(&router, "GET", "/labels", ""), (200, listed.to_owned()));
    let csv = || std::fs::read_to_string(folder.path().join("clip.csv")).unwrap();
    assert_eq!(csv(), "frame,x_px,y_px,hard\n2,1.500,-0.500,1\n");
    assert_eq!(said(&router, "GET", "/labels.csv", ""), (200, csv()));
    assert_eq!(said(&router, "DELETE", "/labels/2", "").0, 204);
    assert_eq!(said(&router, "DELETE", "/labels/2", "").0, 204, "gone is gone");
    assert_eq!(csv(), "frame,x_px,y_px\n");
}

#[test]
fn what_cannot_be_done_is_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let router = router_on(folder.path());
    let outside = r#"{"x_px":9.6,"y_px":2,"is_hard":false}"#;
    let huge = r#"{"x_px":1e999,"y_px":2,"is_hard":false}"#;
    for (method, path, body, status, words) in [
        ("PUT", "/labels/3", BALL, 404, "the clip has 3 frames"),
        ("DELETE", "/labels/3", "", 404, "the clip has 3 frames"),
        ("PUT", "/labels/one", BALL, 400, "Cannot parse"),
        ("PUT", "/labels/1", outside, 422, "(9.6, 2) is outside the picture of 10x8"),
        ("PUT", "/labels/1", huge, 400, "number out of range"),
        ("PUT", "/labels/1", r#"{"x_px":NaN}"#, 400, "expected value"),
        ("PUT", "/labels/1", r#"{"x_px":1,"y_px":2}"#, 422, "missing field `is_hard`"),
        ("PUT", "/labels/1", &BALL.replace("is_hard", "hard"), 422, "unknown field"),
        ("PUT", "/labels/1", &" ".repeat(70_000), 413, "length limit exceeded"),
        ("POST", "/labels/1", BALL, 405, "does not know that method"),
        ("GET", "/frames/3", "", 404, "the clip has 3 frames"),
        ("GET", "/frames/-1", "", 400, "Cannot parse"),
        ("GET", "/frames/1.jpg", "", 400, "Cannot parse"),
        ("GET", "/../clip.csv", "", 404, "there is no such address"),
        ("GET", "/..%2f..%2fclip.csv/labels", "", 404, "there is no such address"),
    ] {
        let (got, text) = said(&router, method, path, body);
        assert_eq!(got, status, "{method} {path} {body:?}: {text}");
        assert!(text.contains(words), "{method} {path}: {text:?} lacks {words:?}");
    }
    let other = asked("GET", "/api/v1/clips/..%2fclip.y4m", &TRUSTED, "");
    assert_eq!(answer(&router, other).0, StatusCode::NOT_FOUND);
    let csv = folder.path().join("clip.csv");
    assert!(!csv.exists(), "nothing was saved");
    std::fs::write(&csv, "frame,x,y\n").unwrap();
    let (status, text) = said(&router, "PUT", "/labels/1", BALL);
    assert_eq!(status, 409);
    assert!(text.contains("clip.csv: changed by somebody else"), "{text}");
    std::fs::remove_dir_all(folder.path()).unwrap();
    let (status, text) = said(&router, "PUT", "/labels/1", BALL);
    assert_eq!(status, 503);
    assert!(text.contains("clip.csv: cannot be written"), "{text}");
}

#[test]
fn a_page_from_elsewhere_and_who_has_no_token_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let router = router_on(folder.path());
    let label = format!("{CLIP}/labels/1");
    let [host, token, json] = TRUSTED;
    let elsewhere = [host, token, json, ("origin", "http://evil.example")];
    let renamed = [("host", "evil.example:4000"), token, json];
    for headers in [&elsewhere[..], &renamed, &[token]] {
        for (method, path) in [("PUT", label.as_str()), ("GET", "/api/v1/clips"), ("GET", CLIP)] {
            let (status, ..) = answer(&router, asked(method, path, headers, BALL));
            assert_eq!(status, StatusCode::FORBIDDEN, "{method} {path} {headers:?}");
        }
    }
    for headers in [&[host, json][..], &[host, json, ("authorization", "Bearer x")]] {
        for method in ["PUT", "DELETE"] {
            let (status, ..) = answer(&router, asked(method, &label, headers, BALL));
            assert_eq!(status, StatusCode::UNAUTHORIZED, "{method} {headers:?}");
        }
    }
    assert!(!folder.path().join("clip.csv").exists());
    let ours = [host, token, json, ("origin", "http://127.0.0.1:4000")];
    let (status, ..) = answer(&router, asked("PUT", &label, &ours, BALL));
    assert_eq!(status, StatusCode::NO_CONTENT);
}

#[test]
fn no_word_of_the_other_language_is_left_over() {
    let text_of = |name: &str| TOOL.iter().find(|(path, ..)| path.ends_with(name)).unwrap().2;
    let words: std::collections::BTreeMap<String, String> =
        serde_json::from_str(text_of("de.json")).unwrap();
    let shown = ["/label/", "label.js", "frames.js", "drawing.js"].map(text_of).concat();
    assert!(words.len() > 60);
    for (english, german) in words {
        assert!(shown.contains(&english) && !german.is_empty(), "{english:?} is shown nowhere");
    }
}

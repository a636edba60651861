//! A clip and its label file → a page on which a person says where the ball is.
//!
//! `GET /clip` and `/frames/7.png` show the clip; `GET /labels`, `PUT /labels/7` and
//! `DELETE /labels/7` see and change labels, each change on disk before it is answered. A refusal
//! is a status and a sentence.
//!
//! Only our own page is heard ([`crate::sender`]), and no other page may frame it.

use crate::label_file::{self, LabelFile};
use crate::labels::Label;
use crate::sender::Sender;
use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, put};
use capture::recording::Recording;
use image::ImageEncoder as _;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A label as JSON takes less than a hundred bytes.
const MAX_BODY_BYTES: usize = 1024;
/// What the page may load and who may frame it.
const PAGE_POLICY: &str = "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'";

/// The page: path, kind, text.
const PAGE: [(&str, &str, &str); 6] = [
    ("/", "text/html", include_str!("../page/label.html")),
    ("/label.css", "text/css", include_str!("../page/label.css")),
    ("/label.js", "text/javascript", include_str!("../page/label.js")),
    ("/desk.js", "text/javascript", include_str!("../page/desk.js")),
    ("/frames.js", "text/javascript", include_str!("../page/frames.js")),
    ("/drawing.js", "text/javascript", include_str!("../page/drawing.js")),
];

/// What is on the desk: one clip, one file of labels.
#[derive(Debug)]
pub struct Desk {
    clip_name: String,
    recording: Mutex<Recording>,
    file: Mutex<LabelFile>,
}

impl Desk {
    /// Puts a clip and its labels on the desk; `clip_name` is what the page calls it.
    #[must_use]
    pub fn new(clip_name: String, recording: Recording, file: LabelFile) -> Self {
        Self { clip_name, recording: Mutex::new(recording), file: Mutex::new(file) }
    }

    fn png_from(&self, frame_idx: usize) -> Result<Vec<u8>, Refusal> {
        let mut recording = unpoisoned(&self.recording);
        let (width_px, height_px) = recording.size_px();
        let mut luma = vec![0; width_px as usize * height_px as usize];
        recording.go_to(frame_idx).map_err(Refusal::internal)?;
        recording.read_into(&mut luma).map_err(Refusal::internal)?;
        drop(recording); // others may read while this one is packed
        let mut png = Vec::new();
        // It only crosses loopback: fast, not small.
        PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Up)
            .write_image(&luma, width_px, height_px, image::ExtendedColorType::L8)
            .map_err(Refusal::internal)?;
        Ok(png)
    }
}

/// Both hold what is consistent between statements, so a panic elsewhere spoils nothing.
fn unpoisoned<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The page and what it asks for, for a server at this port of loopback.
pub fn router(desk: Arc<Desk>, port: u16) -> Router {
    let mut router = Router::new();
    for (path, kind, text) in PAGE {
        router = router.route(path, get(move || page(kind, text)));
    }
    router
        .route("/clip", get(clip))
        .route("/frames/{file}", get(frame))
        .route("/labels", get(labels))
        .route("/labels/{frame}", put(put_label).delete(delete_label))
        .fallback(|| async { Refusal(StatusCode::NOT_FOUND, "nothing is here".to_owned()) })
        .layer(DefaultBodyLimit::max(MAX_BODY_BYTES))
        .layer(middleware::from_fn_with_state(Sender::ours(port), guarded))
        .with_state(desk)
}

/// A status and a sentence.
#[derive(Debug)]
struct Refusal(StatusCode, String);

impl Refusal {
    fn internal(why: impl std::fmt::Display) -> Self {
        Self(StatusCode::INTERNAL_SERVER_ERROR, why.to_string())
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        (self.0, self.1).into_response()
    }
}

impl From<label_file::Error> for Refusal {
    fn from(error: label_file::Error) -> Self {
        use label_file::{Error, Outside};
        let status = match error {
            Error::Outside(Outside::Frame { .. }) => StatusCode::NOT_FOUND,
            Error::Outside(Outside::Picture { .. }) => StatusCode::UNPROCESSABLE_ENTITY,
            Error::Changed { .. } => StatusCode::CONFLICT,
            _ => StatusCode::INTERNAL_SERVER_ERROR,
        };
        Self(status, error.to_string())
    }
}

/// Answers who may ask, and says what a browser may do with the answer.
async fn guarded(State(sender): State<Sender>, request: Request, next: Next) -> Response {
    if let Err(why) = sender.check(request.headers()) {
        return Refusal(StatusCode::FORBIDDEN, why.to_string()).into_response();
    }
    let mut response = next.run(request).await;
    for (name, value) in [
        (header::CACHE_CONTROL, "no-store"), // tomorrow another clip may be served here
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::CONTENT_SECURITY_POLICY, PAGE_POLICY),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn page(kind: &'static str, text: &'static str) -> impl IntoResponse {
    ([(header::CONTENT_TYPE, format!("{kind}; charset=utf-8"))], text)
}

fn json(value: &impl serde::Serialize) -> Result<Response, Refusal> {
    let text = serde_json::to_string(value).map_err(Refusal::internal)?;
    Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response())
}

/// What the page needs to know first.
#[derive(serde::Serialize)]
struct ClipView<'a> {
    name: &'a str,
    labels_path: String,
    width_px: u32,
    height_px: u32,
    n_frames: usize,
    frame_rate_hz: Option<f64>,
}

async fn clip(State(desk): State<Arc<Desk>>) -> Result<Response, Refusal> {
    let frame_rate_hz = unpoisoned(&desk.recording).frame_rate_hz();
    let file = unpoisoned(&desk.file);
    let ((width_px, height_px), n_frames) = (file.extent().size_px, file.extent().n_frames);
    let labels_path = file.path().display().to_string();
    let name = &desk.clip_name;
    json(&ClipView { name, labels_path, width_px, height_px, n_frames, frame_rate_hz })
}

async fn frame(
    State(desk): State<Arc<Desk>>,
    Path(file): Path<String>,
) -> Result<Response, Refusal> {
    let frame_idx = frame_idx_from(file.strip_suffix(".png").unwrap_or_default())?;
    unpoisoned(&desk.file).extent().check_frame(frame_idx).map_err(label_file::Error::from)?;
    let png = off_the_loop(move || desk.png_from(frame_idx)).await?;
    Ok(([(header::CONTENT_TYPE, "image/png")], png).into_response())
}

/// A label as the page reads it.
#[derive(serde::Serialize)]
struct LabelView {
    frame_idx: usize,
    x_px: f64,
    y_px: f64,
    is_hard: bool,
}

async fn labels(State(desk): State<Arc<Desk>>) -> Result<Response, Refusal> {
    let file = unpoisoned(&desk.file);
    let view = |(&frame_idx, label): (&usize, &Label)| {
        let Label { x_px, y_px, is_hard } = *label;
        LabelView { frame_idx, x_px, y_px, is_hard }
    };
    json(&file.labels().iter().map(view).collect::<Vec<_>>())
}

/// A label as the page writes it.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct LabelBody {
    x_px: f64,
    y_px: f64,
    is_hard: bool,
}

async fn put_label(
    State(desk): State<Arc<Desk>>,
    Path(frame): Path<String>,
    body: Bytes,
) -> Result<StatusCode, Refusal> {
    let frame_idx = frame_idx_from(&frame)?;
    let body: LabelBody = serde_json::from_slice(&body).map_err(|why| {
        let words = format!("expected {{\"x_px\":1.5,\"y_px\":2,\"is_hard\":false}}: {why}");
        Refusal(StatusCode::BAD_REQUEST, words)
    })?;
    let LabelBody { x_px, y_px, is_hard } = body;
    changed(desk, frame_idx, Some(Label { x_px, y_px, is_hard })).await
}

async fn delete_label(
    State(desk): State<Arc<Desk>>,
    Path(frame): Path<String>,
) -> Result<StatusCode, Refusal> {
    changed(desk, frame_idx_from(&frame)?, None).await
}

async fn changed(
    desk: Arc<Desk>,
    frame_idx: usize,
    label: Option<Label>,
) -> Result<StatusCode, Refusal> {
    off_the_loop(move || Ok(unpoisoned(&desk.file).update(frame_idx, label)?)).await?;
    Ok(StatusCode::NO_CONTENT)
}

fn frame_idx_from(text: &str) -> Result<usize, Refusal> {
    let refusal = || Refusal(StatusCode::NOT_FOUND, "expected the number of a frame".to_owned());
    text.parse().map_err(|_| refusal())
}

/// Work on files happens beside the loop that answers. What has begun is finished even when the
/// process is asked to end.
async fn off_the_loop<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Refusal> + Send + 'static,
) -> Result<T, Refusal> {
    tokio::task::spawn_blocking(work).await.map_err(Refusal::internal)?
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::label_file::Extent;
    use axum::body::Body;
    use axum::http::HeaderMap;
    use tower::ServiceExt as _;

    const HERE: &str = "127.0.0.1:4000";

    /// Three frames of 10x8, all of one grey each: 0, 50, 100.
    fn router_on(folder: &std::path::Path) -> Router {
        let clip = folder.join("clip.y4m");
        let mut bytes = b"YUV4MPEG2 W10 H8 F90:1 Cmono\n".to_vec();
        for grey in [0, 50, 100] {
            bytes.extend(b"FRAME\n");
            bytes.extend([grey; 80]);
        }
        std::fs::write(&clip, bytes).unwrap();
        let recording = Recording::open(&clip).unwrap();
        let extent = Extent { n_frames: recording.n_frames(), size_px: recording.size_px() };
        let file = LabelFile::open(&folder.join("labels.csv"), extent).unwrap();
        let desk = Desk::new("clip.y4m".to_owned(), recording, file);
        router(Arc::new(desk), 4000)
    }

    fn answer(router: &Router, request: Request) -> (StatusCode, HeaderMap, Vec<u8>) {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
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

    /// Status and text of an ordinary request.
    fn said(router: &Router, method: &str, path: &str, body: &str) -> (u16, String) {
        let (status, _, body) = answer(router, asked(method, path, &[("host", HERE)], body));
        (status.as_u16(), String::from_utf8(body).unwrap())
    }

    #[test]
    fn the_page_and_the_clip_are_shown() {
        let folder = tempfile::tempdir().unwrap();
        let router = router_on(folder.path());
        for (path, kind, _) in PAGE {
            let (status, headers, body) =
                answer(&router, asked("GET", path, &[("host", HERE)], ""));
            assert!(status.is_success() && body.len() > 500, "{path}");
            assert!(headers["content-type"].to_str().unwrap().contains(kind), "{path}");
            assert_eq!(headers["cache-control"], "no-store");
            assert!(headers["content-security-policy"].to_str().unwrap().contains("ancestors"));
        }
        let (_, clip) = said(&router, "GET", "/clip", "");
        let clip: serde_json::Value = serde_json::from_str(&clip).unwrap();
        assert_eq!((&clip["name"], &clip["n_frames"]), (&"clip.y4m".into(), &3.into()));
        assert_eq!((&clip["width_px"], &clip["height_px"]), (&10.into(), &8.into()));
        assert_eq!(clip["frame_rate_hz"], 90.0);
        for (frame_idx, grey) in [(2, 100), (0, 0), (1, 50)] {
            let path = format!("/frames/{frame_idx}.png");
            let (_, headers, png) = answer(&router, asked("GET", &path, &[("host", HERE)], ""));
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
        assert_eq!(said(&router, "GET", "/labels", ""), (200, "[]".to_owned()));
        let ball = r#"{"x_px":1.5,"y_px":-0.5,"is_hard":true}"#;
        assert_eq!(said(&router, "PUT", "/labels/2", ball), (204, String::new()));
        let listed = r#"[{"frame_idx":2,"x_px":1.5,"y_px":-0.5,"is_hard":true}]"#;
        assert_eq!(said(&router, "GET", "/labels", ""), (200, listed.to_owned()));
        let csv = || std::fs::read_to_string(folder.path().join("labels.csv")).unwrap();
        assert_eq!(csv(), "frame,x_px,y_px,hard\n2,1.500,-0.500,1\n");
        assert_eq!(said(&router, "DELETE", "/labels/2", "").0, 204);
        assert_eq!(said(&router, "DELETE", "/labels/2", "").0, 204, "gone is gone");
        assert_eq!(csv(), "frame,x_px,y_px\n");
    }

    #[test]
    fn what_cannot_be_done_is_refused_with_a_sentence() {
        let folder = tempfile::tempdir().unwrap();
        let router = router_on(folder.path());
        let ball = r#"{"x_px":1,"y_px":2,"is_hard":false}"#;
        let outside = r#"{"x_px":9.6,"y_px":2,"is_hard":false}"#;
        let huge = r#"{"x_px":1e999,"y_px":2,"is_hard":false}"#;
        for (method, path, body, status, words) in [
            ("PUT", "/labels/3", ball, 404, "the clip has 3 frames"),
            ("DELETE", "/labels/3", "", 404, "the clip has 3 frames"),
            ("PUT", "/labels/one", ball, 404, "expected the number of a frame"),
            ("PUT", "/labels/1", outside, 422, "(9.6, 2) is outside the picture of 10x8"),
            ("PUT", "/labels/1", huge, 400, "number out of range"),
            ("PUT", "/labels/1", r#"{"x_px":NaN}"#, 400, "expected {\"x_px\":1.5"),
            ("PUT", "/labels/1", r#"{"x_px":1,"y_px":2}"#, 400, "missing field `is_hard`"),
            ("PUT", "/labels/1", &ball.replace("is_hard", "hard"), 400, "unknown field"),
            ("PUT", "/labels/1", &" ".repeat(2000), 413, "length limit exceeded"),
            ("POST", "/labels/1", ball, 405, ""),
            ("GET", "/frames/3.png", "", 404, "the clip has 3 frames"),
            ("GET", "/frames/-1.png", "", 404, "expected the number of a frame"),
            ("GET", "/frames/1.jpg", "", 404, "expected the number of a frame"),
            ("GET", "/../labels.csv", "", 404, "nothing is here"),
        ] {
            let (got, text) = said(&router, method, path, body);
            assert_eq!(got, status, "{method} {path} {body:?}: {text}");
            assert!(text.contains(words), "{method} {path}: {text:?} lacks {words:?}");
        }
        assert!(!folder.path().join("labels.csv").exists(), "nothing was saved");
        std::fs::write(folder.path().join("labels.csv"), "frame,x,y\n").unwrap();
        let (status, text) = said(&router, "PUT", "/labels/1", ball);
        assert_eq!(status, 409);
        assert!(text.contains("labels.csv: changed by somebody else"), "{text}");
        std::fs::remove_dir_all(folder.path()).unwrap();
        let (status, text) = said(&router, "PUT", "/labels/1", ball);
        assert_eq!(status, 500);
        assert!(text.contains("labels.csv: cannot be written"), "{text}");
    }

    #[test]
    fn a_page_from_elsewhere_changes_and_reads_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let router = router_on(folder.path());
        let ball = r#"{"x_px":1,"y_px":2,"is_hard":false}"#;
        let elsewhere = [("host", HERE), ("origin", "http://evil.example")];
        let renamed = [("host", "evil.example:4000")];
        for headers in [&elsewhere[..], &renamed, &[]] {
            for (method, path) in [("PUT", "/labels/1"), ("GET", "/labels"), ("GET", "/clip")] {
                let (status, ..) = answer(&router, asked(method, path, headers, ball));
                assert_eq!(status, StatusCode::FORBIDDEN, "{method} {path} {headers:?}");
            }
        }
        assert!(!folder.path().join("labels.csv").exists());
        let ours = [("host", HERE), ("origin", "http://127.0.0.1:4000")];
        let (status, ..) = answer(&router, asked("PUT", "/labels/1", &ours, ball));
        assert_eq!(status, StatusCode::NO_CONTENT);
    }
}

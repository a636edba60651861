//! A clip, frame by frame, and where a person says that the ball is: ground truth.
//!
//! Each change is on disk before it is answered. Whoever has no token may look, not change. The
//! tool itself (`label/`) is a page of its own beside the coach's, for it is one picture and many
//! keys; the program `label` serves the same for a single clip.

use super::{Answer, Refusal, aside};
use crate::clips::{self, Clip, Clips};
use crate::guard::Guard;
use crate::label_file::{self, Outside};
use crate::labels::{self, Label};
use crate::views::{ClipRow, ClipView, ClipViews, LabelBody, LabelView, LabelViews, Problem};
use axum::extract::rejection::JsonRejection;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Redirect};
use axum::routing::get;
use axum::{Json, Router};
use axum_extra::extract::WithRejection;
use std::sync::Arc;
use tokio::sync::Semaphore;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Frames that are packed at a time: the processor is shared with fusion.
static PACKING: Semaphore = Semaphore::const_new(1);

/// The tool: path, kind, text.
const TOOL: [(&str, &str, &str); 8] = [
    ("/label/", "text/html", include_str!("../../label/label.html")),
    ("/label/label.css", "text/css", include_str!("../../label/label.css")),
    ("/label/label.js", "text/javascript", include_str!("../../label/label.js")),
    ("/label/desk.js", "text/javascript", include_str!("../../label/desk.js")),
    ("/label/frames.js", "text/javascript", include_str!("../../label/frames.js")),
    ("/label/drawing.js", "text/javascript", include_str!("../../label/drawing.js")),
    ("/label/words.js", "text/javascript", include_str!("../../label/words.js")),
    ("/label/de.json", "application/json", include_str!("../../label/de.json")),
];

/// What is labelled, and who may.
#[derive(Debug, Clone)]
pub struct Bench {
    /// The clips.
    pub clips: Arc<Clips>,
    /// Who may change labels.
    pub guard: Arc<Guard>,
}

impl From<clips::Error> for Refusal {
    fn from(why: clips::Error) -> Self {
        use label_file::Error as Labels;
        let status = match &why {
            clips::Error::Unknown(_)
            | clips::Error::Labels(Labels::Outside(Outside::Frame { .. })) => StatusCode::NOT_FOUND,
            clips::Error::Labels(Labels::Outside(Outside::Picture { .. })) => {
                StatusCode::UNPROCESSABLE_ENTITY
            }
            clips::Error::Labels(Labels::Unwritable { .. }) => StatusCode::SERVICE_UNAVAILABLE,
            // A file that is not what it should be is no fault of the server's.
            _ => StatusCode::CONFLICT,
        };
        Self::new(status, why)
    }
}

type Named = WithRejection<Path<String>, Refusal>;
type Numbered = WithRejection<Path<(String, usize)>, Refusal>;

pub(super) fn routes() -> OpenApiRouter<Bench> {
    OpenApiRouter::new()
        .routes(routes!(clips))
        .routes(routes!(clip))
        .routes(routes!(frame))
        .routes(routes!(list))
        .routes(routes!(csv))
        .routes(routes!(put_label, delete_label))
}

/// The tool's own files.
pub(super) fn tool() -> Router {
    let mut router = Router::new().route("/label", get(|| async { Redirect::to("/label/") }));
    for (path, kind, text) in TOOL {
        let kind = format!("{kind}; charset=utf-8");
        let file = move || async move { ([(header::CONTENT_TYPE, kind)], text) };
        router = router.route(path, get(file));
    }
    router
}

/// The tool for one bench alone: nothing of a court is known or told.
pub fn router(bench: Bench) -> Router {
    let guard = Arc::clone(&bench.guard);
    let (api, _) = OpenApiRouter::new().nest("/api/v1", routes()).split_for_parts();
    let router = api.with_state(bench).merge(tool()).fallback(super::nothing_here);
    super::walled(router.method_not_allowed_fallback(super::wrong_method), guard)
}

async fn of_clip<T: Send + 'static>(
    bench: &Bench,
    name: String,
    work: impl FnOnce(&Clip) -> Answer<T> + Send + 'static,
) -> Answer<T> {
    let clips = Arc::clone(&bench.clips);
    aside(move || work(&*clips.clip(&name)?)).await
}

/// Clips that can be labelled, the newest first.
#[utoipa::path(get, path = "/clips", responses((status = 200, body = ClipViews)))]
async fn clips(State(bench): State<Bench>) -> Answer<Json<ClipViews>> {
    let rows = aside(move || {
        let row = |clip: clips::Listed| {
            let clips::Listed { name, bytes, at_ms, is_labelled } = clip;
            ClipRow { name, bytes, at_ms, is_labelled }
        };
        Ok(bench.clips.listed().into_iter().map(row).collect())
    });
    Ok(Json(ClipViews { clips: rows.await? }))
}

/// A clip.
#[utoipa::path(get, path = "/clips/{clip}", params(("clip" = String, Path)), responses(
    (status = 200, body = ClipView), (status = 400, body = Problem),
    (status = 404, body = Problem), (status = 409, body = Problem)))]
async fn clip(
    State(bench): State<Bench>,
    WithRejection(Path(name), _): Named,
) -> Answer<Json<ClipView>> {
    let view = |clip: &Clip| {
        let label_file::Extent { n_frames, size_px: (width_px, height_px) } = clip.extent();
        let path = clip.labels_path();
        let labels_file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let (name, frame_rate_hz) = (clip.name().to_owned(), clip.frame_rate_hz());
        Ok(ClipView { name, labels_file, width_px, height_px, n_frames, frame_rate_hz })
    };
    Ok(Json(of_clip(&bench, name, view).await?))
}

/// A frame of a clip; the first is 0.
#[utoipa::path(get, path = "/clips/{clip}/frames/{frame}",
    params(("clip" = String, Path), ("frame" = usize, Path)), responses(
    (status = 200, body = Vec<u8>, content_type = "image/png"), (status = 400, body = Problem),
    (status = 404, body = Problem), (status = 409, body = Problem)))]
async fn frame(
    State(bench): State<Bench>,
    WithRejection(Path((name, frame_idx)), _): Numbered,
) -> Answer<impl IntoResponse> {
    let turn = PACKING.acquire().await;
    let png = of_clip(&bench, name, move |clip| Ok(clip.png(frame_idx)?)).await;
    drop(turn);
    Ok(([(header::CONTENT_TYPE, "image/png")], png?))
}

/// Where the ball is, in every frame that is labelled.
#[utoipa::path(get, path = "/clips/{clip}/labels", params(("clip" = String, Path)), responses(
    (status = 200, body = LabelViews), (status = 400, body = Problem),
    (status = 404, body = Problem), (status = 409, body = Problem)))]
async fn list(
    State(bench): State<Bench>,
    WithRejection(Path(name), _): Named,
) -> Answer<Json<LabelViews>> {
    let view = |(&frame_idx, label): (&usize, &Label)| {
        let Label { x_px, y_px, is_hard } = *label;
        LabelView { frame_idx, x_px, y_px, is_hard }
    };
    let all = move |clip: &Clip| Ok(clip.labels().iter().map(view).collect());
    Ok(Json(LabelViews { labels: of_clip(&bench, name, all).await? }))
}

/// The labels as `evaluate` reads them: frame,x_px,y_px[,hard].
#[utoipa::path(get, path = "/clips/{clip}/labels.csv", params(("clip" = String, Path)), responses(
    (status = 200, body = String, content_type = "text/csv"), (status = 400, body = Problem),
    (status = 404, body = Problem), (status = 409, body = Problem)))]
async fn csv(
    State(bench): State<Bench>,
    WithRejection(Path(name), _): Named,
) -> Answer<impl IntoResponse> {
    let stem = name.trim_end_matches(".y4m").replace(['"', '\\'], "");
    let text = of_clip(&bench, name, |clip| {
        let mut text = Vec::new();
        let wrong = |why| Refusal::new(StatusCode::CONFLICT, why);
        labels::to_csv(&clip.labels(), &mut text).map_err(wrong)?;
        Ok(text)
    });
    let disposition = format!("attachment; filename=\"{stem}.csv\"");
    let kind = "text/csv; charset=utf-8".to_owned();
    Ok(([(header::CONTENT_TYPE, kind), (header::CONTENT_DISPOSITION, disposition)], text.await?))
}

/// The ball is here.
#[utoipa::path(put, path = "/clips/{clip}/labels/{frame}",
    params(("clip" = String, Path), ("frame" = usize, Path)),
    request_body = LabelBody, security(("token" = [])), responses((status = 204),
    (status = 400, body = Problem), (status = 401, body = Problem), (status = 404, body = Problem),
    (status = 409, body = Problem), (status = 413, body = Problem), (status = 415, body = Problem),
    (status = 422, body = Problem), (status = 503, body = Problem)))]
async fn put_label(
    State(bench): State<Bench>,
    headers: HeaderMap,
    WithRejection(Path((name, frame_idx)), _): Numbered,
    body: Result<Json<LabelBody>, JsonRejection>,
) -> Answer<StatusCode> {
    bench.guard.check_token(&headers)?;
    let Json(LabelBody { x_px, y_px, is_hard }) = body?;
    changed(bench, name, frame_idx, Some(Label { x_px, y_px, is_hard })).await
}

/// There is no label in this frame.
#[utoipa::path(delete, path = "/clips/{clip}/labels/{frame}",
    params(("clip" = String, Path), ("frame" = usize, Path)),
    security(("token" = [])), responses((status = 204), (status = 400, body = Problem),
    (status = 401, body = Problem), (status = 404, body = Problem), (status = 409, body = Problem),
    (status = 503, body = Problem)))]
async fn delete_label(
    State(bench): State<Bench>,
    headers: HeaderMap,
    WithRejection(Path((name, frame_idx)), _): Numbered,
) -> Answer<StatusCode> {
    bench.guard.check_token(&headers)?;
    changed(bench, name, frame_idx, None).await
}

async fn changed(
    bench: Bench,
    name: String,
    frame_idx: usize,
    label: Option<Label>,
) -> Answer<StatusCode> {
    aside(move || Ok(bench.clips.update(&name, frame_idx, label)?)).await?;
    Ok(StatusCode::NO_CONTENT)
}

#[cfg(test)]
mod tests;

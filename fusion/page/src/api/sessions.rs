//! Sessions: their figures, and their balls to take away.

use super::{Answer, Hall, Refusal};
use crate::desk::Desk;
use crate::figures;
use crate::history::Outline;
use crate::views::{Problem, Session, SessionRow, Sessions};
use axum::Json;
use axum::body::Body;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;
use axum_extra::extract::WithRejection;
use serde::Deserialize;
use std::fs::File;
use std::io::{BufWriter, Seek as _, Write as _};
use tokio::sync::Semaphore;
use tokio_util::io::ReaderStream;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Most balls of a session that are exported or counted for figures: a day of one every 3 s.
const MAX_BALLS: usize = 28_800;
/// Balls that are read at a time for an export.
const AT_A_TIME: usize = 100;
/// Who watches may export too: so many at a time, and the others wait.
static EXPORTING: Semaphore = Semaphore::const_new(1);
/// Characters of a session's name.
const MAX_NAME: usize = 60;

pub(super) fn routes() -> OpenApiRouter<Hall> {
    OpenApiRouter::new()
        .routes(routes!(sessions, begin))
        .routes(routes!(session))
        .routes(routes!(csv))
        .routes(routes!(json))
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct Asked {
    /// At most so many.
    #[param(minimum = 1, maximum = 500, default = 50)]
    limit: Option<usize>,
    /// Older than this one.
    before: Option<i64>,
}

/// Sessions, newest first.
#[utoipa::path(get, path = "/sessions", params(Asked), responses(
    (status = 200, body = Sessions), (status = 400, body = Problem)))]
async fn sessions(
    State(hall): State<Hall>,
    WithRejection(Query(asked), _): WithRejection<Query<Asked>, Refusal>,
) -> Answer<Json<Sessions>> {
    let limit = super::checked_limit(asked.limit)?;
    let before = asked.before;
    let sessions = hall.aside(move |desk| Ok(desk.history.sessions(before, limit)?)).await?;
    let next = sessions.last().filter(|_| sessions.len() == limit).map(|session| session.id);
    Ok(Json(Sessions { sessions, next }))
}

/// What a new session is called.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct NewSession {
    /// 1 to 60 characters on one line.
    #[schema(min_length = 1, max_length = 60)]
    name: String,
}

/// A new session begins; the one before it has ended.
#[utoipa::path(post, path = "/sessions", request_body = NewSession, security(("token" = [])),
    responses((status = 200, body = SessionRow), (status = 400, body = Problem),
    (status = 401, body = Problem), (status = 413, body = Problem), (status = 415, body = Problem),
    (status = 422, body = Problem)))]
async fn begin(
    State(hall): State<Hall>,
    headers: HeaderMap,
    body: Result<Json<NewSession>, axum::extract::rejection::JsonRejection>,
) -> Answer<Json<SessionRow>> {
    hall.trusted(&headers)?;
    let Json(NewSession { name }) = body?;
    let n = name.chars().count();
    if !(1..=MAX_NAME).contains(&n) || name.chars().any(char::is_control) {
        let error = format!("name is {n} characters, expected 1 to {MAX_NAME} on one line");
        return Err(Refusal::new(StatusCode::BAD_REQUEST, error));
    }
    Ok(Json(hall.desk.begin_session(Some(name))))
}

fn outlined(desk: &Desk, id: i64) -> Answer<(SessionRow, Vec<Outline>)> {
    let row = desk.history.session(id)?;
    let row = row.ok_or_else(|| Refusal::nothing(format!("there is no session {id}")))?;
    Ok((row, desk.history.outlines(id, MAX_BALLS)?))
}

/// A session with its figures and balls, in a file that is gone when it is closed: a day's is too
/// much for memory.
fn exported(desk: &Desk, id: i64) -> Answer<File> {
    let (row, outlines) = outlined(desk, id)?;
    let mut next_id = outlines.first().map(|outline| outline.row.id);
    let export =
        figures::Export { schema: "tennis-session/1", session: figures::session(row, &outlines) };
    drop(outlines);
    let wrong = |why: std::io::Error| Refusal::new(StatusCode::SERVICE_UNAVAILABLE, why);
    let mut file = BufWriter::new(tempfile::tempfile_in(desk.history.folder()).map_err(wrong)?);
    let head = serde_json::to_string(&export).map_err(|why| wrong(why.into()))?;
    // Another member of the same object.
    let head = head.strip_suffix('}').unwrap_or(&head);
    write!(file, "{head},\"balls\":[").map_err(wrong)?;
    let mut before = "";
    while let Some(from_id) = next_id {
        // In parts, so that others read in between.
        let part = desk.history.texts(id, from_id, AT_A_TIME)?;
        for (_, text) in &part {
            write!(file, "{before}{text}").map_err(wrong)?;
            before = ",";
        }
        next_id = part.last().filter(|_| part.len() == AT_A_TIME).map(|(id, _)| id + 1);
    }
    write!(file, "]}}").map_err(wrong)?;
    let mut file = file.into_inner().map_err(|why| wrong(why.into_error()))?;
    file.rewind().map_err(wrong)?;
    Ok(file)
}

/// One session with its figures.
#[utoipa::path(get, path = "/sessions/{id}", params(("id" = i64, Path)), responses(
    (status = 200, body = Session), (status = 400, body = Problem),
    (status = 404, body = Problem)))]
async fn session(
    State(hall): State<Hall>,
    WithRejection(Path(id), _): WithRejection<Path<i64>, Refusal>,
) -> Answer<Json<Session>> {
    let of =
        move |desk: &Desk| outlined(desk, id).map(|(row, balls)| figures::session(row, &balls));
    Ok(Json(hall.aside(of).await?))
}

/// All balls of a session, a line each.
#[utoipa::path(get, path = "/sessions/{id}/balls.csv", params(("id" = i64, Path)), responses(
    (status = 200, body = String, content_type = "text/csv"), (status = 400, body = Problem),
    (status = 404, body = Problem)))]
async fn csv(
    State(hall): State<Hall>,
    WithRejection(Path(id), _): WithRejection<Path<i64>, Refusal>,
) -> Answer<impl IntoResponse> {
    let text = hall.aside(move |desk| Ok(figures::csv(&outlined(desk, id)?.1))).await?;
    let disposition = format!("attachment; filename=\"session-{id}.csv\"");
    let kind = "text/csv; charset=utf-8".to_owned();
    Ok(([(header::CONTENT_TYPE, kind), (header::CONTENT_DISPOSITION, disposition)], text))
}

/// A session with its figures and all its balls.
#[utoipa::path(get, path = "/sessions/{id}/session.json", params(("id" = i64, Path)), responses(
    (status = 200, body = Session, description = "the session, and `balls` with all its balls"),
    (status = 400, body = Problem), (status = 404, body = Problem),
    (status = 503, body = Problem)))]
async fn json(
    State(hall): State<Hall>,
    WithRejection(Path(id), _): WithRejection<Path<i64>, Refusal>,
) -> Answer<impl IntoResponse> {
    let turn = EXPORTING.acquire().await;
    let file = hall.aside(move |desk| exported(desk, id)).await;
    drop(turn);
    let body = Body::from_stream(ReaderStream::new(tokio::fs::File::from_std(file?)));
    let disposition = format!("attachment; filename=\"session-{id}.json\"");
    let kind = "application/json".to_owned();
    Ok(([(header::CONTENT_TYPE, kind), (header::CONTENT_DISPOSITION, disposition)], body))
}

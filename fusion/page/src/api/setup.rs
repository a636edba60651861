//! Cameras, calibration, pairing, recordings and the log.

use super::{Answer, Hall, Refusal};
use crate::desk::Desk;
use crate::setup::jobs::{self, Task};
use crate::setup::{Error, look};
use crate::views::{CameraView, Job, Problem, Recording, Recordings, Said};
use axum::Json;
use axum::body::Body;
use axum::extract::rejection::JsonRejection;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum_extra::extract::WithRejection;
use serde::{Deserialize, Serialize};
use shm_layout::Camera;
use std::time::UNIX_EPOCH;
use tokio_util::io::ReaderStream;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Longest recording: with candidates alone, some 100 MB.
const MAX_SECONDS: u32 = 600;
/// Recordings that are listed.
const MAX_RECORDINGS: usize = 1000;

pub(super) fn routes() -> OpenApiRouter<Hall> {
    OpenApiRouter::new()
        .routes(routes!(look_at))
        .routes(routes!(picture))
        .routes(routes!(view))
        .routes(routes!(calibrate))
        .routes(routes!(job))
        .routes(routes!(use_calibration))
        .routes(routes!(found))
        .routes(routes!(rig))
        .routes(routes!(pair))
        .routes(routes!(pair_file))
        .routes(routes!(record, recordings))
        .routes(routes!(recording))
        .routes(routes!(log))
}

impl From<Error> for Refusal {
    fn from(why: Error) -> Self {
        // None is a fault of the server's: a board is silent, a picture shows no court.
        Self::new(StatusCode::CONFLICT, why)
    }
}

type Named = WithRejection<Path<String>, Refusal>;
type Numbered = WithRejection<Path<u64>, Refusal>;

fn camera_from(name: &str) -> Answer<Camera> {
    name.parse().map_err(|why| Refusal::new(StatusCode::BAD_REQUEST, why))
}

/// Fetches a new picture from a board.
#[utoipa::path(post, path = "/cameras/{camera}/look", params(("camera" = String, Path)),
    security(("token" = [])), responses((status = 200, body = CameraView),
    (status = 400, body = Problem), (status = 401, body = Problem),
    (status = 409, body = Problem)))]
async fn look_at(
    State(hall): State<Hall>,
    headers: HeaderMap,
    WithRejection(Path(name), _): Named,
) -> Answer<Json<CameraView>> {
    hall.trusted(&headers)?;
    let camera = camera_from(&name)?;
    let looked = move |desk: &Desk| Ok(look::view(desk, camera, &desk.setup.look(camera)?));
    Ok(Json(hall.aside(looked).await?))
}

fn not_looked(camera: Camera) -> Refusal {
    Refusal::nothing(format!("no picture of {camera} was fetched yet"))
}

/// The last picture that was fetched.
#[utoipa::path(get, path = "/cameras/{camera}/picture.png", params(("camera" = String, Path)),
    responses((status = 200, body = Vec<u8>, content_type = "image/png"),
    (status = 400, body = Problem), (status = 404, body = Problem)))]
async fn picture(
    State(hall): State<Hall>,
    WithRejection(Path(name), _): Named,
) -> Answer<impl IntoResponse> {
    let camera = camera_from(&name)?;
    let seen = hall.desk.setup.seen(camera).ok_or_else(|| not_looked(camera))?;
    Ok(([(header::CONTENT_TYPE, "image/png")], seen.png.to_vec()))
}

/// How sharp and bright it is, and what is in it.
#[utoipa::path(get, path = "/cameras/{camera}/view", params(("camera" = String, Path)),
    responses((status = 200, body = CameraView), (status = 400, body = Problem),
    (status = 404, body = Problem)))]
async fn view(
    State(hall): State<Hall>,
    WithRejection(Path(name), _): Named,
) -> Answer<Json<CameraView>> {
    let camera = camera_from(&name)?;
    let seen = hall.desk.setup.seen(camera).ok_or_else(|| not_looked(camera))?;
    Ok(Json(hall.aside(move |desk| Ok(look::view(desk, camera, &seen))).await?))
}

/// How the rig is found.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct NewCalibration {
    /// "court": from the painted lines.
    kind: String,
    /// Of both lenses, 100 to 20000; null: begin with the rig there is.
    focal_px: Option<f64>,
}

/// Begins a calibration.
#[utoipa::path(post, path = "/setup/calibrations", request_body = NewCalibration,
    security(("token" = [])), responses((status = 200, body = Job), (status = 400, body = Problem),
    (status = 401, body = Problem), (status = 409, body = Problem), (status = 413, body = Problem),
    (status = 415, body = Problem), (status = 422, body = Problem)))]
async fn calibrate(
    State(hall): State<Hall>,
    headers: HeaderMap,
    body: Result<Json<NewCalibration>, JsonRejection>,
) -> Answer<Json<Job>> {
    hall.trusted(&headers)?;
    let Json(NewCalibration { kind, focal_px }) = body?;
    if kind != "court" || focal_px.is_some_and(|px| !(100.0..=20_000.0).contains(&px)) {
        let error = format!(
            "kind is {kind:?}, focal_px {focal_px:?}: expected \"court\", and null or 100 to 20000"
        );
        return Err(Refusal::new(StatusCode::BAD_REQUEST, error));
    }
    Ok(Json(jobs::begin(&hall.desk, Task::Calibrate { focal_px })?))
}

/// How a job stands.
#[utoipa::path(get, path = "/setup/jobs/{id}", params(("id" = u64, Path)), responses(
    (status = 200, body = Job), (status = 400, body = Problem), (status = 404, body = Problem)))]
async fn job(State(hall): State<Hall>, WithRejection(Path(id), _): Numbered) -> Answer<Json<Job>> {
    let job = hall.desk.setup.jobs.job(id);
    job.map(Json).ok_or_else(|| Refusal::nothing(format!("there is no job {id}")))
}

/// Only calibrations of this run that went well have files.
fn calibrated(desk: &Desk, id: u64) -> Answer<()> {
    let job = desk.setup.jobs.job(id);
    match job.filter(|job| job.kind == "calibration" && job.state == "done") {
        Some(_) => Ok(()),
        None => Err(Refusal::nothing(format!("there is no calibration {id} that went well"))),
    }
}

/// Puts a calibration's rig in the place of the one there is, which is kept.
#[utoipa::path(post, path = "/setup/calibrations/{id}/use", params(("id" = u64, Path)),
    security(("token" = [])), responses((status = 200, body = Said), (status = 400, body = Problem),
    (status = 401, body = Problem), (status = 404, body = Problem),
    (status = 409, body = Problem)))]
async fn use_calibration(
    State(hall): State<Hall>,
    headers: HeaderMap,
    WithRejection(Path(id), _): Numbered,
) -> Answer<Json<Said>> {
    hall.trusted(&headers)?;
    let used = move |desk: &Desk| {
        calibrated(desk, id)?;
        Ok(jobs::use_calibration(desk, id)?)
    };
    Ok(Json(Said { sentence: hall.aside(used).await? }))
}

async fn calibration_file(hall: &Hall, id: u64, name: &'static str) -> Answer<Vec<u8>> {
    let read = move |desk: &Desk| {
        calibrated(desk, id)?;
        let path = jobs::folder_of(desk, id).join(name);
        std::fs::read(&path).map_err(|_| Refusal::nothing(format!("there is no {name}")))
    };
    hall.aside(read).await
}

/// Both pictures with the lines that were found.
#[utoipa::path(get, path = "/setup/calibrations/{id}/found.png", params(("id" = u64, Path)),
    responses((status = 200, body = Vec<u8>, content_type = "image/png"),
    (status = 400, body = Problem), (status = 404, body = Problem)))]
async fn found(
    State(hall): State<Hall>,
    WithRejection(Path(id), _): Numbered,
) -> Answer<impl IntoResponse> {
    let png = calibration_file(&hall, id, "found.png").await?;
    Ok(([(header::CONTENT_TYPE, "image/png")], png))
}

/// The rig that was found.
#[utoipa::path(get, path = "/setup/calibrations/{id}/rig.toml", params(("id" = u64, Path)),
    responses((status = 200, body = String, content_type = "application/toml"),
    (status = 400, body = Problem), (status = 404, body = Problem)))]
async fn rig(
    State(hall): State<Hall>,
    WithRejection(Path(id), _): Numbered,
) -> Answer<impl IntoResponse> {
    let text = calibration_file(&hall, id, "rig.toml").await?;
    let disposition = "attachment; filename=\"rig.toml\"";
    Ok((
        [(header::CONTENT_TYPE, "application/toml"), (header::CONTENT_DISPOSITION, disposition)],
        text,
    ))
}

/// Whose keys are made.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct NewPair {
    /// "left" or "right".
    camera: String,
}

/// Keys to carry to a board.
#[derive(Debug, Serialize, ToSchema)]
struct Pair {
    /// Their file, which can be fetched once.
    file: String,
}

/// Makes a board's keys.
#[utoipa::path(post, path = "/setup/pair", request_body = NewPair, security(("token" = [])),
    responses((status = 200, body = Pair), (status = 400, body = Problem),
    (status = 401, body = Problem), (status = 409, body = Problem), (status = 413, body = Problem),
    (status = 415, body = Problem), (status = 422, body = Problem)))]
async fn pair(
    State(hall): State<Hall>,
    headers: HeaderMap,
    body: Result<Json<NewPair>, JsonRejection>,
) -> Answer<Json<Pair>> {
    hall.trusted(&headers)?;
    let Json(NewPair { camera }) = body?;
    let camera = camera_from(&camera)?;
    let paired = move |desk: &Desk| Ok(jobs::at_once(desk, &Task::Pair(camera))?);
    Ok(Json(Pair { file: hall.aside(paired).await? }))
}

/// A board's keys, once: then they are no longer here.
#[utoipa::path(get, path = "/setup/pair/{file}", params(("file" = String, Path)),
    security(("token" = [])), responses(
    (status = 200, body = Vec<u8>, content_type = "application/octet-stream"),
    (status = 400, body = Problem), (status = 401, body = Problem),
    (status = 404, body = Problem)))]
async fn pair_file(
    State(hall): State<Hall>,
    headers: HeaderMap,
    WithRejection(Path(name), _): Named,
) -> Answer<impl IntoResponse> {
    hall.trusted(&headers)?;
    let disposition = format!("attachment; filename=\"{}\"", name.replace('"', ""));
    let taken = move |desk: &Desk| {
        // Compared with the two there may be, so that no name leads elsewhere.
        let files = Camera::BOTH.map(|camera| jobs::pair_file(desk, camera));
        let file =
            files.iter().find(|file| file.file_name().is_some_and(|own| own == name.as_str()));
        let nothing = || Refusal::nothing(format!("there are no keys {name:?}"));
        let bytes = std::fs::read(file.ok_or_else(nothing)?).map_err(|_| nothing())?;
        std::fs::remove_file(file.ok_or_else(nothing)?).map_err(|_| nothing())?;
        Ok(bytes)
    };
    let bytes = hall.aside(taken).await?;
    Ok(([(header::CONTENT_DISPOSITION, disposition)], bytes))
}

/// How long is recorded.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct NewRecording {
    /// 1 to 600.
    #[schema(minimum = 1, maximum = 600)]
    seconds: u32,
}

/// Begins a recording of candidates and shots.
#[utoipa::path(post, path = "/setup/recordings", request_body = NewRecording,
    security(("token" = [])), responses((status = 200, body = Job), (status = 400, body = Problem),
    (status = 401, body = Problem), (status = 409, body = Problem), (status = 413, body = Problem),
    (status = 415, body = Problem), (status = 422, body = Problem)))]
async fn record(
    State(hall): State<Hall>,
    headers: HeaderMap,
    body: Result<Json<NewRecording>, JsonRejection>,
) -> Answer<Json<Job>> {
    hall.trusted(&headers)?;
    let Json(NewRecording { seconds }) = body?;
    if !(1..=MAX_SECONDS).contains(&seconds) {
        let error = format!("seconds is {seconds}, expected 1 to {MAX_SECONDS}");
        return Err(Refusal::new(StatusCode::BAD_REQUEST, error));
    }
    Ok(Json(jobs::begin(&hall.desk, Task::Record { seconds })?))
}

fn listed(desk: &Desk) -> Vec<Recording> {
    let folder = desk.setup.place.data.join("recordings");
    let mut recordings = Vec::new();
    // Without a folder nothing was recorded yet.
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Ok(about) = entry.metadata() else { continue };
        if !about.is_file() || !name.ends_with(".mcap") || recordings.len() == MAX_RECORDINGS {
            continue;
        }
        let written = about.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok());
        let at_ms = written.map_or(0, |since| i64::try_from(since.as_millis()).unwrap_or(0));
        recordings.push(Recording { name, bytes: about.len(), at_ms });
    }
    recordings.sort_by_key(|recording| std::cmp::Reverse(recording.at_ms));
    recordings
}

/// What was recorded.
#[utoipa::path(get, path = "/setup/recordings", responses((status = 200, body = Recordings)))]
async fn recordings(State(hall): State<Hall>) -> Answer<Json<Recordings>> {
    let recordings = hall.aside(|desk| Ok(listed(desk))).await?;
    Ok(Json(Recordings { recordings }))
}

/// A recording, for Foxglove or `track`.
#[utoipa::path(get, path = "/setup/recordings/{name}", params(("name" = String, Path)), responses(
    (status = 200, body = Vec<u8>, content_type = "application/octet-stream"),
    (status = 400, body = Problem), (status = 404, body = Problem)))]
async fn recording(
    State(hall): State<Hall>,
    WithRejection(Path(name), _): Named,
) -> Answer<Response> {
    let nothing = format!("there is no recording {name:?}");
    let path = hall.aside(move |desk| {
        // Only what is listed: no name leads elsewhere.
        let is_there = listed(desk).iter().any(|recording| recording.name == name);
        Ok(is_there.then(|| desk.setup.place.data.join("recordings").join(name)))
    });
    let path = path.await?.ok_or_else(|| Refusal::nothing(nothing))?;
    let wrong = |why: std::io::Error| Refusal::nothing(format!("{}: {why}", path.display()));
    let file = tokio::fs::File::open(&path).await.map_err(wrong)?;
    let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{file_name}\"")),
    ];
    Ok((headers, Body::from_stream(ReaderStream::new(file))).into_response())
}

/// What the tools said lately.
#[utoipa::path(get, path = "/logs.txt", security(("token" = [])), responses(
    (status = 200, body = String, content_type = "text/plain"), (status = 401, body = Problem)))]
async fn log(State(hall): State<Hall>, headers: HeaderMap) -> Answer<String> {
    hall.trusted(&headers)?;
    Ok(hall.desk.setup.log())
}

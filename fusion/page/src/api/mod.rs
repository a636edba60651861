//! The routes, each with its OpenAPI; what cannot be done is a status and a [`Problem`].

mod balls;
mod drill;
mod files;
pub mod labels;
mod live;
mod sessions;
mod setup;

use crate::desk::Desk;
use crate::guard::{self, Guard};
use crate::history;
use crate::views::{Court, Problem, Status};
use axum::extract::rejection::{JsonRejection, PathRejection, QueryRejection};
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::{Json, Router};
use std::sync::Arc;
use std::time::Duration;
use tower_http::timeout::TimeoutLayer;
use utoipa::OpenApi;
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityScheme};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// A drill of 200 targets as JSON takes less.
const MAX_BODY_BYTES: usize = 64 * 1024;
/// A request that takes longer is given up; recordings are sent at their own pace.
const ANSWERED_WITHIN: Duration = Duration::from_secs(30);
/// What the page may load, and who may frame it. Plots become pictures by way of a blob.
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; style-src 'self' \
                      'unsafe-inline'; connect-src 'self' ws: wss:; frame-ancestors 'none'; \
                      base-uri 'none'; form-action 'self'";

/// What every route knows.
#[derive(Debug, Clone)]
pub struct Hall {
    /// What there is to tell.
    pub desk: Arc<Desk>,
    /// Who may ask.
    pub guard: Arc<Guard>,
}

/// Why a request is refused.
#[derive(Debug)]
pub struct Refusal {
    status: StatusCode,
    error: String,
}

impl Refusal {
    /// With a sentence.
    pub fn new(status: StatusCode, error: impl ToString) -> Self {
        Self { status, error: error.to_string() }
    }

    /// There is no such thing.
    pub fn nothing(what: impl ToString) -> Self {
        Self::new(StatusCode::NOT_FOUND, what)
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        (self.status, Json(Problem { error: self.error })).into_response()
    }
}

impl From<guard::Error> for Refusal {
    fn from(why: guard::Error) -> Self {
        let status = match why {
            guard::Error::Token => StatusCode::UNAUTHORIZED,
            guard::Error::Host | guard::Error::Origin => StatusCode::FORBIDDEN,
        };
        Self::new(status, why)
    }
}

impl From<history::Error> for Refusal {
    fn from(why: history::Error) -> Self {
        tracing::warn!(%why, "the history cannot be read");
        Self::new(StatusCode::SERVICE_UNAVAILABLE, why)
    }
}

impl From<JsonRejection> for Refusal {
    fn from(why: JsonRejection) -> Self {
        Self::new(why.status(), why.body_text())
    }
}

impl From<QueryRejection> for Refusal {
    fn from(why: QueryRejection) -> Self {
        Self::new(why.status(), why.body_text())
    }
}

impl From<PathRejection> for Refusal {
    fn from(why: PathRejection) -> Self {
        Self::new(why.status(), why.body_text())
    }
}

/// What is asked for, or why it cannot be.
pub type Answer<T> = Result<T, Refusal>;

impl Hall {
    /// Goes on only with the token.
    ///
    /// # Errors
    /// 401 without it.
    pub fn trusted(&self, headers: &HeaderMap) -> Answer<()> {
        Ok(self.guard.check_token(headers)?)
    }

    /// Does what may wait for the disk beside the loop that serves.
    ///
    /// # Errors
    /// What `work` returns.
    pub async fn aside<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Desk) -> Answer<T> + Send + 'static,
    ) -> Answer<T> {
        let desk = Arc::clone(&self.desk);
        aside(move || work(&desk)).await
    }
}

/// As [`Hall::aside`]. What has begun is finished even when the process is asked to end.
async fn aside<T: Send + 'static>(work: impl FnOnce() -> Answer<T> + Send + 'static) -> Answer<T> {
    let done = tokio::task::spawn_blocking(work).await;
    done.unwrap_or_else(|why| Err(Refusal::new(StatusCode::INTERNAL_SERVER_ERROR, why)))
}

/// Most things that are listed at once.
const MAX_LISTED: usize = 500;

fn checked_limit(limit: Option<usize>) -> Answer<usize> {
    match limit.unwrap_or(50) {
        limit if (1..=MAX_LISTED).contains(&limit) => Ok(limit),
        limit => {
            let error = format!("limit is {limit}, expected 1 to {MAX_LISTED}");
            Err(Refusal::new(StatusCode::BAD_REQUEST, error))
        }
    }
}

#[derive(OpenApi)]
#[openapi(info(
    title = "Tennis court",
    description = "What a court's fusion measures, and what a coach may ask of it. SI units; null \
                   is what was not observed. What changes the machine needs the token."
))]
struct Document;

/// All routes of a court.
pub fn router(hall: Hall) -> Router {
    let guard = Arc::clone(&hall.guard);
    let clips = Arc::clone(&hall.desk.setup.clips);
    let bench = labels::Bench { clips, guard: Arc::clone(&guard) };
    let (router, mut document) = OpenApiRouter::with_openapi(Document::openapi())
        .nest(
            "/api/v1",
            OpenApiRouter::new()
                .routes(routes!(status))
                .routes(routes!(court))
                .merge(balls::routes())
                .merge(sessions::routes())
                .merge(drill::routes())
                .merge(setup::routes())
                .merge(labels::routes().with_state(bench))
                .merge(live::routes()),
        )
        .split_for_parts();
    let token = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
    document
        .components
        .get_or_insert_default()
        .security_schemes
        .insert("token".to_owned(), token.into());
    let document = Arc::new(document);
    let router = router
        .with_state(hall)
        .merge(labels::tool())
        .route(
            "/api/v1/openapi.json",
            axum::routing::get(move || async move { Json((*document).clone()) }),
        )
        .route("/api/{*rest}", axum::routing::any(nothing_here))
        .fallback(files::page)
        .method_not_allowed_fallback(wrong_method);
    walled(router, guard)
}

/// The same walls around everything: size, time, who is heard.
fn walled(router: Router, guard: Arc<Guard>) -> Router {
    router
        .layer(DefaultBodyLimit::max(MAX_BODY_BYTES))
        .layer(TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, ANSWERED_WITHIN))
        .layer(middleware::from_fn_with_state(guard, guarded))
}

async fn nothing_here() -> Refusal {
    Refusal::nothing("there is no such address; all are in /api/v1/openapi.json")
}

async fn wrong_method() -> Refusal {
    let error = "this address does not know that method; all are in /api/v1/openapi.json";
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, error)
}

/// Refuses strangers, and says how every answer is to be treated.
async fn guarded(State(guard): State<Arc<Guard>>, request: Request, next: Next) -> Response {
    let mut response = match guard.check_sender(request.headers()) {
        Ok(()) => next.run(request).await,
        Err(why) => Refusal::from(why).into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    if !headers.contains_key(header::CACHE_CONTROL) {
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    }
    response
}

/// All at a glance.
#[utoipa::path(get, path = "/status", responses((status = 200, body = Status)))]
async fn status(State(hall): State<Hall>) -> Json<Status> {
    Json(hall.desk.status())
}

/// The court as it stands still.
#[utoipa::path(get, path = "/court", responses((status = 200, body = Court)))]
async fn court(State(hall): State<Hall>) -> Json<Court> {
    let world = &hall.desk.world;
    Json(crate::court::court_from(&world.court, world.rig.as_ref(), world.machine.as_ref()))
}

#[cfg(test)]
mod tests;

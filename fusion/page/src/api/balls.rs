//! Balls of the history.

use super::{Answer, Hall, Refusal};
use crate::history::Filter;
use crate::views::{Ball, Balls, Problem};
use axum::Json;
use axum::extract::{Path, Query, State};
use axum_extra::extract::WithRejection;
use serde::Deserialize;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

pub(super) fn routes() -> OpenApiRouter<Hall> {
    OpenApiRouter::new().routes(routes!(balls)).routes(routes!(ball))
}

/// Which balls.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct Asked {
    /// Of this session.
    session: Option<i64>,
    /// At most so many.
    #[param(minimum = 1, maximum = 500, default = 50)]
    limit: Option<usize>,
    /// Older than this one.
    before: Option<i64>,
    /// With this outcome.
    outcome: Option<String>,
    /// For the target of this name.
    target: Option<String>,
    /// Told then or later, Unix time in ms.
    from_ms: Option<i64>,
    /// Told then or earlier, Unix time in ms.
    until_ms: Option<i64>,
}

/// Balls, newest first.
#[utoipa::path(get, path = "/balls", params(Asked), responses(
    (status = 200, body = Balls), (status = 400, body = Problem)))]
async fn balls(
    State(hall): State<Hall>,
    WithRejection(Query(asked), _): WithRejection<Query<Asked>, Refusal>,
) -> Answer<Json<Balls>> {
    let limit = super::checked_limit(asked.limit)?;
    let filter = Filter {
        session_id: asked.session,
        before: asked.before,
        outcome: asked.outcome,
        target: asked.target,
        from_ms: asked.from_ms,
        until_ms: asked.until_ms,
    };
    let balls = hall.aside(move |desk| Ok(desk.history.balls(&filter, limit)?)).await?;
    let next = balls.last().filter(|_| balls.len() == limit).map(|ball| ball.id);
    Ok(Json(Balls { balls, next }))
}

/// One ball, with its track.
#[utoipa::path(get, path = "/balls/{id}", params(("id" = i64, Path)), responses(
    (status = 200, body = Ball), (status = 400, body = Problem), (status = 404, body = Problem)))]
async fn ball(
    State(hall): State<Hall>,
    WithRejection(Path(id), _): WithRejection<Path<i64>, Refusal>,
) -> Answer<Json<Ball>> {
    let ball = hall.aside(move |desk| Ok(desk.history.ball(id)?)).await?;
    ball.map(Json).ok_or_else(|| Refusal::nothing(format!("there is no ball {id}")))
}

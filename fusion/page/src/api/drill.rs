//! Drills, aiming, and what a person tells the ball machine.

use super::{Answer, Hall, Refusal};
use crate::aiming::{self, Aiming};
use crate::desk::Desk;
use crate::drill::{Order, Plan, Refused};
use crate::drills::{self, Drills as Folder};
use crate::views::{Aim, Drill, DrillState, Drills, Problem, Target};
use axum::Json;
use axum::extract::rejection::JsonRejection;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum_extra::extract::WithRejection;
use serde::{Deserialize, Serialize};
use tokio::sync::Semaphore;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Who watches may aim too: so many at a time, and the others wait.
static AIMING: Semaphore = Semaphore::const_new(1);

type Body<T> = Result<Json<T>, JsonRejection>;

pub(super) fn routes() -> OpenApiRouter<Hall> {
    OpenApiRouter::new()
        .routes(routes!(list))
        .routes(routes!(keep, remove))
        .routes(routes!(aim))
        .routes(routes!(start))
        .routes(routes!(stop))
        .routes(routes!(correcting))
        .routes(routes!(emergency_stop))
        .routes(routes!(resume))
}

impl From<drills::Error> for Refusal {
    fn from(why: drills::Error) -> Self {
        let status = match why {
            drills::Error::Name(_) | drills::Error::Wrong(_) => StatusCode::BAD_REQUEST,
            drills::Error::Unknown(_) => StatusCode::NOT_FOUND,
            drills::Error::Full => StatusCode::CONFLICT,
            drills::Error::File { .. } => StatusCode::SERVICE_UNAVAILABLE,
        };
        Self::new(status, why)
    }
}

impl From<aiming::Error> for Refusal {
    fn from(why: aiming::Error) -> Self {
        let status = match why {
            aiming::Error::NoShot { .. } => StatusCode::BAD_REQUEST,
            aiming::Error::NoMachine | aiming::Error::NoRig => StatusCode::CONFLICT,
        };
        Self::new(status, why)
    }
}

impl From<Refused> for Refusal {
    fn from(why: Refused) -> Self {
        let status = match why {
            Refused::Busy(_) | Refused::Idle | Refused::Stopped | Refused::NotHeard => {
                StatusCode::CONFLICT
            }
            Refused::NotSent(_) | Refused::Ended => StatusCode::SERVICE_UNAVAILABLE,
        };
        Self::new(status, why)
    }
}

fn drills_of(desk: &Desk) -> Answer<&Folder> {
    let missing = || Refusal::new(StatusCode::CONFLICT, "this page keeps no drills");
    desk.drill.drills().ok_or_else(missing)
}

/// Nothing to say.
#[derive(Debug, Serialize, ToSchema)]
struct Done {}

/// All drills, by name.
#[utoipa::path(get, path = "/drills", responses(
    (status = 200, body = Drills), (status = 409, body = Problem), (status = 503, body = Problem)))]
async fn list(State(hall): State<Hall>) -> Answer<Json<Drills>> {
    let drills = hall.aside(|desk| Ok(drills_of(desk)?.all()?)).await?;
    Ok(Json(Drills { drills }))
}

/// Keeps a drill in place of what was called so; each of its targets must be within reach.
#[utoipa::path(put, path = "/drills/{name}", params(("name" = String, Path)),
    request_body = Drill, security(("token" = [])), responses(
    (status = 200, body = Drill), (status = 400, body = Problem), (status = 401, body = Problem),
    (status = 409, body = Problem), (status = 413, body = Problem), (status = 415, body = Problem),
    (status = 422, body = Problem), (status = 503, body = Problem)))]
async fn keep(
    State(hall): State<Hall>,
    headers: HeaderMap,
    WithRejection(Path(name), _): WithRejection<Path<String>, Refusal>,
    body: Body<Drill>,
) -> Answer<Json<Drill>> {
    hall.trusted(&headers)?;
    let Json(drill) = body?;
    if drill.name != name {
        let error = "the drill's name is not that of its address";
        return Err(Refusal::new(StatusCode::BAD_REQUEST, error));
    }
    if drill.targets.len() > fusion::drill::MAX_TARGETS {
        let error = format!("the drill has {} targets, expected 1 to 200", drill.targets.len());
        return Err(Refusal::new(StatusCode::BAD_REQUEST, error));
    }
    let work = |desk: &Desk| {
        let aiming = Aiming::new(&desk.world)?;
        for target in &drill.targets {
            aiming.settings(target)?;
        }
        drills_of(desk)?.keep(&drill, aiming.machine)?;
        Ok(Json(drill))
    };
    hall.aside(work).await
}

/// Deletes a drill; one that runs goes on.
#[utoipa::path(delete, path = "/drills/{name}", params(("name" = String, Path)),
    security(("token" = [])), responses(
    (status = 200, body = Done), (status = 400, body = Problem), (status = 401, body = Problem),
    (status = 404, body = Problem), (status = 409, body = Problem),
    (status = 503, body = Problem)))]
async fn remove(
    State(hall): State<Hall>,
    headers: HeaderMap,
    WithRejection(Path(name), _): WithRejection<Path<String>, Refusal>,
) -> Answer<Json<Done>> {
    hall.trusted(&headers)?;
    hall.aside(move |desk| Ok(drills_of(desk)?.remove(&name)?)).await?;
    Ok(Json(Done {}))
}

/// What the machine would be told for a target, and the flight; of the nearest if it cannot do it.
#[utoipa::path(post, path = "/aim", request_body = Target, responses(
    (status = 200, body = Aim), (status = 400, body = Problem), (status = 408, body = Problem),
    (status = 409, body = Problem), (status = 413, body = Problem), (status = 415, body = Problem),
    (status = 422, body = Problem)))]
async fn aim(State(hall): State<Hall>, body: Body<Target>) -> Answer<Json<Aim>> {
    let Json(target) = body?;
    let turn = AIMING.acquire().await;
    let aimed = hall.aside(move |desk| Ok(Aiming::new(&desk.world)?.aim(&target)?)).await;
    drop(turn);
    aimed.map(Json)
}

/// Which drill, and how.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Start {
    /// Its name.
    name: String,
    /// What fusion learns is used.
    is_correcting: bool,
    /// So many balls; null: until stopped.
    #[schema(minimum = 1, maximum = 10_000)]
    balls: Option<u32>,
}

/// A drill begins.
#[utoipa::path(post, path = "/drill/start", request_body = Start, security(("token" = [])),
    responses((status = 200, body = DrillState), (status = 400, body = Problem),
    (status = 401, body = Problem), (status = 404, body = Problem), (status = 409, body = Problem),
    (status = 413, body = Problem), (status = 415, body = Problem), (status = 422, body = Problem),
    (status = 503, body = Problem)))]
async fn start(
    State(hall): State<Hall>,
    headers: HeaderMap,
    body: Body<Start>,
) -> Answer<Json<DrillState>> {
    hall.trusted(&headers)?;
    let Json(start) = body?;
    if let Some(balls) = start.balls.filter(|balls| !(1..=10_000).contains(balls)) {
        let error = format!("balls is {balls}, expected 1 to 10000, or null until it is stopped");
        return Err(Refusal::new(StatusCode::BAD_REQUEST, error));
    }
    let plan = hall.aside(move |desk| plan_of(desk, start)).await?;
    Ok(Json(hall.desk.drill.order(Order::Start(Box::new(plan))).await?))
}

fn plan_of(desk: &Desk, start: Start) -> Answer<Plan> {
    let running = desk.drill_state();
    if running.running {
        return Err(Refused::Busy(running.name.unwrap_or_default()).into());
    }
    let Start { name, is_correcting, balls } = start;
    let drills = drills_of(desk)?;
    drills.drill(&name)?; // whether there is one, even where nothing can be aimed
    let aiming = Aiming::new(&desk.world)?;
    let (drill, targets) = drills.played(&name, aiming.machine)?;
    let aims = targets.iter().map(|target| aiming.settings(target)).collect::<Result<_, _>>()?;
    Ok(Plan { name, drill, targets, aims, is_correcting, balls })
}

/// The drill ends after the ball that is under way.
#[utoipa::path(post, path = "/drill/stop", security(("token" = [])), responses(
    (status = 200, body = DrillState), (status = 401, body = Problem),
    (status = 409, body = Problem), (status = 503, body = Problem)))]
async fn stop(State(hall): State<Hall>, headers: HeaderMap) -> Answer<Json<DrillState>> {
    hall.trusted(&headers)?;
    Ok(Json(hall.desk.drill.order(Order::Stop).await?))
}

/// Whether what fusion learns is used.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Correcting {
    /// From the next ball on.
    is_correcting: bool,
}

/// What fusion learns is used from the next ball on, or not.
#[utoipa::path(post, path = "/drill/correcting", request_body = Correcting,
    security(("token" = [])), responses((status = 200, body = DrillState),
    (status = 400, body = Problem), (status = 401, body = Problem), (status = 409, body = Problem),
    (status = 413, body = Problem), (status = 415, body = Problem), (status = 422, body = Problem),
    (status = 503, body = Problem)))]
async fn correcting(
    State(hall): State<Hall>,
    headers: HeaderMap,
    body: Body<Correcting>,
) -> Answer<Json<DrillState>> {
    hall.trusted(&headers)?;
    let Json(Correcting { is_correcting }) = body?;
    Ok(Json(hall.desk.drill.order(Order::Correcting(is_correcting)).await?))
}

/// Emergency stop: nothing of the machine moves any more, and the drill has ended.
#[utoipa::path(post, path = "/machine/stop", security(("token" = [])), responses(
    (status = 200, body = Done), (status = 401, body = Problem), (status = 409, body = Problem,
    description = "it was sent, but no machine has been heard"), (status = 503, body = Problem)))]
async fn emergency_stop(State(hall): State<Hall>, headers: HeaderMap) -> Answer<Json<Done>> {
    hall.trusted(&headers)?;
    hall.desk.drill.order(Order::EmergencyStop).await?;
    Ok(Json(Done {}))
}

/// After an emergency stop: balls may be fired again. No drill goes on by itself.
#[utoipa::path(post, path = "/machine/resume", security(("token" = [])), responses(
    (status = 200, body = Done), (status = 401, body = Problem), (status = 409, body = Problem,
    description = "it was sent, but no machine has been heard"), (status = 503, body = Problem)))]
async fn resume(State(hall): State<Hall>, headers: HeaderMap) -> Answer<Json<Done>> {
    hall.trusted(&headers)?;
    hall.desk.drill.order(Order::Resume).await?;
    Ok(Json(Done {}))
}

#[cfg(test)]
mod tests;

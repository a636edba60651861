//! What happens, as it happens: one WebSocket for each who watches.

use super::{Answer, Hall, Refusal};
use crate::views::{Problem, Push};
use axum::extract::State;
use axum::extract::ws::{
    Message, WebSocket, WebSocketUpgrade, rejection::WebSocketUpgradeRejection,
};
use axum::http::StatusCode;
use axum::response::Response;
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Who may watch at once.
const MAX_VIEWERS: usize = 64;
/// Who watches says nothing of interest.
const MAX_HEARD_BYTES: usize = 1024;
/// Who does not take a message for so long is cut off.
const TAKEN_WITHIN: Duration = Duration::from_secs(10);

pub(super) fn routes() -> OpenApiRouter<Hall> {
    OpenApiRouter::new().routes(routes!(live))
}

/// A WebSocket: texts with "type" status, ball, correction, drill, watch or job.
#[utoipa::path(get, path = "/live", responses(
    (status = 101, description = "What happens from now on"),
    (status = 400, body = Problem), (status = 426, body = Problem),
    (status = 503, body = Problem)))]
async fn live(
    State(hall): State<Hall>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Answer<Response> {
    let upgrade = upgrade.map_err(|why| {
        let status = why.status();
        let status = if status.is_server_error() { StatusCode::BAD_REQUEST } else { status };
        Refusal::new(status, why.body_text())
    })?;
    if hall.desk.n_viewers() >= MAX_VIEWERS {
        let error = format!("{MAX_VIEWERS} watch already");
        return Err(Refusal::new(StatusCode::SERVICE_UNAVAILABLE, error));
    }
    Ok(upgrade.max_message_size(MAX_HEARD_BYTES).on_upgrade(|socket| show(hall, socket)))
}

async fn show(hall: Hall, mut socket: WebSocket) {
    let mut pushes = hall.desk.watch();
    let status = Push::Status { status: Box::new(hall.desk.status()) };
    let Ok(first) = serde_json::to_string(&status) else { return };
    if !sent(&mut socket, Message::text(first)).await {
        return;
    }
    loop {
        tokio::select! {
            push = pushes.recv() => match push {
                Ok(text) => if !sent(&mut socket, Message::text(&*text)).await { return },
                // Who is behind comes again and asks for what it missed.
                Err(RecvError::Lagged(_) | RecvError::Closed) => return,
            },
            heard = socket.recv() => match heard {
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                Some(Ok(_)) => {}
            },
        }
    }
}

async fn sent(socket: &mut WebSocket, message: Message) -> bool {
    matches!(tokio::time::timeout(TAKEN_WITHIN, socket.send(message)).await, Ok(Ok(())))
}

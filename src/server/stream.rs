//! The event stream: what happens, to one client, as server-sent events.

use std::convert::Infallible;
use std::pin::pin;
use std::time::Duration;

use axum::extract::rejection::QueryRejection;
use axum::extract::{ConnectInfo, Query, State};
use axum::http::HeaderMap;
use axum::response::sse::{self, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use tokio::sync::{mpsc, watch};
use tokio_stream::wrappers::ReceiverStream;
use utoipa::IntoParams;

use super::error::{ErrorBody, ServerError};
use super::feed::{Snapshot, Subscription};
use super::openapi;
use super::places::Ticket;
use super::routes::App;
use crate::session::event::{Event, FeedEvent};
use crate::session::to_json_value;

/// Events on their way to one client; the others wait in the feed.
const IN_FLIGHT: usize = 16;
/// How long one stream may last: a peer that died without a word is let go of then; a browser comes back and misses nothing.
const LONGEST: Duration = Duration::from_secs(600);
/// How soon a browser comes back after a lost connection.
const RETRY: Duration = Duration::from_secs(1);

/// Where an event stream begins.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct After {
    /// The last event the client has; the `Last-Event-ID` header goes before it.
    after: Option<u64>,
}

/// Every event as it happens, as server-sent events.
///
/// `id` is the event's number, `event` its kind, `data` the [`Event`](openapi::StreamedEvent) as JSON. A
/// client that says which event it had last (`Last-Event-ID`, or `after`) gets each later one exactly
/// once. One that says none, or one no longer kept, first gets a `snapshot`, whose data has the
/// status and `seq`, the number of the last event in it. A stream ends after ten minutes, or when it must make room for others:
/// come back with the last number.
#[utoipa::path(get, path = "/events", tag = "run",
    params(After, ("last-event-id" = Option<u64>, Header, description = "The last event the client has")),
    responses(
    (status = 200, description = "The stream; each `data` is a StreamedEvent, or `seq` and `status` for `snapshot`",
     content_type = "text/event-stream", body = openapi::StreamedEvent),
    (status = 400, description = "`after` is no number", body = ErrorBody),
))]
pub(super) async fn events(
    State(app): State<App>,
    ConnectInfo(ticket): ConnectInfo<Ticket>,
    query: Result<Query<After>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let Query(After { after }) = query?;
    let after = match headers.get("last-event-id") {
        // One that is no number was not given out here: unknown, as an earlier daemon's.
        Some(id) => id.to_str().ok().and_then(|id| id.parse().ok()),
        None => after,
    };
    ticket.becomes_stream();
    let (snapshot, subscription) = app.rig.events().subscribe(after);
    let (sender, receiver) = mpsc::channel(IN_FLIGHT);
    tokio::spawn(forward(snapshot, subscription, sender, app.stopping));
    let stream =
        Sse::new(ReceiverStream::new(receiver)).keep_alive(KeepAlive::new().interval(app.keep_alive));
    Ok(stream.into_response())
}

type Sender = mpsc::Sender<Result<sse::Event, Infallible>>;

/// Carries events from the feed to one client, until it leaves, is too slow, or the server ends.
async fn forward(
    snapshot: Option<Snapshot>,
    mut subscription: Subscription,
    sender: Sender,
    mut stopping: watch::Receiver<bool>,
) {
    let first = match snapshot {
        Some(snapshot) => snapshot_message(&snapshot),
        None => Some(sse::Event::default().retry(RETRY).comment("welcome back")),
    };
    let mut message = first;
    let mut end = pin!(tokio::time::sleep(LONGEST));
    while let Some(next) = message {
        if sender.send(Ok(next)).await.is_err() {
            return;
        }
        message = tokio::select! {
            event = subscription.next() => event.and_then(|event| event_message(&event)),
            () = sender.closed() => return,
            () = &mut end => return,
            _ = stopping.wait_for(|stopping| *stopping) => return,
        };
    }
}

fn snapshot_message(snapshot: &Snapshot) -> Option<sse::Event> {
    let message = sse::Event::default().retry(RETRY).id(snapshot.seq.to_string()).event("snapshot");
    let data = serde_json::json!({ "seq": snapshot.seq, "status": snapshot.status });
    message.json_data(data).inspect_err(|error| tracing::error!(%error, "snapshot is no JSON")).ok()
}

fn event_message(event: &Event<FeedEvent>) -> Option<sse::Event> {
    let data = to_json_value(event).inspect_err(|error| tracing::error!(%error, "event is no JSON")).ok()?;
    let kind = data.get("event").and_then(serde_json::Value::as_str)?;
    let message = sse::Event::default().id(event.seq.to_string()).event(kind);
    message.json_data(&data).ok()
}

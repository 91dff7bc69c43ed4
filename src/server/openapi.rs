//! The description of the API, for people and for generators of clients.

use axum::Json;
use jiff::Timestamp;
use serde::Serialize;
use utoipa::{OpenApi, ToSchema};

use super::error::{ErrorBody, ErrorText};
use super::status::{HullPoint, RejectedPicture, RunState, Stage, Status, ViewVerdict, ViewWarning};
use super::{CompressionStarted, CompressionStatus, RunRequest, RunStarted, compressing, routes, stream};
use crate::daemon::{CompressMaterial, CompressRequest};

#[derive(OpenApi)]
#[openapi(
    info(title = "grainrig", description = "Watch and drive the rig."),
    paths(
        routes::status,
        routes::start,
        routes::pause,
        routes::resume,
        routes::abort,
        routes::devices,
        routes::doctor,
        routes::sessions,
        routes::session,
        routes::resume_session,
        routes::frame,
        routes::rejected,
        routes::preview,
        routes::product,
        compressing::start,
        compressing::cancel,
        compressing::resume,
        compressing::list,
        compressing::one,
        compressing::file,
        stream::events,
        document
    ),
    components(schemas(
        Status,
        RunState,
        HullPoint,
        Stage,
        ViewVerdict,
        ViewWarning,
        RejectedPicture,
        RunRequest,
        RunStarted,
        CompressRequest,
        CompressMaterial,
        CompressionStarted,
        CompressionStatus,
        ErrorBody,
        ErrorText,
        StreamedEvent,
        routes::Part
    ))
)]
struct Description;

/// What `data` holds in the event stream: these, and the fields of the kind.
#[derive(Serialize, ToSchema)]
pub(super) struct StreamedEvent {
    /// The event's number: one more than the one before it.
    seq: u64,
    /// When, in UTC.
    #[schema(value_type = String, format = DateTime)]
    time: Timestamp,
    /// The kind: `started`, `homed`, `moving`, `captured`, `rejected`, `suspended`, `paused`, `resumed`, `aborted`,
    /// `acquisition_complete`, `silhouette`, `judged`, `hull`, `working`, `products`, `failed`, `complete` or `compression`.
    event: String,
}

/// This description.
#[utoipa::path(get, path = "/api/v1/openapi.json", tag = "about", responses(
    (status = 200, description = "OpenAPI description", body = Object),
    (status = 401, description = "No token", body = ErrorBody),
))]
pub(super) async fn document() -> Json<utoipa::openapi::OpenApi> {
    Json(Description::openapi())
}

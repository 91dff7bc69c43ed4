//! The description of the API, for people and for generators of clients.

use axum::Json;
use jiff::Timestamp;
use serde::Serialize;
use utoipa::openapi::security::{ApiKey, ApiKeyValue, Http, HttpAuthScheme, SecurityScheme};
use utoipa::{Modify, OpenApi, ToSchema};

use super::error::{ErrorBody, ErrorText};
use super::guard::COOKIE;
use super::status::{HullPoint, RejectedPicture, RunState, Stage, Status, ViewVerdict, ViewWarning};
use super::{
    CompressionStarted, CompressionStatus, JobStarted, JobStatus, RunRequest, RunStarted, compressing, jobs,
    routes, schemas, stream,
};
use crate::daemon::{CompressMaterial, CompressRequest, ComputeRequest};
use crate::pipeline::MeshSettings;

#[derive(OpenApi)]
#[openapi(
    info(title = "grainrig", description = "Watch and drive the rig."),
    // Only a daemon that was given a token asks for one.
    security((), ("bearer" = []), ("cookie" = []), ("query" = [])),
    modifiers(&Tokens),
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
        jobs::list,
        jobs::start,
        jobs::cancel,
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
        ComputeRequest,
        MeshSettings,
        JobStarted,
        JobStatus,
        ErrorBody,
        ErrorText,
        StreamedEvent,
        routes::Part,
        schemas::FileBytes,
        schemas::SessionLine,
        schemas::SessionDetails,
        schemas::FrameLine,
        schemas::ProductLine,
        schemas::GrainResult,
        schemas::HullFigures,
        schemas::MeshFigures,
        schemas::Device,
        schemas::CheckFinding,
        schemas::CompressionLine,
        schemas::CompressionDetails,
        schemas::CompressionFigures,
        schemas::CompressionFile,
        schemas::ForcePoint
    ))
)]
struct Description;

/// The ways of showing the token.
struct Tokens;

impl Modify for Tokens {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let components = document.components.get_or_insert_with(Default::default);
        let bearer = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
        components.add_security_scheme("bearer", bearer);
        let cookie = ApiKey::Cookie(ApiKeyValue::with_description(
            COOKIE,
            "Set by the page that is opened with the token",
        ));
        components.add_security_scheme("cookie", SecurityScheme::ApiKey(cookie));
        let query = ApiKey::Query(ApiKeyValue::with_description(
            "token",
            "For GET alone: pictures and event streams",
        ));
        components.add_security_scheme("query", SecurityScheme::ApiKey(query));
    }
}

/// What `data` holds in the event stream: these, and the fields of the kind.
#[derive(Serialize, ToSchema)]
pub(super) struct StreamedEvent {
    /// The event's number: one more than the one before it.
    seq: u64,
    /// When, in UTC.
    #[schema(value_type = String, format = DateTime)]
    time: Timestamp,
    /// The kind: `started`, `homed`, `moving`, `captured`, `rejected`, `suspended`, `paused`, `resumed`, `aborted`,
    /// `acquisition_complete`, `silhouette`, `judged`, `hull`, `working`, `products`, `failed`, `complete`, `compression` or `job`.
    event: String,
}

/// This description.
#[utoipa::path(get, path = "/api/v1/openapi.json", tag = "about", responses(
    (status = 200, description = "OpenAPI description", body = Object),
    (status = 401, description = "No token, or a wrong one", body = ErrorBody),
    (status = 429, description = "Too many wrong tokens", body = ErrorBody),
))]
pub(super) async fn document() -> Json<utoipa::openapi::OpenApi> {
    Json(Description::openapi())
}

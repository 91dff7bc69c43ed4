//! The routes under `/api/v1`: each translates between HTTP and the rig, and does nothing else.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::rejection::{JsonRejection, PathRejection, QueryRejection};
use axum::extract::{DefaultBodyLimit, Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json, Router, middleware};
use serde::Deserialize;
use tokio::sync::watch;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::trace::TraceLayer;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::error::{ErrorBody, ServerError};
use super::guard::{self, Guard, shortened};
use super::status::Status;
use super::{
    Download, Refusal, Rig, RunRequest, RunStarted, assets, compressing, files, jobs, openapi, schemas,
    stream,
};
use crate::acquire::QualityMode;

/// Largest body that is read.
pub(super) const BODY_LIMIT_BYTES: usize = 64 * 1024;
/// Longest name of a session: it becomes a folder.
pub(super) const SESSION_NAME_LIMIT: usize = 64;
/// Longest name of a file, as file systems have it.
pub(super) const FILE_NAME_LIMIT: usize = 255;

/// What every route knows.
#[derive(Clone)]
pub(super) struct App {
    pub(super) rig: Arc<dyn Rig>,
    pub(super) guard: Arc<Guard>,
    /// Becomes true when the server is to end; event streams end with it.
    pub(super) stopping: watch::Receiver<bool>,
    pub(super) keep_alive: Duration,
}

pub(super) fn router(app: App) -> Router {
    let api = OpenApiRouter::new()
        .routes(routes!(status))
        .routes(routes!(start))
        .routes(routes!(pause))
        .routes(routes!(resume))
        .routes(routes!(abort))
        .routes(routes!(devices))
        .routes(routes!(doctor))
        .routes(routes!(sessions))
        .routes(routes!(session, remove_session))
        .routes(routes!(resume_session))
        .routes(routes!(frame))
        .routes(routes!(rejected))
        .routes(routes!(preview))
        .routes(routes!(product))
        .merge(compressing::routes())
        .merge(jobs::routes())
        .merge(files::routes())
        .routes(routes!(stream::events))
        .routes(routes!(openapi::document));
    let (api, document) = openapi::described(api);
    // Path only: the query may hold the token.
    let trace = TraceLayer::new_for_http().make_span_with(|request: &axum::http::Request<_>| {
        tracing::debug_span!("request", method = %request.method(), path = request.uri().path())
    });
    Router::new()
        .merge(api)
        .layer(Extension(Arc::new(document)))
        .merge(assets::routes())
        .fallback(async || ServerError::NoRoute)
        .method_not_allowed_fallback(async || ServerError::WrongMethod)
        .layer(DefaultBodyLimit::max(BODY_LIMIT_BYTES))
        .layer(CatchPanicLayer::custom(|panic| panicked(panic).into_response()))
        .layer(middleware::from_fn_with_state(app.clone(), guard::guard))
        .layer(trace)
        .with_state(app)
}

/// Where the run stands.
#[utoipa::path(get, path = "/status", tag = "run", responses(
    (status = 200, description = "Where the run stands", body = Status),
))]
pub(super) async fn status(State(app): State<App>) -> Result<Json<serde_json::Value>, ServerError> {
    on_rig(&app, |rig| Ok(rig.status())).await
}

/// Starts a run.
#[utoipa::path(post, path = "/runs", operation_id = "start_run", tag = "run", request_body = RunRequest, responses(
    (status = 201, description = "The run has begun", body = RunStarted,
     headers(("location" = String, description = "The session"))),
    (status = 400, description = "The request makes no sense", body = ErrorBody),
    (status = 409, description = "The rig is busy", body = ErrorBody),
    (status = 507, description = "The disk is full", body = ErrorBody),
))]
pub(super) async fn start(
    State(app): State<App>,
    request: Result<Json<RunRequest>, JsonRejection>,
) -> Result<Response, ServerError> {
    let Json(request) = request?;
    check_name("session", &request.session, SESSION_NAME_LIMIT)?;
    let Json(started) = on_rig(&app, |rig| rig.start(request)).await?;
    let location = format!("/api/v1/sessions/{}", started.session);
    let mut response = (StatusCode::CREATED, Json(started)).into_response();
    if let Ok(location) = location.parse() {
        response.headers_mut().insert(header::LOCATION, location);
    }
    Ok(response)
}

/// Pauses the run after the view being taken.
#[utoipa::path(post, path = "/runs/current/pause", operation_id = "pause_run", tag = "run", responses(
    (status = 204, description = "The run will pause"),
    (status = 409, description = "There is nothing to pause", body = ErrorBody),
))]
pub(super) async fn pause(State(app): State<App>) -> Result<StatusCode, ServerError> {
    on_rig(&app, Rig::pause).await.map(|_| StatusCode::NO_CONTENT)
}

/// Lets a paused run go on.
#[utoipa::path(post, path = "/runs/current/resume", operation_id = "resume_run", tag = "run", responses(
    (status = 204, description = "The run goes on"),
    (status = 409, description = "No run is paused", body = ErrorBody),
))]
pub(super) async fn resume(State(app): State<App>) -> Result<StatusCode, ServerError> {
    on_rig(&app, Rig::resume).await.map(|_| StatusCode::NO_CONTENT)
}

/// Stops the run; what was captured stays.
#[utoipa::path(post, path = "/runs/current/abort", operation_id = "abort_run", tag = "run", responses(
    (status = 204, description = "The run will stop"),
    (status = 409, description = "There is no run", body = ErrorBody),
))]
pub(super) async fn abort(State(app): State<App>) -> Result<StatusCode, ServerError> {
    on_rig(&app, Rig::abort).await.map(|_| StatusCode::NO_CONTENT)
}

/// The devices that are there; none is opened.
#[utoipa::path(get, path = "/devices", tag = "rig", responses(
    (status = 200, description = "The devices", body = Vec<schemas::Device>),
))]
pub(super) async fn devices(State(app): State<App>) -> Result<Json<serde_json::Value>, ServerError> {
    on_rig(&app, Rig::devices).await
}

/// Looks at everything that a run needs: the stage makes a step and comes back, the camera takes a picture.
#[utoipa::path(post, path = "/doctor", tag = "rig", responses(
    (status = 200, description = "What was found", body = Vec<schemas::CheckFinding>),
    (status = 409, description = "The rig is busy", body = ErrorBody),
))]
pub(super) async fn doctor(State(app): State<App>) -> Result<Json<serde_json::Value>, ServerError> {
    on_rig(&app, Rig::doctor).await
}

/// The sessions in the data folder.
#[utoipa::path(get, path = "/sessions", tag = "sessions", responses(
    (status = 200, description = "The sessions", body = Vec<schemas::SessionLine>),
))]
pub(super) async fn sessions(State(app): State<App>) -> Result<Json<serde_json::Value>, ServerError> {
    on_rig(&app, Rig::sessions).await
}

/// One session: its manifest, its frames and its products.
#[utoipa::path(get, path = "/sessions/{id}", tag = "sessions",
    params(("id" = String, Path, description = "Name of the session")), responses(
    (status = 200, description = "The session", body = schemas::SessionDetails),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such session", body = ErrorBody),
))]
pub(super) async fn session(
    State(app): State<App>,
    path: Result<Path<String>, PathRejection>,
) -> Result<Json<serde_json::Value>, ServerError> {
    let Path(id) = path?;
    check_name("session", &id, SESSION_NAME_LIMIT)?;
    on_rig(&app, move |rig| rig.session(&id)).await
}

/// Removes a session with everything in its folder: it is there, or it is gone.
#[utoipa::path(delete, path = "/sessions/{id}", operation_id = "remove_session", tag = "sessions",
    params(("id" = String, Path, description = "Name of the session")), responses(
    (status = 204, description = "It is gone"),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such session", body = ErrorBody),
    (status = 409, description = "It is being written, or a merged grain is made from it", body = ErrorBody),
))]
pub(super) async fn remove_session(
    State(app): State<App>,
    path: Result<Path<String>, PathRejection>,
) -> Result<StatusCode, ServerError> {
    let Path(id) = path?;
    check_name("session", &id, SESSION_NAME_LIMIT)?;
    on_rig(&app, move |rig| rig.remove_session(&id)).await.map(|_| StatusCode::NO_CONTENT)
}

/// How missing views are judged.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct Judged {
    /// What becomes of a picture that is no good: `gate`, `label` or `off`; as the session's configuration says unless told.
    quality: Option<QualityMode>,
}

/// Goes on with a session that was aborted, interrupted or has failed: captures the views that are missing, and computes.
#[utoipa::path(post, path = "/sessions/{id}/resume", tag = "sessions",
    params(("id" = String, Path, description = "Name of the session"), Judged), responses(
    (status = 201, description = "The run goes on", body = RunStarted),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such session", body = ErrorBody),
    (status = 409, description = "The rig is busy, or nothing is left to do", body = ErrorBody),
))]
pub(super) async fn resume_session(
    State(app): State<App>,
    path: Result<Path<String>, PathRejection>,
    query: Result<Query<Judged>, QueryRejection>,
) -> Result<Response, ServerError> {
    let (Path(id), Query(Judged { quality })) = (path?, query?);
    check_name("session", &id, SESSION_NAME_LIMIT)?;
    let started = on_rig(&app, move |rig| rig.resume_session(&id, quality)).await?;
    Ok((StatusCode::CREATED, started).into_response())
}

/// A captured picture, byte for byte as the camera gave it.
#[utoipa::path(get, path = "/sessions/{id}/frames/{file}", tag = "sessions",
    params(("id" = String, Path, description = "Name of the session"),
           ("file" = String, Path, description = "Name of the frame")), responses(
    (status = 200, description = "The picture",
     headers(("etag" = String, description = "SHA-256 of the file")),
     content_type = "image/*", body = schemas::FileBytes),
    (status = 304, description = "The client has it already"),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such session or frame", body = ErrorBody),
    (status = 500, description = "The file is not the one that was recorded", body = ErrorBody),
))]
pub(super) async fn frame(
    State(app): State<App>,
    path: Result<Path<(String, String)>, PathRejection>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    file(&app, path, &headers, Rig::frame).await
}

/// What a preview shows.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Part {
    /// The whole picture.
    #[default]
    Whole,
    /// The grain and what is near it; the whole picture where no grain is found.
    Grain,
}

/// What a preview shows.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct Of {
    /// `whole` (unless told) or `grain`.
    #[serde(default)]
    part: Part,
}

/// A captured picture made small for a screen: a JPEG of some ten kilobytes, at most 1280 pixels wide.
#[utoipa::path(get, path = "/sessions/{id}/previews/{file}", tag = "sessions",
    params(("id" = String, Path, description = "Name of the session"),
           ("file" = String, Path, description = "Name of the frame"), Of), responses(
    (status = 200, description = "The preview",
     headers(("etag" = String, description = "SHA-256 of the preview")),
     content_type = "image/jpeg", body = schemas::FileBytes),
    (status = 304, description = "The client has it already"),
    (status = 400, description = "Not a name, or `part` is neither", body = ErrorBody),
    (status = 404, description = "No such session or frame", body = ErrorBody),
    (status = 500, description = "The file is not the one that was recorded", body = ErrorBody),
))]
pub(super) async fn preview(
    State(app): State<App>,
    path: Result<Path<(String, String)>, PathRejection>,
    query: Result<Query<Of>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let Query(Of { part }) = query?;
    let of_grain = part == Part::Grain;
    file(&app, path, &headers, move |rig, id, file| rig.preview(id, file, of_grain)).await
}

/// The last picture of a view that was refused, as the camera gave it. It is no evidence: nothing vouches for its bytes.
#[utoipa::path(get, path = "/sessions/{id}/rejected/{view}", tag = "sessions",
    params(("id" = String, Path, description = "Name of the session"),
           ("view" = usize, Path, description = "Index of the view")), responses(
    (status = 200, description = "The picture",
     headers(("etag" = String, description = "SHA-256 of the file")),
     content_type = "image/*", body = schemas::FileBytes),
    (status = 304, description = "The client has it already"),
    (status = 400, description = "Not a name, or no index", body = ErrorBody),
    (status = 404, description = "No such session, or no refused picture of that view", body = ErrorBody),
))]
pub(super) async fn rejected(
    State(app): State<App>,
    path: Result<Path<(String, usize)>, PathRejection>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let Path((id, view)) = path?;
    check_name("session", &id, SESSION_NAME_LIMIT)?;
    let Json(download) = on_rig(&app, move |rig| rig.rejected(&id, view)).await?;
    Ok(download.answer(&headers))
}

/// A product: mesh, deck, figure or report.
#[utoipa::path(get, path = "/sessions/{id}/products/{file}", tag = "sessions",
    params(("id" = String, Path, description = "Name of the session"),
           ("file" = String, Path, description = "Name of the product")), responses(
    (status = 200, description = "The product",
     headers(("etag" = String, description = "SHA-256 of the file")),
     content_type = "application/octet-stream", body = schemas::FileBytes),
    (status = 304, description = "The client has it already"),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such session or product", body = ErrorBody),
    (status = 500, description = "The file is not the one that was recorded", body = ErrorBody),
))]
pub(super) async fn product(
    State(app): State<App>,
    path: Result<Path<(String, String)>, PathRejection>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    file(&app, path, &headers, Rig::product).await
}

/// Answers with a file that the rig reads.
async fn file(
    app: &App,
    path: Result<Path<(String, String)>, PathRejection>,
    headers: &HeaderMap,
    read: impl FnOnce(&dyn Rig, &str, &str) -> Result<Download, Refusal> + Send + 'static,
) -> Result<Response, ServerError> {
    let Path((id, name)) = path?;
    check_name("session", &id, SESSION_NAME_LIMIT)?;
    check_name("file", &name, FILE_NAME_LIMIT)?;
    let Json(download) = on_rig(app, move |rig| read(rig, &id, &name)).await?;
    Ok(download.answer(headers))
}

/// The first fence before the disk; the rig checks the name against its own list.
pub(super) fn check_name(what: &'static str, name: &str, limit: usize) -> Result<(), ServerError> {
    let fits = (1..=limit).contains(&name.len()) && !name.starts_with('.');
    if fits && !name.contains(|c: char| c == '/' || c == '\\' || c.is_control()) {
        return Ok(());
    }
    Err(ServerError::BadName { what, name: shortened(name), limit })
}

/// Asks the rig on a thread that may block: it takes locks and reads the disk.
pub(super) async fn on_rig<T: Send + 'static>(
    app: &App,
    ask: impl FnOnce(&dyn Rig) -> Result<T, Refusal> + Send + 'static,
) -> Result<Json<T>, ServerError> {
    let rig = Arc::clone(&app.rig);
    let asked = tokio::task::spawn_blocking(move || ask(rig.as_ref())).await;
    match asked {
        Ok(answer) => Ok(Json(answer?)),
        Err(error) => Err(match error.try_into_panic() {
            Ok(panic) => panicked(panic),
            // Only a runtime that is shutting down cancels a task.
            Err(error) => ServerError::Panicked { detail: error.to_string() },
        }),
    }
}

/// A panic's message, for the log.
fn panicked(panic: Box<dyn std::any::Any + Send>) -> ServerError {
    let detail = match panic.downcast::<String>() {
        Ok(message) => *message,
        Err(panic) => panic.downcast_ref::<&str>().copied().unwrap_or("panic without a message").to_owned(),
    };
    ServerError::Panicked { detail }
}

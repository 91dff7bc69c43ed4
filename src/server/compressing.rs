//! Compressions over HTTP: begun, watched, cancelled, taken up again, their results read.

use axum::Json;
use axum::extract::rejection::{JsonRejection, PathRejection};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::error::{ErrorBody, ServerError};
use super::routes::{App, FILE_NAME_LIMIT, SESSION_NAME_LIMIT, check_name, on_rig};
use super::{Download, Refusal, schemas};
use crate::jobs::CompressRequest;
use crate::session::event::{CompressionState, CompressionUpdate};
use grainrig_core::contact::CurvePoint;

/// Points of the curve that are kept; a compression has some hundreds.
const POINTS_KEPT: usize = 4000;

/// What the server asks of whoever computes compressions. As with [`super::Rig`], methods may block for a moment.
pub trait Compressions: Send + Sync + 'static {
    /// Begins to compress a complete session's grain.
    ///
    /// # Errors
    /// [`super::RefusalKind::Busy`] while another compression goes on, [`super::RefusalKind::Invalid`] for figures that make
    /// no sense or a session without a grain, [`super::RefusalKind::NotFound`] where there is no such session.
    fn compress(&self, id: &str, request: CompressRequest) -> Result<CompressionStarted, Refusal>;

    /// Goes on with a compression that was cancelled or interrupted.
    ///
    /// # Errors
    /// As [`Self::compress`]; [`super::RefusalKind::Busy`] also where it is complete.
    fn resume_compression(&self, id: &str, name: &str) -> Result<(), Refusal>;

    /// Stops the compression; it can go on later.
    ///
    /// # Errors
    /// [`super::RefusalKind::Busy`] where there is none.
    fn cancel_compression(&self) -> Result<(), Refusal>;

    /// The compressions of a session: a JSON array of objects with `name`, `state`, `settings` and `placing`.
    ///
    /// # Errors
    /// [`super::RefusalKind::NotFound`] where there is no such session.
    fn compressions(&self, id: &str) -> Result<serde_json::Value, Refusal>;

    /// One compression: the same with its `files` and, once there is one, its `result`.
    ///
    /// # Errors
    /// [`super::RefusalKind::NotFound`] where there is none of that name.
    fn compression(&self, id: &str, name: &str) -> Result<serde_json::Value, Refusal>;

    /// One of its files. `file` comes from the network: look it up in the list, never join it to a path.
    ///
    /// # Errors
    /// [`super::RefusalKind::NotFound`] where it is not listed.
    fn compression_file(&self, id: &str, name: &str, file: &str) -> Result<Download, Refusal>;
}

/// A compression that has begun.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct CompressionStarted {
    /// Name of its session.
    pub session: String,
    /// Its own name among the session's compressions.
    pub name: String,
}

/// Where a compression stands: its news so far, folded. `web/status.js` does the same.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct CompressionStatus {
    /// Name of its session.
    pub session: String,
    /// Its own name.
    pub name: String,
    /// `meshing`, `running`, `complete`, `cancelled`, `interrupted` or `failed`.
    #[schema(value_type = String)]
    pub state: CompressionState,
    /// What is being done before the plates move, in words; absent afterwards.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<String>,
    /// How much of the way to the end, or of the meshing, is done, 0 to 1.
    pub done: f64,
    /// About how much longer, seconds; `null` before it can be told.
    pub left_s: Option<f64>,
    /// Contacts between grain and plates.
    pub contacts: usize,
    /// Force against the approach of the plates, so far: objects with `approach_mm` and `force_n`.
    #[schema(value_type = Vec<schemas::ForcePoint>)]
    pub curve: Vec<CurvePoint>,
    /// Why it failed.
    pub error: Option<String>,
}

impl CompressionStatus {
    /// What `before` and the news after it make together.
    pub(super) fn after(before: Option<Self>, news: &CompressionUpdate) -> Self {
        let same = before.filter(|b| b.session == news.session && b.name == news.name);
        let mut curve = same.map_or_else(Vec::new, |b| b.curve);
        curve.truncate(news.from);
        if curve.len() == news.from {
            curve.extend(news.points.iter().copied().take(POINTS_KEPT - curve.len()));
        }
        Self {
            session: news.session.clone(),
            name: news.name.clone(),
            state: news.state,
            phase: news.phase.clone(),
            done: news.done,
            left_s: news.left_s,
            contacts: news.contacts,
            curve,
            error: news.error.clone(),
        }
    }
}

pub(super) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(list, start))
        .routes(routes!(one))
        .routes(routes!(resume))
        .routes(routes!(file))
        .routes(routes!(cancel))
}

/// Begins to compress a complete session's grain between two plates, beside whatever the rig does.
#[utoipa::path(post, path = "/sessions/{id}/compressions", operation_id = "start_compression", tag = "compressions",
    params(("id" = String, Path, description = "Name of the session")),
    request_body = CompressRequest, responses(
    (status = 201, description = "The compression has begun", body = CompressionStarted,
     headers(("location" = String, description = "The compression"))),
    (status = 400, description = "The request makes no sense, or the session has no grain", body = ErrorBody),
    (status = 404, description = "No such session", body = ErrorBody),
    (status = 409, description = "Another compression goes on", body = ErrorBody),
))]
pub(super) async fn start(
    State(app): State<App>,
    path: Result<Path<String>, PathRejection>,
    request: Result<Json<CompressRequest>, JsonRejection>,
) -> Result<Response, ServerError> {
    let Path(id) = path?;
    let Json(request) = request?;
    check_name("session", &id, SESSION_NAME_LIMIT)?;
    let Json(started) = on_rig(&app, move |rig| rig.compress(&id, request)).await?;
    let location = format!("/api/v1/sessions/{}/compressions/{}", started.session, started.name);
    let mut response = (StatusCode::CREATED, Json(started)).into_response();
    if let Ok(location) = location.parse() {
        response.headers_mut().insert(header::LOCATION, location);
    }
    Ok(response)
}

/// Stops the compression; what is computed stays, and it can go on.
#[utoipa::path(post, path = "/compressions/current/cancel", operation_id = "cancel_compression", tag = "compressions", responses(
    (status = 204, description = "The compression will stop"),
    (status = 409, description = "There is no compression", body = ErrorBody),
))]
pub(super) async fn cancel(State(app): State<App>) -> Result<StatusCode, ServerError> {
    on_rig(&app, Compressions::cancel_compression).await.map(|_| StatusCode::NO_CONTENT)
}

/// Goes on with a compression that was cancelled or interrupted, from its last checkpoint.
#[utoipa::path(post, path = "/sessions/{id}/compressions/{name}/resume", operation_id = "resume_compression",
    tag = "compressions",
    params(("id" = String, Path, description = "Name of the session"),
           ("name" = String, Path, description = "Name of the compression")), responses(
    (status = 204, description = "The compression goes on"),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such compression", body = ErrorBody),
    (status = 409, description = "It is complete, or another one goes on", body = ErrorBody),
))]
pub(super) async fn resume(
    State(app): State<App>,
    path: Result<Path<(String, String)>, PathRejection>,
) -> Result<StatusCode, ServerError> {
    let (id, name) = checked(path)?;
    on_rig(&app, move |rig| rig.resume_compression(&id, &name)).await.map(|_| StatusCode::NO_CONTENT)
}

/// The compressions of a session.
#[utoipa::path(get, path = "/sessions/{id}/compressions", operation_id = "compressions", tag = "compressions",
    params(("id" = String, Path, description = "Name of the session")), responses(
    (status = 200, description = "The compressions", body = Vec<schemas::CompressionLine>),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such session", body = ErrorBody),
))]
pub(super) async fn list(
    State(app): State<App>,
    path: Result<Path<String>, PathRejection>,
) -> Result<Json<serde_json::Value>, ServerError> {
    let Path(id) = path?;
    check_name("session", &id, SESSION_NAME_LIMIT)?;
    on_rig(&app, move |rig| rig.compressions(&id)).await
}

/// One compression: how it stands, what was asked, its files and its result.
#[utoipa::path(get, path = "/sessions/{id}/compressions/{name}", operation_id = "compression", tag = "compressions",
    params(("id" = String, Path, description = "Name of the session"),
           ("name" = String, Path, description = "Name of the compression")), responses(
    (status = 200, description = "The compression", body = schemas::CompressionDetails),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such compression", body = ErrorBody),
))]
pub(super) async fn one(
    State(app): State<App>,
    path: Result<Path<(String, String)>, PathRejection>,
) -> Result<Json<serde_json::Value>, ServerError> {
    let (id, name) = checked(path)?;
    on_rig(&app, move |rig| rig.compression(&id, &name)).await
}

/// A file of a compression: its curve, a cut with the stresses, a mesh, a deck.
#[utoipa::path(get, path = "/sessions/{id}/compressions/{name}/files/{file}",
    operation_id = "compression_file", tag = "compressions",
    params(("id" = String, Path, description = "Name of the session"),
           ("name" = String, Path, description = "Name of the compression"),
           ("file" = String, Path, description = "Name of the file")), responses(
    (status = 200, description = "The file",
     headers(("etag" = String, description = "SHA-256 of the file")),
     content_type = "application/octet-stream", body = schemas::FileBytes),
    (status = 304, description = "The client has it already"),
    (status = 400, description = "Not a name", body = ErrorBody),
    (status = 404, description = "No such compression or file", body = ErrorBody),
))]
pub(super) async fn file(
    State(app): State<App>,
    path: Result<Path<(String, String, String)>, PathRejection>,
    headers: HeaderMap,
) -> Result<Response, ServerError> {
    let Path((id, name, file)) = path?;
    check_name("session", &id, SESSION_NAME_LIMIT)?;
    check_name("compression", &name, SESSION_NAME_LIMIT)?;
    check_name("file", &file, FILE_NAME_LIMIT)?;
    let Json(download) = on_rig(&app, move |rig| rig.compression_file(&id, &name, &file)).await?;
    Ok(download.answer(&headers))
}

/// The session's and the compression's name, after the first fence before the disk.
fn checked(path: Result<Path<(String, String)>, PathRejection>) -> Result<(String, String), ServerError> {
    let Path((id, name)) = path?;
    check_name("session", &id, SESSION_NAME_LIMIT)?;
    check_name("compression", &name, SESSION_NAME_LIMIT)?;
    Ok((id, name))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The page says the figures that are taken where nothing is said: they must be the daemon's own.
    #[test]
    fn the_pages_form_has_the_usual_figures() {
        let usual = serde_json::to_value(CompressRequest::default()).unwrap();
        let page = include_str!("../../web/index.html");
        let mut seen = 0;
        for input in page.split("<input id=\"press-").skip(1).map(|rest| rest.split('>').next().unwrap()) {
            let attribute = |name: &str| {
                let (_, rest) = input.split_once(&format!(" {name}=\""))?;
                Some(rest.split('"').next().unwrap().to_owned())
            };
            let name = attribute("name").unwrap();
            let shown = attribute("value").map(|value| value.parse::<f64>().unwrap());
            let expected = match name.as_str() {
                // Where neither force nor approach is given.
                "to_force_n" => grainrig_core::contact::Loading::default().to_force_n,
                _ => usual.get(&name).unwrap_or_else(|| panic!("there is no {name}")).as_f64(),
            };
            assert_eq!(shown, expected, "{name}");
            seen += 1;
        }
        assert!(seen > 8, "{seen} fields");
    }
}

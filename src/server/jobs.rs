//! Computations beside the rig over HTTP: asked for, watched, called off.

use axum::extract::rejection::{JsonRejection, PathRejection};
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use serde::Serialize;
use utoipa::ToSchema;

use super::error::{ErrorBody, ServerError};
use super::routes::{App, on_rig};
use crate::daemon::ComputeRequest;
use crate::session::event::{JobKind, JobNews, JobState};

/// Ended computations that are kept in the status, beside those that wait or go on.
const ENDED_KEPT: usize = 20;

/// A computation that was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
pub struct JobStarted {
    /// Its number since the daemon began.
    pub job: u64,
}

/// Where a computation stands: its news so far, folded. `web/status.js` does the same.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct JobStatus {
    /// Its number since the daemon began.
    pub job: u64,
    /// `reconstruct`, `replay`, `verify`, `merge` or `compress`.
    #[schema(value_type = String)]
    pub kind: JobKind,
    /// Name of the session whose results it makes.
    pub session: String,
    /// Of a compression: its name among the session's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// `waiting`, `running`, `complete`, `cancelled`, `interrupted` or `failed`.
    #[schema(value_type = String)]
    pub state: JobState,
    /// What is being done, in words; absent where nothing is. A compression tells that in `compression`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<String>,
    /// How much of that is done, 0 to 1.
    pub done: f64,
    /// Why it failed: value, limit, remedy.
    pub error: Option<String>,
}

impl JobStatus {
    fn is_under_way(&self) -> bool {
        matches!(self.state, JobState::Waiting | JobState::Running)
    }

    /// Takes some news into account; the newest job comes last.
    pub(super) fn apply(jobs: &mut Vec<Self>, news: &JobNews) {
        let news = news.clone();
        let now = Self {
            job: news.job,
            kind: news.kind,
            session: news.session,
            name: news.name,
            state: news.state,
            phase: news.phase,
            done: news.done,
            error: news.error,
        };
        match jobs.iter_mut().find(|before| before.job == now.job) {
            Some(before) => *before = now,
            None => jobs.push(now),
        }
        let ended = jobs.iter().filter(|job| !job.is_under_way()).count();
        if ended > ENDED_KEPT
            && let Some(oldest) = jobs.iter().position(|job| !job.is_under_way())
        {
            jobs.remove(oldest);
        }
    }
}

pub(super) fn routes() -> Router<App> {
    Router::new()
        .route("/jobs", get(list))
        .route("/jobs", post(start))
        .route("/jobs/{job}/cancel", post(cancel))
}

/// The computations that wait or go on, and the last ones that have ended, the newest last.
#[utoipa::path(get, path = "/api/v1/jobs", operation_id = "jobs", tag = "jobs", responses(
    (status = 200, description = "The computations", body = Vec<JobStatus>),
    (status = 401, description = "No token, or a wrong one", body = ErrorBody),
    (status = 429, description = "Too many wrong tokens", body = ErrorBody),
))]
pub(super) async fn list(State(app): State<App>) -> Result<Json<Vec<JobStatus>>, ServerError> {
    on_rig(&app, |rig| Ok(rig.events().status().jobs)).await
}

/// Asks for a computation over recorded sessions: one at a time is computed, beside whatever the rig does, and a few wait.
///
/// `kind` says which: `reconstruct` (hull and mesh again, with the controls in `mesh`), `replay` (the whole way again from the
/// recording; lost products are written again), `verify` (every file against its recorded hash), `merge` (captures `a` and `b`
/// become `session`). How it stands is told by `GET /jobs` and by events of the kind `job`.
#[utoipa::path(post, path = "/api/v1/jobs", operation_id = "start_job", tag = "jobs", request_body = ComputeRequest, responses(
    (status = 202, description = "It is computed, or waits for that", body = JobStarted,
     headers(("location" = String, description = "The list of computations"))),
    (status = 400, description = "The request makes no sense", body = ErrorBody),
    (status = 401, description = "No token, or a wrong one", body = ErrorBody),
    (status = 429, description = "Too many wrong tokens", body = ErrorBody),
    (status = 403, description = "Sent by another site's page", body = ErrorBody),
    (status = 404, description = "No such session", body = ErrorBody),
    (status = 409, description = "Too many wait already", body = ErrorBody),
    (status = 413, description = "The body is too large", body = ErrorBody),
    (status = 415, description = "The body is not JSON", body = ErrorBody),
))]
pub(super) async fn start(
    State(app): State<App>,
    request: Result<Json<ComputeRequest>, JsonRejection>,
) -> Result<Response, ServerError> {
    let Json(request) = request?;
    let Json(job) = on_rig(&app, |rig| rig.compute(request)).await?;
    let mut response = (StatusCode::ACCEPTED, Json(JobStarted { job })).into_response();
    response.headers_mut().insert(header::LOCATION, header::HeaderValue::from_static("/api/v1/jobs"));
    Ok(response)
}

/// Takes a waiting computation out of the queue, or stops a compression. Others end by themselves, and change nothing before.
#[utoipa::path(post, path = "/api/v1/jobs/{job}/cancel", operation_id = "cancel_job", tag = "jobs",
    params(("job" = u64, Path, description = "Number of the computation")), responses(
    (status = 204, description = "It is called off"),
    (status = 400, description = "Not a number", body = ErrorBody),
    (status = 401, description = "No token, or a wrong one", body = ErrorBody),
    (status = 429, description = "Too many wrong tokens", body = ErrorBody),
    (status = 403, description = "Sent by another site's page", body = ErrorBody),
    (status = 404, description = "None of this number waits or goes on", body = ErrorBody),
    (status = 409, description = "It cannot be stopped in its middle", body = ErrorBody),
))]
pub(super) async fn cancel(
    State(app): State<App>,
    path: Result<Path<u64>, PathRejection>,
) -> Result<StatusCode, ServerError> {
    let Path(job) = path?;
    on_rig(&app, move |rig| rig.cancel_job(job)).await.map(|_| StatusCode::NO_CONTENT)
}

//! Computations beside the rig over HTTP: asked for, watched, called off.

use axum::Json;
use axum::extract::rejection::{JsonRejection, PathRejection};
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::error::{ErrorBody, ServerError};
use super::routes::{App, on_rig};
use super::{Refusal, RefusalKind};
use crate::jobs::Job;
use crate::session::event::{JobState, JobStatus};

/// Ended computations that are kept in the status, beside those that wait or go on.
const ENDED_KEPT: usize = 20;

/// A computation that was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
pub struct JobStarted {
    /// Its number since the daemon began.
    pub job: u64,
}

/// Takes some news into account; the newest job comes last. `web/status.js` does the same.
pub(super) fn apply(jobs: &mut Vec<JobStatus>, news: &JobStatus) {
    let is_under_way = |job: &JobStatus| matches!(job.state, JobState::Waiting | JobState::Running);
    match jobs.iter_mut().find(|before| before.job == news.job) {
        Some(before) => before.clone_from(news),
        None => jobs.push(news.clone()),
    }
    let ended = jobs.iter().filter(|job| !is_under_way(job)).count();
    if ended > ENDED_KEPT
        && let Some(oldest) = jobs.iter().position(|job| !is_under_way(job))
    {
        jobs.remove(oldest);
    }
}

pub(super) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(list, start)).routes(routes!(one)).routes(routes!(cancel))
}

/// The computations that wait or go on, and the last ones that have ended, the newest last.
#[utoipa::path(get, path = "/jobs", operation_id = "jobs", tag = "jobs", responses(
    (status = 200, description = "The computations", body = Vec<JobStatus>),
))]
pub(super) async fn list(State(app): State<App>) -> Result<Json<Vec<JobStatus>>, ServerError> {
    on_rig(&app, |rig| Ok(rig.events().status().jobs)).await
}

/// Asks for a job: one at a time is done, beside whatever the rig does, and a few wait.
///
/// `kind` says which: `import` (photographs become a session), `reconstruct` (hull and mesh again, with the controls in `mesh`),
/// `replay` (the whole way again from the recording; lost products are written again), `verify` (every file against its recorded
/// hash), `merge` (captures `a` and `b` become `session`), `mesh` and `compress` (of a file, or a session), `calibrate_scale` and
/// `study`: the command line's options, by its names. A file or folder is one of `/files`; what a job writes beside sessions is
/// found there. How it stands is told by `GET /jobs` and by events of the kind `job`, what it came to by `GET /jobs/{job}`.
#[utoipa::path(post, path = "/jobs", operation_id = "start_job", tag = "jobs", request_body = Job, responses(
    (status = 202, description = "It is computed, or waits for that", body = JobStarted,
     headers(("location" = String, description = "The list of computations"))),
    (status = 400, description = "The request makes no sense", body = ErrorBody),
    (status = 404, description = "No such session", body = ErrorBody),
    (status = 409, description = "Too many wait already", body = ErrorBody),
))]
pub(super) async fn start(
    State(app): State<App>,
    request: Result<Json<Job>, JsonRejection>,
) -> Result<Response, ServerError> {
    let Json(request) = request?;
    let Json(job) = on_rig(&app, |rig| rig.compute(request)).await?;
    let mut response = (StatusCode::ACCEPTED, Json(JobStarted { job })).into_response();
    response.headers_mut().insert(header::LOCATION, header::HeaderValue::from_static("/api/v1/jobs"));
    Ok(response)
}

/// How a job stands and what it came to.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct JobDetails {
    /// How it stands.
    #[serde(flatten)]
    pub status: JobStatus,
    /// What the command line prints for it under `--json`; `null` before its end, where it failed, and where twenty have ended
    /// since.
    #[schema(value_type = Option<Object>)]
    pub result: Option<serde_json::Value>,
}

/// One job, with what it came to.
#[utoipa::path(get, path = "/jobs/{job}", operation_id = "job", tag = "jobs",
    params(("job" = u64, Path, description = "Number of the job")), responses(
    (status = 200, description = "The job", body = JobDetails),
    (status = 400, description = "Not a number", body = ErrorBody),
    (status = 404, description = "None of this number waits, goes on or has ended lately", body = ErrorBody),
))]
pub(super) async fn one(
    State(app): State<App>,
    path: Result<Path<u64>, PathRejection>,
) -> Result<Json<JobDetails>, ServerError> {
    let Path(job) = path?;
    on_rig(&app, move |rig| {
        let status = rig.events().status().jobs.into_iter().find(|status| status.job == job);
        let absent = || {
            let text = "no job of this number waits, goes on or has ended lately; see the list of jobs";
            Refusal::new(RefusalKind::NotFound, text)
        };
        Ok(JobDetails { status: status.ok_or_else(absent)?, result: rig.job_result(job) })
    })
    .await
}

/// Takes a waiting computation out of the queue, or stops a compression. Others end by themselves, and change nothing before.
#[utoipa::path(post, path = "/jobs/{job}/cancel", operation_id = "cancel_job", tag = "jobs",
    params(("job" = u64, Path, description = "Number of the computation")), responses(
    (status = 204, description = "It is called off"),
    (status = 400, description = "Not a number", body = ErrorBody),
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

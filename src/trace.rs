//! What the log tells of a job: a span around everything that it does, how long it took, how it ended.

use std::fmt::Display;
use std::path::Path;
use std::time::Instant;
use tracing::{debug, info_span};

/// Where the log has the beginning and the end of jobs.
const TARGET: &str = "grainrig::job";

/// Does a job within a span that says what it is and of which session.
///
/// # Errors
/// The job's own.
pub fn job<T, E: Display>(kind: &str, session: &str, work: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    info_span!(target: TARGET, "job", kind, session).in_scope(|| {
        debug!(target: TARGET, "begins");
        let begun = Instant::now();
        let ended = work();
        let ms = ms_since(begun);
        match &ended {
            Ok(_) => debug!(target: TARGET, ms, outcome = "done", "ended"),
            Err(error) => debug!(target: TARGET, ms, outcome = "failed", %error, "ended"),
        }
        ended
    })
}

/// As [`job`], of the session in this folder.
///
/// # Errors
/// The job's own.
pub fn job_of<T, E: Display>(kind: &str, folder: &Path, work: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    job(kind, &folder.file_name().unwrap_or_default().to_string_lossy(), work)
}

/// How long ago that was, ms, in whole microseconds.
pub fn ms_since(begun: Instant) -> f64 {
    begun.elapsed().as_micros() as f64 / 1e3
}

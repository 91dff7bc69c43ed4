//! What jobs on recorded sessions have in common: the frozen computation, fed with the recorded views, and its products.

use super::JobError;
use super::finish::{self, Finished, Made};
use crate::acquire::QualityMode;
use crate::config::Config;
use crate::pipeline::{Cameras, MeshSettings, OUTLINE, Pipeline, PipelineError, Reconstruction, View};
use crate::session::event::EventKind;
use crate::session::{Recording, Session};
use grainrig_core::formats::Photograph;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::thread::ScopedJoinHandle;

/// Pictures that may wait for the workers.
pub(super) const WAITING_VIEWS: usize = 2;

/// The frozen configuration and cameras of a session, as the computation to run.
pub(super) fn computation(recording: &Recording) -> Result<(Config, Pipeline), JobError> {
    let manifest = recording.manifest();
    let frozen = |part, reason: serde_json::Error| JobError::Frozen {
        session: manifest.name.clone(),
        part,
        reason: reason.to_string(),
    };
    let config: Config =
        serde_json::from_value(manifest.config.clone()).map_err(|e| frozen("configuration", e))?;
    let cameras: Cameras =
        serde_json::from_value(manifest.geometry.clone()).map_err(|e| frozen("cameras", e))?;
    let background = match &manifest.background {
        None => None,
        Some(archived) => {
            let bytes = recording.background()?.map(|f| f.bytes).unwrap_or_default();
            let reason = |reason| JobError::Background { file: archived.file.clone(), reason };
            Some(Photograph::open(&bytes).map_err(reason)?)
        }
    };
    let pipeline = Pipeline {
        settings: config.computation(),
        cameras,
        background,
        views: manifest.plan.views.len(),
        full_step_deg: config.plan.step_deg,
        judges: config.acquire.quality != QualityMode::Off,
    };
    Ok((config, pipeline))
}

/// Sends the views that are recorded already down the pipeline's channel, each as `through` makes it; stops early where
/// nobody takes them.
pub(super) fn send_recorded(
    recording: &Recording,
    send: &SyncSender<View>,
    mut through: impl FnMut(View) -> View,
) -> Result<(), JobError> {
    for captured in recording.views() {
        let view = View::recorded(captured, recording.frame(captured.view)?.bytes);
        if send.send(through(view)).is_err() {
            break;
        }
    }
    Ok(())
}

/// Whether every view of the plan is there.
pub(super) fn check_views(recording: &Recording) -> Result<(), JobError> {
    let (got, expected) = (recording.views().len(), recording.manifest().plan.views.len());
    if got < expected {
        return Err(PipelineError::MissingViews { got, expected }.into());
    }
    Ok(())
}

/// What is known of the newest products.
pub(super) struct PriorProducts {
    /// Their timing.
    pub timing_s: serde_json::Value,
    /// The mesh that was asked for otherwise than the frozen configuration says.
    pub mesh: Option<MeshSettings>,
    /// Whether drawings are among them.
    pub pictures: bool,
}

/// What is known of the newest products, where there are any.
pub(super) fn prior_products(recording: &Recording) -> Result<Option<PriorProducts>, JobError> {
    let newest = recording.events().iter().rev().find_map(|e| match &e.what {
        EventKind::Products { files, timing_s, settings } => Some((files, timing_s, settings)),
        _ => None,
    });
    let Some((files, timing_s, settings)) = newest else { return Ok(None) };
    let frozen = |e: serde_json::Error| JobError::Frozen {
        session: recording.manifest().name.clone(),
        part: "mesh settings",
        reason: e.to_string(),
    };
    let mesh = settings.as_ref().map(|s| serde_json::from_value(s.clone()).map_err(frozen)).transpose()?;
    let pictures = files.iter().any(|f| f.file.starts_with(OUTLINE));
    Ok(Some(PriorProducts { timing_s: timing_s.clone(), mesh, pictures }))
}

/// Runs the pipeline over the recorded views, journalling what happens.
pub(super) fn compute(
    recording: &Recording,
    pipeline: &Pipeline,
    session: &Mutex<Session>,
) -> Result<Reconstruction, JobError> {
    fed(recording, |views| pipeline.run(views, &|what| note(session, what)))
}

/// Hands the recorded views to a computation on this thread, and reads them on another.
pub(super) fn fed<T>(
    recording: &Recording,
    compute: impl FnOnce(Receiver<View>) -> Result<T, PipelineError>,
) -> Result<T, JobError> {
    let (send, receive) = sync_channel(WAITING_VIEWS);
    std::thread::scope(|scope| {
        let feeding = scope.spawn(move || send_recorded(recording, &send, |view| view));
        let made = compute(receive);
        joined(feeding)?;
        Ok(made?)
    })
}

/// What a thread came to; a panic goes on in this one.
pub(super) fn joined<T>(thread: ScopedJoinHandle<'_, T>) -> T {
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Journals an event of the computation; a journal that can't be written ends the job at its next durable step.
pub(super) fn note(session: &Mutex<Session>, what: EventKind) {
    if let Err(error) = lock(session).append(what) {
        tracing::warn!("{error}");
    }
}

pub(super) fn lock(session: &Mutex<Session>) -> std::sync::MutexGuard<'_, Session> {
    session.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes the products, or journals why there are none. `mesh` is what was asked otherwise than the frozen settings.
pub(super) fn conclude(
    session: &Mutex<Session>,
    outcome: Result<impl Made, JobError>,
    mesh: Option<&MeshSettings>,
) -> Result<Finished, JobError> {
    let written = outcome.and_then(|made| record(&mut lock(session), &made, mesh));
    if let Err(error) = &written {
        note(session, EventKind::Failed { error: error.to_string() });
    }
    written
}

/// Writes the products and journals them, and that all is done.
pub(super) fn record(
    session: &mut Session,
    made: &dyn Made,
    mesh: Option<&MeshSettings>,
) -> Result<Finished, JobError> {
    session.recording().check_frames()?;
    let manifest = session.recording().manifest().clone();
    let timing = made.timing_s();
    let files = finish::render(made, &manifest.software, &manifest.name, timing.clone())?;
    // As the file has it: with the products' names, not with their places on this computer.
    let result = finish::result_of(&files)?;
    let records = finish::write(session, &files, timing, mesh)?;
    let folder = session.recording().folder().to_owned();
    let done = finish::finished(made, &manifest.software, &folder, &manifest.name, records);
    session.append(EventKind::Complete { result })?;
    Ok(done)
}

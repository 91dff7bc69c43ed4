//! Jobs beside the rig, as anyone may ask for them: the command line does the same at once.

use super::background::{Background, JobDescription, JobEnd, JobReporter};
use super::{
    CompressOptions, Context, EnsembleOptions, ImportOptions, JobError, MergeOptions, MeshOptions, Meshed,
    ReconstructOptions, ReplayOptions, RestsOptions, ScaleOptions, StudyOptions, VerifyOptions, Watcher,
    stated,
};
use crate::session::event::{EventKind, JobKind};
use crate::session::to_json_value;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use utoipa::ToSchema;

/// A job, by its kind.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
#[schema(example = json!({ "kind": "reconstruct", "session": "leighton-buzzard-07", "mesh": { "surface_size_mm": 0.05 } }))]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Job {
    /// Photographs are taken in as a session.
    Import(ImportOptions),
    /// Hull and mesh of a session again.
    Reconstruct(ReconstructOptions),
    /// The whole way again, from the recording; a product that is missing or damaged is written again.
    Replay(ReplayOptions),
    /// Every file of a session against the hashes in its journal.
    Verify(VerifyOptions),
    /// Two captures of one grain become one.
    Merge(MergeOptions),
    /// A file's or a session's body is meshed and written.
    Mesh(MeshOptions),
    /// A file's body, a sphere or a session's grain is pressed between two plates.
    Compress(CompressOptions),
    /// A session's grain or a file's surface is pressed in many ways, for an interval.
    Ensemble(EnsembleOptions),
    /// The size of a pixel is measured.
    CalibrateScale(ScaleOptions),
    /// The volume against the number of views is studied.
    Study(StudyOptions),
    /// How a body can come to lie, and how closing plates turn it.
    Rests(RestsOptions),
}

impl Job {
    /// What it is about; `stop` is set where it is to stop.
    fn about(&self, context: &Context) -> Result<JobDescription, JobError> {
        let named = |path: &Path| path.display().to_string();
        let (kind, subject) = match self {
            Self::Import(o) => (JobKind::Import, o.session(context)?),
            Self::Reconstruct(o) => (JobKind::Reconstruct, named(&o.session)),
            Self::Replay(o) => (JobKind::Replay, named(&o.session)),
            Self::Verify(o) => (JobKind::Verify, named(&o.session)),
            Self::Merge(o) => (JobKind::Merge, named(&o.session)),
            Self::Mesh(o) => (JobKind::Mesh, named(&o.input)),
            Self::Compress(o) => (JobKind::Compress, named(&o.subject())),
            Self::Ensemble(o) => (JobKind::Ensemble, named(&o.grain.subject())),
            Self::CalibrateScale(o) => (JobKind::CalibrateScale, named(&o.folder)),
            Self::Study(o) => (JobKind::Study, named(&o.out)),
            Self::Rests(o) => (JobKind::Rests, named(&o.input)),
        };
        let stop = matches!(self, Self::Compress(_) | Self::Ensemble(_)).then(|| Arc::clone(&context.stop));
        Ok(JobDescription { kind, session: subject, name: None, stop, called_off: None })
    }

    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        match self {
            Self::Import(o) => o.check(context),
            Self::Reconstruct(o) => o.check(context),
            Self::Replay(o) => o.check(context),
            Self::Verify(o) => o.check(context),
            Self::Merge(o) => o.check(context),
            Self::Mesh(o) => o.check(context),
            Self::Compress(o) => o.check(context),
            Self::Ensemble(o) => o.check(context),
            Self::CalibrateScale(o) => o.check(context),
            Self::Study(o) => o.check(context),
            Self::Rests(o) => o.check(context),
        }
    }

    /// Does it; what `--json` prints.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn run(&self, context: &Context) -> Result<Value, JobError> {
        Ok(match self {
            Self::Import(o) => to_json_value(&o.run(context)?.result)?,
            Self::Reconstruct(o) => to_json_value(&o.run(context)?.result)?,
            Self::Replay(o) => {
                let done = o.run(context)?;
                let object = done.to_json()?;
                done.check()?;
                object
            }
            Self::Verify(o) => {
                let report = o.run(context)?;
                let object = to_json_value(&report)?;
                if !report.is_sound() {
                    let session = o.session.display().to_string();
                    return Err(JobError::Damaged { session, faults: report.faults });
                }
                object
            }
            Self::Merge(o) => to_json_value(&o.run(context)?.result)?,
            Self::Mesh(o) => match o.run(context)? {
                Meshed::File(made) => made.to_json()?,
                Meshed::Session(done) => to_json_value(&done.result)?,
            },
            Self::Compress(o) => {
                let mut told = |p: super::CompressProgress| context.working("compressing", p.done);
                let (result, folder) = o.run(context, &mut told)?;
                CompressOptions::to_json(&result, &folder)?
            }
            Self::Ensemble(o) => to_json_value(&o.run(context)?)?,
            Self::CalibrateScale(o) => to_json_value(&o.run(context)?)?,
            Self::Study(o) => o.run(context)?.to_json()?,
            Self::Rests(o) => to_json_value(&o.run(context)?)?,
        })
    }
}

impl Background {
    /// Begins a job, or lets it wait; its number.
    ///
    /// # Errors
    /// [`JobError`] for what makes no sense, and where too many wait.
    pub fn compute(&self, job: Job, context: Context) -> Result<u64, JobError> {
        let context = Context { stop: Arc::new(AtomicBool::new(false)), ..context };
        job.check(&context)?;
        self.queue(job.about(&context)?, move |_, reporter| {
            let stop = Arc::clone(&context.stop);
            let told = Arc::new(Mutex::new(reporter.clone()));
            let result =
                job.run(&Context { watcher: progress(told), ..context }).map_err(|e| e.to_string())?;
            let is_whole = result.get("finished") != Some(&Value::Bool(false));
            reporter.keep(stated(result));
            Ok(if is_whole || !stop.load(Ordering::Acquire) { JobEnd::Done } else { JobEnd::Stopped })
        })
    }
}

/// Tells a job's progress by the events of its computation. The run's own are not passed on: they are not the rig's.
fn progress(reporter: Arc<Mutex<JobReporter>>) -> Watcher {
    Arc::new(move |event| {
        let mut reporter = reporter.lock().unwrap_or_else(PoisonError::into_inner);
        match &event.what {
            EventKind::Working { stage, done } => reporter.progress(stage, *done),
            EventKind::Silhouette { .. } => reporter.progress("silhouettes", 0.0),
            _ => {}
        }
    })
}

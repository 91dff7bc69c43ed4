//! Jobs on recorded sessions: the computation again, and the whole way again.

use super::finish::{self, Finished, Made};
use super::{Context, JobError, Watcher, merging};
use crate::acquire::{self, Control, Earlier, FrameSink, Outcome, QualityMode, StoreOutcome, SystemClock};
use crate::config::Config;
use crate::pipeline::{Cameras, MeshSettings, OUTLINE, Pipeline, PipelineError, Reconstruction, View};
use crate::rig::Frame;
use crate::session::event::{Event, EventKind};
use crate::session::replay::replay as play;
use crate::session::{
    Origin, Plan, PlannedView, Recording, Session, SessionError, VerifyReport, to_json_value, verify,
};
use crate::trace;
use grainrig_core::formats::Photograph;
use grainrig_core::geometry::Angle;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::ScopedJoinHandle;

/// Hull and mesh of a session, to be computed again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct ReconstructOptions {
    /// The session: its name in the data folder, or its folder's path.
    #[schema(value_type = String)]
    pub session: PathBuf,
    /// The mesh's controls, where they are not to be the configured ones.
    #[command(flatten)]
    #[serde(default)]
    pub mesh: MeshSettings,
    /// Draw no outlines over the photographs, and no sheet of the calibration.
    #[arg(long = "no-pictures", action = clap::ArgAction::SetFalse)]
    #[serde(default = "yes")]
    pub pictures: bool,
    /// Take figures as they are that look like slips of unit.
    #[arg(skip)]
    #[serde(default)]
    pub as_given: bool,
}

fn yes() -> bool {
    true
}

impl ReconstructOptions {
    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        self.mesh.controls(1.0).check()?;
        drop(Recording::read(&context.names.session(&self.session)?)?);
        Ok(())
    }

    /// Computes, and writes the products.
    ///
    /// # Errors
    /// As [`reconstruct`].
    pub fn run(&self, context: &Context) -> Result<Finished, JobError> {
        let folder = context.names.session(&self.session)?;
        let as_given = context.as_given || self.as_given;
        reconstruct(&folder, self.mesh.asked(), self.pictures, as_given, &context.watcher)
    }
}

/// A session, to be sent the whole way again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct ReplayOptions {
    /// The session: its name in the data folder, or its folder's path.
    #[schema(value_type = String)]
    pub session: PathBuf,
}

impl ReplayOptions {
    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        drop(Recording::read(&context.names.session(&self.session)?)?);
        Ok(())
    }

    /// Replays.
    ///
    /// # Errors
    /// As [`replay`]; products that differ are none.
    pub fn run(&self, context: &Context) -> Result<Replayed, JobError> {
        replay(&context.names.session(&self.session)?, &context.watcher)
    }
}

/// A session whose files are to be held against the hashes in its journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct VerifyOptions {
    /// The session: its name in the data folder, or its folder's path.
    #[schema(value_type = String)]
    pub session: PathBuf,
}

impl VerifyOptions {
    /// Whether there is such a session; a damaged one is what it is to tell of.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        let folder = context.names.session(&self.session)?;
        match Recording::read(&folder) {
            Err(e @ SessionError::Absent { .. }) => Err(e.into()),
            _ => Ok(()),
        }
    }

    /// Reads everything, changes nothing.
    ///
    /// # Errors
    /// [`JobError`] where it can't be read; faults are none.
    pub fn run(&self, context: &Context) -> Result<VerifyReport, JobError> {
        let folder = context.names.session(&self.session)?;
        trace::job_of("verify", &folder, || Ok(verify(&folder)?))
    }
}

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

/// Computes a session's hull and mesh again and writes the products, with another mesh if wanted, and without pictures
/// where they are not; `as_given` takes figures that look like slips of unit.
///
/// # Errors
/// [`JobError`]; the session's pictures are only read.
pub fn reconstruct(
    folder: &Path,
    mesh: Option<&MeshSettings>,
    pictures: bool,
    as_given: bool,
    watcher: &Watcher,
) -> Result<Finished, JobError> {
    trace::job_of("reconstruct", folder, || reconstructed(folder, mesh, pictures, as_given, watcher))
}

fn reconstructed(
    folder: &Path,
    mesh: Option<&MeshSettings>,
    pictures: bool,
    as_given: bool,
    watcher: &Watcher,
) -> Result<Finished, JobError> {
    let mut session = Session::open(folder)?;
    let watch = Arc::clone(watcher);
    session.observe(move |e| watch(e));
    let session = Mutex::new(session);
    let recording = lock(&session).recording().clone();
    if recording.manifest().origin == Origin::Merge {
        let (outcome, mesh) = match merging::again(&recording, mesh, watcher) {
            Ok((made, mesh)) => (Ok(made), mesh),
            Err(error) => (Err(error), None),
        };
        return conclude(&session, outcome, mesh.as_ref());
    }
    check_views(&recording)?;
    let (_, mut pipeline) = computation(&recording)?;
    pipeline.settings.report.pictures &= pictures;
    pipeline.settings.as_given |= as_given;
    let mesh = mesh.map(|asked| asked.over(&pipeline.settings.mesh));
    if let Some(mesh) = &mesh {
        pipeline.settings.mesh = mesh.clone();
        pipeline.settings.check()?;
    }
    let outcome = compute(&recording, &pipeline, &session);
    conclude(&session, outcome, mesh.as_ref())
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

/// What a replay made, and how it compares.
#[derive(Debug, Clone)]
pub struct Replayed {
    /// The result.
    pub finished: Finished,
    /// Products whose bytes differ from the recorded ones; the recorded ones are left as they are.
    pub differs: Vec<String>,
}

impl Replayed {
    /// What `--json` prints.
    ///
    /// # Errors
    /// [`JobError::Encode`] where a figure is not finite.
    pub fn to_json(&self) -> Result<serde_json::Value, JobError> {
        let mut object = to_json_value(&self.finished.result)?;
        object["differs"] = serde_json::json!(self.differs);
        Ok(object)
    }

    /// Whether every product has the recorded bytes.
    ///
    /// # Errors
    /// [`JobError::Differs`] where one has not.
    pub fn check(self) -> Result<(), JobError> {
        if self.differs.is_empty() {
            return Ok(());
        }
        Err(JobError::Differs { products: self.differs, software: self.finished.result.software })
    }
}

/// Sends a recording the whole way again: through the acquisition, with the recording as stage and camera, through
/// the computation, to the products. A product that is missing or damaged on the disk is written again; the journal
/// stays as it is, except that a session without products gets its first ones.
///
/// # Errors
/// [`JobError`] where views are missing, a file has changed, or the computation fails.
pub fn replay(folder: &Path, watcher: &Watcher) -> Result<Replayed, JobError> {
    trace::job_of("replay", folder, || replayed(folder, watcher))
}

fn replayed(folder: &Path, watcher: &Watcher) -> Result<Replayed, JobError> {
    let mut recording = Recording::read(folder)?;
    if recording.is_unsettled() || finish::lacks_end(&recording) {
        // A run was killed while it put its products in their place.
        let mut session = Session::open(folder)?;
        finish::end(&mut session)?;
        recording = session.recording().clone();
    }
    let prior_products = prior_products(&recording)?;
    if recording.manifest().origin == Origin::Merge {
        let mesh = prior_products.as_ref().and_then(|before| before.mesh.as_ref());
        let (made, _) = merging::again(&recording, mesh, watcher)?;
        return compared(&recording, &made, prior_products, watcher);
    }
    let made = played(&recording, prior_products.as_ref(), watcher)?;
    compared(&recording, &made, prior_products, watcher)
}

/// Sends the recorded pictures through acquisition and computation.
fn played(
    recording: &Recording,
    prior_products: Option<&PriorProducts>,
    watcher: &Watcher,
) -> Result<Reconstruction, JobError> {
    let plan = Plan { settle_ms: 0, retakes: 0, ..recording.manifest().plan.clone() };
    check_views(recording)?;
    let (_, mut pipeline) = computation(recording)?;
    if let Some(before) = prior_products {
        if let Some(mesh) = &before.mesh {
            pipeline.settings.mesh = mesh.clone();
        }
        // Who made them has said that they are meant so; the result has what was doubtful.
        pipeline.settings.as_given = true;
        // What was not drawn then would only differ.
        pipeline.settings.report.pictures = before.pictures;
    }
    let session = &recording.manifest().name;
    let (send, receive) = sync_channel(WAITING_VIEWS);
    let numbered = Numbered::new(watcher);
    std::thread::scope(|scope| {
        let (numbered, plan, span) = (&numbered, &plan, tracing::Span::current());
        let acquiring = scope.spawn(move || {
            let _within = span.entered();
            let (mut stage, mut camera) = play(recording.clone());
            let mut sink = ReplaySink { recording, send, numbered };
            acquire::run(&mut stage, &mut camera, plan, &mut sink, &Control::new(), &SystemClock::new())
        });
        let made = pipeline.run(receive, &|what| numbered.tell(what));
        match joined(acquiring)? {
            Outcome::Complete { .. } => Ok::<_, JobError>(made?),
            Outcome::Aborted { captured } => {
                let planned = plan.views.len();
                Err(JobError::Aborted { session: session.clone(), captured, planned })
            }
        }
    })
}

/// Holds what was made against the recorded products; a session without products gets its first ones.
fn compared(
    recording: &Recording,
    made: &dyn Made,
    prior_products: Option<PriorProducts>,
    watcher: &Watcher,
) -> Result<Replayed, JobError> {
    let folder = recording.folder();
    let Some(PriorProducts { timing_s, .. }) = prior_products else {
        let mut session = Session::open(folder)?;
        let watch = Arc::clone(watcher);
        session.observe(move |e| watch(e));
        let finished = record(&mut session, made, None)?;
        return Ok(Replayed { finished, differs: Vec::new() });
    };
    let (software, session) = (&recording.manifest().software, &recording.manifest().name);
    let files = finish::render(made, software, session, timing_s)?;
    let differs = finish::compare(recording, files)?;
    if finish::lacks_end(recording) && differs.is_empty() {
        finish::end(&mut Session::open(folder)?)?;
    }
    let records = recording.products().cloned().collect();
    let finished = finish::finished(made, software, folder, session, records);
    Ok(Replayed { finished, differs })
}

/// Numbers the events of a job that journals none: of a replay (the journal's are the recording's), of a merging.
pub(super) struct Numbered<'a> {
    next: Mutex<u64>,
    watcher: &'a Watcher,
}

impl<'a> Numbered<'a> {
    pub fn new(watcher: &'a Watcher) -> Self {
        Self { next: Mutex::new(1), watcher }
    }

    pub fn tell(&self, what: EventKind) {
        // Locked over the call, so that the events come in order.
        let mut next = self.next.lock().unwrap_or_else(PoisonError::into_inner);
        (self.watcher)(&Event { seq: *next, time: jiff::Timestamp::now(), what });
        *next += 1;
    }
}

/// Hands the played pictures to the pipeline: they are durable already.
struct ReplaySink<'a> {
    recording: &'a Recording,
    send: SyncSender<View>,
    numbered: &'a Numbered<'a>,
}

impl FrameSink for ReplaySink<'_> {
    fn begin(&mut self) -> Result<Earlier, SessionError> {
        let manifest = self.recording.manifest();
        self.numbered.tell(EventKind::Started {
            session: manifest.name.clone(),
            views: manifest.plan.views.len(),
            already_captured: 0,
        });
        Ok(Earlier::default())
    }

    fn offer(&mut self, view: &PlannedView, _: Angle, frame: Frame, remaining_s: Option<f64>) {
        // Every view of the plan is recorded, which is seen to before a replay begins.
        let Some(captured) = self.recording.view(view.index) else { return };
        self.numbered.tell(EventKind::Captured { view: captured.clone(), remaining_s });
        // A pipeline that has failed takes no more; its error is what the replay returns.
        let _ = self.send.send(View::recorded(captured, frame.bytes));
    }

    fn outcome(&mut self) -> Result<StoreOutcome, SessionError> {
        Ok(StoreOutcome::Kept)
    }

    fn event(&mut self, what: EventKind) -> Result<(), SessionError> {
        self.numbered.tell(what);
        Ok(())
    }
}

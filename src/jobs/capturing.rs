//! Capture on the rig: the stage turns, the session fills, the pipeline computes alongside.

use super::devices;
use super::finish::{self, Finished, product_paths};
use super::reconstructing::reconstruct;
use super::recorded::{
    PriorProducts, WAITING_VIEWS, check_views, computation, conclude, joined, lock, note, prior_products,
    send_recorded,
};
use super::replaying::replay;
use super::scale_file::ScaleFile;
use super::{Context, JobError, Names, Watcher};
use crate::acquire::{self, Control, Judge, Outcome, QualityMode, SessionSink, SystemClock};
use crate::config::{Config, ConfigError, ServeSettings};
use crate::pipeline::{Cameras, Gate, MeshSettings, Reconstruction, SegmentedPicture, View};
use crate::rig::{Frame, TruthHandle};
use crate::session::event::CapturedView;
use crate::session::replay::replay as play;
use crate::session::{
    Manifest, Origin, PlannedView, Session, State, Store, check_space, damage, required_bytes, write_whole,
};
use crate::trace;
use grainrig_core::geometry::Angle;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex};

/// A grain, to be captured on the rig.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct CaptureOptions {
    /// Name of the new session: 1 to 64 letters, digits, `.`, `_` or `-`.
    pub name: String,
    /// Number of views over half a turn, instead of the configuration's: 2 to 200 with motor steps of 0.9°.
    /// The step between them is the greatest whole number of motor steps that keeps them within it.
    #[arg(long, value_name = "COUNT", allow_negative_numbers = true)]
    pub views: Option<u32>,
    /// A file of `grainrig calibrate scale`, which sets the size of a pixel instead of the configuration
    /// (`optics.mm_per_px`), and the camera's distance where it was given there.
    #[arg(long, value_name = "FILE")]
    #[schema(value_type = Option<String>)]
    pub calibration: Option<PathBuf>,
    /// Use the stage's angles as they are and no sideways shift of single views; both are measured and told all the same.
    #[arg(long)]
    #[serde(default)]
    pub no_refine: bool,
    /// Draw no outlines over the photographs, and no sheet of the calibration.
    #[arg(long)]
    #[serde(default)]
    pub no_pictures: bool,
    /// What becomes of a picture that is out of focus, shaken, overexposed, obstructed or a copy of another, instead
    /// of what the configuration says.
    #[arg(long, value_enum)]
    pub quality: Option<QualityMode>,
    /// Write the simulated rig's truth (shape, angles, camera) into this folder.
    #[arg(long, value_name = "DIR")]
    #[schema(value_type = Option<String>)]
    pub truth: Option<PathBuf>,
}

impl CaptureOptions {
    /// The configuration that the session is made with.
    ///
    /// # Errors
    /// [`JobError`] for a figure or a file that makes no sense.
    pub fn over(&self, config: &Config, names: &Names) -> Result<Config, JobError> {
        let mut config = config.clone();
        if let Some(views) = self.views {
            let half_turn = (180.0 / config.plan.step_deg + 1e-9).floor();
            let steps = (half_turn / f64::from(views)).floor();
            if views < 2 || steps < 1.0 {
                return Err(JobError::Usage(format!(
                    "--views is {views}; give 2 to {half_turn}: a half turn has {half_turn} motor steps of {}° \
                     (plan.step_deg)",
                    config.plan.step_deg
                )));
            }
            config.plan.views = views;
            config.plan.steps_per_view = steps as u32;
        }
        if let Some(path) = &self.calibration {
            let scale = ScaleFile::read(&names.input(path)?)?.given();
            config.optics.mm_per_px = scale.mm_per_px;
            config.optics.mm_per_px_sigma = scale.sigma;
            config.optics.camera_distance_mm = scale.camera_distance_mm.or(config.optics.camera_distance_mm);
        }
        config.optics.refine &= !self.no_refine;
        config.report.pictures &= !self.no_pictures;
        config.acquire.quality = self.quality.unwrap_or(config.acquire.quality);
        config.check()?;
        Ok(config)
    }

    /// Captures and computes. Blocks until the run ends.
    ///
    /// # Errors
    /// As [`capture`].
    pub fn run(&self, context: &Context, control: &Control) -> Result<Finished, JobError> {
        let config = self.over(&context.config, &context.names)?;
        let truth = self.truth.as_ref().map(|folder| context.names.output(folder)).transpose()?;
        let data = context.names.store().data();
        capture(data, &self.name, &config, truth.as_deref(), control, &context.watcher)
    }
}

/// A session to go on with.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct ResumeOptions {
    /// The session: its name in the data folder, or its folder's path.
    #[schema(value_type = String)]
    pub session: PathBuf,
    /// What becomes of a picture that is no good among the missing views, instead of what the session's
    /// configuration says.
    #[arg(long, value_enum)]
    pub quality: Option<QualityMode>,
}

impl ResumeOptions {
    /// Goes on with it. Blocks until the run ends.
    ///
    /// # Errors
    /// As [`resume`].
    pub fn run(&self, context: &Context, control: &Control) -> Result<Resumed, JobError> {
        resume(&context.names.session(&self.session)?, self.quality, control, &context.watcher)
    }
}

/// Captures a new session and computes its products. Blocks until the run ends.
///
/// `truth` is a folder for what only the simulated rig knows.
///
/// # Errors
/// [`JobError`]; what was captured stays in the session.
pub fn capture(
    data: &Path,
    name: &str,
    config: &Config,
    truth: Option<&Path>,
    control: &Control,
    watcher: &Watcher,
) -> Result<Finished, JobError> {
    if let Some(folder) = truth {
        // Before anything moves: a run whose truth has no place to go is not the one that was asked for.
        std::fs::create_dir_all(folder).map_err(|e| no_truth(folder, e))?;
    }
    begin(data, name, config)?.run(truth, control, watcher)
}

fn no_truth(folder: &Path, reason: impl std::fmt::Display) -> JobError {
    JobError::Truth { path: folder.into(), reason: reason.to_string() }
}

fn write_truth(handle: &TruthHandle, folder: &Path) -> Result<(), JobError> {
    for (name, bytes) in handle.files()? {
        write_whole(folder, name, &bytes).map_err(|e| no_truth(folder, e))?;
    }
    Ok(())
}

/// A run whose rig is open and whose session exists: nothing but the run itself can fail from here on.
pub(super) struct PreparedRun {
    session: Session,
    rig: devices::Rig,
    /// The mesh that was asked for otherwise than the frozen configuration says.
    mesh: Option<MeshSettings>,
    /// Whether pictures that are no good are taken again.
    gates: bool,
}

/// Opens the rig and makes the session.
pub(super) fn begin(data: &Path, name: &str, config: &Config) -> Result<PreparedRun, JobError> {
    config.check()?;
    let plan = config.plan.check().map_err(|e| ConfigError::Value(e.to_string()))?;
    let rig = devices::open(config)?;
    // How the monitor is reached is no part of a session, which people hand around; its token is a secret.
    let kept = Config { serve: ServeSettings::default(), ..config.clone() };
    let frozen = serde_json::to_value(&kept).map_err(|e| JobError::Encode(e.to_string()))?;
    let mut manifest = Manifest::new(name, Origin::Rig, plan, frozen);
    manifest.devices = vec![rig.stage.describe(), rig.camera.describe()];
    manifest.geometry = serde_json::to_value(Cameras::Turntable(config.optics))
        .map_err(|e| JobError::Encode(e.to_string()))?;
    let store = Store::new(data);
    store.folder(name)?;
    // Before the name is taken: a run that has no room leaves nothing behind.
    check_space(data, required_bytes(manifest.plan.views.len(), config.camera().view_bytes()))?;
    let session = store.create(&manifest)?;
    Ok(PreparedRun { session, rig, mesh: None, gates: config.acquire.quality == QualityMode::Gate })
}

/// Has the gate look at pictures, where there is one, and hands those that are kept to the pipeline.
struct Examiner<'a> {
    gate: Option<Gate<'a>>,
    send: SyncSender<View>,
}

impl Judge for Examiner<'_> {
    /// Where there is a gate, what it has cut out.
    type Seen = Option<SegmentedPicture>;

    fn examine(&mut self, view: &PlannedView, reached: Angle, frame: &Frame) -> Result<Self::Seen, String> {
        self.gate.as_ref().map(|gate| gate.examine(view.index, reached, &frame.bytes)).transpose()
    }

    fn kept(&mut self, view: CapturedView, frame: Frame, seen: Self::Seen) {
        let view = View::recorded(&view, frame.bytes);
        let view = match (&mut self.gate, seen) {
            (Some(gate), Some(segmented)) => gate.pass(view, segmented),
            _ => view,
        };
        // A pipeline that has failed takes no more views; the capture goes on all the same.
        let _ = self.send.send(view);
    }
}

/// What became of a session that was to go on.
#[derive(Debug, Clone)]
pub enum Resumed {
    /// It went on to its end.
    Done(Box<Finished>),
    /// All was captured, and products were missing or changed: they are made again.
    MadeAgain {
        /// The result.
        done: Box<Finished>,
        /// Names of the products.
        lost: Vec<String>,
    },
    /// It is complete: nothing was done.
    NothingToDo {
        /// Name of the session.
        session: String,
        /// Views captured.
        views: usize,
        /// The result as it was when the products were made.
        result: serde_json::Value,
    },
}

/// Goes on with an interrupted session: captures the views that its journal lacks, on the rig, and computes.
/// Where only the computation is missing or has failed no device is needed. `quality` says what becomes of missing
/// views that are no good, where it is not to be what the session's configuration says; what the result says of
/// views stays as that has it.
///
/// # Errors
/// [`JobError`]; what was captured stays in the session.
pub fn resume(
    folder: &Path,
    quality: Option<QualityMode>,
    control: &Control,
    watcher: &Watcher,
) -> Result<Resumed, JobError> {
    match take_up(folder, quality)? {
        Resumption::Nothing(nothing) => Ok(nothing),
        Resumption::Run(begun) => begun.run(None, control, watcher).map(|done| Resumed::Done(Box::new(done))),
        Resumption::Again { before, lost } => made_again(folder, before, lost, watcher),
        Resumption::Merge(mesh) => {
            let done = reconstruct(folder, mesh.as_ref(), false, false, watcher)?;
            Ok(Resumed::Done(Box::new(done)))
        }
    }
}

/// What there is to do for a session that was to go on.
pub(super) enum Resumption {
    /// Nothing.
    Nothing(Resumed),
    /// Views are missing, or what is computed from them.
    Run(Box<PreparedRun>),
    /// The products of a complete session are missing or have changed.
    Again {
        /// How they were made.
        before: Option<PriorProducts>,
        /// Their names.
        lost: Vec<String>,
    },
    /// Two poses are to be merged again, into this mesh where it is not the configured one.
    Merge(Option<MeshSettings>),
}

/// Opens a session to go on with, and the rig where views are missing.
pub(super) fn take_up(folder: &Path, quality: Option<QualityMode>) -> Result<Resumption, JobError> {
    let mut session = Session::open(folder)?;
    finish::end(&mut session)?;
    let recording = session.recording();
    let manifest = recording.manifest();
    // Before anything is said or done: a session whose evidence is lost is neither complete nor to be gone on with.
    let faults = damage(recording);
    if !faults.is_empty() {
        return Err(JobError::Damaged { session: manifest.name.clone(), faults });
    }
    if let (State::Complete, Some(result)) = (recording.state(), recording.result()) {
        let lost = recording.changed_products();
        if !lost.is_empty() {
            return Ok(Resumption::Again { before: prior_products(recording)?, lost });
        }
        let (session, views) = (manifest.name.clone(), recording.views().len());
        let mut result = result.clone();
        // Of a time when forms had no number.
        if result["schema"].is_null() {
            result["schema"] = 0.into();
        }
        // The session may have been moved since.
        result["products"] = serde_json::json!(product_paths(folder, recording.products()));
        return Ok(Resumption::Nothing(Resumed::NothingToDo { session, views, result }));
    }
    if manifest.origin == Origin::Merge {
        return Ok(Resumption::Merge(prior_products(recording)?.and_then(|before| before.mesh)));
    }
    let (config, _) = computation(recording)?;
    let mesh = prior_products(recording)?.and_then(|before| before.mesh);
    if manifest.origin == Origin::Import {
        // No rig can take somebody else's photographs again.
        check_views(recording)?;
    }
    let missing = recording.views().len() < manifest.plan.views.len();
    let rig = if missing {
        session.check_space(config.camera().view_bytes())?;
        devices::take_up(&config, devices::before(recording))?
    } else {
        let (stage, camera) = play(recording.clone());
        devices::Rig { stage: Box::new(stage), camera: Box::new(camera), truth: None }
    };
    let gates = missing && quality.unwrap_or(config.acquire.quality) == QualityMode::Gate;
    Ok(Resumption::Run(Box::new(PreparedRun { session, rig, mesh, gates })))
}

/// Makes the products of a complete session again that are missing or are not the recorded bytes.
fn made_again(
    folder: &Path,
    before: Option<PriorProducts>,
    lost: Vec<String>,
    watcher: &Watcher,
) -> Result<Resumed, JobError> {
    let again = replay(folder, watcher)?;
    let done = if again.differs.is_empty() {
        again.finished
    } else {
        // Another version's bytes are not to be had back: a new set, whole.
        let pictures = before.as_ref().is_none_or(|b| b.pictures);
        reconstruct(folder, before.and_then(|b| b.mesh).as_ref(), pictures, false, watcher)?
    };
    Ok(Resumed::MadeAgain { done: Box::new(done), lost })
}

impl PreparedRun {
    /// Captures what is missing and computes. Blocks until the run ends.
    pub(super) fn run(
        self,
        truth: Option<&Path>,
        control: &Control,
        watcher: &Watcher,
    ) -> Result<Finished, JobError> {
        let name = self.session.recording().manifest().name.clone();
        trace::job("capture", &name, || self.capture(truth, control, watcher))
    }

    fn capture(
        self,
        truth: Option<&Path>,
        control: &Control,
        watcher: &Watcher,
    ) -> Result<Finished, JobError> {
        let Self { mut session, mut rig, mesh, gates } = self;
        let watch = Arc::clone(watcher);
        session.observe(move |e| watch(e));
        let recording = session.recording().clone();
        let (_, mut pipeline) = computation(&recording)?;
        if let Some(mesh) = &mesh {
            pipeline.settings.mesh = mesh.clone();
        }
        let plan = &recording.manifest().plan;
        let session = Arc::new(Mutex::new(session));
        let (send, receive) = sync_channel(WAITING_VIEWS);
        let clock = SystemClock::new();
        let span = tracing::Span::current();
        let outcome = std::thread::scope(|scope| {
            let computing =
                scope.spawn(|| span.in_scope(|| pipeline.run(receive, &|what| note(&session, what))));
            // Where pictures are judged before they are kept, that cuts them out and the pipeline does not.
            let mut gate = gates.then(|| Gate::new(&pipeline));
            let through = |view: View| match &mut gate {
                Some(gate) => gate.pass_recorded(view),
                None => view,
            };
            let sent = send_recorded(&recording, &send, through);
            // The sender goes away with the sink: that ends the pipeline's waiting.
            let judge = Examiner { gate, send };
            let acquired = sent.and_then(|()| {
                let mut sink = SessionSink::new(scope, Arc::clone(&session), judge);
                let ended =
                    acquire::run(&mut *rig.stage, &mut *rig.camera, plan, &mut sink, control, &clock)?;
                Ok(ended)
            });
            let made = joined(computing);
            match acquired? {
                Outcome::Complete { .. } => Ok(Some(made?)),
                Outcome::Aborted { .. } => Ok(None),
            }
        });
        let told = match (&rig.truth, truth) {
            (Some(handle), Some(folder)) => write_truth(handle, folder),
            _ => Ok(()),
        };
        let concluded = match outcome {
            Ok(Some(made)) => conclude(&session, Ok(made), mesh.as_ref()),
            // The journal has the abort already.
            Ok(None) => {
                let session = lock(&session);
                let r = session.recording();
                Err(JobError::Aborted {
                    session: r.manifest().name.clone(),
                    captured: r.views().len(),
                    planned: plan.views.len(),
                })
            }
            // The acquisition has journalled its own failure.
            Err(error @ JobError::Acquire(_)) => Err(error),
            Err(error) => conclude(&session, Err::<Reconstruction, _>(error), None),
        };
        // The products come first: they are what the run was for.
        concluded.and_then(|done| told.map(|()| done))
    }
}

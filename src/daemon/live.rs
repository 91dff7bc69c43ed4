//! Capture on the rig: the stage turns, the session fills, the pipeline computes alongside.

use super::devices;
use super::finish::{self, Finished, product_paths};
use super::recorded::{
    MadeBefore, WAITING_VIEWS, check_views, computation, conclude, joined, lock, made_before, note,
    reconstruct, replay, send_recorded,
};
use super::{DaemonError, Watcher};
use crate::acquire::{self, Control, Judge, Outcome, QualityMode, SessionSink, SystemClock};
use crate::config::{CameraKind, Config, ConfigError, RigKind, ServeSettings};
use crate::pipeline::{Cameras, Gate, MeshSettings, Reconstruction, SegmentedPicture, View};
use crate::rig::Frame;
use crate::rig::simulated::TruthHandle;
use crate::session::event::CapturedView;
use crate::session::replay::replay as play;
use crate::session::{
    Manifest, Origin, PlannedView, Session, State, Store, check_space, damage, required_bytes, write_whole,
};
use crate::trace;
use grainrig_core::geometry::Angle;
use std::path::Path;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex};

/// What one picture takes on the disk, for the check before a run: a DSLR's largest JPEG, and its RAW file.
const FRAME_BYTES: u64 = 24 << 20;
const RAW_BYTES: u64 = 40 << 20;

/// What one view of this configuration takes on the disk, bytes.
pub(super) fn view_bytes(config: &Config) -> u64 {
    let of_dslr = config.rig.kind == RigKind::Hardware && config.rig.camera == CameraKind::Gphoto2;
    FRAME_BYTES + if of_dslr { RAW_BYTES } else { 0 }
}

/// Captures a new session and computes its products. Blocks until the run ends.
///
/// `truth` is a folder for what only the simulated rig knows.
///
/// # Errors
/// [`DaemonError`]; what was captured stays in the session.
pub fn capture(
    data: &Path,
    name: &str,
    config: &Config,
    truth: Option<&Path>,
    control: &Control,
    watcher: &Watcher,
) -> Result<Finished, DaemonError> {
    if let Some(folder) = truth {
        // Before anything moves: a run whose truth has no place to go is not the one that was asked for.
        std::fs::create_dir_all(folder).map_err(|e| no_truth(folder, e))?;
    }
    begin(data, name, config)?.run(truth, control, watcher)
}

fn no_truth(folder: &Path, reason: impl std::fmt::Display) -> DaemonError {
    DaemonError::Truth { path: folder.into(), reason: reason.to_string() }
}

fn write_truth(handle: &TruthHandle, folder: &Path) -> Result<(), DaemonError> {
    for (name, bytes) in handle.files()? {
        write_whole(folder, name, &bytes).map_err(|e| no_truth(folder, e))?;
    }
    Ok(())
}

/// A run whose rig is open and whose session exists: nothing but the run itself can fail from here on.
pub(super) struct Begun {
    session: Session,
    rig: devices::Rig,
    /// The mesh that was asked for otherwise than the frozen configuration says.
    mesh: Option<MeshSettings>,
    /// Whether pictures that are no good are taken again.
    gates: bool,
}

/// Opens the rig and makes the session.
pub(super) fn begin(data: &Path, name: &str, config: &Config) -> Result<Begun, DaemonError> {
    config.check()?;
    let plan = config.plan.check().map_err(|e| ConfigError::Value(e.to_string()))?;
    let rig = devices::open(config)?;
    // How the monitor is reached is no part of a session, which people hand around; its token is a secret.
    let kept = Config { serve: ServeSettings::default(), ..config.clone() };
    let frozen = serde_json::to_value(&kept).map_err(|e| DaemonError::Encode(e.to_string()))?;
    let mut manifest = Manifest::new(name, Origin::Rig, plan, frozen);
    manifest.devices = vec![rig.stage.describe(), rig.camera.describe()];
    manifest.geometry = serde_json::to_value(Cameras::Turntable(config.optics))
        .map_err(|e| DaemonError::Encode(e.to_string()))?;
    let store = Store::new(data);
    store.folder(name)?;
    // Before the name is taken: a run that has no room leaves nothing behind.
    check_space(data, required_bytes(manifest.plan.views.len(), view_bytes(config)))?;
    let session = store.create(&manifest)?;
    Ok(Begun { session, rig, mesh: None, gates: config.acquire.quality == QualityMode::Gate })
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
/// [`DaemonError`]; what was captured stays in the session.
pub fn resume(
    folder: &Path,
    quality: Option<QualityMode>,
    control: &Control,
    watcher: &Watcher,
) -> Result<Resumed, DaemonError> {
    match take_up(folder, quality)? {
        TakenUp::Nothing(nothing) => Ok(nothing),
        TakenUp::Run(begun) => begun.run(None, control, watcher).map(|done| Resumed::Done(Box::new(done))),
        TakenUp::Again { before, lost } => made_again(folder, before, lost, watcher),
        TakenUp::Merge(mesh) => {
            let done = reconstruct(folder, mesh.as_ref(), false, false, watcher)?;
            Ok(Resumed::Done(Box::new(done)))
        }
    }
}

/// What there is to do for a session that was to go on.
pub(super) enum TakenUp {
    /// Nothing.
    Nothing(Resumed),
    /// Views are missing, or what is computed from them.
    Run(Box<Begun>),
    /// The products of a complete session are missing or have changed.
    Again {
        /// How they were made.
        before: Option<MadeBefore>,
        /// Their names.
        lost: Vec<String>,
    },
    /// Two poses are to be merged again, into this mesh where it is not the configured one.
    Merge(Option<MeshSettings>),
}

/// Opens a session to go on with, and the rig where views are missing.
pub(super) fn take_up(folder: &Path, quality: Option<QualityMode>) -> Result<TakenUp, DaemonError> {
    let mut session = Session::open(folder)?;
    finish::end(&mut session)?;
    let recording = session.recording();
    let manifest = recording.manifest();
    // Before anything is said or done: a session whose evidence is lost is neither complete nor to be gone on with.
    let faults = damage(recording);
    if !faults.is_empty() {
        return Err(DaemonError::Damaged { session: manifest.name.clone(), faults });
    }
    if let (State::Complete, Some(result)) = (recording.state(), recording.result()) {
        let lost = recording.changed_products();
        if !lost.is_empty() {
            return Ok(TakenUp::Again { before: made_before(recording)?, lost });
        }
        let (session, views) = (manifest.name.clone(), recording.views().len());
        let mut result = result.clone();
        // Of a time when forms had no number.
        if result["schema"].is_null() {
            result["schema"] = 0.into();
        }
        // The session may have been moved since.
        result["products"] = serde_json::json!(product_paths(folder, recording.products()));
        return Ok(TakenUp::Nothing(Resumed::NothingToDo { session, views, result }));
    }
    if manifest.origin == Origin::Merge {
        return Ok(TakenUp::Merge(made_before(recording)?.and_then(|before| before.mesh)));
    }
    let (config, _) = computation(recording)?;
    let mesh = made_before(recording)?.and_then(|before| before.mesh);
    if manifest.origin == Origin::Import {
        // No rig can take somebody else's photographs again.
        check_views(recording)?;
    }
    let missing = recording.views().len() < manifest.plan.views.len();
    let rig = if missing {
        session.check_space(view_bytes(&config))?;
        devices::take_up(&config, devices::before(recording))?
    } else {
        let (stage, camera) = play(recording.clone());
        devices::Rig { stage: Box::new(stage), camera: Box::new(camera), truth: None }
    };
    let gates = missing && quality.unwrap_or(config.acquire.quality) == QualityMode::Gate;
    Ok(TakenUp::Run(Box::new(Begun { session, rig, mesh, gates })))
}

/// Makes the products of a complete session again that are missing or are not the recorded bytes.
fn made_again(
    folder: &Path,
    before: Option<MadeBefore>,
    lost: Vec<String>,
    watcher: &Watcher,
) -> Result<Resumed, DaemonError> {
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

impl Begun {
    /// Captures what is missing and computes. Blocks until the run ends.
    pub(super) fn run(
        self,
        truth: Option<&Path>,
        control: &Control,
        watcher: &Watcher,
    ) -> Result<Finished, DaemonError> {
        let name = self.session.recording().manifest().name.clone();
        trace::job("capture", &name, || self.capture(truth, control, watcher))
    }

    fn capture(
        self,
        truth: Option<&Path>,
        control: &Control,
        watcher: &Watcher,
    ) -> Result<Finished, DaemonError> {
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
                Err(DaemonError::Aborted {
                    session: r.manifest().name.clone(),
                    captured: r.views().len(),
                    planned: plan.views.len(),
                })
            }
            // The acquisition has journalled its own failure.
            Err(error @ DaemonError::Acquire(_)) => Err(error),
            Err(error) => conclude(&session, Err::<Reconstruction, _>(error), None),
        };
        // The products come first: they are what the run was for.
        concluded.and_then(|done| told.map(|()| done))
    }
}

//! Capture on the rig: the stage turns, the session fills, the pipeline computes alongside.

use super::devices;
use super::finish::Finished;
use super::recorded::{WAITING_VIEWS, computation, conclude, lock, note, send_recorded};
use super::{DaemonError, Watcher};
use crate::acquire::{self, Control, Outcome, SessionSink, SystemClock};
use crate::config::{Config, ConfigError, ServeSettings};
use crate::geometry::Angle;
use crate::pipeline::{Cameras, View};
use crate::session::{Manifest, Origin, Session, Store};
use std::path::Path;
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex};

/// What one picture takes on the disk, for the check before a run: a DSLR's largest JPEG.
const FRAME_BYTES: u64 = 24 << 20;

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
    begin(data, name, config)?.run(truth, control, watcher)
}

/// A run whose rig is open and whose session exists: nothing but the run itself can fail from here on.
pub(super) struct Begun {
    session: Session,
    rig: devices::Rig,
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
    let mut staged = Store::new(data).stage(&manifest)?;
    // Before it gets its name: a run that can't begin leaves the name free.
    staged.session().check_space(FRAME_BYTES)?;
    Ok(Begun { session: staged.publish()?, rig })
}

/// Goes on with an interrupted session: captures the views that its journal lacks.
///
/// # Errors
/// [`DaemonError`]; what was captured stays in the session.
pub fn resume(folder: &Path, control: &Control, watcher: &Watcher) -> Result<Finished, DaemonError> {
    let session = Session::open(folder)?;
    let (config, _) = computation(session.recording())?;
    let rig = devices::open(&config)?;
    session.check_space(FRAME_BYTES)?;
    Begun { session, rig }.run(None, control, watcher)
}

impl Begun {
    /// Captures what is missing and computes. Blocks until the run ends.
    pub(super) fn run(
        self,
        truth: Option<&Path>,
        control: &Control,
        watcher: &Watcher,
    ) -> Result<Finished, DaemonError> {
        let Self { mut session, mut rig } = self;
        let watch = Arc::clone(watcher);
        session.observe(move |e| watch(e));
        let recording = session.recording().clone();
        let (_, pipeline) = computation(&recording)?;
        let plan = &recording.manifest().plan;
        let session = Arc::new(Mutex::new(session));
        let (send, receive) = sync_channel(WAITING_VIEWS);
        let clock = SystemClock::new();
        let outcome = std::thread::scope(|scope| {
            let computing = scope.spawn(|| pipeline.run(receive, &|what| note(&session, what)));
            let acquired = send_recorded(&recording, &send).and_then(|()| {
                // A pipeline that has failed takes no more views; the capture goes on all the same.
                let forward = |view: crate::session::event::CapturedView, frame: crate::rig::Frame| {
                    let angle = Angle::from_deg(view.reached_deg);
                    let _ = send.send(View { index: view.view, role: view.role, angle, bytes: frame.bytes });
                };
                let mut sink = SessionSink::new(Arc::clone(&session), forward);
                let ended =
                    acquire::run(&mut *rig.stage, &mut *rig.camera, plan, &mut sink, control, &clock)?;
                Ok(ended)
            });
            drop(send);
            let made = match computing.join() {
                Ok(made) => made,
                Err(panic) => std::panic::resume_unwind(panic),
            };
            match acquired? {
                Outcome::Complete { .. } => Ok(Some(made?)),
                Outcome::Aborted { .. } => Ok(None),
            }
        });
        if let (Some(handle), Some(folder)) = (&rig.truth, truth) {
            std::fs::create_dir_all(folder)
                .and_then(|()| handle.write_truth(folder))
                .map_err(|source| DaemonError::Write { path: folder.into(), source })?;
        }
        match outcome {
            Ok(Some(made)) => conclude(&session, Ok(made), None),
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
            Err(error) => conclude(&session, Err(error), None),
        }
    }
}

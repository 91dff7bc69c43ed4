//! The rig of a configuration, opened; and what is there to be opened.

use crate::config::{Config, RigKind};
use crate::rig::simulated::{self, TruthHandle};
use crate::rig::{Camera, RigError, RotationStage};
use serde::Serialize;

/// An open rig.
pub(super) struct Rig {
    pub(super) stage: Box<dyn RotationStage>,
    pub(super) camera: Box<dyn Camera>,
    /// What only a simulated rig knows.
    pub(super) truth: Option<TruthHandle>,
}

/// Opens the rig that the configuration names.
pub(super) fn open(config: &Config) -> Result<Rig, RigError> {
    match config.rig.kind {
        RigKind::Simulated => {
            let (stage, camera, truth) = simulated::open(&config.simulated)?;
            Ok(Rig { stage: Box::new(stage), camera: Box::new(camera), truth: Some(truth) })
        }
    }
}

/// One device that could be used.
#[derive(Debug, Clone, Serialize)]
pub struct DeviceLine {
    /// `stage` or `camera`.
    pub role: &'static str,
    /// The kind of rig that it belongs to.
    pub kind: &'static str,
    /// As it describes itself.
    pub name: String,
    /// Whether this configuration uses it.
    pub configured: bool,
}

/// The devices that this configuration can open.
///
/// # Errors
/// [`RigError`] where the configured rig can't be opened.
pub fn devices(config: &Config) -> Result<Vec<DeviceLine>, RigError> {
    let rig = open(config)?;
    let line = |role, name| DeviceLine { role, kind: "simulated", name, configured: true };
    Ok(vec![line("stage", rig.stage.describe()), line("camera", rig.camera.describe())])
}

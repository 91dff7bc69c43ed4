//! The rig of a configuration, opened; and what is there to be opened.

use crate::config::{CameraKind, Config, RigKind, StageKind};
use crate::geometry::Angle;
use crate::rig::gphoto::{GphotoCamera, Launch};
use crate::rig::simulated::{self, TruthHandle};
use crate::rig::v4l::V4lCamera;
use crate::rig::{Camera, RigError, RotationStage, controller, grbl};
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
        RigKind::Hardware => {
            let stage: Box<dyn RotationStage> = match config.rig.stage {
                StageKind::Controller => Box::new(controller::open(&config.controller)?),
                StageKind::Grbl => Box::new(grbl::open(&config.grbl)?),
                StageKind::Simulated => Box::new(simulated::open(&config.simulated)?.0),
            };
            match config.rig.camera {
                CameraKind::Simulated => {
                    let (_, camera, truth) = simulated::open(&config.simulated)?;
                    let stage = Seen { stage, truth: truth.clone() };
                    Ok(Rig { stage: Box::new(stage), camera: Box::new(camera), truth: Some(truth) })
                }
                CameraKind::Gphoto2 => {
                    let unnamed =
                        |e| RigError::Device(format!("this program does not know its own file: {e}"));
                    let launch = Launch::this_program().map_err(unnamed)?;
                    let camera = Box::new(GphotoCamera::open(&config.gphoto2, launch)?);
                    Ok(Rig { stage, camera, truth: None })
                }
                CameraKind::V4l2 => {
                    let camera = Box::new(V4lCamera::open(&config.v4l2)?);
                    Ok(Rig { stage, camera, truth: None })
                }
            }
        }
    }
}

/// A stage that the simulated camera sees turn.
struct Seen {
    stage: Box<dyn RotationStage>,
    truth: TruthHandle,
}

impl Seen {
    fn show(&self, reached: Angle) -> Angle {
        self.truth.turn_to(reached);
        reached
    }
}

impl RotationStage for Seen {
    fn home(&mut self) -> Result<Angle, RigError> {
        self.stage.home().map(|reached| self.show(reached))
    }

    fn move_to(&mut self, target: Angle) -> Result<Angle, RigError> {
        self.stage.move_to(target).map(|reached| self.show(reached))
    }

    fn describe(&self) -> String {
        self.stage.describe()
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
    let kind = match config.rig.kind {
        RigKind::Simulated => "simulated",
        RigKind::Hardware => "hardware",
    };
    let line = |role, name| DeviceLine { role, kind, name, configured: true };
    Ok(vec![line("stage", rig.stage.describe()), line("camera", rig.camera.describe())])
}

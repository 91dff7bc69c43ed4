//! The rig of a configuration, opened; and what is there to be opened.

use crate::config::{Config, Release, RigKind};
use crate::rig::discovery::{Found, Role, discover};
use crate::rig::driver::{OpenCamera, OpenStage};
use crate::rig::simulated;
use crate::rig::{Before, Camera, RigError, RotationStage, TruthHandle, traced_camera, traced_stage};
use crate::session::Recording;
use crate::session::event::EventKind;
use grainrig_core::geometry::Angle;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// An open rig.
pub(super) struct Rig {
    pub(super) stage: Box<dyn RotationStage>,
    pub(super) camera: Box<dyn Camera>,
    /// What only a simulated rig knows.
    pub(super) truth: Option<TruthHandle>,
}

impl Rig {
    /// With its requests in the log.
    fn traced(self) -> Self {
        Self { stage: traced_stage(self.stage), camera: traced_camera(self.camera), truth: self.truth }
    }
}

/// Opens the rig that the configuration names.
pub(super) fn open(config: &Config) -> Result<Rig, RigError> {
    take_up(config, Before::default())
}

/// What a recorded session has had a rig do. An exposure leaves a picture, its refusal, or what the camera said instead.
pub(super) fn before(recording: &Recording) -> Before {
    let of_camera = |text: &str| text.contains("the simulated camera");
    let mut before = Before::default();
    for event in recording.events() {
        match &event.what {
            EventKind::Moving { .. } => before.moves += 1,
            EventKind::Captured { .. } | EventKind::Rejected { .. } => before.exposures += 1,
            EventKind::Suspended { cause: text, .. } | EventKind::Failed { error: text }
                if of_camera(text) =>
            {
                before.exposures += 1;
            }
            _ => {}
        }
    }
    before
}

/// The same, of a session that is taken up after what it has had the rig do before: a simulated one's faults go on from
/// there.
pub(super) fn take_up(config: &Config, before: Before) -> Result<Rig, RigError> {
    opened(config, before).map(Rig::traced)
}

fn opened(config: &Config, before: Before) -> Result<Rig, RigError> {
    if config.rig.kind == RigKind::Simulated {
        // One rig and not two devices: its camera sees where the motor truly stands.
        let (stage, camera, truth) = simulated::take_up(&config.simulated, before)?;
        return Ok(Rig { stage: Box::new(stage), camera: Box::new(camera), truth: Some(truth) });
    }
    let OpenStage { stage, shutter } = config.stage().open(before)?;
    let shutter = shutter.filter(|_| config.rig.release == Release::Controller);
    let OpenCamera { camera, truth } = config.camera().open(before, shutter)?;
    let stage = match &truth {
        Some(truth) => Box::new(Seen { stage, truth: truth.clone() }),
        None => stage,
    };
    Ok(Rig { stage, camera, truth })
}

/// Opens the camera alone: nothing turns.
pub(super) fn open_camera(config: &Config) -> Result<Box<dyn Camera>, RigError> {
    Ok(traced_camera(config.camera().open(Before::default(), None)?.camera))
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

    fn take_up(&mut self, stands: Angle) -> Result<Angle, RigError> {
        self.stage.take_up(stands).map(|reached| self.show(reached))
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
    pub role: Role,
    /// The driver that it is for, or several.
    pub driver: String,
    /// As it describes itself.
    pub name: String,
    /// Its device file; none of the simulated ones.
    pub path: Option<PathBuf>,
    /// Whether this account may open it.
    pub permitted: bool,
    /// Another program that has it open.
    pub held_by: Option<String>,
    /// Whether this configuration uses it.
    pub configured: bool,
}

/// The devices that are there: the simulated ones, and what is plugged in. No hardware is opened.
///
/// # Errors
/// [`RigError`] where the simulated rig can't be set up.
pub fn devices(config: &Config) -> Result<Vec<DeviceLine>, RigError> {
    let [stage, camera] = [config.stage_kind().name(), config.camera_kind().name()];
    let found = discover(config.stages(), config.cameras(), Path::new("/"))?;
    let line = |found: Found| DeviceLine {
        configured: match found.role {
            Role::Stage => found.drivers.contains(&stage) && config.stage().means(&found),
            Role::Camera => found.drivers.contains(&camera) && config.camera().means(&found),
        },
        role: found.role,
        driver: found.drivers.join(" or "),
        name: found.name,
        path: found.path,
        permitted: found.permitted,
        held_by: found.held_by,
    };
    Ok(found.into_iter().map(line).collect())
}

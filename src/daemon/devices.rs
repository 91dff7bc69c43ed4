//! The rig of a configuration, opened; and what is there to be opened.

use crate::config::{CameraKind, Config, Release, RigKind, StageKind};
use crate::rig::discovery::{Role, discover};
use crate::rig::gphoto::{GphotoCamera, Launch};
use crate::rig::simulated::{self, Before, TruthHandle};
use crate::rig::v4l::V4lCamera;
use crate::rig::{Camera, RigError, RotationStage, controller, grbl, traced_camera, traced_stage};
use crate::session::Recording;
use crate::session::event::Happening;
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
            Happening::Moving { .. } => before.moves += 1,
            Happening::Captured { .. } | Happening::Rejected { .. } => before.exposures += 1,
            Happening::Suspended { cause: text, .. } | Happening::Failed { error: text }
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
    match config.rig.kind {
        RigKind::Simulated => {
            let (stage, camera, truth) = simulated::take_up(&config.simulated, before)?;
            Ok(Rig { stage: Box::new(stage), camera: Box::new(camera), truth: Some(truth) })
        }
        RigKind::Hardware => {
            let mut shutter = None;
            let stage: Box<dyn RotationStage> = match config.rig.stage {
                StageKind::Controller => {
                    let stage = controller::open(&config.controller)?;
                    shutter = (config.rig.release == Release::Controller).then(|| stage.shutter());
                    Box::new(stage)
                }
                StageKind::Grbl => Box::new(grbl::open(&config.grbl)?),
                StageKind::Simulated => Box::new(simulated::take_up(&config.simulated, before)?.0),
            };
            match config.rig.camera {
                CameraKind::Simulated => {
                    let (_, camera, truth) = simulated::take_up(&config.simulated, before)?;
                    let stage = Seen { stage, truth: truth.clone() };
                    Ok(Rig { stage: Box::new(stage), camera: Box::new(camera), truth: Some(truth) })
                }
                CameraKind::Gphoto2 => {
                    let mut camera = GphotoCamera::open(&config.gphoto2, Launch::this_program())?;
                    if let Some(shutter) = shutter {
                        camera = camera.released_by(shutter);
                    }
                    Ok(Rig { stage, camera: Box::new(camera), truth: None })
                }
                CameraKind::V4l2 => {
                    let camera = Box::new(V4lCamera::open(&config.v4l2)?);
                    Ok(Rig { stage, camera, truth: None })
                }
            }
        }
    }
}

/// Opens the camera alone: nothing turns.
pub(super) fn open_camera(config: &Config) -> Result<Box<dyn Camera>, RigError> {
    let kind = match config.rig.kind {
        RigKind::Simulated => CameraKind::Simulated,
        RigKind::Hardware => config.rig.camera,
    };
    let camera: Box<dyn Camera> = match kind {
        CameraKind::Simulated => Box::new(simulated::open(&config.simulated)?.1),
        CameraKind::Gphoto2 => Box::new(GphotoCamera::open(&config.gphoto2, Launch::this_program())?),
        CameraKind::V4l2 => Box::new(V4lCamera::open(&config.v4l2)?),
    };
    Ok(traced_camera(camera))
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
    /// The driver that it is for.
    pub driver: &'static str,
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
    let (stage, camera, _) = simulated::open(&config.simulated)?;
    let hardware = config.rig.kind == RigKind::Hardware;
    let simulated = |role, name, configured| DeviceLine {
        role,
        driver: "simulated",
        name,
        path: None,
        permitted: true,
        held_by: None,
        configured,
    };
    let mut all = vec![
        simulated(Role::Stage, stage.describe(), !hardware || config.rig.stage == StageKind::Simulated),
        simulated(Role::Camera, camera.describe(), !hardware || config.rig.camera == CameraKind::Simulated),
    ];
    let same = |found: &Path, named: &Path| {
        found == named || found.canonicalize().is_ok_and(|p| named.canonicalize().is_ok_and(|q| p == q))
    };
    all.extend(discover(Path::new("/")).into_iter().map(|found| {
        let configured = hardware
            && match found.driver {
                "gphoto2" => config.rig.camera == CameraKind::Gphoto2,
                "v4l2" => {
                    let named = &config.v4l2.device;
                    config.rig.camera == CameraKind::V4l2
                        && (named.as_os_str().is_empty() || same(&found.path, named))
                }
                _ => match config.rig.stage {
                    StageKind::Controller => same(&found.path, Path::new(&config.controller.port)),
                    StageKind::Grbl => same(&found.path, Path::new(&config.grbl.port)),
                    StageKind::Simulated => false,
                },
            };
        DeviceLine {
            role: found.role,
            driver: found.driver,
            name: found.name,
            path: Some(found.path),
            permitted: found.permitted,
            held_by: found.held_by,
            configured,
        }
    }));
    Ok(all)
}

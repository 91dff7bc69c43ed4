//! What every driver answers for; its settings do it. Which drivers there are is the table in [`super`].

use super::discovery::Found;
use super::{Camera, RigError, RotationStage, Shutter, TruthHandle};
use grainrig_core::plausible::Doubt;
use serde::Serialize;
use std::path::Path;

/// What one picture takes on the disk, bytes: a DSLR's largest JPEG.
pub const FRAME_BYTES: u64 = 24 << 20;
/// What a RAW file beside it takes, bytes.
pub const RAW_BYTES: u64 = 40 << 20;

/// What stages and cameras have in common.
pub trait Driver {
    /// Whether every value makes sense.
    ///
    /// # Errors
    /// [`RigError`] names the first that does not, its limit and the remedy.
    fn check(&self) -> Result<(), RigError>;
    /// What of the figures no laboratory has.
    fn doubts(&self) -> Vec<Doubt> {
        Vec::new()
    }
    /// What of its section belongs to whoever runs the daemon and not to a run: JSON pointers within the section, and the
    /// empty one for all of it.
    fn fixed(&self) -> &'static [&'static str] {
        &[""]
    }
    /// Whether it was built in; `None` where it is part of every build. Opening one that was not says what to do.
    fn built_in(&self) -> Option<bool> {
        None
    }
    /// What the doctor looks at beside the devices themselves.
    fn findings(&self) -> Vec<Finding> {
        Vec::new()
    }
}

/// Something that turns the grain.
pub trait StageDriver: Driver {
    /// The devices below a root folder (`/`, or a copy of its `dev` and `sys`) that it could drive. Nothing is opened.
    ///
    /// # Errors
    /// [`RigError`] where the settings don't say what the device is.
    fn found(&self, root: &Path) -> Result<Vec<Found>, RigError>;
    /// Whether the settings mean this device.
    fn means(&self, found: &Found) -> bool;
    /// Whether the same device can release a camera's shutter.
    fn has_release(&self) -> bool {
        false
    }
    /// Opens the stage; `before` is what a run that is taken up has done. Nothing moves.
    ///
    /// # Errors
    /// [`RigError`] where it can't be opened, does not answer or is set otherwise.
    fn open(&self, before: Before) -> Result<OpenStage, RigError>;
}

/// Something that photographs the grain.
pub trait CameraDriver: Driver {
    /// As [`StageDriver::found`].
    ///
    /// # Errors
    /// [`RigError`] where the settings don't say what the device is.
    fn found(&self, root: &Path) -> Result<Vec<Found>, RigError>;
    /// Whether the settings mean this device.
    fn means(&self, _found: &Found) -> bool {
        true
    }
    /// Whether its shutter can be released from elsewhere.
    fn takes_release(&self) -> bool {
        false
    }
    /// What one view takes on the disk, bytes; for the check before a run.
    fn view_bytes(&self) -> u64 {
        FRAME_BYTES
    }
    /// Opens the camera, released by `shutter` where there is one.
    ///
    /// # Errors
    /// [`RigError`] where it can't be opened, does not answer or is set otherwise.
    fn open(&self, before: Before, shutter: Option<Box<dyn Shutter>>) -> Result<OpenCamera, RigError>;
}

/// A stage, and the camera's release on the same device.
pub struct OpenStage {
    /// The stage.
    pub stage: Box<dyn RotationStage>,
    /// The release; good as long as the stage.
    pub shutter: Option<Box<dyn Shutter>>,
}

/// A camera, and what it knows of what it sees.
pub struct OpenCamera {
    /// The camera.
    pub camera: Box<dyn Camera>,
    /// Of a rendered grain: what is to be told how the stage stands, and tells the truth.
    pub truth: Option<TruthHandle>,
}

impl OpenStage {
    /// A stage that releases no camera.
    pub fn alone(stage: impl RotationStage + 'static) -> Self {
        Self { stage: Box::new(stage), shutter: None }
    }
}

impl OpenCamera {
    /// A camera of this world.
    pub fn of(camera: impl Camera + 'static) -> Self {
        Self { camera: Box::new(camera), truth: None }
    }
}

/// What the rig has done before a run takes it up again, as the session's journal knows it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Before {
    /// Exposures, good and bad.
    pub exposures: usize,
    /// Moves to a view.
    pub moves: usize,
}

/// How a check came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Health {
    /// As it should be.
    Good,
    /// A run may go well, or not.
    Doubtful,
    /// A run will not go well.
    Bad,
    /// Not looked at, because of what was found before.
    Skipped,
}

/// What a check found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub check: &'static str,
    /// How it came out.
    pub health: Health,
    /// What was found.
    pub found: String,
    /// What to do about it.
    pub remedy: Option<String>,
}

impl Finding {
    /// It is as it should be.
    pub fn good(check: &'static str, found: impl Into<String>) -> Self {
        Self { check, health: Health::Good, found: found.into(), remedy: None }
    }

    /// A run will not go well.
    pub fn bad(check: &'static str, error: &RigError) -> Self {
        let (found, remedy) = error.cause_and_remedy();
        Self { check, health: Health::Bad, found, remedy }
    }
}

/// Makes the kinds of stage and camera of the table's rows.
macro_rules! kinds {
    (
        sections { $($_section:tt)* }
        stages { $($(#[$of_stage:meta])* $Stage:ident = $stage:ident,)* }
        cameras { $($(#[$of_camera:meta])* $Camera:ident = $camera:ident,)* }
    ) => {
        kinds! { #[doc = "What turns the grain."] StageKind $($(#[$of_stage])* $Stage = $stage,)* }
        kinds! { #[doc = "What photographs the grain."] CameraKind $($(#[$of_camera])* $Camera = $camera,)* }
    };
    (#[$about:meta] $Kind:ident $($(#[$of:meta])* $Each:ident = $name:ident,)*) => {
        #[$about]
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum $Kind {
            $($(#[$of])* $Each,)*
        }

        impl $Kind {
            /// All that there are.
            pub const ALL: &[Self] = &[$(Self::$Each,)*];

            /// Its name in the configuration, which is its section's.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$Each => stringify!($name),)* }
            }
        }
    };
}

super::drivers!(kinds);

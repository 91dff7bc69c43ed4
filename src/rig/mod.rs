//! The rig: a stage that turns the grain and a camera that photographs it.
//!
//! The traits speak the field's verbs and know nothing of how a device was found. One thread owns each
//! device; calls block. A driver is a module, whose settings answer for it ([`driver`]), and its rows in the table below.

pub mod controller;
pub mod discovery;
pub mod driver;
pub mod folder;
pub mod gphoto;
pub mod grbl;
mod holder;
mod serial;
pub mod simulated;
mod traced;
pub mod v4l;

/// The drivers. A section of the configuration is named like the driver that it sets; what drives both stage and camera has one.
/// Whoever wants something of each driver hands this macro one that takes the rows: here the kinds, in `config` the sections.
macro_rules! drivers {
    ($take:ident) => {
        $take! {
            sections {
                /// The simulated rig.
                simulated: $crate::rig::simulated::Settings,
                /// The stepper controller with grainrig's firmware.
                controller: $crate::rig::controller::Settings,
                /// A board with GRBL.
                grbl: $crate::rig::grbl::Settings,
                /// A DSLR by libgphoto2.
                gphoto2: $crate::rig::gphoto::Settings,
                /// A video camera by V4L2.
                v4l2: $crate::rig::v4l::Settings,
                /// A folder that another program saves pictures to.
                folder: $crate::rig::folder::Settings,
            }
            stages {
                /// A board with grainrig's firmware (`firmware/`), set in `[controller]`.
                #[default]
                Controller = controller,
                /// A board with GRBL 1.1, set in `[grbl]`.
                Grbl = grbl,
                /// The simulated stage, which turns nothing: to try a camera out.
                Simulated = simulated,
            }
            cameras {
                /// The simulated camera, which sees the grain at the angle that the stage says it reached: to try a stage out.
                #[default]
                Simulated = simulated,
                /// A DSLR, set in `[gphoto2]`.
                Gphoto2 = gphoto2,
                /// A video camera, set in `[v4l2]`.
                V4l2 = v4l2,
                /// A camera whose pictures another program saves, set in `[folder]`.
                Folder = folder,
            }
        }
    };
}
pub(crate) use drivers;

pub use driver::{Before, CameraDriver, CameraKind, Driver, StageDriver, StageKind};
pub use grainrig_core::formats::Encoding;
use grainrig_core::geometry::Angle;
pub use simulated::TruthHandle;
use std::time::Duration;
pub use traced::{traced_camera, traced_stage};

/// Turns the grain about the z axis.
pub trait RotationStage: Send {
    /// Finds the reference angle and goes there; returns the angle reached (zero by definition).
    ///
    /// # Errors
    /// [`RigError`] where the stage does not answer or the reference is not found.
    fn home(&mut self) -> Result<Angle, RigError>;
    /// Takes up what was interrupted when the stage had been sent to `stands`; returns the angle at which it is. A stage that
    /// finds its reference by itself homes. One whose zero is where it stood at first can only take it that nothing has
    /// turned it since.
    ///
    /// # Errors
    /// [`RigError`] where the stage does not answer or the reference is not found.
    fn take_up(&mut self, stands: Angle) -> Result<Angle, RigError> {
        let _ = stands;
        self.home()
    }
    /// Goes to an absolute angle (counter-clockwise seen from above), waits until it stands, returns the angle
    /// that the stage believes it has reached.
    ///
    /// # Errors
    /// [`RigError`] where the angle is outside the limits or the stage does not get there.
    fn move_to(&mut self, target: Angle) -> Result<Angle, RigError>;
    /// One line that names the device for the session's record.
    fn describe(&self) -> String;
}

/// Photographs the grain.
pub trait Camera: Send {
    /// Takes one picture: the camera's own bytes.
    ///
    /// # Errors
    /// [`RigError`] where the camera does not deliver a whole picture.
    fn capture(&mut self) -> Result<Frame, RigError>;
    /// Shows what is before it, to focus by: as quickly as it can, as small as it likes. Leaves nothing behind, and the next
    /// picture may come at once.
    ///
    /// # Errors
    /// [`RigError`] where the camera does not deliver a whole picture, or can't show one without taking it.
    fn preview(&mut self) -> Result<Frame, RigError> {
        self.capture()
    }
    /// The picture that was delivered last is durable: the camera need not keep it any longer.
    fn kept(&mut self) {}
    /// One line that names the device for the session's record.
    fn describe(&self) -> String;
}

/// Closes the contacts of a camera's remote release.
pub trait Shutter: Send {
    /// Releases the shutter once; returns when it has been released, not when the picture is taken.
    ///
    /// # Errors
    /// [`RigError`] where nobody knows whether it was released.
    fn release(&mut self) -> Result<(), RigError>;
}

/// One photograph as the camera delivered it: never re-encoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The file's bytes.
    pub bytes: Vec<u8>,
    /// What kind of file they are.
    pub encoding: Encoding,
    /// Further files of the same exposure, such as a RAW file: archived, not decoded.
    pub others: Vec<OtherFile>,
}

impl Frame {
    /// A photograph of one file.
    pub const fn new(bytes: Vec<u8>, encoding: Encoding) -> Self {
        Self { bytes, encoding, others: Vec::new() }
    }
}

/// A file that a camera made beside the picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OtherFile {
    /// The ending of the camera's own name for it, in small letters: `cr2`.
    pub extension: String,
    /// The file's bytes.
    pub bytes: Vec<u8>,
}

/// Why a device did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// A target outside the stage's limits: refused before anything moves.
    #[error("the stage was asked for {asked}, its limits are {low} to {high}; change the plan or limits_deg")]
    OutOfLimits {
        /// The angle asked for.
        asked: Angle,
        /// The least angle allowed.
        low: Angle,
        /// The greatest angle allowed.
        high: Angle,
    },
    /// The device failed, and nothing is known that would help; the text says how, with value and limit.
    #[error("{0}")]
    Device(String),
    /// The device failed, or cannot be used as it is set.
    #[error("{cause}; {remedy}")]
    Fault {
        /// What failed, with value and limit. It may quote other programs, so nobody looks for the remedy in it.
        cause: String,
        /// What to do.
        remedy: String,
    },
    /// The device does nothing until somebody has done something about it, or until it is tried again.
    #[error("{cause}; {remedy} (the next try is due in {} s)", retry.as_secs())]
    Suspended {
        /// What failed, how often, with value and limit.
        cause: String,
        /// What to do.
        remedy: String,
        /// After how long it is tried again where nobody does anything.
        retry: Duration,
    },
    /// A recording has no more pictures or angles.
    #[error("the recording ends after {0} views; the plan asks for more")]
    RecordingEnds(usize),
}

impl RigError {
    /// A failure and what to do about it.
    pub fn fault(cause: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Fault { cause: cause.into(), remedy: remedy.into() }
    }

    /// What failed, with value and limit; and what to do, where that is known.
    pub fn cause_and_remedy(&self) -> (String, Option<String>) {
        let told = |cause: String, remedy: &str| (cause, Some(remedy.to_owned()));
        match self {
            Self::OutOfLimits { asked, low, high } => told(
                format!("the stage was asked for {asked}, its limits are {low} to {high}"),
                "change the plan or limits_deg",
            ),
            Self::Device(text) => (text.clone(), None),
            Self::Fault { cause, remedy } | Self::Suspended { cause, remedy, .. } => {
                told(cause.clone(), remedy)
            }
            Self::RecordingEnds(views) => {
                told(format!("the recording ends after {views} views"), "the plan asks for more")
            }
        }
    }
}

/// What a stage without a reference switch can't know when a run is taken up.
fn warn_taken_up(deg: f64) {
    tracing::warn!(
        "without a reference switch the stage is taken to stand at {deg:.2}°, where the interrupted run sent it last: if it has \
         been turned since, or its power failed while it turned, begin a new capture"
    );
}

//! The stage that grainrig's own firmware turns (`firmware/`), and the camera's release on the same board.

mod frame;
mod link;
mod machine;
mod settings;
mod stage;

pub use frame::{FRAME_MOST, Reader, Said, crc16, request};
pub use settings::{Reference, Settings};
pub use stage::{ControllerShutter, ControllerStage};

use super::RigError;

/// Opens the stage. Nothing moves.
///
/// # Errors
/// [`RigError::Device`] where the port can't be opened, no controller answers, or its firmware speaks another protocol.
pub fn open(settings: &Settings) -> Result<ControllerStage, RigError> {
    ControllerStage::open(settings.clone())
}

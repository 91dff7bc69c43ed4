//! The simulated rig: a stage with a real motor's errors, a camera with a real lens's, and the truth.
//!
//! ```text
//!  SimulatedStage ──true angle──▶ Shared ◀──exposures── SimulatedCamera ──▶ JPEG
//!                                   ▲                         │
//!                              TruthHandle ────────────────▶ Scene (grain, pedestal, lamp, lens)
//! ```
//!
//! The frame is the house's: the grain turns counter-clockwise seen from above, the camera looks along +y.

mod camera;
mod driver;
mod exif;
mod faults;
mod grain;
mod jpeg;
mod optics;
mod random;
mod raster;
mod scene;
mod settings;
mod stage;
mod truth;

pub use camera::SimulatedCamera;
pub use faults::{Faults, Missed, Outage, Slip, Slow};
pub use optics::Optics;
pub use raster::Window;
pub use settings::Settings;
pub use stage::SimulatedStage;
pub use truth::{Coverage, Exposure, Truth, TruthHandle};

use crate::rig::{Before, RigError};
use grainrig_core::geometry::Angle;
use std::sync::{Arc, Mutex};

/// What stage, camera and truth have in common.
#[derive(Debug, Clone, Default, PartialEq)]
struct Shared {
    /// Where the stage truly stands.
    stage_angle: Angle,
    /// The rig's computed time, seconds.
    time_s: f64,
    /// The truth of every exposure.
    exposures: Vec<Exposure>,
}

/// Sets up a simulated rig.
///
/// # Errors
/// [`RigError::Device`] where a setting is outside its limits, the grain's STL cannot be read or is open, or
/// the grain does not fit the picture.
pub fn open(settings: &Settings) -> Result<(SimulatedStage, SimulatedCamera, TruthHandle), RigError> {
    take_up(settings, Before::default())
}

/// The same rig as it is after what it has done before: its faults, noise and wobble go on from there.
///
/// # Errors
/// As [`open`].
pub fn take_up(
    settings: &Settings,
    before: Before,
) -> Result<(SimulatedStage, SimulatedCamera, TruthHandle), RigError> {
    let scene = Arc::new(scene::Scene::new(settings)?);
    let shared = Arc::new(Mutex::new(Shared::default()));
    Ok((
        SimulatedStage::new(settings, shared.clone(), before.moves),
        SimulatedCamera::new(scene.clone(), shared.clone(), before.exposures),
        TruthHandle::new(scene, shared),
    ))
}

#[cfg(test)]
mod tests;

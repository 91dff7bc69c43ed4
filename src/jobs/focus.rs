//! Pictures to focus by, each with figures that say how sharp it is.

use super::JobError;
use super::devices::open_camera;
use crate::config::Config;
use crate::rig::{Frame, RigError};
use grainrig_core::formats::decode;
use grainrig_core::silhouette::{assess, find, sharpness};
use serde::Serialize;
use std::ops::ControlFlow;

/// A picture to focus by.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Focused {
    /// Its number, from 1.
    pub picture: usize,
    /// Its size, pixels.
    pub size_px: [usize; 2],
    /// How sharp it is ([`sharpness`]), per square pixel: the greater the better, without a scale of its own.
    pub sharpness: f64,
    /// That of the sharpest picture so far.
    pub best: f64,
    /// Blur of the grain's outline, pixels (standard deviation); `null` where no grain is found.
    pub blur_px: Option<f64>,
}

/// Shows what is before the camera until `told` has enough. The stage is left alone.
///
/// # Errors
/// [`JobError::Rig`] where the camera does not open or shows nothing.
pub fn focus(
    config: &Config,
    told: &mut dyn FnMut(&Focused, &Frame) -> ControlFlow<()>,
) -> Result<(), JobError> {
    let mut camera = open_camera(config)?;
    let mut best: f64 = 0.0;
    for number in 1.. {
        let frame = camera.preview()?;
        let picture = decode(&frame.bytes).map_err(|reason| {
            RigError::fault(format!("the camera's picture can't be read: {reason}"), "try another cable")
        })?;
        let sharpness = sharpness(&picture);
        best = best.max(sharpness);
        let found = find(&picture, None, &config.silhouette).ok();
        let focused = Focused {
            picture: number,
            size_px: [picture.width(), picture.height()],
            sharpness,
            best,
            blur_px: found.map(|found| assess(&picture, &found).1.blur_px),
        };
        if told(&focused, &frame).is_break() {
            break;
        }
    }
    Ok(())
}

//! The file of a measured scale: what `calibrate scale` writes and `import` and `capture` read.

use super::JobError;
use crate::session::read_named;
use grainrig_core::calibrate::{How, Measured, UncertaintyBudget};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What a file says that it is.
const KIND: &str = "grainrig scale";
/// The form of the file.
const VERSION: u32 = 1;

/// The body that was photographed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyKind {
    /// A ball.
    Ball,
    /// An upright pin.
    Pin,
}

/// A measured scale, as written to its file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaleFile {
    /// What the file is.
    pub kind: String,
    /// The form of the file.
    pub version: u32,
    /// The program and its version.
    pub software: String,
    /// Size of a pixel at the rotation axis, mm.
    pub mm_per_px: Measured,
    /// What makes up its uncertainty, each over the value.
    pub relative_sigma: UncertaintyBudget,
    /// The body that was photographed.
    pub body: BodyKind,
    /// Its diameter, mm.
    pub diameter_mm: f64,
    /// How far the diameter may be off, mm.
    pub tolerance_mm: f64,
    /// Distance from the centre of projection to the axis, mm.
    pub camera_distance_mm: Measured,
    /// How far the body's middle stood from the axis, mm; `null` where the angles were not known.
    pub eccentricity_mm: Option<f64>,
    /// Width and height of the pictures, pixels.
    pub picture_px: [u32; 2],
    /// What each picture says.
    pub pictures: Vec<PictureScale>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// What one picture says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PictureScale {
    /// Its file name.
    pub file: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// The table's angle, counter-clockwise seen from above, degrees; `null` where it is not known.
    pub angle_deg: Option<f64>,
    /// Radius, or half width, of the outline, pixels.
    pub radius_px: f64,
    /// Its standard uncertainty from the outline's scatter, pixels.
    pub sigma_px: f64,
    /// Root mean square distance of the outline from circle or lines, pixels.
    pub residual_px: f64,
    /// Standard deviation of the outline's blur, pixels.
    pub blur_px: f64,
    /// Column and row of the outline's middle, pixels.
    pub center_px: [f64; 2],
    /// A ball's longer axis over the shorter one, less 1.
    pub ellipticity: Option<f64>,
    /// Size of a pixel that this picture alone says, mm.
    pub mm_per_px: f64,
}

/// A scale for a session: what it takes over from the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenScale {
    /// Size of a pixel at the rotation axis, mm.
    pub mm_per_px: f64,
    /// Its standard uncertainty, mm.
    pub sigma: Option<f64>,
    /// The camera's distance that the scale was got with, where it was given, mm.
    pub camera_distance_mm: Option<f64>,
    /// Width and height of the pictures it holds for, where they are known, pixels.
    pub picture_px: Option<[u32; 2]>,
}

/// Longest file, bytes; this program writes a few hundred.
const FILE_LIMIT: u64 = 1 << 20;

impl ScaleFile {
    /// The marks of a file of this form.
    pub(super) fn marks() -> (String, u32) {
        (KIND.into(), VERSION)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`JobError::Calibration`] where the file cannot be read, is of another kind or form, or its numbers make no
    /// sense.
    pub fn read(path: &Path) -> Result<Self, JobError> {
        let bad = |reason: String| JobError::Calibration { path: path.into(), reason };
        let text = read_named(path, FILE_LIMIT).map_err(|e| bad(e.to_string()))?;
        let value: serde_json::Value =
            serde_json::from_slice(&text).map_err(|e| bad(format!("it is no JSON ({e})")))?;
        if value["kind"] != KIND {
            return Err(bad(format!("its \"kind\" is {}, not \"{KIND}\"", value["kind"])));
        }
        if value["version"] != VERSION {
            return Err(bad(format!(
                "its \"version\" is {}, this program reads {VERSION}",
                value["version"]
            )));
        }
        let file: Self = serde_json::from_value(value).map_err(|e| bad(e.to_string()))?;
        file.check().map_err(bad)?;
        Ok(file)
    }

    /// Which number makes no sense.
    fn check(&self) -> Result<(), String> {
        let positive = [
            ("mm_per_px", Some(self.mm_per_px.value.unwrap_or(f64::NAN))),
            ("mm_per_px.sigma", self.mm_per_px.sigma),
            ("camera_distance_mm", self.camera_distance_mm.value),
        ];
        match positive.into_iter().find(|(_, v)| v.is_some_and(|v| !(v.is_finite() && v > 0.0))) {
            Some((name, value)) => {
                Err(format!("its {name} is {}, it must be positive", value.unwrap_or(f64::NAN)))
            }
            None => Ok(()),
        }
    }

    /// What a session takes over.
    pub fn given(&self) -> GivenScale {
        let distance = self.camera_distance_mm;
        GivenScale {
            mm_per_px: self.mm_per_px.value.unwrap_or(f64::NAN),
            sigma: self.mm_per_px.sigma,
            camera_distance_mm: distance.value.filter(|_| distance.how == How::Given),
            picture_px: Some(self.picture_px),
        }
    }
}

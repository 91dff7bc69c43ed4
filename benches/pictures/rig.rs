//! What the program says of the rig beside its truth.

use super::plan::Row;
use super::render::Rendered;
use serde_json::Value;

/// A figure of the rig: what it is off by, and the standard uncertainty that was stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Off {
    /// Said less true.
    pub by: f64,
    /// As stated.
    pub sigma: f64,
}

impl Off {
    /// Whether it is no further off than that.
    pub fn is_within(self, limit: f64) -> bool {
        self.by.abs() <= limit
    }

    /// Whether the truth lies within two stated standard uncertainties.
    pub fn is_stated(self) -> bool {
        self.by.abs() <= 2.0 * self.sigma
    }
}

/// Roll and elevation, degrees, and the axis' column at the foot, pixels.
pub struct RigFigures {
    /// How far the axis leans in the picture.
    pub roll: Off,
    /// How far the rays rise.
    pub elevation: Off,
    /// Where the axis stands.
    pub column: Off,
    /// By how much outlines were moved out for a bright rim, pixels.
    pub rim_px: f64,
}

impl RigFigures {
    /// Of a result; `None` where it states no calibration.
    pub fn new(row: &Row, set: &Rendered, result: &Value) -> Option<Self> {
        let said = &result["calibration"];
        let off = |key: &str, truth: f64| {
            let value = &said[key];
            Some(Off { by: value["value"].as_f64()? - truth, sigma: value["sigma"].as_f64()? })
        };
        let below = said["origin_row_px"].as_f64()? - set.number("row0");
        let column = set.number("axis_u") + row.camera.roll_deg.to_radians().tan() * below;
        let rims =
            result["view_details"].as_array()?.iter().filter_map(|v| v["silhouette"]["rim_px"].as_f64());
        Some(Self {
            roll: off("roll_deg", row.camera.roll_deg)?,
            elevation: off("elevation_deg", row.camera.pitch_deg)?,
            column: off("axis_column_px", column)?,
            rim_px: rims.fold(0.0, f64::max),
        })
    }
}

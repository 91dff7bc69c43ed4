//! The calibration: camera and axis with standard uncertainties, each view's angle and offset, slips and lost steps.

use super::{Measured, Turntable};
use crate::geometry::{Angle, Projection};
use crate::silhouette::Verdict;
use serde::Serialize;

/// The rig as measured from the silhouettes of one session.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Size of a pixel at the axis, mm.
    pub mm_per_px: Measured,
    /// Column of the axis in row `origin_row_px`.
    pub axis_column_px: Measured,
    /// The row of z = 0: the pedestal's top, or the lowest row of the silhouettes where there is none.
    pub origin_row_px: f64,
    /// Turn of the picture about the axis' foot, degrees.
    pub roll_deg: Measured,
    /// Distance from the centre of projection to the axis, mm; no value where the views look parallel.
    pub camera_distance_mm: Measured,
    /// The outlines' evidence on the distance, in words.
    #[serde(rename = "camera_distance_says")]
    pub camera_distance_note: String,
    /// Elevation: how far the view rays rise going away from the camera, at the axis' foot, degrees.
    pub elevation_deg: Measured,
    /// Which way the grain turns, seen from above, when the stage angle grows, and how that is known.
    pub rotation: Rotation,
    /// Radial runout of the stage: standard deviation of a view's sideways shift against the others, pixels.
    #[serde(rename = "wobble_px")]
    pub radial_runout_px: f64,
    /// What the outlines' rows keep of unexplained differences, pixels (standard deviation).
    pub residual_px: f64,
    /// Whether the views' own offsets and angles are in use (`false`: only stated).
    pub refined: bool,
    /// Each view, in the order of the plan.
    pub views: Vec<ViewCalibration>,
    /// Slips, lost steps, a wrong step size.
    pub findings: Vec<Finding>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// The sense of rotation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rotation {
    /// Whether the grain turns counter-clockwise seen from above when the stage angle grows.
    pub counter_clockwise: bool,
    /// Whether the pictures showed it (perspective does; parallel views cannot distinguish it from its mirror image).
    pub how: super::How,
}

/// One view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewCalibration {
    /// Index in the plan.
    pub index: usize,
    /// The stage's angle, degrees.
    pub nominal_angle_deg: f64,
    /// The grain's angle, degrees.
    pub angle_deg: f64,
    /// Its standard uncertainty, degrees.
    pub angle_sigma_deg: f64,
    /// Sideways shift of the view against the others, pixels: positive to the right. A shift that goes round once
    /// with the grain cannot be distinguished from a grain that stands off the axis, and is not in here.
    pub offset_px: f64,
    /// Its standard uncertainty, pixels.
    pub offset_sigma_px: f64,
    /// Root mean square of what its outline keeps of unexplained differences, pixels.
    pub residual_px: f64,
    /// Whether the view can be relied on.
    pub verdict: Verdict,
    /// What a person should know of it.
    pub warnings: Vec<String>,
}

/// What happened to the angles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// What it is.
    pub kind: FindingKind,
    /// The first view that sees the grain turned, for a slip or lost steps.
    pub view: Option<usize>,
    /// The views among which that first one lies as surely as the outlines show.
    pub between: Option<[usize; 2]>,
    /// How far the grain is ahead (positive) or behind from there on, degrees; for a wrong step size, at the last view.
    pub degrees: f64,
    /// Its standard uncertainty, degrees.
    pub sigma_deg: f64,
    /// For a wrong step size: true step over nominal step.
    pub step_ratio: Option<f64>,
    /// The same in a sentence.
    pub text: String,
}

/// Kinds of [`Finding`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The grain turned against the stage.
    Slip,
    /// As far as whole full steps of the motor.
    LostSteps,
    /// Every step is larger or smaller than it should be.
    StepSize,
    /// One of the two: the outlines do not show which.
    SlipOrStepSize,
}

/// What a view that looks from elsewhere costs of the volume, computed on irregular grains: 0.3 % for 0.5° in every
/// view's angle; for shifts of a view, and of the axis, these times the shift over the grain's diameter.
const PER_DEGREE: f64 = 0.006;
const PER_SHIFT: f64 = 1.7;
const PER_AXIS: f64 = 0.6;

impl Calibration {
    /// Standard uncertainty of the scale as a share of it; `None` where nobody knows it.
    pub fn scale_share(&self) -> Option<f64> {
        Some(self.mm_per_px.sigma? / self.mm_per_px.value?)
    }

    /// Standard uncertainty of a hull's volume from axis, angles and the views' shifts, as a share of the volume (mm³).
    pub fn volume_share(&self, volume_mm3: f64) -> f64 {
        let diameter_px =
            (6.0 / std::f64::consts::PI * volume_mm3).cbrt() / self.mm_per_px.value.unwrap_or(1.0);
        let mean_square = |of: &dyn Fn(&ViewCalibration) -> f64| {
            self.views.iter().map(|v| of(v).powi(2)).sum::<f64>() / self.views.len().max(1) as f64
        };
        let angles = PER_DEGREE * mean_square(&|v| v.angle_sigma_deg).sqrt();
        let shifts = PER_SHIFT * mean_square(&|v| v.offset_sigma_px).sqrt() / diameter_px;
        let axis = PER_AXIS * self.axis_column_px.sigma.unwrap_or(0.0) / diameter_px;
        angles.hypot(shifts).hypot(axis)
    }

    /// The camera of each view, in the order of [`Calibration::views`].
    pub fn cameras(&self) -> Vec<Projection> {
        let sense = if self.rotation.counter_clockwise { 1.0 } else { -1.0 };
        let camera = Turntable {
            mm_per_px: self.mm_per_px.value.unwrap_or(1.0),
            axis_column_px: self.axis_column_px.value.unwrap_or(0.0),
            origin_row_px: self.origin_row_px,
            elevation_rad: self.elevation_deg.value.unwrap_or(0.0).to_radians(),
            roll_rad: self.roll_deg.value.unwrap_or(0.0).to_radians(),
            camera_distance_mm: self.camera_distance_mm.value,
        };
        (self.views.iter())
            .map(|v| {
                let (angle, offset) =
                    if self.refined { (v.angle_deg, v.offset_px) } else { (v.nominal_angle_deg, 0.0) };
                camera.view(Angle::from_deg(sense * angle), offset)
            })
            .collect()
    }
}

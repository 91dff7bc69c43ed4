//! Each view's camera: given, or measured from the silhouettes.

use super::reconstruct::SegmentedView;
use super::result::AxisResult;
use super::{Cameras, PipelineError, TurntableSettings};
use grainrig_core::calibrate::{self, Calibration, Known, PedestalObservation, SeenView, calibrate};
use grainrig_core::geometry::Projection;
use grainrig_core::silhouette::{PedestalConsensus, Silhouette, Verdict};

/// The cameras, and what was measured to get them.
pub(super) struct Measured {
    /// A camera for each view, in their order.
    pub projections: Vec<Projection>,
    /// The rotation axis, before a turntable.
    pub axis: Option<AxisResult>,
    /// All else, before a turntable.
    pub calibration: Option<Calibration>,
}

/// Each view's camera.
pub(super) fn cameras_of(
    cameras: &Cameras,
    full_step_deg: f64,
    segmented: &[SegmentedView],
    consensus: Option<&PedestalConsensus>,
    warnings: &mut Vec<String>,
) -> Result<Measured, PipelineError> {
    let table = match cameras {
        Cameras::Given { projections, .. } => {
            let pick = |t: &SegmentedView| {
                let missing = PipelineError::NoCamera { view: t.index, cameras: projections.len() };
                projections.get(t.index).cloned().ok_or(missing)
            };
            let projections = segmented.iter().map(pick).collect::<Result<_, _>>()?;
            return Ok(Measured { projections, axis: None, calibration: None });
        }
        Cameras::Turntable(table) => table,
    };
    if segmented.is_empty() {
        return Err(grainrig_core::hull::HullError::NoViews.into());
    }
    let origin_row_px = consensus.map_or_else(
        || {
            warnings.push("no pedestal was found: z = 0 is the lowest row of the silhouettes".into());
            segmented.iter().map(|t| lowest_row(&t.silhouette)).fold(0.0, f64::max)
        },
        |s| s.top_row_px.value,
    );
    let views: Vec<SeenView> = (segmented.iter().enumerate())
        .map(|(k, t)| SeenView {
            index: t.index,
            angle: t.angle,
            silhouette: &t.silhouette,
            bad: t.quality.as_ref().is_some_and(|q| q.verdict == Verdict::Bad),
            // Its lean as this view saw it: a tilted tube leans now to one side, now to the other.
            pedestal: consensus.and_then(|s| s.own.get(k).copied().flatten()).map(|p| PedestalObservation {
                top_px: [p.centre_column, p.top_row],
                lean_rad: -p.top_slope.atan(),
                length_px: p.side_px(t.silhouette.picture[1]),
            }),
        })
        .collect();
    let (mut calibration, axis) = calibrate(&views, &known(table, full_step_deg, origin_row_px))?;
    for (view, t) in calibration.views.iter_mut().zip(segmented) {
        if let Some(quality) = &t.quality {
            view.verdict = view.verdict.max(quality.verdict);
            view.warnings.extend(quality.warnings());
        }
    }
    warnings.extend(calibration.warnings.iter().cloned());
    let axis = AxisResult {
        axis_column_px: calibration.axis_column_px.value.unwrap_or(axis.column_px),
        roll_deg: calibration.roll_deg.value.unwrap_or(0.0),
        origin_row_px,
        residual_px: axis.residual_px,
        method: axis.method,
    };
    Ok(Measured { projections: calibration.cameras(), axis: Some(axis), calibration: Some(calibration) })
}

fn known(table: &TurntableSettings, full_step_deg: f64, origin_row_px: f64) -> Known {
    Known {
        mm_per_px: calibrate::Measured::given(table.mm_per_px, table.mm_per_px_sigma),
        origin_row_px,
        camera_distance_mm: table.camera_distance_mm,
        axis_column_px: table.axis_column_px,
        roll_deg: table.roll_deg,
        clockwise: table.clockwise,
        full_step_deg,
        refine: table.refine,
    }
}

/// The lowest row (greatest index) that the outline reaches.
fn lowest_row(s: &Silhouette) -> f64 {
    let extents = s.extents_px();
    let last = extents.iter().rposition(Option::is_some).unwrap_or(0);
    (s.origin[1] + last) as f64 + 0.5
}

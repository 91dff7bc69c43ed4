//! One pose of a grain: cut out and calibrated as for a hull of its own, and carved for its volume.

use super::cameras::cameras_of;
use super::pedestal::mixed_px;
use super::quality::compare;
use super::reconstruct::{ALONE_POINTS, MOST_DEFAULT_CELLS, SegmentedView};
use super::result::ViewResult;
use super::{Cameras, LengthUnit, Observer, Pipeline, PipelineError, View};
use crate::session::event::Role;
use grainrig_core::geometry::Projection;
use grainrig_core::hull::{Cone, HullGrid, Measures, carved_alone, find_bounds};
use grainrig_core::register::{Cut, Pose, PoseView};
use std::sync::Arc;
use std::sync::mpsc::Receiver;

/// A pose with what its own hull measures.
#[derive(Debug, Clone)]
pub struct SeenPose {
    /// The views' cameras and outlines.
    pub pose: Pose,
    /// Measures of its own hull.
    pub measures: Measures,
    /// Edge of a voxel of that hull's grid, mm.
    pub voxel_mm: f64,
    /// Size of a pixel at the axis, mm; `None` with given cameras.
    pub scale_mm_per_px: Option<f64>,
    /// Whether a pedestal was found, so that its views stop above its top.
    pub has_pedestal: bool,
    /// The views, in the pose's order; how well the merged hull fills them is filled in by it.
    pub(super) views: Vec<ViewResult>,
    /// Findings about the rig.
    pub(super) findings: Vec<String>,
    /// What a person should know, the findings among it.
    pub warnings: Vec<String>,
}

impl Pipeline {
    /// Takes views until the sender is gone, then measures the cameras and carves the pose's own hull. `name` is what
    /// messages call it.
    ///
    /// # Errors
    /// [`PipelineError`], at the first view that can't be used, and where lengths have no unit.
    pub fn pose(
        &self,
        name: &str,
        views: Receiver<View>,
        observer: &Observer,
    ) -> Result<SeenPose, PipelineError> {
        self.settings.check()?;
        match &self.cameras {
            Cameras::Turntable(t) => t.check()?,
            Cameras::Given { unit: LengthUnit::None, .. } => {
                return Err(PipelineError::NoUnit { session: name.into() });
            }
            Cameras::Given { .. } => {}
        }
        let (mut segmented, consensus, mut warnings) = self.cut(views, observer)?;
        warnings.extend(compare(&self.cameras, &mut segmented, observer));
        let measured =
            cameras_of(&self.cameras, self.full_step_deg, &segmented, consensus.as_ref(), &mut warnings)?;
        let cut = consensus.as_ref().map(|s| Cut {
            column_px: s.centre_column_px.value,
            row_px: s.top_row_px.value - mixed_px(s),
            slope: s.top_slope.value,
            mixed_px: mixed_px(s),
        });
        let seen: Vec<(&SegmentedView, Projection)> =
            (segmented.iter().zip(measured.projections)).filter(|(t, _)| t.role == Role::Grain).collect();
        let closed: Vec<Cone> =
            seen.iter().map(|(t, p)| Cone::new(p.clone(), Arc::clone(&t.silhouette))).collect();
        let bounds = find_bounds(&closed)?;
        let scale_mm_per_px = match &self.cameras {
            Cameras::Turntable(t) => Some(t.mm_per_px),
            Cameras::Given { .. } => None,
        };
        let by_default = scale_mm_per_px.unwrap_or(0.0).max(bounds.size().max() / MOST_DEFAULT_CELLS);
        let voxel_mm = self.settings.hull.voxel_mm.unwrap_or(by_default);
        let mut grid = HullGrid::new(&bounds, voxel_mm)?;
        closed.iter().for_each(|c| grid.carve(c));
        let alone = carved_alone(&closed, &bounds, ALONE_POINTS);
        let views = (seen.iter().zip(alone))
            .map(|((t, _), carved_alone)| ViewResult {
                index: t.index,
                angle_deg: t.angle.deg(),
                iou: 0.0,
                carved_alone,
                silhouette: t.found.report.clone(),
                quality: t.quality.clone(),
            })
            .collect();
        let pose = (seen.into_iter())
            .map(|(t, projection)| PoseView { projection, silhouette: Arc::clone(&t.silhouette), cut })
            .collect();
        let named = |text: String| format!("{name}: {text}");
        let findings = measured.calibration.map_or_else(Vec::new, |c| c.warnings);
        Ok(SeenPose {
            pose: Pose::new(pose)?,
            measures: grid.measures(),
            voxel_mm,
            scale_mm_per_px,
            has_pedestal: consensus.is_some(),
            views,
            findings: findings.into_iter().map(named).collect(),
            warnings: warnings.into_iter().map(named).collect(),
        })
    }
}

//! All views are cut at the pedestal that they show together.

use super::{Cameras, PipelineError, SegmentedView, ViewFault};
use crate::session::event::Role;
use grainrig_core::geometry::TriangleMesh;
use grainrig_core::silhouette::{PedestalConsensus, PedestalOutline, Side, pedestal_consensus};
use serde::Serialize;

/// Above the pedestal's top its blurred light mixes with the grain's up to this many standard deviations of the blur.
const MIXED: f64 = 2.5;
/// The least height of the part in which they mix, pixels: a pixel's own width blurs too.
const LEAST_MIXED_PX: f64 = 2.0;

/// Where the grain stands on the pedestal: the lowest part of the hull, in which no view sees the outline unmixed. What
/// of the grain sits below the top no view sees at all; it is in neither the hull nor these figures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContactPatch {
    /// Area of the hull's cross-section at the upper end of that part, mm².
    pub area_mm2: f64,
    /// Its height above the pedestal's top: 2.5 standard deviations of the lens's blur, two pixels at
    /// least, mm.
    pub height_mm: f64,
    /// Its volume over the hull's: `∮ min(z, height) n_z dA` over `∮ z n_z dA`.
    pub volume_share: f64,
}

/// How high above the pedestal's top the outline is mixed with its light, pixels.
pub(super) fn mixed_px(consensus: &PedestalConsensus) -> f64 {
    (MIXED * consensus.blur_px.value).max(LEAST_MIXED_PX)
}

/// The contact patch of a hull's surface, in mm.
pub(super) fn contact_patch(
    consensus: &PedestalConsensus,
    mm_per_px: f64,
    surface: &TriangleMesh,
) -> ContactPatch {
    let height_mm = mixed_px(consensus) * mm_per_px;
    let (mut area_mm2, mut low, mut all) = (0.0, 0.0, 0.0);
    for [a, b, c] in (0..surface.triangles.len()).map(|t| surface.corners(t)) {
        let upwards = 0.5 * (b - a).cross(&(c - a)).z;
        let z = (a.z + b.z + c.z) / 3.0;
        area_mm2 += if z > height_mm { upwards } else { 0.0 };
        // Less the height, whose flux out of a closed surface is nothing: above it nothing adds up, not even what is rounded.
        low += (z - height_mm).min(0.0) * upwards;
        all += z * upwards;
    }
    // The hull may begin a little below the top: what is there counts as low.
    ContactPatch { area_mm2, height_mm, volume_share: low / all }
}

/// Finds the pedestal from all views and cuts each at its top. Views with cameras of their own stay as they are, and
/// so do all where too few show a pedestal. The pedestal, and what a person should know.
///
/// # Errors
/// [`ViewFault::CutByBorder`] where a grain still reaches the picture's lower border.
pub(super) fn recut(
    cameras: &Cameras,
    segmented: &mut [SegmentedView],
) -> Result<(Option<PedestalConsensus>, Vec<String>), PipelineError> {
    if !matches!(cameras, Cameras::Turntable(_)) {
        return Ok((None, Vec::new()));
    }
    let seen: Vec<Option<PedestalOutline>> = segmented.iter().map(|t| t.found.report.pedestal).collect();
    let consensus = pedestal_consensus(&seen);
    let mut warnings = Vec::new();
    if let Some(consensus) = &consensus {
        for one in segmented.iter_mut() {
            let joint = consensus.seen_by(one.found.report.pedestal);
            if one.found.recut(joint) {
                one.take_outline();
            }
        }
        warnings.extend(consensus.disagree.iter().map(|&k| {
            format!(
                "view {} shows another pedestal than the other views do: it is cut at their pedestal's top (row {:.1})",
                segmented[k].index, consensus.top_row_px.value
            )
        }));
    }
    let cut = segmented.iter().find(|t| t.role == Role::Grain && t.found.report.touches_border[3]);
    match cut {
        Some(t) => Err(ViewFault::CutByBorder { side: Side::Bottom.name() }.of(t.index)),
        None => Ok((consensus, warnings)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use grainrig_core::geometry::Point;
    use grainrig_core::silhouette::ConsensusValue;

    #[test]
    fn a_box_has_its_foot_in_its_contact_patch() {
        let figure = |value| ConsensusValue { value, sd: 0.0 };
        let consensus = PedestalConsensus {
            top_row_px: figure(100.0),
            top_slope: figure(0.0),
            centre_column_px: figure(50.0),
            half_width_px: figure(20.0),
            blur_px: figure(1.0),
            views: 3,
            disagree: Vec::new(),
            unseen: Vec::new(),
            slope_seen: true,
            own: Vec::new(),
        };
        // Two by three, four high; only what faces up or down counts.
        let face =
            |z: f64| [[0.0, 0.0], [2.0, 0.0], [2.0, 3.0], [0.0, 3.0]].map(|[x, y]| Point::new(x, y, z));
        let surface = TriangleMesh {
            vertices: [face(0.0), face(4.0)].concat(),
            triangles: vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]],
        };
        let patch = contact_patch(&consensus, 0.16, &surface);
        assert!((patch.height_mm - 0.4).abs() < 1e-12 && (patch.area_mm2 - 6.0).abs() < 1e-12, "{patch:?}");
        assert!((patch.volume_share - 0.1).abs() < 1e-12, "{patch:?}");
        // A hull that begins above has nothing in it.
        let raised = |mut s: TriangleMesh| {
            s.vertices.iter_mut().for_each(|p| p.z += 0.7);
            s
        };
        assert_eq!(
            contact_patch(&consensus, 0.16, &raised(surface)).volume_share.to_bits(),
            0.0_f64.to_bits()
        );
    }
}

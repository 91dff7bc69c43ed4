//! What `result.json` says: every figure with its unit in its name.

use super::convergence::Convergence;
use super::merge::MergeResult;
use super::pedestal::ContactPatch;
use super::verdict::ResultVerdict;
use grainrig_core::calibrate::{AxisMethod, Calibration};
use grainrig_core::geometry::Aabb;
use grainrig_core::hull::estimate::{Share, Signs, VolumeEstimate};
use grainrig_core::hull::{CarvedAlone, Measures, VoxelCount};
use grainrig_core::mesh::{Controls, Dihedral, TetMesh};
use grainrig_core::silhouette::{PedestalConsensus, Report, ViewQuality};
use serde::Serialize;
use std::collections::BTreeMap;

/// The version of the form of [`ResultFile`]; raised where a key changes its name, unit or meaning.
pub const SCHEMA: u32 = 1;

/// What a result states beside its figures.
#[derive(Debug, Clone)]
pub struct ResultHead {
    /// The program and its version.
    pub software: String,
    /// Name of the session.
    pub session: String,
    /// The files, by kind.
    pub products: BTreeMap<String, String>,
    /// Seconds each stage took.
    pub timing_s: serde_json::Value,
}

/// The result of a session, as written to `result.json` and printed by `--json`.
#[derive(Debug, Clone, Serialize)]
pub struct ResultFile {
    /// The version of this form: `SCHEMA`.
    pub schema: u32,
    /// The program and its version.
    pub software: String,
    /// Name of the session.
    pub session: String,
    /// Whether hull and volume can be relied on.
    pub verdict: ResultVerdict,
    /// Views that carved the hull.
    pub views: usize,
    /// Size of a pixel at the axis, mm; `null` where each view has a camera of its own.
    pub scale_mm_per_px: Option<f64>,
    /// The rotation axis; `null` where each view has a camera of its own.
    pub axis: Option<AxisResult>,
    /// The pedestal, from all views together; `null` where too few show one.
    pub pedestal: Option<PedestalConsensus>,
    /// All that the views say of the rig, with uncertainties; `null` where each view has a camera of its own.
    pub calibration: Option<Calibration>,
    /// The visual hull.
    pub hull: HullResult,
    /// The mesh.
    pub mesh: MeshResult,
    /// The files, by kind.
    pub products: BTreeMap<String, String>,
    /// Seconds each stage took. In a file: on the run that first made the products, so that a replay gives the
    /// same bytes.
    pub timing_s: serde_json::Value,
    /// What a person should know.
    pub warnings: Vec<String>,
    /// Each view's silhouette; of a merged grain the first pose's views, then the second's, each with the index that it
    /// has in its own session.
    pub view_details: Vec<ViewResult>,
    /// The figures of the merging, where the grain was merged from two captures. There is no axis, pedestal or
    /// calibration then: those are each session's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub merge: Option<MergeResult>,
}

/// The rotation axis in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AxisResult {
    /// Column of the axis in row `origin_row_px`.
    pub axis_column_px: f64,
    /// Turn of the picture, degrees.
    pub roll_deg: f64,
    /// The row of z = 0: the pedestal's top, or the lowest row of the silhouettes where there is none.
    pub origin_row_px: f64,
    /// Root mean square of what the outlines disagree by, pixels.
    pub residual_px: f64,
    /// How it was found.
    pub method: AxisMethod,
}

/// One view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewResult {
    /// Index in the plan.
    pub index: usize,
    /// The stage's angle, degrees.
    pub angle_deg: f64,
    /// Intersection over union of the silhouette and the hull seen again by this view.
    pub iou: f64,
    /// What of the hull this view alone carves away.
    pub carved_alone: CarvedAlone,
    /// How the silhouette was found.
    pub silhouette: Report,
    /// How good the view is, by itself and against the others; `null` where it was not judged.
    pub quality: Option<ViewQuality>,
}

/// The visual hull, an upper bound of the grain, and what it says of the grain's volume.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HullResult {
    /// Volume, mm³; `null` where the cameras have no unit.
    pub volume_mm3: Option<f64>,
    /// The grain's own volume above the pedestal, mm³, as likely too large as too small: the hull's without what it
    /// fills of the hollows; `null` where the cameras have no unit, and for two poses together, whose hulls no one has
    /// held against true volumes yet.
    pub volume_estimate_mm3: Option<f64>,
    /// Where the grain's own volume lies with 95 %, mm³; `null` where the estimate is.
    pub volume_interval_mm3: Option<[f64; 2]>,
    /// Why there is neither an estimate nor an interval, in words; `null` where there are both.
    pub volume_unknown: Option<String>,
    /// What that interval is made of: each part, and what it alone takes and adds, in words. Parts add up as squares.
    pub volume_says: Vec<String>,
    /// The signs of hollows that the estimate rests on; `null` where the cameras show no level slices all around.
    pub volume_signs: Option<Signs>,
    /// How the volume was got.
    pub method: HullMethod,
    /// Volume by counting voxels, as the paper does, mm³.
    pub voxel_volume_mm3: Option<f64>,
    /// Edge of a voxel, mm.
    pub voxel_mm: Option<f64>,
    /// Surface area, mm².
    pub surface_area_mm2: Option<f64>,
    /// The tight box, mm.
    pub bounding_box_mm: Option<Aabb>,
    /// Where the grain stands on the pedestal; `null` without a pedestal before a turntable.
    pub contact_patch: Option<ContactPatch>,
    /// How well the hull, seen again, fills the silhouettes.
    pub silhouette_iou: Agreement,
    /// Volumes of the hulls of fewer views, each time spread evenly over the session, and of all: what a further
    /// view would still take away. Measured on a coarse grid and normalised by the full hull. Empty where the cameras
    /// have no unit.
    pub convergence: Vec<Convergence>,
}

/// How the hull's volume was got.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum HullMethod {
    /// Slice by slice, without a grid: parallel rays square to the axis.
    #[serde(rename = "exact slices")]
    ExactSlices,
    /// From the surface on the grid: any other cameras.
    #[serde(rename = "grid")]
    Grid,
}

/// Intersection over union, over the views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Agreement {
    /// The mean.
    pub mean: f64,
    /// The worst view's.
    pub min: f64,
}

impl HullResult {
    #[allow(clippy::too_many_arguments, reason = "each is another room's figure")]
    pub(super) fn new(
        m: &Measures,
        (method, volume_mm3): (HullMethod, f64),
        estimate: Result<&VolumeEstimate, String>,
        v: &VoxelCount,
        ious: &[f64],
        contact_patch: Option<ContactPatch>,
        convergence: Vec<Convergence>,
        metric: bool,
    ) -> Self {
        let stated = |x: f64| metric.then_some(x);
        let unknown = match &estimate {
            Err(why) => Some(why.clone()),
            Ok(_) => (!metric).then(|| "the cameras have no unit of length".to_owned()),
        };
        let estimate = estimate.ok();
        Self {
            volume_mm3: stated(volume_mm3),
            volume_estimate_mm3: estimate.and_then(|e| stated(e.volume_mm3)),
            volume_interval_mm3: estimate.filter(|_| metric).map(|e| e.interval_mm3),
            volume_unknown: unknown,
            volume_says: estimate.map_or_else(Vec::new, |e| e.shares.iter().map(share_line).collect()),
            volume_signs: estimate.and_then(|e| e.signs),
            method,
            voxel_volume_mm3: stated(v.volume_mm3),
            voxel_mm: stated(v.voxel_mm),
            surface_area_mm2: stated(m.surface_area_mm2),
            bounding_box_mm: m.bounding_box_mm.filter(|_| metric),
            contact_patch,
            silhouette_iou: Agreement {
                mean: ious.iter().sum::<f64>() / ious.len().max(1) as f64,
                min: ious.iter().copied().fold(1.0, f64::min),
            },
            convergence: if metric { convergence } else { Vec::new() },
        }
    }
}

/// A part of the interval in words.
fn share_line(share: &Share) -> String {
    let [below, above] = share.percent;
    if below == 0.0 && above == 0.0 {
        return share.what.clone();
    }
    // A minus sign, as a person writes it.
    format!("{}: −{:.1} % to +{above:.1} %", share.what, below.abs())
}

/// The mesh, its size and quality.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeshResult {
    /// Nodes.
    pub nodes: usize,
    /// Facets of the surface.
    pub triangles: usize,
    /// Tetrahedra.
    pub tetrahedra: usize,
    /// Volume, mm³; `null` where the cameras have no unit.
    pub volume_mm3: Option<f64>,
    /// Angles between faces of tetrahedra, degrees.
    pub dihedral_deg: Dihedral,
    /// Angles of surface facets, degrees.
    pub facet_angle_deg: Least,
    /// Circumradius over shortest edge of tetrahedra.
    pub radius_edge: Most,
    /// Smallest over median altitude of tetrahedra: what the explicit time step costs.
    pub altitude_min_over_median: f64,
    /// Smallest altitude of a tetrahedron, mm.
    pub altitude_min_mm: Option<f64>,
    /// The longest stable step of an explicit simulation of quartz (100 `GPa`, 0.22, 2.65 g/cm³), s.
    pub time_step_quartz_s: Option<f64>,
    /// The promises that the mesh keeps, in mm, degrees and mm³.
    pub controls: Option<Controls>,
}

/// Quartz: Young's modulus, Poisson's ratio and density.
const YOUNG_MPA: f64 = 1e5;
const POISSON: f64 = 0.22;
const DENSITY_T_MM3: f64 = 2.65e-9;

/// A figure's smallest value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Least {
    /// The smallest.
    pub min: f64,
}

/// A figure's largest value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Most {
    /// The largest.
    pub max: f64,
}

impl MeshResult {
    /// The figures of a mesh that was made under these controls; lengths only where they are `metric`.
    pub fn new(mesh: &TetMesh, controls: &Controls, metric: bool) -> Self {
        let q = mesh.quality();
        Self {
            nodes: mesh.nodes.len(),
            triangles: mesh.surface().triangles.triangles.len(),
            tetrahedra: mesh.tets.len(),
            volume_mm3: metric.then(|| mesh.volume_mm3()),
            dihedral_deg: q.dihedral_deg,
            facet_angle_deg: Least { min: q.facet_angle_deg },
            radius_edge: Most { max: q.radius_edge },
            altitude_min_over_median: q.altitude_min_mm / q.altitude_median_mm,
            altitude_min_mm: metric.then_some(q.altitude_min_mm),
            time_step_quartz_s: metric.then(|| q.time_step_s(YOUNG_MPA, POISSON, DENSITY_T_MM3)),
            controls: metric.then_some(*controls),
        }
    }
}

/// Seconds each stage took: work done, not waiting for the rig.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Timing {
    /// Decoding and cutting out, summed over the views (they run side by side).
    pub silhouette: f64,
    /// Finding the axis.
    pub calibrate: f64,
    /// Carving and measuring the hull.
    pub hull: f64,
    /// Meshing.
    pub mesh: f64,
    /// Drawing the outlines.
    pub report: f64,
    /// All of these.
    pub total: f64,
}

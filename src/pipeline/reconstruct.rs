//! All views are in: axis, cameras, hull, mesh.

use super::cameras::{Measured, cameras_of};
use super::convergence::convergence;
use super::pedestal::contact_patch;
use super::result::{
    AxisResult, HullMethod, HullResult, MeshResult, ResultFile, ResultHead, Timing, ViewResult,
};
use super::verdict::{ResultVerdict, outline_px, verdict};
use super::{Cameras, LengthUnit, Observer, PipelineError, Product, Settings, TurntableSettings, pictures};
use crate::session::event::{EventKind, Role};
use grainrig_core::calibrate::{Calibration, Turntable};
use grainrig_core::geometry::Angle;
use grainrig_core::hull::estimate::{Known, estimate};
use grainrig_core::hull::slices::{SliceError, SlicedHull};
use grainrig_core::hull::{Cone, HullGrid, VisualHull, carved_alone, find_bounds, silhouette_ious};
use grainrig_core::mesh::{Controls, TetMesh, mesh};
use grainrig_core::plausible::{self, Doubt};
use grainrig_core::report::{Sheet, Shot};
use grainrig_core::silhouette::{PedestalConsensus, Segmentation, Silhouette, Traits, ViewQuality};
use std::sync::Arc;
use std::time::Instant;

/// The finest default grid: cells along the hull's longest edge.
pub(super) const MOST_DEFAULT_CELLS: f64 = 400.0;

/// Points along the hull's longest edge at which is looked what single views carve away.
pub(super) const ALONE_POINTS: usize = 96;

/// Silhouettes of one rigid body that is seen by the right cameras agree better than this.
const LEAST_AGREEMENT: f64 = 0.95;

/// A view that has been cut out.
#[derive(Debug, Clone)]
pub struct SegmentedView {
    /// Index in the plan.
    pub index: usize,
    /// What it is for.
    pub role: Role,
    /// The stage's angle.
    pub angle: Angle,
    /// Its picture file, to cut it out again.
    pub bytes: Vec<u8>,
    /// The outline, shared with the hull.
    pub silhouette: Arc<Silhouette>,
    /// How it was found.
    pub found: Segmentation,
    /// The grain's surroundings, where pictures were asked for.
    pub shot: Option<Shot>,
    /// How good it is; absent where nobody wants to know.
    pub quality: Option<ViewQuality>,
    /// Its figures, to be compared with other views'.
    pub traits: Option<Traits>,
    /// What decoding and cutting out took, seconds.
    pub seconds: f64,
}

/// What the computation made.
#[derive(Debug, Clone)]
pub struct Reconstruction {
    /// Views that carved the hull.
    pub views: Vec<ViewResult>,
    /// Size of a pixel at the axis, mm; `None` with given cameras.
    pub scale_mm_per_px: Option<f64>,
    /// The rotation axis, before a turntable.
    pub axis: Option<AxisResult>,
    /// The pedestal that all views share, where there is one before a turntable.
    pub consensus: Option<PedestalConsensus>,
    /// All that the views say of the rig, before a turntable.
    pub calibration: Option<Calibration>,
    /// Measures of the hull.
    pub hull: HullResult,
    /// Measures of the mesh.
    pub mesh: MeshResult,
    /// The mesh.
    pub tetrahedra: TetMesh,
    /// The controls that the mesh keeps.
    pub controls: Controls,
    /// Each view's outline over its photograph; empty where no pictures were asked for.
    pub outlines: Vec<Product>,
    /// The sheet of the calibration, where pictures were asked for.
    pub sheet: Option<Sheet>,
    /// Whether it can be relied on.
    pub verdict: ResultVerdict,
    /// Seconds each stage took.
    pub timing_s: Timing,
    /// What a person should know.
    pub warnings: Vec<String>,
}

impl Reconstruction {
    /// The result, with what it is to state beside its figures.
    pub fn result_file(&self, head: ResultHead) -> ResultFile {
        let ResultHead { software, session, products, timing_s } = head;
        ResultFile {
            schema: super::result::SCHEMA,
            software,
            session,
            verdict: self.verdict.clone(),
            views: self.views.len(),
            scale_mm_per_px: self.scale_mm_per_px,
            axis: self.axis,
            pedestal: self.consensus.clone(),
            calibration: self.calibration.clone(),
            hull: self.hull.clone(),
            mesh: self.mesh,
            products,
            timing_s,
            warnings: self.warnings.clone(),
            view_details: self.views.clone(),
            merge: None,
        }
    }
}

/// The camera before the axis is measured: the given axis, else the pedestal's middle, else the outline's.
pub(super) fn provisional_camera(table: &TurntableSettings, view: &SegmentedView) -> Turntable {
    let s = &view.silhouette;
    let pedestal = view.found.report.pedestal;
    let middle = s.origin[0] as f64 + 0.5 * s.size[0] as f64;
    Turntable {
        mm_per_px: table.mm_per_px,
        axis_column_px: table.axis_column_px.or(pedestal.map(|p| p.centre_column)).unwrap_or(middle),
        origin_row_px: pedestal.map_or((s.origin[1] + s.size[1]) as f64, |p| p.top_row),
        elevation_rad: 0.0,
        roll_rad: table.roll_deg.unwrap_or(0.0).to_radians(),
        camera_distance_mm: table.camera_distance_mm,
    }
}

/// What of the figures that were given, or that follow from them, no laboratory has.
fn doubts(
    settings: &Settings,
    cameras: &Cameras,
    segmented: &[SegmentedView],
    longest_mm: f64,
) -> Vec<Doubt> {
    let mut doubts = match cameras {
        Cameras::Given { unit: LengthUnit::None, .. } => return Vec::new(),
        Cameras::Given { .. } => Vec::new(),
        Cameras::Turntable(table) => {
            let grain: Vec<f64> =
                segmented.iter().filter(|t| t.role == Role::Grain).map(|t| t.angle.deg()).collect();
            let step = grain.windows(2).map(|w| (w[1] - w[0]).abs()).fold(f64::INFINITY, f64::min);
            table.doubts().into_iter().chain(plausible::VIEW_STEP.doubt(step)).collect()
        }
    };
    doubts.extend(plausible::GRAIN.doubt(longest_mm).map(|doubt| match (cameras, doubt.factor()) {
        (Cameras::Turntable(table), Some(factor)) => {
            let [size, pixel, given] =
                [factor * longest_mm, factor * table.mm_per_px, table.mm_per_px].map(plausible::figure);
            doubt.where_change(format!("{size} mm, by mm_per_px = {pixel} instead of {given}"))
        }
        _ => doubt,
    }));
    doubts.extend(settings.mesh.doubts(longest_mm));
    doubts
}

/// Hull and mesh from all views, in the order of their indices.
pub(super) fn reconstruct(
    settings: &Settings,
    (cameras, full_step_deg): (&Cameras, f64),
    segmented: &[SegmentedView],
    (consensus, mut warnings): (Option<PedestalConsensus>, Vec<String>),
    observer: &Observer,
) -> Result<Reconstruction, PipelineError> {
    let working = |stage: &str, done: f64| observer(EventKind::Working { stage: stage.into(), done });

    working("calibrate", 0.0);
    let start = Instant::now();
    let Measured { projections, axis, calibration } =
        cameras_of(cameras, full_step_deg, segmented, consensus.as_ref(), &mut warnings)?;
    let calibrate_s = start.elapsed().as_secs_f64();

    working("hull", 0.0);
    let start = Instant::now();
    let cones: Vec<Cone> = (segmented.iter().zip(projections))
        .filter(|(t, _)| t.role == Role::Grain)
        .map(|(t, p)| Cone::new(p, Arc::clone(&t.silhouette)))
        .collect();
    let bounds = find_bounds(&cones)?;
    let scale_mm_per_px = match cameras {
        Cameras::Turntable(t) => Some(t.mm_per_px),
        Cameras::Given { .. } => None,
    };
    let longest = bounds.size().max();
    warnings.extend(plausible::settle(doubts(settings, cameras, segmented, longest), settings.as_given)?);
    let by_default = scale_mm_per_px.unwrap_or(0.0).max(longest / MOST_DEFAULT_CELLS);
    let mut grid = HullGrid::new(&bounds, settings.hull.voxel_mm.unwrap_or(by_default))?;
    grid.carve_all(&cones, &mut |done| working("hull", done));
    let measures = grid.measures();
    let tight =
        measures.bounding_box_mm.ok_or(grainrig_core::hull::HullError::Empty { views: cones.len() })?;
    let voxels = grid.count_voxels();
    let volume = match SlicedHull::of_cones(&cones) {
        Ok(slices) => (HullMethod::ExactSlices, slices.volume_mm3()),
        // Before other rays a slice is no line of the picture.
        Err(SliceError::NotLevel { .. }) => (HullMethod::Grid, measures.volume_mm3),
        Err(e) => {
            warnings.push(format!("the hull's volume is the grid's: {e}"));
            (HullMethod::Grid, measures.volume_mm3)
        }
    };
    let surface = grid.surface();
    drop(grid);
    let converging = convergence(&cones, volume.1);
    let ious = silhouette_ious(&cones, &surface, |column, row| {
        (consensus.as_ref()).is_none_or(|c| (row as f64) < c.top_row_at(column as f64))
    });
    let alone = carved_alone(&cones, &tight.grown(0.05 * longest), ALONE_POINTS);
    let patch =
        consensus.as_ref().zip(scale_mm_per_px).map(|(s, mm_per_px)| contact_patch(s, mm_per_px, &surface));
    drop(surface);
    let estimate = estimate(
        &cones,
        &Known {
            volume_mm3: volume.1,
            surface_mm2: measures.surface_area_mm2,
            bounds: tight,
            scale: calibration.as_ref().and_then(Calibration::scale_share),
            cameras: calibration.as_ref().map_or(0.0, |c| c.volume_share(volume.1)),
            foot: patch.map_or(0.0, |p| p.volume_share),
            outline_px: outline_px(segmented, &ious),
        },
    );
    if let Err(why) = &estimate {
        warnings.push(format!("no bound of the grain's own volume can be given but the hull's: {why}"));
    }
    let hull_s = start.elapsed().as_secs_f64();

    let start = Instant::now();
    let body = VisualHull { cones, bounds: tight.grown(0.02 * longest) };
    let diameter_mm = (6.0 * measures.volume_mm3 / std::f64::consts::PI).cbrt();
    let controls = settings.mesh.controls(diameter_mm);
    let tetrahedra = mesh(&body, &controls, &mut |done| working("mesh", done))?;
    let mesh_s = start.elapsed().as_secs_f64();

    let metric = !matches!(cameras, Cameras::Given { unit: LengthUnit::None, .. });
    if !metric {
        warnings
            .push("the cameras have no unit of length: shapes only, no volumes or lengths are stated".into());
    }
    let views: Vec<ViewResult> = (segmented.iter())
        .filter(|t| t.role == Role::Grain)
        .zip(ious.iter().zip(&alone))
        .map(|(t, (iou, alone))| ViewResult {
            index: t.index,
            angle_deg: t.angle.deg(),
            iou: *iou,
            carved_alone: *alone,
            silhouette: t.found.report.clone(),
            quality: t.quality.clone(),
        })
        .collect();
    let findings = calibration.as_ref().map_or(&[][..], |c| &c.warnings);
    let verdict = verdict(&views, findings);
    let worst = views.iter().min_by(|a, b| a.iou.total_cmp(&b.iou));
    if let Some(view) = worst.filter(|v| v.iou < LEAST_AGREEMENT) {
        warnings.push(format!(
            "the hull, seen again, fills the silhouette of view {} only to {:.3} (intersection over union, {} is usual): \
             check that view, the angles, the camera's distance and whether the grain has slipped",
            view.index, view.iou, LEAST_AGREEMENT
        ));
    }
    if tetrahedra.dropped_pieces > 0 {
        warnings.push(format!(
            "the hull has {} more piece(s) than the largest, which alone is meshed; look for dust in the views",
            tetrahedra.dropped_pieces
        ));
    }
    let start = Instant::now();
    let outlines = pictures::outlines(segmented, axis.as_ref())?;
    let sheet = (settings.report.pictures)
        .then(|| pictures::sheet(cameras, segmented, &views, axis.as_ref(), calibration.as_ref(), &warnings));
    let report_s = start.elapsed().as_secs_f64();
    let silhouette_s = segmented.iter().map(|t| t.seconds).sum::<f64>();
    Ok(Reconstruction {
        hull: HullResult::new(
            &measures,
            volume,
            estimate.as_ref().map_err(ToString::to_string),
            &voxels,
            &ious,
            patch,
            converging,
            metric,
        ),
        mesh: MeshResult::new(&tetrahedra, &controls, metric),
        views,
        verdict,
        scale_mm_per_px,
        axis,
        consensus,
        calibration,
        controls,
        outlines,
        sheet,
        tetrahedra,
        timing_s: Timing {
            silhouette: silhouette_s,
            calibrate: calibrate_s,
            hull: hull_s,
            mesh: mesh_s,
            report: report_s,
            total: silhouette_s + calibrate_s + hull_s + mesh_s + report_s,
        },
        warnings,
    })
}

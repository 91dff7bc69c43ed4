//! Two poses of one grain become one hull: each carves what the other cannot see.

use super::products::of_mesh;
use super::result::{HullMethod, HullResult, MeshResult, ResultFile, ResultHead, ViewResult};
use super::verdict::{ResultVerdict, verdict};
use super::{Observer, PipelineError, Product, SeenPose, Settings};
use crate::session::event::EventKind;
use grainrig_core::geometry::{Aabb, Point, TriangleMesh};
use grainrig_core::hull::{Cone, HullError, HullGrid, VisualHull, silhouette_iou};
use grainrig_core::mesh::{Controls, TetMesh, mesh};
use grainrig_core::register::{Motion, PoseView, Registration, Rival, Unfilled, register};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;

/// Poses whose axes are nearer to one another than this see the grain from almost the same sides, degrees.
const LEAST_AXES_APART_DEG: f64 = 20.0;
/// How deep a grain may be embedded below the first pose's lowest shown place, as a share of its longest edge.
const DEEPEST: f64 = 0.12;

/// What `result.json` says of the merging.
#[derive(Debug, Clone, Serialize)]
pub struct MergeResult {
    /// The first pose: the result is in its frame.
    pub a: PoseResult,
    /// The second pose.
    pub b: PoseResult,
    /// From the frame of `b` to that of `a`: `x_a = rotation_matrix · x_b + translation_mm`, row by row.
    pub rotation_matrix: [[f64; 3]; 3],
    /// The turn's axis, a unit vector …
    pub rotation_axis: [f64; 3],
    /// … and angle, degrees.
    pub rotation_deg: f64,
    /// The shift after the turn, mm.
    pub translation_mm: [f64; 3],
    /// The angle between the two poses' upright axes, 0° to 90°: the nearer to 90°, the more the second pose removes.
    pub axes_apart_deg: f64,
    /// Root mean square over all rays through outlines of what both hulls together leave unfilled, pixels.
    pub residual_px: f64,
    /// What both hulls together leave unfilled of the silhouettes, along their outlines.
    pub unfilled: Unfilled,
    /// What each pose's hull leaves unfilled of its own silhouettes.
    pub unfilled_alone: Unfilled,
    /// What the merged hull may leave unfilled in the median view, pixels.
    pub limit_px: f64,
    /// The next best turn that was found: how far it is, and what it would leave unfilled.
    pub rival: Option<Rival>,
    /// Volume of the merged hull, mm³.
    pub volume_mm3: f64,
}

/// One pose of a merging.
#[derive(Debug, Clone, Serialize)]
pub struct PoseResult {
    /// Name of its session.
    pub session: String,
    /// Views that carved.
    pub views: usize,
    /// Volume of its own hull, mm³.
    pub volume_mm3: f64,
    /// Whether its views stop above a pedestal, so that the other pose alone carves the grain's foot there.
    pub pedestal: bool,
    /// Mean depth along each view's outline that the merged hull does not fill, pixels.
    pub unfilled_px: Vec<f64>,
}

/// What a merging made.
#[derive(Debug, Clone)]
pub struct Merged {
    /// The figures of the merging.
    pub merge: MergeResult,
    /// The motion of the second pose into the frame of the first.
    pub motion: Motion,
    /// Measures of the merged hull.
    pub hull: HullResult,
    /// Measures of the mesh.
    pub mesh: MeshResult,
    /// The mesh, in the frame of the first pose.
    pub tetrahedra: TetMesh,
    /// The controls that it keeps.
    pub controls: Controls,
    /// The first pose's views, then the second's.
    views: Vec<ViewResult>,
    scale_mm_per_px: Option<f64>,
    verdict: ResultVerdict,
    warnings: Vec<String>,
}

impl Merged {
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
            axis: None,
            pedestal: None,
            calibration: None,
            hull: self.hull.clone(),
            mesh: self.mesh,
            products,
            timing_s,
            warnings: self.warnings.clone(),
            view_details: self.views.clone(),
            merge: Some(self.merge.clone()),
        }
    }

    /// The mesh as Abaqus input, `ParaView` grid and STL surface.
    ///
    /// # Errors
    /// [`PipelineError`] where a format can't hold the mesh.
    pub fn products(&self, software: &str) -> Result<Vec<Product>, PipelineError> {
        let (a, b) = (&self.merge.a, &self.merge.b);
        let provenance = [
            format!("made by {software} from sessions {} and {}", a.session, b.session),
            format!("{} + {} views, in the frame of session {}", a.views, b.views, a.session),
        ];
        of_mesh(&self.tetrahedra, &self.controls, &provenance, None)
    }
}

/// Finds how the second pose lies to the first and carves one hull by the views of both. Names are the sessions'.
///
/// # Errors
/// [`PipelineError::Register`] where the poses do not fit one another, or fit in several ways.
pub fn merge(
    settings: &Settings,
    [a, b]: [&SeenPose; 2],
    names: [&str; 2],
    observer: &Observer,
) -> Result<Merged, PipelineError> {
    let working = |stage: &str, done: f64| observer(EventKind::Working { stage: stage.into(), done });
    working("register", 0.0);
    let registration = register(&a.pose, &b.pose, &mut |done| working("register", done))?;
    let motion = registration.motion;

    working("hull", 0.0);
    let mut cones = a.pose.cones_moved(&Motion::identity());
    cones.extend(b.pose.cones_moved(&motion));
    let bounds = common_box(a, b, &motion)?;
    let mut grid = HullGrid::new(&bounds, settings.hull.voxel_mm.unwrap_or(a.voxel_mm.min(b.voxel_mm)))?;
    grid.carve_all(&cones, &mut |done| working("hull", done));
    let measures = grid.measures();
    let tight = measures.bounding_box_mm.ok_or(HullError::Empty { views: cones.len() })?;
    let voxels = grid.count_voxels();
    let surface = grid.surface();
    drop(grid);
    let mut ious = filled(a.pose.views(), &surface, &Motion::identity());
    ious.extend(filled(b.pose.views(), &surface, &motion));
    drop(surface);

    let longest = tight.size().max();
    let body = VisualHull { cones, bounds: tight.grown(0.02 * longest) };
    let controls = settings.mesh.controls((6.0 * measures.volume_mm3 / std::f64::consts::PI).cbrt());
    let tetrahedra = mesh(&body, &controls, &mut |done| working("mesh", done))?;

    let views = a.views.iter().chain(&b.views).zip(&ious);
    let views: Vec<ViewResult> = views.map(|(v, iou)| ViewResult { iou: *iou, ..v.clone() }).collect();
    let verdict = verdict(&views, &[&a.findings[..], &b.findings].concat());
    let merge = merge_result([a, b], names, &registration, measures.volume_mm3);
    let mut warnings = [&a.warnings[..], &b.warnings].concat();
    if merge.axes_apart_deg < LEAST_AXES_APART_DEG {
        warnings.push(format!(
            "the two poses' axes are {:.0}° apart, below {LEAST_AXES_APART_DEG}°: the second pose shows little that the \
             first does not; lay the grain on a side that was at a side before",
            merge.axes_apart_deg
        ));
    }
    if tetrahedra.dropped_pieces > 0 {
        warnings.push(format!(
            "the hull has {} more piece(s) than the largest, which alone is meshed; look for dust in the views",
            tetrahedra.dropped_pieces
        ));
    }
    Ok(Merged {
        merge,
        motion,
        hull: HullResult::new(
            &measures,
            (HullMethod::Grid, measures.volume_mm3),
            Err("of two poses' hulls together nobody knows yet how much larger than the grain they are"
                .into()),
            &voxels,
            &ious,
            None,
            Vec::new(),
            true,
        ),
        mesh: MeshResult::new(&tetrahedra, &controls, true),
        tetrahedra,
        controls,
        views,
        verdict,
        scale_mm_per_px: a.scale_mm_per_px,
        warnings,
    })
}

/// A box that holds the grain: where both poses' own boxes meet, each with room below for what its pedestal hides.
fn common_box(a: &SeenPose, b: &SeenPose, motion: &Motion) -> Result<Aabb, PipelineError> {
    let roomy = |pose: &SeenPose| {
        let bounds = pose.pose.body().bounds;
        let depth = if pose.has_pedestal { DEEPEST * bounds.size().max() } else { 0.0 };
        let mut grown = bounds.grown(2.0 * pose.voxel_mm);
        grown.min.z -= depth;
        grown
    };
    let moved = Aabb::of(roomy(b).corners().map(|p| motion.transform(&p)));
    let empty = HullError::Empty { views: a.pose.views().len() + b.pose.views().len() };
    Ok(moved.and_then(|moved| roomy(a).intersection(&moved)).ok_or(empty)?)
}

/// How well the merged hull, seen again by each view of a pose that was moved so, fills its silhouette. What lies below
/// a silhouette's end is no part of it.
fn filled(views: &[PoseView], surface: &TriangleMesh, motion: &Motion) -> Vec<f64> {
    let one = |view: &PoseView| {
        let projection = motion.camera(&view.projection);
        let Some(cut) = view.cut else {
            return silhouette_iou(&Cone::new(projection, Arc::clone(&view.silhouette)), surface);
        };
        let shown = |p: &Point| projection.project(p).is_some_and(|q| cut.above_px(q) > -cut.mixed_px);
        let shown: Vec<bool> = surface.vertices.iter().map(shown).collect();
        let is_above = |t: &&[u32; 3]| t.iter().any(|v| shown[*v as usize]);
        let triangles = surface.triangles.iter().filter(is_above).copied().collect();
        let above = TriangleMesh { vertices: surface.vertices.clone(), triangles };
        silhouette_iou(&Cone::new(projection.clone(), Arc::clone(&view.silhouette)), &above)
    };
    views.par_iter().map(one).collect()
}

fn merge_result(
    [a, b]: [&SeenPose; 2],
    names: [&str; 2],
    registration: &Registration,
    volume_mm3: f64,
) -> MergeResult {
    let pose = |pose: &SeenPose, name: &str, unfilled_px: &[f64]| PoseResult {
        session: name.into(),
        views: pose.pose.views().len(),
        volume_mm3: pose.measures.volume_mm3,
        pedestal: pose.has_pedestal,
        unfilled_px: unfilled_px.to_vec(),
    };
    let motion = &registration.motion;
    let matrix = motion.rotation.to_rotation_matrix();
    let axis = motion.rotation.axis().map_or([0.0, 0.0, 1.0], |axis| [axis.x, axis.y, axis.z]);
    MergeResult {
        a: pose(a, names[0], &registration.views_a_px),
        b: pose(b, names[1], &registration.views_b_px),
        rotation_matrix: std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)])),
        rotation_axis: axis,
        rotation_deg: motion.rotation.angle().to_degrees(),
        translation_mm: motion.translation_mm.into(),
        axes_apart_deg: matrix[(2, 2)].abs().min(1.0).acos().to_degrees(),
        residual_px: registration.residual_px,
        unfilled: registration.unfilled,
        unfilled_alone: registration.alone,
        limit_px: registration.limit_px,
        rival: registration.rival,
        volume_mm3,
    }
}

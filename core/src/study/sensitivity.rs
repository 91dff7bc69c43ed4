//! How the reconstructed volume depends on the number of views (Nadimi and Fonseca 2017, figures 5 to 7).

use super::Body;
use super::views::Frame;
use crate::geometry::Point;
use crate::hull::slices::{RowGrid, SliceError, SlicedHull, Strips, VoxelGrid};
use crate::hull::{Cone, VisualHull};
use crate::mesh::{Controls, MeshError, mesh};
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::PI;

/// Least rows of the exact slices; more where pixels are smaller.
const LEAST_ROWS: f64 = 1024.0;
/// The fine mesh is the usual one; the coarse one's facets are so many times as large.
const COARSE: f64 = 2.0;
/// Most pixels across the body, and least.
const MOST_PIXELS: f64 = 4000.0;
const LEAST_PIXELS: f64 = 8.0;
/// Most views.
const MOST_VIEWS: usize = 720;

/// Why there is no study.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A pixel that does not fit the body.
    #[error(
        "a pixel of {pixel_mm} mm is {pixels:.1} of the body's size of {size_mm:.4} mm; {LEAST_PIXELS} to {MOST_PIXELS} pixels \
         across it can be studied: choose --pixel-mm between {:.2e} and {:.2e}, or check the unit of the surface",
        size_mm / MOST_PIXELS, size_mm / LEAST_PIXELS
    )]
    Pixel {
        /// Size of a pixel, mm.
        pixel_mm: f64,
        /// Pixels across the body.
        pixels: f64,
        /// Longest edge of the body's box, mm.
        size_mm: f64,
    },
    /// A number of views that bounds nothing or takes for ever.
    #[error("{0} views: 2 to {MOST_VIEWS} can be studied")]
    Views(usize),
    /// The slices.
    #[error(transparent)]
    Slices(#[from] SliceError),
    /// The mesh of a hull.
    #[error("the hull of {views} views: {error}")]
    Mesh {
        /// How many views.
        views: usize,
        /// The mesher's message.
        error: MeshError,
    },
}

/// `V_R/V_M`, four ways: the body's real volume over the model's that is reconstructed from its views. At most 1 but for the
/// rounding of voxels and facets, since a hull holds its body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratios {
    /// Voxels as large as a pixel whose middles fall on a set pixel in every view, as published.
    pub voxel: f64,
    /// The exact hull of the exact silhouettes: what the number of views alone does.
    pub exact: f64,
    /// A mesh of the hull of outlines placed between the pixels; its facets twice as large as the fine one's.
    pub coarse_mesh: f64,
    /// The usual mesh (about 50 000 tetrahedra) of the same.
    pub fine_mesh: f64,
}

/// One number of views.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What was studied.
    pub body: String,
    /// Views over half a turn.
    pub views: usize,
    /// Angle between neighbouring views, degrees.
    pub angle_deg: f64,
    /// `V_R/V_M`: real over reconstructed volume.
    pub vr_over_vm: Ratios,
    /// `V_R/V_M` of a ball by the closed form, (π/2N)/tan(π/2N).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub analytic: Option<f64>,
}

/// What to study.
#[derive(Debug, Clone)]
pub struct Study {
    /// What the body is called.
    pub name: String,
    /// The body.
    pub body: Body,
    /// Size of a pixel, mm.
    pub pixel_mm: f64,
}

/// The rows of a study, for these numbers of views over half a turn; `done` is called with the share that is done.
///
/// The same bytes on any number of threads. Cost: dominated by the meshes, about a second a row.
///
/// # Errors
/// [`StudyError`].
pub fn sensitivity(
    study: &Study,
    views: &[usize],
    done: &mut dyn FnMut(f64),
) -> Result<Vec<Row>, StudyError> {
    let size_mm = study.body.bounds().size().max();
    let pixels = size_mm / study.pixel_mm;
    if !(study.pixel_mm > 0.0 && (LEAST_PIXELS..=MOST_PIXELS).contains(&pixels)) {
        return Err(StudyError::Pixel { pixel_mm: study.pixel_mm, pixels, size_mm });
    }
    if let Some(n) = views.iter().find(|n| !(2..=MOST_VIEWS).contains(*n)) {
        return Err(StudyError::Views(*n));
    }
    let mut rows = Vec::new();
    for (k, n) in views.iter().enumerate() {
        rows.push(study.row(*n)?);
        done((k + 1) as f64 / views.len() as f64);
    }
    Ok(rows)
}

fn angles(views: usize) -> Vec<f64> {
    (0..views).map(|i| PI * i as f64 / views as f64).collect()
}

impl Study {
    fn row(&self, views: usize) -> Result<Row, StudyError> {
        let truth = self.body.volume_mm3();
        let hull = self.hull(views);
        let fine = Controls::for_size(self.body.diameter_mm());
        let coarse = Controls {
            surface_size_mm: COARSE * fine.surface_size_mm,
            tet_volume_mm3: COARSE.powi(3) * fine.tet_volume_mm3,
            ..fine
        };
        let meshed = |controls: &Controls| {
            let made =
                mesh(&hull, controls, &mut |_| {}).map_err(|error| StudyError::Mesh { views, error })?;
            Ok::<f64, StudyError>(truth / made.volume_mm3())
        };
        let n = views as f64;
        Ok(Row {
            body: self.name.clone(),
            views,
            angle_deg: 180.0 / n,
            vr_over_vm: Ratios {
                voxel: truth / self.voxels(views)?,
                exact: truth / self.exact(views)?.volume_mm3(),
                coarse_mesh: meshed(&coarse)?,
                fine_mesh: meshed(&fine)?,
            },
            analytic: matches!(self.body, Body::Ball(_)).then(|| PI / (2.0 * n) / (PI / (2.0 * n)).tan()),
        })
    }

    /// The exact hull of exact silhouettes.
    fn exact(&self, views: usize) -> Result<SlicedHull, SliceError> {
        let b = self.body.bounds();
        let row_grid = RowGrid::tiling([b.min.z, b.max.z], self.pixel_mm.min(b.size().z / LEAST_ROWS))?;
        let views: Vec<Strips> = (angles(views).into_par_iter())
            .map(|angle| {
                let rows = self.body.intervals(row_grid, angle);
                let mut next = rows.iter();
                Strips::from_fn(row_grid, angle, |_, out| out.extend(next.next().into_iter().flatten()))
            })
            .collect::<Result<_, _>>()?;
        SlicedHull::new(&views)
    }

    /// Volume of the voxels, mm³: as large as a pixel, one row of them for each row of pixels.
    fn voxels(&self, views: usize) -> Result<f64, SliceError> {
        let frame = Frame::around(&self.body, self.pixel_mm);
        let strips: Vec<Strips> = (angles(views).into_par_iter())
            .map(|angle| frame.pixel_strips(&self.body, angle))
            .collect::<Result<_, _>>()?;
        let (p, row_grid) = (self.pixel_mm, frame.row_grid());
        // Few views leave corners beyond the circle that the body turns in.
        let half = (self.body.reach_mm() * std::f64::consts::SQRT_2 / p).ceil() + 2.0;
        let across = 2 * half as usize;
        let origin = Point::new((0.5 - half) * p, (0.5 - half) * p, row_grid.first_mm);
        let grid = VoxelGrid { origin, pitch_mm: p, dims: [across, across, row_grid.rows] };
        Ok(SlicedHull::new(&strips)?.voxels(grid)?.count() as f64 * p.powi(3))
    }

    /// The hull of outlines between the pixels, as captures have it.
    pub(super) fn hull(&self, views: usize) -> VisualHull {
        let frame = Frame::around(&self.body, self.pixel_mm);
        let cones: Vec<Cone> =
            angles(views).into_par_iter().filter_map(|angle| frame.cone(&self.body, angle)).collect();
        let b = self.body.bounds();
        let half = self.body.reach_mm() * std::f64::consts::SQRT_2 + 2.0 * self.pixel_mm;
        let bounds = crate::geometry::Aabb {
            min: Point::new(-half, -half, b.min.z - 2.0 * self.pixel_mm),
            max: Point::new(half, half, b.max.z + 2.0 * self.pixel_mm),
        };
        VisualHull { cones, bounds }
    }
}

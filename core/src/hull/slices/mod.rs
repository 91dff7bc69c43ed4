//! The exact visual hull before parallel rays that are level: slice by slice, without a grid.
//!
//! Before such rays a horizontal slice of the grain is seen as a line of the picture, and nothing else of the grain is
//! seen there. A slice of the hull is therefore the common part of strips, one or more a view,
//!
//! ```text
//! { p : u0 ≤ p·e(θ) ≤ u1 },   e(θ) = (cos θ, −sin θ),
//! ```
//!
//! that is, disjoint convex polygons with at most two edges a view and interval. Their areas and moments are exact; the
//! cost is rows × views. Along the height each slice stands for a slab as thick as the rows' pitch ([`RowGrid`]).

mod cut;
mod directions;
mod mask;
mod measure;
mod moments;
mod read;
mod row;
mod sight;
mod strips;
mod surface;
mod voxels;

pub use mask::BitMask;
pub use measure::{SliceFigures, SliceMeasures};
pub use sight::Sight;
pub use strips::{RowGrid, Strips};
pub use voxels::{BitVoxels, VoxelGrid};

use cut::Corner;
use rayon::prelude::*;

/// Rows that one task computes.
const ROWS_AT_ONCE: usize = 16;

/// Why there are no slices.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SliceError {
    /// All views look along one line, so that the slices have no end.
    #[error(
        "{views} view(s) look along one line only; a slice is bounded by views from at least 2 directions"
    )]
    OneDirection {
        /// How many views.
        views: usize,
    },
    /// A row grid that is none.
    #[error(
        "rows from {} mm on, {} mm apart, {} of them: the pitch must be a positive number and the rows 1 to {}",
        .0.first_mm, .0.pitch_mm, .0.rows, strips::MOST_ROWS
    )]
    RowGrid(RowGrid),
    /// A camera before which a slice is no line.
    #[error(
        "{}: exact slices need parallel rays square to the axis (within 1e-6 rad); use the hull on a grid",
        .elevation_rad.map_or("the view has perspective".to_owned(), |r| format!("the view's rays rise by {:.4}°", r.to_degrees()))
    )]
    NotLevel {
        /// Elevation of the rays from level, radians; `None` where they are not parallel to each other.
        elevation_rad: Option<f64>,
    },
    /// The outlines share no height.
    #[error(
        "the highest bottom of an outline is at {low_mm} mm and the lowest top at {high_mm} mm: the views share no height; \
         check that all show the same grain and the same pedestal"
    )]
    NoCommonHeight {
        /// The highest of the outlines' lowest points, mm.
        low_mm: f64,
        /// The lowest of their highest points, mm.
        high_mm: f64,
    },
    /// Voxels that cannot be made.
    #[error("{dims:?} voxels of {pitch_mm} mm: their edge must be a positive number, and they at most 2^34")]
    Voxels {
        /// Edge of a voxel, mm.
        pitch_mm: f64,
        /// Voxels along x, y and z.
        dims: [usize; 3],
    },
    /// Views with different rows.
    #[error(
        "view {view} has the rows {row_grid:?}, the first view {first:?}: read all views on one row grid"
    )]
    RowGrids {
        /// Number of the view in the list.
        view: usize,
        /// Its rows.
        row_grid: RowGrid,
        /// The first view's.
        first: RowGrid,
    },
    /// An angle that is no number.
    #[error("the stage's angle is {0} rad; it must be a finite number")]
    Angle(f64),
    /// Intervals that overlap, run backwards or are no numbers.
    #[error(
        "row {row} at {height_mm} mm has the interval {interval:?} mm: intervals must be finite, ascending and disjoint"
    )]
    Intervals {
        /// The row.
        row: usize,
        /// Its height, mm.
        height_mm: f64,
        /// The first one that is wrong, mm.
        interval: [f64; 2],
    },
}

/// The exact hull: for each row of the row grid its slice, a set of disjoint convex polygons.
///
/// The same bits on any number of threads and for any order of the views.
#[derive(Debug, Clone, PartialEq)]
pub struct SlicedHull {
    row_grid: RowGrid,
    /// Unit normals of the half-planes, counter-clockwise.
    normals: Vec<[f64; 2]>,
    corners: Vec<Corner>,
    /// Where each piece begins in `corners`, and their end.
    pieces: Vec<u32>,
    /// Where each row begins among the pieces, and their end.
    rows: Vec<u32>,
}

impl SlicedHull {
    /// The hull of views that were read on the same row grid. It may be empty.
    ///
    /// Cost: rows × views where each row is one interval; a gap in a view's row doubles the pieces at worst.
    ///
    /// # Errors
    /// [`SliceError::OneDirection`] and [`SliceError::RowGrids`].
    pub fn new(views: &[Strips]) -> Result<Self, SliceError> {
        let directions = directions::sorted(views)?;
        let normals = directions::normals(&directions);
        let row_grid = views[0].row_grid();
        let parts: Vec<Self> = (0..row_grid.rows.div_ceil(ROWS_AT_ONCE))
            .into_par_iter()
            .map_init(row::ScratchBuffers::default, |scratch, n| {
                let mut part = Self::empty(row_grid);
                let first = n * ROWS_AT_ONCE;
                for row in first..(first + ROWS_AT_ONCE).min(row_grid.rows) {
                    scratch.slice(&directions, &normals, row, &mut part.corners, &mut part.pieces);
                    part.rows.push(part.pieces.len() as u32 - 1);
                }
                part
            })
            .collect();
        let mut whole = Self { normals, ..Self::empty(row_grid) };
        for part in parts {
            let (corners, pieces) = (whole.corners.len() as u32, whole.pieces.len() as u32 - 1);
            whole.corners.extend(part.corners);
            whole.pieces.extend(part.pieces[1..].iter().map(|end| end + corners));
            whole.rows.extend(part.rows[1..].iter().map(|end| end + pieces));
        }
        Ok(whole)
    }

    fn empty(row_grid: RowGrid) -> Self {
        Self { row_grid, normals: Vec::new(), corners: Vec::new(), pieces: vec![0], rows: vec![0] }
    }

    /// The rows.
    pub fn row_grid(&self) -> RowGrid {
        self.row_grid
    }

    /// The convex pieces of a row's slice.
    fn slice(&self, row: usize) -> impl Iterator<Item = &[Corner]> + Clone {
        let pieces = self.rows[row] as usize..self.rows[row + 1] as usize;
        pieces.map(|k| &self.corners[self.pieces[k] as usize..self.pieces[k + 1] as usize])
    }

    /// The slice's convex, disjoint polygons: corners (x, y) in mm, counter-clockwise seen from above.
    pub fn polygons(&self, row: usize) -> Vec<Vec<[f64; 2]>> {
        self.slice(row).map(|piece| piece.iter().map(|c| c.at).collect()).collect()
    }
}

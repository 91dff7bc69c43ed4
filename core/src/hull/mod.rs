//! The visual hull: the largest body that all silhouettes allow, and its measures.
//!
//! A point belongs to the hull when every view sees it inside the silhouette. The hull is the intersection of
//! the views' cones (Laurentini 1994), an upper bound of the grain: what no view can see stays filled.
//!
//! ```text
//! H = ∩ᵢ { p : dᵢ(πᵢ(p)) < 0 },   f(p) = maxᵢ dᵢ(πᵢ(p))/sᵢ(p)
//! ```
//!
//! πᵢ is view i's projection, dᵢ the signed distance from its outline (px, negative inside) and sᵢ its scale at p (px/mm): f is
//! negative in the hull and about the distance from it, mm, near its surface. Of a ball before N parallel views spread evenly
//! over half a turn each slice is a regular polygon of 2N sides about a circle, so the hull is too large by
//!
//! ```text
//! V_H/V = (2N/π) tan(π/2N):   N = 4: 5.5 %,  12: 0.58 %,  25: 0.13 %,  36: 0.06 %
//! ```
//!
//! Of a grain with hollows it is more, and not less with more views about the same axis: see [`estimate`].
//! [`HullGrid`] takes views before any camera, one by one; [`slices`] is exact before level parallel rays.

mod alone;
mod bounds;
mod cone;
pub mod estimate;
mod grid;
mod lattice;
mod measure;
mod others;
mod reproject;
pub mod slices;

pub use alone::{CarvedAlone, carved_alone};
pub use bounds::find_bounds;
pub use cone::Cone;
pub use grid::{HullGrid, VoxelCount};
pub use measure::Measures;
pub use others::held_by_others;
pub use reproject::{silhouette_iou, silhouette_ious};

use crate::geometry::{Aabb, ImplicitBody, Point};

/// The hull as a function of the point, without a grid: the greatest signed distance over the views.
#[derive(Debug, Clone)]
pub struct VisualHull {
    /// The views.
    pub cones: Vec<Cone>,
    /// A box that holds the hull.
    pub bounds: Aabb,
}

impl ImplicitBody for VisualHull {
    fn value(&self, p: &Point) -> f64 {
        self.cones.iter().map(|c| c.value_mm(p)).fold(f64::NEG_INFINITY, f64::max)
    }
    fn bounds(&self) -> Aabb {
        self.bounds
    }
    /// Each direction of a picture's bilinear distances changes by at most 1: √2 together, and a pinhole's scale a little.
    fn steepness(&self) -> Option<f64> {
        Some(1.5)
    }
}

/// Why there is no hull.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HullError {
    /// No view was given.
    #[error("there is no view to carve with; a hull needs at least 2")]
    NoViews,
    /// The views have no common body.
    #[error(
        "the silhouettes of {views} views have no common body; check the direction of rotation, the step angle, \
         the axis and the cameras"
    )]
    Empty {
        /// How many views.
        views: usize,
    },
    /// The views leave the hull unbounded.
    #[error("{views} views do not bound the hull in every direction; add views from other angles")]
    Unbounded {
        /// How many views.
        views: usize,
    },
    /// The grid's pitch is not a positive number.
    #[error("voxel size {0} mm: it must be a positive number; give hull.voxel_mm or a scale")]
    Voxel(f64),
    /// The grid would have too many cells.
    #[error(
        "a voxel of {voxel_mm} mm makes {cells} cells along the longest edge, the limit is {limit}; use a larger voxel"
    )]
    TooFine {
        /// The pitch asked for.
        voxel_mm: f64,
        /// Cells along the longest edge.
        cells: f64,
        /// The greatest number allowed.
        limit: usize,
    },
}

#[cfg(test)]
mod tests;

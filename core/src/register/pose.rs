//! One pose, prepared for the search: its hull as a function, samples of its surface, the rays of its outlines.

use super::field::{Field, Moments};
use super::rims::{Rim, rims};
use super::view::PoseView;
use super::{Motion, RegisterError};
use crate::geometry::{Point, TriangleMesh};
use crate::hull::{Cone, HullError, HullGrid, VisualHull, find_bounds};
use std::sync::Arc;

/// Cells along the hull's longest edge: of the grid whose surface is sampled, of the lattice for the search, and of
/// the one for the centroid.
const SURFACE_CELLS: f64 = 64.0;
const FIELD_CELLS: usize = 72;
const MOMENT_CELLS: usize = 40;
/// Room about the hull in the lattice, as a share of its longest edge.
const ROOM: f64 = 0.1;
/// Samples of the surface.
const SAMPLES: usize = 360;

/// All views of one pose of a grain.
#[derive(Debug, Clone)]
pub struct Pose {
    views: Vec<PoseView>,
    /// The open cones, and the box of the closed hull.
    body: VisualHull,
    pub(super) field: Field,
    pub(super) moments: Moments,
    pub(super) samples: Vec<Point>,
    pub(super) rims: Vec<Rim>,
    pub(super) size_mm: f64,
    /// Pixels per mm at the hull's centre.
    pub(super) px_per_mm: f64,
}

impl Pose {
    /// Prepares a pose.
    ///
    /// # Errors
    /// [`RegisterError`] where the views have no common body, or show no outline above their cut.
    pub fn new(views: Vec<PoseView>) -> Result<Self, RegisterError> {
        let closed: Vec<Cone> =
            views.iter().map(|v| Cone::new(v.projection.clone(), Arc::clone(&v.silhouette))).collect();
        let bounds = find_bounds(&closed)?;
        let size_mm = bounds.size().max();
        let empty = || RegisterError::Hull(HullError::Empty { views: views.len() });
        let mut grid = HullGrid::new(&bounds, size_mm / SURFACE_CELLS)?;
        closed.iter().for_each(|c| grid.carve(c));
        let surface = grid.surface();
        let closed = VisualHull { cones: closed, bounds };
        let moments = Field::of(&closed, &bounds, MOMENT_CELLS).moments().ok_or_else(empty)?;
        let body = VisualHull { cones: views.iter().map(PoseView::open).collect(), bounds };
        let px_per_mm = views.iter().filter_map(|v| v.projection.px_per_mm(&moments.centre)).sum::<f64>()
            / views.len() as f64;
        let field = Field::of(&body, &bounds.grown(ROOM * size_mm), FIELD_CELLS);
        let rims = rims(&views, &body)?;
        let shown = |p: &Point| views.iter().all(|v| v.shows(p, 1.0));
        let samples = sampled(&surface, shown);
        if samples.is_empty() {
            return Err(empty());
        }
        Ok(Self { views, body, field, moments, samples, rims, size_mm, px_per_mm })
    }

    /// The views.
    pub fn views(&self) -> &[PoseView] {
        &self.views
    }

    /// The hull as a function; below its cuts it is open.
    pub fn body(&self) -> &VisualHull {
        &self.body
    }

    /// The open cones as they stand in a frame into which the pose is moved.
    pub fn cones_moved(&self, motion: &Motion) -> Vec<Cone> {
        (self.views.iter())
            .map(|v| PoseView { projection: motion.camera(&v.projection), ..v.clone() }.open())
            .collect()
    }
}

/// Points evenly spread over the area of the triangles that `keep`s.
fn sampled(surface: &TriangleMesh, keep: impl Fn(&Point) -> bool) -> Vec<Point> {
    let middle = |[a, b, c]: [Point; 3]| Point::from((a.coords + b.coords + c.coords) / 3.0);
    let kept: Vec<(Point, f64)> = (0..surface.triangles.len())
        .map(|t| surface.corners(t))
        .map(|t| (middle(t), 0.5 * (t[1] - t[0]).cross(&(t[2] - t[0])).norm()))
        .filter(|(p, _)| keep(p))
        .collect();
    let each = kept.iter().map(|(_, area)| area).sum::<f64>() / SAMPLES as f64;
    let (mut sum, mut out) = (0.0, Vec::with_capacity(SAMPLES));
    for (p, area) in &kept {
        sum += area;
        if sum > each * (out.len() as f64 + 0.5) {
            out.push(*p);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_spread_by_area() {
        let square = |x: f64, n: usize| {
            (0..n).flat_map(move |i| {
                let y = i as f64 / n as f64;
                let h = 2.0 / n as f64;
                [Point::new(x, y, 0.0), Point::new(x + 1.0, y, 0.0), Point::new(x, y + h, 0.0)]
            })
        };
        // The same area in many small triangles and in fewer large ones.
        let vertices: Vec<_> = square(0.0, 4000).chain(square(5.0, 1000)).collect();
        let triangles = (0..vertices.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let samples = sampled(&TriangleMesh { vertices, triangles }, |p| p.y < 0.99);
        let left = samples.iter().filter(|p| p.x < 2.0).count();
        assert!(samples.len().abs_diff(SAMPLES) <= 2, "{}", samples.len());
        assert!(left.abs_diff(SAMPLES / 2) <= 2, "{left}");
        assert!(samples.iter().all(|p| p.y < 0.99));
    }
}

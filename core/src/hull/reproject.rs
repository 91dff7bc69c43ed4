//! Reprojection of the hull: intersection over union with the silhouette that carved it.

use super::Cone;
use crate::geometry::{Aabb, TriangleMesh};
use rayon::prelude::*;

/// Intersection over union of a view's silhouette and the picture of a closed surface's triangles.
///
/// A pixel is covered where its centre lies in a triangle's picture, whichever way that faces. 1 is perfect;
/// inconsistent cameras or silhouettes carve away what a view has seen, so its value falls.
pub fn silhouette_iou(cone: &Cone, surface: &TriangleMesh) -> f64 {
    within(cone, surface, surface.bounds().as_ref(), &|_, _| true)
}

/// The same for each of several views, of those pixels (column, row) that count.
///
/// What hangs below a pedestal's top no hull has, where other views see it before or behind the pedestal: there views do not contradict one
/// another.
pub fn silhouette_ious(
    cones: &[Cone],
    surface: &TriangleMesh,
    counts: impl Fn(usize, usize) -> bool + Sync,
) -> Vec<f64> {
    let bounds = surface.bounds();
    cones.par_iter().map(|cone| within(cone, surface, bounds.as_ref(), &counts)).collect()
}

/// Of a surface in its box.
fn within(
    cone: &Cone,
    surface: &TriangleMesh,
    bounds: Option<&Aabb>,
    counts: &impl Fn(usize, usize) -> bool,
) -> f64 {
    let s = cone.silhouette();
    let window = window(cone, bounds);
    let [w, h] = window.size;
    let mut covered = vec![false; w * h];
    let seen: Vec<Option<[f64; 2]>> = (surface.vertices.iter())
        .map(|p| cone.projection().project(p).map(|at| [0, 1].map(|k| at[k] - window.origin[k] as f64)))
        .collect();
    for t in &surface.triangles {
        if let [Some(a), Some(b), Some(c)] = t.map(|v| seen[v as usize]) {
            fill(&mut covered, w, h, a, b, c);
        }
    }
    let (mut both, mut either) = (0u64, 0u64);
    for row in 0..h {
        for column in 0..w {
            let at = [window.origin[0] + column, window.origin[1] + row];
            if !counts(at[0], at[1]) {
                continue;
            }
            let x = s.contains(at[0], at[1]);
            let y = covered[row * w + column];
            both += u64::from(x && y);
            either += u64::from(x || y);
        }
    }
    if either == 0 { 0.0 } else { both as f64 / either as f64 }
}

/// A rectangle of pixels.
struct Window {
    origin: [usize; 2],
    size: [usize; 2],
}

/// The part of the picture in which the silhouette and the triangles' pictures lie: of a large picture a few per
/// cent. The whole picture where a part of the triangles' box is behind the camera.
fn window(cone: &Cone, bounds: Option<&Aabb>) -> Window {
    let s = cone.silhouette();
    let whole = Window { origin: [0, 0], size: s.picture };
    let Some(bounds) = bounds else {
        return Window { origin: s.origin, size: s.size };
    };
    let mut corners = Vec::new();
    for corner in bounds.corners() {
        let Some(seen) = cone.projection().project(&corner) else { return whole };
        corners.push(seen);
    }
    let origin: [usize; 2] = std::array::from_fn(|k| {
        let low = corners.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min).floor();
        s.origin[k].min(low.max(0.0) as usize)
    });
    let size = std::array::from_fn(|k| {
        let high = corners.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max).ceil();
        let end = (s.origin[k] + s.size[k]).max((high.max(0.0) as usize).saturating_add(1));
        end.min(s.picture[k]) - origin[k]
    });
    Window { origin, size }
}

/// Marks the pixels whose centres lie in the triangle a b c. Most triangles are as small as a pixel, and lie behind another.
fn fill(covered: &mut [bool], w: usize, h: usize, a: [f64; 2], b: [f64; 2], c: [f64; 2]) {
    let range = |k: usize, n: usize| {
        let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
        // Rounded by conversions: `ceil` and `floor` are calls on the processors that programs are built for.
        let first = low.max(0.0) as usize;
        let first = first + usize::from((first as f64) < low);
        let end = if high < 0.0 { 0 } else { (high as usize).saturating_add(1) };
        first..end.min(n)
    };
    let (columns, rows) = (range(0, w), range(1, h));
    let cross =
        |p: [f64; 2], q: [f64; 2], x: f64, y: f64| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
    for row in rows {
        for column in columns.clone() {
            let pixel = &mut covered[row * w + column];
            if *pixel {
                continue;
            }
            let (x, y) = (column as f64, row as f64);
            let e = [cross(a, b, x, y), cross(b, c, x, y), cross(c, a, x, y)];
            *pixel = e.iter().all(|v| *v >= 0.0) || e.iter().all(|v| *v <= 0.0);
        }
    }
}

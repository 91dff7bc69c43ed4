//! Bounding box of the hull, by coarse carving before any grid exists.

use super::{Cone, HullError, cone::Side};
use crate::geometry::{Aabb, Point, Vector};
use nalgebra::{Matrix3, Vector3};

/// Cells along an edge of the coarse search.
const COARSE: usize = 48;
/// How often the search box may double before the hull counts as unbounded.
const DOUBLINGS: usize = 6;
/// How often the box is tightened.
const TIGHTENINGS: usize = 3;

/// The box of the hull, found by coarse carving: a cube about the point that the views look at, doubled until
/// the hull does not touch it, then tightened.
///
/// # Errors
/// [`HullError`] where there is no view, no common body, or no bound.
pub fn find_bounds(cones: &[Cone]) -> Result<Aabb, HullError> {
    if cones.is_empty() {
        return Err(HullError::NoViews);
    }
    let views = cones.len();
    let centers: Vec<[f64; 2]> = cones.iter().map(middle).collect();
    let focus = looked_at(cones, &centers).ok_or(HullError::Unbounded { views })?;
    let radius = (cones.iter())
        .filter_map(|c| {
            let s = c.silhouette();
            let half = 0.5 * (s.size[0] as f64).hypot(s.size[1] as f64);
            Some(half / c.projection().px_per_mm(&focus)?)
        })
        .fold(0.0, f64::max);
    let mut half = radius.max(f64::MIN_POSITIVE);
    let mut found = None;
    for _ in 0..DOUBLINGS {
        let cube = Aabb { min: focus, max: focus }.grown(half);
        let kept = carve_coarsely(cones, &cube).ok_or(HullError::Empty { views })?;
        let touches = (0..3).any(|k| kept.min[k] <= cube.min[k] || kept.max[k] >= cube.max[k]);
        if !touches {
            found = Some(kept);
            break;
        }
        half *= 2.0;
    }
    let mut bounds = found.ok_or(HullError::Unbounded { views })?;
    for _ in 0..TIGHTENINGS {
        bounds = carve_coarsely(cones, &bounds).ok_or(HullError::Empty { views })?;
    }
    Ok(bounds)
}

/// The middle of the silhouette's rectangle in the picture.
fn middle(c: &Cone) -> [f64; 2] {
    let s = c.silhouette();
    [s.origin[0] as f64 + 0.5 * s.size[0] as f64, s.origin[1] as f64 + 0.5 * s.size[1] as f64]
}

/// The point nearest (least squares) to the rays through the silhouettes' middles; `None` where the rays are
/// parallel, so that no such point is singled out.
fn looked_at(cones: &[Cone], middles: &[[f64; 2]]) -> Option<Point> {
    let mut a = Matrix3::zeros();
    let mut b = Vector3::zeros();
    for (c, m) in cones.iter().zip(middles) {
        let (p, d) = c.projection().line_of_sight(*m)?;
        let across = Matrix3::identity() - d * d.transpose();
        a += across;
        b += across * p.coords;
    }
    // One eigenvalue near zero: a single direction of view. Any point along it serves for a first box.
    let regularised = a + Matrix3::identity() * (1e-9 * a.trace());
    regularised.try_inverse().map(|inverse| Point::from(inverse * b))
}

/// The box of the coarse cells that no view removes, or `None` where all go.
///
/// Only cells that could make the box larger are tested: what lies within it already changes nothing.
fn carve_coarsely(cones: &[Cone], cube: &Aabb) -> Option<Aabb> {
    use rayon::prelude::*;
    let cell = cube.size() / COARSE as f64;
    let half = 0.5 * cell;
    let slabs: Vec<Option<[[usize; 2]; 2]>> = (0..COARSE)
        .into_par_iter()
        .map(|z| {
            // The view that removed the last cell often removes its neighbour too.
            let mut last = 0;
            let mut stays = |x: usize, y: usize| {
                let at = Vector::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5);
                let center = cube.min + at.component_mul(&cell);
                let removes = |c: &Cone| c.side_of_box(&center, &half) == Side::Outside;
                if removes(&cones[last]) {
                    return false;
                }
                match cones.iter().position(removes) {
                    Some(view) => last = view,
                    None => return true,
                }
                false
            };
            let mut kept: Option<[[usize; 2]; 2]> = None;
            for y in 0..COARSE {
                let [left, right] = kept.map_or([COARSE, 0], |[across, _]| across);
                let first = (0..left).find(|x| stays(*x, y));
                let right = right.max(first.map_or(0, |x| x + 1));
                let last = (right..COARSE).rev().find(|x| stays(*x, y));
                // Only the row's being there may still make the box larger.
                if first.is_some() || last.is_some() || (left..right).any(|x| stays(x, y)) {
                    let across = [first.unwrap_or(left), last.map_or(right, |x| x + 1)];
                    kept = Some([across, [kept.map_or(y, |k| k[1][0]), y + 1]]);
                }
            }
            kept
        })
        .collect();
    let mut bounds: Option<[[usize; 2]; 3]> = None;
    for (z, slab) in slabs.into_iter().enumerate() {
        let Some([x, y]) = slab else { continue };
        let own = [x, y, [z, z + 1]];
        bounds =
            Some(bounds.map_or(own, |b| [0, 1, 2].map(|k| [b[k][0].min(own[k][0]), b[k][1].max(own[k][1])])));
    }
    let b = bounds?;
    let corner = |end: usize| {
        let at = Vector::new(b[0][end] as f64, b[1][end] as f64, b[2][end] as f64);
        cube.min + at.component_mul(&cell)
    };
    Some(Aabb { min: corner(0), max: corner(1) })
}

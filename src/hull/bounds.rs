//! A box around the hull before any grid exists.

use super::{Cone, HullError, cone::Side};
use crate::geometry::{Aabb, Point, Projection, Vector};
use nalgebra::{Matrix3, Vector3};

/// Cells along an edge of the coarse search.
const COARSE: usize = 48;
/// How often the search box may double before the hull counts as unbounded.
const DOUBLINGS: usize = 6;
/// How often the box is tightened.
const TIGHTENINGS: usize = 3;

/// The box of the hull, found by coarse carving: a cube about the place that the views look at, doubled until
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

/// The place nearest (least squares) to the rays through the silhouettes' middles; `None` where the rays are
/// parallel, so that no such place is singled out.
fn looked_at(cones: &[Cone], middles: &[[f64; 2]]) -> Option<Point> {
    let mut a = Matrix3::zeros();
    let mut b = Vector3::zeros();
    for (c, m) in cones.iter().zip(middles) {
        let (p, d) = ray(c.projection(), *m)?;
        let across = Matrix3::identity() - d * d.transpose();
        a += across;
        b += across * p.coords;
    }
    // One eigenvalue near zero: a single direction of view. Any place along it serves for a first box.
    let regularised = a + Matrix3::identity() * (1e-9 * a.trace());
    regularised.try_inverse().map(|inverse| Point::from(inverse * b))
}

/// The ray through a pixel: a place on it and its unit direction.
fn ray(projection: &Projection, [u, v]: [f64; 2]) -> Option<(Point, Vector)> {
    let m = &projection.matrix;
    let plane = |row: usize, c: f64| {
        let r = m.row(row) - m.row(2) * c;
        (Vector::new(r[0], r[1], r[2]), r[3])
    };
    let ((n1, c1), (n2, c2)) = (plane(0, u), plane(1, v));
    let d = n1.cross(&n2);
    let length2 = d.norm_squared();
    if length2 == 0.0 || !length2.is_finite() {
        return None;
    }
    let p = (n2.cross(&d) * -c1 + d.cross(&n1) * -c2) / length2;
    Some((Point::from(p), d / length2.sqrt()))
}

/// The box of the coarse cells that no view removes, or `None` where all go.
fn carve_coarsely(cones: &[Cone], cube: &Aabb) -> Option<Aabb> {
    use rayon::prelude::*;
    let cell = cube.size() / COARSE as f64;
    let reach = 0.5 * cell.norm();
    let at = |i: usize, k: usize, add: f64| cube.min[k] + (i as f64 + add) * cell[k];
    let slabs: Vec<Option<Aabb>> = (0..COARSE)
        .into_par_iter()
        .map(|z| {
            let mut kept: Option<Aabb> = None;
            for y in 0..COARSE {
                for x in 0..COARSE {
                    let center = Point::new(at(x, 0, 0.5), at(y, 1, 0.5), at(z, 2, 0.5));
                    if cones.iter().any(|c| c.side_of_ball(&center, reach) == Side::Outside) {
                        continue;
                    }
                    let b = Aabb {
                        min: Point::new(at(x, 0, 0.0), at(y, 1, 0.0), at(z, 2, 0.0)),
                        max: Point::new(at(x + 1, 0, 0.0), at(y + 1, 1, 0.0), at(z + 1, 2, 0.0)),
                    };
                    kept = Some(kept.map_or(b, |k| Aabb { min: k.min.inf(&b.min), max: k.max.sup(&b.max) }));
                }
            }
            kept
        })
        .collect();
    slabs.into_iter().flatten().reduce(|a, b| Aabb { min: a.min.inf(&b.min), max: a.max.sup(&b.max) })
}

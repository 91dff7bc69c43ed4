//! Tangents of the grain's slices: at each height the lines of sight that touch it, seen from above.
//!
//! Before rays that are level, each view bounds a horizontal slice of the grain on both sides by a line of sight that
//! touches it. The lines of all views are tangents of the slice: they give its support function in twice as many
//! directions as there are views, and their polygon is the slice of the visual hull (where no view shows a gap).

use crate::geometry::{Aabb, Point, Projection, Vector};
use crate::hull::Cone;
use std::f64::consts::TAU;

/// Heights that are read, evenly over what all views share.
const ROWS: usize = 100;
/// Rows left out below and above, where the outline runs across them.
const LEFT_OUT: usize = 3;
/// Fewer rows than this do not show how a slice changes with the height.
const LEAST_ROWS: usize = 40;
/// Rays may rise by this much over their length and still count as level: over a grain's own depth a tangent then
/// belongs to a slice that is off by less than two hundredths of its diameter.
const MOST_ELEVATION: f64 = 0.035;
/// Neighbouring directions may be this many times as far apart as they are in the mean.
const MOST_UNEVEN: f64 = 2.0;
/// Directions nearer to one another than this share of the mean distance are the same.
const SAME: f64 = 0.25;
/// Fewer views than this show no curvature of a slice.
const LEAST_VIEWS: usize = 6;

/// Tangents of the grain's slices.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tangents {
    /// Height between rows, mm.
    pub pitch_mm: f64,
    /// For each row, from the lowest, the tangents in the order of their directions.
    pub rows: Vec<Vec<Tangent>>,
}

/// A line that touches a slice: the points p with `p·(cos a, sin a) = reach`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tangent {
    /// Direction of its normal out of the slice, radians.
    pub direction: f64,
    /// How far the slice reaches in that direction from the hull's middle, mm.
    pub reach_mm: f64,
}

impl Tangents {
    /// Reads the tangents of all views of a hull that lies in `hull`; `None` where the rays are not level, or the
    /// directions do not go evenly around, or too few heights show the grain in every view.
    pub(super) fn read(cones: &[Cone], hull: &Aabb) -> Option<Self> {
        use rayon::prelude::*;
        if cones.len() < LEAST_VIEWS {
            return None;
        }
        let middle = hull.center();
        let sights = cones.iter().map(|c| Sight::of(c.projection(), &middle)).collect::<Option<Vec<_>>>()?;
        // Both sides of each view, in the order of the directions.
        let mut sides: Vec<(usize, f64)> = (0..cones.len()).flat_map(|k| [(k, 1.0), (k, -1.0)]).collect();
        let direction = |(k, side): (usize, f64)| {
            let e = sights[k].right * side;
            e.y.atan2(e.x).rem_euclid(TAU)
        };
        sides.sort_by(|a, b| direction(*a).total_cmp(&direction(*b)));
        // Views from opposite sides touch the grain along the same lines: one of them is kept.
        let near = SAME * TAU / sides.len() as f64;
        let mut kept = f64::NEG_INFINITY;
        sides.retain(|side| {
            let other = direction(*side) - kept > near;
            kept = if other { direction(*side) } else { kept };
            other
        });
        let even = TAU / sides.len() as f64;
        let gap = |i: usize| {
            let next = sides[(i + 1) % sides.len()];
            (direction(next) - direction(sides[i])).rem_euclid(TAU)
        };
        if (0..sides.len()).any(|i| gap(i) > MOST_UNEVEN * even) {
            return None;
        }
        let half = 0.5 * hull.size().xy().norm() * 1.05;
        let pitch_mm = hull.size().z / ROWS as f64;
        let rows: Vec<Option<Vec<Tangent>>> = (LEFT_OUT..ROWS - LEFT_OUT)
            .into_par_iter()
            .map(|row| {
                let z = hull.min.z + (row as f64 + 0.5) * pitch_mm;
                let tangents = sides
                    .iter()
                    .map(|&(k, side)| sights[k].touch(&cones[k], &middle, z, half, side))
                    .collect::<Option<Vec<_>>>()?;
                let n = tangents.len();
                let turns = |i: usize| tangents[(i + 1) % n].direction - tangents[i].direction;
                let ascending = (0..n).all(|i| {
                    let by = turns(i).rem_euclid(TAU);
                    by > 1e-6 && by < 2.0 * MOST_UNEVEN * even
                });
                ascending.then_some(tangents)
            })
            .collect();
        // One run of neighbouring rows: the heights at which every view shows the grain.
        let mut runs: Vec<Vec<Vec<Tangent>>> = vec![Vec::new()];
        for row in rows {
            match row {
                Some(row) => runs.last_mut()?.push(row),
                None => runs.push(Vec::new()),
            }
        }
        let rows = runs.into_iter().max_by_key(Vec::len).filter(|rows| rows.len() >= LEAST_ROWS)?;
        Some(Self { pitch_mm, rows })
    }
}

/// How a view lies in the plan.
struct Sight {
    /// Level, across the ray through the hull's middle, to the right or the left.
    right: Vector,
    /// The centre of projection; `None` where the rays are parallel.
    centre: Option<Point>,
    /// Direction of the ray through the hull's middle.
    ray: Vector,
    /// The step along `right` that moves the picture by a pixel, mm.
    mm_per_px: f64,
}

impl Sight {
    fn of(camera: &Projection, middle: &Point) -> Option<Self> {
        let m = &camera.matrix;
        let row = |i: usize| Vector::new(m[(i, 0)], m[(i, 1)], m[(i, 2)]);
        let (ray, centre) = if camera.is_orthographic() {
            (row(0).cross(&row(1)), None)
        } else {
            let left = m.fixed_view::<3, 3>(0, 0).into_owned();
            let centre = Point::from(-(left.try_inverse()? * m.column(3)));
            (middle - centre, Some(centre))
        };
        let ray = ray.try_normalize(0.0)?;
        let right = Vector::new(ray.y, -ray.x, 0.0).try_normalize(0.0)?;
        (ray.z.abs() <= MOST_ELEVATION).then_some(())?;
        let mm_per_px = 1.0 / camera.px_per_mm(middle)?;
        Some(Self { right, centre, ray, mm_per_px })
    }

    /// The tangent on one side (±1 of `right`) at a height; `None` where the view shows nothing there.
    fn touch(&self, cone: &Cone, middle: &Point, z: f64, half_mm: f64, side: f64) -> Option<Tangent> {
        let foot = Point::new(middle.x, middle.y, z);
        let point = |u: f64| foot + self.right * (side * u);
        let at = |u: f64| {
            let d = cone.projection().project(&point(u)).map(|q| cone.silhouette().signed_distance_px(q));
            d.unwrap_or(f64::INFINITY)
        };
        // From outside inwards; the distance is a lower bound of how far the outline is.
        let (mut u, mut d) = (half_mm, at(half_mm));
        let crossing = loop {
            let next = u - (0.8 * d - 0.75).max(0.5) * self.mm_per_px;
            if next < -half_mm || d < 0.0 {
                return None;
            }
            let e = at(next);
            if e < 0.0 {
                let (mut a, mut b) = ((next, e), (u, d));
                for _ in 0..4 {
                    let x = a.0 + (b.0 - a.0) * a.1 / (a.1 - b.1);
                    let m = at(x);
                    if m < 0.0 { a = (x, m) } else { b = (x, m) }
                }
                break a.0 + (b.0 - a.0) * a.1 / (a.1 - b.1);
            }
            (u, d) = (next, e);
        };
        let touched = point(crossing);
        let ray = self.centre.map_or(self.ray, |c| touched - c);
        let normal = Vector::new(ray.y, -ray.x, 0.0).try_normalize(0.0)?;
        let normal = if normal.dot(&self.right) * side > 0.0 { normal } else { -normal };
        Some(Tangent { direction: normal.y.atan2(normal.x), reach_mm: normal.dot(&(touched - foot)) })
    }
}

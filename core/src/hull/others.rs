//! What the other views leave of the grain, seen from one: where its outline may lie.

use super::Cone;
use crate::geometry::{Aabb, Point, Projection, Vector};
use crate::silhouette::{HeldByOthers, Silhouette};
use rayon::prelude::*;

/// Cells along the longer side of the silhouette's rectangle, at most about so many.
const CELLS: usize = 128;
/// The shortest step along a line of sight, as a share of a cell.
const LEAST_STEP: f64 = 0.5;

/// In which cells of a view's picture, within its silhouette's rectangle, the lines of sight pass through what all of the `others`
/// but so many hold. Costs a few readings of all others' distances for each cell outside the silhouette.
///
/// One view that has lost a part of the grain says that nothing is there, and so may the one beside it: `but` views may be wrong.
pub fn held_by_others(
    others: &[&Cone],
    (projection, silhouette): (&Projection, &Silhouette),
    bounds: &Aabb,
    but: usize,
) -> HeldByOthers {
    let pitch = (silhouette.size[0].max(silhouette.size[1]) / CELLS).max(1);
    let size = silhouette.size.map(|n| n.div_ceil(pitch));
    let scale = projection.px_per_mm(&bounds.center()).unwrap_or(1.0);
    let step = LEAST_STEP * pitch as f64 / scale;
    let cells = (0..size[0] * size[1])
        .into_par_iter()
        .map(|k| {
            let at = [k % size[0], k / size[0]];
            let pixel = [0, 1].map(|axis| (silhouette.origin[axis] + at[axis] * pitch) as f64);
            if silhouette.signed_distance_px(pixel) <= 0.0 {
                return true;
            }
            let Some((start, direction)) = projection.line_of_sight(pixel) else { return false };
            let Some([first, last]) = within(bounds, &start, &direction) else { return false };
            let mut t = first;
            while t <= last {
                let away = outside(others, &(start + direction * t), but);
                if away <= 0.0 {
                    return true;
                }
                t += away.max(step);
            }
            false
        })
        .collect();
    HeldByOthers { origin: silhouette.origin, pitch, size, cells }
}

/// How far a point is at least from what all views but so many hold, mm; not positive where they hold it.
fn outside(cones: &[&Cone], p: &Point, but: usize) -> f64 {
    let mut most = vec![f64::NEG_INFINITY; but + 1];
    for cone in cones {
        let mut value = cone.value_mm(p);
        for kept in &mut most {
            if value > *kept {
                std::mem::swap(kept, &mut value);
            }
        }
    }
    most[but]
}

/// Between which places of a line, mm from its start, it is in a box.
fn within(bounds: &Aabb, start: &Point, direction: &Vector) -> Option<[f64; 2]> {
    let (mut first, mut last) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        let ends = [bounds.min[k], bounds.max[k]].map(|end| (end - start[k]) / direction[k]);
        if direction[k] == 0.0 {
            if start[k] < bounds.min[k] || start[k] > bounds.max[k] {
                return None;
            }
            continue;
        }
        first = first.max(ends[0].min(ends[1]));
        last = last.min(ends[0].max(ends[1]));
    }
    (first <= last && first.is_finite() && last.is_finite()).then_some([first, last])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use nalgebra::Matrix3x4;
    use std::sync::Arc;

    /// A ball of 40 px seen from 24 sides; some views have lost its right side.
    fn cones(bitten: &[usize]) -> Vec<Cone> {
        let size = 121;
        (0..24)
            .map(|k| {
                let coverage: Vec<f32> = (0..size * size)
                    .map(|at| {
                        let (u, v) = ((at % size) as f64 - 60.0, (at / size) as f64 - 60.0);
                        let is_lost = bitten.contains(&k) && u > 20.0;
                        if is_lost { 0.0 } else { (40.0 - u.hypot(v) + 0.5).clamp(0.0, 1.0) as f32 }
                    })
                    .collect();
                let (sin, cos) = Angle::from_deg(7.5 * k as f64).rad().sin_cos();
                let matrix = Matrix3x4::new(cos, -sin, 0.0, 60.0, 0.0, 0.0, -1.0, 60.0, 0.0, 0.0, 0.0, 1.0);
                let s = Silhouette::of_coverage([size, size], &coverage).unwrap();
                Cone::new(Projection::new(matrix), Arc::new(s))
            })
            .collect()
    }

    #[test]
    fn what_one_view_has_lost_the_others_hold_and_no_more() {
        let bounds = Aabb { min: Point::new(-45.0, -45.0, -45.0), max: Point::new(45.0, 45.0, 45.0) };
        for (bitten, but, is_found) in
            [(&[7][..], 0, true), (&[7, 8], 0, false), (&[7, 8], 1, true), (&[7, 8, 9], 1, false)]
        {
            let all = cones(bitten);
            let others: Vec<&Cone> =
                all.iter().enumerate().filter(|(k, _)| *k != 7).map(|(_, c)| c).collect();
            let held = held_by_others(&others, (all[7].projection(), all[7].silhouette()), &bounds, but);
            // Half-way between the lost side's edge and the ball's outline; inside; beyond the outline.
            assert_eq!(held.holds(60 + 36, 60), is_found, "{bitten:?} {but}");
            assert!(held.holds(50, 60));
            assert!(!held.holds(60 + 44, 60) && !held.holds(16, 60));
            assert!(!held.holds(0, 0) && !held.holds(5000, 60));
        }
    }
}

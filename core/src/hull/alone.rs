//! What one view alone carves away: the sign of a silhouette that is too small.
//!
//! A hull is an intersection: one bad silhouette ruins it. Of what views carve away nearly all is carved away by several of
//! them; what a single one takes is the strip between its outline and that of the hull of the others, as narrow as the views
//! are close. A silhouette from which a part was cut takes a bite.

use super::Cone;
use crate::geometry::{Aabb, Point};
use rayon::prelude::*;
use serde::Serialize;

/// Of the points that a view alone takes away the depth below which this share of them lies.
const DEEP: f64 = 0.95;

/// What a view alone takes away.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CarvedAlone {
    /// Volume that only this view takes away, over that of the hull.
    pub share: f64,
    /// How far from its outline that reaches (95 of 100 points of it), pixels.
    pub depth_px: f64,
}

/// What each view alone takes away within a box, on a grid of this many points along its longest edge. Costs a few views'
/// distances for each point outside and all views' for each inside.
pub fn carved_alone(cones: &[Cone], bounds: &Aabb, points: usize) -> Vec<CarvedAlone> {
    let size = bounds.size();
    let pitch = size.max() / points.max(1) as f64;
    let count = [size.x, size.y, size.z].map(|edge| ((edge / pitch).ceil() as usize).max(1));
    let distance = |cone: &Cone, p: &Point| {
        cone.projection().project(p).map_or(f64::INFINITY, |q| cone.silhouette().signed_distance_px(q))
    };
    // Planes of the grid side by side, put together in their order.
    let planes: Vec<(usize, Vec<Vec<f32>>)> = (0..count[2])
        .into_par_iter()
        .map(|k| {
            let mut inside = 0;
            let mut alone = vec![Vec::new(); cones.len()];
            for j in 0..count[1] {
                for i in 0..count[0] {
                    let at = |axis: usize, n: usize| bounds.min[axis] + (n as f64 + 0.5) * pitch;
                    let p = Point::new(at(0, i), at(1, j), at(2, k));
                    let mut taken = None;
                    let mut others = 0;
                    for (view, cone) in cones.iter().enumerate() {
                        let d = distance(cone, &p);
                        if d > 0.0 {
                            others += 1;
                            taken = Some((view, d));
                            if others > 1 {
                                break;
                            }
                        }
                    }
                    match (others, taken) {
                        (0, _) => inside += 1,
                        (1, Some((view, d))) => alone[view].push(d as f32),
                        _ => {}
                    }
                }
            }
            (inside, alone)
        })
        .collect();
    let inside: usize = planes.iter().map(|(inside, _)| inside).sum();
    (0..cones.len())
        .map(|view| {
            let mut depths: Vec<f32> =
                planes.iter().flat_map(|(_, alone)| alone[view].iter().copied()).collect();
            depths.sort_by(f32::total_cmp);
            let deep = depths.get((DEEP * depths.len() as f64) as usize).copied().unwrap_or(0.0);
            CarvedAlone { share: depths.len() as f64 / inside.max(1) as f64, depth_px: deep.into() }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Angle, Projection};
    use crate::silhouette::Silhouette;
    use nalgebra::Matrix3x4;
    use std::sync::Arc;

    /// A ball of 40 px seen from twelve sides; in one view a bite is missing.
    fn cones(bitten: usize) -> Vec<Cone> {
        let size = 121;
        let coverage = |bite: bool| -> Vec<f32> {
            let inside = |x: usize, y: usize| {
                let (u, v) = (x as f64 - 60.0, y as f64 - 60.0);
                let ball = (40.0 - u.hypot(v) + 0.5).clamp(0.0, 1.0);
                if bite && u > 25.0 && v.abs() < 15.0 { 0.0 } else { ball }
            };
            (0..size * size).map(|k| inside(k % size, k / size) as f32).collect()
        };
        (0..12)
            .map(|k| {
                let (sin, cos) = Angle::from_deg(15.0 * f64::from(k)).rad().sin_cos();
                let matrix = Matrix3x4::new(cos, -sin, 0.0, 60.0, 0.0, 0.0, -1.0, 60.0, 0.0, 0.0, 0.0, 1.0);
                let s = Silhouette::of_coverage([size, size], &coverage(k as usize == bitten)).unwrap();
                Cone::new(Projection::new(matrix), Arc::new(s))
            })
            .collect()
    }

    #[test]
    fn the_view_with_a_bite_takes_most_alone_and_deepest() {
        let bounds = Aabb { min: Point::new(-45.0, -45.0, -45.0), max: Point::new(45.0, 45.0, 45.0) };
        let all = carved_alone(&cones(5), &bounds, 60);
        for (view, one) in all.iter().enumerate() {
            if view == 5 {
                assert!(one.share > 0.02 && one.depth_px > 8.0, "{one:?}");
            } else {
                assert!(one.share < 0.006 && one.depth_px < 3.0, "{view}: {one:?}");
            }
        }
    }
}

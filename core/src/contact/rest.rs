//! Stable rest of a rigid body on a level plate: it rolls over its lowest points until its centre of mass is above what it
//! stands on.

use crate::geometry::{Point, Vector};
use nalgebra::{Rotation3, Unit};

/// Turns after which a body that still rolls is called a ball; each lowers the centre of mass.
const MOST_TURNS: usize = 10_000;
/// Heights that differ by less than this share of the body's size are one.
const LEVEL: f64 = 1e-9;

/// The rotation that brings the points of a body into a stable rest on a level plate below, from how they lie: it rolls over
/// the lowest point, then over edges, as a body does that is let down slowly and does not slide.
///
/// Only corners of the convex hull can touch, which need not be known: each turn goes as far as the next point reaches the
/// plate. Cost: the number of points for each turn. Where two points or one carry the centre exactly, the rest is unstable
/// and left as it is.
pub fn rotation(points: &[Point], center: &Point) -> Rotation3<f64> {
    let mut turned = Rotation3::identity();
    let mut rays: Vec<Vector> = points.iter().map(|p| p - center).collect();
    let size = rays.iter().map(Vector::norm).fold(0.0, f64::max);
    for _ in 0..MOST_TURNS {
        let low = rays.iter().map(|r| r.z).fold(f64::INFINITY, f64::min);
        let feet: Vec<Vector> = rays.iter().filter(|r| r.z - low < LEVEL * size).copied().collect();
        let Some((pivot, axis)) = tips_over(&feet, size) else { break };
        let Some(angle) = next_touch(&rays, &pivot, &axis, size) else { break };
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle);
        for r in &mut rays {
            *r = turn * *r;
        }
        turned = turn * turned;
    }
    turned
}

/// About which point and level axis a body on these feet tips, its centre being at the origin; none where it stands.
fn tips_over(feet: &[Vector], size: f64) -> Option<(Vector, Vector)> {
    // The side of the feet's convex hull (seen from above) that is nearest to the centre, with the centre outside it.
    let nearest = nearest_on_hull(feet);
    let away = Vector::new(nearest.x, nearest.y, 0.0);
    if away.norm() <= LEVEL * size {
        return None;
    }
    // Turning about z × (centre − foot) lowers the centre.
    Some((nearest, Vector::z().cross(&-away)))
}

/// The point of the feet's convex hull, seen from above, that is nearest to the origin.
pub(super) fn nearest_on_hull(feet: &[Vector]) -> Vector {
    let hull = hull_from_above(feet);
    let side = |a: &Vector, b: &Vector| a.x * b.y - a.y * b.x;
    let edges = || hull.iter().zip(hull.iter().cycle().skip(1));
    if hull.len() > 2 && edges().all(|(a, b)| side(a, b) >= 0.0) {
        return Vector::new(0.0, 0.0, hull[0].z);
    }
    edges()
        .map(|(a, b)| {
            let along = b - a;
            let length2 = along.x * along.x + along.y * along.y;
            let t = -(a.x * along.x + a.y * along.y) / length2;
            a + along * if length2 > 0.0 { t.clamp(0.0, 1.0) } else { 0.0 }
        })
        .min_by(|a, b| a.x.hypot(a.y).total_cmp(&b.x.hypot(b.y)))
        .unwrap_or(hull[0])
}

/// The corners of the convex hull seen from above, counter-clockwise (Andrew's monotone chain).
fn hull_from_above(feet: &[Vector]) -> Vec<Vector> {
    let mut sorted = feet.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    if sorted.len() < 3 {
        return sorted;
    }
    let mut hull: Vec<Vector> = Vec::new();
    for half in 0..2 {
        let start = hull.len();
        for p in &sorted {
            while hull.len() >= start + 2 {
                let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (b - a).cross(&(p - b)).z > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(*p);
        }
        // The last corner begins the other half.
        hull.pop();
        if half == 0 {
            sorted.reverse();
        }
    }
    if hull.is_empty() { vec![sorted[0]] } else { hull }
}

/// The angle about this axis through the pivot after which another point is as low as the pivot.
fn next_touch(rays: &[Vector], pivot: &Vector, axis: &Vector, size: f64) -> Option<f64> {
    let axis = axis.normalize();
    let ahead = axis.cross(&Vector::z());
    rays.iter()
        .filter_map(|r| {
            let from = r - pivot;
            // Seen along the axis: forwards and height. A turn by −atan2 brings the point level with the pivot.
            let (forward, height) = (from.dot(&ahead), from.z);
            if forward.hypot(height) < LEVEL * size {
                return None;
            }
            let angle = height.atan2(forward);
            // On the plate behind the pivot, or so close to it that it is a foot already.
            (angle > 1e-9 && angle < std::f64::consts::PI - 1e-9).then_some(angle)
        })
        .min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(size: [f64; 3]) -> Vec<Point> {
        (0..8)
            .map(|i| {
                Point::new(
                    size[0] * f64::from(i & 1),
                    size[1] * f64::from(i >> 1 & 1),
                    size[2] * f64::from(i >> 2 & 1),
                )
            })
            .collect()
    }

    fn middle(p: &[Point]) -> Point {
        Point::from(p.iter().fold(Vector::zeros(), |s, p| s + p.coords) / p.len() as f64)
    }

    fn lowest(points: &[Point], turn: &Rotation3<f64>) -> Vec<usize> {
        let z: Vec<f64> = points.iter().map(|p| (turn * p).z).collect();
        let low = z.iter().copied().fold(f64::INFINITY, f64::min);
        (0..z.len()).filter(|&i| z[i] - low < 1e-6).collect()
    }

    #[test]
    fn a_block_that_stands_stays_and_a_tilted_one_falls_on_the_side_it_leans_to() {
        let block = cuboid([1.0, 2.0, 3.0]);
        assert!(rotation(&block, &middle(&block)).angle() < 1e-12);
        // The diagonal of the side view leans by atan(2/3) = 33.7°: beyond it the block falls on its broad side.
        for (tilt_deg, feet) in [(5.0, vec![0, 1, 2, 3]), (50.0, vec![2, 3, 6, 7])] {
            let tilt = Rotation3::from_euler_angles(f64::to_radians(-tilt_deg), 0.0, 0.0)
                * Rotation3::from_euler_angles(0.0, 0.01, 0.0);
            let tilted: Vec<Point> = block.iter().map(|p| tilt * p).collect();
            let turn = rotation(&tilted, &middle(&tilted));
            let found = lowest(&tilted, &turn);
            assert_eq!(found, feet, "{tilt_deg}");
        }
    }

    #[test]
    fn an_ellipsoid_comes_to_lie_on_its_flat_side() {
        let mut points = Vec::new();
        for i in 0..40 {
            for j in 0..80 {
                let (t, f) = (0.02 + f64::from(i) * 3.1 / 40.0, f64::from(j) * std::f64::consts::TAU / 80.0);
                points.push(Point::new(1.0 * t.sin() * f.cos(), 0.8 * t.sin() * f.sin(), 0.4 * t.cos()));
            }
        }
        let tilt = Rotation3::from_euler_angles(1.1, 0.4, 0.2);
        let tilted: Vec<Point> = points.iter().map(|p| tilt * p).collect();
        let turn = rotation(&tilted, &middle(&tilted));
        let low = tilted.iter().map(|p| (turn * (p - middle(&tilted))).z).fold(f64::INFINITY, f64::min);
        assert!((low + 0.4).abs() < 0.02, "{low}");
    }
}

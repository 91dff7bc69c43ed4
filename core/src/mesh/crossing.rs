//! Self-intersection of a surface, by exact predicates.

use super::solid::Solid;
use crate::geometry::Point;
use rayon::prelude::*;
use robust::{Coord3D, orient3d};

/// On which side of the plane of a triangle a point lies: the sign is exact (Shewchuk 1997).
fn side([a, b, c]: &[Point; 3], d: &Point) -> f64 {
    let [a, b, c, d] = [a, b, c, d].map(|p| Coord3D { x: p.x, y: p.y, z: p.z });
    orient3d(a, b, c, d)
}

/// Whether an edge passes through the inside of a triangle; what only touches its border or lies in its plane does not.
fn pierces(triangle: &[Point; 3], p: &Point, q: &Point) -> bool {
    let (u, v) = (side(triangle, p), side(triangle, q));
    if !(u > 0.0 && v < 0.0 || u < 0.0 && v > 0.0) {
        return false;
    }
    let [a, b, c] = triangle;
    let turns = [(a, b), (b, c), (c, a)].map(|(s, t)| side(&[*p, *q, *s], t));
    turns.iter().all(|s| *s > 0.0) || turns.iter().all(|s| *s < 0.0)
}

/// Whether two triangles cut one another.
fn cross(s: &[Point; 3], t: &[Point; 3]) -> bool {
    (0..3).any(|k| pierces(s, &t[k], &t[(k + 1) % 3]) || pierces(t, &s[k], &s[(k + 1) % 3]))
}

impl Solid {
    /// Two triangles of the surface that cut one another, if there are any: the first, and the least that it cuts. Such a
    /// surface has no inside. Exact for triangles that cut through; two that lie in one plane, one over the other, are
    /// found where they have the same three corners.
    pub fn crossing(&self) -> Option<[usize; 2]> {
        let surface = self.surface();
        (0..surface.triangles.len()).into_par_iter().find_map_first(|t| {
            let own = surface.corners(t);
            let mut other: Option<usize> = None;
            self.each_near(&own, &mut |u| {
                if u > t && other.is_none_or(|o| u < o) {
                    let shared =
                        surface.triangles[u].iter().filter(|v| surface.triangles[t].contains(v)).count();
                    let folded = shared == 3;
                    if folded || cross(&own, &surface.corners(u)) {
                        other = Some(u);
                    }
                }
            });
            other.map(|u| [t, u])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TriangleMesh;

    /// Two tetrahedra, the second moved by `by`.
    fn two(by: f64) -> Solid {
        let one = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        let mut vertices: Vec<Point> = one.map(Point::from).to_vec();
        vertices.extend(one.map(|p| Point::from(p.map(|x| x + by))));
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let mut triangles = faces.to_vec();
        triangles.extend(faces.map(|f| f.map(|v: u32| v + 4)));
        Solid::new(TriangleMesh { vertices, triangles }).unwrap()
    }

    #[test]
    fn bodies_that_overlap_cut_one_another_and_those_apart_do_not() {
        assert!(two(0.1).crossing().is_some());
        assert_eq!(two(2.0).crossing(), None);
        // The corner of one goes through the slanted face of the other.
        assert_eq!(two(0.3).crossing().map(|c| c[0]), Some(2));
    }
}

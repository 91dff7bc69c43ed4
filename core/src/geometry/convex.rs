//! The convex hull of points in space.
//!
//! Quickhull (Barber, Dobkin and Huhdanpaa, ACM Trans. Math. Softw. 22, 469, 1996) with exact orientation tests (Shewchuk,
//! Discrete Comput. Geom. 18, 305, 1997): points of one plane, or nearly so, give the facets that they have, and no others.

use super::{Point, Vector};
use robust::{Coord3D, orient3d};
use std::collections::HashMap;

/// Places along a direction that differ by less, over the distance from the origin, may be the same.
const ROUNDING: f64 = 1e-12;

/// A convex polyhedron: triangles, each with its neighbours.
///
/// A flat side with more than three corners has several triangles, in one plane; some of their corners may lie in the middle
/// of the side.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexHull {
    /// The corners, mm.
    pub vertices: Vec<Point>,
    /// The corners of each facet, counter-clockwise seen from outside.
    pub facets: Vec<[u32; 3]>,
    /// The facet across the side that begins at each corner.
    pub beside: Vec<[u32; 3]>,
    /// For each vertex where its neighbours begin in `neighbours`.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    /// For each vertex one of its facets.
    facet_at: Vec<u32>,
}

impl ConvexHull {
    /// The hull of these points; none where all of them lie in one plane, or one is no number. Cost: about n log n.
    pub fn new(points: &[Point]) -> Option<Self> {
        if points.iter().any(|p| !p.iter().all(|c| c.is_finite())) {
            return None;
        }
        let mut growing = Growing::new(points)?;
        while let Some(facet) = growing.with_outside.pop() {
            growing.reach_out(facet);
        }
        Some(growing.finish())
    }

    /// The same hull with this point at the origin.
    #[must_use]
    pub fn about(mut self, center: &Point) -> Self {
        self.vertices.iter_mut().for_each(|p| *p -= center.coords);
        self
    }

    /// The vertices that an edge joins to this one.
    pub fn neighbours(&self, vertex: u32) -> &[u32] {
        &self.neighbours[self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize]
    }

    /// A vertex that lies farthest in a direction, found from another one. Cost: about the square root of the number of vertices.
    ///
    /// It walks to whichever neighbour lies farther. In the middle of a flat side none may, and yet the side looks the other way: so
    /// where neighbours lie as far as the vertex itself, theirs are looked at too.
    pub fn farthest(&self, direction: &Vector, from: u32) -> u32 {
        let reach = |v: u32| self.vertices[v as usize].coords.dot(direction);
        // As far as the farthest so far, one after the other.
        let mut level = vec![from];
        let mut next = 0;
        while let Some(&at) = level.get(next) {
            next += 1;
            let far = reach(level[0]);
            let as_far = ROUNDING * self.vertices[at as usize].coords.norm() * direction.norm();
            for &v in self.neighbours(at) {
                let ahead = reach(v) - far;
                if ahead > as_far {
                    level = vec![v];
                    next = 0;
                    break;
                }
                if ahead >= -as_far && !level.contains(&v) {
                    level.push(v);
                }
            }
        }
        level[0]
    }

    /// The facets on both sides of the edge between two vertices; the same one twice where there is no such edge.
    pub fn facets_of_edge(&self, a: u32, b: u32) -> [u32; 2] {
        let from = self.facet_at[a as usize];
        let mut at = from;
        loop {
            let side = self.facets[at as usize].iter().position(|v| *v == a).unwrap_or(0);
            if self.facets[at as usize][(side + 1) % 3] == b {
                return [at, self.beside[at as usize][side]];
            }
            // Round the vertex, over the side that ends at it.
            at = self.beside[at as usize][(side + 2) % 3];
            if at == from {
                return [from; 2];
            }
        }
    }

    /// A facet that has this vertex.
    pub fn facet_at(&self, vertex: u32) -> u32 {
        self.facet_at[vertex as usize]
    }

    /// The outward unit normal of a facet.
    pub fn normal(&self, facet: usize) -> Vector {
        let [a, b, c] = self.facets[facet].map(|v| self.vertices[v as usize]);
        (b - a).cross(&(c - a)).normalize()
    }
}

/// A facet of a hull that still grows.
#[derive(Debug, Clone)]
struct Facet {
    corners: [u32; 3],
    beside: [u32; 3],
    /// Points that lie outside of it, and of no facet before it.
    outside: Vec<u32>,
    alive: bool,
}

struct Growing<'a> {
    points: &'a [Point],
    facets: Vec<Facet>,
    with_outside: Vec<u32>,
}

impl<'a> Growing<'a> {
    /// A tetrahedron of four points that are far apart.
    fn new(points: &'a [Point]) -> Option<Self> {
        let farthest = |measure: &dyn Fn(&Point) -> f64| {
            let far = (points.iter().enumerate()).max_by(|a, b| measure(a.1).total_cmp(&measure(b.1)))?;
            (measure(far.1) > 0.0).then_some(far.0)
        };
        let first = *points.first()?;
        let a = farthest(&|p| (p - first).norm_squared())?;
        let pa = points[a];
        let b = farthest(&|p| (p - pa).norm_squared())?;
        let along = points[b] - pa;
        let c = farthest(&|p| along.cross(&(p - pa)).norm_squared())?;
        let pc = points[c];
        let d = farthest(&|p| above(&pa, &points[b], &pc, p).abs())?;
        let [mut b, mut c] = [b as u32, c as u32];
        let (a, d) = (a as u32, d as u32);
        if above(&pa, &points[b as usize], &points[c as usize], &points[d as usize]) > 0.0 {
            (b, c) = (c, b);
        }
        // The fourth is below the first three, as seen from outside.
        let corners = [[a, b, c], [a, d, b], [b, d, c], [c, d, a]];
        let beside = [[1, 2, 3], [3, 2, 0], [1, 3, 0], [2, 1, 0]];
        let facets = (corners.into_iter().zip(beside))
            .map(|(corners, beside)| Facet { corners, beside, outside: Vec::new(), alive: true })
            .collect();
        let mut growing = Self { points, facets, with_outside: Vec::new() };
        growing.share_out((0..points.len() as u32).collect(), 0);
        Some(growing)
    }

    /// How far a point is outside of a facet, over the facet's size; above zero exactly where it is outside.
    fn outside(&self, facet: u32, point: u32) -> f64 {
        let [a, b, c] = self.facets[facet as usize].corners.map(|v| &self.points[v as usize]);
        above(a, b, c, &self.points[point as usize])
    }

    /// Gives points to the facets from this one on that they lie outside of; those outside of none are in the hull.
    fn share_out(&mut self, points: Vec<u32>, from: u32) {
        for p in points {
            if let Some(f) = (from..self.facets.len() as u32).find(|&f| self.outside(f, p) > 0.0) {
                self.facets[f as usize].outside.push(p);
            }
        }
        let new = from..self.facets.len() as u32;
        self.with_outside.extend(new.filter(|f| !self.facets[*f as usize].outside.is_empty()));
    }

    /// Takes the farthest of a facet's points in: all facets that it lies outside of give way to new ones from their rim to it.
    fn reach_out(&mut self, facet: u32) {
        if !self.facets[facet as usize].alive {
            return;
        }
        let far = (self.facets[facet as usize].outside.iter())
            .max_by(|a, b| self.outside(facet, **a).total_cmp(&self.outside(facet, **b)));
        let Some(&far) = far else { return };
        let (mut seen, mut rim, mut freed) = (vec![facet], Vec::new(), Vec::new());
        self.facets[facet as usize].alive = false;
        let mut next = 0;
        while let Some(&f) = seen.get(next) {
            next += 1;
            freed.append(&mut self.facets[f as usize].outside);
            for side in 0..3 {
                let other = self.facets[f as usize].beside[side];
                if !self.facets[other as usize].alive {
                    continue;
                }
                if self.outside(other, far) > 0.0 {
                    self.facets[other as usize].alive = false;
                    seen.push(other);
                } else {
                    let corners = self.facets[f as usize].corners;
                    rim.push((corners[side], corners[(side + 1) % 3], other));
                }
            }
        }
        let first = self.facets.len() as u32;
        let begins: HashMap<u32, u32> =
            rim.iter().enumerate().map(|(k, (a, _, _))| (*a, first + k as u32)).collect();
        let ends: HashMap<u32, u32> =
            rim.iter().enumerate().map(|(k, (_, b, _))| (*b, first + k as u32)).collect();
        for (k, &(a, b, other)) in rim.iter().enumerate() {
            let new = first + k as u32;
            let old = &mut self.facets[other as usize];
            // The side of the neighbour runs the other way round.
            if let Some(side) = (0..3).find(|&s| old.corners[s] == b && old.corners[(s + 1) % 3] == a) {
                old.beside[side] = new;
            }
            let beside = [other, begins[&b], ends[&a]];
            self.facets.push(Facet { corners: [a, b, far], beside, outside: Vec::new(), alive: true });
        }
        freed.retain(|p| *p != far);
        self.share_out(freed, first);
    }

    /// The facets that are left, with their vertices numbered anew.
    fn finish(self) -> ConvexHull {
        let mut facet_of = vec![u32::MAX; self.facets.len()];
        let mut vertex_of: HashMap<u32, u32> = HashMap::new();
        let mut vertices = Vec::new();
        let alive: Vec<usize> = (0..self.facets.len()).filter(|f| self.facets[*f].alive).collect();
        alive.iter().enumerate().for_each(|(k, f)| facet_of[*f] = k as u32);
        let facets: Vec<[u32; 3]> = (alive.iter())
            .map(|f| {
                self.facets[*f].corners.map(|p| {
                    *vertex_of.entry(p).or_insert_with(|| {
                        vertices.push(self.points[p as usize]);
                        vertices.len() as u32 - 1
                    })
                })
            })
            .collect();
        let beside = alive.iter().map(|f| self.facets[*f].beside.map(|o| facet_of[o as usize])).collect();
        // Every edge lies between two facets and so is met once from each end.
        let mut starts = vec![0u32; vertices.len() + 1];
        facets.iter().flatten().for_each(|v| starts[*v as usize + 1] += 1);
        (0..vertices.len()).for_each(|v| starts[v + 1] += starts[v]);
        let mut filled = starts.clone();
        let mut neighbours = vec![0; 3 * facets.len()];
        for corners in &facets {
            for side in 0..3 {
                let place = &mut filled[corners[side] as usize];
                neighbours[*place as usize] = corners[(side + 1) % 3];
                *place += 1;
            }
        }
        let mut facet_at = vec![0; vertices.len()];
        facets.iter().enumerate().for_each(|(f, c)| c.iter().for_each(|v| facet_at[*v as usize] = f as u32));
        ConvexHull { vertices, facets, beside, starts, neighbours, facet_at }
    }
}

/// Above zero exactly where a point lies on the side of a plane from which the plane's three points are seen counter-clockwise.
fn above(a: &Point, b: &Point, c: &Point, p: &Point) -> f64 {
    let [a, b, c, p] = [a, b, c, p].map(|p| Coord3D { x: p.x, y: p.y, z: p.z });
    -orient3d(a, b, c, p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Every facet has its neighbours, no point is outside, every vertex is one of the points, Euler's formula holds.
    fn check(points: &[Point], hull: &ConvexHull) {
        for (f, corners) in hull.facets.iter().enumerate() {
            let [a, b, c] = corners.map(|v| hull.vertices[v as usize]);
            assert!(points.iter().all(|p| above(&a, &b, &c, p) <= 0.0));
            for side in 0..3 {
                let other = hull.beside[f][side] as usize;
                let ends = [corners[(side + 1) % 3], corners[side]];
                let back = (0..3).find(|&s| [hull.facets[other][s], hull.facets[other][(s + 1) % 3]] == ends);
                assert_eq!(back.map(|s| hull.beside[other][s]), Some(f as u32));
            }
        }
        assert_eq!(hull.facets.len(), 2 * hull.vertices.len() - 4);
        assert!(hull.vertices.iter().all(|v| points.contains(v)));
    }

    #[test]
    fn a_box_has_eight_corners_whatever_lies_in_it_and_on_it() {
        let mut points = Vec::new();
        for i in 0..5 {
            for j in 0..5 {
                for k in 0..5 {
                    points.push(Point::new(f64::from(i), 0.3 * f64::from(j), 0.1 * f64::from(k)));
                }
            }
        }
        let hull = ConvexHull::new(&points).unwrap();
        check(&points, &hull);
        // Points on edges and sides may be vertices of triangles in one plane; corners are vertices in any case.
        assert!(hull.vertices.len() >= 8);
        let corner = |p: &Point| {
            [p.x / 4.0, p.y / (0.3 * 4.0), p.z / (0.1 * 4.0)].iter().all(|c| (c - c.round()).abs() < 1e-12)
        };
        assert_eq!(hull.vertices.iter().filter(|p| corner(p)).count(), 8);
        let corner = hull.farthest(&Vector::new(1.0, 1.0, 1.0), 0);
        assert_eq!(hull.vertices[corner as usize], points[124]);
    }

    /// A random test found it: of the first vertex, in the middle of the side x = −1, all neighbours are at x = −1 too.
    #[test]
    fn the_farthest_is_found_beyond_a_flat_side_that_looks_away() {
        let quarters = [
            [0, 0, -1],
            [0, -4, -3],
            [4, -3, 3],
            [-4, 0, 0],
            [-4, 4, 0],
            [-4, 2, -3],
            [-4, 2, -2],
            [-3, -3, 4],
            [2, 4, -4],
            [-4, 0, -3],
            [0, -4, 0],
            [4, 0, 0],
        ];
        let points = quarters.map(|p| Point::from(p.map(|c| 0.25 * f64::from(c))));
        let hull = ConvexHull::new(&points).unwrap();
        check(&points, &hull);
        let quarters = |v: u32| (4.0 * hull.vertices[v as usize].x) as i32;
        assert!(quarters(0) == -4 && hull.neighbours(0).iter().all(|v| quarters(*v) == -4));
        assert_eq!(quarters(hull.farthest(&Vector::x(), 0)), 4);
    }

    #[test]
    fn flat_and_empty_sets_have_none() {
        assert_eq!(ConvexHull::new(&[]), None);
        let flat: Vec<Point> = (0..30).map(|i| Point::new(f64::from(i % 5), f64::from(i / 5), 1.0)).collect();
        assert_eq!(ConvexHull::new(&flat), None);
        assert_eq!(ConvexHull::new(&[Point::origin(); 9]), None);
        assert_eq!(ConvexHull::new(&[Point::new(f64::NAN, 0.0, 0.0)]), None);
    }

    proptest! {
        #[test]
        fn no_point_is_outside(
            coords in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64), 4..200),
            rounded in any::<bool>(),
        ) {
            // Rounded coordinates put many points on one plane, one line, one place.
            let to = |x: f64| if rounded { (4.0 * x).round() / 4.0 } else { x };
            let points: Vec<Point> = coords.iter().map(|(x, y, z)| Point::new(to(*x), to(*y), to(*z))).collect();
            if let Some(hull) = ConvexHull::new(&points) {
                check(&points, &hull);
                for d in [Vector::x(), Vector::new(0.3, -0.8, 0.2), -Vector::z()] {
                    let far = points.iter().map(|p| p.coords.dot(&d)).fold(f64::NEG_INFINITY, f64::max);
                    for from in 0..hull.vertices.len() as u32 {
                        let found = hull.vertices[hull.farthest(&d, from) as usize].coords.dot(&d);
                        prop_assert!((found - far).abs() < 1e-11);
                    }
                }
            }
        }
    }
}

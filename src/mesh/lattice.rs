//! The body-centred cubic lattice: cube corners and cube centres.
//!
//! Doubled coordinates make both integers: corners have even coordinates, centres odd ones. Two centres that
//! share a cube face, with one edge of that face, span a tetrahedron; twelve of them, all alike, belong to
//! each cube. Every tetrahedron has two long edges (length a, opposite each other) and four short ones
//! (a·√3/2).

use super::MeshError;
use crate::geometry::{Aabb, Point, Vector};

/// The most tetrahedra that a mesh may be expected to have.
const MOST_TETS: f64 = 2e7;
/// Shifts of the lattice, one for each attempt, in spacings: the first keeps a centred body's own planes of
/// symmetry off the lattice points, the later ones are only different.
const SHIFTS: [[f64; 3]; 5] =
    [[0.137, 0.271, 0.389], [0.61, 0.83, 0.21], [0.29, 0.47, 0.73], [0.91, 0.07, 0.57], [0.43, 0.67, 0.11]];

/// The fourteen neighbours in doubled coordinates: eight by a short edge, then six by a long one.
pub(super) const NEIGHBOURS: [[i32; 3]; 14] = [
    [-1, -1, -1],
    [1, -1, -1],
    [-1, 1, -1],
    [1, 1, -1],
    [-1, -1, 1],
    [1, -1, 1],
    [-1, 1, 1],
    [1, 1, 1],
    [-2, 0, 0],
    [2, 0, 0],
    [0, -2, 0],
    [0, 2, 0],
    [0, 0, -2],
    [0, 0, 2],
];
/// How many of [`NEIGHBOURS`] are reached by a short edge.
pub(super) const SHORT: usize = 8;

/// A block of cubes and the numbers of its points: corners first, then centres, x fastest.
#[derive(Debug, Clone)]
pub(super) struct Lattice {
    origin: Point,
    half_mm: f64,
    cubes: [i32; 3],
    corners: usize,
}

impl Lattice {
    /// A lattice that holds a body's box with at least one cube to spare on each side.
    pub(super) fn over(bounds: &Aabb, spacing_mm: f64, attempt: usize) -> Result<Self, MeshError> {
        let size = bounds.size();
        if !size.iter().all(|x| x.is_finite() && *x > 0.0) || !bounds.min.iter().all(|x| x.is_finite()) {
            return Err(MeshError::Box(size.into()));
        }
        // A body fills about half of its box (a ball: π/6).
        let estimate = std::f64::consts::FRAC_PI_6 * 12.0 * size.product() / spacing_mm.powi(3);
        // A flat or thin box has most of its lattice around the body rather than in it.
        let cubes_f = size.map(|x| (x / spacing_mm).ceil() + 3.0);
        if !estimate.is_finite() || estimate.max(cubes_f.product()) > MOST_TETS {
            let factor = (estimate.max(cubes_f.product()) / MOST_TETS).cbrt();
            let remedy_mm = 1.05 * factor * spacing_mm;
            return Err(MeshError::TooMany { spacing_mm, estimate, limit: MOST_TETS, remedy_mm });
        }
        let shift = Vector::from(SHIFTS[attempt % SHIFTS.len()]) * spacing_mm;
        let cubes: [i32; 3] = cubes_f.map(|n| n as i32).into();
        let corners = cubes.iter().map(|&n| (n + 1) as usize).product();
        let origin = bounds.min - Vector::repeat(2.0 * spacing_mm) + shift;
        Ok(Self { origin, half_mm: 0.5 * spacing_mm, cubes, corners })
    }

    /// How many points there are.
    pub(super) fn len(&self) -> usize {
        self.corners + self.cubes.iter().map(|&n| n as usize).product::<usize>()
    }
    /// The edge of a cube, mm.
    pub(super) fn spacing_mm(&self) -> f64 {
        2.0 * self.half_mm
    }
    /// How many layers of cubes there are in z.
    pub(super) fn layers(&self) -> i32 {
        self.cubes[2]
    }

    /// Doubled coordinates of a point.
    pub(super) fn coordinates(&self, point: u32) -> [i32; 3] {
        let p = point as usize;
        let (i, odd, dims) = if p < self.corners {
            (p, 0, self.cubes.map(|n| (n + 1) as usize))
        } else {
            (p - self.corners, 1, self.cubes.map(|n| n as usize))
        };
        let xyz = [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])];
        xyz.map(|c| 2 * c as i32 + odd)
    }

    /// The number of the point at doubled coordinates, `None` outside.
    pub(super) fn point(&self, at: [i32; 3]) -> Option<u32> {
        let odd = at[0] & 1;
        let dims = self.cubes.map(|n| n + 1 - odd);
        let c = at.map(|x| (x - odd) >> 1);
        if (0..3).any(|k| c[k] < 0 || c[k] >= dims[k]) {
            return None;
        }
        let i = c[0] as usize + dims[0] as usize * (c[1] as usize + dims[1] as usize * c[2] as usize);
        Some((if odd == 1 { self.corners + i } else { i }) as u32)
    }

    /// The point reached from `at` by one of [`NEIGHBOURS`].
    pub(super) fn neighbour(&self, at: [i32; 3], k: usize) -> Option<u32> {
        let d = NEIGHBOURS[k];
        self.point([at[0] + d[0], at[1] + d[1], at[2] + d[2]])
    }

    /// Where a point lies.
    pub(super) fn place(&self, point: u32) -> Point {
        let c = self.coordinates(point);
        self.origin + Vector::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])) * self.half_mm
    }

    /// Whether a point lies on the block's outermost layer, where the body must not reach.
    pub(super) fn is_rim(&self, point: u32) -> bool {
        let c = self.coordinates(point);
        (0..3).any(|k| c[k] <= 1 || c[k] >= 2 * self.cubes[k] - 1)
    }

    /// Calls `each` with the four points of every tetrahedron whose first centre lies in a layer of cubes;
    /// all have positive volume.
    pub(super) fn tets_of_layer(&self, layer: i32, mut each: impl FnMut([u32; 4])) {
        // The corners of the face between two centres, counter-clockwise about the direction between them.
        const RING: [[i32; 2]; 4] = [[1, -1], [1, 1], [-1, 1], [-1, -1]];
        for y in 0..self.cubes[1] {
            for x in 0..self.cubes[0] {
                let c = [2 * x + 1, 2 * y + 1, 2 * layer + 1];
                for d in 0..3 {
                    let (u, v) = ((d + 1) % 3, (d + 2) % 3);
                    let mut next = c;
                    next[d] += 2;
                    let (Some(p), Some(q)) = (self.point(c), self.point(next)) else { continue };
                    let ring = RING.map(|r| {
                        let mut at = c;
                        at[d] += 1;
                        at[u] += r[0];
                        at[v] += r[1];
                        self.point(at)
                    });
                    for k in 0..4 {
                        if let (Some(r), Some(s)) = (ring[k], ring[(k + 1) % 4]) {
                            each([p, q, r, s]);
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice() -> Lattice {
        let b = Aabb { min: Point::origin(), max: Point::new(1.0, 2.0, 1.5) };
        Lattice::over(&b, 0.5, 0).unwrap()
    }

    #[test]
    fn points_and_coordinates_are_each_others_inverse() {
        let l = lattice();
        for p in 0..l.len() as u32 {
            assert_eq!(l.point(l.coordinates(p)), Some(p));
        }
        assert_eq!(l.point([-2, 0, 0]), None);
    }

    #[test]
    fn every_tetrahedron_has_a_twelfth_of_a_cube_and_its_edges_are_neighbours() {
        let l = lattice();
        let mut count = 0;
        for layer in 0..l.layers() {
            l.tets_of_layer(layer, |t| {
                count += 1;
                let [a, b, c, d] = t.map(|p| l.place(p));
                let volume = (b - a).cross(&(c - a)).dot(&(d - a)) / 6.0;
                assert!((volume / (0.125 / 12.0) - 1.0).abs() < 1e-12);
                for i in 0..4 {
                    for j in 0..i {
                        let at = l.coordinates(t[i]);
                        assert!((0..14).any(|k| l.neighbour(at, k) == Some(t[j])));
                    }
                }
            });
        }
        let n = l.cubes;
        let faces = (n[0] - 1) * n[1] * n[2] + n[0] * (n[1] - 1) * n[2] + n[0] * n[1] * (n[2] - 1);
        assert_eq!(count, 4 * faces);
    }

    #[test]
    fn a_size_that_needs_too_many_tetrahedra_says_how_many() {
        let b = Aabb { min: Point::origin(), max: Point::new(1.0, 1.0, 1.0) };
        let e = Lattice::over(&b, 1e-3, 0).unwrap_err();
        assert!(matches!(e, MeshError::TooMany { estimate, .. } if (6e9..7e9).contains(&estimate)), "{e}");
        assert!(matches!(Lattice::over(&b, 1e-200, 0), Err(MeshError::TooMany { .. })));
        let flat = Aabb { min: Point::origin(), max: Point::new(1.0, 0.0, 1.0) };
        assert!(matches!(Lattice::over(&flat, 0.1, 0), Err(MeshError::Box(_))));
    }
}

//! The background grid: the octree's corners and centres, and tetrahedra between them.
//!
//! Two cubes of one width that share a face make four tetrahedra, each of both centres and an edge of that face: the
//! body-centred lattice, all its tetrahedra alike, with dihedral angles of 60° and 90°. Where widths differ there are
//! three other shapes, with angles from 45° to 120° (Labelle and Shewchuk 2007, section 5):
//!
//! ```text
//!   an edge of the shared face is divided        the tetrahedron is cut in two at its middle
//!   the neighbour is larger                      a pyramid from the centre over the face, cut in two along the
//!                                                diagonal through the larger face's centre
//!   the neighbour is smaller                     eight tetrahedra over the eighths of the face
//! ```

use super::MeshError;
use super::octree::{Leaf, Map, Octree, key};
use crate::geometry::{ImplicitBody, Point, Vector};
use rayon::prelude::*;
use std::hash::BuildHasherDefault;

/// Leaves whose tetrahedra one piece of parallel work makes.
const LEAVES_AT_A_TIME: usize = 512;
/// The corners of a face about the direction that it faces, counter-clockwise.
const RING: [[i32; 2]; 4] = [[1, -1], [1, 1], [-1, 1], [-1, -1]];

/// Points with the body's values, and tetrahedra between them.
#[derive(Debug)]
pub(super) struct Background {
    /// Where the points are, in units from the origin.
    at: Vec<[i32; 3]>,
    origin: Point,
    unit_mm: f64,
    /// The body's value at each point, mm; −∞ deep inside, where only the sign is known.
    pub(super) values: Vec<f64>,
    /// Half the width of the smallest cube at each point, in units.
    halves: Vec<i32>,
    /// Tetrahedra of positive volume with at least one point inside.
    pub(super) tets: Vec<[u32; 4]>,
}

/// The octree's points by their coordinates.
struct Points {
    index: Map<u32>,
    /// Half the width of the cube whose centre a point is; 0 for corners.
    center_of: Vec<i32>,
}

impl Background {
    /// Evaluates the body at the octree's corners, except deep inside, and lists the tetrahedra.
    pub(super) fn new(body: &dyn ImplicitBody, tree: &Octree) -> Result<Self, MeshError> {
        let mut points = Points {
            index: Map::with_capacity_and_hasher(3 * tree.leaves.len(), BuildHasherDefault::default()),
            center_of: Vec::new(),
        };
        let mut at: Vec<[i32; 3]> = Vec::with_capacity(3 * tree.leaves.len());
        let mut values = Vec::new();
        let mut halves = Vec::new();
        // A cube's bound on its corners: inside, as it lies deep below the surface, or nothing.
        let deep = |leaf: &Leaf| {
            let width = 2.0 * f64::from(leaf.half) * tree.unit_mm;
            body.steepness().is_some_and(|s| leaf.value < -s * width)
        };
        for leaf in &tree.leaves {
            let known = if deep(leaf) { f64::NEG_INFINITY } else { f64::NAN };
            for i in 0..9 {
                let p: [i32; 3] = if i == 8 {
                    leaf.center
                } else {
                    std::array::from_fn(|k| {
                        leaf.center[k] + if i >> k & 1 == 0 { -leaf.half } else { leaf.half }
                    })
                };
                let next = at.len() as u32;
                let number = *points.index.entry(key(p)).or_insert(next) as usize;
                if number == at.len() {
                    at.push(p);
                    points.center_of.push(0);
                    values.push(f64::NAN);
                    halves.push(leaf.half);
                }
                halves[number] = halves[number].min(leaf.half);
                if i == 8 {
                    points.center_of[number] = leaf.half;
                    values[number] = leaf.value;
                } else if known < 0.0 {
                    values[number] = known;
                }
            }
        }
        let mut background = Self {
            at,
            origin: tree.origin,
            unit_mm: tree.unit_mm,
            values: Vec::new(),
            halves,
            tets: Vec::new(),
        };
        values.par_iter_mut().enumerate().filter(|(_, v)| v.is_nan()).for_each(|(p, v)| {
            *v = body.value(&background.position(p as u32));
        });
        if let Some(p) = values.iter().position(|v| v.is_nan() || *v == f64::INFINITY) {
            return Err(MeshError::NotFinite(background.position(p as u32), values[p]));
        }
        let room = body.bounds().grown(0.5 * tree.unit_mm);
        let beyond = |p: &Point| (0..3).any(|k| p[k] < room.min[k] || p[k] > room.max[k]);
        let outside =
            (0..values.len() as u32).find(|&p| values[p as usize] < 0.0 && beyond(&background.position(p)));
        if let Some(p) = outside {
            return Err(MeshError::Unbounded(background.position(p)));
        }
        let tets: Vec<Vec<[u32; 4]>> = tree
            .leaves
            .par_chunks(LEAVES_AT_A_TIME)
            .map(|leaves| {
                let mut out = Vec::with_capacity(12 * leaves.len());
                for leaf in leaves {
                    points.tets_of(leaf, tree.graded, &mut |t: [u32; 4]| {
                        if t.iter().any(|&p| values[p as usize] < 0.0) {
                            out.push(t);
                        }
                    });
                }
                out
            })
            .collect();
        background.tets = tets.concat();
        background.values = values;
        Ok(background)
    }

    /// Where a point lies.
    pub(super) fn position(&self, point: u32) -> Point {
        self.origin + Vector::from(self.at[point as usize].map(f64::from)) * self.unit_mm
    }

    /// How many points there are.
    pub(super) fn len(&self) -> usize {
        self.at.len()
    }

    /// The width of the smallest cube at a point, mm.
    pub(super) fn spacing_mm(&self, point: u32) -> f64 {
        2.0 * f64::from(self.halves[point as usize]) * self.unit_mm
    }

    /// Whether an edge runs along an axis: in the lattice those are the long ones.
    pub(super) fn is_axial(&self, p: u32, q: u32) -> bool {
        let (a, b) = (self.at[p as usize], self.at[q as usize]);
        (0..3).filter(|&k| a[k] != b[k]).count() == 1
    }
}

impl Points {
    fn get(&self, at: [i32; 3]) -> Option<u32> {
        self.index.get(&key(at)).copied().filter(|_| at.iter().all(|x| *x >= 0))
    }

    /// The point at `at` if it is the centre of a cube of this half width.
    fn center(&self, at: [i32; 3], half: i32) -> Option<u32> {
        self.get(at).filter(|&p| self.center_of[p as usize] == half)
    }

    /// Calls `each` with the tetrahedra that belong to a leaf: those over its upper faces, and over all faces to
    /// neighbours of another width. All have positive volume.
    fn tets_of(&self, leaf: &Leaf, graded: bool, each: &mut impl FnMut([u32; 4])) {
        let (c, h) = (leaf.center, leaf.half);
        let Some(own) = self.get(c) else { return };
        for d in 0..3 {
            let (u, v) = ((d + 1) % 3, (d + 2) % 3);
            for s in [-1, 1] {
                if s < 0 && !graded {
                    continue;
                }
                // A point relative to the centre: along the face's normal, and along the face.
                let rel = |n: i32, a: i32, b: i32| {
                    let mut at = c;
                    at[d] += n;
                    at[u] += a;
                    at[v] += b;
                    at
                };
                let corner = |k: usize| rel(s * h, RING[k % 4][0] * h, RING[k % 4][1] * h);
                let beyond = rel(2 * s * h, 0, 0);
                if let Some(q) = self.center(beyond, h) {
                    if s > 0 {
                        for k in 0..4 {
                            let (a, b) = (corner(k), corner(k + 1));
                            let (Some(r), Some(t)) = (self.get(a), self.get(b)) else { continue };
                            let middle = if graded {
                                self.get(std::array::from_fn(|i| i32::midpoint(a[i], b[i])))
                            } else {
                                None
                            };
                            if let Some(m) = middle {
                                each([own, q, r, m]);
                                each([own, q, m, t]);
                            } else {
                                each([own, q, r, t]);
                            }
                        }
                    }
                    continue;
                }
                let mut fan = |a: Option<u32>, b: Option<u32>, e: Option<u32>| {
                    if let (Some(a), Some(b), Some(e)) = (a, b, e) {
                        each(if s > 0 { [own, a, b, e] } else { [own, a, e, b] });
                    }
                };
                // The neighbour's parent, if it is a leaf.
                let parent: [i32; 3] = beyond.map(|x| x.div_euclid(4 * h) * 4 * h + 2 * h);
                if self.center(parent, 2 * h).is_some() {
                    let mut middle = parent;
                    middle[d] -= 2 * s * h;
                    let first = (0..4).find(|&k| corner(k) == middle).unwrap_or(0);
                    let at = |k: usize| self.get(corner(first + k));
                    fan(at(0), at(1), at(2));
                    fan(at(0), at(2), at(3));
                    continue;
                }
                if h < 2 {
                    continue;
                }
                let middle = self.get(rel(s * h, 0, 0));
                for (k, [a, b]) in RING.into_iter().enumerate() {
                    if self.center(rel(s * (h + h / 2), a * h / 2, b * h / 2), h / 2).is_none() {
                        continue;
                    }
                    let side = |k: usize| {
                        let (p, q) = (corner(k), corner(k + 1));
                        self.get(std::array::from_fn(|i| i32::midpoint(p[i], q[i])))
                    };
                    let at = self.get(corner(k));
                    fan(middle, side(k + 3), at);
                    fan(middle, at, side(k));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::faces::boundary_triangles;
    use super::super::sizes::{Contacts, Sizes};
    use super::super::tetmesh::TetMesh;
    use super::super::{Controls, score};
    use super::*;
    use crate::geometry::{Aabb, Ball};

    /// All of space within a box is inside, as far as the grid is asked.
    struct Everywhere(f64);
    impl ImplicitBody for Everywhere {
        fn value(&self, _: &Point) -> f64 {
            -self.0
        }
        fn bounds(&self) -> Aabb {
            Aabb { min: Point::new(-50.0, -50.0, -50.0), max: Point::new(50.0, 50.0, 50.0) }
        }
    }

    #[test]
    fn a_graded_grid_is_conforming_and_fills_its_cubes() {
        let ball = Ball { center: Point::origin(), radius_mm: 0.5 };
        let controls = Controls {
            size_at_contact_mm: Some(0.01),
            contact_depth_mm: Some(0.02),
            surface_size_mm: 0.05,
            tet_volume_mm3: 1e-3,
            ..Controls::for_size(1.0)
        };
        let contacts = Contacts::of(&ball, &controls);
        let sizes = Sizes::new(&controls, contacts, [1.0; 3]);
        let tree = Octree::over(&ball, &sizes, 0).unwrap();
        assert!(
            tree.graded && tree.leaves.iter().any(|l| l.half == 1) && tree.leaves.iter().any(|l| l.half >= 8)
        );
        // Values inside everywhere: every tetrahedron of the grid is kept.
        let background = Background::new(&Everywhere(1e-3), &tree).unwrap();
        let nodes: Vec<Point> = (0..background.len() as u32).map(|p| background.position(p)).collect();
        let mesh = TetMesh::new(nodes, background.tets.clone());
        for t in 0..mesh.tets.len() {
            let p = mesh.corners(t);
            let (volume, sine) = score::volume_and_least_sine(&p);
            assert!(volume > 0.0 && sine > 0.7, "{t}: {volume} {sine}");
        }
        // Faces with one tetrahedron lie at the grid's outer boundary: outside the ball.
        for n in boundary_triangles(&mesh.tets, mesh.nodes.len(), |_| true).concat() {
            assert!(ball.value(&mesh.nodes[n as usize]) > 0.0);
        }
    }
}

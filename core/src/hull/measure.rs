//! Volume, area and box of the carved grid, by marching tetrahedra.
//!
//! Each cell is cut into six tetrahedra about its diagonal (Freudenthal), in which the distance is taken as
//! linear: the surface is watertight and the volume and area converge with the square of the pitch.

use super::grid::{B, BLOCKS, Block, Group, HullGrid, POINTS, R, unravel};
use crate::geometry::{Aabb, Point, TriangleMesh, Vector};
use rayon::prelude::*;
use serde::Serialize;

/// The six tetrahedra of a cell; corner `i` is at (i & 1, i >> 1 & 1, i >> 2 & 1).
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
/// Points along an edge of a block with its neighbours' first.
const E: usize = B + 1;

/// Measures of a hull.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Measures {
    /// Volume, mm³; an upper bound of the grain's.
    pub volume_mm3: f64,
    /// Surface area, mm².
    pub surface_area_mm2: f64,
    /// The tight box, mm; `None` where nothing is left.
    pub bounding_box_mm: Option<Aabb>,
}

/// What a part of the grid adds, in units of the pitch; the box from the grid's first point.
#[derive(Clone, Copy)]
struct Sum {
    volume: f64,
    area: f64,
    low: [f64; 3],
    high: [f64; 3],
}

impl Sum {
    const NOTHING: Self =
        Self { volume: 0.0, area: 0.0, low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] };

    fn add(&mut self, other: &Self) {
        self.volume += other.volume;
        self.area += other.area;
        for k in 0..3 {
            self.low[k] = self.low[k].min(other.low[k]);
            self.high[k] = self.high[k].max(other.high[k]);
        }
    }
}

impl HullGrid {
    /// Volume, area and box. The cost is as the surface; the groups' sums are added in a fixed order.
    pub fn measures(&self) -> Measures {
        let h = self.pitch_mm;
        let sums: Vec<Sum> =
            (0..self.groups.len()).into_par_iter().map(|n| self.measure_group(n, &mut Nothing)).collect();
        let mut total = Sum::NOTHING;
        sums.iter().for_each(|s| total.add(s));
        let corner = |p: [f64; 3]| self.origin + Vector::from(p) * h;
        Measures {
            volume_mm3: total.volume * h.powi(3),
            surface_area_mm2: total.area * h * h,
            bounding_box_mm: (total.low[0] <= total.high[0])
                .then(|| Aabb { min: corner(total.low), max: corner(total.high) }),
        }
    }

    /// The surface that [`Self::measures`] measures, in a fixed order. The triangles of a block of 8³ cells share their vertices; those on the
    /// border of two blocks are there twice.
    pub fn surface(&self) -> TriangleMesh {
        let parts: Vec<TriangleMesh> = (0..self.groups.len())
            .into_par_iter()
            .map(|n| {
                let mut sharing = Sharing { mesh: TriangleMesh::default(), ids: vec![0; EDGES] };
                self.measure_group(n, &mut sharing);
                for p in &mut sharing.mesh.vertices {
                    *p = self.origin + p.coords * self.pitch_mm;
                }
                sharing.mesh
            })
            .collect();
        let mut whole = TriangleMesh::default();
        whole.vertices.reserve_exact(parts.iter().map(|part| part.vertices.len()).sum());
        whole.triangles.reserve_exact(parts.iter().map(|part| part.triangles.len()).sum());
        for part in parts {
            let before = whole.vertices.len() as u32;
            whole.vertices.extend(part.vertices);
            whole.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + before)));
        }
        whole
    }

    /// The sums of the cells that a group's blocks own, and their triangles in units of the pitch from the first
    /// point of the grid.
    fn measure_group(&self, n: usize, out: &mut impl Surface) -> Sum {
        let mut sum = Sum::NOTHING;
        let blocks = match &self.groups[n] {
            Group::Outside => return sum,
            Group::Inside => {
                sum.volume = (BLOCKS * POINTS) as f64;
                return sum;
            }
            Group::Split(blocks) => blocks,
        };
        let first = unravel(n, self.groups_along);
        let mut corners = [0f32; E * E * E];
        for (b, block) in blocks.iter().enumerate() {
            match block {
                Block::Outside => {}
                Block::Inside => sum.volume += POINTS as f64,
                Block::Mixed(_) => {
                    let within = unravel(b, [R; 3]);
                    let at = [0, 1, 2].map(|k| R * first[k] + within[k]);
                    self.corners_of(at, &mut corners);
                    let mut own = Sum::NOTHING;
                    out.begin_block();
                    measure_cells(&corners, at.map(|i| (B * i) as f64), &mut own, out);
                    sum.add(&own);
                }
            }
        }
        sum
    }
}

/// The cells between 9³ corners of which the first is at `first`, in units of the pitch.
fn measure_cells(corners: &[f32; E * E * E], first: [f64; 3], sum: &mut Sum, out: &mut impl Surface) {
    // Row after row, a bit for each point that is inside.
    let mut inside = [0u16; E * E];
    for (bits, row) in inside.iter_mut().zip(corners.chunks_exact(E)) {
        *bits = row.iter().enumerate().fold(0, |bits, (x, d)| bits | u16::from(*d < 0.0) << x);
    }
    for z in 0..B {
        for y in 0..B {
            let rows = [0, 1, E, E + 1].map(|k| inside[z * E + y + k]);
            let (all, any) = (rows[0] & rows[1] & rows[2] & rows[3], rows[0] | rows[1] | rows[2] | rows[3]);
            let full = all & all >> 1 & 0xff;
            sum.volume += f64::from(full.count_ones());
            let mut cut = (any | any >> 1) & 0xff & !full;
            while cut != 0 {
                let x = cut.trailing_zeros() as usize;
                cut &= cut - 1;
                let v: [f64; 8] = std::array::from_fn(|i| {
                    f64::from(corners[((z + (i >> 2 & 1)) * E + y + (i >> 1 & 1)) * E + x + (i & 1)])
                });
                let corner = (z * E + y) * E + x;
                let at = [first[0] + x as f64, first[1] + y as f64, first[2] + z as f64];
                measure_cell(&v, (corner, at), sum, out);
            }
        }
    }
}

/// One cell with its first corner, the number of that among the block's and its place. Each tetrahedron is a sixth of it; what is cut off a
/// corner is the product of the three edges' parts, and two corners' wedge is three such pieces.
fn measure_cell(v: &[f64; 8], (corner, at): (usize, [f64; 3]), sum: &mut Sum, out: &mut impl Surface) {
    for t in TETRAHEDRA {
        let signs = t.iter().enumerate().fold(0, |bits, (k, i)| bits | usize::from(v[*i] < 0.0) << k);
        let order = INSIDE_FIRST[signs].map(|k| t[k]);
        // The part of the edge from corner a to corner b that lies before the surface, the point there and the edge's number.
        let cut = |a: usize, b: usize| {
            let (from, to) = (order[a], order[b]);
            // All edges go from a corner to one further along each axis, or as far.
            let low = from & to;
            let low = (low >> 2) * E * E + (low >> 1 & 1) * E + (low & 1);
            let part = v[from] / (v[from] - v[to]);
            let point = [0, 1, 2].map(|k| {
                let (p, q) = ((from >> k & 1) as f64, (to >> k & 1) as f64);
                at[k] + (p + (q - p) * part)
            });
            (part, (point, (corner + low) * 8 + (from ^ to)))
        };
        let (part, points, count) = match signs.count_ones() {
            0 => continue,
            1 => {
                let [a, b, c] = [cut(0, 1), cut(0, 2), cut(0, 3)];
                (a.0 * b.0 * c.0, [a.1, b.1, c.1, c.1], 3)
            }
            2 => {
                let [a, b, c, d] = [cut(0, 2), cut(0, 3), cut(1, 3), cut(1, 2)];
                let part = a.0 * b.0 + c.0 * a.0 * (1.0 - b.0) + (1.0 - a.0) * c.0 * d.0;
                (part, [a.1, b.1, c.1, d.1], 4)
            }
            3 => {
                let [a, b, c] = [cut(0, 3), cut(1, 3), cut(2, 3)];
                (1.0 - (1.0 - a.0) * (1.0 - b.0) * (1.0 - c.0), [a.1, b.1, c.1, c.1], 3)
            }
            _ => {
                sum.volume += 1.0 / 6.0;
                continue;
            }
        };
        sum.volume += part / 6.0;
        for k in 2..count {
            let triangle = [points[0], points[k - 1], points[k]];
            let [p, q, r] = triangle.map(|(point, _)| Vector::from(point));
            sum.area += 0.5 * (q - p).cross(&(r - p)).norm();
            out.take(triangle);
        }
        for (point, _) in points {
            sum.add(&Sum { low: point, high: point, ..Sum::NOTHING });
        }
    }
}

/// Who takes the triangles.
trait Surface {
    /// Before a block's triangles.
    fn begin_block(&mut self);
    /// A triangle's points, in units of the pitch from the first point of the grid, each with the number of the edge that it lies on,
    /// below [`EDGES`] and its own in the block; counter-clockwise seen from outside.
    fn take(&mut self, triangle: [([f64; 3], usize); 3]);
}

/// Nobody does.
struct Nothing;

impl Surface for Nothing {
    fn begin_block(&mut self) {}
    fn take(&mut self, _: [([f64; 3], usize); 3]) {}
}

/// Edges of a block: each of its points has one in seven directions, and one number is free.
const EDGES: usize = E * E * E * 8;

/// A mesh whose triangles share vertices within a block.
struct Sharing {
    mesh: TriangleMesh,
    /// Of each edge the vertex; `u32::MAX` where it has none yet.
    ids: Vec<u32>,
}

impl Surface for Sharing {
    fn begin_block(&mut self) {
        self.ids.fill(u32::MAX);
    }

    fn take(&mut self, triangle: [([f64; 3], usize); 3]) {
        let corners = triangle.map(|(point, edge)| {
            if self.ids[edge] == u32::MAX {
                self.ids[edge] = self.mesh.vertices.len() as u32;
                self.mesh.vertices.push(Point::from(point));
            }
            self.ids[edge]
        });
        self.mesh.triangles.push(corners);
    }
}

/// For each set of a tetrahedron's corners that are inside (a bit each): those first, then the others, by an even permutation, so that
/// triangles are seen counter-clockwise from outside.
const INSIDE_FIRST: [[usize; 4]; 16] = {
    let mut table = [[0; 4]; 16];
    let mut signs = 0;
    while signs < 16 {
        let (mut k, mut next) = (0, 0);
        while k < 8 {
            // First round: the corners inside; second round: the others.
            if (signs >> (k % 4) & 1 == 1) == (k < 4) {
                table[signs][next] = k % 4;
                next += 1;
            }
            k += 1;
        }
        if is_odd(table[signs]) {
            // Two that are both inside, or both not.
            let k = if signs.count_ones() < 3 { 2 } else { 0 };
            let kept = table[signs][k];
            table[signs][k] = table[signs][k + 1];
            table[signs][k + 1] = kept;
        }
        signs += 1;
    }
    table
};

const fn is_odd(order: [usize; 4]) -> bool {
    let (mut inversions, mut a) = (0, 0);
    while a < 4 {
        let mut b = a + 1;
        while b < 4 {
            inversions += (order[a] > order[b]) as usize;
            b += 1;
        }
        a += 1;
    }
    inversions % 2 == 1
}

//! Volume, area and box of the carved grid, by marching tetrahedra.
//!
//! Each cell is cut into six tetrahedra about its diagonal (Freudenthal), in which the distance is taken as
//! linear: the surface is watertight and the volume and area converge with the square of the pitch.

use super::grid::{B, BLOCKS, Block, Group, HullGrid, POINTS, R, unravel};
use crate::geometry::{Aabb, Point, Vector};
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
            (0..self.groups.len()).into_par_iter().map(|n| self.measure_group(n, &mut |_| {})).collect();
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

    /// The triangles of the surface that [`Self::measures`] measures, in a fixed order; not oriented.
    pub fn surface_triangles(&self) -> Vec<[Point; 3]> {
        let parts: Vec<Vec<[Point; 3]>> = (0..self.groups.len())
            .into_par_iter()
            .map(|n| {
                let mut out = Vec::new();
                self.measure_group(n, &mut |t: [[f64; 3]; 3]| {
                    out.push(t.map(|p| self.origin + Vector::from(p) * self.pitch_mm));
                });
                out
            })
            .collect();
        parts.concat()
    }

    /// The sums of the cells that a group's blocks own, and their triangles in units of the pitch from the first
    /// point of the grid.
    fn measure_group(&self, n: usize, emit: &mut impl FnMut([[f64; 3]; 3])) -> Sum {
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
                    measure_cells(&corners, at.map(|i| (B * i) as f64), &mut own, emit);
                    sum.add(&own);
                }
            }
        }
        sum
    }
}

/// The cells between 9³ corners of which the first is at `first`, in units of the pitch.
fn measure_cells(
    corners: &[f32; E * E * E],
    first: [f64; 3],
    sum: &mut Sum,
    emit: &mut impl FnMut([[f64; 3]; 3]),
) {
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
                measure_cell(&v, [first[0] + x as f64, first[1] + y as f64, first[2] + z as f64], sum, emit);
            }
        }
    }
}

/// One cell with its first corner at `at`. Each tetrahedron is a sixth of it; what is cut off a corner is the
/// product of the three edges' parts, and two corners' wedge is three such pieces.
fn measure_cell(v: &[f64; 8], at: [f64; 3], sum: &mut Sum, emit: &mut impl FnMut([[f64; 3]; 3])) {
    for t in TETRAHEDRA {
        let signs = t.iter().enumerate().fold(0, |bits, (k, i)| bits | usize::from(v[*i] < 0.0) << k);
        let order = INSIDE_FIRST[signs].map(|k| t[k]);
        // The part of the edge from corner a to corner b that lies before the surface, and the point there.
        let cut = |a: usize, b: usize| {
            let (from, to) = (order[a], order[b]);
            let part = v[from] / (v[from] - v[to]);
            let point = [0, 1, 2].map(|k| {
                let (p, q) = ((from >> k & 1) as f64, (to >> k & 1) as f64);
                at[k] + (p + (q - p) * part)
            });
            (part, point)
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
            let [p, q, r] = [points[0], points[k - 1], points[k]].map(Vector::from);
            sum.area += 0.5 * (q - p).cross(&(r - p)).norm();
            emit([points[0], points[k - 1], points[k]]);
        }
        for point in points {
            sum.add(&Sum { low: point, high: point, ..Sum::NOTHING });
        }
    }
}

/// For each set of a tetrahedron's corners that are inside (a bit each): those first, then the others, each in order.
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
        signs += 1;
    }
    table
};

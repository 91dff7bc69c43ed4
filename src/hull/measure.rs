//! Volume, area and box of the standing hull, by marching tetrahedra.
//!
//! Each cell is cut into six tetrahedra about its diagonal (Freudenthal), in which the distance is taken as
//! linear: the surface is watertight and the volume and area converge with the square of the pitch.

use super::grid::{B, Block, HullGrid};
use crate::geometry::{Aabb, Point, Vector};
use rayon::prelude::*;
use serde::Serialize;

/// The six tetrahedra of a cell; corner `i` is at (i & 1, i >> 1 & 1, i >> 2 & 1).
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

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

#[derive(Clone, Copy)]
struct Sum {
    volume: f64,
    area: f64,
    bounds: Option<Aabb>,
}

impl HullGrid {
    /// Volume, area and box. The cost is as the surface; block sums are added in a fixed order.
    pub fn measures(&self) -> Measures {
        let h = self.pitch_mm;
        let sums: Vec<Sum> =
            (0..self.blocks.len()).into_par_iter().map(|n| self.measure_block(n, &mut |_| {})).collect();
        let mut total = Sum { volume: 0.0, area: 0.0, bounds: None };
        for s in sums {
            total.volume += s.volume;
            total.area += s.area;
            total.bounds = union(total.bounds, s.bounds);
        }
        Measures {
            volume_mm3: total.volume * h.powi(3),
            surface_area_mm2: total.area * h * h,
            bounding_box_mm: total.bounds,
        }
    }

    /// The triangles of the surface that [`Self::measures`] measures, in a fixed order; not oriented.
    pub fn surface_triangles(&self) -> Vec<[Point; 3]> {
        let parts: Vec<Vec<[Point; 3]>> = (0..self.blocks.len())
            .into_par_iter()
            .map(|n| {
                let mut out = Vec::new();
                self.measure_block(n, &mut |t| out.push(t));
                out
            })
            .collect();
        parts.concat()
    }

    /// The sums of the cells that a block owns, in units of the pitch.
    fn measure_block(&self, n: usize, emit: &mut impl FnMut([Point; 3])) -> Sum {
        const E: usize = B + 1;
        let mut sum = Sum { volume: 0.0, area: 0.0, bounds: None };
        match &self.blocks[n] {
            Block::Outside => return sum,
            Block::Inside => {
                sum.volume = (B * B * B) as f64;
                return sum;
            }
            Block::Mixed(_) => {}
        }
        let mut corners = [0f32; E * E * E];
        self.corners_of(n, &mut corners);
        let corner = self.block_corner(n);
        for z in 0..B {
            for y in 0..B {
                for x in 0..B {
                    let value =
                        |i: usize| corners[((z + (i >> 2 & 1)) * E + y + (i >> 1 & 1)) * E + x + (i & 1)];
                    let v: [f64; 8] = std::array::from_fn(|i| f64::from(value(i)));
                    let inside = v.iter().filter(|d| **d < 0.0).count();
                    if inside == 8 {
                        sum.volume += 1.0;
                    } else if inside > 0 {
                        let at = corner + Vector::new(x as f64, y as f64, z as f64) * self.pitch_mm;
                        self.measure_cell(&v, &at, &mut sum, emit);
                    }
                }
            }
        }
        sum
    }

    fn measure_cell(&self, v: &[f64; 8], at: &Point, sum: &mut Sum, emit: &mut impl FnMut([Point; 3])) {
        let place = |i: usize| Vector::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
        for t in TETRAHEDRA {
            let mut order = t;
            // Inside corners first; a stable order keeps the sums reproducible.
            order.sort_by_key(|&i| v[i] >= 0.0);
            let inside = order.iter().filter(|&&i| v[i] < 0.0).count();
            let p = order.map(place);
            let cut = |a: usize, b: usize| {
                let (da, db) = (v[order[a]], v[order[b]]);
                p[a] + (p[b] - p[a]) * (da / (da - db))
            };
            let tet = |a: Vector, b: Vector, c: Vector, d: Vector| {
                (b - a).dot(&(c - a).cross(&(d - a))).abs() / 6.0
            };
            let tri = |a: Vector, b: Vector, c: Vector| 0.5 * (b - a).cross(&(c - a)).norm();
            let (volume, area, cuts) = match inside {
                0 => continue,
                1 => {
                    let (a, b, c) = (cut(0, 1), cut(0, 2), cut(0, 3));
                    (tet(p[0], a, b, c), tri(a, b, c), vec![a, b, c])
                }
                2 => {
                    let (a, b, c, d) = (cut(0, 2), cut(0, 3), cut(1, 3), cut(1, 2));
                    let prism = tet(p[0], a, b, p[1]) + tet(a, b, p[1], c) + tet(a, c, p[1], d);
                    (prism, tri(a, b, c) + tri(a, c, d), vec![a, b, c, d])
                }
                3 => {
                    let (a, b, c) = (cut(0, 3), cut(1, 3), cut(2, 3));
                    (1.0 / 6.0 - tet(p[3], a, b, c), tri(a, b, c), vec![a, b, c])
                }
                _ => (1.0 / 6.0, 0.0, Vec::new()),
            };
            sum.volume += volume;
            sum.area += area;
            let cuts: Vec<Point> = cuts.into_iter().map(|c| at + c * self.pitch_mm).collect();
            for k in 2..cuts.len() {
                emit([cuts[0], cuts[k - 1], cuts[k]]);
            }
            sum.bounds = union(sum.bounds, Aabb::of(cuts));
        }
    }
}

fn union(a: Option<Aabb>, b: Option<Aabb>) -> Option<Aabb> {
    match (a, b) {
        (Some(a), Some(b)) => Some(Aabb { min: a.min.inf(&b.min), max: a.max.sup(&b.max) }),
        (a, b) => a.or(b),
    }
}

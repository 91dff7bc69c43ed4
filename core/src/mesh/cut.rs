//! Where the surface cuts the lattice, and which lattice points are warped onto it.

use super::MeshError;
use super::background::Background;
use super::score::EDGES;
use crate::geometry::{ImplicitBody, Point};
use rayon::prelude::*;
use std::collections::HashMap;

/// A cut nearer to a lattice point than this part of a long edge (one along an axis) warps the point (Labelle and Shewchuk, table
/// 1, the pair that bounds the least dihedral angle best).
const WARP_LONG: f64 = 0.24999;
/// The same for a short edge.
const WARP_SHORT: f64 = 0.41189;
/// Cuts keep at least this part of the edge from a point that must not be warped.
const KEPT_CLEAR: f64 = 0.2;

/// The background grid with the surface's cuts through its edges.
#[derive(Debug)]
pub(super) struct Field {
    pub(super) background: Background,
    /// For each point, where its cuts start in `cuts` (inside points have them); one entry more than points.
    start: Vec<u32>,
    cuts: Vec<Cut>,
}

/// The surface's crossing of an edge from an inside point to an outside one.
#[derive(Debug, Clone, Copy)]
struct Cut {
    inside: u32,
    outside: u32,
    /// The part of the edge that is inside, 0 to 1.
    t: f64,
}

impl Field {
    /// Finds the cuts, in parallel.
    pub(super) fn new(body: &dyn ImplicitBody, background: Background) -> Result<Self, MeshError> {
        let values = &background.values;
        if !values.iter().any(|v| *v < 0.0) {
            let spacing_mm =
                (0..background.len() as u32).map(|p| background.spacing_mm(p)).fold(0.0, f64::max);
            return Err(MeshError::Empty { spacing_mm });
        }
        let mut edges: Vec<u64> = background
            .tets
            .par_iter()
            .filter(|t| t.iter().any(|&p| values[p as usize] > 0.0))
            .flat_map_iter(|t| {
                EDGES.iter().filter_map(|&[i, j, ..]| {
                    let (p, q) = (t[i], t[j]);
                    let (v, w) = (values[p as usize], values[q as usize]);
                    if v < 0.0 && w > 0.0 {
                        Some(u64::from(p) << 32 | u64::from(q))
                    } else if w < 0.0 && v > 0.0 {
                        Some(u64::from(q) << 32 | u64::from(p))
                    } else {
                        None
                    }
                })
            })
            .collect();
        edges.par_sort_unstable();
        edges.dedup();
        let cuts: Vec<Cut> = edges
            .into_par_iter()
            .map(|edge| {
                let (inside, outside) = ((edge >> 32) as u32, edge as u32);
                let (p, q) = (background.position(inside), background.position(outside));
                let deep = values[inside as usize];
                // Deep inside only the sign is known so far.
                let deep = if deep.is_finite() { deep } else { body.value(&p) };
                let tolerance = 1e-3 * (q - p).norm();
                let t =
                    crossing(|t| body.value(&(p + (q - p) * t)), deep, values[outside as usize], tolerance);
                Cut { inside, outside, t }
            })
            .collect();
        let mut start = vec![0u32; background.len() + 1];
        cuts.iter().for_each(|c| start[c.inside as usize + 1] += 1);
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        Ok(Self { background, start, cuts })
    }

    /// How many cuts there are.
    pub(super) fn cut_count(&self) -> usize {
        self.cuts.len()
    }

    /// Where the cuts are: points on the body's surface.
    pub(super) fn surface_points(&self) -> Vec<Point> {
        self.cuts.iter().map(|c| self.on_edge(*c, c.t)).collect()
    }

    /// The number of the cut between an inside and an outside point.
    pub(super) fn cut(&self, inside: u32, outside: u32) -> u32 {
        let range = self.start[inside as usize]..self.start[inside as usize + 1];
        range.into_iter().find(|&c| self.cuts[c as usize].outside == outside).unwrap_or_else(|| {
            unreachable!("an edge from inside to outside is always cut: {inside} to {outside}")
        })
    }

    /// Warps lattice points onto the surface, the nearest first. `kept` points are not warped, and count as
    /// inside where the surface goes right through them.
    pub(super) fn warp(&self, kept: &[bool]) -> Warped {
        let mut side: Vec<i8> = self
            .background
            .values
            .iter()
            .zip(kept)
            .map(|(v, &kept)| {
                if *v < 0.0 {
                    -1
                } else if *v > 0.0 {
                    1
                } else {
                    -i8::from(kept)
                }
            })
            .collect();
        // (closeness as part of the threshold, the point to warp, the cut)
        let mut near: Vec<(f64, u32, u32)> = Vec::new();
        for (i, c) in self.cuts.iter().enumerate() {
            let part = if self.background.is_axial(c.inside, c.outside) { WARP_LONG } else { WARP_SHORT };
            let (p, q) = (self.background.position(c.inside), self.background.position(c.outside));
            for (point, t) in [(c.inside, c.t), (c.outside, 1.0 - c.t)] {
                // Where cubes of two widths meet, the smaller one bounds how far a point may go.
                let usual = if part == WARP_LONG { 1.0 } else { 0.75f64.sqrt() };
                let threshold = part * usual * self.background.spacing_mm(point) / (q - p).norm();
                let threshold = threshold.min(part);
                if t < threshold && !kept[point as usize] {
                    near.push((t / threshold, point, i as u32));
                }
            }
        }
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut moved = HashMap::new();
        for (_, point, cut) in near {
            let c = self.cuts[cut as usize];
            let other = if point == c.inside { c.outside } else { c.inside };
            if side[point as usize] != 0 && side[other as usize] != 0 {
                side[point as usize] = 0;
                moved.insert(point, self.on_edge(c, c.t));
            }
        }
        let cut_points = self
            .cuts
            .iter()
            .map(|c| {
                let low = if kept[c.inside as usize] { KEPT_CLEAR } else { 0.0 };
                let high = if kept[c.outside as usize] { 1.0 - KEPT_CLEAR } else { 1.0 };
                self.on_edge(*c, c.t.clamp(low, high))
            })
            .collect();
        Warped { side, moved, cut_points }
    }

    /// The width of the smallest cube at a node, mm: lattice points come first, cuts after them.
    pub(super) fn spacing_mm(&self, node: u32) -> f64 {
        let n = self.background.len() as u32;
        let point = if node < n { node } else { self.cuts[(node - n) as usize].inside };
        self.background.spacing_mm(point)
    }

    fn on_edge(&self, c: Cut, t: f64) -> Point {
        let (p, q) = (self.background.position(c.inside), self.background.position(c.outside));
        p + (q - p) * t
    }
}

/// The lattice after warping.
#[derive(Debug)]
pub(super) struct Warped {
    /// −1 inside, 0 on the surface, +1 outside, for each lattice point.
    pub(super) side: Vec<i8>,
    moved: HashMap<u32, Point>,
    cut_points: Vec<Point>,
}

impl Warped {
    /// Where a node lies: lattice points come first, cuts after them.
    pub(super) fn position(&self, field: &Field, node: u32) -> Point {
        let n = self.side.len() as u32;
        if node >= n {
            return self.cut_points[(node - n) as usize];
        }
        self.moved.get(&node).copied().unwrap_or_else(|| field.background.position(node))
    }
}

/// The point in 0..1 where a function changes from negative (at 0) to positive (at 1): regula falsi with the
/// Illinois rule, at most eight values.
fn crossing(f: impl Fn(f64) -> f64, at_0: f64, at_1: f64, tolerance: f64) -> f64 {
    let (mut a, mut fa, mut b, mut fb) = (0.0, at_0, 1.0, at_1);
    let mut last_side = 0;
    let mut t = fa / (fa - fb);
    for _ in 0..8 {
        let ft = f(t);
        // A value that is not a number ends the search where it stands.
        if !(ft.abs() > tolerance && b - a > 1e-6) {
            break;
        }
        if ft < 0.0 {
            (a, fa) = (t, ft);
            if last_side == -1 {
                fb *= 0.5;
            }
            last_side = -1;
        } else {
            (b, fb) = (t, ft);
            if last_side == 1 {
                fa *= 0.5;
            }
            last_side = 1;
        }
        t = (a * fb - b * fa) / (fb - fa);
    }
    t.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crossing_is_found_also_where_the_function_bends() {
        assert!((crossing(|t| t - 0.3, -0.3, 0.7, 1e-9) - 0.3).abs() < 1e-12);
        let bent = |t: f64| t.powi(5) - 0.5;
        assert!((crossing(bent, -0.5, 0.5, 1e-9) - 0.5f64.powf(0.2)).abs() < 1e-3);
        let step = |t: f64| if t < 0.7 { -1.0 } else { 1.0 };
        assert!((crossing(step, -1.0, 1.0, 1e-9) - 0.7).abs() < 0.01);
    }
}

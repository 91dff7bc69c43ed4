//! Where the surface cuts the lattice, and which lattice points are warped onto it.

use super::{MeshError, lattice::Lattice, lattice::SHORT};
use crate::geometry::{ImplicitBody, Point};
use rayon::prelude::*;
use std::collections::HashMap;

/// A cut nearer to a lattice point than this part of a long edge warps the point (Labelle and Shewchuk, table
/// 1, the pair that bounds the least dihedral angle best).
const WARP_LONG: f64 = 0.24999;
/// The same for a short edge.
const WARP_SHORT: f64 = 0.41189;
/// Cuts keep at least this part of the edge from a point that must not be warped.
const KEPT_CLEAR: f64 = 0.2;

/// A lattice with the body's values and the surface's cuts through its edges.
#[derive(Debug)]
pub(super) struct Field {
    pub(super) lattice: Lattice,
    /// The body's value at each lattice point, mm.
    pub(super) values: Vec<f64>,
    /// For each inside point, where its cuts start in `cuts`; one entry more than points.
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
    short: bool,
}

impl Field {
    /// Evaluates the body at every lattice point once and finds the cuts, in parallel.
    pub(super) fn sample(body: &dyn ImplicitBody, lattice: Lattice) -> Result<Self, MeshError> {
        let n = lattice.len() as u32;
        let values: Vec<f64> = (0..n).into_par_iter().map(|p| body.value(&lattice.place(p))).collect();
        if let Some(p) = values.iter().position(|v| !v.is_finite()) {
            return Err(MeshError::NotFinite(lattice.place(p as u32), values[p]));
        }
        let inside = |p: u32| values[p as usize] < 0.0;
        if let Some(p) = (0..n).find(|&p| inside(p) && lattice.is_rim(p)) {
            return Err(MeshError::Unbounded(lattice.place(p)));
        }
        if !(0..n).any(inside) {
            return Err(MeshError::Empty { spacing_mm: lattice.spacing_mm() });
        }
        let mut start = Vec::with_capacity(n as usize + 1);
        let mut cuts = Vec::new();
        for p in 0..n {
            start.push(cuts.len() as u32);
            if !inside(p) {
                continue;
            }
            let at = lattice.coordinates(p);
            for k in 0..14 {
                // An inside point is not on the rim, so every neighbour exists.
                if let Some(q) = lattice.neighbour(at, k).filter(|&q| values[q as usize] > 0.0) {
                    cuts.push(Cut { inside: p, outside: q, t: 0.0, short: k < SHORT });
                }
            }
        }
        start.push(cuts.len() as u32);
        let tolerance = 1e-4 * lattice.spacing_mm();
        cuts.par_iter_mut().for_each(|c| {
            let (p, q) = (lattice.place(c.inside), lattice.place(c.outside));
            c.t = crossing(
                |t| body.value(&(p + (q - p) * t)),
                values[c.inside as usize],
                values[c.outside as usize],
                tolerance,
            );
        });
        Ok(Self { lattice, values, start, cuts })
    }

    /// How many cuts there are.
    pub(super) fn cut_count(&self) -> usize {
        self.cuts.len()
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
            let threshold = if c.short { WARP_SHORT } else { WARP_LONG };
            for (point, t) in [(c.inside, c.t), (c.outside, 1.0 - c.t)] {
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
        let cut_places = self
            .cuts
            .iter()
            .map(|c| {
                let low = if kept[c.inside as usize] { KEPT_CLEAR } else { 0.0 };
                let high = if kept[c.outside as usize] { 1.0 - KEPT_CLEAR } else { 1.0 };
                self.on_edge(*c, c.t.clamp(low, high))
            })
            .collect();
        Warped { side, moved, cut_places }
    }

    fn on_edge(&self, c: Cut, t: f64) -> Point {
        let (p, q) = (self.lattice.place(c.inside), self.lattice.place(c.outside));
        p + (q - p) * t
    }
}

/// The lattice after warping.
#[derive(Debug)]
pub(super) struct Warped {
    /// −1 inside, 0 on the surface, +1 outside, for each lattice point.
    pub(super) side: Vec<i8>,
    moved: HashMap<u32, Point>,
    cut_places: Vec<Point>,
}

impl Warped {
    /// Where a node lies: lattice points come first, cuts after them.
    pub(super) fn place(&self, field: &Field, node: u32) -> Point {
        let n = self.side.len() as u32;
        if node >= n {
            return self.cut_places[(node - n) as usize];
        }
        self.moved.get(&node).copied().unwrap_or_else(|| field.lattice.place(node))
    }
}

/// The place in 0..1 where a function changes from negative (at 0) to positive (at 1): regula falsi with the
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

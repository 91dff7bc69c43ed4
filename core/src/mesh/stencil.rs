//! Stencils of isosurface stuffing: the part of one lattice tetrahedron that is inside, as tetrahedra.
//!
//! ```text
//!  inside  on  outside     what is left
//!     any   any   0        the whole tetrahedron (with no point inside: only where its centre is)
//!     1     0–2  1–3       a tetrahedron: outside points replaced by cuts
//!     2     1     1        a pyramid: 2 tetrahedra
//!     2     0     2        a wedge between two cut triangles at the inside points: 3 tetrahedra
//!     3     0     1        a wedge between the inside triangle and the cut triangle: 3 tetrahedra
//! ```
//! A quadrilateral in a lattice face is seen by two lattice tetrahedra, which must choose the same diagonal:
//! it starts at the inside point of lower [rank](Stencil::rank), the deeper one. A rank orders all points, so
//! the diagonals of a wedge never turn in a circle, which is what would make it impossible to fill.

use super::cut::{Field, Warped};
use super::score;
use crate::geometry::{ImplicitBody, Point};
use rayon::prelude::*;

/// Sine of a dihedral angle (15°) below which a tetrahedron with all points on the surface is not kept.
const LEAST_SINE: f64 = 0.26;
/// Tetrahedra that one piece of parallel work cuts.
const TETS_AT_A_TIME: usize = 8192;

/// Cuts lattice tetrahedra; nodes are lattice points, then cuts.
struct Stencil<'a> {
    field: &'a Field,
    warped: &'a Warped,
    body: &'a dyn ImplicitBody,
}

/// All tetrahedra inside the warped lattice, with positive volumes, in the order of the lattice.
pub(super) fn cut_all(body: &dyn ImplicitBody, field: &Field, warped: &Warped) -> Vec<[u32; 4]> {
    let stencil = Stencil { field, warped, body };
    let parts: Vec<Vec<[u32; 4]>> = field
        .background
        .tets
        .par_chunks(TETS_AT_A_TIME)
        .map(|tets| {
            let mut out = Vec::with_capacity(tets.len());
            tets.iter().for_each(|t| stencil.cut(*t, &mut out));
            out
        })
        .collect();
    parts.concat()
}

impl Stencil<'_> {
    fn side(&self, p: u32) -> i8 {
        self.warped.side[p as usize]
    }
    fn position(&self, node: u32) -> Point {
        self.warped.position(self.field, node)
    }
    fn cut_node(&self, inside: u32, outside: u32) -> u32 {
        self.warped.side.len() as u32 + self.field.cut(inside, outside)
    }
    /// Whether `p` comes before `q`: deeper first, then by number.
    fn rank(&self, p: u32, q: u32) -> std::cmp::Ordering {
        let v = &self.field.background.values;
        v[p as usize].total_cmp(&v[q as usize]).then(p.cmp(&q))
    }

    fn cut(&self, tet: [u32; 4], out: &mut Vec<[u32; 4]>) {
        let sides = tet.map(|p| self.side(p));
        let inside = sides.iter().filter(|s| **s < 0).count();
        let outside = sides.iter().filter(|s| **s > 0).count();
        match (inside, outside) {
            (0, 0) => {
                // All four were warped onto the surface: a piece of the body, or a piece of the outside.
                // A flat one, where cubes of two widths meet, is better left out: what it hides becomes the surface.
                let positions = tet.map(|p| self.position(p));
                let sum = positions.iter().map(|p| p.coords).sum::<crate::geometry::Vector>();
                let (volume, sine) = score::volume_and_least_sine(&positions);
                let is_flat = volume <= 0.0 || sine < LEAST_SINE;
                if !is_flat && self.body.value(&(sum / 4.0).into()) < 0.0 {
                    out.push(tet);
                }
            }
            (0, _) => {}
            (_, 0) => out.push(tet),
            (1, _) => {
                let p = tet[sides.iter().position(|s| *s < 0).unwrap_or(0)];
                out.push(tet.map(|q| if self.side(q) > 0 { self.cut_node(p, q) } else { q }));
            }
            (2, 1) => self.pyramid(tet, out),
            (2, _) => self.wedge_of_two(tet, out),
            _ => self.wedge_of_three(tet, out),
        }
    }

    /// Inside p and q, z on the surface, n outside.
    fn pyramid(&self, tet: [u32; 4], out: &mut Vec<[u32; 4]>) {
        let [p, q, z, n] = self.sorted(tet);
        let (cp, cq) = (self.cut_node(p, n), self.cut_node(q, n));
        // The quadrilateral p, q, cq, cp is seen from z; p, q, z, n is positive.
        if self.rank(p, q).is_lt() {
            out.extend([[p, q, z, cq], [p, cq, z, cp]]);
        } else {
            out.extend([[p, q, z, cp], [q, cq, z, cp]]);
        }
    }

    fn wedge_of_two(&self, tet: [u32; 4], out: &mut Vec<[u32; 4]>) {
        let [mut p, mut q, mut m, n] = self.sorted(tet);
        let mut n = n;
        if self.rank(q, p).is_lt() {
            (p, q, m, n) = (q, p, n, m);
        }
        let a = [p, self.cut_node(p, m), self.cut_node(p, n)];
        let b = [q, self.cut_node(q, m), self.cut_node(q, n)];
        // The diagonals from p are set; the one of the surface quadrilateral is free, and the shorter is
        // taken.
        let length = |i: usize, j: usize| (self.position(a[i]) - self.position(b[j])).norm_squared();
        if length(1, 2) <= length(2, 1) {
            wedge(a, b, [0, 1, 2], out);
        } else {
            wedge(a, b, [0, 2, 1], out);
        }
    }

    fn wedge_of_three(&self, tet: [u32; 4], out: &mut Vec<[u32; 4]>) {
        let [p, q, r, n] = self.sorted(tet);
        let a = [p, q, r];
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| self.rank(a[i], a[j]));
        wedge(a, a.map(|p| self.cut_node(p, n)), order, out);
    }

    /// The same tetrahedron with inside points first and outside points last, its volume still positive.
    fn sorted(&self, tet: [u32; 4]) -> [u32; 4] {
        let mut t = tet;
        let mut odd = false;
        for end in (1..4).rev() {
            for i in 0..end {
                if self.side(t[i]) > self.side(t[i + 1]) {
                    t.swap(i, i + 1);
                    odd = !odd;
                }
            }
        }
        if odd {
            // Of four points with three kinds of sides two are of one kind: these may change places.
            let i = (0..3).find(|&i| self.side(t[i]) == self.side(t[i + 1])).unwrap_or(0);
            t.swap(i, i + 1);
        }
        t
    }
}

/// Fills the wedge between triangles `a` and `b`, with a0, a1, a2, b0 positive. The diagonals run from `a` to
/// `b`, always from the earlier to the later corner in `order`.
fn wedge(a: [u32; 3], b: [u32; 3], order: [usize; 3], out: &mut Vec<[u32; 4]>) {
    let [i, j, k] = order;
    let even = (j + 3 - i) % 3 == 1;
    for [p, q, r, s] in [[a[i], a[j], a[k], b[k]], [a[i], a[j], b[k], b[j]], [a[i], b[i], b[j], b[k]]] {
        out.push(if even { [p, q, r, s] } else { [p, q, s, r] });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wedge_is_filled_in_every_order_of_its_corners() {
        let position = |n: u32| {
            let z = f64::from(n / 3);
            Point::from([[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]][n as usize % 3])
        };
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut out = Vec::new();
            wedge([0, 1, 2], [3, 4, 5], order, &mut out);
            for t in out {
                let [p, q, r, s] = t.map(position);
                let six = (q - p).cross(&(r - p)).dot(&(s - p));
                assert!((six - 1.0).abs() < 1e-12, "{order:?} {t:?} {six}");
            }
        }
    }
}

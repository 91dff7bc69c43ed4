//! Quality of a mesh: dihedral angles, facet angles, radius–edge ratio, altitudes.
//!
//! ```text
//! dihedral angle    cos θ = −n₁·n₂/(|n₁| |n₂|)              n: area vectors of two faces, outwards
//! radius–edge       R/l_min,  R = | |b|² c×d + |c|² d×b + |d|² b×c | / (12 V)    b, c, d: edges from node 0
//! altitude          h = 3V/A_max
//! time step         Δt = h_min/c,  c² = E (1 − ν)/((1 + ν)(1 − 2ν) ρ)
//! ```

use super::{TetMesh, score};
use rayon::prelude::*;
use serde::Serialize;

/// The quality of a mesh; every figure is an extreme over the whole mesh unless otherwise stated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quality {
    /// Angles between the faces of tetrahedra, degrees; a regular tetrahedron has 70.5.
    pub dihedral_deg: Dihedral,
    /// Smallest angle of a surface facet, degrees.
    pub facet_angle_deg: f64,
    /// Largest circumradius of a surface facet, mm.
    pub facet_circumradius_mm: f64,
    /// Largest ratio of a tetrahedron's circumradius to its shortest edge; 0.61 is regular.
    pub radius_edge: f64,
    /// Smallest altitude of a tetrahedron, mm: with the speed of sound it bounds an explicit time step.
    pub altitude_min_mm: f64,
    /// Median over tetrahedra of the smallest altitude, mm.
    pub altitude_median_mm: f64,
    /// Largest tetrahedron, mm³.
    pub tet_volume_mm3: f64,
}

/// Dihedral angles, degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Dihedral {
    /// The smallest.
    pub min: f64,
    /// The first percentile of all six of every tetrahedron.
    pub p01: f64,
    /// The largest.
    pub max: f64,
}

/// Cosine of a dihedral angle (56.6°) below which the first percentile is sought before all angles are looked at.
const NARROW: f64 = 0.55;

pub(super) struct Measures {
    /// Cosines of the dihedral angles.
    pub(super) cosines: [f64; 6],
    pub(super) radius_edge: f64,
    pub(super) altitude_mm: f64,
    volume_mm3: f64,
}

impl Quality {
    /// The longest stable step of an explicit simulation of a linear elastic material, s: the time in which a pressure wave
    /// of √(E (1 − ν) / ((1 + ν) (1 − 2 ν) ρ)) crosses the smallest altitude. Young's modulus in `MPa`, density in
    /// tonne/mm³.
    pub fn time_step_s(&self, young_mpa: f64, poisson: f64, density_t_mm3: f64) -> f64 {
        let stiffness = young_mpa * (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
        self.altitude_min_mm / (stiffness / density_t_mm3).sqrt()
    }
}

impl TetMesh {
    /// Measures the mesh, which must pass [`TetMesh::check`].
    pub fn quality(&self) -> Quality {
        let all: Vec<Measures> = (0..self.tets.len()).into_par_iter().map(|t| self.measure(t)).collect();
        let most = |f: fn(&Measures) -> f64| all.iter().map(f).fold(0.0, f64::max);
        let cosines = || all.iter().flat_map(|m| m.cosines);
        let (widest, narrowest) = cosines().fold((1.0f64, -1.0f64), |(w, n), c| (w.min(c), n.max(c)));
        // The first percentile of the angles is among the narrow ones of most meshes.
        let rank = (6 * all.len() - 1) / 100;
        let mut narrow: Vec<f64> = cosines().filter(|c| *c > NARROW).collect();
        if narrow.len() <= rank {
            narrow = cosines().collect();
        }
        let p01 = *narrow.select_nth_unstable_by(rank, |a, b| b.total_cmp(a)).1;
        let mut altitudes: Vec<f64> = all.iter().map(|m| m.altitude_mm).collect();
        let middle = (altitudes.len() - 1) / 2;
        let median = *altitudes.select_nth_unstable_by(middle, f64::total_cmp).1;
        let degrees = |cosine: f64| cosine.clamp(-1.0, 1.0).acos().to_degrees();
        let surface = self.surface().triangles;
        let (mut radius, mut sine) = (0.0f64, 1.0f64);
        for t in 0..surface.triangles.len() {
            let (r, s) = score::circumradius_and_least_sine(&surface.corners(t));
            (radius, sine) = (radius.max(r), sine.min(s));
        }
        Quality {
            dihedral_deg: Dihedral { min: degrees(narrowest), p01: degrees(p01), max: degrees(widest) },
            facet_angle_deg: sine.asin().to_degrees(),
            facet_circumradius_mm: radius,
            radius_edge: most(|m| m.radius_edge),
            altitude_min_mm: all.iter().map(|m| m.altitude_mm).fold(f64::INFINITY, f64::min),
            altitude_median_mm: median,
            tet_volume_mm3: most(|m| m.volume_mm3),
        }
    }

    pub(super) fn measure(&self, t: usize) -> Measures {
        let p = self.corners(t);
        let n = score::face_vectors(&p);
        let volume_mm3 = score::volume(&p);
        let lengths = n.map(|v| v.norm());
        let cosines = score::EDGES.map(|[_, _, k, l]| -n[k].dot(&n[l]) / (lengths[k] * lengths[l]));
        let largest = lengths.into_iter().fold(0.0, f64::max);
        let shortest =
            score::EDGES.iter().map(|&[i, j, ..]| (p[i] - p[j]).norm()).fold(f64::INFINITY, f64::min);
        // Circumcentre relative to node 0: (|b|² c×d + |c|² d×b + |d|² b×c) / 12 V.
        let [b, c, d] = [p[1] - p[0], p[2] - p[0], p[3] - p[0]];
        let sum =
            b.norm_squared() * c.cross(&d) + c.norm_squared() * d.cross(&b) + d.norm_squared() * b.cross(&c);
        Measures {
            cosines,
            radius_edge: sum.norm() / (12.0 * volume_mm3) / shortest,
            altitude_mm: 6.0 * volume_mm3 / largest,
            volume_mm3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    #[test]
    fn the_regular_tetrahedron_has_its_known_figures() {
        let p = [[1., 1., 1.], [-1., 1., -1.], [1., -1., -1.], [-1., -1., 1.]].map(Point::from);
        let mesh = TetMesh::new(p.to_vec(), vec![[0, 1, 2, 3]]);
        assert_eq!(mesh.check(), Ok(()));
        let q = mesh.quality();
        let edge = 8f64.sqrt();
        let known = [
            (q.dihedral_deg.min, (1.0f64 / 3.0).acos().to_degrees()),
            (q.dihedral_deg.max, (1.0f64 / 3.0).acos().to_degrees()),
            (q.facet_angle_deg, 60.0),
            (q.facet_circumradius_mm, edge / 3f64.sqrt()),
            (q.radius_edge, 6f64.sqrt() / 4.0),
            (q.altitude_min_mm, edge * (2.0f64 / 3.0).sqrt()),
            (q.tet_volume_mm3, 8.0 / 3.0),
            // A wave of 1 mm/s, as ν = 0.
            (q.time_step_s(4.0, 0.0, 4.0), edge * (2.0f64 / 3.0).sqrt()),
        ];
        for (i, (is, should)) in known.iter().enumerate() {
            assert!((is / should - 1.0).abs() < 1e-9, "{i}: {is} {should}");
        }
    }
}

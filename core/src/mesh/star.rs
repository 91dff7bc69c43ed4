//! The star of a node: the tetrahedra and facets around it, gathered once and scored at many trial positions of the node.
//!
//! What does not change with the node (the opposite faces and edges) is computed once. A trial that cannot
//! beat the best so far is refused at its first tetrahedron that is too bad; that one is asked first the next
//! time, because it is likely to refuse again. The score is a minimum, so the order changes the time only,
//! not a bit of the result.

use super::sizes::Contacts;
use super::{Controls, score};
use crate::geometry::{Point, Vector};

/// Dihedral angle below which a tetrahedron is worth work, degrees.
const TARGET_DIHEDRAL_DEG: f64 = 25.0;
/// The same for facets, above what was promised, degrees.
const FACET_MARGIN_DEG: f64 = 3.0;
/// The same for the smallest altitude, in lattice spacings; a lattice tetrahedron has 0.707.
const TARGET_ALTITUDE: f64 = 0.295;

/// What a score is measured against: 1 is good enough to be left alone. It is the same seen from every node of a
/// tetrahedron: were it not, what one node gains would be another's loss.
#[derive(Debug, Clone, Copy)]
pub(super) struct Targets {
    largest_radius_mm: f64,
    largest_volume_mm3: f64,
    /// The promised least angle's, a hair above it.
    promised_sine: f64,
    facet_sine: f64,
    tet_sine: f64,
    /// Where facets must be smaller.
    contacts: Option<Contacts>,
}

impl Targets {
    /// Whether a plate may touch the body at this height.
    pub(super) fn touched(&self, z: f64) -> bool {
        self.contacts.is_some_and(|c| c.distance(z) == 0.0)
    }

    pub(super) fn new(controls: &Controls, contacts: Option<Contacts>) -> Self {
        Self {
            largest_radius_mm: controls.surface_size_mm,
            largest_volume_mm3: controls.tet_volume_mm3,
            promised_sine: controls.facet_angle_deg.to_radians().sin() * (1.0 + 1e-9),
            facet_sine: (controls.facet_angle_deg + FACET_MARGIN_DEG).to_radians().sin(),
            tet_sine: TARGET_DIHEDRAL_DEG.to_radians().sin(),
            contacts,
        }
    }

    /// The score of a facet: its least angle over the target, negative where a promised size or angle is broken; NaN
    /// without area.
    pub(super) fn facet_score(&self, facet: &[Point; 3]) -> f64 {
        let (radius, sine) = score::circumradius_and_least_sine(facet);
        let excess = radius / self.radius_mm(facet);
        // A broken promise comes before everything that is only wished for.
        if excess.is_nan() || excess > 1.0 {
            1.0 - excess
        } else if sine < self.promised_sine {
            sine / self.promised_sine - 1.0
        } else {
            sine / self.facet_sine
        }
    }

    /// The largest circumradius of a facet, mm.
    fn radius_mm(&self, facet: &[Point; 3]) -> f64 {
        match &self.contacts {
            Some(c) if facet.iter().all(|p| c.distance(p.z) == 0.0) => c.size_mm,
            _ => self.largest_radius_mm,
        }
    }
}

/// A tetrahedron of the star without its moving node.
#[derive(Debug, Clone, Copy)]
struct Spoke {
    /// The three other nodes: positive volume with the moving node before them.
    b: Point,
    c: Point,
    d: Point,
    /// Squared lengths of the edges c–d, b–d, b–c.
    fixed: [f64; 3],
    /// Squared norm of twice the area vector of b, c, d.
    base: f64,
    /// The altitude that is asked for, mm.
    altitude_mm: f64,
}

/// Everything around a node that its position changes.
#[derive(Debug, Default)]
pub(super) struct Star {
    /// The two other nodes of each facet.
    facets: Vec<[Point; 2]>,
    tets: Vec<Spoke>,
    /// Whether a tetrahedron refused the last trial that was refused, rather than a facet.
    tets_first: bool,
}

impl Star {
    /// Forgets the last node.
    pub(super) fn clear(&mut self) {
        self.facets.clear();
        self.tets.clear();
        self.tets_first = false;
    }

    /// Adds a facet by the positions of its three nodes, of which `k` is the moving one.
    pub(super) fn add_facet(&mut self, p: [Point; 3], k: usize) {
        self.facets.push([p[(k + 1) % 3], p[(k + 2) % 3]]);
    }

    /// Adds a tetrahedron by the positions of its four nodes, of which `k` is the moving one, and the least spacing of the
    /// grid at them.
    pub(super) fn add_tet(&mut self, p: [Point; 4], k: usize, spacing_mm: f64) {
        // Even permutations that bring node k to the front.
        const TURNED: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [1, 0, 2]];
        self.tets.push(Spoke::new(TURNED[k].map(|i| p[i]), spacing_mm));
    }

    /// Whether the node lies on the surface.
    pub(super) fn on_surface(&self) -> bool {
        !self.facets.is_empty()
    }

    /// The unit normal at a surface node at `at`; `None` inside, or where the facets' normals cancel.
    pub(super) fn normal(&self, at: Point, least: f64) -> Option<Vector> {
        self.facets.iter().map(|[p, q]| (p - at).cross(&(q - at))).sum::<Vector>().try_normalize(least)
    }

    /// The mean of the neighbours: of those on the surface for a surface node.
    pub(super) fn centre(&self) -> Point {
        let of = |sum: Vector, count: usize| Point::from(sum / count as f64);
        if self.on_surface() {
            of(self.facets.iter().flatten().map(|p| p.coords).sum(), 2 * self.facets.len())
        } else {
            of(self.tets.iter().map(|s| s.b.coords + s.c.coords + s.d.coords).sum(), 3 * self.tets.len())
        }
    }

    /// The score with the node at `at`: the worst of tetrahedra and facets, each over its target, negative
    /// where a promised size or angle is broken. −∞ where a tetrahedron would be flat or inside out, or the score
    /// below `floor`.
    pub(super) fn score(&mut self, targets: &Targets, at: Point, floor: f64) -> f64 {
        let (a, b) = if self.tets_first {
            let tets = self.tets_score(targets, at, floor);
            if tets == f64::NEG_INFINITY {
                return tets;
            }
            (tets, self.facets_score(targets, at, floor))
        } else {
            let facets = self.facets_score(targets, at, floor);
            if facets == f64::NEG_INFINITY {
                return facets;
            }
            (facets, self.tets_score(targets, at, floor))
        };
        a.min(b)
    }

    fn facets_score(&mut self, targets: &Targets, at: Point, floor: f64) -> f64 {
        let mut least = f64::INFINITY;
        for [p, q] in &self.facets {
            let one = targets.facet_score(&[at, *p, *q]);
            least = least.min(one);
            // A facet without area has no score: not a number, which `min` would pass over.
            if least < floor || one.is_nan() {
                self.tets_first = false;
                return f64::NEG_INFINITY;
            }
        }
        least
    }

    fn tets_score(&mut self, targets: &Targets, at: Point, floor: f64) -> f64 {
        let mut least = f64::INFINITY;
        for i in 0..self.tets.len() {
            let one = self.tets[i].score(targets, at);
            least = least.min(one);
            if least < floor || one == f64::NEG_INFINITY {
                self.tets.swap(0, i);
                self.tets_first = true;
                return f64::NEG_INFINITY;
            }
        }
        least
    }
}

impl Spoke {
    fn new([b, c, d]: [Point; 3], spacing_mm: f64) -> Self {
        let fixed = [(d - c).norm_squared(), (d - b).norm_squared(), (c - b).norm_squared()];
        let base = (c - b).cross(&(d - b)).norm_squared();
        Self { b, c, d, fixed, base, altitude_mm: TARGET_ALTITUDE * spacing_mm }
    }

    fn score(&self, targets: &Targets, at: Point) -> f64 {
        let (b, c, d) = (self.b - at, self.c - at, self.d - at);
        // Twice the area vectors of the faces opposite to b, c, d.
        let (of_b, of_c, of_d) = (d.cross(&c), b.cross(&d), c.cross(&b));
        let six_volumes = -of_d.dot(&d);
        // Flat, inside out, or not a number.
        if six_volumes.is_nan() || six_volumes <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let excess = six_volumes / (6.0 * targets.largest_volume_mm3);
        if excess > 1.0 {
            return 1.0 - excess;
        }
        let n = [of_b.norm_squared(), of_c.norm_squared(), of_d.norm_squared()];
        let [cd, bd, bc] = self.fixed;
        // sin θ = 3 V l / 2 A₁ A₂ for the faces that meet in the edge of length l.
        let squares = [
            b.norm_squared() / (n[1] * n[2]),
            c.norm_squared() / (n[0] * n[2]),
            d.norm_squared() / (n[0] * n[1]),
            cd / (self.base * n[0]),
            bd / (self.base * n[1]),
            bc / (self.base * n[2]),
        ];
        let least = squares.into_iter().fold(f64::INFINITY, f64::min).sqrt();
        let largest = n.into_iter().fold(self.base, f64::max).sqrt();
        six_volumes * (least / targets.tet_sine).min(1.0 / (largest * self.altitude_mm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broken_promise_is_worse_than_any_wish_that_is_not_met() {
        let controls = Controls {
            surface_size_mm: 10.0,
            facet_angle_deg: 15.0,
            tet_volume_mm3: 10.0,
            ..Controls::for_size(1.0)
        };
        let targets = Targets::new(&controls, None);
        let score = |least_angle_deg: f64| {
            let mut star = Star::default();
            let up = (0.5 * least_angle_deg).to_radians().tan();
            star.add_facet([Point::origin(), Point::new(1.0, -up, 0.0), Point::new(1.0, up, 0.0)], 0);
            star.score(&targets, Point::origin(), f64::NEG_INFINITY)
        };
        assert!(score(14.9) < 0.0 && score(10.0) < score(14.9));
        assert!(score(15.1) > 0.8 && score(15.1) < 1.0 && score(18.1) > 1.0);
    }

    #[test]
    fn a_score_is_the_same_from_every_node_of_a_tetrahedron_and_is_its_least_part() {
        let p = [[0., 0., 0.], [1., 0.1, 0.], [0.2, 0.9, 0.], [0.1, 0.3, 0.4]].map(Point::from);
        let controls = Controls {
            surface_size_mm: 10.0,
            facet_angle_deg: 15.0,
            tet_volume_mm3: 10.0,
            ..Controls::for_size(1.0)
        };
        let targets = Targets::new(&controls, None);
        let refused = |score: f64| score.is_infinite() && score < 0.0;
        let (volume, sine) = score::volume_and_least_sine(&p);
        assert!(volume > 0.0);
        for k in 0..4 {
            let mut star = Star::default();
            star.add_tet(p, k, 0.01);
            let s = star.score(&targets, p[k], f64::NEG_INFINITY);
            assert!((s * targets.tet_sine / sine - 1.0).abs() < 1e-12, "{k}: {s} {sine}");
            // The floor refuses, and a mirrored node is inside out.
            assert!(refused(star.score(&targets, p[k], s + 1e-9)));
        }
        // With a coarse lattice the altitude is what is short: 6 V over twice the largest face.
        let largest = score::face_vectors(&p).iter().map(nalgebra::Matrix::norm).fold(0.0, f64::max);
        let mut star = Star::default();
        star.add_tet(p, 0, 100.0);
        let s = star.score(&targets, p[0], f64::NEG_INFINITY);
        assert!((s * 100.0 * TARGET_ALTITUDE / (6.0 * volume / largest) - 1.0).abs() < 1e-12, "{s}");
        let beyond = Point::new(0.5, 0.5, 0.5);
        assert!(refused(star.score(&targets, beyond, f64::NEG_INFINITY)));
    }
}

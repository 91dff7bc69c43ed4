//! Optimisation-based smoothing: nodes move to where their worst tetrahedron or facet gets better.
//!
//! A node's score is the worst of its tetrahedra (least sine of a dihedral angle, smallest altitude) and
//! of its facets (least sine of an angle), each over its target; a broken promise makes it negative, so
//! that it comes before every wish. A move is accepted only if the score rises, so no part of the mesh
//! ever gets worse than it was (Freitag and Ollivier-Gooch, Int. J. Numer. Meth. Engng 40, 1997). Surface
//! nodes move along the surface and are put back onto it. Only nodes at the surface and their neighbours move: the
//! lattice inside is as good as it can be. After a first pass over all of these only those below their target are
//! asked again, and what has moved near them. Nodes are coloured so that two of one colour
//! share no tetrahedron: a colour moves at once, in parallel, with the same result on any number of
//! threads.

use super::faces::Around;
use super::repair::Filled;
use super::star::{Star, Targets};
use crate::geometry::{ImplicitBody, Point, Vector};
use nalgebra::Rotation3;
use rayon::prelude::*;

/// Passes at most. Most meshes need ten.
const PASSES: usize = 40;
/// A node that no direction of so many passes has helped waits until something near it moves.
const PATIENCE: u8 = 5;
/// Layers of nodes below the surface that move.
const LAYERS: usize = 2;
/// Score below which a node is moved in the first pass, towards its neighbours' centre only.
const GOOD: f64 = 1.3;
/// Score at which a search ends: a little above the target, so that a neighbour's moves leave some of it.
const ENOUGH: f64 = 1.05;
/// Parts of the way to the neighbours' centre, and lengths of trial steps in lattice spacings.
const TOWARDS_CENTRE: [f64; 3] = [1.0, 0.5, 0.2];
const STEPS: [f64; 3] = [0.12, 0.04, 0.013];
/// Trial directions: the six along the axes and the eight diagonals (length √3, longer on purpose).
const DIRECTIONS: [[f64; 3]; 14] = [
    [1., 0., 0.],
    [-1., 0., 0.],
    [0., 1., 0.],
    [0., -1., 0.],
    [0., 0., 1.],
    [0., 0., -1.],
    [1., 1., 1.],
    [-1., 1., 1.],
    [1., -1., 1.],
    [-1., -1., 1.],
    [1., 1., -1.],
    [-1., 1., -1.],
    [1., -1., -1.],
    [-1., -1., -1.],
];
/// The mean of a facet's distance from a curved surface over the distance at its centre, where its corners lie on the
/// surface: 1 − r²/R², with the mean r² = R²/4 of an equilateral triangle.
const MEAN_OVER_CENTRE: f64 = 0.75;
/// A surface node is moved off the surface by at most this part of a spacing.
const MOST_LIFT: f64 = 0.1;
/// Cosine (37°) between the planes around a node below which the body has an edge there.
const SHARP: f64 = 0.8;
/// A direction is decided by the planes if its eigenvalue is at least this part of the largest.
const DECIDED: f64 = 0.08;
/// Edges are looked for within this part of a spacing from a node.
const EDGE_REACH: f64 = 0.45;
/// The score that may be left at an edge, and parts of the way there that are tried.
const AT_EDGE: f64 = 0.985;
const TO_EDGE: [f64; 4] = [1.0, 0.75, 0.5, 0.25];
/// Depth of a facet's centre over the root of twice its area below which there is no edge near.
const SHALLOW: f64 = 0.02;

/// What became of a node.
enum Tried {
    /// It was good enough.
    Good,
    /// It goes there.
    Better(Point),
    /// No better position was found.
    Stuck,
}

/// Improves a mesh in place; its topology stays.
pub(super) fn improve(body: &dyn ImplicitBody, targets: &Targets, filled: &mut Filled) {
    let Filled { mesh, spacings, facets } = filled;
    let smoother = Smoother::new(body, targets, spacings, &mesh.tets, facets, mesh.nodes.len());
    let nodes = &mut mesh.nodes;
    let mut todo: Vec<u32> =
        (0..nodes.len() as u32).filter(|&v| smoother.colour_of[v as usize] != INACTIVE).collect();
    let mut patience = vec![PATIENCE; nodes.len()];
    // The pass in which a node was last listed.
    let mut listed = vec![0u32; nodes.len()];
    for pass in 0..PASSES {
        // Other directions in each pass: a node that none of one set helps may be helped by the next.
        let turn = Rotation3::from_scaled_axis(Vector::new(0.7, 1.1, 0.4) * pass as f64);
        let directions = DIRECTIONS.map(|d| turn * Vector::from(d));
        let (directions, below) = if pass == 0 { (&[][..], GOOD) } else { (&directions[..], 1.0) };
        let mut moved = Vec::new();
        let mut stuck = Vec::new();
        for colour in smoother.by_colour(&todo) {
            let tried: Vec<Tried> = (colour.par_iter())
                .with_min_len(16)
                .map_init(Star::default, |star, &v| smoother.try_node(nodes, v, below, directions, star))
                .collect();
            for (&v, tried) in colour.iter().zip(tried) {
                match tried {
                    Tried::Good => {}
                    Tried::Better(to) => {
                        nodes[v as usize] = to;
                        moved.push(v);
                    }
                    Tried::Stuck => stuck.push(v),
                }
            }
        }
        if pass == 0 {
            // All are looked at once more, now for good.
            continue;
        }
        todo.clear();
        let mut list = |v: u32, todo: &mut Vec<u32>| {
            if smoother.colour_of[v as usize] != INACTIVE && listed[v as usize] != pass as u32 {
                listed[v as usize] = pass as u32;
                todo.push(v);
            }
        };
        for &v in &moved {
            for &n in smoother.tets_of.get(v).iter().flat_map(|&t| &smoother.tets[t as usize]) {
                patience[n as usize] = PATIENCE;
                list(n, &mut todo);
            }
        }
        for &v in &stuck {
            if patience[v as usize] > 0 {
                patience[v as usize] -= 1;
                list(v, &mut todo);
            }
        }
        todo.sort_unstable();
        if todo.is_empty() {
            break;
        }
    }
    smoother.lift(nodes);
}

/// The colour of nodes that stay where they are.
const INACTIVE: u8 = u8::MAX;

struct Smoother<'a> {
    body: &'a dyn ImplicitBody,
    spacings: &'a [f64],
    targets: &'a Targets,
    tets: &'a [[u32; 4]],
    facets: &'a [[u32; 3]],
    /// Of active nodes.
    tets_of: Around,
    facets_of: Around,
    /// Of each node; [`INACTIVE`] away from the surface.
    colour_of: Vec<u8>,
    colours: usize,
}

impl<'a> Smoother<'a> {
    fn new(
        body: &'a dyn ImplicitBody,
        targets: &'a Targets,
        spacings: &'a [f64],
        tets: &'a [[u32; 4]],
        facets: &'a [[u32; 3]],
        nodes: usize,
    ) -> Self {
        let mut on = vec![false; nodes];
        facets.iter().flatten().for_each(|&n| on[n as usize] = true);
        let mut active = on.clone();
        for _ in 0..LAYERS {
            let before = active.clone();
            for t in tets.iter().filter(|t| t.iter().any(|n| before[*n as usize])) {
                t.iter().for_each(|&n| active[n as usize] = true);
            }
        }
        let mut smoother = Self {
            body,
            spacings,
            targets,
            tets,
            facets,
            tets_of: Around::of(tets, nodes, |n| active[n as usize]),
            facets_of: Around::of(facets, nodes, |_| true),
            colour_of: vec![INACTIVE; nodes],
            colours: 0,
        };
        smoother.colour(&active);
        smoother
    }

    /// Colours the active nodes, greedily in their order. A node with more neighbours than there are colours stays where
    /// it is.
    fn colour(&mut self, active: &[bool]) {
        for v in (0..active.len()).filter(|v| active[*v]) {
            let mut taken = [0u64; 4];
            for &n in self.tets_of.get(v as u32).iter().flat_map(|&t| &self.tets[t as usize]) {
                let c = self.colour_of[n as usize];
                taken[c as usize / 64] |= 1 << (c % 64);
            }
            let free = taken.iter().position(|w| *w != u64::MAX);
            let colour = free.map_or(INACTIVE, |i| (64 * i) as u8 + taken[i].trailing_ones() as u8);
            self.colour_of[v] = colour;
            if colour != INACTIVE {
                self.colours = self.colours.max(colour as usize + 1);
            }
        }
    }

    /// Nodes by their colour, each in the order given.
    fn by_colour(&self, nodes: &[u32]) -> Vec<Vec<u32>> {
        let mut out = vec![Vec::new(); self.colours];
        nodes.iter().for_each(|&v| out[self.colour_of[v as usize] as usize].push(v));
        out
    }

    /// Gathers what is around node `v`.
    fn gather(&self, nodes: &[Point], v: u32, star: &mut Star) {
        star.clear();
        let position = |n: u32| nodes[n as usize];
        for &f in self.facets_of.get(v) {
            let facet = self.facets[f as usize];
            let k = facet.iter().position(|n| *n == v).unwrap_or(0);
            star.add_facet(facet.map(position), k);
        }
        for &t in self.tets_of.get(v) {
            let tet = self.tets[t as usize];
            let k = tet.iter().position(|n| *n == v).unwrap_or(0);
            let spacing_mm = tet.iter().map(|n| self.spacings[*n as usize]).fold(f64::INFINITY, f64::min);
            star.add_tet(tet.map(position), k, spacing_mm);
        }
    }

    /// Seeks a better position for node `v` if its score is below `below`: towards its neighbours' centre, then, where
    /// that is not enough, in the directions.
    fn try_node(&self, nodes: &[Point], v: u32, below: f64, directions: &[Vector], star: &mut Star) -> Tried {
        self.gather(nodes, v, star);
        let (from, spacing_mm) = (nodes[v as usize], self.spacings[v as usize]);
        let now = star.score(self.targets, from, f64::NEG_INFINITY);
        if now >= below {
            return Tried::Good;
        }
        let enough = ENOUGH * below;
        let normal = star.normal(from, 1e-12 * spacing_mm * spacing_mm);
        let on_surface = star.on_surface();
        let flat = |d: Vector| normal.map_or(d, |n| d - n * d.dot(&n));
        let centre = star.centre() - from;
        let (mut best, mut best_score) = (from, now);
        for part in TOWARDS_CENTRE {
            let to = from + flat(centre) * part;
            let score = star.score(self.targets, to, best_score);
            if score > best_score {
                (best, best_score) = (to, score);
            }
        }
        'search: for step in STEPS {
            // Twice from each length: the second time from where the first arrived.
            for _ in 0..2 {
                let base = best;
                for d in directions {
                    if best_score >= enough {
                        break 'search;
                    }
                    let to = base + flat(*d) * (step * spacing_mm);
                    let score = star.score(self.targets, to, best_score);
                    if score > best_score {
                        (best, best_score) = (to, score);
                    }
                }
            }
        }
        if best_score <= now {
            return Tried::Stuck;
        }
        let Some(normal) = normal.filter(|_| on_surface) else {
            return if on_surface { Tried::Stuck } else { Tried::Better(best) };
        };
        // Back onto the surface; of the whole move and its halves the first that still helps is taken.
        let was_off = self.body.value(&from).abs();
        let mut way = best - from;
        for _ in 0..3 {
            let (to, off) = self.onto_surface(from + way, normal, spacing_mm);
            if off <= was_off.max(1e-3 * spacing_mm) && star.score(self.targets, to, now) > now {
                return Tried::Better(to);
            }
            way *= 0.5;
        }
        Tried::Stuck
    }

    /// The point on the surface reached from `p` along the normal by the secant method, and the body's value
    /// left there (absolute, mm).
    fn onto_surface(&self, p: Point, normal: Vector, spacing_mm: f64) -> (Point, f64) {
        let (mut s0, mut f0) = (0.0, self.body.value(&p));
        if f0.abs() < 1e-4 * spacing_mm {
            return (p, f0.abs());
        }
        // Near the surface the value is about the distance.
        let mut s1 = -f0;
        let mut f1 = self.body.value(&(p + normal * s1));
        for _ in 0..4 {
            if f1.abs() < 1e-4 * spacing_mm || (f1 - f0).abs() < f64::MIN_POSITIVE {
                break;
            }
            let s2 = s1 - f1 * (s1 - s0) / (f1 - f0);
            (s0, f0) = (s1, f1);
            s1 = s2;
            f1 = self.body.value(&(p + normal * s1));
        }
        // Not a number or a step far away: left to the caller to refuse.
        let off = if f1.is_finite() && s1.abs() < spacing_mm { f1.abs() } else { f64::INFINITY };
        (p + normal * s1, off)
    }

    /// Moves surface nodes off the surface by what the facets' middles lie within it (or beyond it, in a hollow), so that
    /// facets are neither inscribed nor circumscribed: the volume is right to second order, and the mean distance halved.
    /// Where the body has an edge or a corner the node goes there instead. Where a plate will touch, nodes stay on the body:
    /// it is nodes that a plate meets, and it is to meet them where it would meet the body.
    fn lift(&self, nodes: &mut [Point]) {
        let planes: Vec<Tangent> = (self.facets.par_iter()).map(|f| self.tangent(nodes, f)).collect();
        let on = |v: &u32| {
            let active = self.colour_of[*v as usize] != INACTIVE;
            active && !self.facets_of.get(*v).is_empty() && !self.targets.touched(nodes[*v as usize].z)
        };
        let on: Vec<u32> = (0..nodes.len() as u32).filter(on).collect();
        for colour in self.by_colour(&on) {
            let moves: Vec<Option<Point>> = (colour.par_iter())
                .with_min_len(16)
                .map_init(Star::default, |star, &v| {
                    self.gather(nodes, v, star);
                    let (from, spacing_mm) = (nodes[v as usize], self.spacings[v as usize]);
                    let normal = star.normal(from, 1e-12 * spacing_mm * spacing_mm)?;
                    let around = self.facets_of.get(v).iter().map(|&f| planes[f as usize]);
                    let count = around.len() as f64;
                    let now = star.score(self.targets, from, f64::NEG_INFINITY);
                    if let Some(way) = to_edge(around.clone(), from, EDGE_REACH * spacing_mm) {
                        for part in TO_EDGE {
                            let to = from + way * part;
                            if star.score(self.targets, to, f64::NEG_INFINITY) >= now.min(AT_EDGE) {
                                return Some(to);
                            }
                        }
                        return None;
                    }
                    let mean = around.map(|p| p.depth).sum::<f64>() / count;
                    let most = MOST_LIFT * spacing_mm;
                    let to = from + normal * (MEAN_OVER_CENTRE * mean).clamp(-most, most);
                    (star.score(self.targets, to, f64::NEG_INFINITY) >= now.min(1.0)).then_some(to)
                })
                .collect();
            for (&v, to) in colour.iter().zip(moves) {
                if let Some(to) = to {
                    nodes[v as usize] = to;
                }
            }
        }
    }

    /// The plane that touches the body nearest to a facet's centre.
    fn tangent(&self, nodes: &[Point], facet: &[u32; 3]) -> Tangent {
        let [a, b, c] = facet.map(|n| nodes[n as usize]);
        let centre = Point::from((a.coords + b.coords + c.coords) / 3.0);
        let across = (b - a).cross(&(c - a));
        let depth = -self.body.value(&centre);
        let flat = across.try_normalize(0.0).unwrap_or_else(Vector::zeros);
        if !depth.is_finite() {
            return Tangent { at: centre, normal: flat, depth: 0.0 };
        }
        // A shallow facet on a smooth body: its own plane is as good as the body's slope would.
        if depth.abs() < SHALLOW * across.norm().sqrt() {
            return Tangent { at: centre + flat * depth, normal: flat, depth };
        }
        let step = 0.02 * across.norm().sqrt();
        let at = centre + flat * depth;
        let slope = Vector::from([0, 1, 2].map(|k| {
            let mut d = Vector::zeros();
            d[k] = step;
            self.body.value(&(at + d)) - self.body.value(&(at - d))
        }));
        let normal = slope.try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite())).unwrap_or(flat);
        Tangent { at, normal, depth }
    }
}

/// A plane that touches the body, and how deep the facet's centre lies below the body's surface, mm.
#[derive(Debug, Clone, Copy)]
struct Tangent {
    at: Point,
    normal: Vector,
    depth: f64,
}

/// The way from a node to the edge or corner in which the planes around it meet: where the squares of its distances from
/// them are least, moved only in directions that the planes decide (Garland and Heckbert 1997; Ohtake and Belyaev 2002).
/// `None` where they are nearly one plane, or meet farther than `reach_mm` away.
fn to_edge(planes: impl Iterator<Item = Tangent> + Clone, from: Point, reach_mm: f64) -> Option<Vector> {
    let sharpest = planes.clone().flat_map(|p| planes.clone().map(move |q| p.normal.dot(&q.normal)));
    if sharpest.fold(1.0, f64::min) > SHARP {
        return None;
    }
    let (mut matrix, mut right) = (nalgebra::Matrix3::zeros(), Vector::zeros());
    for p in planes {
        matrix += p.normal * p.normal.transpose();
        right += p.normal * p.normal.dot(&(p.at - from));
    }
    let eigen = matrix.symmetric_eigen();
    let most = eigen.eigenvalues.max();
    let mut way = Vector::zeros();
    for k in 0..3 {
        if eigen.eigenvalues[k] > DECIDED * most {
            let d = eigen.eigenvectors.column(k);
            way += d * (d.dot(&right) / eigen.eigenvalues[k]);
        }
    }
    (way.norm() <= reach_mm).then_some(way)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_in_a_corner_and_two_in_an_edge() {
        let plane = |n: [f64; 3]| Tangent { at: Point::from(n), normal: Vector::from(n), depth: 0.0 };
        let from = Point::new(0.9, 0.9, 0.7);
        let three = [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(plane);
        let way = to_edge(three.into_iter(), from, 1.0).unwrap();
        assert!((from + way - Point::new(1.0, 1.0, 1.0)).norm() < 1e-12);
        let way = to_edge(three.into_iter().take(2), from, 1.0).unwrap();
        assert!((from + way - Point::new(1.0, 1.0, 0.7)).norm() < 1e-12);
        assert_eq!(to_edge(three.into_iter().take(1), from, 1.0), None);
        assert_eq!(to_edge(three.into_iter(), from, 0.1), None);
    }
}

//! Smoothing: nodes move to where their worst tetrahedron or facet gets better.
//!
//! A node's score is the worst of its tetrahedra (least sine of a dihedral angle) and of its facets (least sine of
//! an angle), each over its target; it is negative where a promised size is broken. A move is accepted only if the
//! score rises, so no part of the mesh ever gets worse than it was (Freitag and Ollivier-Gooch, Int. J. Numer.
//! Meth. Engng 40, 1997). Surface nodes move along the surface and are put back onto it. Nodes are coloured so that
//! two of one colour share no tetrahedron: a colour moves at once, in parallel, with the same result on any number
//! of threads.

use super::score;
use super::tetmesh::{boundary, face_nodes};
use super::{Controls, TetMesh};
use crate::geometry::{ImplicitBody, Point, Vector};
use rayon::prelude::*;

/// Passes over all nodes, then over those that are below their target.
const PASSES: [usize; 2] = [3, 12];
/// Dihedral angle below which a tetrahedron is worth work, degrees.
const TARGET_DIHEDRAL_DEG: f64 = 20.0;
/// The same for facets, above what was promised, degrees.
const FACET_MARGIN_DEG: f64 = 3.0;
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

/// Improves a mesh in place; its topology stays.
pub(super) fn improve(body: &dyn ImplicitBody, controls: &Controls, spacing_mm: f64, mesh: &mut TetMesh) {
    let smoother = Smoother::new(body, controls, spacing_mm, &mesh.tets, mesh.nodes.len());
    let colours = smoother.colours();
    for pass in 0..PASSES[0] + PASSES[1] {
        let only_bad = pass >= PASSES[0];
        for colour in &colours {
            let moves: Vec<Option<Point>> =
                colour.par_iter().map(|&v| smoother.better_place(&mesh.nodes, v, only_bad)).collect();
            for (&v, to) in colour.iter().zip(moves) {
                if let Some(to) = to {
                    mesh.nodes[v as usize] = to;
                }
            }
        }
    }
}

/// Numbers of the things around each node, in one list.
struct Around {
    start: Vec<u32>,
    items: Vec<u32>,
}

impl Around {
    fn of<const N: usize>(things: &[[u32; N]], nodes: usize) -> Self {
        let mut start = vec![0u32; nodes + 1];
        things.iter().flatten().for_each(|&n| start[n as usize + 1] += 1);
        for i in 0..nodes {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut items = vec![0; N * things.len()];
        for (i, thing) in things.iter().enumerate() {
            for &n in thing {
                items[next[n as usize] as usize] = i as u32;
                next[n as usize] += 1;
            }
        }
        Self { start, items }
    }
    fn get(&self, node: u32) -> &[u32] {
        &self.items[self.start[node as usize] as usize..self.start[node as usize + 1] as usize]
    }
}

struct Smoother<'a> {
    body: &'a dyn ImplicitBody,
    spacing_mm: f64,
    largest_radius_mm: f64,
    largest_volume_mm3: f64,
    facet_sine: f64,
    tet_sine: f64,
    tets: &'a [[u32; 4]],
    facets: Vec<[u32; 3]>,
    tets_of: Around,
    facets_of: Around,
}

impl<'a> Smoother<'a> {
    fn new(
        body: &'a dyn ImplicitBody,
        controls: &Controls,
        spacing_mm: f64,
        tets: &'a [[u32; 4]],
        nodes: usize,
    ) -> Self {
        let facets: Vec<[u32; 3]> = boundary(tets).into_iter().map(|(t, f)| face_nodes(tets, t, f)).collect();
        Self {
            body,
            spacing_mm,
            largest_radius_mm: controls.surface_size_mm,
            largest_volume_mm3: controls.tet_volume_mm3,
            facet_sine: (controls.facet_angle_deg + FACET_MARGIN_DEG).to_radians().sin(),
            tet_sine: TARGET_DIHEDRAL_DEG.to_radians().sin(),
            tets_of: Around::of(tets, nodes),
            facets_of: Around::of(&facets, nodes),
            tets,
            facets,
        }
    }

    /// Nodes by colour, greedily in their order.
    fn colours(&self) -> Vec<Vec<u32>> {
        let nodes = self.tets_of.start.len() - 1;
        let mut colour_of = vec![u32::MAX; nodes];
        let mut colours: Vec<Vec<u32>> = Vec::new();
        let mut taken: Vec<u32> = Vec::new();
        for v in 0..nodes as u32 {
            taken.clear();
            let neighbours = self.tets_of.get(v).iter().flat_map(|&t| self.tets[t as usize]);
            taken.extend(neighbours.map(|n| colour_of[n as usize]).filter(|c| *c != u32::MAX));
            taken.sort_unstable();
            taken.dedup();
            let free =
                taken.iter().enumerate().find(|(i, c)| *i as u32 != **c).map_or(taken.len(), |(i, _)| i);
            colour_of[v as usize] = free as u32;
            if free == colours.len() {
                colours.push(Vec::new());
            }
            colours[free].push(v);
        }
        colours
    }

    /// The score of node `v` if it were at `at`; the search stops, with some score below, under `floor`.
    fn score(&self, nodes: &[Point], v: u32, at: Point, floor: f64) -> f64 {
        let place = |n: u32| if n == v { at } else { nodes[n as usize] };
        let mut score = f64::INFINITY;
        for &f in self.facets_of.get(v) {
            let (radius, sine) = score::circumradius_and_least_sine(&self.facets[f as usize].map(place));
            let excess = radius / self.largest_radius_mm;
            score = score.min(if excess > 1.0 { 1.0 - excess } else { sine / self.facet_sine });
            // A facet without area has no radius: not a number, which `min` would pass over.
            if score < floor || radius.is_nan() {
                return f64::NEG_INFINITY;
            }
        }
        for &t in self.tets_of.get(v) {
            let (volume, sine) = score::volume_and_least_sine(&self.tets[t as usize].map(place));
            let excess = volume / self.largest_volume_mm3;
            score = score.min(if excess > 1.0 { 1.0 - excess } else { sine / self.tet_sine });
            if score < floor || volume.is_nan() || volume <= 0.0 {
                return f64::NEG_INFINITY;
            }
        }
        score
    }

    /// A better place for node `v`, if one is found.
    fn better_place(&self, nodes: &[Point], v: u32, only_bad: bool) -> Option<Point> {
        let from = nodes[v as usize];
        let now = self.score(nodes, v, from, f64::NEG_INFINITY);
        if only_bad && now >= 1.0 {
            return None;
        }
        let normal = self.normal(nodes, v);
        let on_surface = !self.facets_of.get(v).is_empty();
        let flat = |d: Vector| normal.map_or(d, |n| d - n * d.dot(&n));
        let centre = self.centre(nodes, v) - from;
        let (mut best, mut best_score) = (from, now);
        let consider = |to: Point, best: &mut Point, best_score: &mut f64| {
            let score = self.score(nodes, v, to, *best_score);
            if score > *best_score {
                (*best, *best_score) = (to, score);
            }
        };
        for part in TOWARDS_CENTRE {
            consider(from + flat(centre) * part, &mut best, &mut best_score);
        }
        for step in STEPS {
            // Twice from each length: the second time from where the first arrived.
            for _ in 0..2 {
                let base = best;
                for d in DIRECTIONS {
                    consider(
                        base + flat(Vector::from(d)) * (step * self.spacing_mm),
                        &mut best,
                        &mut best_score,
                    );
                }
            }
        }
        if best_score <= now {
            return None;
        }
        let Some(normal) = normal.filter(|_| on_surface) else {
            return (!on_surface).then_some(best);
        };
        // Back onto the surface; of the whole move and its halves the first that still helps is taken.
        let was_off = self.body.value(&from).abs();
        let mut way = best - from;
        for _ in 0..3 {
            let (to, off) = self.onto_surface(from + way, normal);
            if off <= was_off.max(1e-3 * self.spacing_mm) && self.score(nodes, v, to, now) > now {
                return Some(to);
            }
            way *= 0.5;
        }
        None
    }

    /// The unit normal at a surface node from its facets; `None` inside, or where the facets' normals cancel.
    fn normal(&self, nodes: &[Point], v: u32) -> Option<Vector> {
        let sum: Vector = self
            .facets_of
            .get(v)
            .iter()
            .map(|&f| {
                let [a, b, c] = self.facets[f as usize].map(|n| nodes[n as usize]);
                (b - a).cross(&(c - a))
            })
            .sum();
        sum.try_normalize(1e-12 * self.spacing_mm * self.spacing_mm)
    }

    /// The mean of the neighbours: of those on the surface for a surface node.
    fn centre(&self, nodes: &[Point], v: u32) -> Point {
        let (mut sum, mut count) = (Vector::zeros(), 0.0);
        let mut add = |n: u32| {
            if n != v {
                sum += nodes[n as usize].coords;
                count += 1.0;
            }
        };
        if self.facets_of.get(v).is_empty() {
            self.tets_of.get(v).iter().for_each(|&t| self.tets[t as usize].into_iter().for_each(&mut add));
        } else {
            self.facets_of
                .get(v)
                .iter()
                .for_each(|&f| self.facets[f as usize].into_iter().for_each(&mut add));
        }
        (sum / count).into()
    }

    /// The place on the surface reached from `p` along the normal by the secant method, and the body's value left
    /// there (absolute, mm).
    fn onto_surface(&self, p: Point, normal: Vector) -> (Point, f64) {
        let (mut s0, mut f0) = (0.0, self.body.value(&p));
        if f0.abs() < 1e-5 * self.spacing_mm {
            return (p, f0.abs());
        }
        // Near the surface the value is about the distance.
        let mut s1 = -f0;
        let mut f1 = self.body.value(&(p + normal * s1));
        for _ in 0..4 {
            if f1.abs() < 1e-5 * self.spacing_mm || (f1 - f0).abs() < f64::MIN_POSITIVE {
                break;
            }
            let s2 = s1 - f1 * (s1 - s0) / (f1 - f0);
            (s0, f0) = (s1, f1);
            s1 = s2;
            f1 = self.body.value(&(p + normal * s1));
        }
        // Not a number or a step far away: left to the caller to refuse.
        let off = if f1.is_finite() && s1.abs() < self.spacing_mm { f1.abs() } else { f64::INFINITY };
        (p + normal * s1, off)
    }
}

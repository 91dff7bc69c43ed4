//! Smoothing: nodes move to where their worst tetrahedron or facet gets better.
//!
//! A node's score is the worst of its tetrahedra (least sine of a dihedral angle, smallest altitude) and
//! of its facets (least sine of an angle), each over its target; a broken promise makes it negative, so
//! that it comes before every wish. A move is accepted only if the score rises, so no part of the mesh
//! ever gets worse than it was (Freitag and Ollivier-Gooch, Int. J. Numer. Meth. Engng 40, 1997). Surface
//! nodes move along the surface and are put back onto it. Nodes are coloured so that two of one colour
//! share no tetrahedron: a colour moves at once, in parallel, with the same result on any number of
//! threads.

use super::TetMesh;
use super::star::{Star, Targets};
use super::tetmesh::{boundary, face_nodes};
use crate::geometry::{ImplicitBody, Point, Vector};
use nalgebra::Rotation3;
use rayon::prelude::*;

/// Passes over all nodes, then over those that are below their target.
const PASSES: [usize; 2] = [3, 20];
/// Score from which a node is left alone in the first passes too: a lattice node far from the surface has
/// 2.0, and no place is better.
const GOOD: f64 = 1.4;
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
pub(super) fn improve(body: &dyn ImplicitBody, targets: &Targets, spacings: &[f64], mesh: &mut TetMesh) {
    let smoother = Smoother::new(body, targets, spacings, &mesh.tets, mesh.nodes.len());
    let colours = smoother.colours();
    for pass in 0..PASSES[0] + PASSES[1] {
        // Other directions in each pass: a node that none of one set helps may be helped by the next.
        let turn = Rotation3::from_scaled_axis(Vector::new(0.7, 1.1, 0.4) * pass as f64);
        let directions = DIRECTIONS.map(|d| turn * Vector::from(d));
        let enough = if pass < PASSES[0] { GOOD } else { 1.0 };
        for colour in &colours {
            let moves: Vec<Option<Point>> = (colour.par_iter())
                .map_init(Star::default, |star, &v| {
                    smoother.better_place(&mesh.nodes, v, enough, &directions, star)
                })
                .collect();
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
    spacings: &'a [f64],
    targets: &'a Targets,
    tets: &'a [[u32; 4]],
    facets: Vec<[u32; 3]>,
    tets_of: Around,
    facets_of: Around,
}

impl<'a> Smoother<'a> {
    fn new(
        body: &'a dyn ImplicitBody,
        targets: &'a Targets,
        spacings: &'a [f64],
        tets: &'a [[u32; 4]],
        nodes: usize,
    ) -> Self {
        let facets: Vec<[u32; 3]> = boundary(tets).into_iter().map(|(t, f)| face_nodes(tets, t, f)).collect();
        Self {
            body,
            spacings,
            targets,
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

    /// Gathers what is around node `v`.
    fn gather(&self, nodes: &[Point], v: u32, star: &mut Star) {
        star.clear();
        let place = |n: u32| nodes[n as usize];
        for &f in self.facets_of.get(v) {
            let facet = self.facets[f as usize];
            let k = facet.iter().position(|n| *n == v).unwrap_or(0);
            star.add_facet(facet.map(place), k);
        }
        for &t in self.tets_of.get(v) {
            let tet = self.tets[t as usize];
            let k = tet.iter().position(|n| *n == v).unwrap_or(0);
            star.add_tet(tet.map(place), k);
        }
    }

    /// A better place for node `v`, if its score is below `enough` and a better one is found.
    fn better_place(
        &self,
        nodes: &[Point],
        v: u32,
        enough: f64,
        directions: &[Vector],
        star: &mut Star,
    ) -> Option<Point> {
        self.gather(nodes, v, star);
        let (from, spacing_mm) = (nodes[v as usize], self.spacings[v as usize]);
        let targets = self.targets.at(spacing_mm);
        let now = star.score(&targets, from, f64::NEG_INFINITY);
        if now >= enough {
            return None;
        }
        let normal = star.normal(from, 1e-12 * spacing_mm * spacing_mm);
        let on_surface = star.on_surface();
        let flat = |d: Vector| normal.map_or(d, |n| d - n * d.dot(&n));
        let centre = star.centre() - from;
        let (mut best, mut best_score) = (from, now);
        let mut consider = |to: Point, best: &mut Point| {
            let score = star.score(&targets, to, best_score);
            if score > best_score {
                (*best, best_score) = (to, score);
            }
        };
        for part in TOWARDS_CENTRE {
            consider(from + flat(centre) * part, &mut best);
        }
        for step in STEPS {
            // Twice from each length: the second time from where the first arrived.
            for _ in 0..2 {
                let base = best;
                for d in directions {
                    consider(base + flat(*d) * (step * spacing_mm), &mut best);
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
            let (to, off) = self.onto_surface(from + way, normal, spacing_mm);
            if off <= was_off.max(1e-3 * spacing_mm) && star.score(&targets, to, now) > now {
                return Some(to);
            }
            way *= 0.5;
        }
        None
    }

    /// The place on the surface reached from `p` along the normal by the secant method, and the body's value
    /// left there (absolute, mm).
    fn onto_surface(&self, p: Point, normal: Vector, spacing_mm: f64) -> (Point, f64) {
        let (mut s0, mut f0) = (0.0, self.body.value(&p));
        if f0.abs() < 1e-5 * spacing_mm {
            return (p, f0.abs());
        }
        // Near the surface the value is about the distance.
        let mut s1 = -f0;
        let mut f1 = self.body.value(&(p + normal * s1));
        for _ in 0..4 {
            if f1.abs() < 1e-5 * spacing_mm || (f1 - f0).abs() < f64::MIN_POSITIVE {
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
}

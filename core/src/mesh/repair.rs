//! Manifold repair: the lattice is cut again until the surface is manifold.
//!
//! Where a body is thin, or grazes lattice points, two sheets of its surface can meet in a warped point. Cuts
//! alone cannot do that: without warped points the surface in each lattice tetrahedron is one triangle or
//! quadrilateral, and each edge and fan closes. So the warped points at a fault are put back, to be inside or
//! outside, and the lattice is cut again. Each round puts back at least one point, and few rounds are needed.

use super::TetMesh;
use super::cut::Field;
use super::faces::boundary_triangles;
use super::stencil;
use crate::geometry::{ImplicitBody, Point};

/// After so many rounds every warped point is put back at once.
const ROUNDS: usize = 40;

/// A body's tetrahedra as the stencils leave them.
#[derive(Debug)]
pub(super) struct Filled {
    pub(super) mesh: TetMesh,
    /// The spacing of the background grid at each node, mm.
    pub(super) spacings: Vec<f64>,
    /// The surface: nodes of each facet, counter-clockwise seen from outside.
    pub(super) facets: Vec<[u32; 3]>,
}

/// The tetrahedra of a body, their surface manifold, possibly in several pieces.
pub(super) fn fill(body: &dyn ImplicitBody, field: &Field) -> Filled {
    let points = field.background.len();
    let all = points + field.cut_count();
    let mut kept = vec![false; points];
    for round in 0..=ROUNDS {
        let warped = field.warp(&kept);
        let tets = stencil::cut_all(body, field, &warped);
        // Only faces between nodes on the surface can be faces of the body.
        let on = |n: u32| n as usize >= points || warped.side[n as usize] == 0;
        let facets = boundary_triangles(&tets, all, on);
        let faulty = faulty_nodes(&facets, all);
        if faulty.is_empty() {
            return compact(tets, facets, all, |n| (warped.position(field, n), field.spacing_mm(n)));
        }
        if round + 1 >= ROUNDS {
            kept.fill(true);
        }
        for n in faulty.into_iter().map(|n| n as usize).filter(|n| *n < points) {
            kept[n] = true;
        }
    }
    unreachable!("a lattice without warped points has a manifold surface")
}

/// Nodes at which the surface is not manifold: on an edge with other than two triangles, or with several
/// fans.
fn faulty_nodes(triangles: &[[u32; 3]], nodes: usize) -> Vec<u32> {
    let mut faulty = Vec::new();
    let mut edges: Vec<(u32, u32)> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)].map(|(p, q)| (p.min(q), p.max(q))))
        .collect();
    edges.sort_unstable();
    for group in edges.chunk_by(|a, b| a == b).filter(|g| g.len() != 2) {
        faulty.extend([group[0].0, group[0].1]);
    }
    // The triangles of each vertex, then their number of fans: triangles joined by edges at the vertex.
    let mut start = vec![0u32; nodes + 1];
    triangles.iter().flatten().for_each(|&n| start[n as usize + 1] += 1);
    for i in 0..nodes {
        start[i + 1] += start[i];
    }
    let mut next = start.clone();
    let mut links = vec![[0u32; 2]; 3 * triangles.len()];
    for &[a, b, c] in triangles {
        for [v, p, q] in [[a, b, c], [b, c, a], [c, a, b]] {
            links[next[v as usize] as usize] = [p, q];
            next[v as usize] += 1;
        }
    }
    for v in 0..nodes {
        let link = &links[start[v] as usize..start[v + 1] as usize];
        if !link.is_empty() && !is_one_fan(link) {
            faulty.push(v as u32);
        }
    }
    faulty.sort_unstable();
    faulty.dedup();
    faulty
}

/// Whether walking along a vertex's ring from its first triangle passes all its triangles.
fn is_one_fan(link: &[[u32; 2]]) -> bool {
    let mut at = link[0][1];
    let mut steps = 1;
    while at != link[0][0] && steps <= link.len() {
        let Some(next) = link.iter().find(|l| l[0] == at) else { return false };
        at = next[1];
        steps += 1;
    }
    steps == link.len()
}

/// The nodes that are used, in their order, and what is between them.
fn compact(
    mut tets: Vec<[u32; 4]>,
    mut facets: Vec<[u32; 3]>,
    nodes: usize,
    of: impl Fn(u32) -> (Point, f64),
) -> Filled {
    let mut number = vec![u32::MAX; nodes];
    tets.iter().flatten().for_each(|&n| number[n as usize] = 0);
    let (mut positions, mut spacings) = (Vec::new(), Vec::new());
    for (n, slot) in number.iter_mut().enumerate().filter(|(_, slot)| **slot == 0) {
        *slot = positions.len() as u32;
        let (position, spacing) = of(n as u32);
        positions.push(position);
        spacings.push(spacing);
    }
    tets.iter_mut().flatten().for_each(|n| *n = number[*n as usize]);
    facets.iter_mut().flatten().for_each(|n| *n = number[*n as usize]);
    Filled { mesh: TetMesh::new(positions, tets), spacings, facets }
}

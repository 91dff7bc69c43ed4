//! Connected components of a mesh; the largest is kept.

use super::TetMesh;
use super::repair::Filled;
use super::score;

/// Keeps the piece of greatest volume and the nodes that it uses, in their order.
pub(super) fn largest(filled: Filled) -> Filled {
    let Filled { mesh, spacings, facets } = filled;
    let piece = label(&mesh);
    let count = piece.iter().max().map_or(0, |m| *m as usize + 1);
    if count == 1 {
        return Filled { mesh, spacings, facets };
    }
    let mut volume = vec![0.0; count];
    for (t, &c) in piece.iter().enumerate() {
        volume[c as usize] += score::volume(&mesh.corners(t));
    }
    // The first of equals, so that the choice does not depend on anything else.
    let best = (0..count).fold(0, |b, c| if volume[c] > volume[b] { c } else { b });
    let mut number = vec![u32::MAX; mesh.nodes.len()];
    let kept: Vec<[u32; 4]> =
        mesh.tets.iter().zip(&piece).filter(|(_, c)| **c as usize == best).map(|(t, _)| *t).collect();
    kept.iter().flatten().for_each(|&n| number[n as usize] = 0);
    let (mut nodes, mut kept_spacings) = (Vec::new(), Vec::new());
    for (i, p) in number.iter_mut().enumerate().filter(|(_, p)| **p == 0) {
        *p = nodes.len() as u32;
        nodes.push(mesh.nodes[i]);
        kept_spacings.push(spacings[i]);
    }
    let tets = kept.iter().map(|t| t.map(|n| number[n as usize])).collect();
    let facets = facets.iter().map(|f| f.map(|n| number[n as usize])).filter(|f| f[0] != u32::MAX).collect();
    let mesh = TetMesh { nodes, tets, dropped_pieces: count.saturating_sub(1) };
    Filled { mesh, spacings: kept_spacings, facets }
}

/// The number of each tetrahedron's piece, in the order of first tetrahedra. Pieces of a mesh whose surface is manifold
/// share no node, so whatever shares one hangs together.
fn label(mesh: &TetMesh) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    let root = |parent: &mut Vec<u32>, mut n: u32| {
        while parent[n as usize] != n {
            parent[n as usize] = parent[parent[n as usize] as usize];
            n = parent[n as usize];
        }
        n
    };
    for t in &mesh.tets {
        let mut a = root(&mut parent, t[0]);
        for &n in &t[1..] {
            let b = root(&mut parent, n);
            parent[a.max(b) as usize] = a.min(b);
            a = a.min(b);
        }
    }
    let mut number = vec![u32::MAX; mesh.nodes.len()];
    let mut count = 0;
    let mut of = |t: &[u32; 4]| {
        let slot = &mut number[root(&mut parent, t[0]) as usize];
        if *slot == u32::MAX {
            *slot = count;
            count += 1;
        }
        *slot
    };
    mesh.tets.iter().map(&mut of).collect()
}

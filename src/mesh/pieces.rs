//! Pieces of a mesh that hang together by faces; the largest is kept.

use super::TetMesh;
use super::score;
use super::tetmesh::sorted_faces;

/// Keeps the piece of greatest volume and the nodes that it uses, in their order; `spacings` are kept with them.
pub(super) fn largest(mesh: TetMesh, spacings: &mut Vec<f64>) -> TetMesh {
    let piece = label(&mesh.tets);
    let count = piece.iter().max().map_or(0, |m| *m as usize + 1);
    if count == 1 {
        return mesh;
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
    for (i, p) in number.iter_mut().enumerate() {
        if *p == 0 {
            *p = nodes.len() as u32;
            nodes.push(mesh.nodes[i]);
            kept_spacings.push(spacings[i]);
        }
    }
    *spacings = kept_spacings;
    let tets = kept.iter().map(|t| t.map(|n| number[n as usize])).collect();
    TetMesh { nodes, tets, dropped_pieces: count.saturating_sub(1) }
}

/// The number of each tetrahedron's piece, in the order of first tetrahedra.
fn label(tets: &[[u32; 4]]) -> Vec<u32> {
    let mut neighbours = vec![[u32::MAX; 4]; tets.len()];
    for pair in sorted_faces(tets).windows(2).filter(|w| w[0].0 == w[1].0) {
        neighbours[pair[0].1 as usize][pair[0].2 as usize] = pair[1].1;
        neighbours[pair[1].1 as usize][pair[1].2 as usize] = pair[0].1;
    }
    let mut piece = vec![u32::MAX; tets.len()];
    let mut count = 0;
    for seed in 0..tets.len() {
        if piece[seed] != u32::MAX {
            continue;
        }
        piece[seed] = count;
        let mut todo = vec![seed as u32];
        while let Some(t) = todo.pop() {
            for &n in neighbours[t as usize].iter().filter(|n| **n != u32::MAX) {
                if piece[n as usize] == u32::MAX {
                    piece[n as usize] = count;
                    todo.push(n);
                }
            }
        }
        count += 1;
    }
    piece
}

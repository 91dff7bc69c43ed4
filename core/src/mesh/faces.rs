//! Face adjacency: the faces of tetrahedra gathered by their least node, boundary, node-to-element lists.

use rayon::prelude::*;

/// The faces of a tetrahedron as indices into its list of nodes, counter-clockwise seen from outside, in the
/// order of Abaqus' and `CalculiX`' S1 to S4.
pub const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

/// Nodes whose faces one piece of parallel work sorts.
const NODES_AT_A_TIME: usize = 2048;

/// A face: its middle and greatest node, and four times its tetrahedron plus its index in [`FACES`].
type Entry = (u32, u32, u32);

/// Every face of some tetrahedra, equal faces side by side, in an order that does not depend on threads. Linear in the
/// number of tetrahedra (at most 2³⁰), as only few faces share their least node.
pub(super) struct Faces {
    /// For each node where the faces whose least node it is start; one entry more than nodes.
    start: Vec<u32>,
    entries: Vec<Entry>,
}

/// Equal faces.
pub(super) struct Group<'a> {
    /// The nodes, rising.
    pub(super) nodes: [u32; 3],
    entries: &'a [Entry],
}

impl Group<'_> {
    /// How many tetrahedra have the face.
    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }
    /// The tetrahedron and the index of the face in [`FACES`].
    pub(super) fn side(&self, i: usize) -> (u32, u8) {
        (self.entries[i].2 >> 2, (self.entries[i].2 & 3) as u8)
    }
}

impl Faces {
    /// Of those faces of `tets` whose nodes are all `wanted`; node numbers are below `nodes`.
    pub(super) fn of(tets: &[[u32; 4]], nodes: usize, wanted: impl Fn(u32) -> bool) -> Self {
        let each = |t: &[u32; 4], f: u8| {
            let [a, b, c] = FACES[f as usize].map(|i| t[i]);
            // Of three numbers the least, the middle and the greatest.
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            (wanted(a) && wanted(b) && wanted(c)).then_some([low, a ^ b ^ c ^ low ^ high, high])
        };
        let mut start = vec![0u32; nodes + 1];
        for t in tets {
            for f in 0..4 {
                if let Some([a, ..]) = each(t, f) {
                    start[a as usize + 1] += 1;
                }
            }
        }
        for i in 0..nodes {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut entries = vec![(0, 0, 0); start[nodes] as usize];
        for (i, t) in tets.iter().enumerate() {
            for f in 0..4 {
                if let Some([a, b, c]) = each(t, f) {
                    let at = &mut next[a as usize];
                    entries[*at as usize] = (b, c, (i as u32) << 2 | u32::from(f));
                    *at += 1;
                }
            }
        }
        // Pieces of the list at nodes' borders, sorted side by side.
        let mut pieces: Vec<(&mut [Entry], &[u32])> = Vec::new();
        let mut rest = entries.as_mut_slice();
        for first in (0..nodes).step_by(NODES_AT_A_TIME) {
            let last = (first + NODES_AT_A_TIME).min(nodes);
            let (piece, after) = rest.split_at_mut((start[last] - start[first]) as usize);
            pieces.push((piece, &start[first..=last]));
            rest = after;
        }
        pieces.into_par_iter().for_each(|(piece, start)| {
            for pair in start.windows(2) {
                piece[(pair[0] - start[0]) as usize..(pair[1] - start[0]) as usize].sort_unstable();
            }
        });
        Self { start, entries }
    }

    /// Equal faces together, in the order of their least nodes.
    pub(super) fn groups(&self) -> impl Iterator<Item = Group<'_>> {
        self.start.windows(2).enumerate().flat_map(|(a, pair)| {
            self.entries[pair[0] as usize..pair[1] as usize]
                .chunk_by(|x, y| (x.0, x.1) == (y.0, y.1))
                .map(move |entries| Group { nodes: [a as u32, entries[0].0, entries[0].1], entries })
        })
    }

    /// The faces with one tetrahedron, in the order of their tetrahedra.
    pub(super) fn boundary(&self) -> Vec<(u32, u8)> {
        let mut out: Vec<(u32, u8)> = self.groups().filter(|g| g.len() == 1).map(|g| g.side(0)).collect();
        out.sort_unstable();
        out
    }
}

/// The nodes of a tetrahedron's face, counter-clockwise seen from outside.
pub(super) fn face_nodes(tets: &[[u32; 4]], tet: u32, face: u8) -> [u32; 3] {
    FACES[face as usize].map(|i| tets[tet as usize][i])
}

/// Numbers of the things around each node, in one list.
pub(super) struct Around {
    start: Vec<u32>,
    items: Vec<u32>,
}

impl Around {
    /// Of things by their nodes, for the nodes that are wanted; nodes are numbered below `nodes`.
    pub(super) fn of<const N: usize>(
        things: &[[u32; N]],
        nodes: usize,
        wanted: impl Fn(u32) -> bool,
    ) -> Self {
        let mut start = vec![0u32; nodes + 1];
        things.iter().flatten().filter(|n| wanted(**n)).for_each(|&n| start[n as usize + 1] += 1);
        for i in 0..nodes {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut items = vec![0; start[nodes] as usize];
        for (i, thing) in things.iter().enumerate() {
            for &n in thing.iter().filter(|n| wanted(**n)) {
                items[next[n as usize] as usize] = i as u32;
                next[n as usize] += 1;
            }
        }
        Self { start, items }
    }

    /// What is around a node.
    pub(super) fn get(&self, node: u32) -> &[u32] {
        &self.items[self.start[node as usize] as usize..self.start[node as usize + 1] as usize]
    }
}

/// The nodes of the faces with one tetrahedron, counter-clockwise seen from outside.
pub(super) fn boundary_triangles(
    tets: &[[u32; 4]],
    nodes: usize,
    wanted: impl Fn(u32) -> bool,
) -> Vec<[u32; 3]> {
    Faces::of(tets, nodes, wanted).boundary().into_iter().map(|(t, f)| face_nodes(tets, t, f)).collect()
}

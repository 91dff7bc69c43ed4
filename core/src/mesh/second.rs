//! Second-order (ten-node) tetrahedra with straight edges.

use super::TetMesh;
use crate::geometry::Point;

/// The edges of a tetrahedron on which the nodes five to ten lie, as indices into its list of nodes.
///
/// ```text
///        3            4 on 0–1, 5 on 1–2, 6 on 2–0, 7 on 0–3, 8 on 1–3, 9 on 2–3
///       /|\           (Abaqus C3D10, VTK_QUADRATIC_TETRA)
///      7 9 8
///     0--6--2
///      4 | 5
///        1
/// ```
pub const MIDDLES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];

/// A body of ten-node tetrahedra with straight edges, made from one of four-node ones.
#[derive(Debug, Clone, PartialEq)]
pub struct SecondOrder {
    /// The corners' positions, in the mesh's order, then those of the middles of edges, mm.
    pub nodes: Vec<Point>,
    /// Node numbers of each tetrahedron: corners as in [`TetMesh`], then the middles in the order of [`MIDDLES`].
    pub tets: Vec<[u32; 10]>,
    /// How many corners there are.
    pub corners: usize,
    /// The two corners of each middle, the lesser first, rising.
    pub edges: Vec<[u32; 2]>,
}

impl TetMesh {
    /// The same body with a node in the middle of each edge. Edges stay straight: every element has the constant Jacobian
    /// of its four-node form.
    pub fn second_order(&self) -> SecondOrder {
        let ends = |t: &[u32; 4], [i, j]: [usize; 2]| [t[i].min(t[j]), t[i].max(t[j])];
        let mut edges: Vec<[u32; 2]> = self.tets.iter().flat_map(|t| MIDDLES.map(|m| ends(t, m))).collect();
        edges.sort_unstable();
        edges.dedup();
        // Where the edges of each lesser corner start.
        let mut start = vec![0usize; self.nodes.len() + 1];
        edges.iter().for_each(|e| start[e[0] as usize + 1] += 1);
        for i in 0..self.nodes.len() {
            start[i + 1] += start[i];
        }
        let number = |e: [u32; 2]| {
            let own = start[e[0] as usize]..start[e[0] as usize + 1];
            let at = edges[own.clone()].binary_search(&e).unwrap_or_else(|_| unreachable!("{e:?} is listed"));
            (self.nodes.len() + own.start + at) as u32
        };
        let tets = self
            .tets
            .iter()
            .map(|t| {
                let mut all = [0; 10];
                all[..4].copy_from_slice(t);
                for (slot, m) in all[4..].iter_mut().zip(MIDDLES) {
                    *slot = number(ends(t, m));
                }
                all
            })
            .collect();
        let position = |n: u32| self.nodes[n as usize];
        let middles = edges.iter().map(|e| nalgebra::center(&position(e[0]), &position(e[1])));
        let nodes = self.nodes.iter().copied().chain(middles).collect();
        SecondOrder { nodes, tets, corners: self.nodes.len(), edges }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_tetrahedra_share_the_middles_of_their_common_face() {
        let nodes =
            [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]].map(Point::from).to_vec();
        let second = TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]]).second_order();
        // Nine edges: six of the first, three more to the far node.
        assert_eq!((second.nodes.len(), second.corners), (14, 5));
        for t in &second.tets {
            for (n, [i, j]) in t[4..].iter().zip(MIDDLES) {
                let middle = nalgebra::center(&second.nodes[t[i] as usize], &second.nodes[t[j] as usize]);
                assert_eq!(second.nodes[*n as usize], middle);
            }
        }
        let shared = second.tets[0].iter().filter(|n| second.tets[1].contains(n)).count();
        assert_eq!(shared, 6);
    }
}

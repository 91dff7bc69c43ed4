//! The tetrahedral mesh: nodes (mm), connectivity, boundary, consistency check.

use super::faces::{Faces, face_nodes};
use super::score;
use crate::geometry::{MeshFault, Point, TriangleMesh};

/// A body of four-node tetrahedra.
///
/// ```text
///        3            nodes 0, 1, 2 run counter-clockwise seen from node 3 (Abaqus C3D4, VTK_TETRA):
///       /|\           the volume (x1 − x0) × (x2 − x0) · (x3 − x0) / 6 is positive
///      / | \
///     0--|--2
///      \ | /
///        1
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TetMesh {
    /// Positions, mm.
    pub nodes: Vec<Point>,
    /// Node numbers of each tetrahedron, from 0.
    pub tets: Vec<[u32; 4]>,
    /// How many smaller pieces of the body were left out, because only the largest is meshed.
    pub dropped_pieces: usize,
}

/// The boundary of a tetrahedral mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// The triangles, outwards, with vertices of their own numbering.
    pub triangles: TriangleMesh,
    /// The mesh's node number of each vertex of the surface, rising.
    pub nodes: Vec<u32>,
    /// For each triangle its tetrahedron and the index of its face in [`super::FACES`].
    pub faces: Vec<(u32, u8)>,
}

/// What keeps tetrahedra from being a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TetFault {
    /// There is no tetrahedron.
    #[error("there is no tetrahedron")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("node {0} is not finite")]
    NotFinite(usize),
    /// A tetrahedron names a node that does not exist, or one twice.
    #[error("tetrahedron {0} has a missing or repeated node")]
    BadTet(usize),
    /// A tetrahedron is flat or inside out.
    #[error("tetrahedron {0} has a volume of {1:e} mm³")]
    Volume(usize, f64),
    /// A node that no tetrahedron uses.
    #[error("node {0} belongs to no tetrahedron")]
    Orphan(usize),
    /// Two tetrahedra on the same side of a face, or more than two at it.
    #[error("the face of nodes {0:?} does not lie between two tetrahedra or at the surface")]
    Face([u32; 3]),
    /// The boundary is not a closed surface.
    #[error("the surface is not closed and manifold: {0}")]
    Surface(#[from] MeshFault),
}

impl TetMesh {
    /// From nodes (mm) and tetrahedra; [`TetMesh::check`] shows whether they are a mesh.
    pub fn new(nodes: Vec<Point>, tets: Vec<[u32; 4]>) -> Self {
        Self { nodes, tets, dropped_pieces: 0 }
    }

    /// The corners of tetrahedron `t`.
    pub fn corners(&self, t: usize) -> [Point; 4] {
        self.tets[t].map(|n| self.nodes[n as usize])
    }

    /// The volume, mm³.
    pub fn volume_mm3(&self) -> f64 {
        self.tet_volumes_mm3().sum()
    }

    /// The volume of each tetrahedron, mm³.
    pub fn tet_volumes_mm3(&self) -> impl Iterator<Item = f64> {
        (0..self.tets.len()).map(|t| score::volume(&self.corners(t)))
    }

    /// The boundary: faces with one tetrahedron, in the order of their tetrahedra.
    pub fn surface(&self) -> Surface {
        self.surface_of(Faces::of(&self.tets, self.nodes.len(), |_| true).boundary())
    }

    /// The surface of these faces.
    fn surface_of(&self, faces: Vec<(u32, u8)>) -> Surface {
        let mut used = vec![false; self.nodes.len()];
        for &(t, f) in &faces {
            for n in face_nodes(&self.tets, t, f) {
                used[n as usize] = true;
            }
        }
        let nodes: Vec<u32> = (0..self.nodes.len() as u32).filter(|&n| used[n as usize]).collect();
        let mut vertex = vec![u32::MAX; self.nodes.len()];
        for (i, &n) in nodes.iter().enumerate() {
            vertex[n as usize] = i as u32;
        }
        let triangles =
            faces.iter().map(|&(t, f)| face_nodes(&self.tets, t, f).map(|n| vertex[n as usize])).collect();
        let vertices = nodes.iter().map(|&n| self.nodes[n as usize]).collect();
        Surface { triangles: TriangleMesh { vertices, triangles }, nodes, faces }
    }

    /// Whether this is a mesh: finite, positive volumes, conforming, and with a closed manifold surface.
    ///
    /// # Errors
    /// The first fault found, in the order of [`TetFault`]'s variants.
    pub fn check(&self) -> Result<(), TetFault> {
        if self.tets.is_empty() {
            return Err(TetFault::Empty);
        }
        if let Some(i) = self.nodes.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(TetFault::NotFinite(i));
        }
        let n = self.nodes.len() as u32;
        let mut used = vec![false; self.nodes.len()];
        for (i, t) in self.tets.iter().enumerate() {
            if t.iter().any(|&x| x >= n) || (0..4).any(|a| (0..a).any(|b| t[a] == t[b])) {
                return Err(TetFault::BadTet(i));
            }
            t.iter().for_each(|&x| used[x as usize] = true);
            let volume = score::volume(&self.corners(i));
            if volume.is_nan() || volume <= 0.0 {
                return Err(TetFault::Volume(i, volume));
            }
        }
        if let Some(i) = used.iter().position(|u| !u) {
            return Err(TetFault::Orphan(i));
        }
        let faces = Faces::of(&self.tets, self.nodes.len(), |_| true);
        for group in faces.groups() {
            let turned = |i: usize| {
                let (t, f) = group.side(i);
                is_even(face_nodes(&self.tets, t, f))
            };
            if group.len() > 2 || group.len() == 2 && turned(0) == turned(1) {
                return Err(TetFault::Face(group.nodes));
            }
        }
        Ok(self.surface_of(faces.boundary()).triangles.check()?)
    }
}

/// Whether a triangle's nodes are a rotation of their rising order.
fn is_even([a, b, c]: [u32; 3]) -> bool {
    (a < b) ^ (b < c) ^ (c < a) ^ ((a < b) && (b < c) && (c < a))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> TetMesh {
        let nodes =
            [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]].map(Point::from).to_vec();
        TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]])
    }

    #[test]
    fn the_surface_of_two_tetrahedra_is_six_triangles_outwards() {
        let m = two();
        assert_eq!(m.check(), Ok(()));
        let s = m.surface();
        assert_eq!(s.triangles.triangles.len(), 6);
        assert_eq!(s.nodes, [0, 1, 2, 3, 4]);
        assert!((s.triangles.volume_mm3() - m.volume_mm3()).abs() < 1e-15);
        assert!((m.volume_mm3() - 0.5).abs() < 1e-15);
        for (i, &(t, f)) in s.faces.iter().enumerate() {
            let nodes = face_nodes(&m.tets, t, f);
            assert_eq!(nodes, s.triangles.triangles[i].map(|v| s.nodes[v as usize]));
        }
    }

    #[test]
    fn each_fault_is_found() {
        assert_eq!(TetMesh::default().check(), Err(TetFault::Empty));
        let mut m = two();
        m.nodes[4].x = f64::NAN;
        assert_eq!(m.check(), Err(TetFault::NotFinite(4)));
        let mut m = two();
        m.tets[1][3] = 9;
        assert_eq!(m.check(), Err(TetFault::BadTet(1)));
        let mut m = two();
        m.tets[1].swap(0, 1);
        assert!(matches!(m.check(), Err(TetFault::Volume(1, v)) if v < 0.0));
        let mut m = two();
        m.nodes.push(Point::origin());
        assert_eq!(m.check(), Err(TetFault::Orphan(5)));
        // A third tetrahedron at the face between the two.
        let mut m = two();
        m.nodes.push(Point::new(2.0, 2.0, 2.0));
        m.tets.push([1, 2, 3, 5]);
        assert_eq!(m.check(), Err(TetFault::Face([1, 2, 3])));
        // Both tetrahedra on the same side of the face.
        let mut m = two();
        m.nodes[4] = Point::new(-0.1, -0.1, -0.1);
        m.tets[1] = [1, 3, 2, 4];
        assert_eq!(m.check(), Err(TetFault::Face([1, 2, 3])));
        // Two tetrahedra that share a node only.
        let mut m = two();
        m.nodes.extend([[-1., 0., 0.], [0., -1., 0.], [0., 0., -1.]].map(Point::from));
        m.tets.push([0, 6, 5, 7]);
        assert!(matches!(m.check(), Err(TetFault::Surface(MeshFault::Pinched(0, 2)))), "{:?}", m.check());
    }
}

//! Plane section through the deformed tetrahedra.

use crate::geometry::{Point, Vector};
use crate::mesh::TetMesh;

/// The tetrahedra that an upright plane cuts: each with the corners of its cut, to the right along `along` and upwards, mm.
///
/// The plane goes through `through` and holds z and the level direction `along`; `positions` are the nodes' positions, mm.
pub fn section(
    mesh: &TetMesh,
    positions: &[Point],
    through: &Point,
    along: &Vector,
) -> Vec<(usize, Vec<[f64; 2]>)> {
    let along = along.normalize();
    let normal = along.cross(&Vector::z());
    let depth: Vec<f64> = positions.iter().map(|p| (p - through).dot(&normal)).collect();
    let at = |p: Vector| [p.dot(&along), p.z];
    (mesh.tets.iter().enumerate())
        .filter_map(|(t, nodes)| {
            let (behind, before): (Vec<u32>, Vec<u32>) =
                nodes.iter().partition(|n| depth[**n as usize] < 0.0);
            let crossing = |a: u32, b: u32| {
                let (da, db) = (depth[a as usize], depth[b as usize]);
                let (pa, pb) = (positions[a as usize], positions[b as usize]);
                at((pa + (pb - pa) * (da / (da - db))).coords)
            };
            let corners = match (behind.as_slice(), before.as_slice()) {
                ([a], [b, c, d]) | ([b, c, d], [a]) => {
                    vec![crossing(*a, *b), crossing(*a, *c), crossing(*a, *d)]
                }
                ([a, b], [c, d]) => {
                    vec![crossing(*a, *c), crossing(*a, *d), crossing(*b, *d), crossing(*b, *c)]
                }
                _ => return None,
            };
            Some((t, corners))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tetrahedron_is_cut_in_a_triangle_or_a_quadrilateral() {
        let nodes = [[0., 0., 0.], [2., 0., 0.], [0., 2., 0.], [0., 0., 2.]].map(Point::from).to_vec();
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]]);
        let cut = |x: f64, y: f64, along: Vector| section(&mesh, &mesh.nodes, &Point::new(x, y, 0.0), &along);
        let triangle = cut(0.0, 1.0, Vector::x());
        assert_eq!((triangle.len(), triangle[0].1.len()), (1, 3));
        let area = |c: &[[f64; 2]]| {
            0.5 * (0..c.len())
                .map(|i| {
                    let (a, b) = (c[i], c[(i + 1) % c.len()]);
                    a[0] * b[1] - a[1] * b[0]
                })
                .sum::<f64>()
                .abs()
        };
        assert!((area(&triangle[0].1) - 0.5).abs() < 1e-12);
        let four = cut(0.5, 0.5, Vector::new(1.0, 1.0, 0.0));
        assert!(four.is_empty() || four[0].1.len() >= 3);
        assert!(cut(0.0, 3.0, Vector::x()).is_empty());
    }
}

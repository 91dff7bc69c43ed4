//! Meshes of known bodies.

use grainrig_core::geometry::{Ball, Point};
use grainrig_core::mesh::{Controls, TetMesh, mesh};

/// A block from the origin, cut into cells of six tetrahedra each around the cell's diagonal (Kuhn), which fit their
/// neighbours.
pub fn block(size_mm: [f64; 3], cells: [usize; 3]) -> TetMesh {
    let [nx, ny, nz] = cells;
    let node = |i: usize, j: usize, k: usize| (i + (nx + 1) * (j + (ny + 1) * k)) as u32;
    let mut nodes = Vec::new();
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                let at = |n: usize, of: usize, size: f64| size * n as f64 / of as f64;
                nodes.push(Point::new(at(i, nx, size_mm[0]), at(j, ny, size_mm[1]), at(k, nz, size_mm[2])));
            }
        }
    }
    let mut tets = Vec::new();
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                for (path, even) in [
                    ([0, 1, 2], true),
                    ([0, 2, 1], false),
                    ([1, 0, 2], false),
                    ([1, 2, 0], true),
                    ([2, 0, 1], true),
                    ([2, 1, 0], false),
                ] {
                    let mut at = [i, j, k];
                    let mut tet = [node(i, j, k); 4];
                    for (n, axis) in path.into_iter().enumerate() {
                        at[axis] += 1;
                        tet[n + 1] = node(at[0], at[1], at[2]);
                    }
                    if !even {
                        tet.swap(2, 3);
                    }
                    tets.push(tet);
                }
            }
        }
    }
    let mesh = TetMesh::new(nodes, tets);
    mesh.check().unwrap();
    mesh
}

/// A ball about the origin with elements of one size.
pub fn ball(radius_mm: f64, coarser: f64) -> TetMesh {
    let ball = Ball { center: Point::origin(), radius_mm };
    mesh(&ball, &Controls::for_size(coarser * 2.0 * radius_mm), &mut |_| ()).unwrap()
}

/// A ball about the origin, finer within `depth_mm` of its lowest and highest places.
pub fn graded_ball(radius_mm: f64, at_contact_mm: f64, depth_mm: f64, elsewhere_mm: f64) -> TetMesh {
    let ball = Ball { center: Point::origin(), radius_mm };
    let controls = Controls {
        surface_size_mm: elsewhere_mm,
        tet_volume_mm3: 0.5 * elsewhere_mm.powi(3),
        size_at_contact_mm: Some(at_contact_mm),
        contact_depth_mm: Some(depth_mm),
        ..Controls::for_size(2.0 * radius_mm)
    };
    mesh(&ball, &controls, &mut |_| ()).unwrap()
}

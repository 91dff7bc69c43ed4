//! Triangle meshes with shared vertices.

use super::{Aabb, Point};
use std::collections::HashMap;

/// A surface of triangles that share vertices; counter-clockwise seen from outside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// Points, mm.
    pub vertices: Vec<Point>,
    /// Vertex numbers of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// What keeps a surface from being the boundary of a body.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshFault {
    /// There is no triangle.
    #[error("the surface has no triangle")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("vertex {0} is not finite")]
    NotFinite(usize),
    /// A triangle names a vertex that does not exist, or one twice.
    #[error("triangle {0} has a missing or repeated vertex")]
    BadTriangle(usize),
    /// An edge without a triangle on one side, or with more than one.
    #[error(
        "the edge from vertex {0} to {1} borders {2} triangles with this sense and {3} with the other, not 1 and 1"
    )]
    Edge(u32, u32, usize, usize),
    /// Several fans of triangles meet in one vertex.
    #[error("vertex {0} joins {1} separate fans of triangles: the surface is pinched there")]
    Pinched(u32, usize),
    /// The surface encloses no positive volume.
    #[error("the surface encloses {0} mm³: it is inside out or flat")]
    Inverted(f64),
}

impl TriangleMesh {
    /// The corners of triangle `t`.
    pub fn corners(&self, t: usize) -> [Point; 3] {
        self.triangles[t].map(|v| self.vertices[v as usize])
    }
    /// The enclosed volume, mm³ (divergence theorem; positive where triangles face outwards).
    pub fn volume_mm3(&self) -> f64 {
        let c = self.bounds().map_or_else(Point::origin, |b| b.center());
        let six: f64 = (0..self.triangles.len())
            .map(|t| {
                let [a, b, d] = self.corners(t).map(|p| p - c);
                a.dot(&b.cross(&d))
            })
            .sum();
        six / 6.0
    }
    /// The enclosed volume above the plane z = 0, mm³: of a grain, what silhouettes above the pedestal can show.
    pub fn volume_above_zero_mm3(&self) -> f64 {
        // By the divergence theorem with the field (0, 0, z), whose flux through the cut at z = 0 vanishes.
        let mut volume = 0.0;
        for t in 0..self.triangles.len() {
            let corners = self.corners(t);
            let mut kept: Vec<Point> = Vec::with_capacity(4);
            for i in 0..3 {
                let (p, q) = (corners[i], corners[(i + 1) % 3]);
                if p.z >= 0.0 {
                    kept.push(p);
                }
                if (p.z >= 0.0) != (q.z >= 0.0) {
                    kept.push(p + (q - p) * (p.z / (p.z - q.z)));
                }
            }
            for i in 2..kept.len() {
                let (a, b, c) = (kept[0], kept[i - 1], kept[i]);
                let area_xy = 0.5 * ((b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y));
                volume += area_xy * (a.z + b.z + c.z) / 3.0;
            }
        }
        volume
    }
    /// The area, mm².
    pub fn area_mm2(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                0.5 * (b - a).cross(&(c - a)).norm()
            })
            .sum()
    }
    /// The box around all vertices, `None` where there are none.
    pub fn bounds(&self) -> Option<Aabb> {
        Aabb::of(self.vertices.iter().copied())
    }

    /// Whether the surface is closed, manifold (edges and vertices), oriented outwards and finite.
    ///
    /// # Errors
    /// The first fault found, in the order of [`MeshFault`]'s variants.
    pub fn check(&self) -> Result<(), MeshFault> {
        if self.triangles.is_empty() {
            return Err(MeshFault::Empty);
        }
        if let Some(i) = self.vertices.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(MeshFault::NotFinite(i));
        }
        let n = self.vertices.len() as u32;
        if let Some(i) =
            self.triangles.iter().position(|&[a, b, c]| a == b || b == c || c == a || a.max(b).max(c) >= n)
        {
            return Err(MeshFault::BadTriangle(i));
        }
        let mut edges: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                edges.push((p.min(q), p.max(q), p < q));
            }
        }
        edges.sort_unstable();
        for group in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            let forward = group.iter().filter(|e| e.2).count();
            if forward != 1 || group.len() != 2 {
                return Err(MeshFault::Edge(group[0].0, group[0].1, forward, group.len() - forward));
            }
        }
        self.check_fans()?;
        let volume = self.volume_mm3();
        if volume > 0.0 { Ok(()) } else { Err(MeshFault::Inverted(volume)) }
    }

    /// Each vertex must have one closed fan of triangles: walking from triangle to triangle reaches all.
    fn check_fans(&self) -> Result<(), MeshFault> {
        let mut incident: Vec<Vec<[u32; 2]>> = vec![Vec::new(); self.vertices.len()];
        for &[a, b, c] in &self.triangles {
            incident[a as usize].push([b, c]);
            incident[b as usize].push([c, a]);
            incident[c as usize].push([a, b]);
        }
        for (v, link) in incident.iter().enumerate() {
            let next: HashMap<u32, u32> = link.iter().map(|&[p, q]| (p, q)).collect();
            let mut left = link.len();
            let mut fans = 0;
            let mut seen = std::collections::HashSet::new();
            for &[start, _] in link {
                if seen.contains(&start) {
                    continue;
                }
                fans += 1;
                let mut at = start;
                while seen.insert(at) {
                    left -= 1;
                    match next.get(&at) {
                        Some(&q) => at = q,
                        None => break,
                    }
                }
            }
            if fans > 1 || left > 0 {
                return Err(MeshFault::Pinched(v as u32, fans));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            vertices: vec![
                Point::origin(),
                Point::new(1., 0., 0.),
                Point::new(0., 1., 0.),
                Point::new(0., 0., 1.),
            ],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        }
    }

    #[test]
    fn a_tetrahedron_is_closed_and_has_its_volume_and_area() {
        let t = tetrahedron();
        assert_eq!(t.check(), Ok(()));
        assert!((t.volume_mm3() - 1.0 / 6.0).abs() < 1e-15);
        assert!((t.area_mm2() - (1.5 + 3f64.sqrt() / 2.0)).abs() < 1e-15);
    }

    #[test]
    fn each_fault_is_found() {
        assert_eq!(TriangleMesh::default().check(), Err(MeshFault::Empty));
        let mut open = tetrahedron();
        open.triangles.pop();
        assert!(matches!(open.check(), Err(MeshFault::Edge(..))));
        let mut inside_out = tetrahedron();
        inside_out.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert!(matches!(inside_out.check(), Err(MeshFault::Inverted(_))));
        let mut nan = tetrahedron();
        nan.vertices[2].x = f64::NAN;
        assert_eq!(nan.check(), Err(MeshFault::NotFinite(2)));
        let mut bad = tetrahedron();
        bad.triangles[1] = [0, 1, 9];
        assert_eq!(bad.check(), Err(MeshFault::BadTriangle(1)));
        // Two tetrahedra that share only vertex 0.
        let mut two = tetrahedron();
        two.vertices.extend([Point::new(-1., 0., 0.), Point::new(0., -1., 0.), Point::new(0., 0., -1.)]);
        two.triangles
            .extend([[0, 4, 5], [0, 6, 4], [4, 6, 5], [5, 6, 0]].map(|[a, b, c]: [u32; 3]| [a, b, c]));
        assert_eq!(two.check(), Err(MeshFault::Pinched(0, 2)));
    }
}

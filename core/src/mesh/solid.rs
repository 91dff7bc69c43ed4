//! Signed distance of a closed triangle surface, in a bounding volume hierarchy.

use super::{MeshError, check_extent};
use crate::geometry::{Aabb, ImplicitBody, Point, TriangleMesh, Vector};

/// The most triangles of a surface: they take about 1.5 GB, and a micrometre on a grain of a millimetre.
pub const MOST_TRIANGLES: usize = 5_000_000;
/// Least volume over area^1.5; a ball has 0.094, a square plate of a millionth of its width 3·10⁻⁷.
const LEAST_THICKNESS: f64 = 1e-8;
/// Triangles in a leaf of the tree.
const LEAF: usize = 4;

/// The inside of a closed triangle mesh. Its value is the signed distance to the nearest triangle, in mm,
/// found in a tree of boxes; the sign is that of the angle-weighted pseudonormal at the nearest point
/// (Bærentzen and Aanæs, IEEE Trans. Vis. Comput. Graph. 11(3), 2005), exact for a surface that does not cut
/// itself.
#[derive(Debug, Clone)]
pub struct Solid {
    surface: TriangleMesh,
    bounds: Aabb,
    /// Triangle numbers, leaf by leaf.
    order: Vec<u32>,
    tree: Vec<Branch>,
    face_normals: Vec<Vector>,
    /// For each triangle the pseudonormals of its edges 0–1, 1–2, 2–0.
    edge_normals: Vec<[Vector; 3]>,
    vertex_normals: Vec<Vector>,
}

/// A box of triangles: a leaf has `order[first..last]`, a branch its children at `first` and `last` in the
/// tree.
#[derive(Debug, Clone, Copy)]
struct Branch {
    bounds: Aabb,
    first: u32,
    last: u32,
    leaf: bool,
}

/// The part of a triangle that is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Feature {
    Vertex(usize),
    Edge(usize),
    Face,
}

impl Solid {
    /// From a surface that passes [`TriangleMesh::check`]. Takes O(n log n) for n triangles.
    ///
    /// # Errors
    /// [`MeshError::Open`] with the fault, [`MeshError::Triangles`] for too many, [`MeshError::Flat`] without volume;
    /// those of [`check_extent`].
    pub fn new(surface: TriangleMesh) -> Result<Self, MeshError> {
        let n = surface.triangles.len();
        if n > MOST_TRIANGLES {
            return Err(MeshError::Triangles { count: n, limit: MOST_TRIANGLES });
        }
        if surface.vertices.iter().all(|p| p.iter().all(|x| x.is_finite())) {
            surface.bounds().as_ref().map_or(Ok(()), check_extent)?;
        }
        surface.check()?;
        // A sheet folded onto itself encloses nothing but rounding errors.
        let (volume, area) = (surface.volume_mm3(), surface.area_mm2());
        if volume < LEAST_THICKNESS * area.powf(1.5) {
            return Err(MeshError::Flat { volume_mm3: volume, area_mm2: area });
        }
        let boxes: Vec<Aabb> = (0..n).filter_map(|t| Aabb::of(surface.corners(t))).collect();
        let mut order: Vec<u32> = (0..n as u32).collect();
        let mut tree = Vec::with_capacity(2 * n / LEAF + 1);
        build(&mut tree, &boxes, &mut order, 0);
        let bounds = tree[0].bounds;
        let (face_normals, edge_normals, vertex_normals) = pseudonormals(&surface);
        Ok(Self { surface, bounds, order, tree, face_normals, edge_normals, vertex_normals })
    }

    /// The surface it was made from.
    pub fn surface(&self) -> &TriangleMesh {
        &self.surface
    }

    /// The same, turned inside out first where its triangles all face inwards; and whether they did.
    ///
    /// # Errors
    /// As [`Solid::new`], except for what turning repairs.
    pub fn turned_outwards(mut surface: TriangleMesh) -> Result<(Self, bool), MeshError> {
        let inwards = surface.volume_mm3() < 0.0;
        if inwards {
            surface.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        Ok((Self::new(surface)?, inwards))
    }

    /// Calls `each` with the triangles whose boxes meet a triangle's box.
    pub(super) fn each_near(&self, triangle: &[Point; 3], each: &mut impl FnMut(usize)) {
        let Some(own) = Aabb::of(*triangle) else { return };
        let mut todo = vec![0u32];
        while let Some(b) = todo.pop() {
            let branch = &self.tree[b as usize];
            if branch.bounds.intersection(&own).is_none() {
                continue;
            }
            if branch.leaf {
                self.order[branch.first as usize..branch.last as usize]
                    .iter()
                    .for_each(|&t| each(t as usize));
            } else {
                todo.extend([branch.first, branch.last]);
            }
        }
    }

    /// The nearest triangle, its feature and the nearest point on it.
    fn nearest(&self, p: &Point) -> (usize, Feature, Point) {
        let mut best = (0, Feature::Face, self.surface.vertices[0]);
        let mut best_square = f64::INFINITY;
        let mut todo = [0u32; 64];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let branch = self.tree[todo[depth] as usize];
            if square_distance(&branch.bounds, p) >= best_square {
                continue;
            }
            if branch.leaf {
                for &t in &self.order[branch.first as usize..branch.last as usize] {
                    let (feature, at) = nearest_on_triangle(&self.surface.corners(t as usize), p);
                    let square = (p - at).norm_squared();
                    if square < best_square {
                        best_square = square;
                        best = (t as usize, feature, at);
                    }
                }
                continue;
            }
            // The nearer child is looked at first. Halving keeps the tree's depth under 32, so the stack
            // holds.
            let [a, b] = [branch.first, branch.last];
            let of = |c: u32| square_distance(&self.tree[c as usize].bounds, p);
            let (near, far) = if of(a) <= of(b) { (a, b) } else { (b, a) };
            todo[depth] = far;
            todo[depth + 1] = near;
            depth += 2;
        }
        best
    }
}

impl ImplicitBody for Solid {
    fn value(&self, p: &Point) -> f64 {
        let (t, feature, at) = self.nearest(p);
        let normal = match feature {
            Feature::Vertex(k) => self.vertex_normals[self.surface.triangles[t][k] as usize],
            Feature::Edge(k) => self.edge_normals[t][k],
            Feature::Face => self.face_normals[t],
        };
        let d = p - at;
        d.norm().copysign(d.dot(&normal))
    }
    fn bounds(&self) -> Aabb {
        self.bounds
    }
    fn steepness(&self) -> Option<f64> {
        Some(1.0)
    }
}

/// Adds a branch for a part of the triangles (whose first is `offset` in the whole order); returns its
/// number.
fn build(tree: &mut Vec<Branch>, boxes: &[Aabb], order: &mut [u32], offset: usize) -> u32 {
    let all = order.iter().map(|&t| boxes[t as usize]);
    let bounds = all.reduce(|a, b| Aabb { min: a.min.inf(&b.min), max: a.max.sup(&b.max) });
    let Some(bounds) = bounds else { unreachable!("a branch has triangles") };
    let here = tree.len();
    let (first, last) = (offset as u32, (offset + order.len()) as u32);
    tree.push(Branch { bounds, first, last, leaf: true });
    if order.len() > LEAF {
        let axis = bounds.size().imax();
        let middle = order.len() / 2;
        let key = |t: u32| boxes[t as usize].min[axis] + boxes[t as usize].max[axis];
        order.select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let (low, high) = order.split_at_mut(middle);
        let first = build(tree, boxes, low, offset);
        let last = build(tree, boxes, high, offset + middle);
        tree[here] = Branch { bounds, first, last, leaf: false };
    }
    here as u32
}

fn square_distance(b: &Aabb, p: &Point) -> f64 {
    (0..3).map(|k| (b.min[k] - p[k]).max(p[k] - b.max[k]).max(0.0).powi(2)).sum()
}

type Normals = (Vec<Vector>, Vec<[Vector; 3]>, Vec<Vector>);

/// Unit normals of faces, sums of the two at each edge, and sums weighted by angle at each vertex.
fn pseudonormals(surface: &TriangleMesh) -> Normals {
    let n = surface.triangles.len();
    let faces: Vec<Vector> = (0..n)
        .map(|t| {
            let [a, b, c] = surface.corners(t);
            (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector::zeros)
        })
        .collect();
    let mut vertices = vec![Vector::zeros(); surface.vertices.len()];
    let mut edges: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(3 * n);
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let p = surface.corners(t);
        for k in 0..3 {
            let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            vertices[triangle[k] as usize] += faces[t] * u.cross(&v).norm().atan2(u.dot(&v));
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], t as u32, k as u8));
        }
    }
    edges.sort_unstable();
    let mut edge_normals = vec![[Vector::zeros(); 3]; n];
    for pair in edges.chunk_by(|a, b| a.0 == b.0) {
        let sum: Vector = pair.iter().map(|e| faces[e.1 as usize]).sum();
        for e in pair {
            edge_normals[e.1 as usize][e.2 as usize] = sum;
        }
    }
    (faces, edge_normals, vertices)
}

/// The nearest point on a triangle (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
fn nearest_on_triangle([a, b, c]: &[Point; 3], p: &Point) -> (Feature, Point) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (Feature::Vertex(0), *a);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (Feature::Vertex(1), *b);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (Feature::Edge(0), a + ab * (d1 / (d1 - d3)));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (Feature::Vertex(2), *c);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (Feature::Edge(2), a + ac * (d2 / (d2 - d6)));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return (Feature::Edge(1), b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))));
    }
    let sum = va + vb + vc;
    (Feature::Face, a + ab * (vb / sum) + ac * (vc / sum))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::sync::LazyLock;

    const BALL: crate::geometry::Ball =
        crate::geometry::Ball { center: Point::new(0.1, 0.0, 0.0), radius_mm: 1.0 };
    /// A ball's surface from the mesher itself, some hundred triangles.
    static SOLID: LazyLock<Solid> = LazyLock::new(|| {
        let controls = crate::mesh::Controls {
            surface_size_mm: 0.3,
            facet_angle_deg: 5.0,
            tet_volume_mm3: 1.0,
            ..crate::mesh::Controls::for_size(1.0)
        };
        let mesh = crate::mesh::mesh(&BALL, &controls, &mut |_| ()).unwrap();
        Solid::new(mesh.surface().triangles).unwrap()
    });

    fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            vertices: [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(Point::from).to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        }
    }

    #[test]
    fn distances_to_a_tetrahedron_are_those_of_its_planes_edges_and_corners() {
        let s = Solid::new(tetrahedron()).unwrap();
        let value = |x, y, z| s.value(&Point::new(x, y, z));
        assert!((value(0.1, 0.2, 0.2) + 0.1).abs() < 1e-15);
        assert!((value(-1.0, -1.0, 0.5) - 2f64.sqrt()).abs() < 1e-15);
        assert!((value(-1.0, -1.0, -1.0) - 3f64.sqrt()).abs() < 1e-15);
        assert!((value(1.0, 1.0, 1.0) - 2.0 / 3f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn an_open_surface_is_no_solid() {
        let mut open = tetrahedron();
        open.triangles.pop();
        assert!(matches!(Solid::new(open), Err(MeshError::Open(_))));
    }

    proptest! {
        #[test]
        fn the_tree_finds_what_looking_at_every_triangle_finds(x in -2.0..2.0f64, y in -2.0..2.0f64, z in -2.0..2.0f64) {
            let s = &*SOLID;
            let p = Point::new(x, y, z);
            let brute = (0..s.surface.triangles.len())
                .map(|t| (p - nearest_on_triangle(&s.surface.corners(t), &p).1).norm())
                .fold(f64::INFINITY, f64::min);
            let v = s.value(&p);
            prop_assert!((v.abs() - brute).abs() < 1e-12);
            prop_assert!((v - BALL.value(&p)).abs() < 0.05, "{} {}", v, BALL.value(&p));
        }
    }
}

//! The grain on the pedestal: a measured shape, scaled, turned to its pose and set down.

use super::bvh::{Bvh, Hit};
use super::chance::Chance;
use super::plan::{Pose, Row};
use anyhow::{Context as _, Result};
use grainrig_core::formats::stl;
use grainrig_core::geometry::{Point, TriangleMesh};
use nalgebra::{Matrix3, Rotation3, SymmetricEigen, Vector3};
use std::path::Path;

type V = Vector3<f64>;

/// A body that rays can meet.
pub struct Body {
    /// Its surface in the table's frame at angle 0, mm.
    pub mesh: TriangleMesh,
    tree: Bvh,
    normals: Vec<V>,
}

impl Body {
    /// With smooth normals: at each vertex the mean of its triangles', by their areas.
    pub fn new(mesh: TriangleMesh) -> Self {
        let mut normals = vec![V::zeros(); mesh.vertices.len()];
        let corners: Vec<[V; 3]> =
            (0..mesh.triangles.len()).map(|t| mesh.corners(t).map(|p| p.coords)).collect();
        for (t, [a, b, c]) in mesh.triangles.iter().zip(&corners) {
            let normal = (b - a).cross(&(c - a));
            t.iter().for_each(|v| normals[*v as usize] += normal);
        }
        normals.iter_mut().for_each(|n| *n = n.try_normalize(0.0).unwrap_or_else(V::z));
        Self { tree: Bvh::new(&corners), mesh, normals }
    }

    /// The nearest place on a ray, `far` at most, with the outward normal there.
    pub fn hit(&self, origin: &V, direction: &V, near: f64, far: f64) -> Option<(f64, V)> {
        let Hit { t, triangle, weights: [u, v] } = self.tree.hit(origin, direction, near, far)?;
        let [a, b, c] = self.mesh.triangles[triangle].map(|v| self.normals[v as usize]);
        let normal = a * (1.0 - u - v) + b * u + c * v;
        Some((t, normal.try_normalize(0.0).unwrap_or(a)))
    }

    /// Whether a ray meets it.
    pub fn is_hit(&self, origin: &V, direction: &V, near: f64) -> bool {
        self.tree.is_hit(origin, direction, near)
    }

    /// Its lowest and highest place and its greatest distance from the axis, mm.
    pub fn reach(&self) -> (f64, f64, f64) {
        self.mesh.vertices.iter().fold((f64::INFINITY, f64::NEG_INFINITY, 0.0), |(low, high, wide), p| {
            (low.min(p.z), high.max(p.z), f64::max(wide, p.x.hypot(p.y)))
        })
    }
}

/// The centre of mass and the second moments about it, of the enclosed body.
fn moments(mesh: &TriangleMesh) -> (V, Matrix3<f64>) {
    let (mut volume, mut first, mut second) = (0.0, V::zeros(), Matrix3::zeros());
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t).map(|p| p.coords);
        let v = a.dot(&b.cross(&c)) / 6.0;
        let s = a + b + c;
        volume += v;
        first += v * s / 4.0;
        let squares = a * a.transpose() + b * b.transpose() + c * c.transpose();
        second += (squares + s * s.transpose()) * (v / 20.0);
    }
    let center = first / volume;
    (center, second / volume - center * center.transpose())
}

/// A row's grain, as it stands on the pedestal.
///
/// # Errors
/// Where its file cannot be read.
pub fn placed(row: &Row, grains: &Path) -> Result<Body> {
    let path = grains.join(format!("{}.stl", row.shape));
    let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut mesh = stl::read(&bytes).with_context(|| format!("{} is no STL", path.display()))?;
    let size = (6.0 / std::f64::consts::PI * mesh.volume_mm3()).cbrt();
    let scale = row.size_mm / size;
    let (center, second) = moments(&mesh);
    // Axes by their extent, the longest first.
    let axes = SymmetricEigen::new(second);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| axes.eigenvalues[j].total_cmp(&axes.eigenvalues[i]));
    let [long, _, short] = order.map(|k| axes.eigenvectors.column(k).into_owned());
    // The first becomes x, the last z.
    let (x, z) = if row.pose == Pose::Upright { (short, long) } else { (long, short) };
    let base = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    let yaw = Chance::new(row.seed, "yaw").between(0.0, std::f64::consts::TAU);
    let tip = if let Pose::Tipped(deg) = row.pose { deg.to_radians() } else { 0.0 };
    let turn = Rotation3::from_axis_angle(&V::x_axis(), tip) * Rotation3::from_axis_angle(&V::z_axis(), yaw);
    for p in &mut mesh.vertices {
        *p = Point::from(turn * (base * (p.coords - center)) * scale);
    }
    let [east, north] = row.off_mm;
    let radius = 0.5 * row.pedestal.diameter_mm;
    let mut shift = V::new(east, north, 0.0);
    let lowest = |inside: &dyn Fn(&Point) -> bool| {
        let all = mesh.vertices.iter().filter(|p| inside(p));
        all.min_by(|p, q| p.z.total_cmp(&q.z)).copied()
    };
    if row.hangs {
        // It rests where it is lowest above the pedestal's top; what is beside that may be lower.
        let over = lowest(&|p: &Point| (p.x + shift.x).hypot(p.y + shift.y) < radius);
        shift.z = -over.context("nothing of the grain is over its pedestal")?.z - row.embed_mm;
    } else {
        // Its foot is brought over the pedestal.
        let foot = lowest(&|_| true).context("no grain")?;
        let at = V::new(foot.x + shift.x, foot.y + shift.y, 0.0);
        let most = 0.6 * radius;
        if at.norm() > most {
            shift -= at * (1.0 - most / at.norm());
        }
        shift.z = -foot.z - row.embed_mm;
    }
    mesh.vertices.iter_mut().for_each(|p| *p += shift);
    Ok(Body::new(mesh))
}

/// A ball on the pedestal: an icosphere of 20 480 triangles with the volume of the ball.
pub fn ball(diameter_mm: f64, off_mm: [f64; 2]) -> Body {
    let golden = f64::midpoint(1.0, 5f64.sqrt());
    let mut vertices = Vec::new();
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        vertices.extend([V::new(a, b, 0.0), V::new(0.0, a, b), V::new(b, 0.0, a)]);
    }
    let edge = 2.0;
    let near = |p: &V, q: &V| ((p - q).norm() - edge).abs() < 1e-6;
    let mut faces: Vec<[V; 3]> = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [vertices[i], vertices[j], vertices[k]];
                if near(&a, &b) && near(&b, &c) && near(&a, &c) {
                    let outwards = (b - a).cross(&(c - a)).dot(&a) > 0.0;
                    faces.push(if outwards { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..5 {
        let parted = faces.iter().flat_map(|[a, b, c]| {
            let [ab, bc, ca] = [(a + b), (b + c), (c + a)].map(|m| m.normalize());
            let [a, b, c] = [a, b, c].map(V::normalize);
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        });
        faces = parted.collect();
    }
    let radius = 0.5 * diameter_mm;
    let center = V::new(off_mm[0], off_mm[1], radius - 0.005);
    let vertices: Vec<Point> = faces.iter().flatten().map(|p| Point::from(p * radius + center)).collect();
    let triangles = (0..faces.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mut body = Body::new(TriangleMesh { vertices, triangles });
    for (n, p) in body.normals.iter_mut().zip(&body.mesh.vertices) {
        *n = (p.coords - center).normalize();
    }
    body
}

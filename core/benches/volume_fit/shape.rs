//! Bodies whose volume is known: particles by their spherical harmonics, grains cut by planes, ellipsoids, boxes.

use crate::random::Random;
use grainrig_core::geometry::{Point, TriangleMesh, Vector};
use nalgebra::{Matrix3, SymmetricEigen};
use std::collections::HashMap;
use std::f64::consts::PI;

/// Times that an icosahedron's triangles are parted into four: 20 480 of them, 2° wide.
const PARTED: usize = 5;

/// Directions all around, and their triangles.
pub fn icosphere() -> TriangleMesh {
    let golden = f64::midpoint(1.0, 5f64.sqrt());
    let mut points: Vec<Vector> = Vec::new();
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        points.extend([[a, b, 0.0], [0.0, a, b], [b, 0.0, a]].map(Vector::from));
    }
    let near = |i: usize, j: usize| ((points[i] - points[j]).norm() - 2.0).abs() < 1e-6;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(k, i) {
                    let outwards =
                        (points[j] - points[i]).cross(&(points[k] - points[i])).dot(&points[i]) > 0.0;
                    let [i, j, k] = [i as u32, j as u32, k as u32];
                    triangles.push(if outwards { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    for _ in 0..PARTED {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                points.push(points[a as usize] + points[b as usize]);
                points.len() as u32 - 1
            })
        };
        triangles = (triangles.iter())
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
        points.iter_mut().for_each(|p| *p = p.normalize());
    }
    TriangleMesh { vertices: points.into_iter().map(Point::from).collect(), triangles }
}

/// A body that reaches so far in each direction from its middle.
pub fn star(sphere: &TriangleMesh, reach: impl Fn(&Vector) -> f64) -> TriangleMesh {
    let vertices = sphere.vertices.iter().map(|p| p * reach(&p.coords)).collect();
    TriangleMesh { vertices, triangles: sphere.triangles.clone() }
}

/// A particle from lines `n m re im` of its radius' spherical harmonics (orthonormal, with the Condon–Shortley phase),
/// up to a degree. `None` where a line is something else.
pub fn particle(sphere: &TriangleMesh, text: &str, degree: usize) -> Option<TriangleMesh> {
    let mut terms = vec![[0.0; 2]; (degree + 1) * (degree + 1)];
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let mut words = line.split_whitespace();
        let n: usize = words.next()?.parse().ok()?;
        let m: i64 = words.next()?.parse().ok()?;
        let re: f64 = words.next()?.parse().ok()?;
        let im: f64 = words.next()?.parse().ok()?;
        // The radius is real: what −m says is known from m.
        if n <= degree && m >= 0 {
            terms[n * (degree + 1) + m as usize] = [re, im];
        }
    }
    Some(star(sphere, |u| {
        let azimuth = u.y.atan2(u.x);
        let sine = u.x.hypot(u.y);
        let (mut sum, mut sectoral) = (0.0, (0.25 / PI).sqrt());
        for m in 0..=degree {
            let (sin, cos) = (m as f64 * azimuth).sin_cos();
            let weight = if m == 0 { 1.0 } else { 2.0 };
            // Normalised associated Legendre functions, from n = m upwards.
            let (mut before, mut legendre) = (0.0, sectoral);
            for n in m..=degree {
                let [re, im] = terms[n * (degree + 1) + m];
                sum += weight * legendre * (re * cos - im * sin);
                let ([n, m], next) = ([n as f64, m as f64], n as f64 + 1.0);
                let a = ((4.0 * next * next - 1.0) / (next * next - m * m)).sqrt();
                let b = if n > m { ((n * n - m * m) / (4.0 * n * n - 1.0)).sqrt() } else { 0.0 };
                (before, legendre) = (legendre, a * (u.z * legendre - b * before));
            }
            let m = m as f64;
            sectoral *= -((2.0 * m + 3.0) / (2.0 * m + 2.0)).sqrt() * sine;
        }
        sum
    }))
}

/// The convex body between planes, each the points p with `p·normal ≤ reach`. They must bound it.
pub fn polytope(planes: &[(Vector, f64)]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for (k, (normal, reach)) in planes.iter().enumerate() {
        let across = normal.cross(&if normal.x.abs() < 0.6 { Vector::x() } else { Vector::y() }).normalize();
        let along = normal.cross(&across);
        let far = 100.0 * reach;
        let mut face: Vec<Vector> = [(-far, -far), (far, -far), (far, far), (-far, far)]
            .map(|(x, y)| normal * *reach + across * x + along * y)
            .to_vec();
        for (_, (cut, most)) in planes.iter().enumerate().filter(|(other, _)| *other != k) {
            let over = |p: &Vector| p.dot(cut) - most;
            let mut kept = Vec::with_capacity(face.len() + 1);
            for (p, q) in face.iter().zip(face.iter().cycle().skip(1)) {
                let (a, b) = (over(p), over(q));
                if a <= 0.0 {
                    kept.push(*p);
                }
                if (a <= 0.0) != (b <= 0.0) {
                    kept.push(p + (q - p) * (a / (a - b)));
                }
            }
            face = kept;
        }
        let first = mesh.vertices.len() as u32;
        mesh.triangles.extend((2..face.len() as u32).map(|i| [first, first + i - 1, first + i]));
        mesh.vertices.extend(face.into_iter().map(Point::from));
    }
    mesh
}

/// The convex body that touches a mesh from outside in so many directions: nearly its convex hull.
pub fn convex(mesh: &TriangleMesh, planes: usize) -> TriangleMesh {
    let middle = moments(mesh).0;
    // Directions evenly all around, along a spiral.
    let golden = PI * (3.0 - 5f64.sqrt());
    let touching: Vec<(Vector, f64)> = (0..planes)
        .map(|k| {
            let z = 1.0 - (2.0 * k as f64 + 1.0) / planes as f64;
            let (sin, cos) = (golden * k as f64).sin_cos();
            let normal = Vector::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vector::z() * z;
            let reach = mesh.vertices.iter().map(|p| (p.coords - middle).dot(&normal)).fold(0.0, f64::max);
            (normal, reach)
        })
        .collect();
    polytope(&touching)
}

/// A grain of so many facets at random, some of them close to its middle.
pub fn cut(facets: usize, draw: &mut Random) -> TriangleMesh {
    let depth = draw.between(0.6, 0.95);
    // A cube holds it together where the facets leave it open.
    let mut planes: Vec<(Vector, f64)> =
        [Vector::x(), Vector::y(), Vector::z()].iter().flat_map(|e| [(*e, 1.2), (-e, 1.2)]).collect();
    planes.extend((0..facets).map(|_| (draw.rotation() * Vector::z(), draw.between(depth, 1.0))));
    polytope(&planes)
}

/// A box or ellipsoid with rounded edges (the exponent 2 is an ellipsoid, a large one a box), and bumps.
pub fn rough(
    sphere: &TriangleMesh,
    half: &Vector,
    exponent: f64,
    bumps: f64,
    draw: &mut Random,
) -> TriangleMesh {
    let waves: Vec<(Vector, f64, f64)> = (0..40)
        .map(|_| {
            let number = draw.between(4.0, 20.0);
            (draw.rotation() * Vector::z() * number, draw.between(0.0, 2.0 * PI), 4.0 / number)
        })
        .collect();
    let norm = waves.iter().map(|w| 0.5 * w.2 * w.2).sum::<f64>().sqrt();
    star(sphere, |u| {
        let smooth = u.component_div(half).map(|x| x.abs().powf(exponent)).sum().powf(-1.0 / exponent);
        let wave: f64 = waves.iter().map(|(k, phase, height)| height * (k.dot(u) + phase).cos()).sum();
        smooth * (1.0 + bumps * wave / norm)
    })
}

/// Centre of volume and second moments about it over the volume, of what a mesh encloses.
pub fn moments(mesh: &TriangleMesh) -> (Vector, Matrix3<f64>) {
    let (mut volume, mut first, mut second) = (0.0, Vector::zeros(), Matrix3::zeros());
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t).map(|p| p.coords);
        let part = a.dot(&b.cross(&c)) / 6.0;
        let sum = a + b + c;
        volume += part;
        first += sum * (part / 4.0);
        let squares = a * a.transpose() + b * b.transpose() + c * c.transpose();
        second += (squares + sum * sum.transpose()) * (part / 20.0);
    }
    let middle = first / volume;
    (middle, second / volume - middle * middle.transpose())
}

/// Principal axes, the longest first, as the rows of a rotation, and the half lengths of the ellipsoid with these moments.
pub fn axes(mesh: &TriangleMesh) -> (Matrix3<f64>, Vector) {
    let eigen = SymmetricEigen::new(moments(mesh).1);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let [long, middle, _] = order.map(|k| eigen.eigenvectors.column(k).into_owned());
    let rows = Matrix3::from_rows(&[long.transpose(), middle.transpose(), long.cross(&middle).transpose()]);
    (rows, Vector::from(order.map(|k| (5.0 * eigen.eigenvalues[k].max(0.0)).sqrt())))
}

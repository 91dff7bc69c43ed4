//! The body on the pedestal: a built-in angular grain, a ball, or a surface from an STL file.

use super::random::{self, Purpose};
use super::settings::Settings;
use crate::rig::RigError;
use grainrig_core::formats::stl;
use grainrig_core::geometry::{Point, TriangleMesh, Vector};
use nalgebra::Rotation3;
use std::collections::HashMap;
use std::path::Path;

/// The body's surface in the table's frame at stage angle 0: scaled, turned, its centroid at the eccentricity, its
/// lowest point `embedded_mm` below the pedestal's top (z = 0).
///
/// # Errors
/// [`RigError::Device`] where the STL file cannot be read or is not the boundary of a body.
pub fn placed(settings: &Settings) -> Result<TriangleMesh, RigError> {
    let (mut mesh, diameter_mm) = match (&settings.grain_stl, settings.sphere_diameter_mm) {
        (Some(path), _) => (read_stl(path)?, settings.grain_size_mm),
        (None, Some(d)) => (ball(), d),
        (None, None) => (angular(settings.seed), settings.grain_size_mm),
    };
    let scale = diameter_mm / (6.0 / std::f64::consts::PI * mesh.volume_mm3()).cbrt();
    let center = centroid(&mesh);
    let [x, y, z] = settings.grain_rotation_deg.map(f64::to_radians);
    let turn = Rotation3::from_euler_angles(x, y, z);
    for p in &mut mesh.vertices {
        *p = Point::from(turn * ((*p - center) * scale));
    }
    let lowest = mesh.vertices.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let [x, y] = settings.eccentricity_mm;
    let shift = Vector::new(x, y, -lowest - settings.embedded_mm);
    mesh.vertices.iter_mut().for_each(|p| *p += shift);
    Ok(mesh)
}

/// Reads a closed surface; an ASCII or a binary STL file.
fn read_stl(path: &Path) -> Result<TriangleMesh, RigError> {
    let refuse = |what: String| {
        RigError::fault(
            format!("the grain {} {what}", path.display()),
            "give [simulated] grain_stl a closed surface in STL, or leave it out for the built-in grain",
        )
    };
    let bytes = std::fs::read(path).map_err(|e| refuse(format!("cannot be opened ({e})")))?;
    let mesh = stl::read(&bytes).map_err(|e| refuse(format!("is not an STL file ({e})")))?;
    mesh.check().map_err(|fault| refuse(format!("does not bound a body: {fault}")))?;
    Ok(mesh)
}

/// The centroid of the enclosed body (the sum over tetrahedra from the box's centre).
fn centroid(mesh: &TriangleMesh) -> Point {
    let apex = mesh.bounds().map_or_else(Point::origin, |b| b.center());
    let (mut moment, mut volume) = (Vector::zeros(), 0.0);
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t).map(|p| p - apex);
        let v = a.dot(&b.cross(&c));
        moment += v * (a + b + c) / 4.0;
        volume += v;
    }
    apex + moment / volume
}

/// A unit ball of 81,920 triangles (its volume is set by [`placed`]: the silhouette's area is then within
/// 2 × 10⁻⁵ of the circle's).
fn ball() -> TriangleMesh {
    icosphere(6)
}

/// A sub-angular grain: a smooth body of low order, cut by planes whose edges are a little worn, with a
/// slight roughness. Star-shaped about the origin, so that the surface is closed and simple for any seed.
fn angular(seed: u64) -> TriangleMesh {
    let key = random::key(seed, Purpose::Shape);
    let draw = |i: u64, low: f64, high: f64| low + (high - low) * random::uniform(key, i);
    let direction = |i: u64| {
        let (z, a) = (draw(2 * i, -1.0, 1.0), draw(2 * i + 1, 0.0, std::f64::consts::TAU));
        let s = (1.0 - z * z).sqrt();
        Vector::new(s * a.cos(), s * a.sin(), z)
    };
    let axes = Vector::new(draw(500, 0.95, 1.1), draw(501, 0.85, 1.0), draw(502, 0.9, 1.15));
    let bumps: Vec<(Vector, f64, f64)> = (0..14)
        .map(|i| {
            let order = 1.5 + 0.55 * i as f64;
            let amplitude = if i < 6 { 0.035 } else { 0.007 };
            (direction(100 + i) * order, draw(520 + i, 0.0, std::f64::consts::TAU), amplitude)
        })
        .collect();
    // Facets in directions that keep their distance from one another, or they would merge into one.
    let mut facets: Vec<(Vector, f64)> = Vec::new();
    for i in 0..200 {
        let n = direction(i + 300);
        if facets.len() < 12 && facets.iter().all(|(m, _)| m.dot(&n) < 0.72) {
            facets.push((n, draw(900 + i, 0.72, 0.88)));
        }
    }
    // How sharp the worn edges are: the p-norm of the surfaces' inverse radii, p → ∞ being a knife's edge.
    let sharpness = 60;
    let mut mesh = icosphere(6);
    for p in &mut mesh.vertices {
        let d = p.coords;
        let mut body = 1.0 / d.component_div(&axes).norm();
        for (k, phase, amplitude) in &bumps {
            body *= 1.0 + amplitude * (k.dot(&d) + phase).cos();
        }
        let planes = facets.iter().map(|(n, h)| (n.dot(&d) / h).max(0.0).powi(sharpness)).sum::<f64>();
        let radius = ((1.0 / body).powi(sharpness) + planes).powf(-1.0 / f64::from(sharpness));
        // Three octaves, each half as high as the one before.
        let rough = [6.0, 13.0, 29.0].map(|k| random::lattice(key, &(d * k)) / k).iter().sum::<f64>();
        *p = Point::from(d * radius * (1.0 + 0.035 * rough));
    }
    mesh
}

/// A unit sphere: an icosahedron whose triangles are each cut in four, `levels` times.
fn icosphere(levels: u32) -> TriangleMesh {
    let g = f64::midpoint(1.0, 5f64.sqrt());
    let mut vertices: Vec<Point> = [
        (-1.0, g, 0.0),
        (1.0, g, 0.0),
        (-1.0, -g, 0.0),
        (1.0, -g, 0.0),
        (0.0, -1.0, g),
        (0.0, 1.0, g),
        (0.0, -1.0, -g),
        (0.0, 1.0, -g),
        (g, 0.0, -1.0),
        (g, 0.0, 1.0),
        (-g, 0.0, -1.0),
        (-g, 0.0, 1.0),
    ]
    .map(|(x, y, z)| Point::from(Vector::new(x, y, z).normalize()))
    .to_vec();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = vertices[a as usize].coords + vertices[b as usize].coords;
                vertices.push(Point::from(sum.normalize()));
                vertices.len() as u32 - 1
            })
        };
        triangles = (triangles.iter())
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    TriangleMesh { vertices, triangles }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_has_its_volume_and_stands_where_it_should() {
        let s =
            Settings { sphere_diameter_mm: Some(0.8), eccentricity_mm: [0.1, -0.2], ..Settings::default() };
        let m = placed(&s).unwrap();
        m.check().unwrap();
        let r = 0.4f64;
        let whole = 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        assert!((m.volume_mm3() / whole - 1.0).abs() < 1e-9);
        assert!((centroid(&m) - Point::new(0.1, -0.2, r - 0.02)).norm() < 1e-4);
        // The cap of height h below the plane: π h² (3 r − h) / 3.
        let cap = std::f64::consts::PI * 0.02f64.powi(2) * (3.0 * r - 0.02) / 3.0;
        assert!((m.volume_above_zero_mm3() - (whole - cap)).abs() < 1e-4 * whole);
    }

    #[test]
    fn built_in_grains_are_closed_angular_and_of_the_size_asked() {
        for seed in 0..4 {
            let m = placed(&Settings { seed, ..Settings::default() }).unwrap();
            m.check().unwrap();
            let ball = std::f64::consts::PI / 6.0 * 0.9f64.powi(3);
            assert!((m.volume_mm3() / ball - 1.0).abs() < 1e-9);
            // Sphericity: below a ball's, above a cube's (0.806).
            let sphericity = std::f64::consts::PI * 0.9f64.powi(2) / m.area_mm2();
            assert!((0.85..0.98).contains(&sphericity), "seed {seed}: {sphericity}");
        }
        assert_ne!(
            placed(&Settings::default()).unwrap(),
            placed(&Settings { seed: 2, ..Settings::default() }).unwrap()
        );
    }

    #[test]
    fn a_bad_stl_is_refused_with_its_path_and_what_is_wrong() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("open.stl");
        let read = || placed(&Settings { grain_stl: Some(path.clone()), ..Settings::default() });
        let text = read().unwrap_err().to_string();
        assert!(text.contains("open.stl") && text.contains("opened"), "{text}");
        std::fs::write(&path, b"not a surface").unwrap();
        let text = read().unwrap_err().to_string();
        assert!(text.contains("not an STL"), "{text}");
        let vertices = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]].map(Point::from).to_vec();
        let open = TriangleMesh { vertices, triangles: vec![[0, 1, 2]] };
        stl::write(&open, std::fs::File::create(&path).unwrap()).unwrap();
        let text = read().unwrap_err().to_string();
        assert!(text.contains("does not bound a body"), "{text}");
    }
}

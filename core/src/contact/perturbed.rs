//! A surface as it may be as well, within what its outlines leave open.

use super::ensemble::even;
use super::foot::normals;
use crate::geometry::{TriangleMesh, Vector};
use std::f64::consts::TAU;

/// Waves of a field: the more, the nearer its values are to normal ones.
const WAVES: usize = 96;

/// A closed surface whose vertices are moved along their normals by a smooth random field: normal, of this standard deviation (mm), and
/// with a correlation of exp(−½ (distance/length)²). The same number gives the same field always.
///
/// Source: random Fourier features (Rahimi and Recht 2007). Cost: a hundred cosines a vertex.
pub fn perturbed(surface: &TriangleMesh, deviation_mm: f64, length_mm: f64, number: usize) -> TriangleMesh {
    let waves: Vec<(Vector, f64)> = (0..WAVES)
        .map(|k| {
            let (normal, phase) = normal_vector(number * WAVES + k);
            (normal / length_mm, TAU * phase)
        })
        .collect();
    let amplitude = deviation_mm * (2.0 / WAVES as f64).sqrt();
    let normals = normals(surface);
    let moved = surface.vertices.iter().zip(normals).map(|(p, normal)| {
        let field: f64 = waves.iter().map(|(k, phase)| (k.dot(&p.coords) + phase).cos()).sum();
        p + normal * (amplitude * field)
    });
    TriangleMesh { vertices: moved.collect(), triangles: surface.triangles.clone() }
}

/// Of an even sequence of vectors with three standard normal components the one of this number, and a place that has nothing to do with
/// it, from 0 to below 1.
pub fn normal_vector(number: usize) -> (Vector, f64) {
    let [a, b, c, d, place, ..] = even::<7>(number);
    // Box and Muller.
    let size = |u: f64| (-2.0 * (1.0 - u).ln()).sqrt();
    let ((sin, cos), other) = ((TAU * b).sin_cos(), (TAU * d).sin());
    (Vector::new(size(a) * sin, size(a) * cos, size(c) * other), place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Ball, Point};
    use crate::mesh::{Controls, mesh};

    #[test]
    fn vectors_are_standard_normal() {
        let count = 2000;
        let all: Vec<Vector> = (0..count).map(|k| normal_vector(k).0).collect();
        let mean = all.iter().sum::<Vector>() / f64::from(count as u32);
        let square: Vector = all.iter().map(|v| v.component_mul(v)).sum::<Vector>() / f64::from(count as u32);
        assert!(mean.amax() < 0.05 && square.add_scalar(-1.0).amax() < 0.05, "{mean} {square}");
    }

    #[test]
    fn the_field_has_its_deviation_and_its_length() {
        let controls = Controls { surface_size_mm: 0.06, tet_volume_mm3: 1e-3, ..Controls::for_size(1.0) };
        let ball = mesh(&Ball { center: Point::origin(), radius_mm: 0.5 }, &controls, &mut |_| ()).unwrap();
        let surface = ball.surface().triangles;
        let (mut square, mut product, mut pairs, mut count) = (0.0, 0.0, 0.0, 0.0);
        for number in 1..40 {
            let moved = perturbed(&surface, 0.001, 0.1, number);
            let by: Vec<f64> = (moved.vertices.iter().zip(&surface.vertices))
                .map(|(q, p)| (q - p).dot(&p.coords.normalize()))
                .collect();
            square += by.iter().map(|x| x * x).sum::<f64>();
            count += by.len() as f64;
            for t in &surface.triangles {
                let [a, b] = [t[0] as usize, t[1] as usize];
                let d = (surface.vertices[a] - surface.vertices[b]).norm();
                product += by[a] * by[b] / (-0.5 * (d / 0.1).powi(2)).exp();
                pairs += 1.0;
            }
            assert_eq!(moved, perturbed(&surface, 0.001, 0.1, number));
        }
        assert!(((square / count).sqrt() / 0.001 - 1.0).abs() < 0.1, "{}", (square / count).sqrt());
        assert!((product / pairs / 1e-6 - 1.0).abs() < 0.2, "{}", product / pairs);
        assert_eq!(perturbed(&surface, 0.0, 0.1, 3), surface);
    }
}

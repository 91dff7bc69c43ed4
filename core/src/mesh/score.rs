//! Volume, area vectors, dihedral sines, circumradius of one tetrahedron and one triangle.

use crate::geometry::{Point, Vector};

/// The volume of a tetrahedron, positive where nodes 0, 1, 2 run counter-clockwise seen from node 3.
pub(super) fn volume([a, b, c, d]: &[Point; 4]) -> f64 {
    (b - a).cross(&(c - a)).dot(&(d - a)) / 6.0
}

/// Twice the area vectors of the faces opposite to each node, outwards.
pub(super) fn face_vectors([a, b, c, d]: &[Point; 4]) -> [Vector; 4] {
    [(c - b).cross(&(d - b)), (d - a).cross(&(c - a)), (b - a).cross(&(d - a)), (c - a).cross(&(b - a))]
}

/// The pairs of nodes that are edges; the faces that meet there are opposite to the two other nodes.
pub(super) const EDGES: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 0, 2], [2, 3, 0, 1]];

/// The volume and the least sine of the six dihedral angles (from sin θ = 3 V l / 2 A₁ A₂).
pub(super) fn volume_and_least_sine(p: &[Point; 4]) -> (f64, f64) {
    let n = face_vectors(p).map(|v| v.norm_squared());
    let volume = volume(p);
    let mut least = f64::INFINITY;
    for [i, j, k, l] in EDGES {
        least = least.min((p[i] - p[j]).norm_squared() / (n[k] * n[l]));
    }
    (volume, 6.0 * volume * least.sqrt())
}

/// The circumradius `R = abc/(4A)` and the sine of the least angle, `a/(2R)` with a the shortest edge, of a triangle.
pub(super) fn circumradius_and_least_sine([a, b, c]: &[Point; 3]) -> (f64, f64) {
    let double_area = (b - a).cross(&(c - a)).norm();
    let (x, y, z) = ((b - a).norm(), (c - b).norm(), (a - c).norm());
    // The least angle lies between the two longer edges.
    let least = x.min(y).min(z);
    let product = x * y * z;
    (product / (2.0 * double_area), double_area * least / product)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_regular_tetrahedron_has_its_known_angles() {
        let p = [[1., 1., 1.], [-1., 1., -1.], [1., -1., -1.], [-1., -1., 1.]].map(Point::from);
        let (volume, sine) = volume_and_least_sine(&p);
        assert!((volume - 8.0 / 3.0).abs() < 1e-12);
        assert!((sine - (1.0f64 / 3.0).acos().sin()).abs() < 1e-12);
        let (r, s) = circumradius_and_least_sine(&[p[0], p[1], p[2]]);
        assert!((r - 8f64.sqrt() / 3f64.sqrt()).abs() < 1e-12 && (s - 0.75f64.sqrt()).abs() < 1e-12);
        let sum: Vector = face_vectors(&p).iter().sum();
        assert!(sum.norm() < 1e-12);
    }
}

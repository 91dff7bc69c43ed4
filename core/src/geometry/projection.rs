//! Cameras as 3×4 matrices: from the world (mm) to the picture (pixels).

use super::{Point, Vector};
use nalgebra::{Matrix3x4, Vector4};
use serde::{Deserialize, Serialize};

/// A camera: `(u, v, w) = P · (x, y, z, 1)`, column `u/w`, row `v/w`, both in pixels, with the centre of the
/// first pixel at (0, 0). An orthographic (telecentric) camera has the third row (0, 0, 0, 1).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Projection {
    /// The matrix, its sign chosen so that `w > 0` in front of the camera.
    pub matrix: Matrix3x4<f64>,
}

impl Projection {
    /// From a matrix whose sign gives `w > 0` at points in front of the camera.
    pub fn new(matrix: Matrix3x4<f64>) -> Self {
        Self { matrix }
    }

    /// Column and row of a point in the picture, in pixels; `None` at or behind the camera.
    #[inline]
    pub fn project(&self, p: &Point) -> Option<[f64; 2]> {
        let h = self.matrix * Vector4::new(p.x, p.y, p.z, 1.0);
        (h.z > 0.0).then(|| [h.x / h.z, h.y / h.z])
    }

    /// The most pixels that a displacement of 1 mm at `p` can move the picture of a point (the greatest
    /// singular value of the derivative), pixels per mm. `None` at or behind the camera.
    pub fn px_per_mm(&self, p: &Point) -> Option<f64> {
        let [u, v] = self.project(p)?;
        let m = &self.matrix;
        let w = m.row(2).dot(&Vector4::new(p.x, p.y, p.z, 1.0).transpose());
        let row = |i: usize, c: f64| {
            nalgebra::Vector3::new(
                (m[(i, 0)] - c * m[(2, 0)]) / w,
                (m[(i, 1)] - c * m[(2, 1)]) / w,
                (m[(i, 2)] - c * m[(2, 2)]) / w,
            )
        };
        let (a, b) = (row(0, u), row(1, v));
        let (aa, bb, ab) = (a.norm_squared(), b.norm_squared(), a.dot(&b));
        let half = 0.5 * (aa + bb);
        Some((half + (0.25 * (aa - bb).powi(2) + ab * ab).sqrt()).sqrt())
    }

    /// The ray of a point in the picture: a point on it, and its unit direction (either way along it). `None` where
    /// the matrix sees no such ray.
    pub fn line_of_sight(&self, [column, row]: [f64; 2]) -> Option<(Point, Vector)> {
        let m = &self.matrix;
        let plane = |i: usize, c: f64| {
            let r = m.row(i) - m.row(2) * c;
            (Vector::new(r[0], r[1], r[2]), r[3])
        };
        let ((n1, c1), (n2, c2)) = (plane(0, column), plane(1, row));
        let along = n1.cross(&n2);
        let length2 = along.norm_squared();
        if length2 == 0.0 || !length2.is_finite() {
            return None;
        }
        let p = (n2.cross(&along) * -c1 + along.cross(&n1) * -c2) / length2;
        Some((Point::from(p), along / length2.sqrt()))
    }

    /// Whether the view is orthographic (parallel rays).
    pub fn is_orthographic(&self) -> bool {
        self.matrix.fixed_view::<1, 3>(2, 0).iter().all(|x| *x == 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_sight_projects_to_its_place() {
        let parallel = Matrix3x4::new(200., 3., 4., 100., -5., 2., -210., 140., 0., 0., 0., 1.);
        let pinhole = Matrix3x4::new(900., 3., 40., 320., -5., 950., 10., 240., 0.1, 0.02, 1., 100.);
        for camera in [parallel, pinhole].map(Projection::new) {
            let (start, direction) = camera.line_of_sight([120.5, 77.25]).unwrap();
            for along in [-1.0, 0.0, 2.5] {
                let [u, v] = camera.project(&(start + direction * along)).unwrap();
                assert!((u - 120.5).hypot(v - 77.25) < 1e-6, "{u} {v}");
            }
        }
    }

    #[test]
    fn the_local_scale_is_the_derivative() {
        let m = Matrix3x4::new(900., 3., 40., 320., -5., 950., 10., 240., 0.1, 0.02, 1., 100.);
        let p = Point::new(1.0, -2.0, 3.0);
        let cam = Projection::new(m);
        let q = cam.project(&p).unwrap();
        let h = 1e-6;
        let mut most: f64 = 0.0;
        for i in 0..2000 {
            let (a, b) = (f64::from(i) * 0.37, f64::from(i) * 0.011);
            let d = nalgebra::Vector3::new(a.cos() * b.cos(), a.sin() * b.cos(), b.sin());
            let r = cam.project(&(p + d * h)).unwrap();
            most = most.max((r[0] - q[0]).hypot(r[1] - q[1]) / h);
        }
        let s = cam.px_per_mm(&p).unwrap();
        assert!((s / most - 1.0).abs() < 2e-3, "{s} {most}");
    }
}

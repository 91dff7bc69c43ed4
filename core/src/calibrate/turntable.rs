//! Projection of a turntable view: pinhole or parallel rays, roll, elevation, a view's own shift.

use crate::geometry::{Angle, Projection};
use nalgebra::Matrix3x4;
use serde::{Deserialize, Serialize};

/// A camera that stands still and looks along +y at a grain that turns about z.
///
/// A point (x, y, z) of the grain is turned by the stage angle a (counter-clockwise seen from above) to
/// x' = x cos a − y sin a, y' = x sin a + y cos a; its picture is scaled by s = D/(D + y') (s = 1 for a
/// telecentric lens); rays that rise going away see a point lower the farther it is; the picture is turned by the roll
/// about the axis' foot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Turntable {
    /// Size of a pixel at the axis, mm.
    pub mm_per_px: f64,
    /// Column of the axis in row `origin_row_px`.
    pub axis_column_px: f64,
    /// The row of z = 0.
    pub origin_row_px: f64,
    /// How far the view rays rise going away from the camera, at the axis' foot, radians (small): the camera's
    /// pitch, and for a pinhole how far the foot lies below its height.
    pub elevation_rad: f64,
    /// Turn of the picture: with a positive roll the axis leans to smaller columns towards the top.
    pub roll_rad: f64,
    /// Distance from the centre of projection to the axis, mm; `None` for a telecentric lens.
    pub camera_distance_mm: Option<f64>,
}

impl Turntable {
    /// The camera of the view at a stage angle, with the picture moved right by `offset_px`.
    pub fn view(&self, angle: Angle, offset_px: f64) -> Projection {
        let (sin, cos) = angle.rad().sin_cos();
        let m = self.mm_per_px;
        // w = 1/s, linear in the point; u and v in pixels from the axis' foot, times w.
        let w = self.camera_distance_mm.map_or([0.0, 0.0, 0.0, 1.0], |d| [sin / d, cos / d, 0.0, 1.0]);
        let u = [cos / m, -sin / m, 0.0, 0.0];
        let elevation = self.elevation_rad / m;
        let v = [elevation * sin, elevation * cos, -1.0 / m, 0.0];
        let (sr, cr) = self.roll_rad.sin_cos();
        let column = |k: usize| (self.axis_column_px + offset_px) * w[k] + u[k] * cr + v[k] * sr;
        let row = |k: usize| self.origin_row_px * w[k] - u[k] * sr + v[k] * cr;
        Projection::new(Matrix3x4::from_fn(|i, k| match i {
            0 => column(k),
            1 => row(k),
            _ => w[k],
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    #[test]
    fn the_matrix_is_the_formula() {
        let t = Turntable {
            mm_per_px: 0.00437,
            axis_column_px: 524.7,
            origin_row_px: 705.0,
            elevation_rad: 0.0,
            roll_rad: -0.3f64.to_radians(),
            camera_distance_mm: Some(120.0),
        };
        let p = Point::new(0.4, -0.7, 1.3);
        let angle = Angle::from_deg(33.0);
        let (s, c) = angle.rad().sin_cos();
        let (x, y) = (p.x * c - p.y * s, p.x * s + p.y * c);
        let scale = 120.0 / (120.0 + y);
        let (u, v) = (x * scale / 0.00437, -p.z * scale / 0.00437);
        let (sr, cr) = t.roll_rad.sin_cos();
        let expected = [524.7 + 2.5 + u * cr + v * sr, 705.0 - u * sr + v * cr];
        let got = t.view(angle, 2.5).project(&p).unwrap();
        assert!((got[0] - expected[0]).abs() < 1e-9 && (got[1] - expected[1]).abs() < 1e-9);
        // A point on the ray through the foot does not move with depth, before a pinhole or a telecentric lens.
        for camera_distance_mm in [Some(120.0), None] {
            let rising = Turntable { elevation_rad: 0.02, roll_rad: 0.0, camera_distance_mm, ..t };
            for y in [-1.0, 0.0, 1.0] {
                let row =
                    rising.view(Angle::default(), 0.0).project(&Point::new(0.0, y, 0.02 * y)).unwrap()[1];
                assert!((row - 705.0).abs() < 1e-9);
            }
        }
        let telecentric = Turntable { camera_distance_mm: None, ..t };
        assert!(telecentric.view(angle, 0.0).is_orthographic());
    }
}

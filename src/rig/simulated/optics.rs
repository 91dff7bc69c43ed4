//! The simulated lens: where a place of the table's frame is seen in the picture.

use super::settings::Settings;
use crate::rig::RigError;
use grainrig_core::geometry::{Angle, Point, Projection, TriangleMesh};
use nalgebra::{Matrix3x4, RowVector4};
use serde::{Deserialize, Serialize};

/// The camera's true parameters.
///
/// A place (x, y, z) of the table at stage angle a is turned to x' = x cos a − y sin a, y' = x sin a + y cos a. A camera
/// that looks up by e has it at the depth y" = y' cos e + z sin e and the height z" = z cos e − y' sin e
/// and sees it at u = x' s / `mm_per_px`, v = −z" s / `mm_per_px`, where s = D / (D + y") (1 for a telecentric lens);
/// then, with the roll r, at column `axis_column` + u cos r + v sin r + wobble, row `axis_row` − u sin r + v cos r.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Optics {
    /// Width and height of the picture, pixels.
    pub picture: [usize; 2],
    /// Edge of one pixel in the plane of the rotation axis, mm.
    pub mm_per_px: f64,
    /// Distance D from the pinhole to the axis, mm; `None` for a telecentric lens.
    pub distance_mm: Option<f64>,
    /// Column of the axis's foot (the axis at z = 0), pixels.
    pub axis_column_px: f64,
    /// Row of the axis's foot, which is the pedestal's top, pixels.
    pub axis_row_px: f64,
    /// Roll r, radians.
    pub roll_rad: f64,
    /// How far it looks up e, radians.
    pub elevation_rad: f64,
    /// Radius of the pedestal, mm.
    pub pedestal_radius_mm: f64,
}

impl Optics {
    /// The lens before a placed body: the row of the pedestal's top is chosen so that the body stands in the
    /// middle of the picture.
    ///
    /// # Errors
    /// [`RigError::Device`] where the camera would touch the body or the body would leave the picture while it
    /// turns.
    pub(super) fn before(settings: &Settings, body: &TriangleMesh) -> Result<Self, RigError> {
        let top = body.vertices.iter().map(|p| p.z).fold(0.0, f64::max);
        let reach =
            (body.vertices.iter()).map(|p| p.x.hypot(p.y)).fold(settings.pedestal_radius_mm, f64::max);
        let [w, h] = [settings.width as f64, settings.height as f64];
        let optics = Self {
            picture: [settings.width, settings.height],
            mm_per_px: settings.mm_per_px,
            distance_mm: settings.camera_distance_mm,
            axis_column_px: 0.5 * (w - 1.0) + settings.axis_offset_px,
            axis_row_px: 0.5 * (h - 1.0) + 0.5 * top / settings.mm_per_px,
            roll_rad: settings.roll_deg.to_radians(),
            elevation_rad: settings.elevation_deg.to_radians(),
            pedestal_radius_mm: settings.pedestal_radius_mm,
        };
        let magnified = match settings.camera_distance_mm {
            Some(d) if d < 2.0 * reach => {
                return Err(RigError::fault(
                    format!(
                        "the simulated camera is {d} mm from the axis and the body reaches {reach:.3} mm towards it, it \
                     must stay twice that away"
                    ),
                    "change [simulated] camera_distance_mm",
                ));
            }
            Some(d) => d / (d - reach),
            None => 1.0,
        };
        // The corners of the box swept by the turning body, with room for blur and wobble (the normal
        // deviates end at 3.7 standard deviations).
        let (sin, cos) = optics.roll_rad.sin_cos();
        let tilted = reach * settings.elevation_deg.to_radians().abs() / settings.mm_per_px;
        let room = 4.0 * (settings.blur_px + settings.wobble_px) + 1.0 + tilted;
        let scale = magnified / settings.mm_per_px;
        let inside = [(-reach, 0.0), (reach, 0.0), (-reach, top), (reach, top)].iter().all(|&(x, z)| {
            let (u, v) = (x * scale, -z * scale);
            let column = optics.axis_column_px + u * cos + v * sin;
            let row = optics.axis_row_px - u * sin + v * cos;
            column >= room && column <= w - 1.0 - room && row >= room && row <= h - 1.0 - room
        });
        if !inside {
            return Err(RigError::fault(
                format!(
                    "the turning body sweeps {:.3} mm × {top:.3} mm, with its blur that does not fit the simulated \
                 picture of {:.3} mm × {:.3} mm",
                    2.0 * reach,
                    w * settings.mm_per_px,
                    h * settings.mm_per_px,
                ),
                "change [simulated] mm_per_px, width, height or axis_offset_px",
            ));
        }
        Ok(optics)
    }

    /// The whole camera as a matrix from the table's frame, at a stage angle and with a view's own sideways
    /// shift (pixels).
    pub(super) fn projection(&self, angle: Angle, wobble_px: f64) -> Projection {
        let (sin, cos) = angle.rad().sin_cos();
        let (roll_sin, roll_cos) = self.roll_rad.sin_cos();
        let u = RowVector4::new(cos, -sin, 0.0, 0.0) / self.mm_per_px;
        let (rise, along) = self.elevation_rad.sin_cos();
        let v = RowVector4::new(sin * rise, cos * rise, -along, 0.0) / self.mm_per_px;
        let per_mm = self.distance_mm.map_or(0.0, |d| 1.0 / d);
        let w = RowVector4::new(sin * along, cos * along, rise, 0.0) * per_mm
            + RowVector4::new(0.0, 0.0, 0.0, 1.0);
        Projection::new(Matrix3x4::from_rows(&[
            w * (self.axis_column_px + wobble_px) + u * roll_cos + v * roll_sin,
            w * self.axis_row_px - u * roll_sin + v * roll_cos,
            w,
        ]))
    }

    /// How near the camera a turned place is, as a quantity that is linear over the picture of a plane (so
    /// that it may be interpolated there); greater is nearer.
    pub(super) fn nearness(&self, angle: Angle, p: &Point) -> f64 {
        let (sin, cos) = angle.rad().sin_cos();
        let (rise, along) = self.elevation_rad.sin_cos();
        self.nearness_of((p.x * sin + p.y * cos) * along + p.z * rise)
    }

    fn nearness_of(&self, y_turned: f64) -> f64 {
        self.distance_mm.map_or(-y_turned, |d| d / (d + y_turned))
    }

    /// Half the width of the pedestal's picture, pixels.
    pub(super) fn pedestal_half_width_px(&self) -> f64 {
        let r = self.pedestal_radius_mm;
        // The tangent rays of a pinhole see a little more than the radius.
        let seen = self.distance_mm.map_or(r, |d| d * r / (d * d - r * r).sqrt());
        seen / self.mm_per_px
    }

    /// The picture turned back by the roll: the u and v (pixels) of a place in the picture.
    pub(super) fn unrolled(&self, [column, row]: [f64; 2], wobble_px: f64) -> [f64; 2] {
        let (sin, cos) = self.roll_rad.sin_cos();
        let (du, dv) = (column - self.axis_column_px - wobble_px, row - self.axis_row_px);
        [du * cos - dv * sin, du * sin + dv * cos]
    }

    /// The columns of a picture row at which v ≥ 0: below the plane of the pedestal's top. Least and
    /// greatest, possibly infinite; the least exceeds the greatest where there is none.
    pub(super) fn below_top(&self, row: f64, wobble_px: f64) -> [f64; 2] {
        let (sin, cos) = self.roll_rad.sin_cos();
        let dv = row - self.axis_row_px;
        let axis = self.axis_column_px + wobble_px;
        if sin == 0.0 {
            return if dv >= 0.0 { [f64::NEG_INFINITY, f64::INFINITY] } else { [1.0, 0.0] };
        }
        let crossing = axis - dv * cos / sin;
        if sin > 0.0 { [crossing, f64::INFINITY] } else { [f64::NEG_INFINITY, crossing] }
    }

    /// The columns of a picture row that the pedestal covers.
    pub(super) fn pedestal_span(&self, row: f64, wobble_px: f64) -> [f64; 2] {
        let (sin, cos) = self.roll_rad.sin_cos();
        let middle = self.axis_column_px + wobble_px + (row - self.axis_row_px) * sin / cos;
        let half = self.pedestal_half_width_px() / cos;
        let [low, high] = self.below_top(row, wobble_px);
        let below = [low.max(middle - half), high.min(middle + half)];
        let rim = self.rim_span(row, wobble_px);
        match (below[0] < below[1], rim[0] < rim[1]) {
            (true, true) => [below[0].min(rim[0]), below[1].max(rim[1])],
            (false, true) => rim,
            _ => below,
        }
    }

    /// The columns of a picture row inside the ellipse as which a camera that looks up or down sees the pedestal's rim.
    fn rim_span(&self, row: f64, wobble_px: f64) -> [f64; 2] {
        let half = self.pedestal_half_width_px();
        let flat = self.elevation_rad.sin().abs();
        if flat == 0.0 {
            return [1.0, 0.0];
        }
        let (sin, cos) = self.roll_rad.sin_cos();
        // Along the row: u = k cos − dv sin, v = k sin + dv cos, with (u² + (v/flat)²) = half².
        let dv = row - self.axis_row_px;
        let (s, c) = (sin / flat, cos / flat);
        let a = cos * cos + s * s;
        let b = dv * (s * c - sin * cos);
        let root = b * b - a * (dv * dv * (sin * sin + c * c) - half * half);
        if root <= 0.0 {
            return [1.0, 0.0];
        }
        let middle = self.axis_column_px + wobble_px - b / a;
        [middle - root.sqrt() / a, middle + root.sqrt() / a]
    }

    /// The nearness of the pedestal's front where the picture's u is `u_px`, and the part of its outward
    /// normal that faces the camera; `None` beside the pedestal.
    pub(super) fn pedestal_front(&self, u_px: f64) -> Option<(f64, f64)> {
        let r = self.pedestal_radius_mm;
        let x = u_px * self.mm_per_px;
        // Along the ray x' = slope (D + y') (or x' = x): x'² + y'² = r², the solution nearer to the camera.
        let (slope, d) = self.distance_mm.map_or((0.0, 0.0), |d| (x / d, d));
        let (a, b, c) = match self.distance_mm {
            Some(_) => (1.0 + slope * slope, slope * slope * d, slope * slope * d * d - r * r),
            None => (1.0, 0.0, x * x - r * r),
        };
        let root = b * b - a * c;
        (root >= 0.0).then(|| {
            let y = (-b - root.sqrt()) / a;
            (self.nearness_of(y), -y / r)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::simulated::grain;

    fn small() -> Settings {
        Settings { width: 400, height: 300, roll_deg: 3.0, ..Settings::default() }
    }

    #[test]
    fn the_projection_is_the_formula() {
        for distance in [None, Some(30.0)] {
            let s = Settings { camera_distance_mm: distance, ..small() };
            let s = Settings { elevation_deg: 0.7, ..s };
            let o = Optics::before(&s, &grain::placed(&s).unwrap()).unwrap();
            let (a, wobble, p) = (Angle::from_deg(37.0), 0.4, Point::new(0.3, -0.2, 0.5));
            let (x, y) =
                (p.x * a.rad().cos() - p.y * a.rad().sin(), p.x * a.rad().sin() + p.y * a.rad().cos());
            let (se, ce) = 0.7f64.to_radians().sin_cos();
            let (depth, up) = (y * ce + p.z * se, p.z * ce - y * se);
            let k = distance.map_or(1.0, |d| d / (d + depth)) / s.mm_per_px;
            let (u, v) = (x * k, -up * k);
            let (sr, cr) = 3f64.to_radians().sin_cos();
            let want = [o.axis_column_px + u * cr + v * sr + wobble, o.axis_row_px - u * sr + v * cr];
            let got = o.projection(a, wobble).project(&p).unwrap();
            assert!((got[0] - want[0]).hypot(got[1] - want[1]) < 1e-9, "{got:?} {want:?}");
            let back = o.unrolled(got, wobble);
            assert!((back[0] - u).hypot(back[1] - v) < 1e-9);
        }
    }

    #[test]
    fn a_camera_that_looks_up_or_down_sees_the_rim_as_an_ellipse() {
        let s = Settings { elevation_deg: -1.0, roll_deg: 2.0, ..small() };
        let o = Optics::before(&s, &grain::placed(&s).unwrap()).unwrap();
        let r = s.pedestal_radius_mm;
        for k in 0..72 {
            let turn = Angle::from_deg(5.0 * f64::from(k)).rad();
            let at = Point::new(0.999 * r * turn.cos(), 0.999 * r * turn.sin(), 0.0);
            let [column, row] = o.projection(Angle::default(), 0.3).project(&at).unwrap();
            let [low, high] = o.pedestal_span(row, 0.3);
            assert!((low..=high).contains(&column), "{turn}: {column} {low} {high}");
            let beyond = Point::new(1.01 * at.x, 1.01 * at.y, 0.0);
            let [column, row] = o.projection(Angle::default(), 0.3).project(&beyond).unwrap();
            let [low, high] = o.rim_span(row, 0.3);
            assert!(!(low..=high).contains(&column), "{turn}: {column} {low} {high}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let s = Settings { mm_per_px: 0.002, ..small() };
        let text = Optics::before(&s, &grain::placed(&s).unwrap()).unwrap_err().to_string();
        assert!(text.contains("does not fit"), "{text}");
        let s = Settings { camera_distance_mm: Some(0.5), ..small() };
        let text = Optics::before(&s, &grain::placed(&s).unwrap()).unwrap_err().to_string();
        assert!(text.contains("camera_distance_mm"), "{text}");
    }
}

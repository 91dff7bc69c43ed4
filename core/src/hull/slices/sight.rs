//! Epipolar lines of level parallel rays: a horizontal plane is seen as a line of the picture.

use super::SliceError;
use crate::geometry::Projection;
use crate::hull::Cone;

/// How far a view's rays may rise over their length (the tangent of their elevation) and still count as level: a nanometre over
/// a millimetre.
const MOST_ELEVATION: f64 = 1e-6;

/// A view's angle, and its picture of the plane across its rays through the axis: the point `u` mm right of the axis
/// (towards e(θ)) and `z` mm up is seen at `origin + u · right + z · up`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// θ, with e(θ) = (cos θ, −sin θ): the stage's angle before a [`Turntable`](crate::calibrate::Turntable).
    pub angle_rad: f64,
    /// Column and row of the world's origin.
    pub origin_px: [f64; 2],
    /// Pixels per mm across the axis.
    pub right_px: [f64; 2],
    /// Pixels per mm along the axis.
    pub up_px: [f64; 2],
}

impl Sight {
    /// Of a camera.
    ///
    /// # Errors
    /// [`SliceError::NotLevel`] where the rays are not parallel to each other, or not level.
    pub fn of(camera: &Projection) -> Result<Self, SliceError> {
        let m = &camera.matrix;
        let w = m[(2, 3)];
        let row = |i: usize| [m[(i, 0)] / w, m[(i, 1)] / w, m[(i, 2)] / w];
        let (column, line) = (row(0), row(1));
        let (across, sideways, upwards) = (
            column[1] * line[2] - column[2] * line[1],
            column[2] * line[0] - column[0] * line[2],
            column[0] * line[1] - column[1] * line[0],
        );
        // The ray's direction is (across, sideways, upwards); e is level and square to it.
        let level = across.hypot(sideways);
        let slope = upwards.abs() / level;
        let within = slope <= MOST_ELEVATION;
        if !camera.is_orthographic() || !within {
            let elevation_rad = if camera.is_orthographic() { Some(slope.atan()) } else { None };
            return Err(SliceError::NotLevel { elevation_rad });
        }
        let e = [-sideways / level, across / level];
        let along = |g: [f64; 3]| g[0] * e[0] + g[1] * e[1];
        let (u, v) = (along(column), along(line));
        // The right-hand way, or downwards for a picture that lies on its side.
        let sign = if (if u.abs() >= v.abs() { u } else { v }) < 0.0 { -1.0 } else { 1.0 };
        Ok(Self {
            angle_rad: (-e[1] * sign).atan2(e[0] * sign),
            origin_px: [m[(0, 3)] / w, m[(1, 3)] / w],
            right_px: [u * sign, v * sign],
            up_px: [column[2], line[2]],
        })
    }

    /// Column and row of a point.
    #[inline]
    pub fn pixel(&self, u: f64, z: f64) -> [f64; 2] {
        [0, 1].map(|k| self.origin_px[k] + u * self.right_px[k] + z * self.up_px[k])
    }

    /// `u` and `z` (mm) of a point in the picture.
    pub fn coordinates(&self, [column, row]: [f64; 2]) -> [f64; 2] {
        let (r, p) = (self.right_px, self.up_px);
        let det = r[0] * p[1] - r[1] * p[0];
        let (dx, dy) = (column - self.origin_px[0], row - self.origin_px[1]);
        [(dx * p[1] - dy * p[0]) / det, (dy * r[0] - dx * r[1]) / det]
    }

    /// Pixels per mm along the axis.
    pub fn px_per_mm(&self) -> f64 {
        self.up_px[0].hypot(self.up_px[1])
    }

    /// The line of height `z`, walked a pixel at a time along whichever side of the pixels it crosses most.
    pub(super) fn line(&self, z: f64) -> Line {
        let major = usize::from(self.right_px[0].abs() < self.right_px[1].abs());
        let mm = 1.0 / self.right_px[major];
        let foot = self.pixel(0.0, z);
        let slope = self.right_px[1 - major] * mm;
        Line { major, slope, at_zero: foot[1 - major] - slope * foot[major], foot: foot[major], mm }
    }
}

/// A line of the picture: at `s` along its major coordinate the other one is `at_zero + slope · s`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    /// 0 where it runs along columns' numbers (as usual), 1 along rows'.
    pub major: usize,
    pub slope: f64,
    pub at_zero: f64,
    /// Major coordinate where it crosses the axis.
    foot: f64,
    /// mm a pixel of the major coordinate; negative where u falls.
    mm: f64,
}

impl Line {
    pub(super) fn pixel(&self, s: f64) -> [f64; 2] {
        let other = self.at_zero + self.slope * s;
        if self.major == 0 { [s, other] } else { [other, s] }
    }

    /// Adds the intervals between crossings of the outline, given along the major coordinate in their order.
    pub(super) fn push_intervals(&self, crossings: &[f64], out: &mut Vec<[f64; 2]>) {
        let u = |s: f64| (s - self.foot) * self.mm;
        if self.mm > 0.0 {
            out.extend(crossings.chunks_exact(2).map(|c| [u(c[0]), u(c[1])]));
        } else {
            out.extend(crossings.rchunks_exact(2).map(|c| [u(c[1]), u(c[0])]));
        }
    }
}

/// Adds a crossing; two in one point are none.
pub(super) fn push_crossing(out: &mut Vec<f64>, at: f64) {
    if out.last() == Some(&at) {
        out.pop();
    } else {
        out.push(at);
    }
}

/// The sights of all cones; the first that is not level is an error.
pub(super) fn all(cones: &[Cone]) -> Result<Vec<Sight>, SliceError> {
    cones.iter().map(|c| Sight::of(c.projection())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::Turntable;
    use crate::geometry::{Angle, Point};

    #[test]
    fn a_turntables_view_is_its_angle_axis_and_roll() {
        let table = Turntable {
            mm_per_px: 0.0043,
            axis_column_px: 510.3,
            origin_row_px: 700.0,
            elevation_rad: 0.0,
            roll_rad: 0.02,
            camera_distance_mm: None,
        };
        for (degrees, offset) in [(0.0, 0.0), (33.0, 1.5), (-120.0, -2.0), (179.9, 0.3)] {
            let camera = table.view(Angle::from_deg(degrees), offset);
            let sight = Sight::of(&camera).unwrap();
            let (sin, cos) = f64::to_radians(degrees).sin_cos();
            assert!((sight.angle_rad - degrees.to_radians()).abs() < 1e-12, "{degrees}: {}", sight.angle_rad);
            let p = Point::new(0.31, -0.2, 0.9);
            let (u, z) = (p.x * cos - p.y * sin, p.z);
            let (seen, placed) = (camera.project(&p).unwrap(), sight.pixel(u, z));
            assert!((0..2).all(|k| (seen[k] - placed[k]).abs() < 1e-9));
            let back = sight.coordinates(placed);
            assert!((back[0] - u).abs() < 1e-12 && (back[1] - z).abs() < 1e-12);
            let line = sight.line(z);
            let on = line.pixel(placed[line.major]);
            assert!((0..2).all(|k| (on[k] - placed[k]).abs() < 1e-9));
        }
        let rising = Turntable { elevation_rad: 0.01, ..table };
        let e = Sight::of(&rising.view(Angle::default(), 0.0)).unwrap_err();
        assert!(e.to_string().contains("0.57"), "{e}");
        let near = Turntable { camera_distance_mm: Some(100.0), ..table };
        assert_eq!(
            Sight::of(&near.view(Angle::default(), 0.0)),
            Err(SliceError::NotLevel { elevation_rad: None })
        );
    }
}

//! The camera before the turning grain: rays through pixels, and points' places in the picture.

use super::plan::Row;
use nalgebra::{Rotation3, Vector3};

type V = Vector3<f64>;

/// Parallel rays begin so far before the axis, mm.
const FAR_MM: f64 = 200.0;

/// One view's camera.
#[derive(Debug, Clone)]
pub struct View {
    /// How far the grain is turned, degrees.
    pub angle_deg: f64,
    /// The view's own shift to the right, pixels.
    pub wobble_px: f64,
    foot: [f64; 2],
    roll: (f64, f64),
    pitch: Rotation3<f64>,
    turn: Rotation3<f64>,
    mm_per_px: f64,
    distance: Option<f64>,
}

impl View {
    /// A row's camera when the grain is turned so far.
    pub fn new(row: &Row, angle_deg: f64, wobble_px: f64) -> Self {
        let [column, line] = row.foot_px();
        Self {
            angle_deg,
            wobble_px,
            foot: [column + wobble_px, line],
            roll: row.camera.roll_deg.to_radians().sin_cos(),
            pitch: Rotation3::from_axis_angle(&V::x_axis(), row.camera.pitch_deg.to_radians()),
            turn: Rotation3::from_axis_angle(&V::z_axis(), angle_deg.to_radians()),
            mm_per_px: row.mm_per_px(),
            distance: (row.camera.distance_mm > 0.0).then_some(row.camera.distance_mm),
        }
    }

    /// How far a place in the picture is to the right of the axis' foot and below the pedestal's top, without the roll, pixels.
    pub fn beside_foot(&self, [column, row]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.roll;
        let (dc, dr) = (column - self.foot[0], row - self.foot[1]);
        [dc * cos - dr * sin, dc * sin + dr * cos]
    }

    /// The ray through a place in the picture, in the room: its beginning `before` the axis, mm, and its direction.
    pub fn ray(&self, place: [f64; 2], before: f64) -> (V, V) {
        let [u, v] = self.beside_foot(place);
        let (x, z) = (u * self.mm_per_px, -v * self.mm_per_px);
        let (origin, direction) = match self.distance {
            None => (V::new(x, -FAR_MM, z), V::y()),
            Some(d) => (V::new(0.0, -d, 0.0), V::new(x, d, z).normalize()),
        };
        let ahead = self.distance.unwrap_or(FAR_MM) - before;
        let origin = origin + direction * (ahead / direction.y);
        (self.pitch * origin, self.pitch * direction)
    }

    /// How large a millimetre at the axis is in the picture, pixels.
    pub fn px_per_mm(&self) -> f64 {
        1.0 / self.mm_per_px
    }

    /// Column and row of a point of the table, pixels.
    pub fn project(&self, p: &V) -> [f64; 2] {
        let q = self.pitch.inverse() * (self.turn * p);
        let scale = self.distance.map_or(1.0, |d| d / (d + q.y)) / self.mm_per_px;
        let (u, v) = (q.x * scale, -q.z * scale);
        let (sin, cos) = self.roll;
        [u * cos + v * sin + self.foot[0], -u * sin + v * cos + self.foot[1]]
    }

    /// From the room to the table.
    pub fn to_table(&self, v: &V) -> V {
        self.turn.inverse() * v
    }

    /// From the table to the room.
    pub fn to_room(&self, v: &V) -> V {
        self.turn * v
    }
}

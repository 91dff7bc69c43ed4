//! Surfaces as a person sees them: facets turned towards the reader, lit from the left above.

use crate::geometry::{Point, Vector};
use nalgebra::Rotation3;

const LIGHT: [f64; 3] = [-0.5, 0.45, 0.74];
/// Greys in the dark and in full light.
const GREYS: [f64; 2] = [60.0, 235.0];

/// The triangles that face the reader, the farthest first: corners to the right and upwards, and a grey. `view` turns the
/// world so that x is to the right, y upwards and z towards the reader.
pub fn shaded(
    triangles: impl Iterator<Item = [Point; 3]>,
    view: &Rotation3<f64>,
) -> Vec<(Vec<[f64; 2]>, u8)> {
    let light = Vector::from(LIGHT).normalize();
    let mut facing: Vec<(f64, [Vector; 3], f64)> = triangles
        .filter_map(|t| {
            let c = t.map(|p| view * p.coords);
            let normal = (c[1] - c[0]).cross(&(c[2] - c[0])).try_normalize(0.0)?;
            (normal.z > 0.0).then(|| ((c[0] + c[1] + c[2]).z, c, normal.dot(&light).max(0.0)))
        })
        .collect();
    facing.sort_by(|a, b| a.0.total_cmp(&b.0));
    (facing.into_iter())
        .map(|(_, corners, lit)| {
            let grey = GREYS[0] + (GREYS[1] - GREYS[0]) * lit;
            (corners.map(|c| [c.x, c.y]).into(), grey.round() as u8)
        })
        .collect()
}

/// The view from the side, from a direction so far round from −y against the clock, looking down by so much, radians.
pub fn from_the_side(round: f64, down: f64) -> Rotation3<f64> {
    let upright = Rotation3::from_axis_angle(&Vector::x_axis(), down - std::f64::consts::FRAC_PI_2);
    upright * Rotation3::from_axis_angle(&Vector::z_axis(), round)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_has_up_above_and_what_is_near_before() {
        let level = from_the_side(0.0, 0.0);
        assert!((level * Vector::z() - Vector::y()).norm() < 1e-12);
        assert!((level * Vector::x() - Vector::x()).norm() < 1e-12);
        // Who looks down sees the upper side.
        assert!((from_the_side(0.3, 0.4) * Vector::z()).z > 0.3);
        let up = [Point::new(0.0, 0.0, 0.0), Point::new(1.0, 0.0, 0.0), Point::new(0.0, 1.0, 0.0)];
        let down = [up[0], up[2], up[1]];
        assert_eq!(shaded([up, down].into_iter(), &from_the_side(0.0, 0.4)).len(), 1);
    }
}

//! Limits of a body's size and of its distance from the origin.

use super::MeshError;
use crate::geometry::Aabb;

/// From a nanometre to a kilometre: beyond them areas and volumes lose digits, and no body is so large or small.
const LEAST_MM: f64 = 1e-6;
const MOST_MM: f64 = 1e6;
/// Steps of double precision over a body: far more than the mesher's own rounding needs.
const LEAST_STEPS: f64 = 1e6;

/// Whether a body with this box can be computed with.
///
/// # Errors
/// [`MeshError::Extent`] for one shorter than a nanometre or longer than a kilometre, [`MeshError::Far`] for one so far from
/// the origin that coordinates there are too coarse for it.
pub fn check_extent(bounds: &Aabb) -> Result<(), MeshError> {
    let (longest_mm, far_mm) = (bounds.size().max(), bounds.farthest());
    if !(LEAST_MM..=MOST_MM).contains(&longest_mm) {
        return Err(MeshError::Extent { longest_mm, least: LEAST_MM, most: MOST_MM });
    }
    let step_mm = far_mm.next_up() - far_mm;
    if longest_mm < LEAST_STEPS * step_mm {
        return Err(MeshError::Far { longest_mm, far_mm, step_mm });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    #[test]
    fn sizes_and_places_beyond_reason_are_refused_with_value_and_limit() {
        let cube = |at: f64, long: f64| Aabb {
            min: Point::new(at, at, at),
            max: Point::new(at + long, at + long, at + long),
        };
        let message = |bounds: Aabb| check_extent(&bounds).unwrap_err().to_string();
        assert_eq!(check_extent(&cube(-0.5, 1.0)), Ok(()));
        assert_eq!(check_extent(&cube(1e7, 1.0)), Ok(()));
        assert!(message(cube(0.0, 1e38)).contains("1.0000e38 mm long, it must be 1e-6 to 1e6 mm"));
        assert!(message(cube(0.0, 1e-38)).contains("it must be 1e-6 to 1e6 mm"));
        assert!(message(cube(f64::NEG_INFINITY, 1.0)).contains("mm long"));
        assert!(message(cube(1e12, 1.0)).contains("move it to the origin"));
    }
}

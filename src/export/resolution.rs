//! How finely a file keeps coordinates: far from the origin less finely than near it.

use super::ExportError;
use crate::geometry::{Aabb, Point};

/// Steps of the coordinates that a body must be long at least: with fewer its facets are no longer its own.
const LEAST_STEPS: f64 = 1000.0;

/// Whether coordinates in single or double precision are fine enough for the body that they describe.
///
/// # Errors
/// [`ExportError::Resolution`] with the length of the body, its distance from the origin and the step between neighbouring
/// coordinates there.
pub(super) fn check(
    format: &'static str,
    places: impl IntoIterator<Item = Point>,
    single: bool,
) -> Result<(), ExportError> {
    let Some(bounds) = Aabb::of(places) else { return Ok(()) };
    let (longest, far) = (bounds.size().max(), bounds.farthest());
    let step = if single {
        let far = far as f32;
        f64::from(far.next_up()) - f64::from(far)
    } else {
        far.next_up() - far
    };
    // A body that is not finite is for others to refuse.
    if far > 0.0 && longest.is_finite() && longest < LEAST_STEPS * step {
        let kind = if single { "single" } else { "double" };
        return Err(ExportError::Resolution { format, kind, longest, far, step, least: LEAST_STEPS });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edge(from: f64, long: f64) -> [Point; 2] {
        [Point::new(from, 0.0, 0.0), Point::new(from + long, 0.0, 0.0)]
    }

    #[test]
    fn what_is_far_away_is_coarse() {
        assert!(check("STL", edge(0.0, 1.0), true).is_ok());
        assert!(check("STL", edge(1e3, 1.0), true).is_ok());
        let e = check("STL", edge(1e7, 1.0), true).unwrap_err().to_string();
        for part in
            ["1 long", "10000001 from the origin", "single precision are 1 apart", "move it to the origin"]
        {
            assert!(e.contains(part), "{part}: {e}");
        }
        assert!(check("PLY", edge(1e7, 1.0), false).is_ok());
        assert!(check("PLY", edge(1e14, 1.0), false).is_err());
        // At any size, the smallest numbers that there are excepted.
        assert!(check("STL", edge(-1e-30, 1e-30), true).is_ok());
        assert!(check("STL", edge(0.0, 1e-43), true).is_err());
    }
}

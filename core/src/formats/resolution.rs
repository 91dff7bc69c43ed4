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
    points: impl IntoIterator<Item = Point>,
    single: bool,
) -> Result<(), ExportError> {
    let Some(bounds) = Aabb::of(points) else { return Ok(()) };
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

/// Decimals of a mantissa that are written of coordinates: ten digits, or fourteen of a body that lies so far from the origin
/// that ten would move its nodes. A field of a deck has room for twenty characters.
///
/// # Errors
/// As [`check`], where fourteen are too few.
pub(super) fn decimals(format: &'static str, points: &[Point]) -> Result<usize, ExportError> {
    const USUAL: (usize, f64) = (9, 1e-9);
    const MOST: (usize, f64) = (13, 1e-13);
    let Some(bounds) = Aabb::of(points.iter().copied()) else { return Ok(USUAL.0) };
    let (longest, far) = (bounds.size().max(), bounds.farthest());
    // A thousandth of the least step that a body must have: its elements are smaller than it is.
    if far * USUAL.1 * 1e3 * LEAST_STEPS <= longest {
        return Ok(USUAL.0);
    }
    let step = far * MOST.1;
    if longest < LEAST_STEPS * step {
        let kind = "14-digit";
        return Err(ExportError::Resolution { format, kind, longest, far, step, least: LEAST_STEPS });
    }
    Ok(MOST.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edge(from: f64, long: f64) -> [Point; 2] {
        [Point::new(from, 0.0, 0.0), Point::new(from + long, 0.0, 0.0)]
    }

    #[test]
    fn more_digits_are_written_of_what_is_far_away_until_there_are_too_few() {
        let of = |from| decimals("Abaqus", &edge(from, 1.0));
        assert_eq!(
            [of(0.0).unwrap(), of(500.0).unwrap(), of(1e4).unwrap(), of(-3e8).unwrap()],
            [9, 9, 13, 13]
        );
        assert!(of(1e11).unwrap_err().to_string().contains("14-digit precision"));
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

//! Line fits to an upright pin's two sides: the width between them, pixels.

use super::ball::LEAST_RADIUS_PX;
use crate::silhouette::Silhouette;

/// Sides further than this from straight and parallel, as a share of the width (root mean square), are no pin's.
pub const MOST_CROOKED: f64 = 0.01;
/// The sides may close or open by this over the rows looked at, as a share of the width.
const MOST_TAPER: f64 = 0.01;
/// Rows that are needed.
const LEAST_ROWS: usize = 30;
/// Which part of the body's height is looked at, from its top: clear of the rim, and of what it stands in.
const MID_HEIGHT: [f64; 2] = [0.2, 0.8];

/// The two sides of a pin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sides {
    /// Half the distance between the sides, pixels.
    pub half_width_px: f64,
    /// Its standard uncertainty from the sides' own scatter, neighbouring rows' likeness allowed for, pixels.
    pub sigma_px: f64,
    /// Root mean square distance of the sides from straight lines, pixels.
    pub residual_px: f64,
    /// Column and row of the middle, pixels.
    pub center_px: [f64; 2],
    /// Rows that were used.
    pub rows: usize,
    /// How many of them are independent of each other.
    pub independent: f64,
}

/// Why a picture shows no pin.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PinError {
    /// Too short.
    #[error(
        "the body shows {rows} rows between its ends, at least {LEAST_ROWS} are needed; use a longer pin, or more \
         magnification"
    )]
    TooShort {
        /// Rows seen.
        rows: usize,
    },
    /// Too coarse.
    #[error("the pin is {width_px:.1} px wide, at least {} px are needed; use a thicker pin", 2.0 * LEAST_RADIUS_PX)]
    TooNarrow {
        /// Its width, pixels.
        width_px: f64,
    },
    /// Not straight.
    #[error(
        "the body is no upright pin: its sides are {share:.2} % of its width off straight and parallel lines, {limit} % \
         is the limit; use a clean cylinder that stands upright, and crop what it stands in",
        share = 100.0 * share,
        limit = 100.0 * MOST_CROOKED
    )]
    Crooked {
        /// Share of the width.
        share: f64,
    },
}

/// Both sides of a pin at mid height: straight lines by least squares through the outline's ends of each row.
///
/// # Errors
/// [`PinError`] where the body is too small, or its sides are not straight and parallel.
pub fn fit_sides(silhouette: &Silhouette) -> Result<Sides, PinError> {
    let extents = silhouette.extents_px();
    let first = extents.iter().position(Option::is_some).unwrap_or(0);
    let end = extents.iter().rposition(Option::is_some).map_or(0, |k| k + 1);
    let at = |share: f64| first + (share * (end - first) as f64).round() as usize;
    let rows: Vec<(f64, [f64; 2])> = (at(MID_HEIGHT[0])..at(MID_HEIGHT[1]))
        .filter_map(|k| Some(((silhouette.origin[1] + k) as f64, extents[k]?)))
        .collect();
    if rows.len() < LEAST_ROWS {
        return Err(PinError::TooShort { rows: rows.len() });
    }
    let middle = Line::through(rows.iter().map(|(y, [l, r])| (*y, 0.5 * (l + r))));
    let width = Line::through(rows.iter().map(|(y, [l, r])| (*y, r - l)));
    // Across the sides, which lean with the camera's roll.
    let upright = 1.0 / middle.slope.hypot(1.0);
    let width_px = width.mean * upright;
    if width_px < 2.0 * LEAST_RADIUS_PX {
        return Err(PinError::TooNarrow { width_px });
    }
    let height = rows.len() as f64;
    let off = width.spread().hypot(2.0 * middle.spread());
    let share = (off / width_px).max((width.slope * height / width_px).abs() * MOST_CROOKED / MOST_TAPER);
    if share > MOST_CROOKED {
        return Err(PinError::Crooked { share });
    }
    let along = width.correlation();
    let sigma_px = 0.5 * width.spread() * upright * (along / height).sqrt();
    Ok(Sides {
        half_width_px: 0.5 * width_px,
        sigma_px,
        residual_px: 0.5 * off,
        center_px: [middle.mean, middle.at],
        rows: rows.len(),
        independent: height / along,
    })
}

/// A straight line through values over rows.
struct Line {
    /// Mean row.
    at: f64,
    /// Value there.
    mean: f64,
    /// Per row.
    slope: f64,
    residuals: Vec<f64>,
}

impl Line {
    fn through(values: impl Iterator<Item = (f64, f64)>) -> Self {
        let values: Vec<(f64, f64)> = values.collect();
        let n = values.len() as f64;
        let at = values.iter().map(|v| v.0).sum::<f64>() / n;
        let mean = values.iter().map(|v| v.1).sum::<f64>() / n;
        let (mut xx, mut xy) = (0.0, 0.0);
        for (y, v) in &values {
            xx += (y - at).powi(2);
            xy += (y - at) * (v - mean);
        }
        let slope = xy / xx;
        let residuals = values.iter().map(|(y, v)| v - mean - slope * (y - at)).collect();
        Self { at, mean, slope, residuals }
    }

    fn spread(&self) -> f64 {
        (self.residuals.iter().map(|e| e * e).sum::<f64>() / self.residuals.len() as f64).sqrt()
    }

    fn correlation(&self) -> f64 {
        super::ball::integrated_correlation(&self.residuals)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An upright body whose sides lie at these columns in each row.
    fn body(sides: impl Fn(f64) -> [f64; 2]) -> Silhouette {
        let size = [300, 260];
        let distance_px = (0..size[0] * size[1])
            .map(|k| {
                let (x, y) = ((k % 300) as f64, (k / 300) as f64);
                let [l, r] = sides(y);
                (l - x).max(x - r).max(20.0 - y).max(y - 250.0) as f32
            })
            .collect();
        Silhouette { picture: [600, 500], origin: [40, 30], size, distance_px }
    }

    #[test]
    fn a_leaning_pin_is_measured_across() {
        let lean = 0.8f64.to_radians();
        let half = 61.27;
        let pin = body(|y| {
            let middle = 150.0 + lean.tan() * (y - 130.0);
            [middle - half / lean.cos(), middle + half / lean.cos()]
        });
        let sides = fit_sides(&pin).unwrap();
        assert!((sides.half_width_px - half).abs() < 0.01, "{sides:?}");
        assert!((sides.center_px[0] - 190.0).abs() < 1.0, "{sides:?}");
    }

    #[test]
    fn what_is_no_pin_is_refused() {
        let cone = body(|y| [150.0 - 0.3 * y, 150.0 + 0.3 * y]);
        assert!(matches!(fit_sides(&cone), Err(PinError::Crooked { .. })));
        let step = body(|y| if y > 150.0 { [60.0, 240.0] } else { [90.0, 210.0] });
        assert!(matches!(fit_sides(&step), Err(PinError::Crooked { .. })));
        assert!(matches!(fit_sides(&body(|_| [140.0, 165.0])), Err(PinError::TooNarrow { .. })));
        let mut short = body(|_| [90.0, 210.0]);
        short.distance_px[60 * 300..].fill(9.0);
        assert!(matches!(fit_sides(&short), Err(PinError::TooShort { .. })));
    }
}

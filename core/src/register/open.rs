//! Silhouettes that are open below a line: there they carve nothing.
//!
//! A silhouette ends at the pedestal's top, but the grain does not: a little of it is embedded, and just above the top
//! the pedestal's blurred light mixes with the grain's. A pose must not carve there what another pose shows.

use crate::silhouette::Silhouette;

/// The line in a picture down to which a silhouette shows the grain by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// A column of the picture, pixels …
    pub column_px: f64,
    /// … and the line's row there, pixels.
    pub row_px: f64,
    /// Rows per column.
    pub slope: f64,
    /// How far below the line the silhouette ends, pixels: in between it is not relied on.
    pub mixed_px: f64,
}

/// How far below the line a grain may reach, as a share of the silhouette's height: no grain is glued deeper.
const DEEPEST: f64 = 0.1;
/// How far the hidden foot may spread to either side with its depth: an overhang of 63°.
const SPREAD: f64 = 2.0;
/// Steps along the line, pixels.
const STEP_PX: f64 = 0.5;

impl Cut {
    /// How far a point of the picture lies above the line, pixels; negative below it.
    #[inline]
    pub fn above_px(&self, [column, row]: [f64; 2]) -> f64 {
        (self.row_px + self.slope * (column - self.column_px) - row) / self.slope.hypot(1.0)
    }

    /// The columns between which the line runs through the silhouette; `None` where it passes below it.
    fn foot(&self, s: &Silhouette) -> Option<[f64; 2]> {
        let steps = (s.size[0] as f64 / STEP_PX) as usize;
        let row = |column: f64| self.row_px + self.slope * (column - self.column_px);
        let mut inside = (0..=steps)
            .map(|k| s.origin[0] as f64 + k as f64 * STEP_PX)
            .filter(|&c| s.signed_distance_px([c, row(c)]) < 0.0);
        let first = inside.next()?;
        Some([first, inside.next_back().unwrap_or(first)])
    }

    /// The silhouette with what the pedestal may hide counted as inside: below the line, under the point where the
    /// grain goes through it and some way to either side, down to a tenth of the silhouette's height. The rectangle
    /// may reach beyond the picture.
    pub fn opened(&self, s: &Silhouette) -> Silhouette {
        let Some([left, right]) = self.foot(s) else { return s.clone() };
        let deepest = DEEPEST * s.size[1] as f64;
        let aside = (SPREAD * deepest).ceil() as usize;
        let origin = [s.origin[0].saturating_sub(aside), s.origin[1]];
        let size = [s.origin[0] + s.size[0] + aside - origin[0], s.size[1] + deepest.ceil() as usize];
        let distance_px = (0..size[0] * size[1])
            .map(|n| {
                let at = [(origin[0] + n % size[0]) as f64, (origin[1] + n / size[0]) as f64];
                let above = self.above_px(at);
                let beside = (left - at[0]).max(at[0] - right);
                let foot = above.max((beside + SPREAD * above) / SPREAD.hypot(1.0)).max(-above - deepest);
                s.signed_distance_px(at).min(foot) as f32
            })
            .collect();
        Silhouette { picture: s.picture, origin, size, distance_px }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn below_the_line_the_foot_is_open_and_above_it_nothing_changes() {
        let size = [40, 40];
        let distance_px =
            (0..1600).map(|n| (((n % 40) as f32 - 20.0).hypot((n / 40) as f32 - 20.0)) - 12.0).collect();
        let disc = Silhouette { picture: [100, 60], origin: [10, 10], size, distance_px };
        let cut = Cut { column_px: 30.0, row_px: 38.0, slope: 0.1, mixed_px: 0.0 };
        let open = cut.opened(&disc);
        for (column, row) in [(30.0, 20.0), (22.5, 25.25), (41.0, 36.0), (12.0, 30.0)] {
            let (was, is) = (disc.signed_distance_px([column, row]), open.signed_distance_px([column, row]));
            assert!((was - is).abs() < 1e-5, "at {column}, {row}: {was} became {is}");
        }
        for (column, row) in [(30.0, 41.0), (22.0, 38.5), (40.0, 41.0)] {
            assert!(open.signed_distance_px([column, row]) < 0.0, "{column}, {row}");
            assert!(cut.above_px([column, row]) < 0.0);
        }
        for (column, row) in [(30.0, 43.5), (10.0, 39.0), (55.0, 42.0)] {
            assert!(open.signed_distance_px([column, row]) > 0.0, "{column}, {row}");
        }
    }
}

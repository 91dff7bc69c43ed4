//! The outline about a pedestal's top as it was before the cut.

use crate::silhouette::outline::Field;
use crate::silhouette::{PedestalOutline, Silhouette};

/// Rows above and below the top for which the outline before the cut is kept.
const ROWS: usize = 24;

/// The outline around a pedestal's top as it was before the cut: the last rows of a silhouette's rectangle.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncut {
    /// The first row kept, counted in the silhouette's rectangle; all below it are kept too.
    pub(in crate::silhouette) first: usize,
    /// `[row, column]`, row-major: 0 on the outline, −1 well inside, +1 well outside.
    pub(in crate::silhouette) values: Vec<f32>,
}

impl Uncut {
    /// The last rows of a silhouette's rectangle whose first row is `first_row`, from a little above the pedestal's top on,
    /// before the cut.
    pub(in crate::silhouette) fn of(whole: &Field, first_row: usize, top_row: f64) -> Self {
        let Field { width, height, values } = whole;
        let above = (top_row.max(0.0) as usize).saturating_sub(first_row + ROWS);
        let first = above.min(*height);
        Self { first, values: values[first * width..].to_vec() }
    }
}

impl Silhouette {
    /// Width of the outline along the line one pixel above a pedestal's top, pixels.
    pub(in crate::silhouette) fn width_above(&self, pedestal: &PedestalOutline) -> f64 {
        const STEP: f64 = 0.125;
        let first = self.origin[0] as f64;
        let row = |x: f64| pedestal.top_row - 1.0 + pedestal.top_slope * (x - pedestal.centre_column);
        let steps = (self.size[0] as f64 / STEP) as usize;
        let inside = (0..steps)
            .map(|k| first + STEP * k as f64)
            .filter(|&x| self.signed_distance_px([x, row(x)]) < 0.0);
        inside.count() as f64 * STEP * pedestal.top_slope.hypot(1.0)
    }
}

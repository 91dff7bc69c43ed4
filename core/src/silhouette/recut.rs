//! A silhouette that has been found, cut again at a pedestal's top that is known better.

use super::outline::Field;
use super::{Found, PedestalSeen, Silhouette, distance};

/// Rows above and below the top for which the outline before the cut is kept.
pub(super) const ROWS: usize = 24;
/// The cut is this much wider than the pedestal on each side, pixels.
const CUT_MARGIN: f64 = 5.0;

/// The outline around a pedestal's top as it was before the cut: the last rows of a silhouette's rectangle.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncut {
    /// The first row kept, counted in the silhouette's rectangle; all below it are kept too.
    pub(super) first: usize,
    /// `[row, column]`, row-major: 0 on the outline, −1 well inside, +1 well outside.
    pub(super) values: Vec<f32>,
}

impl Silhouette {
    /// Width of the outline along the line one pixel above a pedestal's top, pixels.
    pub(super) fn width_above(&self, stand: &PedestalSeen) -> f64 {
        const STEP: f64 = 0.125;
        let first = self.origin[0] as f64;
        let row = |x: f64| stand.top_row - 1.0 + stand.top_slope * (x - stand.centre_column);
        let steps = (self.size[0] as f64 / STEP) as usize;
        let inside = (0..steps)
            .map(|k| first + STEP * k as f64)
            .filter(|&x| self.signed_distance_px([x, row(x)]) < 0.0);
        inside.count() as f64 * STEP * stand.top_slope.hypot(1.0)
    }
}

impl Found {
    /// Cuts the silhouette at a top row (at `centre_column`), slope and half width in place of its own; all in pixels
    /// of the picture. Distances, area, length and pedestal are those of the new cut; what Otsu's thresholds give was
    /// counted at the old one. Whether anything of the grain is left: where not, nothing is changed.
    pub fn recut(&mut self, stand: PedestalSeen) -> bool {
        let s = &self.silhouette;
        let [width, height] = s.size;
        let mut field =
            Field { width, height, values: s.distance_px.iter().map(|d| d.clamp(-1.0, 1.0)).collect() };
        if let Some(uncut) = &self.uncut {
            field.values[uncut.first * width..].copy_from_slice(&uncut.values);
        }
        let along = 1.0 / stand.top_slope.hypot(1.0);
        let reach = stand.half_width + CUT_MARGIN;
        field.cut(|x, y| {
            let aside = x + s.origin[0] as f64 - stand.centre_column;
            let below = y + s.origin[1] as f64 - stand.top_row - stand.top_slope * aside;
            (aside.abs() <= reach).then_some(below * along)
        });
        field.keep_largest();
        if !field.values.iter().any(|v| *v < 0.0) {
            return false;
        }
        let lowest = field.values.len() - width;
        let at_end = s.origin[1] + height == self.report.frame[3];
        self.report.touches_border[3] = at_end && field.values[lowest..].iter().any(|v| *v < 0.0);
        self.silhouette.distance_px = distance::signed(&field);
        self.report.area_px = self.silhouette.area_px();
        self.report.outline_length_px = self.silhouette.length_px();
        self.report.contact_width_px = Some(self.silhouette.width_above(&stand));
        self.report.pedestal = Some(stand);
        true
    }
}

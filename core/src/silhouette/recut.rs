//! A segmentation cut again at a pedestal's top that is known better.

use super::outline::Field;
use super::pedestal::CUT_MARGIN;
use super::{PedestalOutline, Segmentation, distance};

impl Segmentation {
    /// Cuts the silhouette at a top row (at `centre_column`), slope and half width in place of its own; all in pixels
    /// of the picture. Distances, area, length and pedestal are those of the new cut; what Otsu's thresholds give was
    /// counted at the old one. Whether anything of the grain is left: where not, nothing is changed.
    pub fn recut(&mut self, pedestal: PedestalOutline) -> bool {
        let s = &self.silhouette;
        let [width, height] = s.size;
        let mut field =
            Field { width, height, values: s.distance_px.iter().map(|d| d.clamp(-1.0, 1.0)).collect() };
        if let Some(uncut) = &self.uncut {
            field.values[uncut.first * width..].copy_from_slice(&uncut.values);
        }
        let along = 1.0 / pedestal.top_slope.hypot(1.0);
        let reach = pedestal.half_width + CUT_MARGIN;
        field.cut(|x, y| {
            let aside = x + s.origin[0] as f64 - pedestal.centre_column;
            let below = y + s.origin[1] as f64 - pedestal.top_row - pedestal.top_slope * aside;
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
        self.report.contact_width_px = Some(self.silhouette.width_above(&pedestal));
        self.report.pedestal = Some(pedestal);
        true
    }
}

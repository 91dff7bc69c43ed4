//! A segmentation cut again at a pedestal's top that is known better.

use super::outline::Field;
use super::pedestal::cut_margin;
use super::{PedestalOutline, Segmentation, Silhouette, distance};

/// What is known of a rim at places a few pixels apart holds about each, pixels; further away, where little weighs, the average does.
const SPREAD_PX: f64 = 4.0;
const LEAST_WEIGHT: f32 = 0.3;

impl Segmentation {
    /// Moves the outline outwards by so many pixels on average, more or less where its rim is wider or narrower, but not below the pedestal's
    /// top.
    pub fn grow(&mut self, px: f64) {
        let wider = self.wider();
        let s = &mut self.silhouette;
        let [width, height] = s.size;
        let top = self
            .report
            .pedestal
            .map(|p| (p, p.top_slope.hypot(1.0), p.half_width + cut_margin(self.blur_px)));
        for (k, distance) in s.distance_px.iter_mut().enumerate() {
            let moved = *distance - (px as f32 + wider.get(k).copied().unwrap_or(0.0)).max(0.0);
            let (x, y) = ((k % width + s.origin[0]) as f64, (k / width + s.origin[1]) as f64);
            let below = top.and_then(|(p, along, reach)| {
                let aside = x - p.centre_column;
                (aside.abs() <= reach).then(|| (y - p.top_row - p.top_slope * aside) / along)
            });
            *distance = below.map_or(moved, |below| moved.max((below as f32).min(*distance)));
        }
        if !wider.is_empty() {
            let values = s.distance_px.iter().map(|d| d.clamp(-1.0, 1.0)).collect();
            s.distance_px = distance::signed(&Field { width, height, values });
        }
        self.report.rim_px += px;
        self.report.area_px = self.silhouette.area_px();
        self.report.outline_length_px = self.silhouette.length_px();
        self.report.contact_width_px = self.report.pedestal.map(|p| self.silhouette.width_above(&p));
    }

    /// By how much the rim is wider than on average at each pixel of the silhouette's rectangle; empty where no rim was looked at.
    fn wider(&self) -> Vec<f32> {
        let Silhouette { origin, size: [width, height], .. } = self.silhouette;
        if self.rims.is_empty() {
            return Vec::new();
        }
        let mut sums = vec![[0f32; 2]; width * height];
        let reach = (3.0 * SPREAD_PX).ceil() as isize;
        for rim in &self.rims {
            let at = [0, 1].map(|k| rim.at[k] - origin[k] as f64);
            let [x, y] = at.map(|v| v.round() as isize);
            for j in (y - reach).max(0)..=(y + reach).min(height as isize - 1) {
                for i in (x - reach).max(0)..=(x + reach).min(width as isize - 1) {
                    let squares = (i as f64 - at[0]).powi(2) + (j as f64 - at[1]).powi(2);
                    let weight = (-0.5 * squares / SPREAD_PX.powi(2)).exp();
                    let sum = &mut sums[j as usize * width + i as usize];
                    sum[0] += (weight * rim.px) as f32;
                    sum[1] += weight as f32;
                }
            }
        }
        sums.into_iter().map(|[sum, weight]| sum / weight.max(LEAST_WEIGHT)).collect()
    }

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
        let reach = pedestal.half_width + cut_margin(self.blur_px);
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

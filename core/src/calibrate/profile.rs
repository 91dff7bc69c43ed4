//! Extents of the outlines to either side of the axis at common heights: `[sample, height]`, pixels.

use crate::silhouette::Silhouette;

/// Lines that are read and averaged in one height.
const LINES: usize = 5;
/// Share of the common height that is left out below (beside the pedestal, where grain and glue meet) and above
/// (where the outline runs across the lines), and the least of it in pixels.
const LEFT_OUT: (f64, f64) = (0.05, 0.10);
const LEAST_LEFT_OUT_PX: f64 = 5.0;
/// Lines closer than this are not independent, pixels.
const CLOSEST_PX: f64 = 2.0;

/// The axis as it is known so far: a straight line in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisLine {
    /// Column of the axis in the foot's row.
    pub column_px: f64,
    /// The foot's row.
    pub row_px: f64,
    /// Roll, radians.
    pub roll_rad: f64,
}

impl AxisLine {
    /// Column and row of the point `u` to the right of the axis and `z` above its foot, pixels, both turned by the roll.
    pub(super) fn pixel(&self, u: f64, z: f64) -> [f64; 2] {
        let (sin, cos) = self.roll_rad.sin_cos();
        [self.column_px + u * cos - z * sin, self.row_px - u * sin - z * cos]
    }

    /// How far right of the axis and above the foot a point of the picture lies, pixels.
    pub(super) fn coordinates(&self, [column, row]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.roll_rad.sin_cos();
        let (du, dv) = (column - self.column_px, row - self.row_px);
        [du * cos - dv * sin, -(du * sin + dv * cos)]
    }
}

/// Extents of all views at common heights.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::struct_field_names, reason = "the unit stands in each name")]
pub(super) struct Profiles {
    /// Heights above the foot, pixels, ascending and even.
    pub z_px: Vec<f64>,
    /// `[sample, height]`, row-major: how far the grain reaches from the axis, first to the left in every view, then
    /// to the right in every view, pixels.
    pub reach_px: Vec<f64>,
    /// The same of the heights in the picture at which they were read, pixels.
    pub seen_px: Vec<f64>,
    /// Whole height that all views share, pixels.
    pub height_px: f64,
}

/// How far apart in height a reach may be read from where it is sought, as a share of what is left out above and below.
const MOST_APART: f64 = 0.8;

impl Profiles {
    /// Reads `heights` heights at most; `None` where the views share too few rows. `seen_at` tells at which height of the picture a
    /// sample's point of a height is seen, as near as can be.
    pub(super) fn read(
        views: &[&Silhouette],
        line: &AxisLine,
        heights: usize,
        seen_at: &(impl Fn(usize, f64) -> f64 + Sync),
    ) -> Option<Self> {
        let ranges = views.iter().map(|s| height_range(s, line)).collect::<Option<Vec<_>>>()?;
        let low = ranges.iter().map(|r| r[0]).fold(f64::NEG_INFINITY, f64::max);
        let high = ranges.iter().map(|r| r[1]).fold(f64::INFINITY, f64::min);
        let height_px = high - low;
        let margin = |share: f64| (share * height_px).max(LEAST_LEFT_OUT_PX);
        let (low, high) = (low + margin(LEFT_OUT.0), high - margin(LEFT_OUT.1));
        let count = heights.min(((high - low) / CLOSEST_PX).max(0.0) as usize);
        if count < 8 {
            return None;
        }
        let pitch = (high - low) / count as f64;
        let z_px: Vec<f64> = (0..count).map(|k| low + (k as f64 + 0.5) * pitch).collect();
        let most =
            MOST_APART * [LEFT_OUT.0, LEFT_OUT.1].map(margin).into_iter().fold(f64::INFINITY, f64::min);
        let seen_px: Vec<f64> = (0..2 * views.len())
            .flat_map(|sample| z_px.iter().map(move |z| z + (seen_at(sample, *z) - z).clamp(-most, most)))
            .collect();
        let both = |view: usize| -> Option<Vec<[f64; 2]>> {
            (0..count)
                .map(|k| {
                    let mut sum = [0.0; 2];
                    for line_of in 0..LINES {
                        let beside = ((line_of as f64 + 0.5) / LINES as f64 - 0.5) * pitch;
                        for (side, sense) in [-1.0, 1.0].into_iter().enumerate() {
                            let z = seen_px[(side * views.len() + view) * count + k] + beside;
                            sum[side] += sense * end(views[view], line, z, sense)?;
                        }
                    }
                    Some(sum.map(|s| s / LINES as f64))
                })
                .collect()
        };
        let read = {
            use rayon::prelude::*;
            (0..views.len()).into_par_iter().map(both).collect::<Option<Vec<_>>>()?
        };
        let reach_px = (0..2).flat_map(|side| read.iter().flatten().map(move |ends| ends[side])).collect();
        Some(Self { z_px, reach_px, seen_px, height_px })
    }
}

/// Lowest and highest point of the outline along the axis.
fn height_range(s: &Silhouette, line: &AxisLine) -> Option<[f64; 2]> {
    let rows = s.extents_px();
    let ends = rows.iter().enumerate().filter_map(|(j, e)| e.map(|e| ((s.origin[1] + j) as f64, e)));
    let mut range: Option<[f64; 2]> = None;
    for (row, [left, right]) in ends {
        for column in [left, right] {
            let z = line.coordinates([column, row])[1];
            range = Some(range.map_or([z, z], |[a, b]| [a.min(z), b.max(z)]));
        }
    }
    range
}

/// Where the grain ends along a line across the axis, to the left (sense −1) or to the right (1), pixels right of the axis.
fn end(s: &Silhouette, line: &AxisLine, z: f64, sense: f64) -> Option<f64> {
    let (w, h) = (s.size[0] as f64, s.size[1] as f64);
    let corner = |x: f64, y: f64| line.coordinates([s.origin[0] as f64 + x, s.origin[1] as f64 + y])[0];
    let corners = [corner(0.0, 0.0), corner(w, 0.0), corner(0.0, h), corner(w, h)];
    let outmost =
        |sense: f64| sense * corners.map(|c| sense * c).into_iter().fold(f64::NEG_INFINITY, f64::max).ceil();
    let at = |u: f64| s.signed_distance_px(line.pixel(u, z));
    // Outside, the distance is a lower bound of how far the outline is: no smaller step can miss it.
    let (mut u, last) = (outmost(sense), outmost(-sense));
    let mut d = at(u);
    if d < 0.0 {
        return None;
    }
    loop {
        let next = u - sense * (0.9 * d).max(0.5);
        if (last - next) * sense > 0.0 {
            return None;
        }
        let e = at(next);
        if e < 0.0 {
            // Between two points: false position on a field that is nearly linear.
            let (mut a, mut b) = ((u, d), (next, e));
            for _ in 0..4 {
                let x = a.0 + (b.0 - a.0) * a.1 / (a.1 - b.1);
                let m = at(x);
                if m < 0.0 { b = (x, m) } else { a = (x, m) }
            }
            return Some(a.0 + (b.0 - a.0) * a.1 / (a.1 - b.1));
        }
        (u, d) = (next, e);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leaning_ellipse_is_read_in_the_axis_own_frame() {
        // An upright ellipse in the axis' frame, about 5 px right of the axis and 100 px above the foot.
        let line = AxisLine { column_px: 151.3, row_px: 260.2, roll_rad: 0.03 };
        let size = [320, 300];
        let distance_px = (0..size[0] * size[1])
            .map(|k| {
                let [u, z] = line.coordinates([(k % size[0]) as f64, (k / size[0]) as f64]);
                (60.0 * (((u - 5.0) / 60.0).hypot((z - 100.0) / 90.0) - 1.0)) as f32
            })
            .collect();
        let s = Silhouette { picture: size, origin: [0, 0], size, distance_px };
        let p = Profiles::read(&[&s], &line, 40, &|_, z| z).unwrap();
        for (k, z) in p.z_px.iter().enumerate() {
            let half = 60.0 * (1.0 - ((z - 100.0) / 90.0).powi(2)).sqrt();
            // Averaged over the height's lines: the ellipse's curvature costs a little near its ends.
            assert!((p.reach_px[k] - (half - 5.0)).abs() < 0.1, "{z}: {} {half}", p.reach_px[k]);
            assert!((p.reach_px[p.z_px.len() + k] - (half + 5.0)).abs() < 0.1);
        }
        let [u, z] = line.coordinates(line.pixel(12.0, 34.0));
        assert!((u - 12.0).abs() < 1e-12 && (z - 34.0).abs() < 1e-12);
    }
}

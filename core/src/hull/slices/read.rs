//! Strips from silhouettes: every crossing of the outline with the lines of equal height.

use super::sight::{self, Line, Sight, push_crossing};
use super::{RowGrid, SliceError, SlicedHull, Strips};
use crate::hull::Cone;
use crate::silhouette::Silhouette;
use rayon::prelude::*;

/// How far a bilinear field may be from the distance to the outline, pixels (see `hull::cone`), and a little more.
const SLACK_PX: f64 = 1.0;

impl Strips {
    /// From a view's silhouette on the rows of a row grid.
    ///
    /// Along each row's line the distance is looked at from pixel to pixel, in larger steps where it shows that the
    /// outline is farther away; each change of sign is a crossing, placed where the field is 0. So no part or gap that
    /// is a pixel wide is missed. What lies outside the silhouette's rectangle is background.
    ///
    /// # Errors
    /// [`SliceError::RowGrid`], and [`SliceError::NotLevel`] where the view's rays are not parallel and level.
    pub fn from_cone(cone: &Cone, row_grid: RowGrid) -> Result<Self, SliceError> {
        let sight = Sight::of(cone.projection())?;
        let mut crossings = Vec::new();
        Self::from_fn(row_grid, sight.angle_rad, |z, out| {
            let line = sight.line(z);
            cross(cone.silhouette(), &line, &mut crossings);
            line.push_intervals(&crossings, out);
        })
    }
}

impl SlicedHull {
    /// The hull of views before level parallel rays, on rows about a pixel apart that tile the height which all
    /// outlines share.
    ///
    /// # Errors
    /// [`SliceError::NotLevel`], [`SliceError::NoCommonHeight`], and those of [`SlicedHull::new`].
    pub fn of_cones(cones: &[Cone]) -> Result<Self, SliceError> {
        let sights = sight::all(cones)?;
        let ranges: Vec<[f64; 2]> =
            (cones.par_iter().zip(&sights)).map(|(c, s)| height_range(c.silhouette(), s)).collect();
        let low = ranges.iter().map(|r| r[0]).fold(f64::NEG_INFINITY, f64::max);
        let high = ranges.iter().map(|r| r[1]).fold(f64::INFINITY, f64::min);
        let finest = sights.iter().map(Sight::px_per_mm).fold(0.0, f64::max);
        if cones.is_empty() {
            return Err(SliceError::OneDirection { views: 0 });
        }
        let common = low < high;
        if !common {
            return Err(SliceError::NoCommonHeight { low_mm: low, high_mm: high });
        }
        let row_grid = RowGrid::tiling([low, high], 1.0 / finest)?;
        let views =
            cones.par_iter().map(|c| Strips::from_cone(c, row_grid)).collect::<Result<Vec<_>, _>>()?;
        Self::new(&views)
    }
}

/// The crossings of the outline with a line, along its major coordinate: in order, and in pairs, since the distance is
/// above 0 outside the rectangle.
fn cross(s: &Silhouette, line: &Line, out: &mut Vec<f64>) {
    out.clear();
    let at = |x: f64| s.signed_distance_px(line.pixel(x));
    // From just outside the rectangle to just outside it again, by whole pixels.
    let first = s.origin[line.major] as f64 - 1.0;
    let end = first + s.size[line.major] as f64 + 1.0;
    let (mut x, mut d) = (first, at(first));
    while x < end {
        // A step along the line is longer than one along its major coordinate by at most √2; the distance bounds it.
        let step = ((d.abs() - SLACK_PX) / 1f64.hypot(line.slope)).floor().max(1.0);
        let next = (x + step).min(end);
        let e = at(next);
        if (d < 0.0) != (e < 0.0) {
            if next - x > 1.0 {
                // The field is no distance: look at every pixel.
                (x, d) = by_pixels(&at, x, d, next, out);
                continue;
            }
            push_crossing(out, zero(&at, (x, d), (next, e)));
        }
        (x, d) = (next, e);
    }
}

/// The same from `x` to `end` with steps of one pixel; where it ended.
fn by_pixels(at: &impl Fn(f64) -> f64, x: f64, d: f64, end: f64, out: &mut Vec<f64>) -> (f64, f64) {
    let (mut x, mut d) = (x, d);
    while x < end {
        let next = (x + 1.0).min(end);
        let e = at(next);
        if (d < 0.0) != (e < 0.0) {
            push_crossing(out, zero(at, (x, d), (next, e)));
        }
        (x, d) = (next, e);
    }
    (x, d)
}

/// Where a field that is nearly linear over a pixel is 0: a straight line, and once more on the side that holds it.
fn zero(at: &impl Fn(f64) -> f64, a: (f64, f64), b: (f64, f64)) -> f64 {
    let line = |a: (f64, f64), b: (f64, f64)| a.0 + (b.0 - a.0) * (a.1 / (a.1 - b.1));
    let x = line(a, b);
    let d = at(x);
    if d == 0.0 {
        x
    } else if (d < 0.0) == (a.1 < 0.0) {
        line((x, d), b)
    } else {
        line(a, (x, d))
    }
}

/// Lowest and highest point of the outline along the axis, mm; reversed where there is none. The outline is looked up
/// on the pixels' rows and columns, between which it is straight.
fn height_range(s: &Silhouette, sight: &Sight) -> [f64; 2] {
    let [w, h] = s.size;
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    let mut take = |x: f64, y: f64| {
        let z = sight.coordinates([s.origin[0] as f64 + x, s.origin[1] as f64 + y])[1];
        range = [range[0].min(z), range[1].max(z)];
    };
    let d = |x: usize, y: usize| f64::from(s.distance_px[y * w + x]);
    for y in 0..h {
        let mut x = 0;
        while x < w {
            let a = d(x, y);
            if a < 0.0 {
                // Towards each neighbour that is outside.
                for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                    let (i, j) = (x as i64 + dx, y as i64 + dy);
                    let within = (0..w as i64).contains(&i) && (0..h as i64).contains(&j);
                    let b = if within { d(i as usize, j as usize) } else { -a };
                    if b >= 0.0 {
                        let t = a / (a - b);
                        take(x as f64 + t * dx as f64, y as f64 + t * dy as f64);
                    }
                }
            }
            x = x.saturating_add((a.abs() - SLACK_PX).floor().max(1.0) as usize);
        }
    }
    range
}

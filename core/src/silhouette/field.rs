//! The silhouette as a signed distance field.

use super::distance;

/// The outline of the grain in one view, as the signed distance (pixels) to it: negative inside, positive
/// outside. Known on a rectangle of pixels that holds the whole silhouette; everything else is background.
#[derive(Debug, Clone, PartialEq)]
pub struct Silhouette {
    /// Width and height of the whole picture, pixels.
    pub picture: [usize; 2],
    /// Column and row (in the whole picture) of the first pixel of the rectangle.
    pub origin: [usize; 2],
    /// Width and height of the rectangle, pixels.
    pub size: [usize; 2],
    /// `[row, column]`, row-major: signed distance at each pixel's centre, pixels.
    pub distance_px: Vec<f32>,
}

impl Silhouette {
    /// Signed distance (pixels) at a point of the picture (column, row; the first pixel's centre is (0, 0)):
    /// bilinear inside the rectangle; outside it a lower bound of the distance, positive and growing.
    #[inline]
    pub fn signed_distance_px(&self, [u, v]: [f64; 2]) -> f64 {
        let (w, h) = (self.size[0], self.size[1]);
        let (x, y) = (u - self.origin[0] as f64, v - self.origin[1] as f64);
        let (cx, cy) = (x.clamp(0.0, (w - 1) as f64), y.clamp(0.0, (h - 1) as f64));
        let (i, j) = ((cx as usize).min(w.saturating_sub(2)), (cy as usize).min(h.saturating_sub(2)));
        let (fx, fy) = ((cx - i as f64) as f32, (cy - j as f64) as f32);
        let k = j * w + i;
        let (right, down) = (usize::from(w > 1), if h > 1 { w } else { 0 });
        let d = &self.distance_px;
        let top = d[k] + fx * (d[k + right] - d[k]);
        let low = d[k + down] + fx * (d[k + down + right] - d[k + down]);
        let inner = f64::from(top + fy * (low - top));
        let away2 = (x - cx) * (x - cx) + (y - cy) * (y - cy);
        if away2 == 0.0 { inner } else { (away2 + inner.max(0.0).powi(2)).sqrt() }
    }

    /// Area inside the outline, square pixels: each pixel counts by how far the outline covers it.
    pub fn area_px(&self) -> f64 {
        self.distance_px.iter().map(|d| (0.5 - f64::from(*d)).clamp(0.0, 1.0)).sum()
    }

    /// Length of the outline, pixels: how fast its area grows with the distance from it.
    pub fn length_px(&self) -> f64 {
        self.distance_px.iter().map(|d| (1.0 - f64::from(d.abs())).max(0.0)).sum()
    }

    /// Whether pixel (column, row) of the whole picture is inside.
    pub fn contains(&self, column: usize, row: usize) -> bool {
        let inside = |k: usize, x: usize| (self.origin[k]..self.origin[k] + self.size[k]).contains(&x);
        inside(0, column)
            && inside(1, row)
            && self.distance_px[(row - self.origin[1]) * self.size[0] + column - self.origin[0]] < 0.0
    }

    /// The outline as segments between points (column, row), one or two for each four neighbouring pixel centres that
    /// it passes between; those of one outline join end to end.
    pub fn segments(&self) -> Vec<[[f64; 2]; 2]> {
        let [w, h] = self.size;
        let d = &self.distance_px;
        let mut out = Vec::new();
        for y in 0..h.saturating_sub(1) {
            for x in 0..w.saturating_sub(1) {
                let k = y * w + x;
                let corners = [d[k], d[k + 1], d[k + w + 1], d[k + w]];
                if corners.iter().all(|c| (*c < 0.0) == (d[k] < 0.0)) {
                    continue;
                }
                let position = |[i, j]: [f32; 2]| {
                    [(self.origin[0] + x) as f64 + f64::from(i), (self.origin[1] + y) as f64 + f64::from(j)]
                };
                out.extend(distance::segments(corners).into_iter().flatten().map(|s| s.map(position)));
            }
        }
        out
    }

    /// For each row of the rectangle the least and greatest column of the outline (subpixel, in the whole
    /// picture), or `None` where the row is empty.
    pub fn extents_px(&self) -> Vec<Option<[f64; 2]>> {
        let w = self.size[0];
        (self.distance_px.chunks(w))
            .map(|row| {
                let first = row.iter().position(|d| *d < 0.0)?;
                let last = row.iter().rposition(|d| *d < 0.0)?;
                let at = |k: usize| f64::from(row[k]);
                let left =
                    if first == 0 { 0.0 } else { first as f64 - at(first) / (at(first) - at(first - 1)) };
                let right = if last + 1 == w {
                    last as f64
                } else {
                    last as f64 + at(last) / (at(last) - at(last + 1))
                };
                let o = self.origin[0] as f64;
                Some([o + left, o + right])
            })
            .collect()
    }
}

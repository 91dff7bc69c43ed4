//! Signed distance transform of an outline given by a field that is 0 on it, pixels.
//!
//! Near the outline each pixel measures its distance to the outline's segments (marching squares). Further
//! away the nearest crossing of the outline with a grid line is enough: crossings are at most √2 px apart, so
//! at 4 px the error is below 0.06 px and falls with the distance. Their distance transform is exact and
//! separable (Felzenszwalb & Huttenlocher, Theory of Computing 8, 2012) although they lie between pixels:
//! crossings on columns are swept along columns first, crossings on rows along rows.

use super::outline::Field;
use rayon::prelude::*;

/// Distance up to which segments are measured, pixels.
const NEAR: f32 = 4.0;

/// Signed distance (pixels) at each pixel of a field; negative where the field is. What lies outside the
/// field's rectangle counts as outside: an outline cut by its end closes half a pixel beyond it.
pub(super) fn signed(field: &Field) -> Vec<f32> {
    let padded = pad(field);
    let (w, h) = (field.width, field.height);
    let (near, far) = rayon::join(|| near(&padded, w, h), || far(&padded, w, h));
    let mut out = far;
    (out.par_iter_mut().zip(&near).zip(&field.values)).for_each(|((d, near), value)| {
        // Whichever is less: both are distances to points of the outline.
        let distance = d.min(*near);
        *d = if *value < 0.0 { -distance } else { distance };
    });
    out
}

/// The field with a ring around it that mirrors it: the outline closes half a pixel outside.
struct Padded {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

fn pad(field: &Field) -> Padded {
    let (w, h) = (field.width + 2, field.height + 2);
    let mut values = vec![0f32; w * h];
    for y in 0..h {
        let row = &field.values[y.saturating_sub(1).min(field.height - 1) * field.width..][..field.width];
        let out = &mut values[y * w..][..w];
        out[1..w - 1].copy_from_slice(row);
        out[0] = row[0].abs();
        out[w - 1] = row[field.width - 1].abs();
        if y == 0 || y + 1 == h {
            out.iter_mut().for_each(|v| *v = v.abs());
        }
    }
    Padded { width: w, height: h, values }
}

/// Where between two values of opposite sign the field is 0, 0 … 1.
fn crossing(a: f32, b: f32) -> Option<f32> {
    ((a < 0.0) != (b < 0.0)).then(|| (a / (a - b)).clamp(0.0, 1.0))
}

/// Distance to the outline's segments, where less than [`NEAR`]; infinite elsewhere.
fn near(padded: &Padded, w: usize, h: usize) -> Vec<f32> {
    let mut out = vec![f32::INFINITY; w * h];
    let lines = padded.values.chunks_exact(padded.width);
    for (y, (upper, lower)) in lines.clone().zip(lines.skip(1)).enumerate() {
        for (x, (upper, lower)) in upper.windows(2).zip(lower.windows(2)).enumerate() {
            let corners = [upper[0], upper[1], lower[1], lower[0]];
            let is_inside = corners[0] < 0.0;
            if corners.iter().all(|c| (*c < 0.0) == is_inside) {
                continue;
            }
            for [a, b] in segments(corners).into_iter().flatten() {
                // Padded coordinates are one more than the field's.
                let shift = |p: [f32; 2]| [x as f32 + p[0] - 1.0, y as f32 + p[1] - 1.0];
                measure(&mut out, w, h, shift(a), shift(b));
            }
        }
    }
    out
}

/// A segment in a cell's own coordinates, 0 … 1.
pub(super) type Segment = [[f32; 2]; 2];

/// The outline in one cell, by marching squares; corners in the order (0,0), (1,0), (1,1), (0,1).
pub(super) fn segments([a, b, c, d]: [f32; 4]) -> [Option<Segment>; 2] {
    let top = crossing(a, b).map(|t| [t, 0.0]);
    let right = crossing(b, c).map(|t| [1.0, t]);
    let bottom = crossing(d, c).map(|t| [t, 1.0]);
    let left = crossing(a, d).map(|t| [0.0, t]);
    if let (Some(t), Some(r), Some(low), Some(l)) = (top, right, bottom, left) {
        // A saddle: the mean decides which corners are joined.
        return if (a < 0.0) == (a + b + c + d < 0.0) {
            [Some([t, r]), Some([low, l])]
        } else {
            [Some([t, l]), Some([low, r])]
        };
    }
    let mut ends = [top, right, bottom, left].into_iter().flatten();
    [ends.next().zip(ends.next()).map(|(p, q)| [p, q]), None]
}

/// Lowers the distance of all pixels near a segment.
fn measure(out: &mut [f32], w: usize, h: usize, a: [f32; 2], b: [f32; 2]) {
    let range = |axis: usize, size: usize| {
        let (low, high) = (a[axis].min(b[axis]) - NEAR, a[axis].max(b[axis]) + NEAR);
        (low.ceil().max(0.0) as usize)..((high.floor() + 1.0).clamp(0.0, size as f32) as usize)
    };
    let along = [b[0] - a[0], b[1] - a[1]];
    let length2 = along[0] * along[0] + along[1] * along[1];
    let scale = if length2 > 0.0 { 1.0 / length2 } else { 0.0 };
    for y in range(1, h) {
        let py = y as f32 - a[1];
        for x in range(0, w) {
            let px = x as f32 - a[0];
            let t = ((px * along[0] + py * along[1]) * scale).clamp(0.0, 1.0);
            let (dx, dy) = (px - t * along[0], py - t * along[1]);
            let d = (dx * dx + dy * dy).sqrt();
            let o = &mut out[y * w + x];
            *o = if d <= NEAR { o.min(d) } else { *o };
        }
    }
}

/// Distance to the nearest crossing of the outline with a grid line.
fn far(padded: &Padded, w: usize, h: usize) -> Vec<f32> {
    // Crossings on columns: for each column the distance along it, then the envelope along rows.
    let on_columns = || {
        let upright = transposed(&padded.values, padded.width, padded.height);
        let mut rows = transposed(&swept(&upright, padded.height), h, w);
        rows.par_chunks_mut(w).for_each_init(Envelope::default, Envelope::lower);
        rows
    };
    let on_rows = || {
        let mut columns = transposed(&swept(&padded.values, padded.width), w, h);
        columns.par_chunks_mut(h).for_each_init(Envelope::default, Envelope::lower);
        transposed(&columns, h, w)
    };
    let (mut a, b) = rayon::join(on_columns, on_rows);
    a.par_iter_mut().zip(&b).for_each(|(a, b)| *a = a.min(*b).sqrt());
    a
}

/// Squared distances along each line but the first and the last of a padded field, whose lines are `padded` long.
fn swept(values: &[f32], padded: usize) -> Vec<f32> {
    let (lines, length) = (values.len() / padded - 2, padded - 2);
    let mut out = vec![0f32; lines * length];
    let inner = values[padded..].par_chunks_exact(padded);
    out.par_chunks_exact_mut(length).zip(inner).for_each(|(line, values)| sweep(line, values));
    out
}

/// Squared distance along a line to its nearest crossing; one between the line's padded positions k and k + 1 is at
/// −1 + k + t.
fn sweep(line: &mut [f32], padded: &[f32]) {
    let mut last = f32::NEG_INFINITY;
    for (k, (d, pair)) in line.iter_mut().zip(padded.windows(2)).enumerate() {
        if let Some(t) = crossing(pair[0], pair[1]) {
            last = k as f32 - 1.0 + t;
        }
        *d = k as f32 - last;
    }
    let mut next = f32::INFINITY;
    for (k, (d, pair)) in line.iter_mut().zip(padded[1..].windows(2)).enumerate().rev() {
        if let Some(t) = crossing(pair[0], pair[1]) {
            next = k as f32 + t;
        }
        *d = d.min(next - k as f32);
        *d *= *d;
    }
}

/// Rows become columns, in blocks that stay in the cache.
fn transposed(values: &[f32], width: usize, height: usize) -> Vec<f32> {
    const BLOCK: usize = 32;
    let mut out = vec![0f32; width * height];
    out.par_chunks_mut(height * BLOCK).enumerate().for_each(|(block, part)| {
        let x0 = block * BLOCK;
        let across = part.len() / height;
        let mut tile = [[0f32; BLOCK]; BLOCK];
        for y0 in (0..height).step_by(BLOCK) {
            let rows = values[y0 * width..].chunks(width);
            for (to, row) in tile.iter_mut().zip(rows) {
                to[..across].copy_from_slice(&row[x0..x0 + across]);
            }
            let down = BLOCK.min(height - y0);
            for (x, column) in part.chunks_exact_mut(height).enumerate() {
                column[y0..y0 + down].iter_mut().zip(&tile).for_each(|(to, row)| *to = row[x]);
            }
        }
    });
    out
}

/// The lower envelope of parabolas, with its working memory.
#[derive(Default)]
struct Envelope {
    heights: Vec<f32>,
    vertices: Vec<usize>,
    starts: Vec<f32>,
}

impl Envelope {
    /// Replaces each value by the least of `value[q] + (p − q)²` over all q.
    fn lower(&mut self, line: &mut [f32]) {
        self.heights.clear();
        self.heights.extend_from_slice(line);
        self.vertices.clear();
        self.starts.clear();
        for (q, &height) in self.heights.iter().enumerate() {
            if !height.is_finite() {
                continue;
            }
            let mut start = f32::NEG_INFINITY;
            while let Some(&v) = self.vertices.last() {
                let apart = (q - v) as f32;
                start = 0.5 * ((height - self.heights[v]) / apart + (q + v) as f32);
                if start > *self.starts.last().unwrap_or(&f32::NEG_INFINITY) {
                    break;
                }
                self.vertices.pop();
                self.starts.pop();
                start = f32::NEG_INFINITY;
            }
            self.vertices.push(q);
            self.starts.push(start);
        }
        let mut k = 0;
        for (p, value) in line.iter_mut().enumerate() {
            while k + 1 < self.vertices.len() && self.starts[k + 1] <= p as f32 {
                k += 1;
            }
            if let Some(&v) = self.vertices.get(k) {
                let apart = p as f32 - v as f32;
                *value = apart * apart + self.heights[v];
            }
        }
    }
}

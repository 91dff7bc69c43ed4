//! A small copy of the picture, on which the grain is sought: an 18-megapixel picture is read once, and
//! only in part, before the few percent of it that hold the grain are looked at closely.

use super::frame::Rect;
use super::{Channel, Picture};
use rayon::prelude::*;

/// The longer side of the small copy, cells, at most.
const LONGEST: usize = 600;
/// Rows read of each cell: more would cost bytes and tell nothing new.
const ROWS_READ: usize = 4;

/// Means of the colours over cells of `factor` by `factor` pixels.
pub(super) struct Reduced {
    /// Pixels per cell, a side.
    pub factor: usize,
    /// First column and row of the picture covered.
    pub origin: [usize; 2],
    /// Cells across.
    pub width: usize,
    /// Cells down.
    pub height: usize,
    /// For each colour, `[row, column]`.
    colours: Vec<Vec<f32>>,
}

impl Reduced {
    /// Cells a side of which `factor` pixels are taken together for a frame.
    pub(super) fn of(picture: &Picture, frame: &Rect) -> Self {
        let factor = frame.width().max(frame.height()).div_ceil(LONGEST);
        let (width, height) = (frame.width() / factor, frame.height() / factor);
        let channels = picture.channels();
        let step = (factor / ROWS_READ).max(1);
        let rows: Vec<Vec<u32>> = (0..height)
            .into_par_iter()
            .map(|j| {
                let mut sums = vec![0u32; width * channels];
                let top = frame.y0 + j * factor;
                for y in (top..top + factor).step_by(step) {
                    let row = picture.row(y, frame.x0, frame.x0 + width * factor);
                    for (cell, sum) in
                        row.chunks_exact(factor * channels).zip(sums.chunks_exact_mut(channels))
                    {
                        for pixel in cell.chunks_exact(channels) {
                            for (s, &v) in sum.iter_mut().zip(pixel) {
                                *s += u32::from(v);
                            }
                        }
                    }
                }
                sums
            })
            .collect();
        let scale = 1.0 / (factor * factor.div_ceil(step)) as f32;
        let colours = (0..channels)
            .map(|c| {
                rows.iter()
                    .flat_map(|row| row[c..].iter().step_by(channels))
                    .map(|&s| s as f32 * scale)
                    .collect()
            })
            .collect();
        Self { factor, origin: [frame.x0, frame.y0], width, height, colours }
    }

    /// One combination of the colours, grey levels.
    pub(super) fn channel(&self, channel: Channel) -> Vec<f32> {
        if let [grey] = &self.colours[..] {
            return grey.clone();
        }
        let [r, g, b] = channel.weights().map(|w| f32::from(w) / 16.0);
        let [red, green, blue] = [0, 1, 2].map(|c| &self.colours[c]);
        red.iter().zip(green).zip(blue).map(|((x, y), z)| r * x + g * y + b * z).collect()
    }

    /// Picture column or row (`axis` 0 or 1) of the middle of a cell.
    pub(super) fn position(&self, axis: usize, cell: usize) -> f64 {
        self.origin[axis] as f64 + (cell as f64 + 0.5) * self.factor as f64 - 0.5
    }

    /// Whether a cell lies in the ring along the left, top and right ends (never the bottom: the pedestal
    /// stands there).
    pub(super) fn in_ring(&self, i: usize, j: usize) -> bool {
        let depth = (self.width.min(self.height) / 20).max(2);
        i < depth || i + depth >= self.width || j < depth
    }
}

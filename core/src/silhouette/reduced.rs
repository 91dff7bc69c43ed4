//! A downsampled copy of the picture, on which the grain is sought: an 18-megapixel picture is read once, and
//! only in part, before the few percent of it that hold the grain are looked at closely.

use super::rect::Rect;
use super::{Channel, Grid, SilhouetteError, SmallCopy, Source};

/// Means of the colours over cells of `factor` by `factor` pixels.
pub(super) struct Reduced {
    grid: Grid,
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
    /// The small copy of a frame.
    pub(super) fn of(picture: &dyn Source, frame: &Rect) -> Result<Self, SilhouetteError> {
        let (columns, rows) = frame.ranges();
        Self::on(picture, &picture.grid(&columns, &rows))
    }

    /// The same cells of another picture.
    pub(super) fn alike(&self, picture: &dyn Source) -> Result<Self, SilhouetteError> {
        Self::on(picture, &self.grid)
    }

    fn on(picture: &dyn Source, grid: &Grid) -> Result<Self, SilhouetteError> {
        let Grid { factor, origin, size: [width, height] } = *grid;
        Ok(Self { grid: *grid, factor, origin, width, height, colours: picture.cells(grid)? })
    }

    /// Its brightness, to be kept.
    pub(super) fn small_copy(&self) -> SmallCopy {
        SmallCopy::of(self.grid, &self.channel(SmallCopy::CHANNEL))
    }

    /// For each colour, `[row, column]`.
    pub(super) fn colours(&self) -> &[Vec<f32>] {
        &self.colours
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
        let depth = self.depth();
        i < depth || i + depth >= self.width || j < depth
    }

    /// The cells in that ring, row by row.
    pub(super) fn ring(&self) -> impl Iterator<Item = usize> {
        let (w, depth) = (self.width, self.depth());
        (0..self.height).flat_map(move |j| {
            let left = if j < depth { w } else { depth.min(w) };
            let right = w.saturating_sub(depth).max(left);
            (0..left).chain(right..w).map(move |i| j * w + i)
        })
    }

    fn depth(&self) -> usize {
        (self.width.min(self.height) / 20).max(2)
    }
}

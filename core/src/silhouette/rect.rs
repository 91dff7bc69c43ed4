//! A rectangle of pixels.

use std::ops::Range;

/// A rectangle of pixels: columns `x0..x1`, rows `y0..y1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub x0: usize,
    pub y0: usize,
    pub x1: usize,
    pub y1: usize,
}

impl Rect {
    pub(super) fn width(&self) -> usize {
        self.x1 - self.x0
    }

    pub(super) fn height(&self) -> usize {
        self.y1 - self.y0
    }

    /// Grown by a margin on each side, within a limit.
    pub(super) fn grown(&self, by: usize, limit: &Self) -> Self {
        Self {
            x0: self.x0.saturating_sub(by).max(limit.x0),
            y0: self.y0.saturating_sub(by).max(limit.y0),
            x1: (self.x1 + by).min(limit.x1),
            y1: (self.y1 + by).min(limit.y1),
        }
    }

    /// The values of this rectangle out of those of a picture of this width.
    pub(super) fn part_of<T: Copy>(&self, values: &[T], width: usize) -> Vec<T> {
        let mut part = Vec::with_capacity(self.width() * self.height());
        (self.y0..self.y1).for_each(|y| part.extend_from_slice(&values[y * width..][self.x0..self.x1]));
        part
    }

    /// As columns and rows.
    pub(super) fn ranges(&self) -> (Range<usize>, Range<usize>) {
        (self.x0..self.x1, self.y0..self.y1)
    }
}

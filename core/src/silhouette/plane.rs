//! The background-subtracted region of interest at full resolution, `[row, column]`, sixteenths of a grey level.

use super::backdrop::Backdrop;
use super::otsu::Histogram;
use super::rect::Rect;
use super::{Channel, Source};
use rayon::prelude::*;

/// Units of a plane's values per grey level.
pub(super) const PER_LEVEL: f32 = 16.0;
/// Bins of the histogram that thresholds are read off.
const BINS: usize = 256;

/// Distance from the background towards the grain, sixteenths of a grey level: about 0 in the background,
/// positive in the grain, whichever of the two is the brighter one.
#[derive(Debug, Clone)]
pub(super) struct Plane {
    pub rect: Rect,
    pub width: usize,
    pub height: usize,
    pub values: Vec<i16>,
}

impl Plane {
    pub(super) fn of(
        picture: &dyn Source,
        rect: Rect,
        channel: Channel,
        backdrop: &Backdrop,
        bright_grain: bool,
    ) -> Self {
        let (width, height) = (rect.width(), rect.height());
        let sign = if bright_grain { 1i16 } else { -1 };
        let scale = PER_LEVEL * f32::from(sign);
        let (columns, rows) = rect.ranges();
        let mut values = picture.weighted(&columns, &rows, channel.weights().map(|w| w * sign));
        values.par_chunks_mut(width).enumerate().for_each_init(
            || vec![0f32; width],
            |levels, (j, out)| {
                backdrop.row(rect.y0 + j, rect.x0, levels);
                out.iter_mut().zip(&*levels).for_each(|(o, level)| *o -= (scale * level) as i16);
            },
        );
        Self { rect, width, height, values }
    }

    /// A part, by its own columns and rows.
    pub(super) fn part(&self, part: &Rect) -> Self {
        let Rect { x0, y0, .. } = self.rect;
        let rect = Rect { x0: x0 + part.x0, y0: y0 + part.y0, x1: x0 + part.x1, y1: y0 + part.y1 };
        let values = part.part_of(&self.values, self.width);
        Self { rect, width: part.width(), height: part.height(), values }
    }

    /// Forgets the rows after so many.
    pub(super) fn keep_rows(&mut self, rows: usize) {
        self.height = self.height.min(rows);
        self.rect.y1 = self.rect.y0 + self.height;
        self.values.truncate(self.width * self.height);
    }

    /// Histogram of the values, grey levels, over the range they really take.
    pub(super) fn histogram(&self) -> Histogram {
        let mut counts = vec![0u64; 1 << 16];
        for &v in &self.values {
            counts[(i32::from(v) + (1 << 15)) as usize] += 1;
        }
        let few = self.values.len() as u64 / 20_000;
        let mut sum = 0;
        let mut full = |count: &u64| {
            sum += count;
            sum > few
        };
        let first = counts.iter().position(&mut full).unwrap_or(0);
        sum = 0;
        let last = counts.iter().rposition(|count| {
            sum += count;
            sum > few
        });
        let last = last.unwrap_or(counts.len() - 1);
        let per_bin = (last + 1 - first).div_ceil(BINS).max(1);
        let mut coarse = vec![0u64; BINS];
        for (k, &count) in counts.iter().enumerate() {
            coarse[(k.saturating_sub(first) / per_bin).min(BINS - 1)] += count;
        }
        let level = |k: usize| (k as f64 - f64::from(1 << 15) - 0.5) / f64::from(PER_LEVEL);
        Histogram::from_counts(level(first), per_bin as f64 / f64::from(PER_LEVEL), coarse)
    }

    /// Binomial means of 3×3 pixels: noise goes, and a circle of 200 px shrinks by 0.001 px.
    pub(super) fn smoothed(&self) -> Vec<i16> {
        let (w, h) = (self.width, self.height);
        let row = |y: usize| &self.values[y * w..(y + 1) * w];
        let mut out = vec![0i16; w * h];
        out.par_chunks_mut(w).enumerate().for_each_init(
            || vec![0i32; w + 2],
            |down, (y, out)| {
                let rows = row(y.saturating_sub(1)).iter().zip(row(y)).zip(row((y + 1).min(h - 1)));
                for (sum, ((&a, &b), &c)) in down[1..=w].iter_mut().zip(rows) {
                    *sum = i32::from(a) + 2 * i32::from(b) + i32::from(c);
                }
                // The last one on each side once more beyond it.
                (down[0], down[w + 1]) = (down[1], down[w]);
                for (o, d) in out.iter_mut().zip(down.windows(3)) {
                    *o = ((d[0] + 2 * d[1] + d[2] + 8) >> 4) as i16;
                }
            },
        );
        out
    }

    /// Value at a pixel, grey levels.
    pub(super) fn at(&self, x: usize, y: usize) -> f32 {
        f32::from(self.values[y * self.width + x]) / PER_LEVEL
    }
}

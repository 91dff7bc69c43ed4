//! The region that holds the grain, at full resolution: how far each pixel is from the background.

use super::backdrop::Backdrop;
use super::frame::Rect;
use super::otsu::Histogram;
use super::{Channel, Picture};
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
        picture: &Picture,
        rect: Rect,
        channel: Channel,
        backdrop: &Backdrop,
        bright_grain: bool,
    ) -> Self {
        let (width, height) = (rect.width(), rect.height());
        let mut values = vec![0i16; width * height];
        let sign = if bright_grain { 1i16 } else { -1 };
        let weights = channel.weights().map(|w| w * sign);
        let scale = PER_LEVEL * f32::from(sign);
        values.par_chunks_mut(width).enumerate().for_each_init(
            || vec![0f32; width],
            |levels, (j, out)| {
                let y = rect.y0 + j;
                backdrop.row(y, rect.x0, levels);
                let row = picture.row(y, rect.x0, rect.x1);
                if picture.channels() == 1 {
                    let grey = 16 * sign;
                    for ((o, &v), level) in out.iter_mut().zip(row).zip(&*levels) {
                        *o = grey * i16::from(v) - (scale * level) as i16;
                    }
                } else {
                    let [r, g, b] = weights;
                    for ((o, p), level) in out.iter_mut().zip(row.chunks_exact(3)).zip(&*levels) {
                        let v = r * i16::from(p[0]) + g * i16::from(p[1]) + b * i16::from(p[2]);
                        *o = v - (scale * level) as i16;
                    }
                }
            },
        );
        Self { rect, width, height, values }
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
            || vec![0i32; w],
            |down, (y, out)| {
                let rows = row(y.saturating_sub(1)).iter().zip(row(y)).zip(row((y + 1).min(h - 1)));
                for (sum, ((&a, &b), &c)) in down.iter_mut().zip(rows) {
                    *sum = i32::from(a) + 2 * i32::from(b) + i32::from(c);
                }
                for (x, o) in out.iter_mut().enumerate() {
                    let sum = down[x.saturating_sub(1)] + 2 * down[x] + down[(x + 1).min(w - 1)];
                    *o = ((sum + 8) >> 4) as i16;
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

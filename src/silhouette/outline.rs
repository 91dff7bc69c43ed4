//! The outline between pixels: where the grey value is half-way between the grain and the background
//! beside it.
//!
//! A single threshold is biased wherever the grain is shaded or the background uneven: with blur, a level
//! off the middle by a tenth of the contrast moves the outline by about a quarter of the blur's width.

use super::mask::{Connect, Mask};
use super::plane::{PER_LEVEL, Plane};
use rayon::prelude::*;

/// Pixels on both sides of the mask's edge within which the outline is placed.
pub(super) const BAND: usize = 3;
/// Half the side of the window over which grain and background are averaged, pixels.
const WINDOW: usize = 7;
/// Least number of pixels an average is believed from.
const LEAST_SAMPLES: u32 = 6;
/// An island or opening within the band smaller than this, square pixels, is noise.
const SPECK_PX: usize = 12;

/// A field that is 0 on the outline, −1 well inside, +1 well outside, and linear in the grey value between.
#[derive(Debug, Clone)]
pub(super) struct Field {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

/// Which pixels belong to what, before the outline is placed between them.
pub(super) struct Parts<'a> {
    /// The grain together with what it stands on.
    pub body: &'a Mask,
    /// All that is not background, specks included: no background level is read there.
    pub occupied: &'a Mask,
    /// Where no grain level is read: the pedestal.
    pub excluded: &'a (dyn Fn(usize, usize) -> bool + Sync),
    /// Threshold of the mask, grey levels.
    pub threshold: f64,
    /// Least level of an outline, grey levels: below it the background's noise would be outlined.
    pub least_level: f64,
}

/// Places the outline.
pub(super) fn place(plane: &Plane, parts: &Parts) -> Field {
    let (w, h) = (plane.width, plane.height);
    let inner = parts.body.eroded(BAND);
    let outer = parts.body.dilated(BAND);
    let taken = parts.occupied.dilated(BAND);
    let mut values = vec![0f32; w * h];
    values.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
        for (x, value) in out.iter_mut().enumerate() {
            let k = y * w + x;
            let body = parts.body.bits[k] != 0;
            *value = if inner.bits[k] == outer.bits[k] {
                if body { -1.0 } else { 1.0 }
            } else {
                in_band(plane, parts, &inner, &taken, x, y)
            };
        }
    });
    let mut field = Field { width: w, height: h, values };
    field.settle();
    field
}

fn in_band(plane: &Plane, parts: &Parts, inner: &Mask, taken: &Mask, x: usize, y: usize) -> f32 {
    let w = plane.width;
    let (mut inside, mut n_inside, mut outside, mut n_outside) = (0i64, 0u32, 0i64, 0u32);
    let columns = x.saturating_sub(WINDOW)..(x + WINDOW + 1).min(w);
    for j in y.saturating_sub(WINDOW)..(y + WINDOW + 1).min(plane.height) {
        for i in columns.clone() {
            let k = j * w + i;
            let value = i64::from(plane.values[k]);
            if inner.bits[k] != 0 {
                if !(parts.excluded)(i, j) {
                    inside += value;
                    n_inside += 1;
                }
            } else if taken.bits[k] == 0 {
                outside += value;
                n_outside += 1;
            }
        }
    }
    let value = smooth(plane, x, y);
    let background =
        if n_outside >= LEAST_SAMPLES { outside as f32 / n_outside as f32 / PER_LEVEL } else { 0.0 };
    let grain = if n_inside >= LEAST_SAMPLES {
        inside as f32 / n_inside as f32 / PER_LEVEL
    } else {
        // A part thinner than its blur: its brightest ridge stands for it.
        ridge(plane, x, y)
    };
    let threshold = parts.threshold as f32;
    let contrast = grain - background;
    if contrast < 0.5 * threshold {
        // No grain to read beside this pixel: the threshold decides.
        return ((threshold - value) / threshold.max(1.0)).clamp(-1.0, 1.0);
    }
    let level = (0.5 * (grain + background)).max(parts.least_level as f32);
    ((level - value) / (0.5 * contrast)).clamp(-1.0, 1.0)
}

/// Binomial mean of 3×3 pixels, grey levels: noise goes, and a circle of 200 px shrinks by 0.001 px.
fn smooth(plane: &Plane, x: usize, y: usize) -> f32 {
    let (w, h) = (plane.width, plane.height);
    let rows = [y.saturating_sub(1), y, (y + 1).min(h - 1)];
    let columns = [x.saturating_sub(1), x, (x + 1).min(w - 1)];
    let across = |row: usize| {
        let [a, b, c] = columns.map(|i| i32::from(plane.values[row * w + i]));
        a + 2 * b + c
    };
    let [a, b, c] = rows.map(across);
    (a + 2 * b + c) as f32 / (16.0 * PER_LEVEL)
}

/// Greatest smoothed value near a pixel, grey levels.
fn ridge(plane: &Plane, x: usize, y: usize) -> f32 {
    let mut greatest = f32::NEG_INFINITY;
    for j in y.saturating_sub(2)..(y + 3).min(plane.height) {
        for i in x.saturating_sub(2)..(x + 3).min(plane.width) {
            greatest = greatest.max(smooth(plane, i, j));
        }
    }
    greatest
}

impl Field {
    /// Whether each pixel is inside.
    pub(super) fn inside(&self) -> Mask {
        Mask {
            width: self.width,
            height: self.height,
            bits: self.values.iter().map(|v| u8::from(*v < 0.0)).collect(),
        }
    }

    /// Takes out islands and openings that noise made within the band.
    fn settle(&mut self) {
        for turn in [-1.0f32, 1.0] {
            let mut mask = self.inside();
            if turn > 0.0 {
                mask = mask.complement();
            }
            let (runs, components) = mask.components(Connect::Sides);
            for run in runs.iter().filter(|run| components[run.component].area < SPECK_PX) {
                for v in &mut self.values[run.row * self.width + run.start..run.row * self.width + run.end] {
                    *v = -*v;
                }
            }
        }
    }

    /// Keeps only the largest island.
    pub(super) fn keep_largest(&mut self) {
        let inside = self.inside();
        let keep = inside.largest();
        for ((v, i), k) in self.values.iter_mut().zip(&inside.bits).zip(&keep.bits) {
            if i != k {
                *v = v.abs().max(1e-3);
            }
        }
    }

    /// Cuts away what lies below a line: `below` gives the distance (pixels) below it, `None` where it does
    /// not reach.
    pub(super) fn cut(&mut self, below: impl Fn(f64, f64) -> Option<f64>) {
        for y in 0..self.height {
            for x in 0..self.width {
                if let Some(d) = below(x as f64, y as f64)
                    && d > -1.0
                {
                    let v = &mut self.values[y * self.width + x];
                    *v = v.max(d.min(1.0) as f32);
                }
            }
        }
    }
}

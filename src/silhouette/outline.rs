//! The outline between pixels: where the grey value is half-way between the grain and the background
//! beside it.
//!
//! A single threshold is biased wherever the grain is shaded or the background uneven: with blur, a level
//! off the middle by a tenth of the contrast moves the outline by about a quarter of the blur's width.

use super::mask::{Connect, Mask};
use super::plane::{PER_LEVEL, Plane};
use rayon::prelude::*;

/// Pixels on both sides of the mask's edge within which the outline is placed, in a picture that is in focus.
pub(super) const BAND: usize = 3;
/// The widest band: a picture that needs more shows no outline.
pub(super) const WIDEST: usize = 16;
/// Pixels of each that are read, the nearest ones: enough against noise, few enough that a lit part does not
/// set the level of a shaded one beside it.
const SAMPLES: u32 = 12;
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
    /// Pixels on both sides of the body's edge within which the outline is placed.
    pub band: usize,
    /// The plane's smoothed values.
    pub smooth: &'a [i16],
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
    let inner = parts.body.eroded(parts.band);
    let outer = parts.body.dilated(parts.band);
    let taken = parts.occupied.dilated(parts.band);
    // The nearest pixel beyond the band is at most its width and a little more away, on either side.
    let rings = rings(2 * parts.band + 1);
    let mut values = vec![0f32; w * h];
    values.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
        for (x, value) in out.iter_mut().enumerate() {
            let k = y * w + x;
            let body = parts.body.bits[k] != 0;
            *value = if inner.bits[k] == outer.bits[k] {
                if body { -1.0 } else { 1.0 }
            } else {
                in_band(plane, parts, &inner, &taken, &rings, [x, y])
            };
        }
    });
    let mut field = Field { width: w, height: h, values };
    field.settle();
    field
}

/// Places of equal distance from a pixel, as columns and rows away from it.
type Ring = Vec<(isize, isize)>;

/// The places of the window, nearest first.
fn rings(reach: usize) -> Vec<Ring> {
    let side = reach as isize;
    let mut by_distance = std::collections::BTreeMap::<isize, Ring>::new();
    for dy in -side..=side {
        for dx in -side..=side {
            by_distance.entry(dx * dx + dy * dy).or_default().push((dx, dy));
        }
    }
    by_distance.into_values().collect()
}

fn in_band(
    plane: &Plane,
    parts: &Parts,
    inner: &Mask,
    taken: &Mask,
    rings: &[Ring],
    [x, y]: [usize; 2],
) -> f32 {
    let w = plane.width;
    let (mut inside, mut n_inside, mut outside, mut n_outside) = (0i64, 0u32, 0i64, 0u32);
    for ring in rings {
        // The nearest ones are enough: further along the outline the grain may be lit otherwise.
        let (seek_inside, seek_outside) = (n_inside < SAMPLES, n_outside < SAMPLES);
        if !seek_inside && !seek_outside {
            break;
        }
        for &(dx, dy) in ring {
            let (Some(i), Some(j)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else { continue };
            if i >= w || j >= plane.height {
                continue;
            }
            let k = j * w + i;
            let value = i64::from(plane.values[k]);
            if inner.bits[k] != 0 {
                if seek_inside && !(parts.excluded)(i, j) {
                    inside += value;
                    n_inside += 1;
                }
            } else if seek_outside && taken.bits[k] == 0 {
                outside += value;
                n_outside += 1;
            }
        }
    }
    let value = level(parts.smooth[y * w + x]);
    let background =
        if n_outside >= LEAST_SAMPLES { outside as f32 / n_outside as f32 / PER_LEVEL } else { 0.0 };
    let grain = if n_inside >= LEAST_SAMPLES {
        inside as f32 / n_inside as f32 / PER_LEVEL
    } else {
        // A part thinner than its blur: its brightest ridge stands for it.
        ridge(plane, parts.smooth, x, y)
    };
    let threshold = parts.threshold as f32;
    let contrast = grain - background;
    if contrast < 0.5 * threshold {
        // No grain to read beside this pixel: the threshold decides.
        return ((threshold - value) / threshold.max(1.0)).clamp(-1.0, 1.0);
    }
    let halfway = (0.5 * (grain + background)).max(parts.least_level as f32);
    ((halfway - value) / (0.5 * contrast)).clamp(-1.0, 1.0)
}

/// Grey levels of a plane's value.
fn level(value: i16) -> f32 {
    f32::from(value) / PER_LEVEL
}

/// Greatest smoothed value near a pixel, grey levels.
fn ridge(plane: &Plane, smooth: &[i16], x: usize, y: usize) -> f32 {
    let mut greatest = f32::NEG_INFINITY;
    for j in y.saturating_sub(2)..(y + 3).min(plane.height) {
        for i in x.saturating_sub(2)..(x + 3).min(plane.width) {
            greatest = greatest.max(level(smooth[j * plane.width + i]));
        }
    }
    greatest
}

impl Field {
    /// Standard deviation of the edge's blur, pixels: half-way ± half of a half, a normal distribution's
    /// quartiles, lie 1.35 of them apart.
    pub(super) fn blur(&self, edge_length: f64) -> f64 {
        let between = self.values.iter().filter(|v| v.abs() < 0.5).count();
        between as f64 / (1.35 * edge_length.max(1.0))
    }

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

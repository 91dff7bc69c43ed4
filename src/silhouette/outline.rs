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
/// How far from a body, pixels, anything matters to its outline within a band: what is occupied at a distance of the
/// band keeps a place from being read that is near enough to a pixel of the band.
pub(super) fn reach(band: usize) -> usize {
    band + near_reach(band) + band
}

/// How far from a pixel of the band its levels are read: the nearest pixel beyond the band is at most the band's width
/// and a little more away, on either side.
fn near_reach(band: usize) -> usize {
    2 * band + 1
}

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
    let read = readable(plane, parts, &inner, &taken);
    let near = Near::new(parts.band, w);
    // Beside a pedestal no grain is near: nothing of it need be sought there.
    let grain = Mask { bits: read.iter().map(|r| u8::from(r >> GRAIN_SHIFT != 0)).collect(), ..*parts.body };
    let grain_near = grain.dilated(near.reach);
    let mut values = vec![0f32; w * h];
    values.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
        for (x, value) in out.iter_mut().enumerate() {
            let k = y * w + x;
            *value = if inner.bits[k] == outer.bits[k] {
                if parts.body.bits[k] != 0 { -1.0 } else { 1.0 }
            } else {
                in_band(plane, parts, &read, (&near, grain_near.bits[k] != 0), [x, y])
            };
        }
    });
    let mut field = Field { width: w, height: h, values };
    field.settle();
    field
}

/// What is read at each pixel, such that sums of a few can be read off too: the lower half is of the background, the
/// upper half of the grain; in each the lowest 24 bits are the value, from the least one on, the others count it.
fn readable(plane: &Plane, parts: &Parts, inner: &Mask, taken: &Mask) -> Vec<u64> {
    let w = inner.width;
    let mut read = vec![0u64; inner.bits.len()];
    read.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
        let masks = inner.bits[y * w..].iter().zip(&taken.bits[y * w..]);
        let row = masks.zip(&plane.values[y * w..]).zip(out).enumerate();
        for (x, (((&inner, &taken), &value), out)) in row {
            let one = 1 << COUNT_SHIFT | u64::from(value.abs_diff(i16::MIN));
            if inner == 0 {
                *out = if taken == 0 { one } else { 0 };
            } else if !(parts.excluded)(x, y) {
                *out = one << GRAIN_SHIFT;
            }
        }
    });
    read
}

/// Where the count of values stands in their sum …
const COUNT_SHIFT: u32 = 24;
/// … and the grain's sum beside the background's.
const GRAIN_SHIFT: u32 = 32;

/// Number and mean (grey levels) of the values in a sum; the mean of none is of no use.
fn mean(sum: u64) -> (u32, f32) {
    let count = (sum >> COUNT_SHIFT & 0xff) as u32;
    let total = (sum & ((1 << COUNT_SHIFT) - 1)) as i64 + i64::from(i16::MIN) * i64::from(count);
    (count, total as f32 / count as f32 / PER_LEVEL)
}

/// The places about a pixel, nearest first.
struct Near {
    reach: usize,
    /// Columns and rows away.
    places: Vec<[isize; 2]>,
    /// The same in a row-major picture.
    away: Vec<isize>,
    /// Where the places of each distance end.
    rings: Vec<usize>,
}

impl Near {
    /// In a picture of this width.
    fn new(band: usize, width: usize) -> Self {
        let reach = near_reach(band);
        let side = reach as isize;
        let mut by_distance = std::collections::BTreeMap::<isize, Vec<[isize; 2]>>::new();
        for dy in -side..=side {
            for dx in -side..=side {
                by_distance.entry(dx * dx + dy * dy).or_default().push([dx, dy]);
            }
        }
        let (mut places, mut rings) = (Vec::new(), Vec::new());
        for ring in by_distance.into_values() {
            places.extend(ring);
            rings.push(places.len());
        }
        let away = places.iter().map(|[dx, dy]| dy * width as isize + dx).collect();
        Self { reach, places, away, rings }
    }
}

/// Rings taken together while nothing is decided within them: no more than 200 places, which the counts can hold.
const RINGS: usize = 6;

/// The sum of what is read about a pixel, ring by ring, until there is enough of it; `at` tells what is read at a place
/// by its number.
#[inline]
fn gather(near: &Near, grain_near: bool, at: impl Fn(usize) -> u64) -> u64 {
    let background = u64::from(u32::MAX);
    let grain = if grain_near { background << GRAIN_SHIFT } else { 0 };
    let (mut sum, mut sought, mut start) = (0u64, background | grain, 0);
    for rings in near.rings.chunks(RINGS) {
        let end = rings[rings.len() - 1];
        let all = (start..end).fold(sum, |sum, place| sum + (at(place) & sought));
        if still(all, background, grain) == sought {
            (sum, start) = (all, end);
            continue;
        }
        for &end in rings {
            sum = (start..end).fold(sum, |sum, place| sum + (at(place) & sought));
            start = end;
            // The nearest ones are enough: further along the outline the grain may be lit otherwise.
            sought = still(sum, background, grain);
            if sought == 0 {
                return sum;
            }
        }
    }
    sum
}

/// The halves of a sum that lack values.
#[inline]
fn still(sum: u64, background: u64, grain: u64) -> u64 {
    let lacks = |half: u64| half >> COUNT_SHIFT & 0xff < SAMPLES.into();
    (if lacks(sum) { background } else { 0 }) | (if lacks(sum >> GRAIN_SHIFT) { grain } else { 0 })
}

fn in_band(
    plane: &Plane,
    parts: &Parts,
    read: &[u64],
    (near, grain_near): (&Near, bool),
    [x, y]: [usize; 2],
) -> f32 {
    let (w, h) = (plane.width, plane.height);
    let k = y * w + x;
    let clear = |at: usize, size: usize| (near.reach..size.saturating_sub(near.reach)).contains(&at);
    let sum = if clear(x, w) && clear(y, h) {
        gather(near, grain_near, |place| read[k.wrapping_add_signed(near.away[place])])
    } else {
        gather(near, grain_near, |place| {
            let [dx, dy] = near.places[place];
            match (x.checked_add_signed(dx), y.checked_add_signed(dy)) {
                (Some(i), Some(j)) if i < w && j < h => read[j * w + i],
                _ => 0,
            }
        })
    };
    let (n_outside, outside) = mean(sum);
    let (n_inside, inside) = mean(sum >> GRAIN_SHIFT);
    let value = level(parts.smooth[k]);
    let background = if n_outside >= LEAST_SAMPLES { outside } else { 0.0 };
    let grain = if n_inside >= LEAST_SAMPLES {
        inside
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

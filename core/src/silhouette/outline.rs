//! Subpixel outline: where the grey value is half-way between the grain and the background
//! beside it.
//!
//! A single threshold is biased wherever the grain is shaded or the background uneven: with blur, a level
//! off the middle by a tenth of the contrast moves the outline by about a quarter of the blur's width.
//!
//! ```text
//! f = (½(g + b) − v) / (½(g − b)),  held to −1 … 1;   the outline is f = 0
//! ```
//!
//! v is the smoothed value at a pixel, g the grain's level at the edge beside it and b the background's.

use super::mask::{Connect, Mask};
use super::plane::{PER_LEVEL, Plane};
use rayon::prelude::*;

/// Pixels on both sides of the mask's edge within which the outline is placed, in a picture that is in focus.
pub(super) const BAND: usize = 3;
/// The blur of such a picture after smoothing, pixels.
pub(super) const IN_FOCUS: f64 = 1.0;
/// What the mean over 3×3 pixels adds to the blur, in squares, pixels.
pub(super) const SMOOTHED_PX: f64 = 0.816_496_580_927_726;
/// The widest band: a picture that needs more shows no outline.
pub(super) const WIDEST: usize = 16;
/// How far from a body, pixels, anything matters to its outline within a band: where background is read, and what is
/// occupied within the band's width of that pixel.
pub(super) fn reach(band: usize) -> usize {
    deepest(band) + 2 * band
}

/// How far from the edge the grain is read.
fn deepest(band: usize) -> usize {
    band + DEEPER
}

/// Grain pixels are read up to this many pixels beyond the band, and background pixels, the nearest ones, up to this
/// many: enough against noise, few enough that a lit part does not set the level of a shaded one beside it.
const DEEPER: usize = 5;
const SAMPLES: u32 = 12;
/// Least number of pixels an average is believed from, and a change of the level towards the outline.
const LEAST_SAMPLES: u32 = 6;
const LEAST_SLOPED: f64 = 16.0;
/// A level seldom changes towards the outline by more than this share of itself per root of a pixel.
const STEEP: f64 = 0.06;
/// Light of a body that ends in a limb reaches an edge blurred by σ from about this many σ inside:
/// E(√|z|)² of a normal variable, 2^½ Γ(3/4)²/π.
const FROM_INSIDE: f64 = 0.676;
/// An island or opening within the band smaller than this, square pixels, is noise.
const SPECK_PX: usize = 12;

/// A field that is 0 on the outline, −1 well inside, +1 well outside, and linear in the grey value between.
#[derive(Debug, Clone)]
pub(super) struct Field {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

/// Masks, levels and band from which the outline is placed between pixels.
pub(super) struct OutlineInput<'a> {
    /// Pixels on both sides of the body's edge within which the outline is placed.
    pub band: usize,
    /// Standard deviation of the edge's blur in the smoothed values, pixels.
    pub blur: f64,
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
    /// How often the square root is drawn of levels beside the edge before they are averaged: the oftener, the less a highlight
    /// weighs beside a dim rim.
    pub roots: u32,
}

/// Places the outline.
pub(super) fn place(plane: &Plane, parts: &OutlineInput) -> Field {
    let (w, h) = (plane.width, plane.height);
    let inner = parts.body.eroded(parts.band);
    let outer = parts.body.dilated(parts.band);
    let occupied = parts.occupied.dilated(parts.band);
    let levels = Levels::read(plane, parts, &inner, &outer, &occupied);
    let mut values = vec![0f32; w * h];
    values.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
        for (x, value) in out.iter_mut().enumerate() {
            let k = y * w + x;
            let body = parts.body.bits[k] != 0;
            *value = if inner.bits[k] == outer.bits[k] {
                if body { -1.0 } else { 1.0 }
            } else {
                in_band(plane, parts, &levels, [x, y])
            };
        }
    });
    let mut field = Field { width: w, height: h, values };
    field.settle();
    field
}

/// The levels on both sides of the outline, at every pixel of the band; each with its weight.
struct Levels {
    /// Sum of weighted levels, and of weights.
    grain: Vec<[f32; 2]>,
    background: Vec<[f32; 2]>,
}

/// The offsets of the pixels within a radius, nearest first.
struct Neighbourhood {
    reach: usize,
    /// Width and height of the plane.
    size: [usize; 2],
    /// Columns and rows away from the pixel, the same row-major, and the distance squared.
    list: Vec<([isize; 2], isize, usize)>,
}

impl Neighbourhood {
    fn new(reach: usize, plane: &Plane) -> Self {
        let size = [plane.width, plane.height];
        let side = reach as isize;
        let mut list: Vec<_> = (-side..=side)
            .flat_map(|dy| (-side..=side).map(move |dx| [dx, dy]))
            .map(|[dx, dy]| ([dx, dy], dy * size[0] as isize + dx, (dx * dx + dy * dy) as usize))
            .filter(|p| p.2 <= reach * reach)
            .collect();
        list.sort_by_key(|p| p.2);
        Self { reach, size, list }
    }

    /// Those about a pixel that lie in the plane: their numbers, row-major, and the distances squared.
    fn about(&self, [x, y]: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
        let [w, h] = self.size;
        let far = |at: usize, size: usize| at >= self.reach && at + self.reach < size;
        let clear = far(x, w) && far(y, h);
        self.list.iter().filter_map(move |([dx, dy], away, distance2)| {
            let within = || {
                let (i, j) = (x.checked_add_signed(*dx)?, y.checked_add_signed(*dy)?);
                (i < w && j < h).then_some(())
            };
            (clear || within().is_some()).then(|| ((y * w + x).wrapping_add_signed(*away), *distance2))
        })
    }
}

impl Levels {
    /// Reads them at the body's outermost pixels and hands them to the band around each.
    fn read(plane: &Plane, parts: &OutlineInput, inner: &Mask, outer: &Mask, occupied: &Mask) -> Self {
        let (w, h) = (plane.width, plane.height);
        let edge = edge(parts.body);
        let reach = deepest(parts.band);
        let near = Neighbourhood::new(reach + parts.band, plane);
        // How deep each grain pixel lies below the edge: by how much less than the reach, squares, and one.
        let mut less2 = vec![0u16; w * h];
        let disc = Neighbourhood::new(reach, plane);
        for &pixel in &edge {
            for (k, distance2) in disc.about(pixel) {
                if inner.bits[k] != 0 {
                    less2[k] = less2[k].max((reach * reach + 1 - distance2) as u16);
                }
            }
        }
        let depths2 = (0..reach * reach + 2).map(|less| (reach * reach + 1 - less) as f64);
        let roots: Vec<f64> = depths2.map(|d| (d.sqrt() + 0.5).sqrt()).collect();
        let read: Vec<[Option<f32>; 2]> = (edge.par_iter())
            .map(|&pixel| {
                let mut grain = Limb::default();
                let (mut sum, mut n) = (0_i64, 0_u32);
                for (k, distance2) in near.about(pixel) {
                    let deep = distance2 <= reach * reach;
                    if !deep && n >= SAMPLES {
                        break;
                    }
                    if inner.bits[k] != 0 {
                        if deep && !(parts.excluded)(k % w, k / w) {
                            let seen = f64::from(level(plane.values[k]));
                            let weighed = (0..parts.roots).fold(seen.abs(), |v, _| v.sqrt()) * seen.signum();
                            grain.add(roots[usize::from(less2[k])], weighed);
                        }
                    } else if n < SAMPLES && occupied.bits[k] == 0 {
                        sum += i64::from(plane.values[k]);
                        n += 1;
                    }
                }
                let background = (n >= LEAST_SAMPLES).then(|| sum as f32 / n as f32 / PER_LEVEL);
                let weighed = grain.level(parts.blur);
                let grain =
                    weighed.map(|v| (v.signum() * (0..parts.roots).fold(v.abs(), |v, _| v * v)) as f32);
                [grain, background]
            })
            .collect();
        let mut out = Self { grain: vec![[0.0; 2]; w * h], background: vec![[0.0; 2]; w * h] };
        let around = Neighbourhood::new(parts.band + 2, plane);
        for (&pixel, [grain, background]) in edge.iter().zip(&read) {
            for (k, distance2) in around.about(pixel) {
                if inner.bits[k] == outer.bits[k] {
                    continue;
                }
                let weight = 1.0 / (0.5 + distance2 as f32);
                for (sums, level) in [(&mut out.grain, grain), (&mut out.background, background)] {
                    if let Some(level) = level {
                        sums[k][0] += weight * level;
                        sums[k][1] += weight;
                    }
                }
            }
        }
        out
    }
}

/// The body's pixels that have a neighbour outside it, row by row.
fn edge(body: &Mask) -> Vec<[usize; 2]> {
    let (w, h) = (body.width, body.height);
    let row = |y: usize| &body.bits[y * w..][..w];
    let mut found = Vec::new();
    let mut open = vec![0u8; w];
    for y in 0..h {
        let (above, here, below) = (row(y.saturating_sub(1)), row(y), row((y + 1).min(h - 1)));
        for (((open, a), b), c) in open.iter_mut().zip(above).zip(here).zip(below) {
            *open = b & (1 - (a & c));
        }
        for ((open, a), b) in open[1..].iter_mut().zip(here).zip(&here[1..]) {
            *open |= b & (1 - a);
        }
        for ((open, b), c) in open.iter_mut().zip(here).zip(&here[1..]) {
            *open |= b & (1 - c);
        }
        found.extend(memchr::memchr_iter(1, &open).map(|x| [x, y]));
    }
    found
}

/// A straight line through the grain's level over the root of the depth below its outline.
///
/// Near the limb of a smooth body the part of its normal that faces the camera, and with it the brightness in any
/// light, changes with the root of the distance from the outline: the level that the edge itself has is not that of
/// the pixels a few pixels inside.
#[derive(Default)]
struct Limb {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Limb {
    fn add(&mut self, root: f64, level: f64) {
        self.n += 1.0;
        self.x += root;
        self.y += level;
        self.xx += root * root;
        self.xy += root * level;
        self.yy += level * level;
    }

    /// The level at an edge of this blur; `None` where too little of the grain is seen. The line's slope is drawn
    /// towards 0 as far as what lies about the line makes it unsure.
    fn level(&self, blur: f64) -> Option<f64> {
        let root = (FROM_INSIDE * blur).sqrt();
        if self.n < f64::from(LEAST_SAMPLES) {
            return None;
        }
        let (mx, my) = (self.x / self.n, self.y / self.n);
        let (xx, xy, yy) =
            (self.xx - self.n * mx * mx, self.xy - self.n * mx * my, self.yy - self.n * my * my);
        if self.n < LEAST_SLOPED || xx <= 0.0 {
            return Some(my);
        }
        let rest = ((yy - xy * xy / xx) / (self.n - 2.0)).max(0.0);
        let slope = xy / (xx + rest / (STEEP * my).powi(2).max(1e-6));
        Some(my + slope * (root - mx))
    }
}

fn in_band(plane: &Plane, parts: &OutlineInput, levels: &Levels, [x, y]: [usize; 2]) -> f32 {
    let k = y * plane.width + x;
    let value = level(parts.smooth[k]);
    let mean = |[sum, weight]: [f32; 2]| (weight > 0.0).then(|| sum / weight);
    let background = mean(levels.background[k]).unwrap_or(0.0);
    // A part thinner than its blur: its brightest ridge stands for it.
    let grain = mean(levels.grain[k]).unwrap_or_else(|| ridge(plane, parts.smooth, x, y));
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

    /// Makes the outline go around a mask.
    pub(super) fn fill(&mut self, mask: &Mask) {
        for (v, held) in self.values.iter_mut().zip(&mask.bits) {
            if *held != 0 {
                *v = v.min(-0.5);
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

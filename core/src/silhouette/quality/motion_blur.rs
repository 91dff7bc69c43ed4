//! Motion blur: the edge is softer along one direction than across it, as something moved during the exposure.
//!
//! A lens out of focus softens all directions alike; a motion softens the edges that it crosses, on either side of the
//! grain, and leaves those along it as sharp as they were. The outline itself is no help: its level follows the ramp
//! of a smeared edge outwards. So the picture is read along the outline's normals, each profile is laid out by its own
//! levels, and only widths are compared.
//!
//! All else that widens a profile, shade towards the limb or a highlight, widens some edges but sharpens none. Hence a
//! direction is as soft as the sharper of its two sides, and one sharp side is enough to show that the lens is sharp.

use super::edge::{Crop, level};
use crate::silhouette::Segmentation;
use crate::silhouette::tone::Light;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Profiles read, at most.
const MOST_PROFILES: usize = 800;
/// Steps of a profile on either side of the outline. Half of a motion, and as much again for an outline that lies at
/// its end, must be in reach.
const REACH: usize = 24;
/// A step is a pixel; of a grain more than this many pixels in diameter as much more: what a motion may be, and how
/// far the distances reach, grows with the grain.
const FINEST: f64 = 400.0;
/// Parallel lines that are averaged, by their steps along the outline.
const BESIDE: [f64; 5] = [-4.0, -2.0, 0.0, 2.0, 4.0];
/// As many of them must lie in the picture.
const LEAST_BESIDE: f64 = 3.0;
/// Half the side, in steps, of the square over which the distances' gradient is averaged: a smeared outline wavers.
const AROUND: f64 = 4.0;
/// The mean gradient of the distances is this long where the outline is straight enough to have a normal.
const STRAIGHT: f64 = 0.3;
/// Rows above the pedestal's top that show the grain.
const ABOVE_PEDESTAL: f64 = 2.0;
/// Steps over which a plateau is averaged, and how many of them must be in the picture.
const PLATEAU: usize = 5;
const LEAST_PLATEAU: usize = 3;
/// Nearest plateau to the outline, steps: a sharp edge is over by then.
const NEAREST: usize = 3;
/// Levels are read this many standard deviations away from the outline.
const CLEAR_OF_BLUR: f64 = 2.5;
/// Plateaus are looked for this much further out where they do not stand off each other …
const FURTHER: usize = 3;
/// … by this share of the grain's contrast.
const LEAST_CONTRAST: f64 = 0.25;
/// Rounds after which a plateau is where it is.
const ROUNDS: usize = 8;
/// A normal distribution's quartiles are this many standard deviations apart.
const QUARTILES: f64 = 1.349;
/// Directions of the normal that are distinguished, over a whole turn.
const DIRECTIONS: usize = 16;
/// Half a turn in directions.
const OPPOSITE: usize = DIRECTIONS / 2;
/// Directions away from a motion that count as across it, within half a turn.
const ACROSS: std::ops::RangeInclusive<usize> = 3..=5;
/// A direction with fewer profiles than this is left out.
const LEAST_PROFILES: usize = 10;
/// The share of profiles that are less wide than the width stated for a side: where it is soft and its opposite is seen as
/// well, where it is not (a motion widens all profiles, shade some), and where it is sharp.
const SOFT: f64 = 0.5;
const SOFT_ALONE: f64 = 0.25;
const SHARP: f64 = 0.35;

/// Edge blur along the direction of motion and across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MotionBlur {
    /// Blur along the direction, pixels (standard deviation).
    pub softest_px: f64,
    /// Blur across it, pixels.
    pub sharpest_px: f64,
    /// The direction, degrees from the picture's horizontal, 0 … 180; from directions 22.5° apart.
    pub softest_deg: f64,
}

/// The direction along which the outline is softer by most than across it; `contrast` of the light beside it, levels. `None` where the outline shows no two such
/// directions.
pub(super) fn measure(crop: &Crop, found: &Segmentation, contrast: f64) -> Option<MotionBlur> {
    let diameter_px = (4.0 * found.report.area_px / PI).sqrt();
    let lines = Lines::new(crop, found, (diameter_px / FINEST).max(1.0));
    let points = lines.points();
    let least = LEAST_CONTRAST * contrast;
    let each = points.len().div_ceil(MOST_PROFILES).max(1);
    let few: Vec<[usize; 2]> = points.into_iter().step_by(each).collect();
    let widths: Vec<Option<(usize, f64)>> = (few.par_iter())
        .map(|&point| {
            let normal = lines.normal(point)?;
            // Rows run down, angles up.
            let turn = (-normal[1]).atan2(normal[0]).rem_euclid(2.0 * PI) / (2.0 * PI);
            let direction = (turn * DIRECTIONS as f64).round() as usize % DIRECTIONS;
            Some((direction, lines.step * width(&lines.profile(point, normal), least)?))
        })
        .collect();
    let mut sides = vec![Vec::new(); DIRECTIONS];
    widths.into_iter().flatten().for_each(|(direction, width)| sides[direction].push(width));
    compared(&sides)
}

/// Compares the widths of the edges that face each direction.
fn compared(sides: &[Vec<f64>]) -> Option<MotionBlur> {
    // With its neighbours to either side, so that few directions of an angular grain are left without an edge.
    let wide = |k: usize| [k + DIRECTIONS - 1, k, k + 1].map(|k| sides[k % DIRECTIONS].as_slice()).concat();
    let soft = |k: usize| {
        let both = [k, k + OPPOSITE].map(|k| quantile(wide(k), SOFT));
        match both {
            [Some(a), Some(b)] => Some(a.min(b)),
            [None, None] => None,
            [a, _] => quantile(wide(if a.is_some() { k } else { k + OPPOSITE }), SOFT_ALONE),
        }
    };
    let sharp = |k: usize| {
        let both = [k, k + OPPOSITE].map(|k| quantile(sides[k % DIRECTIONS].clone(), SHARP));
        both.into_iter().flatten().min_by(f64::total_cmp)
    };
    let differences = (0..OPPOSITE).filter_map(|k| {
        let softest = soft(k)?;
        let across = ACROSS.filter_map(|away| sharp(k + away)).min_by(f64::total_cmp)?;
        Some([softest, across.min(softest)])
    });
    let [softest_px, sharpest_px] = differences.max_by(|a, b| (a[0] - a[1]).total_cmp(&(b[0] - b[1])))?;
    // The variance goes with the cosine of twice the angle to the motion.
    let (mut c, mut s) = (0.0, 0.0);
    for k in 0..OPPOSITE {
        let (sin, cos) = (2.0 * PI * k as f64 / OPPOSITE as f64).sin_cos();
        let variance = soft(k).map_or(0.0, |px| px * px - sharpest_px * sharpest_px);
        c += variance * cos;
        s += variance * sin;
    }
    let softest_deg = (0.5 * s.atan2(c)).to_degrees().rem_euclid(180.0);
    Some(MotionBlur { softest_px, sharpest_px, softest_deg })
}

/// The value that a share of the values lies below; `None` of too few.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    if values.len() < LEAST_PROFILES {
        return None;
    }
    values.sort_by(f64::total_cmp);
    Some(values[(share * (values.len() - 1) as f64).round() as usize])
}

/// A picture's light along the outline's normals.
struct Lines<'a> {
    crop: &'a Crop,
    found: &'a Segmentation,
    weights: [f64; 3],
    light: Light,
    /// Pixels in a step.
    step: f64,
    /// Least and greatest column and row that count.
    least: [f64; 2],
    greatest: [f64; 2],
}

impl<'a> Lines<'a> {
    fn new(crop: &'a Crop, found: &'a Segmentation, step: f64) -> Self {
        let rect = crop.rect();
        let [x0, y0, x1, y1] = found.report.frame;
        let above = found.report.pedestal.map_or(f64::INFINITY, |p| p.top_row - ABOVE_PEDESTAL);
        let last = |a: usize, b: usize| a.min(b) as f64 - 1.0;
        Self {
            crop,
            found,
            weights: found.weights(),
            light: found.light(),
            step,
            least: [rect.x0.max(x0) as f64, rect.y0.max(y0) as f64],
            greatest: [last(rect.x1, x1), last(rect.y1, y1).min(above)],
        }
    }

    /// The outline's pixels, in the silhouette's rectangle, row by row.
    fn points(&self) -> Vec<[usize; 2]> {
        let s = &self.found.silhouette;
        let rows = self.found.clear_row().saturating_sub(s.origin[1]).min(s.size[1]);
        let on_outline = |(k, d): (usize, &f32)| (d.abs() < 0.5).then(|| [k % s.size[0], k / s.size[0]]);
        s.distance_px[..rows * s.size[0]].iter().enumerate().filter_map(on_outline).collect()
    }

    /// The outward normal at a pixel of the rectangle.
    fn normal(&self, [i, j]: [usize; 2]) -> Option<[f64; 2]> {
        let s = &self.found.silhouette;
        let [w, h] = s.size;
        let around = (AROUND * self.step).round() as usize;
        let (i, j) =
            (i.clamp(around, w.checked_sub(around + 1)?), j.clamp(around, h.checked_sub(around + 1)?));
        let at = |i: usize, j: usize| f64::from(s.distance_px[j * w + i]);
        let mut sum = [0.0; 2];
        for k in 0..=2 * around {
            let (x, y) = (i - around + k, j - around + k);
            sum[0] += at(i + around, y) - at(i - around, y);
            sum[1] += at(x, j + around) - at(x, j - around);
        }
        let pixels = (2 * around * (2 * around + 1)) as f64;
        let length = sum[0].hypot(sum[1]);
        (length > STRAIGHT * pixels).then(|| sum.map(|v| v / length))
    }

    /// Mean light along the normal, from inside to outside; not a number where the picture or the grain ends.
    fn profile(&self, [i, j]: [usize; 2], normal: [f64; 2]) -> [f64; 2 * REACH + 1] {
        let origin = self.found.silhouette.origin;
        let position = [(origin[0] + i) as f64, (origin[1] + j) as f64];
        std::array::from_fn(|k| {
            let out = self.step * (k as f64 - REACH as f64);
            let (mut sum, mut n) = (0.0, 0.0);
            for aside in BESIDE.map(|aside| self.step * aside) {
                let x = position[0] + out * normal[0] - aside * normal[1];
                let y = position[1] + out * normal[1] + aside * normal[0];
                if let Some(level) = self.level([x, y]) {
                    sum += level;
                    n += 1.0;
                }
            }
            if n >= LEAST_BESIDE { sum / n } else { f64::NAN }
        })
    }

    /// The light at a position between pixels, bilinear.
    fn level(&self, position: [f64; 2]) -> Option<f64> {
        if !(0..2).all(|k| position[k] >= self.least[k] && position[k] <= self.greatest[k]) {
            return None;
        }
        let rect = self.crop.rect();
        // The last pixel has none beyond it: it is read from the one before.
        let [x, y] = [position[0].min(rect.x1 as f64 - 1.001), position[1].min(rect.y1 as f64 - 1.001)];
        let (column, row) = (x as usize, y as usize);
        let c = self.crop.channels();
        let along = |row: usize| {
            let two = self.crop.row(row, &(column..column + 2));
            let t = x - column as f64;
            let light = |pixel: &[u8]| f64::from(self.light.at(level(pixel, &self.weights) as f32));
            (1.0 - t) * light(&two[..c]) + t * light(&two[c..])
        };
        let t = y - row as f64;
        Some((1.0 - t) * along(row) + t * along(row + 1))
    }
}

/// Standard deviation of a profile's blur in steps, from the distance between its quartiles; `None` where no grain
/// stands off the background by `least`.
fn width(profile: &[f64], least: f64) -> Option<f64> {
    let plateau = |levels: &[f64]| {
        let seen: Vec<f64> = levels.iter().copied().filter(|v| !v.is_nan()).collect();
        (seen.len() >= LEAST_PLATEAU).then(|| seen.iter().sum::<f64>() / seen.len() as f64)
    };
    let furthest = REACH - PLATEAU;
    let mut clear = NEAREST;
    let mut blur = None;
    for _ in 0..ROUNDS {
        let inside = plateau(&profile[REACH - clear - PLATEAU..REACH - clear])?;
        let outside = plateau(&profile[REACH + clear + 1..=REACH + clear + PLATEAU])?;
        let needed = if (inside - outside).abs() < least.max(1.0) {
            clear + FURTHER
        } else {
            let share: Vec<f64> = profile.iter().map(|v| (v - outside) / (inside - outside)).collect();
            let found = between_quartiles(&share) / QUARTILES;
            blur = Some(found);
            (CLEAR_OF_BLUR * found).ceil() as usize
        };
        if needed.min(furthest) <= clear {
            break;
        }
        clear = needed.min(furthest);
    }
    blur
}

/// Steps between the positions where three and one quarters of the way from background to grain are made; as far as the
/// profile reaches where it does not get there.
fn between_quartiles(share: &[f64]) -> f64 {
    // From the middle outwards on either side: noise further away is none of the edge's.
    let crossing = |steps: &mut dyn Iterator<Item = usize>, level: f64, rising: bool| {
        let mut last: Option<usize> = None;
        for k in steps {
            let here = share[k];
            if if rising { here >= level } else { here <= level } {
                let before = last.filter(|&b| !share[b].is_nan() && (here - share[b]).abs() > 1e-9);
                return Some(before.map_or(k as f64, |b| {
                    b as f64 + (level - share[b]) / (here - share[b]) * (k as f64 - b as f64)
                }));
            }
            last = Some(k);
        }
        None
    };
    let low = crossing(&mut (0..=REACH + 1).rev(), 0.75, true).unwrap_or(0.0);
    let high = crossing(&mut (REACH - 1..share.len()), 0.25, false).unwrap_or(share.len() as f64 - 1.0);
    (high - low).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp between two levels: what a motion of this many steps makes of an edge, with its middle where it likes.
    fn ramp(length: f64, middle: f64, levels: [f64; 2]) -> Vec<f64> {
        let level = |k: usize| {
            let t = ((k as f64 - REACH as f64 - middle) / length + 0.5).clamp(0.0, 1.0);
            levels[0] + t * (levels[1] - levels[0])
        };
        (0..=2 * REACH).map(level).collect()
    }

    #[test]
    fn a_ramp_is_as_wide_wherever_the_outline_lies_on_it() {
        for levels in [[200.0, 20.0], [40.0, 210.0]] {
            for middle in [-7.0, -5.0, 0.0, 3.0] {
                let found = width(&ramp(24.0, middle, levels), 30.0).unwrap();
                assert!((found - 12.0 / QUARTILES).abs() < 0.2, "{levels:?} at {middle}: {found}");
            }
        }
        assert!(width(&ramp(1.0, 0.0, [100.0, 20.0]), 30.0).unwrap() < 0.8);
        assert_eq!(width(&ramp(5.0, 0.0, [25.0, 20.0]), 30.0), None);
        assert_eq!(width(&[f64::NAN; 2 * REACH + 1], 30.0), None);
    }

    #[test]
    fn a_motion_is_distinguished_from_a_lens_and_from_shade_on_one_side() {
        let sides = |width: &dyn Fn(usize) -> f64| -> Vec<Vec<f64>> {
            (0..DIRECTIONS).map(|k| vec![width(k); LEAST_PROFILES]).collect()
        };
        let differences = |width: &dyn Fn(usize) -> f64| {
            let s = compared(&sides(width)).unwrap();
            (s.softest_px - s.sharpest_px, s.softest_deg)
        };
        assert!(differences(&|_| 7.0).0.abs() < 1e-12);
        assert!(differences(&|k| if k < 6 { 7.0 } else { 1.0 }).0.abs() < 1e-12);
        for along in 0..OPPOSITE {
            let moved = |k: usize| {
                let turn = 2.0 * PI * (k as f64 - along as f64) / DIRECTIONS as f64;
                1.0 + 6.0 * turn.cos().abs()
            };
            let (difference, deg) = differences(&moved);
            let off = (deg - 22.5 * along as f64 + 90.0).rem_euclid(180.0) - 90.0;
            assert!(difference > 5.0 && off.abs() < 5.0, "{along}: {difference} at {deg}°");
        }
        // One side of the sharp direction, or of the soft one, is the pedestal's.
        for hidden in [12, 0] {
            let mut seen = sides(&|k| if k % OPPOSITE == 4 { 1.0 } else { 6.0 });
            for k in [hidden + 15, hidden, hidden + 1] {
                seen[k % DIRECTIONS].clear();
            }
            let s = compared(&seen).unwrap();
            assert!((s.softest_px - 6.0).abs() < 1e-12 && (s.sharpest_px - 1.0).abs() < 1e-12, "{s:?}");
        }
        assert_eq!(compared(&vec![vec![]; DIRECTIONS]), None);
    }
}

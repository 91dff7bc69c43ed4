//! How soft the outline is, and in which direction: the edge's profile, averaged along the outline for each
//! direction of its normal, and the distance between the profile's quartiles.
//!
//! A lens out of focus softens all directions alike. A grain, a table or a camera that moved during the exposure
//! softens only the edges that the motion crosses.

use super::frame::Rect;
use super::{Found, Polarity, Silhouette, Source};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;
use std::ops::Range;

/// Directions of the normal that are told apart, over a whole turn.
const DIRECTIONS: usize = 16;
/// Pixels on either side of the outline that are looked at: two and a half standard deviations of the softest
/// edge that the outline is placed on, and a plateau beyond.
const REACH: usize = 24;
/// Pixels around a silhouette's rectangle, which has some around the outline, that are looked at.
const BESIDE: usize = REACH / 2;
/// Bins of a profile for each pixel.
const PER_PX: usize = 2;
/// Bins of a profile.
const BINS: usize = 2 * REACH * PER_PX;
/// Pixels over which a plateau is averaged.
const PLATEAU: usize = 5;
/// Nearest plateau to the outline, pixels: a sharp edge with its pixel's width is over by then.
const NEAREST: usize = 3;
/// Levels are read this many standard deviations away from the outline, where an edge is over to 1 %.
const CLEAR_OF_BLUR: f64 = 2.5;
/// A normal distribution's quartiles are this many standard deviations apart.
const QUARTILES: f64 = 1.349;
/// A profile with fewer pixels within one of the outline, or on a plateau, than this is not believed.
const LEAST_PIXELS: f64 = 12.0;
/// Directions, of half a turn's, that must have a profile before they are compared.
const LEAST_DIRECTIONS: usize = 4;
/// Pixels above the pedestal's top where the outline is the pedestal's rather than the grain's.
const PEDESTAL_PX: f64 = 8.0;
/// A colour at this level or above is full: what is brighter reads the same, give or take the ripple of a JPEG.
const FULL: u8 = 252;

/// The pixels around a silhouette, as far as its edge reaches.
pub(super) struct Part {
    rect: Rect,
    channels: usize,
    pixels: Vec<u8>,
}

impl Part {
    pub(super) fn of(picture: &dyn Source, found: &Found) -> Self {
        let [width, height, channels] = picture.shape();
        let Silhouette { origin: [x, y], size: [w, h], .. } = &found.silhouette;
        let (x1, y1) = (x + w, y + h);
        let rect =
            Rect { x0: *x, y0: *y, x1, y1 }.grown(BESIDE, &Rect { x0: 0, y0: 0, x1: width, y1: height });
        let (columns, rows) = rect.ranges();
        Self { rect, channels, pixels: picture.part(&columns, &rows) }
    }

    /// The bytes of some columns of a row, by their numbers in the picture.
    pub(super) fn row(&self, y: usize, columns: &Range<usize>) -> &[u8] {
        let start = (y - self.rect.y0) * self.rect.width();
        let [from, to] = [columns.start, columns.end].map(|x| (start + x - self.rect.x0) * self.channels);
        &self.pixels[from..to]
    }
}

/// What the pixels along the outline say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Edge {
    /// Standard deviation of the edge's blur over all directions, pixels.
    pub blur_px: f64,
    /// Of the softest and the sharpest direction, pixels; absent where too few directions occur in the outline.
    pub softest_px: Option<[f64; 2]>,
    /// The softest direction, degrees from the picture's horizontal, 0 … 180.
    pub softest_deg: f64,
    /// Share of full pixels on the lit side of the outline.
    pub full_share: f64,
    /// Mean level of the background beside the outline, grey levels of the channel.
    pub background: f64,
    /// Noise of single pixels beside the outline, grey levels: of the noisier side.
    pub noise: f64,
}

/// A sum and a count for each bin of distance.
#[derive(Clone)]
struct Profile {
    sums: [f64; BINS],
    counts: [f64; BINS],
}

impl Profile {
    fn empty() -> Self {
        Self { sums: [0.0; BINS], counts: [0.0; BINS] }
    }

    fn add(&mut self, bin: usize, level: f64) {
        self.sums[bin] += level;
        self.counts[bin] += 1.0;
    }

    fn take_in(&mut self, other: &Self) {
        for k in 0..BINS {
            self.sums[k] += other.sums[k];
            self.counts[k] += other.counts[k];
        }
    }

    /// Mean level over pixels `from..from + PLATEAU` away from the outline, inside or outside.
    fn plateau(&self, inside: bool, from: usize) -> Option<f64> {
        let bins = from * PER_PX..(from + PLATEAU) * PER_PX;
        let (mut sum, mut count) = (0.0, 0.0);
        for k in bins {
            let bin = if inside { BINS / 2 - 1 - k } else { BINS / 2 + k };
            sum += self.sums[bin];
            count += self.counts[bin];
        }
        (count >= LEAST_PIXELS).then(|| sum / count)
    }

    /// Pixels within one of the outline.
    fn on_outline(&self) -> f64 {
        (BINS / 2 - PER_PX..BINS / 2 + PER_PX).map(|k| self.counts[k]).sum()
    }

    /// Standard deviation of the blur, pixels; `None` where there is too little to see.
    fn blur_px(&self) -> Option<f64> {
        let mut clear = NEAREST;
        let mut blur = None;
        for _ in 0..6 {
            // A body thinner than its blur has its plateau where it is thickest.
            let inside = (1..=clear).rev().find_map(|from| self.plateau(true, from))?;
            let outside = (1..=clear).rev().find_map(|from| self.plateau(false, from))?;
            let found = self.between_quartiles(inside, outside)? / QUARTILES;
            blur = Some(found);
            let needed = ((CLEAR_OF_BLUR * found).ceil() as usize).clamp(NEAREST, REACH - PLATEAU);
            if needed <= clear {
                break;
            }
            clear = needed;
        }
        blur
    }

    /// Distance between the places where three and one quarters of the way from background to grain are made.
    fn between_quartiles(&self, inside: f64, outside: f64) -> Option<f64> {
        let share = |bin: usize| {
            (self.counts[bin] > 0.0)
                .then(|| (self.sums[bin] / self.counts[bin] - outside) / (inside - outside))
        };
        if (inside - outside).abs() < 1.0 {
            return None;
        }
        let place = |bin: f64| (bin + 0.5) / PER_PX as f64 - REACH as f64;
        // From the middle outwards on either side: noise further away is none of the edge's.
        let walk = |bins: &mut dyn Iterator<Item = usize>, level: f64, rising: bool| {
            let mut last: Option<(usize, f64)> = None;
            for bin in bins {
                let Some(here) = share(bin) else { continue };
                if if rising { here >= level } else { here <= level } {
                    return Some(match last {
                        Some((before, was)) if (here - was).abs() > 1e-9 => {
                            let t = ((level - was) / (here - was)).clamp(0.0, 1.0);
                            place(before as f64 + t * (bin as f64 - before as f64))
                        }
                        _ => place(bin as f64),
                    });
                }
                last = Some((bin, here));
            }
            None
        };
        let low = walk(&mut (0..BINS / 2 + PER_PX).rev(), 0.75, true);
        let high = walk(&mut (BINS / 2 - PER_PX..BINS), 0.25, false);
        // An edge that does not get there within reach is at least as wide as that.
        let reach = REACH as f64;
        let whole = (high.unwrap_or(reach) - low.unwrap_or(-reach)).max(0.0);
        // The outer half alone, where half of the level on the outline is left: a grain that darkens towards its limb
        // widens only the inner one.
        let on_outline = 0.5 * (share(BINS / 2 - 1)? + share(BINS / 2)?);
        let outer = walk(&mut (BINS / 2 - PER_PX..BINS), 0.5 * on_outline, false).unwrap_or(reach);
        Some(whole.min(2.0 * outer.max(0.0)))
    }
}

/// Reads the pixels along the outline.
pub(super) fn measure(part: &Part, found: &Found) -> Edge {
    let (profiles, sides) = profiles(part, found);
    let mut all = Profile::empty();
    profiles.iter().for_each(|p| all.take_in(p));
    let mut edge = Edge {
        blur_px: all.blur_px().unwrap_or(0.0),
        full_share: sides.full_share(),
        background: sides.background(),
        noise: sides.noise(),
        ..Edge::default()
    };
    // A motion softens both the edge that it enters and the one that it leaves; the shade of a grain lit from one
    // side softens only one of them.
    let seen: Vec<(f64, f64, f64)> = (0..DIRECTIONS / 2)
        .filter_map(|k| {
            let twice = 4.0 * PI * (k as f64 + 0.5) / DIRECTIONS as f64;
            let sides = [&profiles[k], &profiles[k + DIRECTIONS / 2]];
            if sides.iter().any(|p| p.on_outline() < LEAST_PIXELS) {
                return None;
            }
            let sharper = sides[0].blur_px()?.min(sides[1].blur_px()?);
            Some((twice, sharper * sharper, sides[0].on_outline() + sides[1].on_outline()))
        })
        .collect();
    if seen.len() >= LEAST_DIRECTIONS
        && let Some([mean, c, s]) = fitted(&seen)
    {
        // Only in directions that the outline has: what the fit says of others is a guess.
        let at = |twice: f64| (mean + c * twice.cos() + s * twice.sin()).max(0.0).sqrt();
        let ends = seen.iter().map(|(twice, ..)| at(*twice));
        edge.softest_px = Some([ends.clone().fold(0.0, f64::max), ends.fold(f64::INFINITY, f64::min)]);
        edge.softest_deg = (0.5 * s.atan2(c)).to_degrees().rem_euclid(180.0);
    }
    edge
}

/// The variance of the blur as `mean + c cos 2φ + s sin 2φ` by least squares: what adding a motion's variance to a
/// lens's gives.
fn fitted(seen: &[(f64, f64, f64)]) -> Option<[f64; 3]> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for &(twice, variance, weight) in seen {
        let row = Vector3::new(1.0, twice.cos(), twice.sin());
        normal += weight * row * row.transpose();
        right += weight * variance * row;
    }
    // A trace of a ridge: an outline that lacks a direction shows no swing there.
    let pixels = normal[(0, 0)];
    normal[(1, 1)] += 1e-3 * pixels;
    normal[(2, 2)] += 1e-3 * pixels;
    normal.cholesky().map(|c| c.solve(&right).into())
}

/// What is counted on the two sides of the outline, clear of its blur.
#[derive(Default)]
struct Sides {
    lit: f64,
    full: f64,
    level: f64,
    levels: f64,
    /// Sum of squared second differences along rows, and their number: outside, inside.
    ripple: [(f64, f64); 2],
}

impl Sides {
    fn full_share(&self) -> f64 {
        self.full / self.lit.max(1.0)
    }

    fn background(&self) -> f64 {
        self.level / self.levels.max(1.0)
    }

    /// A second difference of independent values has six times their variance; a slope gives none.
    fn noise(&self) -> f64 {
        self.ripple.iter().map(|(sum, n)| (sum / (6.0 * n.max(1.0))).sqrt()).fold(0.0, f64::max)
    }
}

fn profiles(part: &Part, found: &Found) -> (Vec<Profile>, Sides) {
    let (s, report) = (&found.silhouette, &found.report);
    let bright_grain = report.polarity == Polarity::DarkBackground;
    let weights = report.channel.weights().map(|w| f64::from(w) / 16.0);
    let [x0, y0, x1, y1] = report.frame;
    let lowest = report.pedestal.map_or(y1, |p| (p.top_row - PEDESTAL_PX).max(0.0) as usize).min(y1);
    // The distance is known on the silhouette's rectangle; further out a lower bound of it is enough.
    let reach = |origin: usize, size: usize, low: usize, high: usize| {
        origin.saturating_sub(BESIDE).max(low)..(origin + size + BESIDE).min(high)
    };
    let rows = reach(s.origin[1], s.size[1], y0, lowest);
    let columns = reach(s.origin[0], s.size[0], x0, x1);
    let mut profiles = vec![Profile::empty(); DIRECTIONS];
    let mut sides = Sides::default();
    let channels = part.channels;
    let level = |pixel: &[u8]| match pixel {
        [r, g, b] => weights[0] * f64::from(*r) + weights[1] * f64::from(*g) + weights[2] * f64::from(*b),
        _ => f64::from(pixel[0]),
    };
    for y in rows {
        let line = part.row(y, &columns);
        for (k, x) in columns.clone().enumerate() {
            let Some((d, direction)) = near(found, x, y) else { continue };
            let bin = ((d + REACH as f64) * PER_PX as f64) as usize;
            let pixel = &line[k * channels..(k + 1) * channels];
            let here = level(pixel);
            profiles[direction].add(bin.min(BINS - 1), here);
            let clear = d.abs() > NEAREST as f64;
            if !clear {
                continue;
            }
            if (d > 0.0) != bright_grain {
                sides.lit += 1.0;
                sides.full += f64::from(u8::from(is_full(pixel, &weights)));
            }
            // Further out, where no blur reaches.
            if d > 0.5 * REACH as f64 {
                sides.level += here;
                sides.levels += 1.0;
            }
            if k > 0 && k + 1 < columns.len() {
                let ripple = level(&line[(k - 1) * channels..k * channels]) - 2.0 * here
                    + level(&line[(k + 1) * channels..(k + 2) * channels]);
                let (sum, n) = &mut sides.ripple[usize::from(d < 0.0)];
                *sum += ripple * ripple;
                *n += 1.0;
            }
        }
    }
    (profiles, sides)
}

fn is_full(pixel: &[u8], weights: &[f64; 3]) -> bool {
    match pixel {
        [_, _, _] => pixel.iter().zip(weights).any(|(v, w)| *w != 0.0 && *v >= FULL),
        _ => pixel[0] >= FULL,
    }
}

/// Signed distance of a pixel to the outline and the direction of the normal there, where it is within reach.
fn near(found: &Found, x: usize, y: usize) -> Option<(f64, usize)> {
    let s = &found.silhouette;
    let [w, h] = s.size;
    let i = x.clamp(s.origin[0], s.origin[0] + w - 1) - s.origin[0];
    let j = y.clamp(s.origin[1], s.origin[1] + h - 1) - s.origin[1];
    let at = |i: usize, j: usize| f64::from(s.distance_px[j * w + i]);
    let reach = REACH as f64;
    if at(i, j).abs() >= reach || w < 3 || h < 3 {
        return None;
    }
    let away = [x.abs_diff(s.origin[0] + i), y.abs_diff(s.origin[1] + j)];
    let d = match away {
        [0, 0] => at(i, j),
        [across, down] => at(i, j).hypot((across as f64).hypot(down as f64)),
    };
    if d.abs() >= reach {
        return None;
    }
    let (i, j) = (i.clamp(1, w - 2), j.clamp(1, h - 2));
    let normal = [at(i + 1, j) - at(i - 1, j), at(i, j + 1) - at(i, j - 1)];
    // Rows run down, angles up.
    let turn = (-normal[1]).atan2(normal[0]).rem_euclid(2.0 * PI) / (2.0 * PI);
    Some((d, ((turn * DIRECTIONS as f64) as usize).min(DIRECTIONS - 1)))
}

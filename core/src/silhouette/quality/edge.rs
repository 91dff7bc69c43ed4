//! Edge blur: the edge's profile, averaged along the outline, and the distance between the profile's
//! quartiles. Whether it is softer in one direction than in another is a matter of [`super::motion_blur`].

use crate::silhouette::rect::Rect;
use crate::silhouette::tone::{Light, ToneCurve};
use crate::silhouette::{Polarity, Segmentation, Silhouette, Source};
use std::ops::Range;

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
/// Pixels above the pedestal's top where the outline is the pedestal's rather than the grain's.
const PEDESTAL_PX: f64 = 8.0;
/// A colour at this level or above is full: what is brighter reads the same, give or take the ripple of a JPEG.
const FULL: u8 = 252;

impl Segmentation {
    /// The light of every grey value of the channel; of a difference of two colours, whose light is not known, the values
    /// themselves.
    pub(super) fn light(&self) -> Light {
        let is_difference = self.report.channel.is_difference();
        if is_difference { ToneCurve::Linear } else { self.report.tone_curve }.light()
    }

    /// What red, green and blue count for in the channel.
    pub(super) fn weights(&self) -> [f64; 3] {
        self.report.channel.weights().map(|w| f64::from(w) / 16.0)
    }

    /// The first row in which the outline is the pedestal's, or its blurred light's, rather than the grain's.
    pub(super) fn clear_row(&self) -> usize {
        let end = self.report.frame[3];
        self.report.pedestal.map_or(end, |p| (p.top_row - PEDESTAL_PX).max(0.0) as usize).min(end)
    }
}

/// The pixels around a silhouette, as far as its edge reaches.
pub(super) struct Crop {
    rect: Rect,
    channels: usize,
    pixels: Vec<u8>,
}

impl Crop {
    pub(super) fn of(picture: &dyn Source, found: &Segmentation) -> Self {
        let [width, height, channels] = picture.shape();
        let Silhouette { origin: [x, y], size: [w, h], .. } = &found.silhouette;
        let (x1, y1) = (x + w, y + h);
        let rect =
            Rect { x0: *x, y0: *y, x1, y1 }.grown(BESIDE, &Rect { x0: 0, y0: 0, x1: width, y1: height });
        let (columns, rows) = rect.ranges();
        Self { rect, channels, pixels: picture.part(&columns, &rows) }
    }

    /// Where they lie in the picture.
    pub(super) fn rect(&self) -> &Rect {
        &self.rect
    }

    /// Bytes of a pixel.
    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    /// The bytes of some columns of a row, by their numbers in the picture.
    pub(super) fn row(&self, y: usize, columns: &Range<usize>) -> &[u8] {
        let start = (y - self.rect.y0) * self.rect.width();
        let [from, to] = [columns.start, columns.end].map(|x| (start + x - self.rect.x0) * self.channels);
        &self.pixels[from..to]
    }
}

/// What is measured on the pixels along the outline.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Edge {
    /// Standard deviation of the edge's blur over all directions, pixels.
    pub blur_px: f64,
    /// Light of the grain beside the outline, less the background's, levels.
    pub contrast: f64,
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

    /// Light of the grain less that of the background, levels.
    fn contrast(&self) -> Option<f64> {
        Some((self.plateau(true, NEAREST)? - self.plateau(false, NEAREST)?).abs())
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

    /// Distance between the positions where three and one quarters of the way from background to grain are made.
    fn between_quartiles(&self, inside: f64, outside: f64) -> Option<f64> {
        let share = |bin: usize| {
            (self.counts[bin] > 0.0)
                .then(|| (self.sums[bin] / self.counts[bin] - outside) / (inside - outside))
        };
        if (inside - outside).abs() < 1.0 {
            return None;
        }
        let position = |bin: f64| (bin + 0.5) / PER_PX as f64 - REACH as f64;
        // From the middle outwards on either side: noise further away is none of the edge's.
        let walk = |bins: &mut dyn Iterator<Item = usize>, level: f64, rising: bool| {
            let mut last: Option<(usize, f64)> = None;
            for bin in bins {
                let Some(here) = share(bin) else { continue };
                if if rising { here >= level } else { here <= level } {
                    return Some(match last {
                        Some((before, was)) if (here - was).abs() > 1e-9 => {
                            let t = ((level - was) / (here - was)).clamp(0.0, 1.0);
                            position(before as f64 + t * (bin as f64 - before as f64))
                        }
                        _ => position(bin as f64),
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
pub(super) fn measure(crop: &Crop, found: &Segmentation) -> Edge {
    let (profile, sides) = read(crop, found);
    Edge {
        blur_px: profile.blur_px().unwrap_or(0.0),
        contrast: profile.contrast().unwrap_or(0.0),
        full_share: sides.full_share(),
        background: sides.background(),
        noise: sides.noise(),
    }
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

fn read(crop: &Crop, found: &Segmentation) -> (Profile, Sides) {
    let (s, report) = (&found.silhouette, &found.report);
    let bright_grain = report.polarity == Polarity::DarkBackground;
    let weights = found.weights();
    let [x0, y0, x1, _] = report.frame;
    let lowest = found.clear_row();
    // The distance is known on the silhouette's rectangle; further out a lower bound of it is enough.
    let reach = |origin: usize, size: usize, low: usize, high: usize| {
        origin.saturating_sub(BESIDE).max(low)..(origin + size + BESIDE).min(high)
    };
    let rows = reach(s.origin[1], s.size[1], y0, lowest);
    let columns = reach(s.origin[0], s.size[0], x0, x1);
    let mut profile = Profile::empty();
    let mut sides = Sides::default();
    let channels = crop.channels;
    let level = |pixel: &[u8]| level(pixel, &weights);
    let light = found.light();
    for y in rows {
        let line = crop.row(y, &columns);
        for (k, x) in columns.clone().enumerate() {
            let Some(d) = near(found, x, y) else { continue };
            let bin = ((d + REACH as f64) * PER_PX as f64) as usize;
            let pixel = &line[k * channels..(k + 1) * channels];
            let here = level(pixel);
            profile.add(bin.min(BINS - 1), f64::from(light.at(here as f32)));
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
    (profile, sides)
}

/// Grey level of a pixel in the channel.
pub(super) fn level(pixel: &[u8], weights: &[f64; 3]) -> f64 {
    match pixel {
        [r, g, b] => weights[0] * f64::from(*r) + weights[1] * f64::from(*g) + weights[2] * f64::from(*b),
        _ => f64::from(pixel[0]),
    }
}

fn is_full(pixel: &[u8], weights: &[f64; 3]) -> bool {
    match pixel {
        [_, _, _] => pixel.iter().zip(weights).any(|(v, w)| *w != 0.0 && *v >= FULL),
        _ => pixel[0] >= FULL,
    }
}

/// Signed distance of a pixel to the outline, where it is within reach.
fn near(found: &Segmentation, x: usize, y: usize) -> Option<f64> {
    let s = &found.silhouette;
    let [w, h] = s.size;
    let i = x.clamp(s.origin[0], s.origin[0] + w - 1) - s.origin[0];
    let j = y.clamp(s.origin[1], s.origin[1] + h - 1) - s.origin[1];
    let at = |i: usize, j: usize| f64::from(s.distance_px[j * w + i]);
    let reach = REACH as f64;
    if at(i, j).abs() >= reach {
        return None;
    }
    let away = [x.abs_diff(s.origin[0] + i), y.abs_diff(s.origin[1] + j)];
    let d = match away {
        [0, 0] => at(i, j),
        [across, down] => at(i, j).hypot((across as f64).hypot(down as f64)),
    };
    (d.abs() < reach).then_some(d)
}

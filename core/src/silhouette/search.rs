//! Region of interest, channel and polarity of the grain, on the downsampled picture.

use super::backdrop::Backdrop;
use super::mask::{Connect, Mask};
use super::otsu::Histogram;
use super::rect::Rect;
use super::reduced::Reduced;
use super::{Channel, Polarity, Settings, SilhouetteError};
use rayon::prelude::*;

/// A cell this many standard deviations off the background may be grain.
const SEED_SIGMAS: f64 = 6.0;
/// The same as a share of the strongest contrast: keeps smudges on the background out.
const SEED_SHARE: f64 = 0.1;
/// Least contrast of a grain, grey levels: below it no outline can be placed.
const LEAST_CONTRAST: f64 = 8.0;
/// Contrast of a grain in standard deviations of the background's cells.
const CONTRAST_SIGMAS: f64 = 5.0;
/// Cells whose contrast is called the strongest: the upper share of all cells.
const STRONGEST: f64 = 0.001;
/// An object beside the largest belongs to it when it weighs at least this share of it.
const COMPANION: f64 = 0.05;
/// Background left around the grain, as a share of the grain's longer side.
const MARGIN: f64 = 0.25;
/// Channels whose scores differ by less than this are equally sure.
const EQUAL: f64 = 0.05;
/// What a contrast that vanishes beside the strongest costs.
const PALE: f64 = 0.1;
/// A channel that shows this share of what the one that shows the most does shows as much; brightness, which is stored in full
/// resolution, with less.
const SHOWN: f64 = 0.99;
const SHOWN_BY_LUMA: f64 = 0.92;
/// Greatest share of the picture's ends (not the lower one) that the grain may cover.
const LARGEST_RING_SHARE: f64 = 0.5;

/// What the search found.
pub(super) struct Scene {
    pub channel: Channel,
    pub bright_grain: bool,
    pub backdrop: Backdrop,
    pub region: Rect,
}

/// A channel and a polarity, judged.
struct Candidate {
    scene: Scene,
    contrast: f64,
    ring_share: f64,
    /// Cells taken for grain.
    cells: usize,
    score: f64,
}

/// Looks, on the small copies of the picture and of the empty stage, at every channel and polarity that the settings allow and takes the one that separates best.
pub(super) fn search(
    reduced: &Reduced,
    empty: Option<&Reduced>,
    frame: &Rect,
    settings: &Settings,
) -> Result<Scene, SilhouetteError> {
    let grey = reduced.colours().len() == 1;
    let channels: &[Channel] = match settings.channel {
        Channel::Auto if grey => &[Channel::Luma],
        Channel::Auto => &Channel::CANDIDATES,
        channel if grey && channel != Channel::Luma => return Err(SilhouetteError::NoColour { channel }),
        ref channel => std::slice::from_ref(channel),
    };
    let candidates: Vec<Candidate> =
        (channels.par_iter()).map(|&channel| judge(reduced, empty, channel, frame, settings)).collect();
    let strongest = candidates.iter().max_by(|a, b| a.contrast.total_cmp(&b.contrast));
    let (contrast, noise) = strongest.map_or((0.0, 0.0), |c| (c.contrast, c.scene.backdrop.noise));
    let seen = |c: &Candidate| c.contrast >= needed(c.scene.backdrop.noise);
    let any_seen = candidates.iter().any(seen);
    let least_ring = candidates.iter().map(|c| c.ring_share).fold(f64::INFINITY, f64::min);
    let fit = |c: &Candidate| seen(c) && c.ring_share <= LARGEST_RING_SHARE;
    let strongest = candidates.iter().filter(|c| fit(c)).map(|c| c.contrast).fold(1e-9, f64::max);
    let score = |c: &Candidate| c.score - PALE * (1.0 - c.contrast / strongest) - c.scene.channel.handicap();
    let best = candidates.iter().filter(|c| fit(c)).map(score).fold(f64::NEG_INFINITY, f64::max);
    // What one view leaves out is carved for good, what one view has too much the others carve: of channels
    // that are as good as equally sure, those that show the most of the grain come first.
    let equal = |c: &Candidate| fit(c) && score(c) >= best - EQUAL;
    let most = candidates.iter().filter(|c| equal(c)).map(|c| c.cells).max().unwrap_or(0).max(1);
    (candidates.into_iter())
        .filter(|c| equal(c) && c.cells as f64 >= shown(c.scene.channel) * most as f64)
        .reduce(|best, c| if score(&c) > score(&best) { c } else { best })
        .map(|best| best.scene)
        .ok_or(if any_seen {
            SilhouetteError::NoBackground { share: 100.0 * least_ring, limit: 100.0 * LARGEST_RING_SHARE }
        } else {
            SilhouetteError::NoContrast { contrast, limit: needed(noise), noise }
        })
}

fn shown(channel: Channel) -> f64 {
    if channel == Channel::Luma { SHOWN_BY_LUMA } else { SHOWN }
}

fn needed(noise: f64) -> f64 {
    LEAST_CONTRAST.max(CONTRAST_SIGMAS * noise)
}

fn judge(
    reduced: &Reduced,
    empty: Option<&Reduced>,
    channel: Channel,
    frame: &Rect,
    settings: &Settings,
) -> Candidate {
    let levels = reduced.channel(channel);
    let backdrop = Backdrop::fit(reduced, &levels, empty.map(|stage| stage.channel(channel)));
    let model = backdrop.cells(reduced);
    let mut off: Vec<f32> = levels.iter().zip(&model).map(|(v, m)| v - m).collect();
    // The strongest contrast of either polarity.
    let few = (off.len() as f64 * STRONGEST) as usize;
    let [dark, bright] = ends(&off, few).map(f64::from);
    let dark = -dark;
    let seed = |strongest: f64| (SEED_SIGMAS * backdrop.noise).max(SEED_SHARE * strongest).max(1.0) as f32;
    let bright_grain = match settings.polarity {
        Polarity::BrightBackground => false,
        Polarity::DarkBackground => true,
        Polarity::Auto => {
            // Whichever side of the background outweighs the other is the grain; highlights do not.
            let limit = seed(bright.max(dark));
            let weight = |sign: f32| off.iter().map(|v| f64::from((sign * v - limit).max(0.0))).sum::<f64>();
            weight(1.0) > weight(-1.0)
        }
    };
    if !bright_grain {
        off.iter_mut().for_each(|v| *v = -*v);
    }
    let strongest = if bright_grain { bright } else { dark };
    let limit = seed(strongest);
    let mask = Mask {
        width: reduced.width,
        height: reduced.height,
        bits: off.iter().map(|v| u8::from(*v > limit)).collect(),
    };
    let cells = region(&mask, &off).unwrap_or(Rect { x0: 0, y0: 0, x1: reduced.width, y1: reduced.height });
    let pixels = |k: usize, axis: usize| reduced.origin[axis] + k * reduced.factor;
    let exact = Rect {
        x0: pixels(cells.x0, 0),
        y0: pixels(cells.y0, 1),
        x1: pixels(cells.x1, 0),
        y1: pixels(cells.y1, 1),
    };
    let margin = (MARGIN * exact.width().max(exact.height()) as f64) as usize + 3 * reduced.factor + 12;
    let region = exact.grown(margin, frame);
    let mut histogram =
        Histogram::new(-4.0 * backdrop.noise, (strongest + 5.0 * backdrop.noise) / 256.0, 256);
    let around = Rect { x0: 0, y0: 0, x1: reduced.width, y1: reduced.height };
    let around = cells.grown(margin.div_ceil(reduced.factor), &around);
    for j in around.y0..around.y1 {
        for v in &off[j * reduced.width + around.x0..j * reduced.width + around.x1] {
            histogram.add(f64::from(*v));
        }
    }
    let split = histogram.otsu2();
    let otsu = split.map_or(f64::INFINITY, |s| s.threshold);
    let valley = histogram.valley(limit.into(), otsu.max(limit.into()));
    let (threshold, unsure) = valley.map_or((otsu, 1.0), |q| (q.threshold, q.unsure));
    let contrast = split.map_or(0.0, |s| s.means[1] - s.means[0]).min(strongest.max(0.0));
    let above = |v: &f32| f64::from(*v) > threshold;
    let (ring, covered) =
        reduced.ring().fold((0, 0), |(n, sum), k| (n + 1, sum + usize::from(above(&off[k]))));
    let ring_share = covered as f64 / f64::from(ring.max(1));
    let cells = off.iter().filter(|v| above(v)).count();
    let score = (1.0 - unsure) * (1.0 - ring_share);
    Candidate { scene: Scene { channel, bright_grain, backdrop, region }, contrast, ring_share, cells, score }
}

/// The values that `few` others are less than, and greater than: of the least ones and of the greatest ones. Reads the
/// upper bits of all, and sorts those only that share them with what is sought.
fn ends(values: &[f32], few: usize) -> [f32; 2] {
    // Bits that are ordered as the numbers are (`f32::total_cmp`).
    let key = |v: &f32| {
        let bits = v.to_bits();
        if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
    };
    let mut counts = vec![0u32; 1 << 16];
    values.iter().for_each(|v| counts[(key(v) >> 16) as usize] += 1);
    [few, values.len() - 1 - few].map(|rank| {
        let mut before = 0;
        let full = |&count: &u32| {
            before += count as usize;
            before > rank
        };
        let upper = counts.iter().position(full).unwrap_or(0);
        let mut same: Vec<f32> =
            values.iter().filter(|v| (key(v) >> 16) as usize == upper).copied().collect();
        let first = before - same.len();
        *same.select_nth_unstable_by(rank - first, f32::total_cmp).1
    })
}

/// Cells of the heaviest object and of those that belong to it.
fn region(mask: &Mask, weight: &[f32]) -> Option<Rect> {
    let (runs, components) = mask.components(Connect::Corners);
    let mut weights = vec![0f64; components.len()];
    for run in &runs {
        let cells = &weight[run.row * mask.width + run.start..run.row * mask.width + run.end];
        weights[run.component] += cells.iter().map(|v| f64::from(*v)).sum::<f64>();
    }
    let heaviest = weights.iter().copied().fold(0.0, f64::max);
    (components.iter().zip(&weights))
        .filter(|(_, w)| **w >= COMPANION * heaviest)
        .map(|(c, _)| Rect { x0: c.least[0], y0: c.least[1], x1: c.greatest[0] + 1, y1: c.greatest[1] + 1 })
        .reduce(|a, b| Rect {
            x0: a.x0.min(b.x0),
            y0: a.y0.min(b.y0),
            x1: a.x1.max(b.x1),
            y1: a.y1.max(b.y1),
        })
}

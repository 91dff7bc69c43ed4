//! The region of the grain in full resolution: thresholds, what is not background, the pedestal, the grain.

use super::find::Known;
use super::mask::Mask;
use super::pedestal::{self, Pedestal};
use super::plane::Plane;
use super::rect::Rect;
use super::search::Scene;
use super::{
    Classes, Histogram, Holes, PedestalMode, Plateaus, Settings, SilhouetteError, Source, ToneCurve,
};
use super::{despeckle, faint, hair, highlights, holes, outline, pieces};

/// A threshold this many standard deviations above the background is clear of its noise.
const CLEAR_SIGMAS: f64 = 6.0;
/// The least threshold, grey levels.
const LEAST_THRESHOLD: f64 = 4.0;
/// A threshold before a dark background is at least this share of the grain's light.
const LEAST_LIGHT: f32 = 0.08;
/// Levels are read this many standard deviations of the edge's blur away from the outline.
const CLEAR_OF_BLUR: f64 = 2.5;
/// What comes this near (pixels) to the pedestal's top stands on it.
const RESTING: f64 = 6.0;
/// Pixels above the pedestal's top in which nothing faint is looked for.
const CLEAR_OF_FOOT: f64 = 2.0;
/// So many pixels within a faint part's edge all is grain, where the part is wider than the skirt of a blur (half its width at least, and a
/// part of it in standard deviations of the pedestal's blur and pixels), or the other views hold it.
const WITHIN: usize = 2;
const HALF_SKIRT: (usize, f64, usize) = (6, 1.5, 3);
/// Of the rows below a pedestal's top so many times those above it are looked at further: all of the pedestal is cut off.
const BELOW: f64 = 1.0;
/// Bins of the histogram that is kept for a person's eye.
const HISTOGRAM_BINS: usize = 128;

/// The pixel-accurate state of affairs in the region.
pub(super) struct Seen {
    pub plane: Plane,
    pub histogram: Histogram,
    pub plateaus: Plateaus,
    pub noise: f64,
    pub threshold_two: f64,
    pub thresholds_three: [f64; 2],
    pub separability: [f64; 2],
    pub threshold: f64,
    /// All that is not background.
    pub occupied: Mask,
    pub pedestal: Option<Pedestal>,
    /// The grain without the pedestal, openings treated.
    pub grain: Mask,
    /// Faint parts of the grain, but for their edge: they may be no farther off the background than its noise, and between them and the
    /// rest the grain can be as bright as it.
    pub held: Option<Mask>,
    /// Area of parts that touch the grain and differ from the background, but show none of it beyond them, so that they were left out;
    /// and of those that were added because the other views hold them. Square pixels.
    pub unsure_px: usize,
    pub held_px: usize,
    /// Whether a hair led from the grain out of the picture.
    pub has_hair: bool,
    pub holes_open: usize,
    pub contrast: f64,
    /// Whether the grain reaches the left, right, top, bottom end of the region.
    pub reaches: [bool; 4],
}

/// Looks at a scene's region in full resolution: what is not background, the pedestal, the grain.
pub(super) fn look(
    picture: &dyn Source,
    frame: &Rect,
    scene: &Scene,
    (settings, known): (&Settings, &Known<'_>),
) -> Result<Seen, SilhouetteError> {
    let mut plane = Plane::of(picture, scene.region, scene.channel, &scene.backdrop, scene.bright_grain);
    despeckle::despeckle(&mut plane, scene.backdrop.noise);
    let histogram = plane.histogram();
    let nothing =
        || SilhouetteError::NoContrast { contrast: 0.0, limit: LEAST_THRESHOLD, noise: scene.backdrop.noise };
    let two = histogram.otsu2().ok_or_else(nothing)?;
    let three = histogram.otsu3();
    // The lower half of the background's distribution: the grain's blur widens only the upper one.
    let quantile = |share: f64| histogram.quantile_below(two.threshold, share);
    let noise = match (quantile(0.5), quantile(0.1587)) {
        (Some(middle), Some(low)) => (middle - low).max(0.3),
        _ => scene.backdrop.noise,
    };
    let clear = LEAST_THRESHOLD.max(CLEAR_SIGMAS * noise);
    let low = three.map_or(two.threshold, |t| t.thresholds[0]);
    let threshold = match settings.classes {
        Classes::Three => low,
        Classes::Auto => histogram.valley(clear, two.threshold).map_or(two.threshold, |q| q.threshold),
        Classes::Two => two.threshold,
    };
    let threshold = known.threshold.map_or(threshold, |joint| joint.clamp(clear, two.threshold.max(clear)));
    // Before a dark background a coded threshold may lie far down in the blur's tail, where no outline is placed from; what
    // is darker is looked for below.
    let low = threshold;
    let threshold = if scene.bright_grain && !scene.channel.is_difference() {
        let behind = scene.backdrop.level_at(&scene.region);
        let [dark, bright] =
            [behind, behind + two.means[1] as f32].map(|v| ToneCurve::Srgb.decode(v.max(0.0)));
        let least = ToneCurve::Srgb.encode(dark + LEAST_LIGHT * (bright - dark)) - behind;
        threshold.max(f64::from(least)).min(two.threshold.max(threshold))
    } else {
        threshold
    };
    let mut smooth = plane.smoothed();
    let limit = (threshold * f64::from(super::plane::PER_LEVEL)).clamp(-32_000.0, 32_000.0) as i16;
    let above = |values: &[i16]| values.iter().map(|&v| u8::from(v > limit)).collect();
    let mut occupied = Mask { width: plane.width, height: plane.height, bits: above(&smooth) };
    // A pedestal may be darker than the blur's tail of what stands on it.
    let low = (low * f64::from(super::plane::PER_LEVEL)).clamp(-32_000.0, 32_000.0) as i16;
    let shown = (low < limit)
        .then(|| Mask { bits: smooth.iter().map(|&v| u8::from(v > low)).collect(), ..occupied.clone() });
    let stands = settings.pedestal == PedestalMode::Auto && plane.rect.y1 == frame.y1;
    let pedestal = match known.pedestal.filter(|_| settings.pedestal == PedestalMode::Auto) {
        Some((outline, off_px)) => {
            let known = Pedestal::of(&outline, [plane.rect.x0, plane.rect.y0]);
            Some(pedestal::near(&plane, &known, off_px, noise))
        }
        None if stands => pedestal::find(shown.as_ref().unwrap_or(&occupied), &plane, noise),
        None => None,
    };
    let all_rows = plane.height;
    if let Some(pedestal) = &pedestal
        && scene.region != *frame
    {
        let top = pedestal.top_at(0.0).max(pedestal.top_at(plane.width as f64)).max(0.0);
        plane.keep_rows(((1.0 + BELOW) * top).ceil() as usize + outline::reach(outline::WIDEST));
        occupied.height = plane.height;
    }
    if let Some(pedestal) = &pedestal {
        pedestal::unmix(&mut plane, pedestal);
        smooth = pedestal::smoothed(&plane, pedestal);
        occupied.bits = above(&smooth);
    }
    let mut grain = occupied.clone();
    if let Some(pedestal) = &pedestal {
        clear_below(&mut grain, pedestal);
    }
    if !scene.bright_grain && !scene.channel.is_difference() {
        let largest = grain.largest();
        let level = mean_level(&plane, &largest);
        let limit = (clear * f64::from(super::plane::PER_LEVEL)) as i16;
        if highlights::darken(&mut plane, picture, &largest, &smooth, limit, level as i16) {
            smooth = pedestal.map_or_else(|| plane.smoothed(), |p| pedestal::smoothed(&plane, &p));
            occupied.bits = above(&smooth);
            grain = occupied.clone();
            if let Some(pedestal) = &pedestal {
                clear_below(&mut grain, pedestal);
            }
        }
    }
    let apart = grain;
    // What stands on the pedestal is the grain, however large another thing in the picture is.
    let mut grain = match &pedestal {
        Some(p) => {
            let resting = RESTING.max(CLEAR_OF_BLUR * p.blur);
            let first = p.clear_above(apart.width, resting);
            apart.largest_that(|x, y| {
                y >= first && p.below_top(x, y).is_some_and(|d| d <= 0.0 && -d <= resting)
            })
        }
        None => apart.largest(),
    };
    let r = &plane.rect;
    let has_hair = hair::cut(&mut grain, [r.x0 == frame.x0, r.x1 == frame.x1, r.y0 == frame.y0]);
    let area = grain.area();
    if (area as f64) < settings.min_area_px {
        return Err(SilhouetteError::TooSmall { area_px: area as f64, limit_px: settings.min_area_px });
    }
    let contrast = mean_level(&plane, &grain) / f64::from(super::plane::PER_LEVEL);
    let clear_rows =
        pedestal.map_or(plane.height, |p| p.clear_above(plane.width, CLEAR_OF_FOOT).max(0.0) as usize);
    let mut held = None;
    let (mut unsure_px, mut held_px) = (0, 0);
    if !scene.channel.is_difference() {
        let open = faint::Open {
            rows: clear_rows,
            at: |x: usize, y: usize| {
                pedestal.is_none_or(|p| p.below_top(x as f64, y as f64).is_none_or(|d| d < -CLEAR_OF_FOOT))
            },
        };
        let [x0, y0] = [plane.rect.x0, plane.rect.y0];
        let by_others = known.held.map(|held| move |x: usize, y: usize| held.holds(x0 + x, y0 + y));
        let added = faint::add(&mut grain, &occupied, &smooth, limit, &open, by_others);
        (unsure_px, held_px) = (added.unsure_px, added.held_px);
        if let Some(other_side) = &added.other_side {
            // There the grain is what the background is not, too.
            let near = other_side.dilated(outline::BAND);
            for (v, _) in plane.values.iter_mut().zip(&near.bits).filter(|(v, near)| **near != 0 && **v < 0) {
                *v = -*v;
            }
        }
        if let Some(parts) = added.parts {
            let (least, sigmas, more) = HALF_SKIRT;
            let of_blur = pedestal.map_or(0, |p| (sigmas * p.blur).ceil() as usize + more);
            let skirt = least.max(of_blur);
            let mut wide = match known.held {
                Some(_) => parts,
                None => parts.eroded(skirt).dilated(skirt),
            };
            if let Some(other_side) = added.other_side {
                wide.add(&other_side);
            }
            let mut within = grain.eroded(WITHIN);
            let near = wide.dilated(outline::BAND);
            within.bits.iter_mut().zip(&near.bits).for_each(|(bit, near)| *bit &= near);
            held = Some(within);
        }
    }
    let plateaus = Plateaus::of(&smooth, plane.width, clear_rows);
    let gap = holes::Background { noise, contrast };
    let open = match settings.holes {
        Holes::Auto => scene.channel.is_difference(),
        Holes::Fill => false,
        Holes::Background => true,
    };
    let holes_open = holes::fill(&mut grain, &plane, open.then_some(&gap));
    let clear = (clear * f64::from(super::plane::PER_LEVEL)) as i16;
    pieces::join(&mut grain, &apart, |k| smooth[k] > clear);
    occupied.bits.iter_mut().zip(&grain.bits).for_each(|(o, g)| *o |= g);
    let (w, h) = (grain.width, grain.height);
    let last = if h < all_rows { h.saturating_sub(outline::reach(outline::WIDEST)) } else { h - 1 };
    let reaches = [
        (0..h).any(|y| grain.get(0, y)),
        (0..h).any(|y| grain.get(w - 1, y)),
        (0..w).any(|x| grain.get(x, 0)),
        grain.bits[last * w..].contains(&1),
    ];
    Ok(Seen {
        plane,
        histogram: histogram.coarser(HISTOGRAM_BINS),
        plateaus,
        noise,
        threshold_two: two.threshold,
        thresholds_three: three.map_or([two.threshold; 2], |t| t.thresholds),
        separability: [two.separability, three.map_or(two.separability, |t| t.separability)],
        threshold,
        occupied,
        pedestal,
        grain,
        held,
        unsure_px,
        held_px,
        has_hair,
        holes_open,
        contrast,
        reaches,
    })
}

/// Mean value of the plane in a mask, in the plane's units.
fn mean_level(plane: &Plane, mask: &Mask) -> f64 {
    let sum: i64 = (plane.values.iter().zip(&mask.bits)).map(|(&v, &b)| i64::from(v) * i64::from(b)).sum();
    sum as f64 / mask.area().max(1) as f64
}

fn clear_below(mask: &mut Mask, pedestal: &Pedestal) {
    let above = pedestal.clear_above(mask.width, 0.0).max(0.0) as usize;
    for (y, row) in mask.bits.chunks_exact_mut(mask.width).enumerate().skip(above) {
        for (x, bit) in row.iter_mut().enumerate().filter(|(_, bit)| **bit != 0) {
            if pedestal.below_top(x as f64, y as f64).is_some_and(|d| d > 0.0) {
                *bit = 0;
            }
        }
    }
}

//! The outline placed about a body in as many rounds as it takes, then cut at the pedestal.

use super::ToneCurve;
use super::edge_fit;
use super::lit::Lit;
use super::look::Seen;
use super::mask::Mask;
use super::outline::{self, OutlineInput};
use super::rect::Rect;
use super::search::Scene;

/// Distances are given at least this far around the outline, pixels, and at least this share of its size.
const MARGIN: (usize, f64) = (12, 0.06);
/// Levels are read this many standard deviations of the edge's blur away from the outline.
const CLEAR_OF_BLUR: f64 = 2.5;
/// No outline is placed fewer standard deviations of the noise off the background.
const CLEAR_OF_NOISE: f64 = 4.0;
/// The outline is placed again about itself when it moved by more than this on average, pixels, in focus and out of focus …
const FAR_PX: [f64; 2] = [0.8, 0.3];
/// … but no more often than this, in focus, and where the blur shows wider or out of focus: a clear grain's rim would draw it further
/// in by a band in each round.
const MOST_ROUNDS: [usize; 2] = [2, 12];
/// The outline of a bright grain lies no more than so many standard deviations of the blur inside the threshold's: a lit facet
/// beside a dim rim would draw it over the rim, by a band in each round.
const MOST_INWARDS: f64 = 2.2;
/// Rounds after that.
const HELD_ROUNDS: usize = 3;
/// How much softer a dark grain's edge is than the pedestal's.
const OF_PEDESTAL: f64 = 1.05;
/// How often a root is drawn of levels beside the outline before they are averaged: grey values, light of a dark grain, light of a bright
/// one, whose facets differ most.
const ROOTS: [u32; 3] = [0, 1, 2];

/// An outline in the rectangle around it.
pub(super) struct PlacedOutline {
    pub field: outline::Field,
    /// The same before the pedestal was cut off, where there is one.
    pub uncut: Option<outline::Field>,
    /// Column and row of the first pixel in the picture.
    pub origin: [usize; 2],
    /// Standard deviation of the outline's blur, pixels.
    pub blur_px: f64,
}

/// Places the outline about a body within a window of the region, of which `whole` matters. `None` where nothing is left of the body, or the window turns out to be too small for it.
pub(super) fn place(
    (scene, seen, curve, lens_px): (&Scene, &Seen, ToneCurve, Option<f64>),
    body: &Mask,
    window: &Rect,
    whole: &Rect,
) -> Option<PlacedOutline> {
    let Seen { plane, occupied, pedestal, .. } = seen;
    // Whether so many pixels around a part of the window are in it too, as far as they matter.
    let holds = |part: &Rect, around: usize| {
        (window.x0 == whole.x0 || part.x0 >= around)
            && (window.y0 == whole.y0 || part.y0 >= around)
            && (window.x1 == whole.x1 || part.x1 + around <= window.width())
            && (window.y1 == whole.y1 || part.y1 + around <= window.height())
    };
    let pedestal = pedestal.map(|p| p.seen_from([window.x0, window.y0]));
    let lit =
        Lit::of(plane.part(window), scene, curve, pedestal, [seen.threshold, CLEAR_OF_NOISE * seen.noise]);
    let smooth = lit.smoothed();
    let Lit { plane, threshold, least_level, is_light, .. } = lit;
    let occupied = occupied.part(window);
    let below_top = |x: f64, y: f64| pedestal.as_ref().and_then(|p| p.below_top(x, y));
    // A row of the window above which all is further than so many pixels above the top.
    let clear_above = |pixels: f64| pedestal.map_or(f64::INFINITY, |p| p.clear_above(plane.width, pixels));
    let mut body = body.part(window);
    let first = body.clone();
    let faint = seen.held.as_ref().map(|parts| parts.part(window));
    let mut held: Option<Mask> = None;
    let roots = ROOTS[usize::from(is_light) + usize::from(is_light && scene.bright_grain)];
    let mut band = outline::BAND;
    let mut rounds = 0;
    let mut blur_px = outline::IN_FOCUS;
    let mut field = loop {
        if !holds(&body.bounds()?, outline::reach(band)) {
            return None;
        }
        let reach = band as f64;
        let clear = clear_above(reach);
        let excluded = |x: usize, y: usize| {
            let (x, y) = (x as f64, y as f64);
            y >= clear && below_top(x, y).is_some_and(|d| d > -reach)
        };
        let mut field = outline::place(
            &plane,
            &OutlineInput {
                body: &body,
                band,
                blur: blur_px,
                smooth: &smooth,
                occupied: &occupied,
                excluded: &excluded,
                threshold,
                least_level,
                roots,
            },
        );
        rounds += 1;
        for held in held.iter().chain(&faint) {
            field.fill(held);
        }
        let placed = field.inside();
        // Out of focus, the levels must be read further away, and half-way may lie beyond the band.
        blur_px = field.blur(placed.edge_length());
        let needed = (CLEAR_OF_BLUR * blur_px).ceil() as usize;
        let wider = needed.clamp(band, outline::WIDEST);
        let far = FAR_PX[usize::from(wider > outline::BAND)];
        let most_rounds = MOST_ROUNDS[usize::from(wider > band || wider > 2 * outline::BAND)];
        if rounds < most_rounds && (wider != band || body.mean_shift(&placed) > far) {
            (band, body) = (wider, placed);
            continue;
        }
        if !scene.bright_grain || held.is_some() {
            break field;
        }
        let most = ((MOST_INWARDS * blur_px).ceil() as usize).max(outline::BAND);
        let inmost = first.eroded(most);
        if !inmost.bits.iter().zip(&placed.bits).any(|(inmost, placed)| inmost & !placed & 1 != 0) {
            break field;
        }
        body = placed;
        body.bits.iter_mut().zip(&inmost.bits).for_each(|(b, inmost)| *b |= inmost);
        (held, rounds) = (Some(inmost), most_rounds.saturating_sub(HELD_ROUNDS));
    };
    // A difference of two colours has no light of its own.
    if !scene.channel.is_difference() {
        let clear = CLEAR_OF_BLUR * blur_px;
        let open = |x: f64, y: f64| below_top(x, y).is_none_or(|d| d < -clear);
        let shown = (blur_px, least_level / CLEAR_OF_NOISE, scene.bright_grain);
        // A dark grain's edge is softer than the pedestal's by its own small unevenness.
        let of_pedestal = || pedestal.map(|p| OF_PEDESTAL * p.blur).filter(|px| *px > 0.0);
        let lens_px = if scene.bright_grain { lens_px } else { of_pedestal() };
        if let Some((fitted, lens_px)) = edge_fit::fitted(&plane, &field, shown, lens_px, open) {
            (field, blur_px) = (fitted, lens_px.hypot(outline::SMOOTHED_PX));
        }
    }
    let uncut = pedestal.is_some().then(|| field.clone());
    if pedestal.is_some() {
        let clear = clear_above(1.0);
        field.cut(|x, y| if y < clear { None } else { below_top(x, y) });
    }
    field.keep_largest();
    let bounds = field.inside().bounds()?;
    let around = margin(&bounds);
    if !holds(&bounds, around) {
        return None;
    }
    let part = bounds.grown(around, &Rect { x0: 0, y0: 0, x1: field.width, y1: field.height });
    let origin = [plane.rect.x0 + part.x0, plane.rect.y0 + part.y0];
    let cropped = |field: &outline::Field| outline::Field {
        width: part.width(),
        height: part.height(),
        values: part.part_of(&field.values, field.width),
    };
    Some(PlacedOutline { field: cropped(&field), uncut: uncut.as_ref().map(cropped), origin, blur_px })
}

/// Pixels around an outline's extent in which distances are given.
pub(super) fn margin(extent: &Rect) -> usize {
    let longer = extent.width().max(extent.height()) - 1;
    MARGIN.0.max((MARGIN.1 * longer as f64) as usize)
}

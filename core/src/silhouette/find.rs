//! Segmentation: the order of the steps from a picture to its silhouette.

use super::frame;
use super::mask::{Connect, Mask};
use super::outline::OutlineInput;
use super::pedestal::{self, Pedestal};
use super::plane::Plane;
use super::rect::Rect;
use super::reduced::Reduced;
use super::report::{PedestalOutline, Report};
use super::search::{Scene, search};
use super::{
    Classes, Histogram, Holes, PedestalMode, Polarity, Settings, Silhouette, SilhouetteError, Source, Uncut,
};
use super::{despeckle, distance, highlights, holes, otsu_area, outline, pieces};

/// A threshold this many standard deviations above the background is clear of its noise.
const CLEAR_SIGMAS: f64 = 6.0;
/// The least threshold, grey levels.
const LEAST_THRESHOLD: f64 = 4.0;
/// Distances are given at least this far around the outline, pixels, and at least this share of its size.
const MARGIN: (usize, f64) = (12, 0.06);
/// Levels are read this many standard deviations of the edge's blur away from the outline.
const CLEAR_OF_BLUR: f64 = 2.5;
/// The outline is placed again about itself when it moved by this share of the band on average …
const FAR: f64 = 0.5;
/// … but no more often than this.
const MOST_ROUNDS: usize = 6;
/// What comes this near (pixels) to the pedestal's top stands on it.
const RESTING: f64 = 6.0;
/// A separability below this is worth a warning.
const WEAK_SEPARABILITY: f64 = 0.7;

/// Bins of the histogram that is kept for a person's eye.
const HISTOGRAM_BINS: usize = 128;

/// The segmentation of one picture: the silhouette, how it was got, and what a recut needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Segmentation {
    /// The outline of the grain.
    pub silhouette: Silhouette,
    /// How it was found.
    pub report: Report,
    /// The outline before the pedestal was cut off, near its top; `None` where none was.
    pub uncut: Option<Uncut>,
    /// Grey levels near the grain, away from the background towards it: what the thresholds were read off.
    pub histogram: Histogram,
    /// Standard deviation of the outline's blur, pixels: lens, pixel and the mean over 3×3 pixels together.
    pub blur_px: f64,
}

/// Finds the grain's outline in a picture.
///
/// `background` is a picture of the empty stage under the same light, where there is one; without it a
/// smooth surface is laid through the background. Only the region that holds the grain is looked at in full
/// resolution: the cost is one partial reading of the picture and a few passes over that region. A [`Picture`](super::Picture)
/// is decoded already; other sources decode no more than is looked at.
///
/// # Errors
/// When the settings make no sense, the background does not fit, or no grain is in view.
pub fn find(
    picture: &dyn Source,
    background: Option<&dyn Source>,
    settings: &Settings,
) -> Result<Segmentation, SilhouetteError> {
    settings.check()?;
    let shape = picture.shape();
    if let Some(empty) = background.map(Source::shape)
        && empty != shape
    {
        return Err(SilhouetteError::BackgroundMismatch { background: empty, picture: shape });
    }
    let (frame, reduced) = if let Some(pixels) = picture.at_hand() {
        let frame = frame::inner(pixels);
        (frame, Reduced::of(picture, &frame)?)
    } else {
        let whole = Rect { x0: 0, y0: 0, x1: shape[0], y1: shape[1] };
        let reduced = Reduced::of(picture, &whole)?;
        if frame::possible(&reduced) {
            // Its lines must be counted.
            return find(&*picture.pixels()?, background, settings);
        }
        (whole, reduced)
    };
    let empty = background.map(|stage| reduced.alike(stage)).transpose()?;
    let mut scene = search(&reduced, empty.as_ref(), &frame, settings)?;
    let mut seen = look(picture, &frame, &scene, settings)?;
    let r = &seen.plane.rect;
    let inside = [r.x0 > frame.x0, r.x1 < frame.x1, r.y0 > frame.y0, r.y1 < frame.y1];
    if seen.reaches.iter().zip(inside).any(|(reaches, inside)| *reaches && inside) {
        // The region was guessed too small on the reduced picture: look at everything.
        scene.region = frame;
        seen = look(picture, &frame, &scene, settings)?;
    }
    finish(picture, &frame, &scene, settings, &seen)
}

/// The pixel-accurate state of affairs in the region.
struct Seen {
    plane: Plane,
    histogram: Histogram,
    smooth: Vec<i16>,
    noise: f64,
    threshold_two: f64,
    thresholds_three: [f64; 2],
    separability: [f64; 2],
    threshold: f64,
    /// All that is not background.
    occupied: Mask,
    pedestal: Option<Pedestal>,
    /// The grain without the pedestal, openings treated.
    grain: Mask,
    holes_open: usize,
    contrast: f64,
    /// Whether the grain reaches the left, right, top, bottom end of the region.
    reaches: [bool; 4],
}

fn look(
    picture: &dyn Source,
    frame: &Rect,
    scene: &Scene,
    settings: &Settings,
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
    let mut smooth = plane.smoothed();
    let limit = (threshold * f64::from(super::plane::PER_LEVEL)).clamp(-32_000.0, 32_000.0) as i16;
    let above = |values: &[i16]| values.iter().map(|&v| u8::from(v > limit)).collect();
    let mut occupied = Mask { width: plane.width, height: plane.height, bits: above(&smooth) };
    let stands = settings.pedestal == PedestalMode::Auto && plane.rect.y1 == frame.y1;
    let pedestal = if stands { pedestal::find(&occupied, &plane, noise) } else { None };
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
    let area = grain.area();
    if (area as f64) < settings.min_area_px {
        return Err(SilhouetteError::TooSmall { area_px: area as f64, limit_px: settings.min_area_px });
    }
    let contrast = mean_level(&plane, &grain) / f64::from(super::plane::PER_LEVEL);
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
    let reaches = [
        (0..h).any(|y| grain.get(0, y)),
        (0..h).any(|y| grain.get(w - 1, y)),
        (0..w).any(|x| grain.get(x, 0)),
        (0..w).any(|x| grain.get(x, h - 1)),
    ];
    Ok(Seen {
        plane,
        histogram: histogram.coarser(HISTOGRAM_BINS),
        smooth,
        noise,
        threshold_two: two.threshold,
        thresholds_three: three.map_or([two.threshold; 2], |t| t.thresholds),
        separability: [two.separability, three.map_or(two.separability, |t| t.separability)],
        threshold,
        occupied,
        pedestal,
        grain,
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

fn finish(
    picture: &dyn Source,
    frame: &Rect,
    scene: &Scene,
    settings: &Settings,
    seen: &Seen,
) -> Result<Segmentation, SilhouetteError> {
    let Seen { plane, occupied, grain, pedestal, .. } = seen;
    // The grain together with the pedestal below it, so that the cut is the only edge between them.
    let mut body = grain.clone();
    if let Some(pedestal) = pedestal {
        let w = body.width;
        let (runs, _) = occupied.components(Connect::Corners);
        let joined = runs.iter().find(|r| grain.bits[r.row * w + r.start..r.row * w + r.end].contains(&1));
        let component = joined.map(|r| r.component);
        let above = pedestal.clear_above(w, 0.0).max(0.0) as usize;
        for run in runs.iter().filter(|r| Some(r.component) == component && r.row >= above) {
            for x in run.start..run.end {
                if pedestal.below_top(x as f64, run.row as f64).is_some_and(|d| d > 0.0) {
                    body.bits[run.row * w + x] = 1;
                }
            }
        }
    }
    // The outline lies near the body: little of the region has to be looked at for it. Of the pedestal, all of which
    // is cut off, no more than is as high as the grain.
    let mut whole = Rect { x0: 0, y0: 0, x1: plane.width, y1: plane.height };
    if let (Some(pedestal), Some(grain)) = (pedestal, grain.bounds()) {
        let [a, b] = [grain.x0, grain.x1].map(|x| pedestal.top_at(x as f64).max(0.0) as usize);
        let depth = grain.height().max(outline::reach(outline::WIDEST)).max(margin(&grain));
        whole.y1 = whole.y1.min(grain.y1.max(a).max(b) + depth);
    }
    let near = body.bounds().map(|b| b.grown(margin(&b) + outline::reach(outline::WIDEST), &whole));
    let placed = (near.and_then(|near| place(seen, &body, &near, &whole)))
        .or_else(|| place(seen, &body, &whole, &whole))
        .ok_or(SilhouetteError::TooSmall { area_px: 0.0, limit_px: settings.min_area_px })?;
    let silhouette = Silhouette {
        picture: [picture.shape()[0], picture.shape()[1]],
        origin: placed.origin,
        size: [placed.field.width, placed.field.height],
        distance_px: distance::signed(&placed.field),
    };
    let mut report = report(frame, scene, seen, &silhouette);
    let clear = pedestal.map_or(f64::INFINITY, |p| p.clear_above(plane.width, 0.0));
    let above =
        |x: f64, y: f64| y < clear || pedestal.is_none_or(|p| p.below_top(x, y).is_none_or(|d| d <= 0.0));
    let otsu = [seen.threshold_two, seen.thresholds_three[0]];
    [report.area_otsu_two_px, report.area_otsu_three_px] =
        otsu.map(|threshold| otsu_area::area_px(plane, &silhouette, threshold, above));
    let shift = |area: f64| (area - report.area_px) / report.outline_length_px.max(1.0);
    report.shift_otsu_two_px = shift(report.area_otsu_two_px);
    report.shift_otsu_three_px = shift(report.area_otsu_three_px);
    let uncut =
        placed.uncut.zip(report.pedestal).map(|(whole, p)| Uncut::of(&whole, placed.origin[1], p.top_row));
    Ok(Segmentation { silhouette, report, uncut, histogram: seen.histogram.clone(), blur_px: placed.blur_px })
}

/// An outline in the rectangle around it.
struct PlacedOutline {
    field: outline::Field,
    /// The same before the pedestal was cut off, where there is one.
    uncut: Option<outline::Field>,
    /// Column and row of the first pixel in the picture.
    origin: [usize; 2],
    /// Standard deviation of the outline's blur, pixels.
    blur_px: f64,
}

/// Places the outline about a body within a window of the region, of which `whole` matters. `None` where nothing is left of the body, or the window turns out to be too small for it.
fn place(seen: &Seen, body: &Mask, window: &Rect, whole: &Rect) -> Option<PlacedOutline> {
    let Seen { plane, occupied, pedestal, .. } = seen;
    // Whether so many pixels around a part of the window are in it too, as far as they matter.
    let holds = |part: &Rect, around: usize| {
        (window.x0 == whole.x0 || part.x0 >= around)
            && (window.y0 == whole.y0 || part.y0 >= around)
            && (window.x1 == whole.x1 || part.x1 + around <= window.width())
            && (window.y1 == whole.y1 || part.y1 + around <= window.height())
    };
    let below_top = |x: f64, y: f64| {
        pedestal.as_ref().and_then(|p| p.below_top(x + window.x0 as f64, y + window.y0 as f64))
    };
    // A row of the window above which all is further than so many pixels above the top.
    let clear_above = |pixels: f64| {
        pedestal.map_or(f64::INFINITY, |p| p.clear_above(plane.width, pixels)) - window.y0 as f64
    };
    let smooth = window.part_of(&seen.smooth, plane.width);
    let (plane, occupied) = (plane.part(window), occupied.part(window));
    let mut body = body.part(window);
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
        let field = outline::place(
            &plane,
            &OutlineInput {
                body: &body,
                band,
                blur: blur_px,
                smooth: &smooth,
                occupied: &occupied,
                excluded: &excluded,
                threshold: seen.threshold,
                least_level: 4.0 * seen.noise,
            },
        );
        rounds += 1;
        let placed = field.inside();
        // Out of focus, the levels must be read further away, and half-way may lie beyond the band.
        blur_px = field.blur(placed.edge_length());
        let needed = (CLEAR_OF_BLUR * blur_px).ceil() as usize;
        let wider = needed.clamp(band, outline::WIDEST);
        if rounds == MOST_ROUNDS || (wider == band && body.mean_shift(&placed) <= FAR * band as f64) {
            break field;
        }
        (band, body) = (wider, placed);
    };
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
fn margin(extent: &Rect) -> usize {
    let longer = extent.width().max(extent.height()) - 1;
    MARGIN.0.max((MARGIN.1 * longer as f64) as usize)
}

fn report(frame: &Rect, scene: &Scene, seen: &Seen, silhouette: &Silhouette) -> Report {
    let r = &seen.plane.rect;
    let at_end = [r.x0 == frame.x0, r.x1 == frame.x1, r.y0 == frame.y0, r.y1 == frame.y1];
    let touches_border = std::array::from_fn(|k| seen.reaches[k] && at_end[k]);
    let mut warnings = Vec::new();
    if seen.separability[0].max(seen.separability[1]) < WEAK_SEPARABILITY {
        warnings.push(format!(
            "grain and background overlap: Otsu's separability is {:.2} where {WEAK_SEPARABILITY} is usual; \
             check light and focus",
            seen.separability[0].max(seen.separability[1])
        ));
    }
    if seen.pedestal.is_some_and(|p| !p.top_seen) {
        warnings.push(
            "the pedestal's top does not show: the grain is cut where the pedestal's sides end; more light from the \
             front would show it"
                .into(),
        );
    }
    let pedestal = seen.pedestal.map(|p| {
        let (centre, half_width) = p.centre();
        PedestalOutline {
            top_row: r.y0 as f64 + p.top_at(centre),
            top_slope: p.top[1],
            centre_column: r.x0 as f64 + centre,
            half_width,
            top_seen: p.top_seen,
            blur: p.blur,
        }
    });
    Report {
        channel: scene.channel,
        polarity: if scene.bright_grain { Polarity::DarkBackground } else { Polarity::BrightBackground },
        threshold_two: seen.threshold_two,
        thresholds_three: seen.thresholds_three,
        threshold_used: seen.threshold,
        separability_two: seen.separability[0],
        separability_three: seen.separability[1],
        contrast: seen.contrast,
        noise: seen.noise,
        area_px: silhouette.area_px(),
        outline_length_px: silhouette.length_px(),
        area_otsu_two_px: 0.0,
        area_otsu_three_px: 0.0,
        shift_otsu_two_px: 0.0,
        shift_otsu_three_px: 0.0,
        holes_open: seen.holes_open,
        frame: [frame.x0, frame.y0, frame.x1, frame.y1],
        contact_width_px: pedestal.map(|p| silhouette.width_above(&p)),
        pedestal,
        touches_border,
        warnings,
    }
}

//! What is told of a picture: silhouette, report, what a recut needs.

use super::lit::Lit;
use super::look::Seen;
use super::mask::Connect;
use super::pedestal;
use super::place::{margin, place};
use super::rect::Rect;
use super::search::Scene;
use super::{
    PedestalOutline, Polarity, Report, Segmentation, Settings, Silhouette, SilhouetteError, SmallCopy, Source,
};
use super::{ToneCurve, ToneSource, Uncut, distance, otsu_area, outline};

/// A separability below this is worth a warning.
const WEAK_SEPARABILITY: f64 = 0.7;
/// The lens's blur is sought this far beside the pedestal, pixels, and is so much at least.
const SIDE_PX: f64 = 40.0;
const LEAST_BLUR_PX: f64 = 0.8;

/// Places the outline by a tone curve, and states how.
pub(super) fn finish(
    picture: &dyn Source,
    frame: &Rect,
    scene: &Scene,
    settings: &Settings,
    (seen, curve, from): (&Seen, ToneCurve, ToneSource),
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
    // The outline lies near the body: little of the region has to be looked at for it, and of the pedestal, all of which is cut
    // off, no more than the outline of what stands on it needs.
    let mut whole = Rect { x0: 0, y0: 0, x1: plane.width, y1: plane.height };
    if let (Some(pedestal), Some(grain)) = (pedestal, grain.bounds()) {
        let [a, b] = [grain.x0, grain.x1].map(|x| pedestal.top_at(x as f64).max(0.0) as usize);
        let around = margin(&grain) + 2 * outline::reach(outline::WIDEST);
        let beside = grain.grown(around, &whole);
        (whole.x0, whole.x1) = (beside.x0, beside.x1);
        whole.y1 = whole.y1.min(grain.y1.max(a).max(b) + around);
    }
    let near = body.bounds().map(|b| b.grown(margin(&b) + outline::reach(outline::WIDEST), &whole));
    let lens_px = lens_px(scene, seen, curve);
    let lit = (scene, seen, curve, lens_px);
    let placed = (near.and_then(|near| place(lit, &body, &near, &whole)))
        .or_else(|| place(lit, &body, &whole, &whole))
        .ok_or(SilhouetteError::TooSmall { area_px: 0.0, limit_px: settings.min_area_px })?;
    let silhouette = Silhouette {
        picture: [picture.shape()[0], picture.shape()[1]],
        origin: placed.origin,
        size: [placed.field.width, placed.field.height],
        distance_px: distance::signed(&placed.field),
    };
    let mut report = report(frame, scene, (seen, curve, from), &silhouette);
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
    Ok(Segmentation {
        silhouette,
        report,
        uncut,
        histogram: seen.histogram.clone(),
        plateaus: seen.plateaus.clone(),
        blur_px: placed.blur_px,
        lens_px,
        symmetry: None,
        tail: None,
        rims: Vec::new(),
        unsure_px: seen.unsure_px,
        small: SmallCopy::default(),
    })
}

/// Standard deviation of the lens's blur, pixels, where the pedestal's sides show it. A difference of two colours has no light of its own.
fn lens_px(scene: &Scene, seen: &Seen, curve: ToneCurve) -> Option<f64> {
    let Seen { plane, pedestal, noise, threshold, .. } = seen;
    let pedestal = pedestal.filter(|_| !scene.channel.is_difference())?;
    let (centre, half) = pedestal.centre();
    let top = pedestal.top_at(centre).max(0.0) as usize;
    let reach = half + SIDE_PX;
    let strip = Rect {
        x0: (centre - reach).max(0.0) as usize,
        x1: ((centre + reach).max(0.0) as usize).min(plane.width),
        y0: top.min(plane.height),
        y1: plane.height,
    };
    if strip.x0 >= strip.x1 || strip.y0 >= strip.y1 {
        return None;
    }
    let pedestal = pedestal.seen_from([strip.x0, strip.y0]);
    let lit = Lit::of(plane.part(&strip), scene, curve, None, [*threshold, *noise]);
    pedestal::lens_blur_px(&lit.plane, &pedestal, lit.least_level, pedestal.blur.max(LEAST_BLUR_PX))
}

fn report(
    frame: &Rect,
    scene: &Scene,
    (seen, curve, from): (&Seen, ToneCurve, ToneSource),
    silhouette: &Silhouette,
) -> Report {
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
    if seen.has_hair {
        warnings.push(
            "a hair or fibre leads from the grain out of the picture: it is cut off; take it away and look at the outline".into(),
        );
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
            slope_seen: p.slope_seen,
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
        tone_curve: curve,
        tone_curve_from: from,
        rim_px: 0.0,
        held_px: seen.held_px as f64,
        frame: [frame.x0, frame.y0, frame.x1, frame.y1],
        contact_width_px: pedestal.map(|p| silhouette.width_above(&p)),
        pedestal,
        touches_border,
        warnings,
    }
}

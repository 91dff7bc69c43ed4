//! The verdict on a whole result: whether hull and volume can be relied on, and why not.
//!
//! A view can be good by itself and the hull wrong: silhouettes of which parts were cut away, cameras that do not fit. What
//! shows it is how the views agree: the hull, seen again, fills each silhouette but for a strip that is thin beside the
//! outline's own error, and no view carves away alone what none beside it does.

use super::SegmentedView;
use super::result::ViewResult;
use crate::session::event::Role;
use grainrig_core::silhouette::{Report, ToneSource, Verdict};
use serde::Serialize;

/// Mean width of the strips that the hull leaves of the silhouettes, pixels, and of the widest view's, from which on a
/// result is doubtful, and bad …
const GAP_PX: [f64; 2] = [0.5, 2.5];
const WIDEST_GAP_PX: [f64; 2] = [1.5, 6.0];
/// … but no less than this share of the grain's diameter: cameras are known to a share, too.
const GAP_SHARE: [f64; 2] = [0.0018, 0.012];
/// What a view alone may carve away of the hull (a hollow that only one view looks through takes up to 1.6 %; of a grain that light
/// passes through it is rather a bite out of the outline), and how many times what the views do in the middle.
const ALONE_SHARE: [f64; 2] = [0.018, 0.03];
const ALONE_CLEAR: f64 = 0.01;
const ALONE_TIMES: f64 = 4.0;
/// Share of bad views that makes a result bad; one makes it doubtful.
const BAD_VIEWS: f64 = 0.2;
/// What an outline that is not known better than this may make of the volume before it is worth a doubt: for the tone curve, and for a
/// rim, which differs along the outline, while the hull is what the outlines furthest in leave.
const VOLUME_SHARE: f64 = 0.01;
const RIM_SHARE: f64 = 0.005;
/// A rim's width is known to this share, and where nobody says how grey values code light an edge is off by about half of
/// the blur of a lens in focus, pixels.
const RIM_KNOWN: f64 = 0.4;
const TONE_KNOWN_PX: f64 = 0.4;

/// Whether a result can be relied on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResultVerdict {
    /// The worst of the reasons' verdicts.
    pub verdict: Verdict,
    /// Why it is not good, in words: figure, limit and what to do; none where it is.
    pub reasons: Vec<String>,
}

/// Uncertainty of all outlines together beyond what they always have, pixels (one standard deviation).
pub(super) fn outline_px(segmented: &[SegmentedView], ious: &[f64]) -> f64 {
    let reports: Vec<&Report> =
        segmented.iter().filter(|t| t.role == Role::Grain).map(|t| &t.found.report).collect();
    let gaps = reports.iter().zip(ious).map(|(report, iou)| gap_px(report, *iou)).sum::<f64>();
    let gap = gaps / reports.len().max(1) as f64;
    let [rim, tone] = unsure_px(&reports);
    [0.5 * gap, rim, tone].iter().map(|px| px * px).sum::<f64>().sqrt()
}

/// What the rim and the tone curve leave unsure, pixels.
fn unsure_px(reports: &[&Report]) -> [f64; 2] {
    let n = reports.len().max(1) as f64;
    let rim = reports.iter().map(|report| RIM_KNOWN * report.rim_px).sum::<f64>() / n;
    let tone = reports.iter().filter(|report| report.tone_curve_from == ToneSource::Custom).count();
    [rim, TONE_KNOWN_PX * tone as f64 / n]
}

/// The mean width of what the hull, seen again, leaves of a view's silhouette, pixels.
fn gap_px(report: &Report, iou: f64) -> f64 {
    (1.0 - iou) * report.area_px / report.outline_length_px.max(1.0)
}

/// The verdict; `calibration` has the findings about the rig.
pub(super) fn verdict(views: &[ViewResult], calibration: &[String]) -> ResultVerdict {
    let mut reasons: Vec<(Verdict, String)> = Vec::new();
    let n = views.len().max(1) as f64;
    let area_px = views.iter().map(|v| v.silhouette.area_px).sum::<f64>() / n;
    let diameter_px = (4.0 * area_px / std::f64::consts::PI).sqrt().max(1.0);

    let gaps_px: Vec<f64> = views.iter().map(|v| gap_px(&v.silhouette, v.iou)).collect();
    let mean_gap = gaps_px.iter().sum::<f64>() / n;
    let widest = gaps_px.iter().zip(views).max_by(|a, b| a.0.total_cmp(b.0));
    let limits = |px: [f64; 2]| [0, 1].map(|k| px[k].max(GAP_SHARE[k] * diameter_px));
    if let Some(verdict) = beyond(mean_gap, limits(GAP_PX)) {
        reasons.push((
            verdict,
            format!(
                "the hull, seen again, leaves a strip of {mean_gap:.1} px of the silhouettes (usual: below {:.1} px): some \
                 silhouettes are too small, or angles or the camera's distance are wrong; look at the outlines",
                limits(GAP_PX)[0]
            ),
        ));
    }
    if let Some((gap, view)) = widest
        && let Some(verdict) = beyond(*gap, limits(WIDEST_GAP_PX))
    {
        reasons.push((
            verdict,
            format!(
                "of the silhouette of view {} the hull leaves a strip of {gap:.1} px (usual: below {:.1} px): something \
                 hangs into that view, or another view is too small there",
                view.index,
                limits(WIDEST_GAP_PX)[0]
            ),
        ));
    }
    let mut alone: Vec<f64> = views.iter().map(|v| v.carved_alone.share).collect();
    alone.sort_by(f64::total_cmp);
    let usual = alone.get(alone.len() / 2).copied().unwrap_or(0.0);
    let is_clear = views.iter().any(|v| v.silhouette.rim_px > 0.0);
    let alone_share = [if is_clear { ALONE_CLEAR } else { ALONE_SHARE[0] }, ALONE_SHARE[1]];
    for view in views {
        let share = view.carved_alone.share;
        let limits = alone_share.map(|limit| limit.max(ALONE_TIMES * usual));
        if let Some(verdict) = beyond(share, limits) {
            reasons.push((
                verdict,
                format!(
                    "view {} alone carves {:.1} % of the hull away, {:.1} px deep (the views in the middle {:.2} %): look at \
                     its outline, take it again or leave it out",
                    view.index,
                    100.0 * share,
                    view.carved_alone.depth_px,
                    100.0 * usual
                ),
            ));
        }
    }
    let bad: Vec<usize> = (views.iter())
        .filter(|v| v.quality.as_ref().is_some_and(|q| q.verdict == Verdict::Bad))
        .map(|v| v.index)
        .collect();
    if !bad.is_empty() {
        let verdict = if bad.len() as f64 > BAD_VIEWS * n { Verdict::Bad } else { Verdict::Doubtful };
        let names: Vec<String> = bad.iter().map(ToString::to_string).collect();
        reasons.push((
            verdict,
            format!("{} of {} views are bad ({}): take them again", bad.len(), views.len(), names.join(", ")),
        ));
    }
    let [rim, tone] = unsure_px(&views.iter().map(|v| &v.silhouette).collect::<Vec<_>>());
    let worth = |px: f64| 6.0 * px / diameter_px;
    if worth(rim) > RIM_SHARE {
        reasons.push((
            Verdict::Doubtful,
            format!(
                "the grain's rim mirrors the background, so that the outline was moved {:.1} px outwards: known to {:.1} % of \
                 the volume",
                rim / RIM_KNOWN,
                100.0 * worth(rim)
            ),
        ));
    }
    if worth(tone) > VOLUME_SHARE {
        reasons.push((
            Verdict::Doubtful,
            format!(
                "the files do not say how grey values code light, and the edges do not show it: worth {:.1} % of the volume; \
                 set silhouette.tone_curve",
                100.0 * worth(tone)
            ),
        ));
    }
    reasons.extend(calibration.iter().map(|finding| (Verdict::Doubtful, finding.clone())));
    ResultVerdict {
        verdict: reasons.iter().map(|r| r.0).max().unwrap_or(Verdict::Good),
        reasons: reasons.into_iter().map(|r| r.1).collect(),
    }
}

/// Doubtful beyond the first limit, bad beyond the second.
fn beyond(value: f64, limits: [f64; 2]) -> Option<Verdict> {
    match value {
        v if v > limits[1] => Some(Verdict::Bad),
        v if v > limits[0] => Some(Verdict::Doubtful),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_doubtful_beyond_its_first_limit_and_bad_beyond_its_second() {
        assert_eq!(beyond(0.4, GAP_PX), None);
        assert_eq!(beyond(1.0, GAP_PX), Some(Verdict::Doubtful));
        assert_eq!(beyond(8.4, GAP_PX), Some(Verdict::Bad));
        assert_eq!(verdict(&[], &[]), ResultVerdict { verdict: Verdict::Good, reasons: Vec::new() });
        let found = verdict(&[], &["slipped".into()]);
        assert_eq!((found.verdict, found.reasons), (Verdict::Doubtful, vec!["slipped".to_owned()]));
    }
}

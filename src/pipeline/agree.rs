//! One decision for all views: the grain, the pedestal and the light are the same in each, and so is what they are cut by.
//!
//! Each view is cut out as it comes, by what it shows itself. When all are in, they are asked together: which channel, which
//! polarity, which tone curve, which threshold, where the pedestal stands. A view that was cut otherwise is cut again.

use super::{Pipeline, PipelineError, SegmentedView};
use grainrig_core::silhouette::{
    EdgeSymmetry, EdgeTail, Histogram, Known, PedestalMode, PedestalOutline, Segmentation, Settings,
    SmallCopy, ToneCurve, ToneSource, joint_threshold, pedestal_consensus, standing_pedestal,
};
use rayon::prelude::*;
use tracing::debug;

/// Times that the views are asked: a pedestal that is known better may change what the edges say.
const ROUNDS: usize = 2;
/// A view is cut again where as much as this share of the grain's pixels lies between its threshold and that of all views, beside what lies
/// on blurred edges.
const BETWEEN: f64 = 5e-4;
/// The pedestal that single views found is believed where this share of them agrees on it, or where the still one is there too.
const MOST: f64 = 0.6;
/// A threshold is this many standard deviations of the noise off the background, and at least so many grey levels.
const CLEAR: (f64, f64) = (6.0, 4.0);
/// A view softer than this, pixels, shows its pedestal wider than it is, and is cut by what it shows itself.
const SOFT_PX: f64 = 2.5;
/// The light differs in a view whose background differs from the other views' by so much, as a share and grey levels: it is cut by what
/// it shows itself, too.
const OTHER_LIGHT: (f64, f64) = (0.08, 6.0);
/// A pedestal of single views is known to so many pixels.
const KNOWN_PX: f64 = 2.0;

impl Pipeline {
    /// Lets the views decide together what each is cut by, and cuts those again that were cut otherwise. The decision.
    pub(super) fn agree(&self, segmented: &mut [SegmentedView]) -> Result<Decision, PipelineError> {
        let mut decision = self.decide(segmented);
        for round in 0..ROUNDS {
            let again: Vec<bool> = segmented.iter().map(|view| decision.differs(&view.found)).collect();
            if !again.contains(&true) {
                break;
            }
            debug!(round, views = again.iter().filter(|a| **a).count(), "cut again");
            (segmented.par_iter_mut().zip(again)).filter(|(_, again)| *again).try_for_each(|(view, _)| {
                let (settings, known) = decision.for_view(&view.found);
                let mut one = self.segment_with(view.index, &view.bytes, &settings, &known)?;
                one.take_decision(&decision);
                view.replace(one);
                Ok::<(), PipelineError>(())
            })?;
            decision = self.decide(segmented);
        }
        Ok(decision)
    }

    /// What the views say together.
    fn decide(&self, segmented: &[SegmentedView]) -> Decision {
        let found: Vec<&Segmentation> = segmented.iter().map(|view| &view.found).collect();
        let mut settings = self.settings.silhouette.clone();
        if let Some(channel) = most(found.iter().map(|f| f.report.channel)) {
            settings.channel = channel;
        }
        if let Some(polarity) = most(found.iter().map(|f| f.report.polarity)) {
            settings.polarity = polarity;
        }
        let mut symmetry: Option<EdgeSymmetry> = None;
        for one in found.iter().filter_map(|f| f.symmetry.as_ref()) {
            match &mut symmetry {
                Some(all) => all.add(one),
                None => symmetry = Some(one.clone()),
            }
        }
        let shown = symmetry.as_ref().map(EdgeSymmetry::curve);
        if let Some(curve) = shown {
            settings.tone_curve = curve.unwrap_or(ToneCurve::Srgb);
        }
        let from = shown.map(|curve| if curve.is_some() { ToneSource::Edges } else { ToneSource::Custom });
        let is_turning = matches!(self.cameras, super::Cameras::Turntable(_));
        let alike = || {
            found
                .iter()
                .filter(|f| f.report.channel == settings.channel && f.report.polarity == settings.polarity)
        };
        let histograms: Vec<&Histogram> = alike().map(|f| &f.histogram).collect();
        let noise = alike().map(|f| f.report.noise).sum::<f64>() / histograms.len().max(1) as f64;
        let threshold = (is_turning && histograms.len() > 2)
            .then(|| joint_threshold(&histograms, CLEAR.1.max(CLEAR.0 * noise)))
            .flatten();
        let pedestal =
            (is_turning && settings.pedestal == PedestalMode::Auto).then(|| pedestal(&found)).flatten();
        let mut levels: Vec<f64> = found.iter().map(|f| f.small.middle_level()).collect();
        levels.sort_by(f64::total_cmp);
        let background = levels.get(levels.len() / 2).copied().unwrap_or(0.0);
        Decision { settings, from, threshold, pedestal, background }
    }
}

/// Moves all outlines out to the edge of a rim that mirrors the background; how far, pixels.
pub(super) fn take_rim(segmented: &mut [SegmentedView]) -> f64 {
    let tails: Vec<EdgeTail> = segmented.iter().filter_map(|view| view.found.tail).collect();
    let rim_px = EdgeTail::middle(&tails).map_or(0.0, |tail| tail.rim_px());
    if rim_px > 0.0 {
        segmented.par_iter_mut().for_each(|view| {
            view.found.grow(rim_px);
            view.take_outline();
        });
    }
    rim_px
}

/// What all views are cut by.
pub(super) struct Decision {
    settings: Settings,
    /// Where the tone curve was taken from, where the views were asked.
    pub(super) from: Option<ToneSource>,
    threshold: Option<f64>,
    /// The pedestal and by how many pixels it may be off.
    pedestal: Option<(PedestalOutline, f64)>,
    /// Grey level of the background.
    background: f64,
}

impl Decision {
    /// Whether a view shows thresholds and edges otherwise than the others do: out of focus, or in another light.
    pub(super) fn is_unlike(&self, found: &Segmentation) -> bool {
        let off = (found.small.middle_level() - self.background).abs();
        found.blur_px > SOFT_PX || off > OTHER_LIGHT.1.max(OTHER_LIGHT.0 * self.background)
    }

    /// Whether a view was cut by something else.
    fn differs(&self, found: &Segmentation) -> bool {
        let report = &found.report;
        if report.channel != self.settings.channel || report.polarity != self.settings.polarity {
            return true;
        }
        if self.from.is_some() && report.tone_curve != self.settings.tone_curve {
            return true;
        }
        if self.is_unlike(found) {
            return false;
        }
        let other_threshold = self.threshold.is_some_and(|joint| {
            let [low, high] = [joint.min(report.threshold_used), joint.max(report.threshold_used)];
            found.plateaus.between_px(low, high) as f64 > BETWEEN * report.area_px
        });
        let other_pedestal = self.pedestal.is_some_and(|(known, off)| {
            report.pedestal.is_none_or(|own| !own.top_seen || !are_near(&own, &known, off + 1.0))
        });
        other_threshold || other_pedestal
    }

    /// The settings and the knowledge that a view is cut again with.
    pub(super) fn for_view(&self, found: &Segmentation) -> (Settings, Known<'static>) {
        let mut settings = self.settings.clone();
        if self.from.is_none() {
            // As the file or a person says.
            settings.tone_curve = found.report.tone_curve;
        }
        let known = Known { threshold: self.threshold, pedestal: self.pedestal, held: None };
        (settings, if self.is_unlike(found) { Known::default() } else { known })
    }
}

/// The pedestal of all views and by how many pixels it may be off: the one that stands still, or that single views found
/// alike.
fn pedestal(found: &[&Segmentation]) -> Option<(PedestalOutline, f64)> {
    let copies: Vec<&SmallCopy> = found.iter().map(|f| &f.small).collect();
    let standing = standing_pedestal(&copies);
    let seen: Vec<Option<PedestalOutline>> = found.iter().map(|f| f.report.pedestal).collect();
    let consensus = pedestal_consensus(&seen).map(|c| (c.seen_by(None), c.views));
    let off = 2.0 * copies.first()?.pixels_per_cell() + 1.0;
    match (standing, consensus) {
        (Some(standing), Some((joint, _))) if are_near(&standing, &joint, off) => Some((joint, KNOWN_PX)),
        (_, Some((joint, views))) if views as f64 >= MOST * found.len() as f64 => Some((joint, KNOWN_PX)),
        (Some(standing), _) => Some((standing, off)),
        (None, _) => None,
    }
}

fn are_near(a: &PedestalOutline, b: &PedestalOutline, px: f64) -> bool {
    let tops = a.top_row + a.top_slope * (b.centre_column - a.centre_column) - b.top_row;
    [tops, a.centre_column - b.centre_column, a.half_width - b.half_width].iter().all(|d| d.abs() <= px)
}

/// The value that most have, the first of those that are as frequent.
fn most<T: PartialEq + Copy>(values: impl Iterator<Item = T>) -> Option<T> {
    let mut counts: Vec<(T, usize)> = Vec::new();
    for value in values {
        match counts.iter_mut().find(|(v, _)| *v == value) {
            Some((_, n)) => *n += 1,
            None => counts.push((value, 1)),
        }
    }
    let greatest = counts.iter().map(|(_, n)| *n).max()?;
    counts.into_iter().find(|(_, n)| *n == greatest).map(|(v, _)| v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_most_say_counts_and_of_equals_the_first() {
        assert_eq!(most([1, 2, 2, 3].into_iter()), Some(2));
        assert_eq!(most([3, 1, 1, 3].into_iter()), Some(3));
        assert_eq!(most(std::iter::empty::<u8>()), None);
    }
}

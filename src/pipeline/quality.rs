//! The quality of views on their way through the pipeline: each by itself, then all against each other; and the gate
//! that an acquisition sends its pictures through.

use super::reconstruct::SegmentedView;
use super::stream::SegmentedPicture;
use super::{Cameras, Observer, Pipeline, PipelineError, View};
use crate::session::event::EventKind;
use grainrig_core::geometry::Angle;
use grainrig_core::silhouette::{Check, Traits, Verdict, ViewQuality, ViewTraits, against, between};

/// Sentences about single views in a result, at most; the views' own checks have them all.
const MOST_WARNINGS: usize = 12;

/// The views with their figures and, before a turntable, their angles.
fn placed<'a>(cameras: &Cameras, segmented: &'a [SegmentedView]) -> Vec<(usize, ViewTraits<'a>)> {
    let turns = matches!(cameras, Cameras::Turntable(_));
    (segmented.iter().enumerate())
        .filter_map(|(k, t)| {
            let angle_deg = turns.then(|| t.angle.deg());
            Some((k, ViewTraits { index: t.index, angle_deg, traits: t.traits.as_ref()? }))
        })
        .collect()
}

/// Judges all views against each other and adds what comes out to each one's quality; tells of each view that does
/// not fit, and returns what the result should say.
pub(super) fn compare(
    cameras: &Cameras,
    segmented: &mut [SegmentedView],
    observer: &Observer,
) -> Vec<String> {
    let (places, views): (Vec<usize>, Vec<ViewTraits>) = placed(cameras, segmented).into_iter().unzip();
    let checks = between(&views);
    for (k, checks) in places.into_iter().zip(checks) {
        let view = &mut segmented[k];
        let Some(quality) = &mut view.quality else { continue };
        let warnings: Vec<String> =
            checks.iter().filter(|c| c.verdict != Verdict::Good).map(Check::sentence).collect();
        quality.add(checks);
        if !warnings.is_empty() {
            observer(EventKind::Judged { view: view.index, verdict: quality.verdict, warnings });
        }
    }
    let mut told: Vec<String> = (segmented.iter())
        .flat_map(|t| {
            let warnings = t.quality.iter().flat_map(ViewQuality::warnings);
            warnings.map(|w| format!("view {}: {w}", t.index)).collect::<Vec<_>>()
        })
        .collect();
    let more = told.len().saturating_sub(MOST_WARNINGS);
    if more > 0 {
        told.truncate(MOST_WARNINGS);
        told.push(format!("and {more} more about single views: see each view's quality.checks"));
    }
    told
}

/// Looks at pictures as they come from the camera and says which must be taken again.
///
/// What it works out (decoded, cut out) is kept for the pipeline, so that nothing is computed twice.
pub struct Gate<'a> {
    pipeline: &'a Pipeline,
    /// Views that have passed: index, angle in degrees, figures.
    passed: Vec<(usize, f64, Traits)>,
}

impl<'a> Gate<'a> {
    /// A gate before a pipeline; nothing has passed it yet.
    pub fn new(pipeline: &'a Pipeline) -> Self {
        Self { pipeline, passed: Vec::new() }
    }

    /// Looks at a picture that is not kept yet. The angle is the one that the journal will have. What it works out is
    /// for [`Gate::pass`], should the picture be kept.
    ///
    /// # Errors
    /// Why it must be taken again, with value, unit, limit and remedy: no grain is found, or a check is bad.
    pub fn examine(&self, index: usize, reached: Angle, bytes: &[u8]) -> Result<SegmentedPicture, String> {
        let segmented = self.pipeline.segment(index, bytes).map_err(|error| cause(&error))?;
        let turns = matches!(self.pipeline.cameras, Cameras::Turntable(_));
        let angle = |deg: f64| turns.then_some(deg);
        let earlier: Vec<ViewTraits> = (self.passed.iter())
            .map(|(index, deg, traits)| ViewTraits { index: *index, angle_deg: angle(*deg), traits })
            .collect();
        let own = segmented.quality().into_iter().flat_map(|q| q.checks.iter().cloned());
        let beside = segmented.traits().into_iter().flat_map(|traits| {
            let here = ViewTraits { index, angle_deg: angle(reached.deg()), traits };
            against(&earlier, &here)
        });
        let bad: Vec<String> =
            own.chain(beside).filter(|c| c.verdict == Verdict::Bad).map(|c| c.sentence()).collect();
        if !bad.is_empty() {
            return Err(bad.join("; "));
        }
        Ok(segmented)
    }

    /// The picture of this view is kept: later ones are compared with it. Returns the view for the pipeline, with
    /// what [`Gate::examine`] worked out about the same bytes.
    pub fn pass(&mut self, view: View, segmented: SegmentedPicture) -> View {
        let (index, angle) = view.place();
        self.passed.extend(segmented.traits().map(|t| (index, angle.deg(), t.clone())));
        view.with(segmented)
    }

    /// Lets a picture through that an earlier run has kept, whatever it is like.
    pub fn pass_recorded(&mut self, view: View) -> View {
        // What is wrong with it the pipeline says.
        match self.pipeline.segment(view.place().0, view.bytes()) {
            Ok(segmented) => self.pass(view, segmented),
            Err(_) => view,
        }
    }
}

/// An error of the pipeline without the view's name, which whoever reads it knows.
fn cause(error: &PipelineError) -> String {
    match error {
        PipelineError::View { fault, .. } => fault.to_string(),
        other => other.to_string(),
    }
}

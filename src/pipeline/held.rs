//! Views that may have left out a part of the grain are cut again with what the other views hold.
//!
//! A lit or clear grain can be as bright as the background along a part of its edge, and then a view by itself cannot tell it from a
//! reflection beside the grain. The hull of the others can: what lies within it and differs from the background is the grain. A view may have left
//! out a part where it says so itself, where its area is less than those of the views beside it, or where the grain is clear or glossy.

use super::agree::Decision;
use super::cameras::cameras_of;
use super::{Cameras, Pipeline, SegmentedView};
use crate::session::event::Role;
use grainrig_core::hull::{Cone, find_bounds, held_by_others};
use grainrig_core::silhouette::{HeldByOthers, Known, PedestalConsensus, Polarity, Silhouette};
use rayon::prelude::*;
use std::sync::Arc;
use tracing::debug;

/// Times that it is done: what is set right in one view may be needed by those beside it.
const ROUNDS: usize = 2;
/// So many of the other views may have lost the part, too: shade falls alike on views that are beside one another. What is held too much the
/// others carve away.
const BUT: usize = 3;
/// An area that is less than the mean of those this many views to either side by this share may have lost something: before a bright
/// background, where a body's own area seldom bends by more, and before a dark one, where shade takes parts from many views.
const BRIGHT: (&[usize], f64) = (&[1], 0.015);
const DARK: (&[usize], f64) = (&[1, 2], 0.006);
/// A cut that is greater by this share of its area takes the other's place.
const MORE: f64 = 1e-3;
/// A cut that is outside of what the others hold by this share of its area has found something else.
const ELSEWHERE: f64 = 0.01;

impl Pipeline {
    /// Cuts the unsure views again. They are moved by `rim_px` as the others were. Views with cameras of their own stay as they are: they need
    /// not be beside one another, and few of them may see a part.
    pub(super) fn hold(
        &self,
        segmented: &mut [SegmentedView],
        (decision, consensus, rim_px): (&Decision, Option<&PedestalConsensus>, f64),
    ) {
        if !matches!(self.cameras, Cameras::Turntable(_)) {
            return;
        }
        for round in 0..ROUNDS {
            let unsure = unsure(segmented, decision, rim_px > 0.0);
            if !unsure.contains(&true) {
                break;
            }
            let cameras = (&self.cameras, self.full_step_deg);
            // Whoever needs cameras or a hull says why there are none.
            let Ok(measured) = cameras_of(cameras.0, cameras.1, segmented, consensus, &mut Vec::new()) else {
                break;
            };
            let cones: Vec<Cone> = (segmented.iter().zip(measured.projections))
                .map(|(view, projection)| Cone::new(projection, Arc::clone(&view.silhouette)))
                .collect();
            let of_grain: Vec<bool> = segmented.iter().map(|view| view.role == Role::Grain).collect();
            let carving: Vec<Cone> =
                cones.iter().zip(&of_grain).filter(|(_, is)| **is).map(|(cone, _)| cone.clone()).collect();
            let Ok(bounds) = find_bounds(&carving) else { break };
            let bounds = bounds.grown(0.05 * bounds.size().max());
            let grown: Vec<bool> = (segmented.par_iter_mut().enumerate())
                .filter(|(k, _)| unsure[*k])
                .map(|(k, view)| {
                    let others: Vec<&Cone> = (cones.iter().zip(&of_grain).enumerate())
                        .filter(|(other, (_, is))| *other != k && **is)
                        .map(|(_, (cone, _))| cone)
                        .collect();
                    let held =
                        held_by_others(&others, (cones[k].projection(), &view.silhouette), &bounds, BUT);
                    let (settings, known) = decision.for_view(&view.found);
                    let known = Known { held: Some(&held), ..known };
                    // The first cut is good for a result: a second one that finds nothing must not end the run.
                    let Ok(mut one) = self.segment_with(view.index, &view.bytes, &settings, &known) else {
                        return false;
                    };
                    one.take_decision(decision);
                    let found = one.found_mut();
                    // Half of a cell along the outline is what the cells do not tell.
                    let untold = 0.5 * (held.pitch - 1) as f64 * found.report.outline_length_px;
                    let elsewhere = outside(&found.silhouette, &held) as f64 - untold;
                    if found.report.held_px == 0.0 || elsewhere > ELSEWHERE * found.report.area_px {
                        return false;
                    }
                    if let Some(consensus) = consensus {
                        found.recut(consensus.seen_by(found.report.pedestal));
                    }
                    if rim_px > 0.0 {
                        found.grow(rim_px);
                    }
                    let is_more = found.report.area_px > (1.0 + MORE) * view.found.report.area_px;
                    if is_more {
                        view.replace(one);
                        view.take_outline();
                    }
                    is_more
                })
                .collect();
            debug!(
                round,
                views = grown.iter().filter(|is| **is).count(),
                "cut again with what the others hold"
            );
            if !grown.contains(&true) {
                break;
            }
        }
    }
}

/// Which views may have left out a part of the grain: all of a clear or glossy one. What one out of focus or in another light shows of its
/// edge is no part.
fn unsure(segmented: &[SegmentedView], decision: &Decision, has_rim: bool) -> Vec<bool> {
    let areas: Vec<Option<f64>> = (segmented.iter())
        .map(|view| (view.role == Role::Grain).then_some(view.found.report.area_px))
        .collect();
    (segmented.iter().enumerate())
        .map(|(k, view)| {
            let is_dark = view.found.report.polarity == Polarity::DarkBackground;
            let dips = dips(&areas, k, if is_dark { DARK } else { BRIGHT });
            (view.found.unsure_px > 0 || dips || has_rim) && !decision.is_unlike(&view.found)
        })
        .collect()
}

/// Whether an area is less than the mean of those beside it by more than a share.
fn dips(areas: &[Option<f64>], k: usize, (beside, share): (&[usize], f64)) -> bool {
    let at = |k: usize| areas.get(k).copied().flatten();
    beside.iter().any(|&by| {
        let beside = k.checked_sub(by).and_then(at).zip(at(k + by)).zip(at(k));
        beside.is_some_and(|((before, after), own)| 0.5 * (before + after) - own > share * own)
    })
}

/// Pixels of a silhouette that others do not hold.
fn outside(silhouette: &Silhouette, held: &HeldByOthers) -> usize {
    let [x0, y0] = silhouette.origin;
    let width = silhouette.size[0];
    let inside = silhouette.distance_px.iter().enumerate().filter(|(_, d)| **d < 0.0);
    inside.filter(|(k, _)| !held.holds(x0 + k % width, y0 + k / width)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_area_dips_below_those_beside_it_and_the_first_and_last_cannot() {
        let body: Vec<Option<f64>> =
            (0..25).map(|k| Some(1000.0 + 20.0 * (0.25 * f64::from(k)).sin())).collect();
        let dipping = |areas: &[Option<f64>], which| -> Vec<usize> {
            (0..areas.len()).filter(|k| dips(areas, *k, which)).collect()
        };
        assert!([BRIGHT, DARK].iter().all(|which| dipping(&body, *which).is_empty()));
        let mut bitten = body.clone();
        bitten[12] = bitten[12].map(|area| 0.98 * area);
        assert_eq!(dipping(&bitten, BRIGHT), [12]);
        // Two that are beside one another hide each other from the nearest, but not from those two away.
        bitten[13] = bitten[13].map(|area| 0.98 * area);
        assert!(!dipping(&bitten, BRIGHT).contains(&12));
        assert!([12, 13].iter().all(|k| dipping(&bitten, DARK).contains(k)));
        // What is no view of the grain says nothing of those beside it.
        bitten[11] = None;
        assert!(!dips(&bitten, 12, BRIGHT) && !dips(&bitten, 11, BRIGHT));
        for end in [0, 24] {
            let mut bitten = body.clone();
            bitten[end] = Some(100.0);
            assert!(!dips(&bitten, end, BRIGHT) && !dips(&bitten, end, DARK));
        }
    }

    #[test]
    fn what_others_do_not_hold_of_a_silhouette_is_counted() {
        let coverage: Vec<f32> = (0..40 * 40)
            .map(|k| f32::from(u8::from((10..30).contains(&(k % 40)) && (10..30).contains(&(k / 40)))))
            .collect();
        let silhouette = Silhouette::of_coverage([40, 40], &coverage).unwrap();
        let held = |columns: usize| HeldByOthers {
            origin: [0, 0],
            pitch: 1,
            size: [40, 40],
            cells: (0..40 * 40).map(|k| k % 40 < columns).collect(),
        };
        assert_eq!([40, 25, 0].map(|columns| outside(&silhouette, &held(columns))), [0, 5 * 20, 20 * 20]);
    }
}

//! Views that left out a part of which it is unsure whether it is the grain are cut again with what the other views hold.
//!
//! A lit or clear grain can be as bright as the background along a part of its edge, and then a view by itself cannot tell it from a
//! reflection beside the grain. The hull of the others can: what lies within it and differs from the background is the grain.

use super::agree::Decision;
use super::cameras::cameras_of;
use super::{Pipeline, PipelineError, SegmentedView};
use crate::session::event::Role;
use grainrig_core::hull::{Cone, find_bounds, held_by_others};
use grainrig_core::silhouette::{Known, PedestalConsensus};
use rayon::prelude::*;
use std::sync::Arc;
use tracing::debug;

/// Times that it is done: what is set right in one view may be needed by those beside it.
const ROUNDS: usize = 2;
/// So many of the other views may have lost the part, too: shade falls alike on views that are beside one another. What is held too much the
/// others carve away.
const BUT: usize = 3;

impl Pipeline {
    /// Cuts the unsure views again. They are moved by `rim_px` as the others were.
    pub(super) fn hold(
        &self,
        segmented: &mut [SegmentedView],
        (decision, consensus, rim_px): (&Decision, Option<&PedestalConsensus>, f64),
    ) -> Result<(), PipelineError> {
        for round in 0..ROUNDS {
            let unsure = |view: &SegmentedView| view.found.unsure_px > 0;
            if !segmented.iter().any(unsure) {
                break;
            }
            let cameras = (&self.cameras, self.full_step_deg);
            // Whoever needs cameras or a hull says why there are none.
            let Ok(measured) = cameras_of(cameras.0, cameras.1, segmented, consensus, &mut Vec::new()) else { break };
            let cones: Vec<Cone> = (segmented.iter().zip(measured.projections))
                .map(|(view, projection)| Cone::new(projection, Arc::clone(&view.silhouette)))
                .collect();
            let of_grain: Vec<bool> = segmented.iter().map(|view| view.role == Role::Grain).collect();
            let carving: Vec<Cone> =
                cones.iter().zip(&of_grain).filter(|(_, is)| **is).map(|(cone, _)| cone.clone()).collect();
            let Ok(bounds) = find_bounds(&carving) else { break };
            let bounds = bounds.grown(0.05 * bounds.size().max());
            let grown: Vec<bool> = (segmented.par_iter_mut().enumerate())
                .filter(|(_, view)| unsure(view))
                .map(|(k, view)| {
                    let others: Vec<&Cone> = (cones.iter().zip(&of_grain).enumerate())
                        .filter(|(other, (_, is))| *other != k && **is)
                        .map(|(_, (cone, _))| cone)
                        .collect();
                    let held = held_by_others(&others, (cones[k].projection(), &view.silhouette), &bounds, BUT);
                    let (settings, known) = decision.for_view(&view.found);
                    let known = Known { held: Some(&held), ..known };
                    let mut one = self.segment_with(view.index, &view.bytes, &settings, &known)?;
                    one.take_decision(decision);
                    let found = one.found_mut();
                    if found.report.held_px == 0.0 {
                        return Ok(false);
                    }
                    if let Some(consensus) = consensus {
                        found.recut(consensus.seen_by(found.report.pedestal));
                    }
                    if rim_px > 0.0 {
                        found.grow(rim_px);
                    }
                    let is_more = found.report.area_px > view.found.report.area_px;
                    if is_more {
                        view.replace(one);
                        view.take_outline();
                    }
                    Ok::<bool, PipelineError>(is_more)
                })
                .collect::<Result<_, _>>()?;
            debug!(round, views = grown.iter().filter(|is| **is).count(), "cut again with what the others hold");
            if !grown.contains(&true) {
                break;
            }
        }
        Ok(())
    }
}

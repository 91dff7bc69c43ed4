//! All views are cut at the pedestal that they show together.

use super::{Cameras, PipelineError, Taken};
use crate::session::event::Role;
use crate::silhouette::{PedestalSeen, Side, Stand, joint_stand};
use std::sync::Arc;

/// Finds the pedestal from all views and cuts each at its top. Views with cameras of their own stay as they are, and
/// so do all where too few show a pedestal. The pedestal, and what a person should know.
///
/// # Errors
/// [`PipelineError::CutByBorder`] where a grain still reaches the picture's lower border.
pub(super) fn recut(
    cameras: &Cameras,
    taken: &mut [Taken],
) -> Result<(Option<Stand>, Vec<String>), PipelineError> {
    if !matches!(cameras, Cameras::Turntable(_)) {
        return Ok((None, Vec::new()));
    }
    let seen: Vec<Option<PedestalSeen>> = taken.iter().map(|t| t.found.report.pedestal).collect();
    let stand = joint_stand(&seen);
    let mut warnings = Vec::new();
    if let Some(stand) = &stand {
        for one in taken.iter_mut() {
            // A view may be shifted sideways: its own middle is better than the others'.
            let own = one.found.report.pedestal.map(|p| p.centre_column);
            let middle = stand.centre_column_px.value;
            let half_width = stand.half_width_px.value;
            let centre_column = own.filter(|c| (c - middle).abs() <= 0.5 * half_width).unwrap_or(middle);
            let top_slope = stand.top_slope.value;
            let joint = PedestalSeen {
                top_row: stand.top_row_px.value + top_slope * (centre_column - middle),
                top_slope,
                centre_column,
                half_width,
                top_seen: one.found.report.pedestal.is_some_and(|p| p.top_seen),
            };
            if one.found.recut(joint) {
                one.silhouette = Arc::new(one.found.silhouette.clone());
            }
        }
        for (places, what) in [
            (&stand.disagree, "shows another pedestal than"),
            (&stand.unseen, "does not show the pedestal as"),
        ] {
            warnings.extend(places.iter().map(|&k| {
                format!(
                    "view {} {what} the other views do: it is cut at their pedestal's top (row {:.1})",
                    taken[k].index, stand.top_row_px.value
                )
            }));
        }
    }
    let cut = taken.iter().find(|t| t.role == Role::Grain && t.found.report.touches_border[3]);
    match cut {
        Some(t) => Err(PipelineError::CutByBorder { view: t.index, side: Side::Bottom.name() }),
        None => Ok((stand, warnings)),
    }
}

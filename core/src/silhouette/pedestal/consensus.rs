//! Pedestal consensus: top, slope, centre and width that the views share, by medians; views that disagree are named.
//!
//! The grain turns and the pedestal, whose axis is the stage's, does not change: what stays the same in every view is
//! the pedestal. A single view finds its top to about a fifth of a pixel, worse where the grain hides it; the views
//! together find it several times better, and one that disagrees has seen something else.

use crate::silhouette::PedestalOutline;
use crate::silhouette::backdrop::median;
use serde::Serialize;

/// A view whose pedestal is further from the joint one than this many standard deviations (of the views about it)
/// disagrees …
const SIGMAS: f64 = 4.0;
/// … provided it is off by more than this, pixels, or by this slope, or by a slope that lifts its edge by as many pixels.
const LEAST_OFF_PX: f64 = 0.75;
const LEAST_OFF_SLOPE: f64 = 0.01;
/// Fewer views than this show no scatter.
const LEAST_VIEWS: usize = 3;
/// A median of normal values scatters by this much more than their mean: √(π/2).
const MEDIAN_LOSS: f64 = 1.253;

/// A consensus figure and its standard uncertainty, in the same unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ConsensusValue {
    /// The figure.
    pub value: f64,
    /// Its standard uncertainty, from the scatter of the views.
    #[serde(rename = "sigma")]
    pub sd: f64,
}

/// The consensus of all views on the pedestal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PedestalConsensus {
    /// Row of its top at `centre_column_px`, pixels.
    pub top_row_px: ConsensusValue,
    /// Slope of its top, rows per column.
    pub top_slope: ConsensusValue,
    /// Its centre column at its top, pixels. A view may be shifted sideways against the others.
    pub centre_column_px: ConsensusValue,
    /// Half its width, pixels.
    pub half_width_px: ConsensusValue,
    /// Standard deviation of the blur of its sides, pixels.
    pub blur_px: ConsensusValue,
    /// Views it was taken from.
    pub views: usize,
    /// Indices (in the list of views) of those whose pedestal disagrees with it.
    pub disagree: Vec<usize>,
    /// Indices of those that show no pedestal, or not its top.
    pub unseen: Vec<usize>,
    /// Whether its slope was read off.
    #[serde(skip)]
    pub slope_seen: bool,
    /// What each view saw by itself.
    #[serde(skip)]
    pub own: Vec<Option<PedestalOutline>>,
}

impl PedestalConsensus {
    /// Row of its top, or of the line that goes on from it, in a column.
    pub fn top_row_at(&self, column: f64) -> f64 {
        self.top_row_px.value + self.top_slope.value * (column - self.centre_column_px.value)
    }

    /// The pedestal as a view shows it that saw `own` by itself: where it stands sideways is the view's own business.
    pub fn seen_by(&self, own: Option<PedestalOutline>) -> PedestalOutline {
        let middle = self.centre_column_px.value;
        let half_width = self.half_width_px.value;
        let columns = own.map(|p| p.centre_column);
        let centre_column = columns.filter(|c| (c - middle).abs() <= 0.5 * half_width).unwrap_or(middle);
        let top_slope = self.top_slope.value;
        PedestalOutline {
            top_row: self.top_row_at(centre_column),
            top_slope,
            centre_column,
            half_width,
            blur: self.blur_px.value,
            top_seen: own.is_some_and(|p| p.top_seen),
            slope_seen: self.slope_seen,
        }
    }
}

/// The pedestal that the views share; `None` where fewer than three show one with its top. Medians, so that less than
/// half of the views may be wrong; those far from them are named.
pub fn pedestal_consensus(views: &[Option<PedestalOutline>]) -> Option<PedestalConsensus> {
    let seen: Vec<(usize, PedestalOutline)> =
        (views.iter().enumerate()).filter_map(|(k, p)| p.filter(|p| p.top_seen).map(|p| (k, p))).collect();
    if seen.len() < LEAST_VIEWS {
        return None;
    }
    let middle = |of: &dyn Fn(&PedestalOutline) -> f64, least: f64| {
        let value = median_of(seen.iter().map(|(_, p)| of(p)));
        let sd = 1.4826 * median_of(seen.iter().map(|(_, p)| (of(p) - value).abs()));
        (value, (SIGMAS * sd).max(least))
    };
    let centre = middle(&|p| p.centre_column, f64::INFINITY).0;
    let half = middle(&|p| p.half_width, LEAST_OFF_PX);
    let slope = middle(&|p| p.top_slope, LEAST_OFF_SLOPE.max(LEAST_OFF_PX / half.0.max(1.0)));
    // Tops are compared in one column: views that are shifted sideways see the same top elsewhere.
    let top_of = |p: &PedestalOutline| p.top_row + slope.0 * (centre - p.centre_column);
    let top = middle(&top_of, LEAST_OFF_PX);
    let agrees = |p: &PedestalOutline| {
        (top_of(p) - top.0).abs() <= top.1
            && (p.half_width - half.0).abs() <= half.1
            && (p.top_slope - slope.0).abs() <= slope.1
    };
    let (good, bad): (Vec<_>, Vec<_>) = seen.iter().partition(|(_, p)| agrees(p));
    let joint = |of: &dyn Fn(&PedestalOutline) -> f64| {
        let value = median_of(good.iter().map(|(_, p)| of(p)));
        let scatter = 1.4826 * median_of(good.iter().map(|(_, p)| (of(p) - value).abs()));
        ConsensusValue { value, sd: MEDIAN_LOSS * scatter / (good.len() as f64).sqrt() }
    };
    Some(PedestalConsensus {
        top_row_px: joint(&top_of),
        top_slope: joint(&|p| p.top_slope),
        centre_column_px: joint(&|p| p.centre_column),
        half_width_px: joint(&|p| p.half_width),
        blur_px: joint(&|p| p.blur),
        views: good.len(),
        disagree: bad.iter().map(|(k, _)| *k).collect(),
        unseen: (views.iter().enumerate())
            .filter(|(_, p)| p.is_none_or(|p| !p.top_seen))
            .map(|(k, _)| k)
            .collect(),
        slope_seen: good.iter().any(|(_, p)| p.slope_seen),
        own: views.to_vec(),
    })
}

fn median_of(values: impl Iterator<Item = f64>) -> f64 {
    median(&mut values.collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(top_row: f64, shift: f64) -> PedestalOutline {
        let (centre_column, top_slope) = (500.0 + shift, 0.02);
        let top_row = top_row + top_slope * shift;
        let seen = true;
        PedestalOutline {
            top_row,
            top_slope,
            centre_column,
            half_width: 58.0,
            top_seen: seen,
            slope_seen: seen,
            blur: 1.0,
        }
    }

    #[test]
    fn views_that_are_wrong_or_see_no_top_do_not_move_it_and_are_named() {
        let runout = [0.3, -0.2, 0.1, -0.4, 0.2, 0.0, -0.1, 0.4];
        let mut views: Vec<_> = runout.iter().map(|w| Some(view(700.0 + 0.1 * w, *w))).collect();
        views.push(Some(view(705.0, 0.0)));
        views.push(None);
        views.push(Some(PedestalOutline { top_seen: false, ..view(690.0, 0.0) }));
        let stand = pedestal_consensus(&views).unwrap();
        assert!((stand.top_row_px.value - 700.0).abs() < 0.05, "{stand:?}");
        assert!(stand.top_row_px.sd > 0.0 && stand.top_row_px.sd < 0.05, "{stand:?}");
        assert_eq!((stand.disagree, stand.unseen, stand.views), (vec![8], vec![9, 10], 8));
    }

    #[test]
    fn a_lean_that_nobody_saw_has_no_sides_to_be_read_off() {
        for slope_seen in [true, false] {
            let views =
                [0.1, -0.2, 0.0, 0.3].map(|shift| Some(PedestalOutline { slope_seen, ..view(700.0, shift) }));
            let stand = pedestal_consensus(&views).unwrap();
            assert_eq!(stand.slope_seen, slope_seen);
            assert!((stand.top_row_at(600.0) - stand.top_row_at(500.0) - 2.0).abs() < 1e-9);
            assert_eq!(stand.seen_by(views[1]).side_px(1000) > 200.0, slope_seen);
            assert_eq!(stand.seen_by(None).side_px(1000) > 200.0, slope_seen);
        }
    }

    #[test]
    fn two_views_are_no_majority() {
        assert!(pedestal_consensus(&[Some(view(700.0, 0.0)), Some(view(700.1, 0.0)), None]).is_none());
        assert!(pedestal_consensus(&[]).is_none());
    }
}

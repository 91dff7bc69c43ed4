//! The views in the order of their directions, whatever the order in which they were given.

use super::{SliceError, Strips};
use std::borrow::Cow;
use std::f64::consts::{PI, TAU};

/// Views closer than this in direction, radians, are one view with both silhouettes: on a grain of a millimetre they
/// differ by 10⁻¹² mm.
const SAME_RAD: f64 = 1e-12;

/// One direction across which strips lie.
#[derive(Debug, Clone)]
pub(super) struct Direction<'a> {
    /// Of the strips' normal, counter-clockwise from x, 0 … π.
    angle: f64,
    /// Whether the view's intervals count along the opposite of the normal.
    mirrored: bool,
    view: Cow<'a, Strips>,
}

impl Direction<'_> {
    /// The number of intervals on a row.
    pub(super) fn count(&self, row: usize) -> usize {
        self.view.row(row).len()
    }

    /// Interval `i` of a row, ascending along the normal.
    #[inline]
    pub(super) fn interval(&self, row: usize, i: usize) -> [f64; 2] {
        let row = self.view.row(row);
        if self.mirrored {
            let [a, b] = row[row.len() - 1 - i];
            [-b, -a]
        } else {
            row[i]
        }
    }

    /// The ends of all intervals of a row; `None` where there are none.
    #[inline]
    pub(super) fn extent(&self, row: usize) -> Option<[f64; 2]> {
        let row = self.view.row(row);
        let (low, high) = (row.first()?[0], row.last()?[1]);
        Some(if self.mirrored { [-high, -low] } else { [low, high] })
    }
}

/// Sorts the views by direction and joins those that look along the same line.
pub(super) fn sorted(views: &[Strips]) -> Result<Vec<Direction<'_>>, SliceError> {
    let row_grid = views.first().ok_or(SliceError::OneDirection { views: 0 })?.row_grid();
    if let Some((view, v)) = views.iter().enumerate().find(|(_, v)| v.row_grid() != row_grid) {
        return Err(SliceError::RowGrids { view, row_grid: v.row_grid(), first: row_grid });
    }
    let mut all: Vec<Direction> = views.iter().map(direction).collect();
    all.sort_by(|a, b| a.angle.total_cmp(&b.angle));
    let mut joined: Vec<Direction> = Vec::with_capacity(all.len());
    let mut last_angle = f64::NEG_INFINITY;
    for d in all {
        let near = d.angle - last_angle < SAME_RAD;
        last_angle = d.angle;
        match joined.last_mut().filter(|_| near) {
            Some(last) => *last = last.with(&d),
            None => joined.push(d),
        }
    }
    // The circle closes: a direction just short of half a turn is the first one's opposite.
    if joined.len() > 1 && joined[0].angle + PI - last_angle < SAME_RAD {
        let mut last = joined.remove(joined.len() - 1);
        last.mirrored = !last.mirrored;
        joined[0] = joined[0].with(&last);
    }
    if joined.len() < 2 {
        return Err(SliceError::OneDirection { views: views.len() });
    }
    Ok(joined)
}

/// e(θ) = (cos θ, −sin θ), or its opposite where that points downwards.
fn direction(view: &Strips) -> Direction<'_> {
    let angle = (-view.angle_rad()).rem_euclid(TAU);
    let mirrored = angle >= PI;
    Direction { angle: if mirrored { angle - PI } else { angle }, mirrored, view: Cow::Borrowed(view) }
}

impl<'a> Direction<'a> {
    fn with(&self, other: &Self) -> Direction<'a> {
        let upright = |d: &Self| if d.mirrored { d.view.mirrored() } else { d.view.as_ref().clone() };
        let both = upright(self).intersected(&upright(other));
        Direction { angle: self.angle, mirrored: false, view: Cow::Owned(both) }
    }
}

/// The unit normals of all half-planes: those of the strips' upper sides, then those of their lower sides.
pub(super) fn normals(directions: &[Direction]) -> Vec<[f64; 2]> {
    let upper = directions.iter().map(|d| [d.angle.cos(), d.angle.sin()]);
    upper.clone().chain(upper.map(|[x, y]| [-x, -y])).collect()
}

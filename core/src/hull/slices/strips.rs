//! A view as strips: at each height the intervals across the axis that its silhouette allows.

use super::SliceError;

/// A regular row grid of heights: row `k` is at `first_mm + k · pitch_mm` and stands for half a pitch to either side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowGrid {
    /// Height of the first row above the world's origin, mm.
    pub first_mm: f64,
    /// From row to row, upwards, mm.
    pub pitch_mm: f64,
    /// How many rows.
    pub rows: usize,
}

impl RowGrid {
    /// Rows that tile a range of heights: at the middles of equal slabs of at most `pitch_mm`.
    ///
    /// # Errors
    /// [`SliceError::RowGrid`] where the range or the pitch is not a positive number, or the rows are too many.
    pub fn tiling([low, high]: [f64; 2], pitch_mm: f64) -> Result<Self, SliceError> {
        let count = ((high - low) / pitch_mm).ceil().max(1.0);
        let pitch = (high - low) / count;
        let rows = if count <= MOST_ROWS as f64 { count as usize } else { usize::MAX };
        let row_grid = Self { first_mm: low + 0.5 * pitch, pitch_mm: pitch, rows };
        if pitch_mm > 0.0 {
            row_grid.checked()
        } else {
            Err(SliceError::RowGrid(Self { pitch_mm, ..row_grid }))
        }
    }

    /// Height of row `k`, mm.
    #[inline]
    pub fn height(&self, k: usize) -> f64 {
        self.first_mm + k as f64 * self.pitch_mm
    }

    pub(super) fn checked(self) -> Result<Self, SliceError> {
        let sound = self.first_mm.is_finite() && self.pitch_mm.is_finite() && self.pitch_mm > 0.0;
        if sound && self.rows > 0 && self.rows <= MOST_ROWS {
            Ok(self)
        } else {
            Err(SliceError::RowGrid(self))
        }
    }
}

/// The most rows of a row grid: far above any picture's.
pub(super) const MOST_ROWS: usize = 1 << 20;

/// One view's silhouette: on each row of a row grid the intervals across the axis where the grain may be.
///
/// A point (x, y, z) of the grain at the stage angle θ is seen `u = x cos θ − y sin θ` right of the axis (see
/// [`Turntable`](crate::calibrate::Turntable)); an interval `[u0, u1]` is therefore the strip u0 ≤ p·e(θ) ≤ u1.
#[derive(Debug, Clone, PartialEq)]
pub struct Strips {
    row_grid: RowGrid,
    angle_rad: f64,
    /// Where the intervals of each row begin; one more than there are rows.
    starts: Vec<u32>,
    /// mm right of the axis.
    intervals: Vec<[f64; 2]>,
}

impl Strips {
    /// From a function that adds to a list the intervals (mm right of the axis, ascending, disjoint) at a height (mm).
    ///
    /// # Errors
    /// [`SliceError::Angle`], [`SliceError::RowGrid`], and [`SliceError::Intervals`] where a row's intervals are not
    /// finite, ascending and disjoint.
    pub fn from_fn(
        row_grid: RowGrid,
        angle_rad: f64,
        mut intervals_at: impl FnMut(f64, &mut Vec<[f64; 2]>),
    ) -> Result<Self, SliceError> {
        let row_grid = row_grid.checked()?;
        if !angle_rad.is_finite() {
            return Err(SliceError::Angle(angle_rad));
        }
        let mut starts = Vec::with_capacity(row_grid.rows + 1);
        let mut intervals: Vec<[f64; 2]> = Vec::with_capacity(row_grid.rows);
        starts.push(0);
        for row in 0..row_grid.rows {
            let first = intervals.len();
            let height_mm = row_grid.height(row);
            intervals_at(height_mm, &mut intervals);
            let mut last = f64::NEG_INFINITY;
            for [a, b] in &intervals[first..] {
                if !(*a > last && a <= b && b.is_finite()) {
                    return Err(SliceError::Intervals { row, height_mm, interval: [*a, *b] });
                }
                last = *b;
            }
            starts.push(intervals.len() as u32);
        }
        Ok(Self { row_grid, angle_rad, starts, intervals })
    }

    /// The row grid.
    pub fn row_grid(&self) -> RowGrid {
        self.row_grid
    }

    /// The stage's angle, radians.
    pub fn angle_rad(&self) -> f64 {
        self.angle_rad
    }

    /// The same silhouette seen at another angle of the stage.
    #[must_use]
    pub fn turned_to(&self, angle_rad: f64) -> Self {
        Self { angle_rad, ..self.clone() }
    }

    /// The intervals on a row, mm right of the axis, ascending and disjoint.
    #[inline]
    pub fn row(&self, k: usize) -> &[[f64; 2]] {
        &self.intervals[self.starts[k] as usize..self.starts[k + 1] as usize]
    }

    /// The same strips along the opposite direction: each interval mirrored about the axis.
    pub(super) fn mirrored(&self) -> Self {
        let mut intervals = self.intervals.clone();
        for k in 0..self.row_grid.rows {
            let row = &mut intervals[self.starts[k] as usize..self.starts[k + 1] as usize];
            row.reverse();
            row.iter_mut().for_each(|[a, b]| (*a, *b) = (-*b, -*a));
        }
        Self { intervals, starts: self.starts.clone(), ..*self }
    }

    /// What both views allow, for views along the same direction.
    pub(super) fn intersected(&self, other: &Self) -> Self {
        let mut starts = vec![0];
        let mut intervals = Vec::with_capacity(self.intervals.len());
        for k in 0..self.row_grid.rows {
            let (a, b) = (self.row(k), other.row(k));
            let (mut i, mut j) = (0, 0);
            while i < a.len() && j < b.len() {
                let both = [a[i][0].max(b[j][0]), a[i][1].min(b[j][1])];
                if both[0] <= both[1] {
                    intervals.push(both);
                }
                if a[i][1] < b[j][1] { i += 1 } else { j += 1 }
            }
            starts.push(intervals.len() as u32);
        }
        Self { starts, intervals, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tiling_row_grid_fills_its_range() {
        let l = RowGrid::tiling([-0.3, 0.7], 0.15).unwrap();
        assert_eq!(l.rows, 7);
        assert!((l.first_mm - 0.5 * l.pitch_mm + 0.3).abs() < 1e-15);
        assert!((l.height(6) + 0.5 * l.pitch_mm - 0.7).abs() < 1e-15);
        for bad in [0.0, -1.0, f64::NAN, 1e-12] {
            assert!(matches!(RowGrid::tiling([0.0, 1.0], bad), Err(SliceError::RowGrid(_))), "{bad}");
        }
        assert!(RowGrid::tiling([1.0, 0.0], 0.1).is_err());
        assert!(RowGrid::tiling([0.0, f64::INFINITY], 0.1).is_err());
    }

    #[test]
    fn intervals_are_mirrored_and_intersected_as_sets_are() {
        let row_grid = RowGrid { first_mm: 0.0, pitch_mm: 1.0, rows: 2 };
        let view = |rows: [&'static [[f64; 2]]; 2]| {
            Strips::from_fn(row_grid, 0.0, |z, out| out.extend_from_slice(rows[z as usize])).unwrap()
        };
        let a = view([&[[-3.0, -1.0], [0.0, 2.0]], &[[1.0, 2.0]]]);
        let b = view([&[[-2.0, 1.0], [1.5, 4.0]], &[]]);
        assert_eq!(a.mirrored().row(0), [[-2.0, -0.0], [1.0, 3.0]]);
        let both = a.intersected(&b);
        assert_eq!(both.row(0), [[-2.0, -1.0], [0.0, 1.0], [1.5, 2.0]]);
        assert_eq!(both.row(1), [[0.0; 2]; 0]);
        assert_eq!(both, b.intersected(&a));
    }

    #[test]
    fn intervals_out_of_order_or_not_finite_are_refused() {
        let row_grid = RowGrid { first_mm: 0.0, pitch_mm: 1.0, rows: 1 };
        for bad in [[[0.0, 2.0], [1.0, 3.0]], [[2.0, 1.0], [3.0, 4.0]], [[0.0, f64::NAN], [1.0, 2.0]]] {
            let made = Strips::from_fn(row_grid, 0.0, |_, out| out.extend(bad));
            assert!(matches!(made, Err(SliceError::Intervals { row: 0, .. })), "{bad:?}");
        }
        assert!(matches!(Strips::from_fn(row_grid, f64::NAN, |_, _| ()), Err(SliceError::Angle(_))));
    }
}

//! The pedestal under the grain: found in one view, its light taken off the grain's, and agreed on by all views.
//!
//! ```text
//!      ___            grain
//!     (   )
//!   ___\_/___  top:   row = top_row + top_slope · (column − centre_column)
//!   |       |
//!   |       |  sides: column = left or right at a row, half_width to either side of the centre
//!   |       |
//! ──┴───────┴──       lower end of the picture
//! ```

mod consensus;
mod find;
mod uncut;
mod unmix;

pub use consensus::{ConsensusValue, PedestalConsensus, pedestal_consensus};
pub(super) use find::find;
pub use uncut::Uncut;
pub(super) use unmix::{smoothed, unmix};

/// The cut is this much wider than the pedestal on each side, pixels, so that no blurred sliver stays.
pub(super) const CUT_MARGIN: f64 = 5.0;

/// A pedestal, in the plane's own pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pedestal {
    /// Row of the top at column 0, and rows per column.
    pub top: [f64; 2],
    /// Columns of the left and right side at row 0, and columns per row.
    pub left: [f64; 2],
    pub right: [f64; 2],
    /// Whether the top itself was seen; else it is taken where the sides end.
    pub top_seen: bool,
    /// Its grey level, away from the background.
    pub level: f64,
    /// Standard deviation of the blur of its sides, pixels.
    pub blur: f64,
}

impl Pedestal {
    /// Row of the top at a column.
    pub(super) fn top_at(&self, x: f64) -> f64 {
        self.top[0] + self.top[1] * x
    }

    /// A row of a plane of this width above which everything is further than so many pixels above the top.
    pub(super) fn clear_above(&self, width: usize, pixels: f64) -> f64 {
        // A row more than needed, against rounding.
        self.top_at(0.0).min(self.top_at(width as f64)) - pixels * self.top[1].hypot(1.0) - 1.0
    }

    /// Columns of both sides at a row.
    pub(super) fn sides_at(&self, y: f64) -> [f64; 2] {
        [self.left[0] + self.left[1] * y, self.right[0] + self.right[1] * y]
    }

    /// Centre column and half width at the top.
    pub(super) fn centre(&self) -> (f64, f64) {
        let middle = 0.5 * (self.left[0] + self.right[0]);
        let [l, r] = self.sides_at(self.top_at(middle));
        (0.5 * (l + r), 0.5 * (r - l))
    }

    /// How far (pixels) a pixel lies below the top, where the cut reaches: `None` beside it.
    pub(super) fn below_top(&self, x: f64, y: f64) -> Option<f64> {
        let [l, r] = self.sides_at(y);
        (x >= l - CUT_MARGIN && x <= r + CUT_MARGIN)
            .then(|| (y - self.top_at(x)) / (1.0 + self.top[1] * self.top[1]).sqrt())
    }
}

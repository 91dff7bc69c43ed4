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

use super::PedestalOutline;

mod consensus;
mod find;
mod lens;
mod standing;
mod uncut;
mod unmix;

pub use consensus::{ConsensusValue, PedestalConsensus, pedestal_consensus};
pub(super) use find::{find, near};
pub(super) use lens::lens_blur_px;
pub use standing::{SmallCopy, standing_pedestal};
pub use uncut::Uncut;
pub(super) use unmix::{mix, smoothed, unmix};

/// The cut is this much wider than the pedestal on each side, pixels, or this many standard deviations of the blur, so that no
/// blurred sliver stays.
const CUT_MARGIN: f64 = 5.0;
const CUT_BLURS: f64 = 3.0;

/// By how much the cut is wider than the pedestal on each side, pixels.
pub(super) fn cut_margin(blur_px: f64) -> f64 {
    CUT_MARGIN.max(CUT_BLURS * blur_px)
}

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
    /// Whether its lean was read off; else it is taken for upright.
    pub slope_seen: bool,
    /// Its grey level at its centre, away from the background, and how much that grows with each column.
    pub level: f64,
    pub level_slope: f64,
    /// Standard deviation of the blur of its sides, pixels.
    pub blur: f64,
}

impl Pedestal {
    /// The same in a plane whose first column and row are these of this one.
    pub(super) fn seen_from(&self, [x0, y0]: [usize; 2]) -> Self {
        let (x, y) = (x0 as f64, y0 as f64);
        let side = |[at, lean]: [f64; 2]| [at + lean * y - x, lean];
        let top = [self.top[0] + self.top[1] * x - y, self.top[1]];
        Self { top, left: side(self.left), right: side(self.right), ..*self }
    }

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

    /// Its grey level at a column.
    pub(super) fn level_at(&self, x: f64) -> f64 {
        self.level + self.level_slope * (x - self.centre().0)
    }

    /// The pedestal that an outline in the picture is, in a plane whose first column and row are these.
    pub(super) fn of(outline: &PedestalOutline, [x0, y0]: [usize; 2]) -> Self {
        let slope = outline.top_slope;
        let (centre, top) = (outline.centre_column - x0 as f64, outline.top_row - y0 as f64);
        // The sides are square to the top.
        let side = |x: f64| [x + slope * top, -slope];
        Self {
            top: [top - slope * centre, slope],
            left: side(centre - outline.half_width),
            right: side(centre + outline.half_width),
            top_seen: outline.top_seen,
            slope_seen: outline.slope_seen,
            level: 0.0,
            level_slope: 0.0,
            blur: outline.blur,
        }
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
        let margin = cut_margin(self.blur);
        (x >= l - margin && x <= r + margin)
            .then(|| (y - self.top_at(x)) / (1.0 + self.top[1] * self.top[1]).sqrt())
    }
}

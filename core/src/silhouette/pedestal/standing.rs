//! What stands still while the grain turns: the pedestal, sought in the small copies of all views together.
//!
//! The pedestal's sides are upright edges in the mean of all views, brighter or darker than the background, from the
//! picture's lower end up to the top. What the single view's mask cannot tell (a pedestal as dark as the background, lit on
//! one side and dark on the other, as dark as the grain above it) the mean shows: noise is averaged away, and so is the grain.

use crate::silhouette::backdrop::median;
use crate::silhouette::{Channel, Grid, PedestalOutline};

/// Units of a level in a small copy.
const PER_LEVEL: f32 = 128.0;
/// Fewer views than this show nothing that stands still.
const LEAST_VIEWS: usize = 5;
/// Rows at the lower end in which sides are sought, a share of all and at least.
const FIRST_ROWS: (f64, usize) = (0.03, 4);
/// A side is an edge in the mean this many times as strong as the noise of such edges, and at least so strong: levels a cell.
const CLEAR: f64 = 6.0;
const LEAST_STEP: f64 = 0.6;
/// And at least this share of the strongest.
const LEAST_SHARE: f64 = 0.06;
/// A line thinner than this, pixels, is no pedestal.
const LEAST_WIDTH: f64 = 10.0;
/// A view shows a side in a row when the step there is that of the lower end, within these shares of it …
const ALIKE: [f64; 2] = [0.5, 1.7];
/// … and the side goes on upwards while this share of the views shows it that shows it at the lower end: a grain that hangs
/// over hides it in some.
const GOES_ON: f64 = 0.45;
/// Rows without it after which it has ended.
const GAP: usize = 3;
/// The pedestal's face is still where it changes from view to view by less than this many times what it does at the lower
/// end, or by this many levels more.
const STILL: f64 = 3.0;
const LEAST_MOVE: f64 = 1.0;
/// Rows around in which the top is sought.
const ABOUT: usize = 3;
/// How far a side may lean from row to row, cells.
const LEAN: usize = 1;
/// Least height, pixels, and as a share of the width.
const LEAST_HEIGHT: (f64, f64) = (8.0, 0.04);

/// The small copy of a view's brightness.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SmallCopy {
    grid: Grid,
    levels: Vec<u16>,
}

impl SmallCopy {
    /// From the levels, 0 … 255, of its cells.
    pub(in crate::silhouette) fn of(grid: Grid, levels: &[f32]) -> Self {
        Self { grid, levels: levels.iter().map(|v| (v * PER_LEVEL).round() as u16).collect() }
    }

    /// Pixels along a cell.
    pub fn pixels_per_cell(&self) -> f64 {
        self.grid.factor as f64
    }

    /// The level of the middle cell in the order of their levels, 0 … 255: the background's, as most is background.
    pub fn middle_level(&self) -> f64 {
        let mut levels = self.levels.clone();
        let middle = levels.len() / 2;
        if levels.is_empty() {
            0.0
        } else {
            f64::from(*levels.select_nth_unstable(middle).1) / f64::from(PER_LEVEL)
        }
    }

    /// The channel it shows.
    pub(in crate::silhouette) const CHANNEL: Channel = Channel::Luma;
}

/// The pedestal that stands still in these views, to about a cell of the copies; `None` where there is none, or too few
/// views.
pub fn standing_pedestal(copies: &[&SmallCopy]) -> Option<PedestalOutline> {
    let grid = copies.first()?.grid;
    if copies.len() < LEAST_VIEWS || copies.iter().any(|c| c.grid != grid) {
        return None;
    }
    let [width, height] = grid.size;
    let mut mean = vec![0f32; width * height];
    for copy in copies {
        mean.iter_mut().zip(&copy.levels).for_each(|(m, v)| *m += f32::from(*v));
    }
    let scale = 1.0 / (PER_LEVEL * copies.len() as f32);
    mean.iter_mut().for_each(|m| *m *= scale);
    let stack = Stack { width, height, mean, copies };

    let rows = FIRST_ROWS.1.max((FIRST_ROWS.0 * height as f64) as usize).min(height);
    let steps: Vec<f64> = (0..width)
        .map(|x| median(&mut (height - rows..height).map(|y| stack.step(x, y)).collect::<Vec<_>>()))
        .collect();
    let noise = 1.4826 * median(&mut steps.iter().map(|s| s.abs()).collect::<Vec<_>>());
    let strongest = steps.iter().map(|s| s.abs()).fold(0.0, f64::max);
    let least = (CLEAR * noise).max(LEAST_STEP).max(LEAST_SHARE * strongest);
    let is_peak = |x: usize| {
        let beside = [x.saturating_sub(1), (x + 1).min(width - 1)];
        steps[x].abs() >= least && beside.iter().all(|&b| steps[b].abs() <= steps[x].abs())
    };
    let mut sides: Vec<usize> = (2..width.saturating_sub(2)).filter(|&x| is_peak(x)).collect();
    let thin = LEAST_WIDTH / grid.factor as f64;
    // A hair that reaches the lower end: two edges of opposite sign next to each other.
    let mut k = 0;
    while k + 1 < sides.len() {
        let [a, b] = [sides[k], sides[k + 1]];
        if ((b - a) as f64) < thin && steps[a] * steps[b] < 0.0 && sides.len() > 3 {
            sides.drain(k..k + 2);
        } else {
            k += 1;
        }
    }
    let (left, right) = (*sides.first()?, *sides.last()?);
    if ((right - left) as f64) < thin.max(1.0) {
        return None;
    }
    let [left, right] = [left, right].map(|x| stack.upwards(x, steps[x]));
    let sides_at = |side: &[f64]| median(&mut side[..side.len().min(rows.max(8))].to_vec());
    let top = stack.top(left.len().max(right.len()), [sides_at(&left), sides_at(&right)]);
    let row = |k: usize| grid.origin[1] as f64 + ((height - k) * grid.factor) as f64 - 0.5;
    let column = |side: &[f64]| grid.origin[0] as f64 + (sides_at(side) + 0.5) * grid.factor as f64 - 0.5;
    let (l, r) = (column(&left), column(&right));
    let half_width = 0.5 * (r - l);
    let outline = PedestalOutline {
        top_row: row(top),
        top_slope: 0.0,
        centre_column: 0.5 * (l + r),
        half_width,
        top_seen: false,
        slope_seen: false,
        blur: 0.0,
    };
    let tall = grid.origin[1] as f64 + (height * grid.factor) as f64 - outline.top_row;
    let all = tall >= grid.factor as f64 * (height as f64 - 1.0);
    (!all && tall >= LEAST_HEIGHT.0.max(LEAST_HEIGHT.1 * 2.0 * half_width)).then_some(outline)
}

/// All copies, and their mean.
struct Stack<'a> {
    width: usize,
    height: usize,
    mean: Vec<f32>,
    copies: &'a [&'a SmallCopy],
}

impl Stack<'_> {
    /// How the level steps across a cell, levels.
    fn step(&self, x: usize, y: usize) -> f64 {
        let row = &self.mean[y * self.width..][..self.width];
        f64::from(row[(x + 1).min(self.width - 1)] - row[x.saturating_sub(1)])
    }

    /// In how many views the step across a cell is one like this.
    fn shown(&self, x: usize, y: usize, step: f64) -> usize {
        let at =
            |copy: &SmallCopy, x: usize| f64::from(copy.levels[y * self.width + x]) / f64::from(PER_LEVEL);
        let (left, right) = (x.saturating_sub(1), (x + 1).min(self.width - 1));
        let alike = |copy: &&&SmallCopy| {
            let share = (at(copy, right) - at(copy, left)) / step;
            (ALIKE[0]..ALIKE[1]).contains(&share)
        };
        self.copies.iter().filter(alike).count()
    }

    /// Rows from the lower end up to the top, given how far the sides are seen: between where the pedestal's face begins to
    /// change from view to view, because a grain is there, and where the sides end, the row with the strongest step.
    fn top(&self, sides: usize, [left, right]: [f64; 2]) -> usize {
        let inset = 0.2 * (right - left);
        let inner =
            (left + inset).ceil() as usize..((right - inset).floor() as usize).min(self.width - 1) + 1;
        if inner.is_empty() {
            return sides;
        }
        let moves = |y: usize| {
            let each = inner.clone().map(|x| {
                let k = y * self.width + x;
                let off = |copy: &&SmallCopy| {
                    (f64::from(copy.levels[k]) / f64::from(PER_LEVEL) - f64::from(self.mean[k])).abs()
                };
                self.copies.iter().map(off).sum::<f64>() / self.copies.len() as f64
            });
            median(&mut each.collect::<Vec<_>>())
        };
        let rows: Vec<f64> = (0..self.height).map(|k| moves(self.height - 1 - k)).collect();
        let still = median(&mut rows[..self.height.min(8)].to_vec());
        let limit = (STILL * still).max(still + LEAST_MOVE);
        let Some(moving) = rows.windows(2).position(|w| w[0] > limit && w[1] > limit) else { return sides };
        let (low, high) = (moving.min(sides), moving.max(sides));
        let step = |k: usize| {
            let y = self.height - 1 - k;
            let row = |y: usize| &self.mean[y * self.width..][inner.clone()];
            let (above, below) = (row(y.saturating_sub(1)), row((y + 1).min(self.height - 1)));
            above.iter().zip(below).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>()
        };
        let about = low.saturating_sub(ABOUT)..(high + ABOUT).min(self.height);
        about.max_by(|a, b| step(*a).total_cmp(&step(*b))).unwrap_or(sides)
    }

    /// Columns of a side from the lower end upwards, until it ends.
    fn upwards(&self, first: usize, step: f64) -> Vec<f64> {
        let near = |x: usize| x.saturating_sub(LEAN)..(x + LEAN + 1).min(self.width);
        let best = |x: usize, y: usize| {
            near(x).map(|c| (self.shown(c, y, step), c)).max_by_key(|(n, c)| (*n, usize::MAX - c.abs_diff(x)))
        };
        let lowest = (self.height.saturating_sub(8)..self.height).filter_map(|y| best(first, y));
        let usual = median(&mut lowest.map(|(n, _)| n as f64).collect::<Vec<_>>());
        let needed = (GOES_ON * usual).max(2.0);
        let mut columns = Vec::new();
        let (mut x, mut missing) = (first, 0);
        for y in (0..self.height).rev() {
            match best(x, y).filter(|(n, _)| *n as f64 >= needed) {
                Some((_, c)) => (x, missing) = (c, 0),
                None => missing += 1,
            }
            if missing > GAP {
                break;
            }
            columns.push(x as f64);
        }
        columns.truncate(columns.len() - missing.min(columns.len()));
        columns
    }
}

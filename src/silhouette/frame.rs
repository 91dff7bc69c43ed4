//! The part of a picture that shows something: digitisers and video cards leave black lines at the ends.

use super::Picture;

/// A rectangle of pixels: columns `x0..x1`, rows `y0..y1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub x0: usize,
    pub y0: usize,
    pub x1: usize,
    pub y1: usize,
}

impl Rect {
    pub(super) fn width(&self) -> usize {
        self.x1 - self.x0
    }

    pub(super) fn height(&self) -> usize {
        self.y1 - self.y0
    }

    /// Grown by a margin on each side, within a limit.
    pub(super) fn grown(&self, by: usize, limit: &Self) -> Self {
        Self {
            x0: self.x0.saturating_sub(by).max(limit.x0),
            y0: self.y0.saturating_sub(by).max(limit.y0),
            x1: (self.x1 + by).min(limit.x1),
            y1: (self.y1 + by).min(limit.y1),
        }
    }
}

/// Pixels looked at along a line.
const SAMPLES: usize = 256;
/// A frame is no wider than this share of the picture.
const WIDEST: f64 = 0.1;
/// Grey levels that a line of a frame may differ from the next one, and vary along its length.
const FLAT: f64 = 8.0;
/// Grey levels that the picture stands off its frame …
const STEP: f64 = 20.0;
/// … along at least this share of the line: no object makes such a step, only a frame does.
const STEP_SHARE: f64 = 0.95;
/// Lines over which the step may be smeared out.
const SMEAR: usize = 2;

/// The picture without the flat lines along its ends.
pub(super) fn inner(picture: &Picture) -> Rect {
    let mut rect = Rect { x0: 0, y0: 0, x1: picture.width(), y1: picture.height() };
    let columns = |rect: &Rect, from_right: bool| {
        band(rect.width(), rect.height(), |line, along| {
            let x = if from_right { rect.x1 - 1 - line } else { rect.x0 + line };
            grey(picture, x, rect.y0 + along)
        })
    };
    let (left, right) = rayon::join(|| columns(&rect, false), || columns(&rect, true));
    rect.x0 += left;
    rect.x1 -= right;
    let rows = |rect: &Rect, from_bottom: bool| {
        band(rect.height(), rect.width(), |line, along| {
            let y = if from_bottom { rect.y1 - 1 - line } else { rect.y0 + line };
            grey(picture, rect.x0 + along, y)
        })
    };
    let (top, bottom) = (rows(&rect, false), rows(&rect, true));
    rect.y0 += top;
    rect.y1 -= bottom;
    rect
}

fn grey(picture: &Picture, x: usize, y: usize) -> f64 {
    let pixel = picture.row(y, x, x + 1);
    pixel.iter().map(|&v| f64::from(v)).sum::<f64>() / pixel.len() as f64
}

/// How many lines at one end are frame: flat, alike, and ending in a step along their whole length.
fn band(lines: usize, length: usize, grey: impl Fn(usize, usize) -> f64 + Sync) -> usize {
    let most = (lines as f64 * WIDEST) as usize;
    let step = (length / SAMPLES).max(1);
    let values = |line: usize| (0..length).step_by(step).map(|along| grey(line, along)).collect::<Vec<_>>();
    let mean = |line: &[f64]| line.iter().sum::<f64>() / line.len() as f64;
    // The mean of a line that is flat along its length.
    let flat = |line: usize| {
        let line = values(line);
        let level = mean(&line);
        let spread = line.iter().map(|v| (v - level).powi(2)).sum::<f64>() / line.len() as f64;
        (spread <= FLAT * FLAT).then_some(level)
    };
    let (mut count, mut level) = (0, None);
    while count < most
        && let Some(next) = flat(count)
        && level.is_none_or(|last: f64| (next - last).abs() <= FLAT)
    {
        level = Some(next);
        count += 1;
    }
    let level = level.unwrap_or_default();
    if count == 0 || count == most || count + SMEAR >= lines {
        return 0;
    }
    let beyond = values(count + SMEAR);
    let off = beyond.iter().filter(|v| (**v - level).abs() >= STEP).count();
    if off as f64 >= STEP_SHARE * beyond.len() as f64 { count + SMEAR } else { 0 }
}

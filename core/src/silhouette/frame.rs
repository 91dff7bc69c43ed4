//! The active area of a picture: digitisers and video cards leave black lines at the ends.

use super::Picture;
use super::rect::Rect;
use super::reduced::Reduced;

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

/// The step that is looked for on the small copy, grey levels: somewhat less, and …
const CELL_STEP: f64 = 0.8 * STEP;
/// … along somewhat less of the line.
const CELL_SHARE: f64 = 0.9;

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

/// Whether the small copy of a whole picture leaves it open that there is a frame: somewhere along its ends most
/// cells differ from those beside them. Where the frame ends within a cell, that cell shows part of the step.
pub(super) fn possible(reduced: &Reduced) -> bool {
    let (w, h) = (reduced.width, reduced.height);
    let grey: Vec<f32> = (0..w * h).map(|k| reduced.colours().iter().map(|c| c[k]).sum()).collect();
    let limit = |cell: usize| {
        // A cell at the end holds at least one line of the frame, any other pair of cells half of the step.
        let part = if cell == 0 { 1.0 / reduced.factor as f64 } else { 0.5 };
        (part * CELL_STEP * reduced.colours().len() as f64) as f32
    };
    // The cells `cell` and `cell + 1` from one end, all along it.
    let steps = |cell: usize, length: usize, at: &dyn Fn(usize, usize) -> usize| {
        let off = |along: &usize| (grey[at(cell, *along)] - grey[at(cell + 1, *along)]).abs() >= limit(cell);
        (0..length).filter(off).count() as f64 >= CELL_SHARE * length as f64
    };
    let most = |lines: usize| ((lines as f64 * WIDEST) as usize + 2).min(lines.saturating_sub(1));
    (0..most(w)).any(|c| steps(c, h, &|c, y| y * w + c) || steps(c, h, &|c, y| y * w + w - 1 - c))
        || (0..most(h)).any(|c| steps(c, w, &|c, x| c * w + x) || steps(c, w, &|c, x| (h - 1 - c) * w + x))
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

//! The pedestal in one view: straight upright sides from the picture's lower end up to a level top.

use super::Pedestal;
use crate::silhouette::backdrop::median;
use crate::silhouette::mask::Mask;
use crate::silhouette::plane::Plane;

/// A side may lie this far off its line, pixels.
const SIDE_TOLERANCE: f64 = 2.0;
/// Rows from which the sides are begun.
const FIRST_ROWS: usize = 12;
/// A side may lean by no more than this, columns per row (about 4°).
const GREATEST_LEAN: f64 = 0.07;
/// A row that is off costs as much as this many rows that fit earn.
const MISFIT: i64 = 3;
/// Least height, pixels, and as a share of the width.
const LEAST_HEIGHT: (f64, f64) = (8.0, 0.04);
/// Least width, pixels.
const LEAST_WIDTH: f64 = 12.0;
/// Rows away from the top at which both of its sides are seen unblurred, and how many are averaged.
const STAND_OFF: usize = 4;
const AVERAGED: usize = 4;
/// A column shows the top when the grey value steps there by this share of the pedestal's contrast.
const LEAST_STEP: f64 = 0.12;
/// Least share of the columns that must show it, within this many pixels of one line.
const LEAST_SEEN: f64 = 0.3;
const LINE_TOLERANCE: f64 = 1.0;
/// Sides at least this many times as long as the pedestal is wide determine its lean better than its top does.
const LONG_SIDES: f64 = 1.0;
/// Sides at least this many times as long are a pedestal's even where its top does not show.
const SURE_SIDES: f64 = 0.5;
/// Columns next to the sides that are left out, pixels.
const CORNER: f64 = 4.0;
/// Pixels on either side of a side in which its blur shows.
const PROFILE: usize = 12;
/// Rounds of fitting the top's line.
const ROUNDS: usize = 6;

/// Looks for a pedestal in the mask of all that is not background; `noise` in grey levels.
pub(in crate::silhouette) fn find(mask: &Mask, plane: &Plane, noise: f64) -> Option<Pedestal> {
    let rows = sides_upwards(mask)?;
    let (left, right, top) = straight_sides(&rows, mask.height)?;
    let rough = Pedestal {
        top: [top, 0.0],
        left,
        right,
        top_seen: false,
        slope_seen: true,
        level: 0.0,
        level_slope: 0.0,
        blur: 0.0,
    };
    let (centre, half) = rough.centre();
    let (height, width) = ((mask.height as f64 - 0.5) - top, 2.0 * half);
    if width < LEAST_WIDTH || height < LEAST_HEIGHT.0.max(LEAST_HEIGHT.1 * width) {
        return None;
    }
    let pedestal_level = level(plane, centre, half, top)?;
    let mut found = Pedestal { level: pedestal_level, ..sharpen_sides(plane, rough, pedestal_level) };
    found.blur = blur(plane, &found);
    // The top is square to the sides.
    let lean = (height >= LONG_SIDES * width).then(|| -0.5 * (found.left[1] + found.right[1]));
    if let Some((top, _)) = level_top(plane, &rough, pedestal_level, noise, lean) {
        return Some(Pedestal { top, top_seen: true, ..found });
    }
    if height < SURE_SIDES * width {
        return None;
    }
    // The mask is wider than the pedestal by as much as it is higher.
    let slope = lean.unwrap_or(0.0);
    let widened = half - found.centre().1;
    found.top = [top + widened - slope * centre, slope];
    Some(found)
}

/// First and last column of the run that continues the widest run of the lowest row upwards, row by row.
fn sides_upwards(mask: &Mask) -> Option<Vec<[f64; 2]>> {
    let w = mask.width;
    let bottom = &mask.bits[(mask.height - 1) * w..];
    let mut best: Option<(usize, usize)> = None;
    let mut x = 0;
    while let Some(start) = bottom[x..].iter().position(|&b| b != 0).map(|p| p + x) {
        let end = bottom[start..].iter().position(|&b| b == 0).map_or(w, |p| p + start);
        if best.is_none_or(|(s, e)| end - start > e - s) {
            best = Some((start, end));
        }
        x = end;
    }
    let (start, end) = best?;
    if start == 0 || end == w {
        return None;
    }
    let middle = usize::midpoint(start, end);
    let mut rows = Vec::new();
    for row in mask.bits.chunks_exact(w).rev() {
        // The run under the middle column; specks inside the pedestal do not split it.
        let Some(first) = row[..=middle].iter().rev().position(|&b| b == 0) else { break };
        let Some(last) = row[middle..].iter().position(|&b| b == 0) else { break };
        if first == 0 || last == 0 {
            break;
        }
        rows.push([(middle + 1 - first) as f64, (middle + last - 1) as f64]);
    }
    Some(rows)
}

/// A line: value at 0, and slope.
type Line = [f64; 2];

/// Lines through both sides (column over row), and the row where they end.
fn straight_sides(rows: &[[f64; 2]], height: usize) -> Option<(Line, Line, f64)> {
    let y = |k: usize| (height - 1 - k) as f64;
    let first = rows.len().min(FIRST_ROWS);
    if first < 4 {
        return None;
    }
    let mut lines = [0, 1].map(|side| {
        let mut columns: Vec<f64> = rows[..first].iter().map(|r| r[side]).collect();
        [median(&mut columns), 0.0]
    });
    let mut top = 0;
    for _ in 0..ROUNDS {
        let fits = |k: usize| {
            (0..2).all(|s| (rows[k][s] - lines[s][0] - lines[s][1] * y(k)).abs() <= SIDE_TOLERANCE)
        };
        // The highest row up to which fitting rows outweigh the others most.
        let (mut sum, mut best) = (0i64, 0i64);
        for k in 0..rows.len() {
            sum += if fits(k) { 1 } else { -MISFIT };
            if sum > best {
                (best, top) = (sum, k);
            }
        }
        let good: Vec<usize> = (0..=top).filter(|&k| fits(k)).collect();
        let mut refitted = lines;
        for (side, line) in refitted.iter_mut().enumerate() {
            let points: Vec<(f64, f64)> = good.iter().map(|&k| (y(k), rows[k][side])).collect();
            *line = fit_line(&points)?;
            if line[1].abs() > GREATEST_LEAN {
                return None;
            }
        }
        lines = refitted;
    }
    Some((lines[0], lines[1], y(top) - 0.5))
}

/// Grey level (away from the background) in the body of the pedestal.
fn level(plane: &Plane, centre: f64, half: f64, top: f64) -> Option<f64> {
    let (x0, x1) = ((centre - 0.7 * half).max(0.0) as usize, (centre + 0.7 * half) as usize);
    let y0 = (top.max(0.0) as usize + STAND_OFF).min(plane.height - 1);
    let mut values: Vec<f64> = (y0..plane.height)
        .flat_map(|y| (x0..=x1.min(plane.width - 1)).map(move |x| f64::from(plane.at(x, y))))
        .collect();
    (!values.is_empty()).then(|| median(&mut values))
}

/// The pedestal that is known to stand about here, up to so many pixels off, as this view shows it: brighter or darker than
/// the background, or both.
pub(in crate::silhouette) fn near(plane: &Plane, known: &Pedestal, off_px: f64, noise: f64) -> Pedestal {
    let (centre, half) = known.centre();
    let reach = off_px.ceil() as isize + 1;
    let first = (known.top_at(centre) + off_px).max(0.0) as usize + STAND_OFF;
    let mut found = *known;
    if plane.height >= first + FIRST_ROWS {
        let side = |line: Line| {
            // The step over all rows at once: a straight edge adds up, noise does not.
            let step = |away: isize| -> f64 {
                (first..plane.height)
                    .filter_map(|y| {
                        let x = (line[0] + line[1] * y as f64).round() as isize + away;
                        let inside = x >= 1 && x + 1 < plane.width as isize;
                        inside.then(|| f64::from(plane.at(x as usize + 1, y) - plane.at(x as usize - 1, y)))
                    })
                    .sum::<f64>()
                    .abs()
            };
            let best = (-reach..=reach).max_by(|a, b| step(*a).total_cmp(&step(*b))).unwrap_or(0);
            let [before, at, after] = [best - 1, best, best + 1].map(step);
            let bend = before - 2.0 * at + after;
            let part = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
            let clear = at > 4.0 * noise * 2.0f64.sqrt() * ((plane.height - first) as f64).sqrt();
            if clear { [line[0] + best as f64 + part, line[1]] } else { line }
        };
        (found.left, found.right) = (side(known.left), side(known.right));
    }
    (found.level, found.level_slope) = level_across(plane, &found, off_px).unwrap_or((0.0, 0.0));
    let strongest = found.level.abs() + found.level_slope.abs() * half;
    found.blur = if found.level.abs() > 10.0 * noise { blur(plane, &found) } else { known.blur.max(1.0) };
    // The top within reach that most columns show.
    let tops = (0..=(off_px / STAND_OFF as f64) as isize).flat_map(|k| [-k, k]).filter_map(|k| {
        let shift = k as f64 * STAND_OFF as f64;
        let about = Pedestal { top: [found.top[0] + shift, found.top[1]], ..found };
        level_top(plane, &about, strongest, noise, Some(found.top[1]))
    });
    if let Some((top, _)) = tops.max_by_key(|(_, columns)| *columns) {
        (found.top, found.top_seen) = (top, true);
    }
    found
}

/// Grey level (away from the background) at the centre of a pedestal below its top, and how it grows from column to column.
fn level_across(plane: &Plane, pedestal: &Pedestal, off_px: f64) -> Option<(f64, f64)> {
    let (centre, half) = pedestal.centre();
    let (x0, x1) = ((centre - 0.8 * half).max(0.0) as usize, (centre + 0.8 * half).max(0.0) as usize);
    let y0 = (pedestal.top_at(centre) + off_px).max(0.0) as usize + STAND_OFF;
    let rows = y0..(y0 + 4 * AVERAGED).min(plane.height);
    let points: Vec<(f64, f64)> = rows
        .flat_map(|y| {
            (x0..=x1.min(plane.width - 1)).map(move |x| (x as f64 - centre, f64::from(plane.at(x, y))))
        })
        .collect();
    fit_line(&points).map(|[level, slope]| (level, slope))
}

/// The line of the top, and how many columns show it, seen where the grey value steps, beside the grain or under it; with this lean (rows per
/// column) where it is known.
fn level_top(
    plane: &Plane,
    rough: &Pedestal,
    body: f64,
    noise: f64,
    lean: Option<f64>,
) -> Option<(Line, usize)> {
    let row = rough.top_at(rough.centre().0);
    let [l, r] = rough.sides_at(row);
    let (x0, x1) = ((l + CORNER).ceil().max(0.0) as usize, (r - CORNER).floor().max(0.0) as usize);
    let reach = (STAND_OFF + AVERAGED) as f64;
    if row < reach || x1 <= x0 + 4 || x1 >= plane.width {
        return None;
    }
    let middle = row.round() as usize;
    let least = (LEAST_STEP * body.abs()).max(4.0 * noise);
    let mut points: Vec<(f64, f64)> =
        (x0..=x1).filter_map(|x| Some((x as f64, edge(plane, x, middle, least)?))).collect();
    let columns = (x1 + 1 - x0) as f64;
    if points.len() < 2 {
        return None;
    }
    let slope = lean.unwrap_or(0.0);
    let mut line = [densest(points.iter().map(|p| p.1 - slope * p.0).collect()), slope];
    for _ in 0..ROUNDS {
        let off = |p: &(f64, f64), line: &Line| (p.1 - line[0] - line[1] * p.0).abs();
        let mut all: Vec<f64> = points.iter().map(|p| off(p, &line)).collect();
        let limit = (2.5 * 1.4826 * median(&mut all)).clamp(0.5, 2.0 * LINE_TOLERANCE);
        let near: Vec<(f64, f64)> = points.iter().filter(|p| off(p, &line) <= limit).copied().collect();
        line = match lean {
            _ if near.is_empty() => return None,
            Some(lean) => [near.iter().map(|p| p.1 - lean * p.0).sum::<f64>() / near.len() as f64, lean],
            None => fit_line(&near)?,
        };
    }
    points.retain(|p| (p.1 - line[0] - line[1] * p.0).abs() <= LINE_TOLERANCE);
    (points.len() as f64 >= LEAST_SEEN * columns && line[1].abs() <= GREATEST_LEAN)
        .then_some((line, points.len()))
}

/// The middle of the shortest interval that holds half of the values, of which there is at least one.
fn densest(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len().div_ceil(2);
    (values.windows(half))
        .map(|w| (w[half - 1] - w[0], w[half / 2]))
        .reduce(|best, w| if w.0 < best.0 { w } else { best })
        .map_or(f64::NAN, |w| w.1)
}

/// Row at which the grey value of a column is half-way between the pedestal and what is above it.
fn edge(plane: &Plane, x: usize, middle: usize, least: f64) -> Option<f64> {
    let mean = |rows: std::ops::Range<usize>| {
        let n = rows.len() as f64;
        rows.map(|y| f64::from(plane.at(x, y))).sum::<f64>() / n
    };
    let low_end = middle + STAND_OFF;
    let high_end = middle.checked_sub(STAND_OFF + AVERAGED)?;
    if low_end + 1 >= plane.height {
        return None;
    }
    let below = mean(low_end..(low_end + AVERAGED).min(plane.height));
    let far = mean(high_end..high_end + AVERAGED);
    // Where a gap shows between pedestal and grain, what is next to the pedestal is the gap, not the grain.
    let gap = (high_end..low_end).map(|y| mean(y..y + 2)).fold(f64::INFINITY, f64::min);
    let above = if gap < far.min(below) - least { gap } else { far };
    if (below - above).abs() < least {
        return None;
    }
    let part = |y: usize| (f64::from(plane.at(x, y)) - above) / (below - above) - 0.5;
    let y = (high_end + AVERAGED..=low_end).rev().find(|&y| part(y) < 0.0)?;
    let (a, b) = (part(y), part(y + 1));
    (b > 0.0).then(|| y as f64 - a / (b - a))
}

/// Both sides again, between pixels: where each row is half-way between background and pedestal.
fn sharpen_sides(plane: &Plane, rough: Pedestal, body: f64) -> Pedestal {
    let (centre, _) = rough.centre();
    let first = rough.top_at(centre).max(0.0) as usize + STAND_OFF;
    let side = |line: Line, outwards: isize| {
        let points: Vec<(f64, f64)> = (first..plane.height)
            .filter_map(|y| {
                let start = (line[0] + line[1] * y as f64).round() as isize - 4 * outwards;
                let at = |k: isize| {
                    let x = start + k * outwards;
                    (0..plane.width as isize)
                        .contains(&x)
                        .then(|| f64::from(plane.at(x as usize, y)) / body - 0.5)
                };
                (0..8).find_map(|k| {
                    let (a, b) = (at(k)?, at(k + 1)?);
                    (a >= 0.0 && b < 0.0)
                        .then(|| (y as f64, start as f64 + (k as f64 + a / (a - b)) * outwards as f64))
                })
            })
            .collect();
        if points.len() < 4 { line } else { fit_line(&points).unwrap_or(line) }
    };
    Pedestal { left: side(rough.left, -1), right: side(rough.right, 1), ..rough }
}

/// Standard deviation of the sides' blur, pixels, from where the mean profile over a side is steepest: an edge of height h blurred by σ has
/// h/2 there and the slope h/(σ√2π), whatever the level does further inside, where a round pedestal's own shading begins.
fn blur(plane: &Plane, pedestal: &Pedestal) -> f64 {
    let first = pedestal.top_at(pedestal.centre().0).max(0.0) as usize + STAND_OFF;
    let mut sum = [0.0; 2];
    for (side, outwards) in [-1.0, 1.0].into_iter().enumerate() {
        let mut profile = [0.0; 2 * PROFILE + 1];
        for y in first..plane.height {
            let column = pedestal.sides_at(y as f64)[side];
            for (k, mean) in profile.iter_mut().enumerate() {
                let x = (column + outwards * (k as f64 - PROFILE as f64)).round().max(0.0) as usize;
                *mean += pedestal.level.signum() * f64::from(plane.at(x.min(plane.width - 1), y));
            }
        }
        let steepest = (1..2 * PROFILE)
            .map(|k| (0.5 * (profile[k - 1] - profile[k + 1]), profile[k]))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((slope, height)) = steepest.filter(|(slope, height)| *slope > 0.0 && *height > 0.0) {
            let rise = (2.0 * height).min(pedestal.level.abs() * (plane.height - first) as f64);
            let over_two_pixels = rise / (slope * std::f64::consts::TAU.sqrt());
            sum[0] += (over_two_pixels.powi(2) - 1.0 / 3.0).max(0.0).sqrt();
            sum[1] += 1.0;
        }
    }
    if sum[1] > 0.0 { sum[0] / sum[1] } else { 0.0 }
}

/// Least squares through `(x, y)`: value at 0 and slope.
fn fit_line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    if points.len() < 2 {
        return None;
    }
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let xx: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let xy: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    (xx > 0.0).then(|| [my - xy / xx * mx, xy / xx])
}

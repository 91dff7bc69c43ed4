//! The rotation axis as a line in the picture: mirror symmetry of opposite views, or tangency about the half turn.

use crate::geometry::Angle;
use crate::silhouette::Silhouette;
use serde::{Deserialize, Serialize};

/// Two views count as opposite when they are half a turn apart within this, degrees.
const OPPOSITE_WITHIN_DEG: f64 = 0.5;
/// Iterations of the mirror fit; it converges in three or four.
const MIRROR_ITERATIONS: usize = 12;
/// The fit starts from the column that maps one outline's mean to the other's; a residual beyond this many
/// pixels (a bump on one side only, dust) is held back.
const ROBUST_PX: f64 = 3.0;

/// How the axis was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AxisMethod {
    /// Opposite views are each other's mirror image in the axis.
    Mirror,
    /// The views next to the half turn must be tangent to one body.
    Tangency,
    /// Given by the user.
    Given,
}

/// The rotation axis as a line in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Column where the axis crosses `row_px`.
    pub column_px: f64,
    /// The row at which the column is given.
    pub row_px: f64,
    /// Roll (see [`super::Turntable::roll_rad`]), radians.
    pub roll_rad: f64,
    /// Root mean square of what the outlines disagree by, pixels.
    pub residual_px: f64,
    /// How it was found.
    pub method: AxisMethod,
}

/// Why no axis was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AxisError {
    /// The views neither hold an opposite pair nor cover half a turn evenly.
    #[error(
        "{views} views hold no opposite pair (180° ± {OPPOSITE_WITHIN_DEG}°) and do not cover half a turn in even \
         steps; capture a closing view at 180°, or give the axis column"
    )]
    Unobservable {
        /// How many views.
        views: usize,
    },
    /// The outlines share no rows.
    #[error(
        "the silhouettes share {rows} rows, the axis needs at least {needed}; check that all views show the grain"
    )]
    NoCommonRows {
        /// Rows in common.
        rows: usize,
        /// Rows needed.
        needed: usize,
    },
}

/// The axis from views at known angles: from all opposite pairs where there are any, else from the tangency
/// of the outlines about the half turn.
///
/// # Errors
/// [`AxisError`] where the views don't show it.
pub fn find_axis(views: &[(Angle, &Silhouette)]) -> Result<Axis, AxisError> {
    let mut found = Vec::new();
    for (i, (a, first)) in views.iter().enumerate() {
        for (b, second) in &views[i + 1..] {
            if ((*b - *a).deg().abs() - 180.0).abs() <= OPPOSITE_WITHIN_DEG {
                found.push(axis_from_closing_view(first, second)?);
            }
        }
    }
    match found.len() {
        0 => axis_from_tangency(views),
        n => {
            let k = 1.0 / n as f64;
            // The columns are given at each pair's own row: bring them to the first one's.
            let row = found[0].row_px;
            Ok(Axis {
                column_px: found
                    .iter()
                    .map(|f| f.column_px + f.roll_rad.tan() * (row - f.row_px))
                    .sum::<f64>()
                    * k,
                row_px: row,
                roll_rad: found.iter().map(|f| f.roll_rad).sum::<f64>() * k,
                residual_px: (found.iter().map(|f| f.residual_px.powi(2)).sum::<f64>() * k).sqrt(),
                method: AxisMethod::Mirror,
            })
        }
    }
}

/// The axis as the line in which one silhouette is the mirror image of the other (half a turn apart).
///
/// Gauss–Newton on two unknowns, column c and lean φ: the mirrored outline of the first view must lie on the
/// second's, whose signed distance is d₂,
///
/// ```text
/// Σ ρ(d₂(p − 2 (n·(p − o)) n)) → min,   n = (cos φ, −sin φ),   o = (c, row),   ρ: Huber's function
/// ```
///
/// Exact for telecentric views; for a pinhole camera exact to the first order of size over distance.
///
/// # Errors
/// [`AxisError::NoCommonRows`] where a silhouette is too small to fit a line.
pub fn axis_from_closing_view(first: &Silhouette, closing: &Silhouette) -> Result<Axis, AxisError> {
    let outline = outline_points(first);
    let other = outline_points(closing);
    let needed = 16;
    if outline.len() < needed || other.len() < needed {
        return Err(AxisError::NoCommonRows { rows: outline.len().min(other.len()) / 2, needed: needed / 2 });
    }
    let mean = |points: &[[f64; 2]], k: usize| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64;
    let row_px = 0.5 * (mean(&outline, 1) + mean(&other, 1));
    // Parameters: column at `row_px` and the lean φ of the axis line's direction (−sin φ, −cos φ) upwards.
    let mut x = [0.5 * (mean(&outline, 0) + mean(&other, 0)), 0.0];
    let mirrored = |x: &[f64; 2], p: &[f64; 2]| {
        let (s, c) = x[1].sin_cos();
        let normal = [c, -s];
        let along = 2.0 * ((p[0] - x[0]) * normal[0] + (p[1] - row_px) * normal[1]);
        [p[0] - along * normal[0], p[1] - along * normal[1]]
    };
    let residuals = |x: &[f64; 2]| -> Vec<f64> {
        outline.iter().map(|p| closing.signed_distance_px(mirrored(x, p))).collect()
    };
    for _ in 0..MIRROR_ITERATIONS {
        let r = residuals(&x);
        let steps = [0.25, 0.001];
        let columns: [Vec<f64>; 2] = std::array::from_fn(|k| {
            let (mut low, mut high) = (x, x);
            low[k] -= steps[k];
            high[k] += steps[k];
            let (a, b) = (residuals(&low), residuals(&high));
            a.iter().zip(&b).map(|(a, b)| (b - a) / (2.0 * steps[k])).collect()
        });
        let mut normal = [[0.0; 2]; 2];
        let mut right = [0.0; 2];
        for n in 0..r.len() {
            let weight = if r[n].abs() <= ROBUST_PX { 1.0 } else { ROBUST_PX / r[n].abs() };
            for i in 0..2 {
                right[i] -= weight * columns[i][n] * r[n];
                for j in 0..2 {
                    normal[i][j] += weight * columns[i][n] * columns[j][n];
                }
            }
        }
        let det = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
        if det <= 1e-12 * normal[0][0] * normal[1][1] {
            break;
        }
        let step = [
            (right[0] * normal[1][1] - right[1] * normal[0][1]) / det,
            (right[1] * normal[0][0] - right[0] * normal[1][0]) / det,
        ];
        x[0] += step[0];
        x[1] += step[1];
        if step[0].abs() < 1e-6 && step[1].abs() < 1e-9 {
            break;
        }
    }
    let r = residuals(&x);
    let residual_px = (r.iter().map(|d| d.min(ROBUST_PX).powi(2)).sum::<f64>() / r.len() as f64).sqrt();
    Ok(Axis { column_px: x[0], row_px, roll_rad: x[1], residual_px, method: AxisMethod::Mirror })
}

/// Points of the outline: both ends of every row, subpixel.
fn outline_points(s: &Silhouette) -> Vec<[f64; 2]> {
    (s.extents_px().iter().enumerate())
        .filter_map(|(j, e)| e.map(|e| (j, e)))
        .flat_map(|(j, [l, r])| {
            let row = (s.origin[1] + j) as f64;
            [[l, row], [r, row]]
        })
        .collect()
}

/// The axis from views that cover half a turn in even steps Δ (telecentric, or nearly so).
///
/// With support h on one side of a slice, the view at i is tangent to what its neighbours allow only if
/// h(i−1) + h(i+1) ≥ 2 h(i) cos Δ. About the half turn the neighbour is the first view seen from behind, whose
/// support is the axis' column less its left end: two inequalities that hold the column from both sides in
/// every row. Their middle, by a robust line over the rows, is the axis (after Mendonça, Wong & Cipolla 2001:
/// epipolar tangency).
///
/// # Errors
/// [`AxisError`] where the views are not even, or share too few rows.
pub fn axis_from_tangency(views: &[(Angle, &Silhouette)]) -> Result<Axis, AxisError> {
    let n = views.len();
    if n < 4 {
        return Err(AxisError::Unobservable { views: n });
    }
    let step = (views[n - 1].0 - views[0].0) * (1.0 / (n - 1) as f64);
    let even = views.windows(2).all(|w| ((w[1].0 - w[0].0 - step).deg()).abs() < 0.5);
    if !even || ((step * n as f64).deg().abs() - 180.0).abs() > OPPOSITE_WITHIN_DEG {
        return Err(AxisError::Unobservable { views: n });
    }
    let rows: Vec<(usize, Vec<Option<[f64; 2]>>)> =
        [0, 1, n - 2, n - 1].map(|i| (views[i].1.origin[1], views[i].1.extents_px())).into();
    let get = |view: usize, row: usize| -> Option<[f64; 2]> {
        let (first, extents) = &rows[view];
        extents.get(row.checked_sub(*first)?).copied().flatten()
    };
    let last_row = rows.iter().map(|(o, e)| o + e.len()).max().unwrap_or(0);
    let k = 1.0 / (2.0 * step.rad().cos());
    let mut lines = Vec::new();
    for row in 0..last_row {
        let (Some(e0), Some(e1), Some(e2), Some(e3)) = (get(0, row), get(1, row), get(2, row), get(3, row))
        else {
            continue;
        };
        // Right end now, left end half a turn later; and the other way round.
        for side in [0, 1] {
            let other = 1 - side;
            let one = e3[side] - (e2[side] - e0[other]) * k;
            let two = e0[other] + (e3[side] - e1[other]) * k;
            lines.push((row as f64, 0.5 * (one + two)));
        }
    }
    let needed = 8;
    if lines.len() < 2 * needed {
        return Err(AxisError::NoCommonRows { rows: lines.len() / 2, needed });
    }
    let (column, slope, row_px, residual_px) = robust_line(&lines);
    Ok(Axis { column_px: column, row_px, roll_rad: slope.atan(), residual_px, method: AxisMethod::Tangency })
}

/// A line column = a + b (row − mean row) that outliers don't move: iteratively reweighted least squares.
fn robust_line(points: &[(f64, f64)]) -> (f64, f64, f64, f64) {
    let n = points.len() as f64;
    let mean_row = points.iter().map(|p| p.0).sum::<f64>() / n;
    let mut sorted: Vec<f64> = points.iter().map(|p| p.1).collect();
    sorted.sort_by(f64::total_cmp);
    let (mut a, mut b) = (sorted[sorted.len() / 2], 0.0);
    let mut rms = 0.0;
    for _ in 0..30 {
        let r: Vec<f64> = points.iter().map(|p| p.1 - a - b * (p.0 - mean_row)).collect();
        let mut sizes: Vec<f64> = r.iter().map(|r| r.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let scale = (1.5 * sizes[sizes.len() / 2]).max(1e-6);
        let (mut sw, mut sx, mut sxx, mut sy, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (p, r) in points.iter().zip(&r) {
            let w = 1.0 / (1.0 + (r / scale).powi(2));
            let x = p.0 - mean_row;
            sw += w;
            sx += w * x;
            sxx += w * x * x;
            sy += w * p.1;
            sxy += w * x * p.1;
        }
        let det = sw * sxx - sx * sx;
        if det <= 0.0 {
            break;
        }
        a = (sy * sxx - sx * sxy) / det;
        b = (sw * sxy - sx * sy) / det;
        rms = scale;
    }
    (a, b, mean_row, rms)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The silhouette of an ellipse about `c`, turned by `tilt`, as a distance (first order at the outline).
    fn ellipse(c: [f64; 2], half: [f64; 2], tilt: f64) -> Silhouette {
        let size = [400, 300];
        let (s, k) = tilt.sin_cos();
        let distance_px = (0..size[0] * size[1])
            .map(|n| {
                let (x, y) = ((n % size[0]) as f64 - c[0], (n / size[0]) as f64 - c[1]);
                let (u, v) = (x * k + y * s, y * k - x * s);
                let f = (u / half[0]).hypot(v / half[1]);
                let g = (u / half[0].powi(2)).hypot(v / half[1].powi(2)) / f.max(1e-9);
                ((f - 1.0) / g.max(1e-9)) as f32
            })
            .collect();
        Silhouette { picture: size, origin: [0, 0], size, distance_px }
    }

    #[test]
    fn a_mirrored_pair_shows_column_and_roll() {
        // Mirror an ellipse in the line through (207, 150) that leans by 0.8°.
        let roll = 0.8f64.to_radians();
        let (c, tilt) = ([190.0, 140.0], 0.5);
        let normal = [roll.cos(), -roll.sin()];
        let d = 2.0 * ((c[0] - 207.0) * normal[0] + (c[1] - 150.0) * normal[1]);
        let mirrored = [c[0] - d * normal[0], c[1] - d * normal[1]];
        let a = ellipse(c, [70.0, 110.0], tilt);
        let b = ellipse(mirrored, [70.0, 110.0], -tilt - 2.0 * roll);
        let axis = axis_from_closing_view(&a, &b).unwrap();
        let at = axis.column_px + axis.roll_rad.tan() * (150.0 - axis.row_px);
        assert!((at - 207.0).abs() < 0.05, "{axis:?} {at}");
        assert!((axis.roll_rad - roll).abs() < 5e-4, "{axis:?}");
    }

    #[test]
    fn a_cylinder_off_the_axis_shows_the_column_without_a_closing_view() {
        // An elliptic cylinder 31 px off the axis at column 180: every row is the same slice.
        let n = 25;
        let views: Vec<(Angle, Silhouette)> = (0..n)
            .map(|i| {
                let a = Angle::from_deg(7.2 * f64::from(i));
                let center = 180.0 + 31.0 * (a.rad() + 0.3).cos();
                let h =
                    ((60.0 * (a.rad() + 1.0).cos()).powi(2) + (45.0 * (a.rad() + 1.0).sin()).powi(2)).sqrt();
                let size = [400, 40];
                let distance_px =
                    (0..400 * 40).map(|k| ((f64::from(k % 400) - center).abs() - h) as f32).collect();
                (a, Silhouette { picture: size, origin: [0, 0], size, distance_px })
            })
            .collect();
        let refs: Vec<(Angle, &Silhouette)> = views.iter().map(|(a, s)| (*a, s)).collect();
        let axis = find_axis(&refs).unwrap();
        assert_eq!(axis.method, AxisMethod::Tangency);
        assert!((axis.column_px - 180.0).abs() < 0.2, "{axis:?}");
        assert!(axis.roll_rad.abs() < 1e-3);
        assert_eq!(find_axis(&refs[..10]), Err(AxisError::Unobservable { views: 10 }));
    }
}

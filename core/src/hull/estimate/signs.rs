//! Signs of hollows: concavity, curvature variation, axial variation, gaps.

use super::tangents::{Tangent, Tangents};
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// The height over which slices are compared, as a share of the grain's diameter.
const APART: f64 = 0.05;
/// Of the slices at least this share must be polygons, and of the pairs that are compared: thinner than the outlines'
/// errors, a slice's tangents leave no point inside all of them.
const LEAST_SLICES: f64 = 0.5;

/// Figures of the views that go with the hull's excess; without unit, and free of the grain's size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Signs {
    /// Concavity of the outlines: the share of its convex hull that an outline leaves free, in the mean over the views.
    /// 0 for a convex body. What the outlines show of hollows, slices have across it too, where no level view sees it.
    #[serde(rename = "empty")]
    pub concavity: f64,
    /// Curvature variation of the slices: the coefficient of variation of the radius of curvature, from
    /// one direction to the next. The radius between two tangents is the length of the polygon's edge over the angle.
    /// 0 for a circle; over a hollow the polygon has a long edge, beside it short ones, and so it has over a facet.
    #[serde(rename = "unsteady")]
    pub curvature_variation: f64,
    /// Axial variation: how soon the polygons' edges change along the axis, half the sum of what each edge, as a share of the way round,
    /// gains or loses over 5 % of the diameter. Facets and rounded sides stay; lines of sight that rest on single bumps
    /// jump from one to the next.
    #[serde(rename = "restless")]
    pub axial_variation: f64,
    /// The share of the outlines' breadths that is gap: light between parts of the grain at the same height.
    pub gaps: f64,
    /// Slenderness: the height of what is seen over its breadth, the mean over heights and directions. Of a body that
    /// lies flat more of the surface faces up or down, and hollows there no level view sees.
    #[serde(rename = "slender")]
    pub slenderness: f64,
    /// Different directions of view.
    pub views: f64,
}

impl Signs {
    /// From the tangents of a hull that is so high; `None` where too few of its slices are polygons.
    pub(super) fn of(tangents: &Tangents, height_mm: f64, [concavity, gaps]: [f64; 2]) -> Option<Self> {
        let rows = &tangents.rows;
        let directions = rows.first()?.len();
        let reaches =
            rows.iter().flatten().map(|t| t.reach_mm).sum::<f64>() / (rows.len() * directions) as f64;
        // The mean breadth times the height is the mean outline's area.
        let diameter = (4.0 / PI * 2.0 * reaches.max(0.0) * height_mm).sqrt();
        let slices: Vec<Option<Slice>> = rows.iter().map(|row| Slice::of(row)).collect();
        let (mut area, mut polygons, mut curvature_variation) = (0.0, 0, 0.0);
        for slice in slices.iter().flatten() {
            area += slice.area;
            polygons += 1;
            curvature_variation += slice.area * slice.curvature_variation;
        }
        let apart = ((APART * diameter / tangents.pitch_mm).round() as usize).clamp(1, rows.len().max(2) - 1);
        let (mut pairs, mut axial_variation) = (0, 0.0);
        for (a, b) in slices.iter().zip(&slices[apart.min(slices.len())..]) {
            let Some((a, b)) = a.as_ref().zip(b.as_ref()) else { continue };
            let change = a.shares.iter().zip(&b.shares).map(|(a, b)| (a - b).abs()).sum::<f64>();
            axial_variation += 0.5 * change * (a.area * b.area).sqrt();
            pairs += 1;
        }
        let enough = |some: usize, of: usize| some > 0 && some as f64 >= LEAST_SLICES * of as f64;
        if !enough(polygons, rows.len()) || !enough(pairs, rows.len() - apart) {
            return None;
        }
        let views = 0.5 * directions as f64;
        Some(Self {
            concavity,
            curvature_variation: curvature_variation / area,
            axial_variation: axial_variation / area,
            gaps,
            slenderness: height_mm / (2.0 * reaches),
            views,
        })
    }
}

/// A slice's polygon.
struct Slice {
    area: f64,
    /// The edges' shares of the way round.
    shares: Vec<f64>,
    /// As [`Signs::curvature_variation`].
    curvature_variation: f64,
}

impl Slice {
    /// The polygon of a row's tangents; `None` where they leave no point inside all of them.
    fn of(row: &[Tangent]) -> Option<Self> {
        let n = row.len();
        let (after, before) = (|i: usize| (i + 1) % n, |i: usize| (i + n - 1) % n);
        let turn: Vec<f64> =
            (0..n).map(|i| (row[after(i)].direction - row[i].direction).rem_euclid(TAU)).collect();
        // From the corner with the tangent before to the corner with the one after; a tangent that the two leave
        // outside, by the outlines' errors, has no edge.
        let edges: Vec<f64> = (0..n)
            .map(|i| {
                let here = row[i].reach_mm;
                let part = |other: usize, by: f64| (row[other].reach_mm - here * by.cos()) / by.sin();
                (part(after(i), turn[i]) + part(before(i), turn[before(i)])).max(0.0)
            })
            .collect();
        let around = edges.iter().sum::<f64>();
        let shares: Vec<f64> = edges.iter().map(|e| e / around).collect();
        let angle = |i: usize| 0.5 * (turn[i] + turn[before(i)]) / TAU;
        let variance = (0..n).map(|i| angle(i) * (shares[i] / angle(i) - 1.0).powi(2)).sum::<f64>();
        // Reaches count from the hull's middle, which may lie far outside this slice; edges that were left out do not
        // close, and an area about a far point would then be anything, also negative. So it is about the slice's own.
        let [x, y] = [f64::cos, f64::sin]
            .map(|part| row.iter().map(|t| t.reach_mm * part(t.direction)).sum::<f64>() * 2.0 / n as f64);
        let reach = |t: &Tangent| t.reach_mm - x * t.direction.cos() - y * t.direction.sin();
        let area = 0.5 * edges.iter().zip(row).map(|(edge, tangent)| edge * reach(tangent)).sum::<f64>();
        (around > 0.0 && area > 0.0 && variance.is_finite()).then(|| Self {
            area,
            shares,
            curvature_variation: variance.sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tangents of a strip so thick and so wide, its middle at a point, in directions 7.2° apart; each is off by
    /// `error`.
    fn strip(thick: f64, wide: f64, middle: [f64; 2], error: impl Fn(usize) -> f64) -> Vec<Tangent> {
        (0..50)
            .map(|k| {
                let direction = TAU * f64::from(k) / 50.0;
                let (sin, cos) = direction.sin_cos();
                let reach = 0.5 * (wide * cos.abs() + thick * sin.abs()) + middle[0] * cos + middle[1] * sin;
                Tangent { direction, reach_mm: reach + error(k as usize) }
            })
            .collect()
    }

    #[test]
    fn a_slice_far_from_the_hulls_middle_has_the_same_area() {
        let at = |middle| Slice::of(&strip(0.2, 0.5, middle, |_| 0.0)).unwrap();
        let (here, there) = (at([0.0, 0.0]), at([7.0, -3.0]));
        assert!((here.area / there.area - 1.0).abs() < 1e-9 && here.area > 0.1, "{}", here.area);
        assert!((here.curvature_variation - there.curvature_variation).abs() < 1e-9);
    }

    #[test]
    fn slices_thinner_than_their_errors_are_left_out_or_have_an_area_and_no_sign_is_no_number() {
        let mut left_out = 0;
        for thick in [0.0, 1e-6, 0.001, 0.01] {
            for off in [0.0, 0.3, 5.0] {
                // Errors of a hundredth to either side, alternating and not.
                let rows: Vec<Vec<Tangent>> = (0..60)
                    .map(|row| {
                        let error = move |k: usize| 0.01 * ((k * k * 7 + row * 13) % 11) as f64 / 5.0 - 0.01;
                        strip(thick, 0.5, [off, -off], error)
                    })
                    .collect();
                left_out += rows.iter().filter(|row| Slice::of(row).is_none()).count();
                for slice in rows.iter().filter_map(|row| Slice::of(row)) {
                    assert!(slice.area > 0.0 && slice.curvature_variation.is_finite());
                }
                let signs = Signs::of(&Tangents { pitch_mm: 0.01, rows }, 0.6, [0.1, 0.0]);
                if let Some(s) = signs {
                    assert!(
                        [s.curvature_variation, s.axial_variation].iter().all(|v| v.is_finite() && *v >= 0.0),
                        "{s:?}"
                    );
                }
            }
        }
        let inside_out: Vec<Tangent> = strip(0.1, 0.1, [0.0, 0.0], |_| -0.2);
        assert!(Slice::of(&inside_out).is_none(), "{left_out}");
        let rows = vec![inside_out; 60];
        assert!(Signs::of(&Tangents { pitch_mm: 0.01, rows }, 0.6, [0.0, 0.0]).is_none());
    }
}

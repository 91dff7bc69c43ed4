//! What the tangents show of the hollows that they can't see.

use super::tangents::{Tangent, Tangents};
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// The height over which slices are compared, as a share of the grain's diameter.
const APART: f64 = 0.05;

/// Figures of the views that go with the hull's excess; without unit, and free of the grain's size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Signs {
    /// How empty the outlines are: the share of its convex hull that an outline leaves free, in the mean over the views.
    /// 0 for a convex body. What the outlines show of hollows, slices have across it too, where no level view sees it.
    pub empty: f64,
    /// How unsteady the slices' curvature is: the standard deviation of the radius of curvature over its mean, from
    /// one direction to the next. The radius between two tangents is the length of the polygon's edge over the angle.
    /// 0 for a circle; over a hollow the polygon has a long edge, beside it short ones, and so it has over a facet.
    pub unsteady: f64,
    /// How soon the polygons' edges change along the axis: half the sum of what each edge, as a share of the way round,
    /// gains or loses over 5 % of the diameter. Facets and rounded sides stay; lines of sight that rest on single bumps
    /// jump from one to the next.
    pub restless: f64,
    /// The share of the outlines' breadths that is gap: light between parts of the grain at the same height.
    pub gaps: f64,
    /// Different directions of view.
    pub views: f64,
}

impl Signs {
    /// From the tangents of a hull that is so high.
    pub(super) fn of(tangents: &Tangents, height_mm: f64, [empty, gaps]: [f64; 2]) -> Self {
        let rows = &tangents.rows;
        let directions = rows[0].len();
        let reaches =
            rows.iter().flatten().map(|t| t.reach_mm).sum::<f64>() / (rows.len() * directions) as f64;
        // The mean breadth times the height is the mean outline's area.
        let diameter = (4.0 / PI * 2.0 * reaches * height_mm).sqrt();
        let slices: Vec<Slice> = rows.iter().map(|row| Slice::of(row)).collect();
        let area = slices.iter().map(|s| s.area).sum::<f64>();
        let unsteady = slices.iter().map(|s| s.area * s.unsteady).sum::<f64>() / area;
        let apart = ((APART * diameter / tangents.pitch_mm).round() as usize).clamp(1, rows.len() - 1);
        let restless = (slices.iter().zip(&slices[apart..]))
            .map(|(a, b)| {
                let change = a.shares.iter().zip(&b.shares).map(|(a, b)| (a - b).abs()).sum::<f64>();
                0.5 * change * (a.area * b.area).sqrt()
            })
            .sum::<f64>()
            / area;
        Self { empty, unsteady, restless, gaps, views: 0.5 * directions as f64 }
    }
}

/// A slice's polygon.
struct Slice {
    area: f64,
    /// The edges' shares of the way round.
    shares: Vec<f64>,
    /// As [`Signs::unsteady`].
    unsteady: f64,
}

impl Slice {
    fn of(row: &[Tangent]) -> Self {
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
        let area = 0.5 * (0..n).map(|i| edges[i] * row[i].reach_mm).sum::<f64>();
        Self { area, shares, unsteady: variance.sqrt() }
    }
}

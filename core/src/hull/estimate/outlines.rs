//! Concavity and gaps of single outlines, whatever their cameras.

use crate::silhouette::Silhouette;

/// The share of the outlines' breadths, row by row, that lies between parts of the grain.
pub(super) fn gaps<'a>(silhouettes: impl Iterator<Item = &'a Silhouette>) -> f64 {
    let (mut area, mut breadth) = (0.0, 0.0);
    for s in silhouettes {
        area += s.area_px();
        breadth += s.extents_px().into_iter().flatten().map(|[left, right]| right - left).sum::<f64>();
    }
    // The breadths of pixel rows are the area too, but for the ends' rounding.
    (1.0 - area / breadth).max(0.0)
}

/// Concavity: the share of its convex hull that an outline leaves empty, in the mean over the views: beside it, since gaps
/// count by themselves.
pub(super) fn concavity(silhouettes: &[&Silhouette]) -> f64 {
    use rayon::prelude::*;
    let each: Vec<f64> = (silhouettes.par_iter())
        .map(|s| {
            let extents = s.extents_px();
            let ends = extents.iter().enumerate().filter_map(|(row, e)| e.map(|e| (row as f64, e)));
            let mut points: Vec<[f64; 2]> =
                ends.clone().flat_map(|(row, [left, right])| [[left, row], [right, row]]).collect();
            // Each row is a pixel high: what lies between the first and the last row's middles is compared.
            let breadths: Vec<f64> = ends.map(|(_, [left, right])| right - left).collect();
            let ends = breadths.first().zip(breadths.last()).map_or(0.0, |(a, b)| 0.5 * (a + b));
            let area = breadths.iter().sum::<f64>() - ends;
            let around = convex_area(&mut points);
            if around > 0.0 { (1.0 - area / around).max(0.0) } else { 0.0 }
        })
        .collect();
    each.iter().sum::<f64>() / each.len().max(1) as f64
}

/// Area of the convex hull of points, by Andrew's monotone chain.
fn convex_area(points: &mut [[f64; 2]]) -> f64 {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let cross =
        |o: [f64; 2], a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut kept: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while kept.len() > 1 && cross(kept[kept.len() - 2], kept[kept.len() - 1], p) <= 0.0 {
                kept.pop();
            }
            kept.push(p);
        }
        kept
    };
    let mut ring = chain(&mut points.iter().copied());
    ring.pop();
    ring.extend(chain(&mut points.iter().rev().copied()));
    0.5 * ring.windows(2).map(|p| p[0][0] * p[1][1] - p[0][1] * p[1][0]).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a function of the point is negative in, as a field that is the distance across.
    fn field(inside: impl Fn(f64, f64) -> f64) -> Silhouette {
        let size = [120, 120];
        let distance_px =
            (0..size[0] * size[1]).map(|k| inside((k % 120) as f64, (k / 120) as f64) as f32).collect();
        Silhouette { picture: size, origin: [0, 0], size, distance_px }
    }

    #[test]
    fn a_disc_is_neither_empty_nor_has_gaps_a_cross_is_empty_and_bars_have_a_gap() {
        let disc = field(|x, y| (x - 60.0).hypot(y - 60.0) - 40.3);
        assert!(concavity(&[&disc]) < 2e-3, "{}", concavity(&[&disc]));
        assert!(gaps([&disc].into_iter()) < 2e-3, "{}", gaps([&disc].into_iter()));
        // Two bars 20 px wide, 40 px apart: half of what they span.
        let bars = field(|x, y| ((x - 60.0).abs() - 30.0).abs().max((y - 60.0).abs() - 30.0) - 10.0);
        let (hollow, gap) = (concavity(&[&bars]), gaps([&bars].into_iter()));
        assert!((gap - 0.5).abs() < 0.02 && hollow < 2e-3, "{gap} {hollow}");
        // Two bars of 60 by 20 px crossed, in an octagon of 60² px less four triangles of 20 by 20.
        let cross = field(|x, y| {
            let (x, y) = ((x - 60.0).abs(), (y - 60.0).abs());
            (x.max(y) - 30.0).max(x.min(y) - 10.0)
        });
        let expected = 1.0 - 2000.0 / 2800.0;
        assert!((concavity(&[&cross]) - expected).abs() < 0.02, "{}", concavity(&[&cross]));
    }
}

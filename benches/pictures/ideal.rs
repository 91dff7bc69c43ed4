//! The hull that true outlines and true cameras give: what no program can do better than.

use super::shape::Body;
use super::view::View;
use nalgebra::Vector3;
use rayon::prelude::*;

type V = Vector3<f64>;

/// Voxels along the grain's longest side.
const CELLS: f64 = 220.0;
/// Voxels along a block's side.
const BLOCK: usize = 8;

/// An outline: how much of each pixel is covered, and how many of the pixels above and to the left are not covered at all,
/// and wholly.
struct Mask<'a> {
    view: &'a View,
    coverage: &'a [f32],
    sums: Vec<[u32; 2]>,
    size: [usize; 2],
}

/// What an outline says of a block.
#[derive(PartialEq)]
enum Side {
    Inside,
    Outside,
    Either,
}

impl<'a> Mask<'a> {
    fn new(view: &'a View, coverage: &'a [f32], size: [usize; 2]) -> Self {
        let [w, h] = size;
        let mut sums = vec![[0; 2]; (w + 1) * (h + 1)];
        for y in 0..h {
            let mut row = [0; 2];
            for x in 0..w {
                let c = coverage[y * w + x];
                row[0] += u32::from(c == 0.0);
                row[1] += u32::from(c >= 1.0);
                let above = sums[y * (w + 1) + x + 1];
                sums[(y + 1) * (w + 1) + x + 1] = [above[0] + row[0], above[1] + row[1]];
            }
        }
        Self { view, coverage, sums, size }
    }

    /// Whether half would be covered where a point is seen, between pixels' middles.
    fn covers(&self, p: &V) -> bool {
        let [w, h] = self.size;
        let [u, v] = self.view.project(p);
        let (x, y) = (u.clamp(0.0, w as f64 - 1.001), v.clamp(0.0, h as f64 - 1.001));
        let (i, j) = (x as usize, y as usize);
        let (fx, fy) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let at = |i: usize, j: usize| self.coverage[j * w + i];
        let upper = at(i, j) * (1.0 - fx) + at(i + 1, j) * fx;
        let lower = at(i, j + 1) * (1.0 - fx) + at(i + 1, j + 1) * fx;
        upper * (1.0 - fy) + lower * fy >= 0.5
    }

    /// What it says of all points within `reach` pixels of where `middle` is seen.
    fn side(&self, middle: &V, reach: f64) -> Side {
        let at = self.view.project(middle);
        let range = |k: usize| {
            let most = self.size[k] as f64;
            let end = (at[k] + reach + 2.0).clamp(1.0, most) as usize;
            ((at[k] - reach - 1.0).clamp(0.0, most - 1.0) as usize).min(end - 1)..end
        };
        let (columns, rows) = (range(0), range(1));
        let w = self.size[0] + 1;
        let sum = |k: usize| {
            let at = |x: usize, y: usize| self.sums[y * w + x][k];
            at(columns.end, rows.end) + at(columns.start, rows.start)
                - at(columns.start, rows.end)
                - at(columns.end, rows.start)
        };
        let all = (columns.len() * rows.len()) as u32;
        match (sum(0) == all, sum(1) == all) {
            (true, _) => Side::Outside,
            (_, true) => Side::Inside,
            _ => Side::Either,
        }
    }
}

/// Volume of the hull above the pedestal's top, mm³: voxels whose middle is inside every outline. The outlines are
/// `[row, column]`, each pixel's share from 0 to 1.
pub fn hull_mm3(body: &Body, views: &[View], outlines: &[Vec<f32>], size: [usize; 2]) -> f64 {
    let Some(bounds) = body.mesh.bounds() else { return 0.0 };
    let masks: Vec<Mask> = views.iter().zip(outlines).map(|(v, c)| Mask::new(v, c, size)).collect();
    let low = V::new(bounds.min.x, bounds.min.y, bounds.min.z.max(0.0));
    let extent = bounds.max.coords - low;
    let edge = extent.max() / CELLS;
    let count = extent.map(|s| (s / edge).ceil() as usize);
    let blocks = count.map(|n| n.div_ceil(BLOCK));
    let half = 0.5 * BLOCK as f64;
    let kept = (0..blocks.x * blocks.y * blocks.z).into_par_iter().map(|n| {
        let block = [n % blocks.x, n / blocks.x % blocks.y, n / (blocks.x * blocks.y)];
        let first = block.map(|b| b * BLOCK);
        let end: [usize; 3] = std::array::from_fn(|k| (first[k] + BLOCK).min(count[k]));
        let middle = low + V::from(first.map(|f| f as f64 + half)) * edge;
        let mut unsure = Vec::new();
        for mask in &masks {
            // Half a block's diagonal; a tenth more than at the axis covers what is nearer to the camera.
            let reach = 1.1 * half * edge * 3f64.sqrt() * mask.view.px_per_mm();
            match mask.side(&middle, reach) {
                Side::Outside => return 0,
                Side::Inside => {}
                Side::Either => unsure.push(mask),
            }
        }
        let mut kept = 0;
        for k in first[2]..end[2] {
            for j in first[1]..end[1] {
                for i in first[0]..end[0] {
                    let p = low + V::new(i as f64 + 0.5, j as f64 + 0.5, k as f64 + 0.5) * edge;
                    kept += usize::from(unsure.iter().all(|mask| mask.covers(&p)));
                }
            }
        }
        kept
    });
    kept.sum::<usize>() as f64 * edge.powi(3)
}

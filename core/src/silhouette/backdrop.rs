//! Background model, what the picture would show without the grain: a smooth surface through the background, on top of the
//! picture of the empty stage where there is one.

use super::rect::Rect;
use super::reduced::Reduced;
use nalgebra::{SMatrix, SVector};

/// Terms of the surface: 1, x, y, x², xy, y².
const TERMS: usize = 6;
/// Cells that the surface is fitted to, at most about this many.
const SAMPLES: usize = 12_000;
/// Rounds of fitting and casting out.
const ROUNDS: usize = 6;
/// A cell further from the surface than this many standard deviations is not background.
const OUTLIER: f64 = 3.0;
/// The least standard deviation believed, grey levels: half the step of an 8-bit camera.
const NOISE_FLOOR: f64 = 0.5;
/// Cells around an object in the empty picture that its blur may reach.
const OBJECT_SIGMAS: f64 = 6.0;

/// The background's grey level at every pixel.
#[derive(Debug, Clone)]
pub(super) struct Backdrop {
    centre: [f64; 2],
    scale: [f64; 2],
    terms: [f64; TERMS],
    empty: Option<EmptyStage>,
    /// Standard deviation of the background cells about it, grey levels.
    pub noise: f64,
}

/// The picture of the empty stage, on the grid of cells.
#[derive(Debug, Clone)]
struct EmptyStage {
    factor: f64,
    first: [f64; 2],
    width: usize,
    height: usize,
    levels: Vec<f32>,
}

impl Backdrop {
    /// Fitted to the small copy of the picture in one channel; `empty` is the same of the empty stage.
    pub(super) fn fit(reduced: &Reduced, levels: &[f32], empty: Option<Vec<f32>>) -> Self {
        let empty = empty.map(|mut stage| {
            // What stands on the empty stage (the pedestal) is not background either: the surface goes on.
            let surface = Self::fit_surface(reduced, &stage);
            for (k, level) in stage.iter_mut().enumerate() {
                let model = surface
                    .surface(reduced.position(0, k % reduced.width), reduced.position(1, k / reduced.width));
                if (f64::from(*level) - model).abs() > OBJECT_SIGMAS * surface.noise {
                    *level = model as f32;
                }
            }
            EmptyStage {
                factor: reduced.factor as f64,
                first: [reduced.position(0, 0), reduced.position(1, 0)],
                width: reduced.width,
                height: reduced.height,
                levels: stage,
            }
        });
        match empty {
            None => Self::fit_surface(reduced, levels),
            Some(stage) => {
                let rest: Vec<f32> = levels.iter().zip(&stage.levels).map(|(a, b)| a - b).collect();
                Self { empty: Some(stage), ..Self::fit_surface(reduced, &rest) }
            }
        }
    }

    /// Least squares with outliers cast out, begun from the median of the picture's ends.
    fn fit_surface(reduced: &Reduced, levels: &[f32]) -> Self {
        let (w, h) = (reduced.width, reduced.height);
        let mut ring: Vec<f64> = reduced.ring().map(|k| f64::from(levels[k])).collect();
        let middle = median(&mut ring);
        let mut off: Vec<f64> = ring.iter().map(|v| (v - middle).abs()).collect();
        let noise = (1.4826 * median(&mut off)).max(NOISE_FLOOR);
        let position = |axis: usize, cells: usize| {
            let (first, last) = (reduced.position(axis, 0), reduced.position(axis, cells - 1));
            (0.5 * (first + last), (0.5 * (last - first)).max(1.0))
        };
        let ((cx, sx), (cy, sy)) = (position(0, w), position(1, h));
        let mut terms = [0.0; TERMS];
        terms[0] = middle;
        let mut fitted = Self { centre: [cx, cy], scale: [sx, sy], terms, empty: None, noise };
        let step = ((w * h) as f64 / SAMPLES as f64).sqrt().ceil().max(1.0) as usize;
        let samples: Vec<(bool, Sample)> = ((0..h).step_by(step))
            .flat_map(|j| (0..w).step_by(step).map(move |i| (i, j)))
            .map(|(i, j)| {
                let basis = fitted.basis(reduced.position(0, i), reduced.position(1, j));
                (reduced.in_ring(i, j), (basis, f64::from(levels[j * w + i])))
            })
            .collect();
        for round in 0..ROUNDS {
            // The first round bends the surface through the ends only, which see no grain.
            let used: Vec<Sample> = (samples.iter())
                .filter(|(in_ring, _)| round > 0 || *in_ring)
                .map(|(_, sample)| *sample)
                .filter(|(basis, v)| (v - fitted.at(basis)).abs() <= OUTLIER * fitted.noise)
                .collect();
            let Some(terms) = solve(&used) else { break };
            fitted.terms = terms;
            let mut off: Vec<f64> = used.iter().map(|(basis, v)| (v - fitted.at(basis)).abs()).collect();
            fitted.noise = (1.4826 * median(&mut off)).max(NOISE_FLOOR);
        }
        fitted
    }

    fn basis(&self, x: f64, y: f64) -> [f64; TERMS] {
        let (x, y) = ((x - self.centre[0]) / self.scale[0], (y - self.centre[1]) / self.scale[1]);
        [1.0, x, y, x * x, x * y, y * y]
    }

    fn surface(&self, x: f64, y: f64) -> f64 {
        self.at(&self.basis(x, y))
    }

    fn at(&self, basis: &[f64; TERMS]) -> f64 {
        basis.iter().zip(&self.terms).map(|(b, t)| b * t).sum()
    }

    /// The background's grey level in the middle of a rectangle.
    pub(super) fn level_at(&self, rect: &Rect) -> f32 {
        let mut row = vec![0.0; rect.width().max(1)];
        self.row(usize::midpoint(rect.y0, rect.y1), rect.x0, &mut row);
        row[row.len() / 2]
    }

    /// The background's grey levels along a row, for `out.len()` columns from `x0` on.
    pub(super) fn row(&self, y: usize, x0: usize, out: &mut [f32]) {
        let t = &self.terms;
        let v = (y as f64 - self.centre[1]) / self.scale[1];
        let (c0, c1, c2) = ((t[0] + v * (t[2] + v * t[5])) as f32, (t[1] + v * t[4]) as f32, t[3] as f32);
        let (start, pitch) =
            (((x0 as f64 - self.centre[0]) / self.scale[0]) as f32, (1.0 / self.scale[0]) as f32);
        for (k, level) in out.iter_mut().enumerate() {
            let u = start + k as f32 * pitch;
            *level = c0 + u * (c1 + u * c2);
        }
        if let Some(stage) = &self.empty {
            stage.add_row(y, x0, out);
        }
    }

    /// The background's grey level in every cell.
    pub(super) fn cells(&self, reduced: &Reduced) -> Vec<f32> {
        let (w, h) = (reduced.width, reduced.height);
        let t = &self.terms;
        let along: Vec<f64> =
            (0..w).map(|i| (reduced.position(0, i) - self.centre[0]) / self.scale[0]).collect();
        let mut levels = Vec::with_capacity(w * h);
        for j in 0..h {
            let v = (reduced.position(1, j) - self.centre[1]) / self.scale[1];
            let (c0, c1) = (t[0] + v * (t[2] + v * t[5]), t[1] + v * t[4]);
            levels.extend(along.iter().map(|u| (c0 + u * (c1 + u * t[3])) as f32));
        }
        if let Some(stage) = &self.empty {
            levels.iter_mut().zip(&stage.levels).for_each(|(a, b)| *a += b);
        }
        levels
    }
}

/// The basis functions at a position, and the level there.
type Sample = ([f64; TERMS], f64);

/// The terms that fit best.
fn solve(samples: &[Sample]) -> Option<[f64; TERMS]> {
    if samples.len() < 4 * TERMS {
        return None;
    }
    let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
    let mut right = SVector::<f64, TERMS>::zeros();
    // The lower half, which is what the decomposition reads.
    for (basis, v) in samples {
        for j in 0..TERMS {
            for i in j..TERMS {
                normal[(i, j)] += basis[i] * basis[j];
            }
            right[j] += basis[j] * v;
        }
    }
    // A trace of a ridge keeps the surface flat where no background is left to hold it.
    for k in 1..TERMS {
        normal[(k, k)] += 1e-6 * samples.len() as f64;
    }
    normal.cholesky().map(|c| c.solve(&right).into())
}

impl EmptyStage {
    /// Adds the bilinear level between cells.
    fn add_row(&self, y: usize, x0: usize, out: &mut [f32]) {
        let split = |position: f64, cells: usize| {
            let p = position.clamp(0.0, (cells - 1) as f64);
            let k = (p as usize).min(cells.saturating_sub(2));
            (k, (p - k as f64) as f32)
        };
        let (j, fy) = split((y as f64 - self.first[1]) / self.factor, self.height);
        let below = if self.height > 1 { self.width } else { 0 };
        let at = |i: usize| {
            let k = j * self.width + i;
            self.levels[k] + fy * (self.levels[k + below] - self.levels[k])
        };
        for (k, level) in out.iter_mut().enumerate() {
            let (i, fx) = split(((x0 + k) as f64 - self.first[0]) / self.factor, self.width);
            let next = (i + 1).min(self.width - 1);
            *level += at(i) + fx * (at(next) - at(i));
        }
    }
}

/// The middle value; 0 for none. Reorders.
pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

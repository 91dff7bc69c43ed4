//! The grain's slices as Gaussian random functions: support function, covariance, marginal likelihood.
//!
//! The reach of a slice in the direction t is its support function h(t). With ρ = h + h″, the radius of curvature of
//! the slice's convex hull, white about its mean along t, harmonic n of h has variance σ²/(n² − 1)²; harmonics 0 and
//! 1 (size and position) are free in every slice. Slices at heights Δz apart are alike as exp(−|Δz|/ℓ). Both together
//! make a covariance that is a Kronecker product,
//!
//! ```text
//! cov(h(t, z), h(t₁, z₁)) = σ² Σ_{n ≥ 2} cos n(t − t₁)/(n² − 1)² · exp(−|z − z₁|/ℓ)
//! ```
//!
//! so that in the eigenvectors of the heights' part every problem
//! falls into small ones. The free harmonics are left out by looking only at combinations of the directions that they do
//! not reach, which is what an unbounded variance comes to (kriging; Rasmussen and Williams, Gaussian Processes for Machine
//! Learning, 2006, §2.7 for the free terms, §5.4 for the marginal likelihood).

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

/// Harmonics that count.
const HARMONICS: usize = 60;
/// Free harmonics that differ by less than this in all directions are one (singular value).
const DEPENDENT: f64 = 1e-9;
/// Heights over which light and blur move an edge alike, as a share of the heights' range.
const EDGE_ALIKE: f64 = 0.08;

/// The steepest change of a reach along the axis that counts: beyond it the outline runs across the lines anyway.
const STEEPEST: f64 = 10.0;

/// What the likelihood is maximised over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hyper {
    /// Standard deviation of the curvature's harmonics, pixels.
    pub curvature_px: f64,
    /// ℓ as a share of the heights' range.
    pub alike: f64,
    /// Standard deviation of a reach where outlines run along the axis, pixels: what neighbouring heights share (an edge that light or blur
    /// moved), and what they do not.
    pub edge_px: f64,
    pub noise_px: f64,
    /// Standard deviation of the views' sideways shifts (radial runout), pixels.
    pub runout_px: f64,
    /// Standard deviation of the pedestal's position in a view, pixels.
    pub pedestal_px: f64,
}

/// The directions and heights at which reaches were read.
pub(super) struct Grid {
    /// Directions t, radians.
    t: Vec<f64>,
    heights: Vec<f64>,
    /// How many times as large a reach's error is at each height as where all outlines run along the axis.
    inclined: Vec<f64>,
    /// Covariance of the shape along t for a unit σ, and its derivative along the first direction.
    shape: DMatrix<f64>,
    slope: DMatrix<f64>,
    /// Combinations of the directions that the free harmonics do not reach, `[direction, combination]`, in which the shape
    /// is independent, with its variances there: one decomposition serves all heights and all spreads.
    seen: DMatrix<f64>,
    variances: Vec<f64>,
}

/// The free harmonics of a direction.
fn free(t: f64) -> [f64; 3] {
    [1.0, t.cos(), t.sin()]
}

/// Heights in the combinations in which both shape and noise are independent: with `N = LLᵀ` the noise's covariance and
/// `L⁻¹KL⁻ᵀ = UΛUᵀ`, reaches times `L⁻ᵀU` have unit noise and the shape's variances `Λ`.
struct Modes {
    transform: DMatrix<f64>,
    inverse: DMatrix<f64>,
    values: Vec<f64>,
    /// log |N|
    log_det: f64,
}

impl Grid {
    pub(super) fn new(t: Vec<f64>, heights: Vec<f64>) -> Self {
        let n = t.len();
        let sum = |f: &dyn Fn(f64, f64) -> f64| {
            DMatrix::from_fn(n, n, |i, j| {
                (2..HARMONICS).map(|k| k as f64).map(|k| f(k, t[i] - t[j]) / (k * k - 1.0).powi(2)).sum()
            })
        };
        let shape = sum(&|k, d| (k * d).cos());
        let slope = sum(&|k, d| -k * (k * d).sin());
        let basis = DMatrix::from_fn(n, 3, |i, k| free(t[i])[k]);
        let inverse = basis.clone().pseudo_inverse(DEPENDENT).unwrap_or_else(|_| DMatrix::zeros(3, n));
        let beside = DMatrix::identity(n, n) - &basis * &inverse;
        // What the free harmonics reach has the eigenvalue 0, all else at least the offset.
        let offset = 1.0;
        let eigen = SymmetricEigen::new(&beside * &shape * &beside + &beside * offset);
        let kept: Vec<usize> = (0..n).filter(|k| eigen.eigenvalues[*k] > 0.5 * offset).collect();
        let variances = kept.iter().map(|k| (eigen.eigenvalues[*k] - offset).max(0.0)).collect();
        let seen = eigen.eigenvectors.select_columns(&kept);
        let inclined = vec![1.0; heights.len()];
        Self { t, heights, inclined, shape, slope, seen, variances }
    }

    /// Takes over how much the reaches change along the axis, `[sample, height]`. Where an outline runs across the lines, what it is off by
    /// moves its reach further (√(1 + s²) times as far at the slope s), and what the equations leave out, which are linear, grows with s²: a
    /// height counts as 1 + s² times as uncertain, with the mean of s² over the directions.
    pub(super) fn incline(&mut self, along_axis: &DMatrix<f64>) {
        self.inclined = (along_axis.column_iter())
            .map(|at| 1.0 + at.iter().map(|s| s.abs().min(STEEPEST).powi(2)).sum::<f64>() / at.len() as f64)
            .collect();
    }

    pub(super) fn samples(&self) -> usize {
        self.t.len()
    }

    fn modes(&self, hyper: &Hyper) -> Option<Modes> {
        let z = &self.heights;
        let range = (z[z.len() - 1] - z[0]).max(1.0);
        let alike = |length: f64| {
            DMatrix::from_fn(z.len(), z.len(), |i, j| (-(z[i] - z[j]).abs() / (length * range)).exp())
        };
        let mut noise = alike(EDGE_ALIKE) * hyper.edge_px.powi(2);
        for i in 0..z.len() {
            noise[(i, i)] += hyper.noise_px.powi(2);
        }
        for (i, a) in self.inclined.iter().enumerate() {
            for (j, b) in self.inclined.iter().enumerate() {
                noise[(i, j)] *= a * b;
            }
        }
        let l = Cholesky::new(noise)?.l();
        let mut whitened = alike(hyper.alike);
        if !l.solve_lower_triangular_mut(&mut whitened) {
            return None;
        }
        whitened = whitened.transpose();
        if !l.solve_lower_triangular_mut(&mut whitened) {
            return None;
        }
        let eigen = SymmetricEigen::new(0.5 * (&whitened + whitened.transpose()));
        let transform = l.transpose().solve_upper_triangular(&eigen.eigenvectors)?;
        Some(Modes {
            transform,
            inverse: eigen.eigenvectors.transpose() * l.transpose(),
            values: eigen.eigenvalues.iter().map(|v| v.max(0.0)).collect(),
            log_det: 2.0 * l.diagonal().iter().map(|d| d.ln()).sum::<f64>(),
        })
    }

    /// The reaches without their noise, and their derivatives along t: `[sample, height]`.
    pub(super) fn smoothed(&self, reaches: &DMatrix<f64>, hyper: &Hyper) -> Option<[DMatrix<f64>; 2]> {
        let modes = self.modes(hyper)?;
        let n = self.samples();
        let y = reaches * &modes.transform;
        let mut weights = self.rotated(&y);
        for (m, value) in modes.values.iter().enumerate() {
            let scale = value * hyper.curvature_px.powi(2);
            for (w, variance) in weights.column_mut(m).iter_mut().zip(&self.variances) {
                *w /= scale * variance + 1.0;
            }
        }
        let weights = &self.seen * weights;
        let mut scaled = weights.clone();
        for (m, value) in modes.values.iter().enumerate() {
            scaled.column_mut(m).scale_mut(value * hyper.curvature_px.powi(2));
        }
        let smooth = y - &weights;
        // What the shape leaves is the free harmonics.
        let basis = DMatrix::from_fn(n, 3, |i, k| free(self.t[i])[k]);
        let turned = DMatrix::from_fn(n, 3, |i, k| [0.0, -self.t[i].sin(), self.t[i].cos()][k]);
        let rest = &smooth - &self.shape * &scaled;
        let along = &self.slope * scaled + turned * (basis.pseudo_inverse(DEPENDENT).ok()? * rest);
        Some([smooth * &modes.inverse, along * &modes.inverse])
    }

    /// A matrix `[sample, height]` in the combinations that the free harmonics do not reach.
    pub(super) fn rotated(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        self.seen.tr_mul(x)
    }

    /// Generalised least squares sums of the reaches `y` on the regressors `x` (all of them [`Grid::rotated`]).
    pub(super) fn sums(&self, y: &DMatrix<f64>, x: &[DMatrix<f64>], hyper: &Hyper) -> Option<Sums> {
        let modes = self.modes(hyper)?;
        let (n, p) = (self.seen.ncols(), x.len());
        let y = y * &modes.transform;
        let x: Vec<DMatrix<f64>> = x.par_iter().map(|x| x * &modes.transform).collect();
        let parts: Vec<Sums> = (0..modes.values.len())
            .into_par_iter()
            .map(|m| {
                let scale = modes.values[m] * hyper.curvature_px.powi(2);
                let variances: Vec<f64> = self.variances.iter().map(|v| scale * v + 1.0).collect();
                let mut whitened = DMatrix::zeros(n, p + 1);
                for (k, x) in x.iter().chain([&y]).enumerate() {
                    for ((w, x), v) in whitened.column_mut(k).iter_mut().zip(&x.column(m)).zip(&variances) {
                        *w = x / v.sqrt();
                    }
                }
                let all = whitened.transpose() * &whitened;
                Sums {
                    normal: all.view((0, 0), (p, p)).into_owned(),
                    right: all.view((0, p), (p, 1)).column(0).into_owned(),
                    square: all[(p, p)],
                    log_det: variances.iter().map(|v| v.ln()).sum::<f64>(),
                }
            })
            .collect();
        let log_det = self.samples() as f64 * modes.log_det;
        let zero = Sums { normal: DMatrix::zeros(p, p), right: DVector::zeros(p), square: 0.0, log_det };
        Some(parts.into_iter().fold(zero, |mut a, b| {
            a.normal += b.normal;
            a.right += b.right;
            a.square += b.square;
            a.log_det += b.log_det;
            a
        }))
    }
}

/// Sums over all samples: XᵀC⁻¹X, XᵀC⁻¹y, yᵀC⁻¹y and log |C|.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    pub normal: DMatrix<f64>,
    pub right: DVector<f64>,
    pub square: f64,
    pub log_det: f64,
}

impl Sums {
    /// Adds observations `y` of `x`ᵀ parameters with a covariance of their own; `None` where it is none.
    pub(super) fn add(&mut self, x: &DMatrix<f64>, y: &DVector<f64>, covariance: DMatrix<f64>) -> Option<()> {
        let cholesky = Cholesky::new(covariance)?;
        let weighted = cholesky.solve(x);
        self.normal += x.transpose() * &weighted;
        self.right += weighted.transpose() * y;
        self.square += y.dot(&cholesky.solve(y));
        self.log_det += 2.0 * cholesky.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hyper() -> Hyper {
        Hyper {
            curvature_px: 30.0,
            alike: 0.3,
            edge_px: 0.02,
            noise_px: 0.05,
            runout_px: 0.3,
            pedestal_px: 0.1,
        }
    }

    #[test]
    fn an_ellipse_is_predicted_from_its_neighbours_with_its_slope() {
        let n = 50;
        let t: Vec<f64> = (0..n).map(|i| f64::from(i) * std::f64::consts::TAU / f64::from(n)).collect();
        let z: Vec<f64> = (0..12).map(f64::from).collect();
        let h = |t: f64| (100f64.powi(2) * t.cos().powi(2) + 80f64.powi(2) * t.sin().powi(2)).sqrt();
        let grid = Grid::new(t.clone(), z);
        let y = DMatrix::from_fn(n as usize, 12, |i, _| h(t[i]) + 4.0 * t[i].cos());
        let [value, slope] = grid.smoothed(&y, &hyper()).unwrap();
        for i in 0..n as usize {
            let truth = (h(t[i] + 1e-5) - h(t[i] - 1e-5)) / 2e-5 - 4.0 * t[i].sin();
            assert!((value[(i, 5)] - y[(i, 5)]).abs() < 0.02);
            assert!((slope[(i, 5)] - truth).abs() < 0.3, "{i}: {} {truth}", slope[(i, 5)]);
        }
    }

    #[test]
    fn a_height_at_which_outlines_run_across_the_lines_is_followed_less() {
        let n = 50;
        let t: Vec<f64> = (0..n).map(|i| f64::from(i) * std::f64::consts::TAU / f64::from(n)).collect();
        let mut grid = Grid::new(t.clone(), (0..12).map(f64::from).collect());
        let smooth = DMatrix::from_fn(n as usize, 12, |i, _| 100.0 + 6.0 * (2.0 * t[i]).cos());
        // The sixth height is off by up to five pixels, whichever way.
        let off =
            DMatrix::from_fn(n as usize, 12, |i, k| if k == 5 { 5.0 * (7.0 * i as f64).sin() } else { 0.0 });
        let y = &smooth + &off;
        let moved = |grid: &Grid| {
            let [value, _] = grid.smoothed(&y, &hyper()).unwrap();
            (0..n as usize).map(|i| (value[(i, 5)] - smooth[(i, 5)]).abs()).fold(0.0, f64::max)
        };
        let plain = moved(&grid);
        grid.incline(&DMatrix::from_fn(n as usize, 12, |_, k| if k == 5 { -STEEPEST } else { 0.0 }));
        let inclined = moved(&grid);
        assert!(inclined < 0.4 * plain, "{inclined} {plain}");
    }

    #[test]
    fn a_shift_of_one_sample_is_found_in_all_heights() {
        let n = 40;
        let t: Vec<f64> = (0..n).map(|i| f64::from(i) * std::f64::consts::TAU / f64::from(n)).collect();
        let grid = Grid::new(t.clone(), (0..10).map(f64::from).collect());
        let y = DMatrix::from_fn(n as usize, 10, |i, j| {
            100.0 + 5.0 * (2.0 * t[i] + 0.1 * j as f64).cos() + if i == 7 { 0.8 } else { 0.0 }
        });
        let x = DMatrix::from_fn(n as usize, 10, |i, _| f64::from(i == 7));
        let s = grid.sums(&grid.rotated(&y), &[grid.rotated(&x)], &hyper()).unwrap();
        let found = s.right[0] / s.normal[(0, 0)];
        assert!((found - 0.8).abs() < 3.0 / s.normal[(0, 0)].sqrt(), "{found}");
    }

    #[test]
    fn sums_are_those_of_the_whole_covariance_with_harmonics_that_are_as_good_as_unbounded() {
        let (n, m, unbounded) = (14, 5, 1e5);
        let t: Vec<f64> = (0..n).map(|i| 0.41 * i as f64 + 0.003 * (i * i) as f64).collect();
        let z: Vec<f64> = (0..m).map(|k| 3.0 * k as f64).collect();
        let h = hyper();
        let grid = Grid::new(t.clone(), z.clone());
        let range = z[m - 1] - z[0];
        let alike = |k: usize, l: usize, length: f64| (-(z[k] - z[l]).abs() / (length * range)).exp();
        let whole = DMatrix::from_fn(n * m, n * m, |a, b| {
            let ([i, k], [j, l]) = ([a / m, a % m], [b / m, b % m]);
            let same = |x: usize, y: usize| f64::from(u8::from(x == y));
            let noise = h.edge_px.powi(2) * alike(k, l, EDGE_ALIKE) + h.noise_px.powi(2) * same(k, l);
            let unknown: f64 = free(t[i]).iter().zip(free(t[j])).map(|(a, b)| a * b).sum();
            h.curvature_px.powi(2) * grid.shape[(i, j)] * alike(k, l, h.alike)
                + unbounded * unbounded * unknown * same(k, l)
                + noise * same(i, j)
        });
        let some = |seed: f64| DMatrix::from_fn(n, m, |i, k| (seed * (1 + i * m + k) as f64).sin());
        let (y, x) = (some(1.3), [some(2.9), some(0.7)]);
        let sums = grid.sums(&grid.rotated(&y), &x.clone().map(|x| grid.rotated(&x)), &h).unwrap();
        let cholesky = Cholesky::new(whole).unwrap();
        let flat = |x: &DMatrix<f64>| DVector::from_iterator(n * m, x.transpose().iter().copied());
        let dot = |a: &DMatrix<f64>, b: &DMatrix<f64>| flat(a).dot(&cholesky.solve(&flat(b)));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-4 * b.abs().max(1.0), "{a} {b}");
        near(sums.square, dot(&y, &y));
        for i in 0..2 {
            near(sums.right[i], dot(&x[i], &y));
            near(sums.normal[(i, 1)], dot(&x[i], &x[1]));
        }
    }
}

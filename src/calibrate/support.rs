//! The grain's slices as random functions: what neighbouring views say of a view.
//!
//! The reach of a slice in the direction t is its support function h(t). With ρ = h + h″, the radius of curvature of
//! the slice's convex hull, white about its mean along t, harmonic n of h has variance σ²/(n² − 1)²; harmonics 0 and
//! 1 (size and place) are free in every slice. Slices at heights Δz apart are alike as exp(−|Δz|/ℓ). Both together
//! make a covariance that is a Kronecker product, so that in the eigenvectors of the heights' part every problem
//! falls into small ones (kriging; Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, §2.7 for
//! the free terms, §5.4 for the marginal likelihood).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SymmetricEigen};
use rayon::prelude::*;

/// Harmonics that count.
const HARMONICS: usize = 60;
/// Standard deviation of the free harmonics, pixels: as good as unbounded.
const FREE_PX: f64 = 1e4;
/// Heights over which light and blur move an edge alike, as a share of the heights' range.
const EDGE_ALIKE: f64 = 0.08;

/// What the likelihood is maximised over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hyper {
    /// Standard deviation of the curvature's harmonics, pixels.
    pub curvature_px: f64,
    /// ℓ as a share of the heights' range.
    pub alike: f64,
    /// Standard deviation of a reach, pixels: what neighbouring heights share (an edge that light or blur moved), and
    /// what they do not.
    pub edge_px: f64,
    pub noise_px: f64,
    /// Standard deviation of the views' sideways shifts, pixels.
    pub wobble_px: f64,
    /// Standard deviation of the pedestal's place in a view, pixels.
    pub pedestal_px: f64,
}

/// The directions and heights at which reaches were read.
pub(super) struct Grid {
    /// Directions t, radians.
    t: Vec<f64>,
    heights: Vec<f64>,
    /// Covariance of the shape along t for a unit σ, and its derivative along the first direction.
    shape: DMatrix<f64>,
    slope: DMatrix<f64>,
    /// Free harmonics' covariance and derivative.
    free: DMatrix<f64>,
    free_slope: DMatrix<f64>,
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
        let basis = DMatrix::from_fn(n, 3, |i, k| [1.0, t[i].cos(), t[i].sin()][k] * FREE_PX);
        let turned = DMatrix::from_fn(n, 3, |i, k| [0.0, -t[i].sin(), t[i].cos()][k] * FREE_PX);
        let (free, free_slope) = (&basis * basis.transpose(), &turned * basis.transpose());
        Self { t, heights, shape, slope, free, free_slope }
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

    /// Covariance of the reaches in one mode.
    fn covariance(&self, hyper: &Hyper, value: f64) -> DMatrix<f64> {
        let mut c = &self.shape * (value * hyper.curvature_px.powi(2)) + &self.free;
        for i in 0..c.nrows() {
            c[(i, i)] += 1.0;
        }
        c
    }

    /// The reaches without their noise, and their derivatives along t: `[sample, height]`.
    pub(super) fn smoothed(&self, reaches: &DMatrix<f64>, hyper: &Hyper) -> Option<[DMatrix<f64>; 2]> {
        let modes = self.modes(hyper)?;
        let y = reaches * &modes.transform;
        let columns: Vec<[DVector<f64>; 2]> = (0..modes.values.len())
            .into_par_iter()
            .map(|m| {
                let weights = Cholesky::new(self.covariance(hyper, modes.values[m]))?.solve(&y.column(m));
                let scale = modes.values[m] * hyper.curvature_px.powi(2);
                Some([
                    (&self.shape * scale + &self.free) * &weights,
                    (&self.slope * scale + &self.free_slope) * &weights,
                ])
            })
            .collect::<Option<_>>()?;
        let gather = |k: usize| {
            let own: Vec<DVector<f64>> = columns.iter().map(|c| c[k].clone()).collect();
            DMatrix::from_columns(&own) * &modes.inverse
        };
        Some([gather(0), gather(1)])
    }

    /// Generalised least squares sums of the reaches `y` on the regressors `x` (a matrix `[sample, height]` each).
    pub(super) fn sums(&self, y: &DMatrix<f64>, x: &[DMatrix<f64>], hyper: &Hyper) -> Option<Sums> {
        let modes = self.modes(hyper)?;
        let (n, p) = (self.samples(), x.len());
        let y = y * &modes.transform;
        let x: Vec<DMatrix<f64>> = x.par_iter().map(|x| x * &modes.transform).collect();
        let parts: Vec<Sums> = (0..modes.values.len())
            .into_par_iter()
            .map(|m| {
                let cholesky: Cholesky<f64, Dyn> = Cholesky::new(self.covariance(hyper, modes.values[m]))?;
                let l = cholesky.l();
                let mut right = DMatrix::zeros(n, p + 1);
                for (k, x) in x.iter().enumerate() {
                    right.set_column(k, &x.column(m));
                }
                right.set_column(p, &y.column(m));
                if !l.solve_lower_triangular_mut(&mut right) {
                    return None;
                }
                let all = right.transpose() * &right;
                Some(Sums {
                    normal: all.view((0, 0), (p, p)).into_owned(),
                    right: all.view((0, p), (p, 1)).column(0).into_owned(),
                    square: all[(p, p)],
                    log_det: 2.0 * l.diagonal().iter().map(|d| d.ln()).sum::<f64>(),
                })
            })
            .collect::<Option<_>>()?;
        let log_det = n as f64 * modes.log_det;
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
            wobble_px: 0.3,
            pedestal_px: 0.1,
        }
    }

    #[test]
    fn an_ellipse_is_told_from_its_neighbours_with_its_slope() {
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
    fn a_shift_of_one_sample_is_found_in_all_heights() {
        let n = 40;
        let t: Vec<f64> = (0..n).map(|i| f64::from(i) * std::f64::consts::TAU / f64::from(n)).collect();
        let grid = Grid::new(t.clone(), (0..10).map(f64::from).collect());
        let y = DMatrix::from_fn(n as usize, 10, |i, j| {
            100.0 + 5.0 * (2.0 * t[i] + 0.1 * j as f64).cos() + if i == 7 { 0.8 } else { 0.0 }
        });
        let x = DMatrix::from_fn(n as usize, 10, |i, _| f64::from(i == 7));
        let s = grid.sums(&y, &[x], &hyper()).unwrap();
        let found = s.right[0] / s.normal[(0, 0)];
        assert!((found - 0.8).abs() < 3.0 / s.normal[(0, 0)].sqrt(), "{found}");
    }
}

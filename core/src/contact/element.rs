//! One four-node tetrahedron by itself: its volume, the gradients of its shape functions, its critical time step.

use super::lanes::{Node, cofactors};
use super::laws::Moduli;
use nalgebra::{Matrix3, Matrix6};

/// Squarings of a matrix A: the trace of A²⁵⁶ bounds its largest eigenvalue to 6^(1/256), 0.7 %, from above.
const SQUARINGS: u32 = 8;

fn edge_matrix(p: &[Node; 4]) -> [f64; 9] {
    let mut out = [0.0; 9];
    for k in 0..3 {
        for i in 0..3 {
            out[3 * i + k] = p[k + 1][i] - p[0][i];
        }
    }
    out
}

/// Volume of a tetrahedron.
pub(super) fn tet_volume(p: &[Node; 4]) -> f64 {
    cofactors(&edge_matrix(p)).1 / 6.0
}

/// Gradients of the shape functions of nodes 1, 2, 3 (rows): the inverse of the edges' matrix.
pub(super) fn shape_gradients(p: &[Node; 4]) -> [f64; 9] {
    let (c, d) = cofactors(&edge_matrix(p));
    // The inverse is the transposed cofactors over the determinant.
    [c[0] / d, c[3] / d, c[6] / d, c[1] / d, c[4] / d, c[7] / d, c[2] / d, c[5] / d, c[8] / d]
}

/// The critical time step of a four-node tetrahedron by itself with a quarter of its mass at each node, s; at most 0.4 % too small.
///
/// ```text
/// Δt = 2/ω,   ω² = (4/ρ) max eig { σ → C : sym(σ G) },   G = Σ_a ∇N_a ∇N_aᵀ
/// ```
///
/// The nodal forces `−V σ ∇N_a` on masses ρV/4 make the strain rate (4/ρ) sym(σ G), which C answers with stress. The trace of
/// the map's 256th power bounds its greatest eigenvalue.
pub(super) fn critical_time_step_s(moduli: &Moduli, density_t_mm3: f64, p: &[Node; 4]) -> f64 {
    let b = shape_gradients(p);
    let mut g = Matrix3::zeros();
    let mut first = nalgebra::Vector3::zeros();
    for k in 0..3 {
        let row = nalgebra::Vector3::new(b[3 * k], b[3 * k + 1], b[3 * k + 2]);
        g += row * row.transpose();
        first -= row;
    }
    g += first * first.transpose();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // Mandel's basis of symmetric matrices: orthonormal under the product a : b.
    let basis: [Matrix3<f64>; 6] = [[0, 0], [1, 1], [2, 2], [1, 2], [0, 2], [0, 1]].map(|[i, j]| {
        let mut m = Matrix3::zeros();
        if i == j {
            m[(i, i)] = 1.0;
        } else {
            m[(i, j)] = half;
            m[(j, i)] = half;
        }
        m
    });
    let mut a = Matrix6::zeros();
    for (column, sigma) in basis.iter().enumerate() {
        let strain = 0.5 * (sigma * g + g * sigma);
        let stress = 2.0 * moduli.shear * strain + Matrix3::identity() * (moduli.lambda * strain.trace());
        for (row, e) in basis.iter().enumerate() {
            a[(row, column)] = e.dot(&stress);
        }
    }
    let mut log = 0.0;
    for n in 0..SQUARINGS {
        let size = a.amax();
        a /= size;
        log += size.ln() / f64::from(1u32 << n);
        a *= a;
    }
    let largest = (log + a.trace().ln() / f64::from(1u32 << SQUARINGS)).exp();
    debug_assert!(tet_volume(p) > 0.0);
    2.0 / (4.0 / density_t_mm3 * largest).sqrt()
}

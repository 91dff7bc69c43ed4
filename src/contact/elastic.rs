//! The elastic element: Hooke's law between the stress and the stretch that is left when the rotation is taken out.
//!
//! With F = R U the energy per volume is μ |U − I|² + λ/2 (tr U − 3)², the stress (first Piola–Kirchhoff)
//! P = 2μ (F − R) + λ (tr U − 3) R. It is Hooke's law for small stretches, whatever the rotation; being total it neither
//! drifts nor remembers a path, and unlike the law of St. Venant and Kirchhoff it does not soften in compression, which
//! under a contact of 20 % strain matters: in one direction its nominal stress is just proportional to the stretch.

use super::Material;
use super::lanes::{Batch, Lane, Node, W, edges, gradients, pick, put, rotations, scatter, sum};

/// Lamé's parameters, MPa.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moduli {
    pub lambda: f64,
    pub shear: f64,
}

impl From<&Material> for Moduli {
    fn from(material: &Material) -> Self {
        Self { lambda: material.lambda_mpa(), shear: material.shear_mpa() }
    }
}

/// What a batch says beside its forces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Said {
    /// Volume over that in the mesh.
    pub volume_ratio: Lane,
    /// What bulk viscosity took, N·mm.
    pub viscous_n_mm: f64,
}

/// Adds the forces of a batch. With `VISCOUS` the change of the volume since `before` over `step_s` is resisted, and
/// `before` becomes what is now.
#[inline(always)]
pub(super) fn forces<const VISCOUS: bool>(
    moduli: &Moduli,
    batch: &Batch,
    places: &[Node],
    before: &mut Lane,
    step_s: f64,
    out: &mut [Node],
) -> Said {
    let f = gradients(batch, &edges(batch, places));
    let (r, cofactor, determinant) = rotations(&f);
    let mut stress = [[0.0; W]; 9];
    let mut viscous = [0.0; W];
    for l in 0..W {
        let (fm, rm) = (pick(&f, l), pick(&r, l));
        let mut trace = 0.0;
        for k in 0..9 {
            trace += fm[k] * rm[k];
        }
        let spherical = moduli.lambda * (trace - 3.0);
        let mut p = [0.0; 9];
        for k in 0..9 {
            p[k] = 2.0 * moduli.shear * (fm[k] - rm[k]) + spherical * rm[k];
        }
        if VISCOUS {
            let grown = determinant[l] - before[l];
            let q = batch.viscosity[l] * grown / (step_s * determinant[l]);
            let c = pick(&cofactor, l);
            for k in 0..9 {
                p[k] += q * c[k];
            }
            viscous[l] = q * grown * batch.volume[l];
            before[l] = determinant[l];
        }
        put(&mut stress, l, &p);
    }
    scatter(batch, &stress, out);
    Said { volume_ratio: determinant, viscous_n_mm: if VISCOUS { sum(&viscous) } else { 0.0 } }
}

/// The energy stored in a batch, N·mm.
pub(super) fn energy(moduli: &Moduli, batch: &Batch, places: &[Node]) -> f64 {
    let f = gradients(batch, &edges(batch, places));
    let (r, _, _) = rotations(&f);
    let mut stored = [0.0; W];
    for l in 0..W {
        let (mut trace, mut square) = (0.0, 0.0);
        for k in 0..9 {
            trace += f[k][l] * r[k][l];
            // |F − R| = |U − I|
            square += (f[k][l] - r[k][l]).powi(2);
        }
        stored[l] = batch.volume[l] * (moduli.shear * square + 0.5 * moduli.lambda * (trace - 3.0).powi(2));
    }
    sum(&stored)
}

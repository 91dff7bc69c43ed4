//! The elastic–plastic element: J2 flow by radial return, with the pressure of the nodes.
//!
//! ```text
//! Δε  = sym(ΔF F_½⁻¹),  ΔF = 2 (F − F_½)            strain increment about the half-step configuration F_½
//! s*  = s + 2μ dev(Rᵀ Δε R)                         trial stress in the element's frame, F = R U
//! σ*  = √(3/2 s* : s*),  f = σ* − (Y + H ε̄)         von Mises' yield function
//! Δε̄  = max(0, f/(3μ + H))                          plastic strain increment
//! s   = (1 − 3μ Δε̄/σ*) s*,   ε̄ ← ε̄ + Δε̄            radial return
//! W_p = V J Δε̄ (Y + H ε̄ + ½ H Δε̄)                   dissipated; ε̄ before the step
//!
//! J_a = Σ_e ¼ V_e J_e / V_a,   p_a = κ ln J_a/J_a    nodal pressure (tension positive)
//! σ   = R s Rᵀ + (¼ Σ_a p_a + q) 1,   P = σ cof F    q as in the elastic element
//! ```
//!
//! Source of the radial return: Wilkins, Calculation of elastic-plastic flow, Methods Comput. Phys. 3, 1964.
//!
//! The deviatoric stress is carried in the element's own frame, turned by R of F = R U (Green and Naghdi's rate), and grows
//! with the strain of the step at its middle, from which a rotation of any size makes none. The pressure is not the element's
//! own: each node has one, κ ln J/J of the volume of the elements around it, and an element takes the mean of its four (Bonet
//! and Burton, Commun. Numer. Meth. Engng 14, 437, 1998; LS-DYNA's element 13). A four-node tetrahedron has about five
//! constraints of constant volume for each node, which has three freedoms, so it locks in plastic flow; a constraint for each
//! node does not. The nodal forces are the derivative of the energy Σ V κ/2 (ln J)² of the nodes, so energy is kept.

use super::Material;
use super::elastic::BatchOutput;
use super::lanes::{
    Batch, Lane, Node, W, cofactors, edges, gradients, pick, put, rotations, scatter, sum, times,
    times_transposed, transposed_times,
};

/// The history variables of eight plastic elements.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct HistoryVariables {
    /// Deviatoric stress in the element's frame, xx, yy, zz, yz, xz, xy, MPa.
    pub deviator: [Lane; 6],
    /// Equivalent plastic strain.
    pub strain: Lane,
}

/// Parameters of the elastic–plastic law, MPa.
#[derive(Debug, Clone, Copy)]
pub(super) struct Law {
    pub shear: f64,
    pub bulk: f64,
    pub yield_stress: f64,
    pub hardening: f64,
}

impl Law {
    /// None for a material that does not yield.
    pub(super) fn of(material: &Material) -> Option<Self> {
        Some(Self {
            shear: material.shear_mpa(),
            bulk: material.bulk_mpa(),
            yield_stress: material.yield_mpa?,
            hardening: material.hardening_mpa,
        })
    }
}

/// Adds a quarter of each element's volume to its nodes.
#[inline(always)]
pub(super) fn volumes(batch: &Batch, positions: &[Node], out: &mut [f64]) {
    let f = gradients(batch, &edges(batch, positions));
    let mut quarter = [0.0; W];
    for l in 0..W {
        quarter[l] = 0.25 * batch.volume[l] * cofactors(&pick(&f, l)).1;
    }
    for l in 0..W {
        for k in 0..4 {
            out[batch.nodes[k][l] as usize] += quarter[l];
        }
    }
}

/// The half-step configuration: where the strain increment of the step that led here is taken.
pub(super) struct HalfStep<'a> {
    /// The nodes' positions half a step ago, mm.
    pub positions: &'a [Node],
    /// The step, s.
    pub step_s: f64,
}

/// Adds the forces of a batch after its stress has followed the step; also what plastic flow took, N·mm.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub(super) fn forces(
    law: &Law,
    batch: &Batch,
    positions: &[Node],
    half_step: &HalfStep,
    pressure: &[f64],
    before: &mut Lane,
    history: &mut HistoryVariables,
    out: &mut [Node],
) -> (BatchOutput, f64) {
    let f = gradients(batch, &edges(batch, positions));
    let middle = gradients(batch, &edges(batch, half_step.positions));
    let (r, cofactor, determinant) = rotations(&f);
    let mut mean = [0.0; W];
    for l in 0..W {
        let of = |k: usize| pressure[batch.nodes[k][l] as usize];
        mean[l] = 0.25 * (of(0) + of(1) + of(2) + of(3));
    }
    let mut stress = [[0.0; W]; 9];
    let (mut viscous, mut flowed) = ([0.0; W], [0.0; W]);
    for l in 0..W {
        let (fm, mm, rm) = (pick(&f, l), pick(&middle, l), pick(&r, l));
        let mut step = [0.0; 9];
        for k in 0..9 {
            step[k] = 2.0 * (fm[k] - mm[k]);
        }
        let (c, d) = cofactors(&mm);
        let mut strain = times_transposed(&step, &c);
        for k in 0..9 {
            strain[k] /= d;
        }
        for (i, j) in [(1, 3), (2, 6), (5, 7)] {
            let both = 0.5 * (strain[i] + strain[j]);
            strain[i] = both;
            strain[j] = both;
        }
        let e = times(&transposed_times(&rm, &strain), &rm);
        let third = (e[0] + e[4] + e[8]) / 3.0;
        let grow = [e[0] - third, e[4] - third, e[8] - third, e[5], e[2], e[1]];
        let mut s = [0.0; 6];
        for k in 0..6 {
            s[k] = history.deviator[k][l] + 2.0 * law.shear * grow[k];
        }
        let square =
            s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + 2.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]);
        let mises = (1.5 * square).sqrt();
        let limit = law.yield_stress + law.hardening * history.strain[l];
        let flow = ((mises - limit) / (3.0 * law.shear + law.hardening)).max(0.0);
        let keep = if flow > 0.0 { 1.0 - 3.0 * law.shear * flow / mises } else { 1.0 };
        for k in 0..6 {
            s[k] *= keep;
            history.deviator[k][l] = s[k];
        }
        history.strain[l] += flow;
        flowed[l] = batch.volume[l] * determinant[l] * flow * (limit + 0.5 * law.hardening * flow);
        let turned =
            times_transposed(&times(&rm, &[s[0], s[5], s[4], s[5], s[1], s[3], s[4], s[3], s[2]]), &rm);
        let grown = determinant[l] - before[l];
        let q = batch.viscosity[l] * grown / (half_step.step_s * determinant[l]);
        before[l] = determinant[l];
        viscous[l] = q * grown * batch.volume[l];
        let mut cauchy = turned;
        for k in [0, 4, 8] {
            cauchy[k] += mean[l] + q;
        }
        put(&mut stress, l, &times(&cauchy, &pick(&cofactor, l)));
    }
    scatter(batch, &stress, out);
    (BatchOutput { volume_ratio: determinant, viscous_n_mm: sum(&viscous) }, sum(&flowed))
}

/// Adds a batch's elastic response to small displacements from these positions, as if it did not flow: what the stable
/// step of a body hangs on whose elements have flowed into another shape.
#[inline(always)]
pub(super) fn elastic_response(
    law: &Law,
    batch: &Batch,
    positions: &[Node],
    displacements: &[Node],
    out: &mut [Node],
) {
    let f = gradients(batch, &edges(batch, positions));
    let moved = gradients(batch, &edges(batch, displacements));
    let lambda = law.bulk - 2.0 / 3.0 * law.shear;
    let mut stress = [[0.0; W]; 9];
    for l in 0..W {
        let (c, d) = cofactors(&pick(&f, l));
        let grown = times_transposed(&pick(&moved, l), &c).map(|g| g / d);
        let spherical = lambda * (grown[0] + grown[4] + grown[8]);
        let mut s = [0.0; 9];
        for i in 0..3 {
            for j in 0..3 {
                s[3 * i + j] = law.shear * (grown[3 * i + j] + grown[3 * j + i]);
            }
            s[4 * i] += spherical;
        }
        put(&mut stress, l, &times(&s, &c));
    }
    scatter(batch, &stress, out);
}

/// The energy that the deviatoric stresses of a batch store, N·mm.
pub(super) fn energy(law: &Law, batch: &Batch, history: &HistoryVariables, volume_ratio: &Lane) -> f64 {
    (0..W)
        .map(|l| {
            let s = history.deviator.map(|s| s[l]);
            let square =
                s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + 2.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]);
            batch.volume[l] * volume_ratio[l] * square / (4.0 * law.shear)
        })
        .sum()
}

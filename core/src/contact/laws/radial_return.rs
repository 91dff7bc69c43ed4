//! The elastic–plastic element: flow by radial return, with the pressure of the nodes. What it flows at is a [`YieldStress`].
//!
//! ```text
//! Δε  = sym(ΔF F_½⁻¹),  ΔF = 2 (F − F_½)            strain increment about the half-step configuration F_½
//! s*  = s + 2μ dev(Rᵀ Δε R)                         trial stress in the element's frame, F = R U
//! σ*  = √(3/2 s* : s*),  f = σ* − Y(ε̄, p)           von Mises' yield function
//! Δε̄  = max(0, f/(3μ + H))                          plastic strain increment
//! s   = (1 − 3μ Δε̄/σ*) s*,   ε̄ ← ε̄ + Δε̄            radial return
//! W_p = V J Δε̄ (Y + ½ H Δε̄)                          dissipated; Y before the step, its slope H = ∂Y/∂ε̄
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

use super::{ChunkOutput, ChunkState, ChunkStep, MaterialLaw, Moduli, Program};
use crate::contact::Material;
use crate::contact::body::Chunk;
use crate::contact::instructions::{Instructions, Kernel};
use crate::contact::lanes::{
    Batch, GROUP, Lane, Local, Matrices, Matrix, W, cofactors, edges, gradients, nodal_forces, pick, put,
    rotations, scatter, sum, times, times_transposed, transposed_times,
};
use std::fmt::Debug;

/// History variables of a batch: the deviatoric stress in the element's frame (xx, yy, zz, yz, xz, xy, MPa), and the equivalent
/// plastic strain.
const HISTORY: usize = 7;
const STRAIN: usize = 6;

/// The yield stress against von Mises' equivalent stress.
pub(super) trait YieldStress: Debug + Send + Sync {
    /// At an equivalent plastic strain and a mean stress (tension positive, MPa), MPa; not negative.
    fn limit_mpa(&self, strain: f64, mean_mpa: f64) -> f64;

    /// Its slope against the equivalent plastic strain, the same everywhere, MPa.
    fn hardening_mpa(&self) -> f64;

    /// The lines of a deck's material that say when it yields; none where the program has no such law.
    fn deck(&self, program: Program) -> Option<String>;
}

/// Elastic, and then plastic from a yield stress on.
#[derive(Debug)]
pub(super) struct Plastic<Y> {
    stiffest: Moduli,
    young_mpa: f64,
    poisson: f64,
    shear: f64,
    bulk: f64,
    yield_stress: Y,
}

impl<Y: YieldStress> Plastic<Y> {
    pub(super) fn new(material: &Material, yield_stress: Y) -> Self {
        Self {
            stiffest: material.into(),
            young_mpa: material.young_mpa,
            poisson: material.poisson,
            shear: material.shear_mpa(),
            bulk: material.bulk_mpa(),
            yield_stress,
        }
    }
}

impl<Y: YieldStress> MaterialLaw for Plastic<Y> {
    fn stiffest(&self) -> Moduli {
        self.stiffest
    }

    fn history_lanes(&self) -> usize {
        HISTORY
    }

    fn nodal_bulk_mpa(&self) -> Option<f64> {
        Some(self.bulk)
    }

    fn step(&self, at: &ChunkStep, state: &mut ChunkState, forces: &mut Local) -> ChunkOutput {
        at.instructions.run(Step { law: self, at, state, forces })
    }

    fn response(
        &self,
        instructions: Instructions,
        chunk: &Chunk,
        positions: &Local,
        displacements: &Local,
        forces: &mut Local,
    ) {
        instructions.run(Response { law: self, chunk, positions, displacements, forces });
    }

    fn stored_n_mm(&self, chunk: &Chunk, _positions: &Local, state: &ChunkState) -> f64 {
        let (histories, _) = state.history.as_chunks::<HISTORY>();
        (chunk.batches.iter().zip(histories).zip(&state.volume_ratio))
            .map(|((batch, history), ratio)| energy(self.shear, batch, history, ratio))
            .sum()
    }

    fn cauchy_mpa(&self, _f: &Matrix, r: &Matrix, pressure: f64, history: &[Lane], lane: usize) -> Matrix {
        let [s0, s1, s2, s3, s4, s5] = [0, 1, 2, 3, 4, 5].map(|k| history[k][lane]);
        let mut turned = times_transposed(&times(r, &[s0, s5, s4, s5, s1, s3, s4, s3, s2]), r);
        for k in [0, 4, 8] {
            turned[k] += pressure;
        }
        turned
    }

    fn plastic_strain(&self, history: &[Lane], lane: usize) -> f64 {
        history[STRAIN][lane]
    }

    fn deck(&self, program: Program) -> Option<String> {
        let yields = self.yield_stress.deck(program)?;
        Some(format!("*ELASTIC\n{}, {}\n{yields}", self.young_mpa, self.poisson))
    }
}

/// A step of a chunk.
struct Step<'a, Y> {
    law: &'a Plastic<Y>,
    at: &'a ChunkStep<'a>,
    state: &'a mut ChunkState,
    forces: &'a mut Local,
}

impl<Y: YieldStress> Kernel for Step<'_, Y> {
    type Output = ChunkOutput;

    #[inline(always)]
    fn run(self) -> ChunkOutput {
        let Self { law, at, state, forces } = self;
        let mut output = ChunkOutput::default();
        let (histories, _) = state.history.as_chunks_mut::<HISTORY>();
        let mut work = Work::default();
        let groups = at.chunk.batches.chunks(GROUP).zip(state.volume_ratio.chunks_mut(GROUP));
        for (g, ((group, before), histories)) in groups.zip(histories.chunks_mut(GROUP)).enumerate() {
            let [viscous, plastic] = add_forces(law, group, at, before, histories, &mut work, forces);
            output.viscous += viscous;
            output.plastic += plastic;
            for (b, ratio) in before.iter().enumerate() {
                output.check_volumes(ratio, at.chunk.first + (g * GROUP + b) * W);
            }
        }
        output
    }
}

/// The elastic answer of a chunk to small displacements.
struct Response<'a, Y> {
    law: &'a Plastic<Y>,
    chunk: &'a Chunk,
    positions: &'a Local,
    displacements: &'a Local,
    forces: &'a mut Local,
}

impl<Y: YieldStress> Kernel for Response<'_, Y> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { law, chunk, positions, displacements, forces } = self;
        let lambda = law.bulk - 2.0 / 3.0 * law.shear;
        for batch in &chunk.batches {
            elastic_response(lambda, law.shear, batch, positions, displacements, forces);
        }
    }
}

/// What the passes over a group of batches hand on.
#[derive(Default)]
struct Work {
    /// Edges, then deformation gradients, then nodal forces.
    matrices: [Matrices; GROUP],
    /// Edges half a step ago.
    middle: [Matrices; GROUP],
    rotations: [Matrices; GROUP],
    /// Means of the nodes' pressures, MPa.
    mean: [Lane; GROUP],
}

/// Adds the forces of a group of batches after their stresses have followed the step; what bulk viscosity and plastic flow took,
/// N·mm.
#[inline(always)]
fn add_forces<Y: YieldStress>(
    law: &Plastic<Y>,
    group: &[Batch],
    at: &ChunkStep,
    before: &mut [Lane],
    histories: &mut [[Lane; HISTORY]],
    work: &mut Work,
    forces: &mut Local,
) -> [f64; 2] {
    let Work { matrices, middle, rotations: r, mean } = work;
    for (b, batch) in group.iter().enumerate() {
        matrices[b] = edges(batch, at.positions);
        middle[b] = edges(batch, at.half_positions);
        for l in 0..W {
            let of = |k: usize| at.pressures[batch.nodes[k][l] as usize];
            mean[b][l] = 0.25 * (of(0) + of(1) + of(2) + of(3));
        }
    }
    for (batch, f) in group.iter().zip(&mut *matrices) {
        *f = gradients(batch, f);
    }
    rotations(&matrices[..group.len()], &mut r[..group.len()]);
    let mut taken = [0.0; 2];
    for (b, (batch, history)) in group.iter().zip(histories).enumerate() {
        let middle = gradients(batch, &middle[b]);
        let (stress, of_batch) = stresses(
            law,
            batch,
            [&matrices[b], &middle, &r[b]],
            &mean[b],
            at.step_s,
            &mut before[b],
            history,
        );
        matrices[b] = nodal_forces(batch, &stress);
        taken[0] += of_batch[0];
        taken[1] += of_batch[1];
    }
    for (batch, of) in group.iter().zip(&*matrices) {
        scatter(batch, of, forces);
    }
    taken
}

/// First Piola–Kirchhoff stresses of a batch with deformation gradients F now and half a step ago and rotations; what viscosity and
/// flow took, N·mm.
#[inline(always)]
fn stresses<Y: YieldStress>(
    law: &Plastic<Y>,
    batch: &Batch,
    [f, middle, r]: [&Matrices; 3],
    mean: &Lane,
    step_s: f64,
    before: &mut Lane,
    history: &mut [Lane; HISTORY],
) -> (Matrices, [f64; 2]) {
    let hardening = law.yield_stress.hardening_mpa();
    let softness = 1.0 / (3.0 * law.shear + hardening);
    let mut determinant = [0.0; W];
    let mut stress = [[0.0; W]; 9];
    let (mut viscous, mut flowed) = ([0.0; W], [0.0; W]);
    for l in 0..W {
        let (fm, mm, rm) = (pick(f, l), pick(middle, l), pick(r, l));
        let (cofactor, determinant_now) = cofactors(&fm);
        determinant[l] = determinant_now;
        let mut step = [0.0; 9];
        for k in 0..9 {
            step[k] = 2.0 * (fm[k] - mm[k]);
        }
        let (c, d) = cofactors(&mm);
        let mut strain = times_transposed(&step, &c);
        let share = 1.0 / d;
        for k in 0..9 {
            strain[k] *= share;
        }
        for (i, j) in [(1, 3), (2, 6), (5, 7)] {
            let both = 0.5 * (strain[i] + strain[j]);
            strain[i] = both;
            strain[j] = both;
        }
        let e = times(&transposed_times(&rm, &strain), &rm);
        let third = (e[0] + e[4] + e[8]) * (1.0 / 3.0);
        let grow = [e[0] - third, e[4] - third, e[8] - third, e[5], e[2], e[1]];
        let mut s = [0.0; 6];
        for k in 0..6 {
            s[k] = history[k][l] + 2.0 * law.shear * grow[k];
        }
        let square =
            s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + 2.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]);
        let mises = (1.5 * square).sqrt();
        let limit = law.yield_stress.limit_mpa(history[STRAIN][l], mean[l]);
        let flow = ((mises - limit) * softness).max(0.0);
        let keep = if flow > 0.0 { 1.0 - 3.0 * law.shear * flow / mises } else { 1.0 };
        for k in 0..6 {
            s[k] *= keep;
            history[k][l] = s[k];
        }
        history[STRAIN][l] += flow;
        flowed[l] = batch.volume[l] * determinant[l] * flow * (limit + 0.5 * hardening * flow);
        let turned =
            times_transposed(&times(&rm, &[s[0], s[5], s[4], s[5], s[1], s[3], s[4], s[3], s[2]]), &rm);
        let grown = determinant[l] - before[l];
        let q = batch.viscosity[l] * grown / (step_s * determinant[l]);
        before[l] = determinant[l];
        viscous[l] = q * grown * batch.volume[l];
        let mut cauchy = turned;
        for k in [0, 4, 8] {
            cauchy[k] += mean[l] + q;
        }
        put(&mut stress, l, &times(&cauchy, &cofactor));
    }
    (stress, [sum(&viscous), sum(&flowed)])
}

/// Adds a batch's elastic response to small displacements from these positions, as if it did not flow: what the stable
/// step of a body hangs on whose elements have flowed into another shape.
#[inline(always)]
fn elastic_response(
    lambda: f64,
    shear: f64,
    batch: &Batch,
    positions: &Local,
    displacements: &Local,
    out: &mut Local,
) {
    let f = gradients(batch, &edges(batch, positions));
    let moved = gradients(batch, &edges(batch, displacements));
    let mut stress = [[0.0; W]; 9];
    for l in 0..W {
        let (c, d) = cofactors(&pick(&f, l));
        let grown = times_transposed(&pick(&moved, l), &c).map(|g| g / d);
        let spherical = lambda * (grown[0] + grown[4] + grown[8]);
        let mut s = [0.0; 9];
        for i in 0..3 {
            for j in 0..3 {
                s[3 * i + j] = shear * (grown[3 * i + j] + grown[3 * j + i]);
            }
            s[4 * i] += spherical;
        }
        put(&mut stress, l, &times(&s, &c));
    }
    scatter(batch, &nodal_forces(batch, &stress), out);
}

/// The energy that the deviatoric stresses of a batch store, N·mm.
fn energy(shear: f64, batch: &Batch, history: &[Lane; HISTORY], volume_ratio: &Lane) -> f64 {
    (0..W)
        .map(|l| {
            let s = [0, 1, 2, 3, 4, 5].map(|k| history[k][l]);
            let square =
                s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + 2.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]);
            batch.volume[l] * volume_ratio[l] * square / (4.0 * shear)
        })
        .sum()
}
